"""How far candidates are fitted, and which further ones follow from them."""

from types import SimpleNamespace

import numpy as np
import pytest

from frf_ipz.diagnosis.deadline import NO_LIMIT
from frf_ipz.diagnosis.nonlinear.fitting import candidates
from frf_ipz.diagnosis.nonlinear.fitting.alternating_fit import LawFit
from frf_ipz.diagnosis.nonlinear.fitting.force_localisation import ForceLocalisation

LOCATIONS = tuple(range(10))


def fit_of(cost, *, converged):
    return SimpleNamespace(cost=cost, converged=converged, n_rows=100)


def law_at(location, cost):
    law = SimpleNamespace(name="cubic")
    return SimpleNamespace(law=law, location=location, cost=cost, n_rows=100, strength=1.0, converged=True)


def test_the_best_law_is_fitted_until_it_converges():
    def fit_further(fit, _):
        return fit_of(fit.cost - 1, converged=fit.cost < 9)

    fits = [fit_of(20.0, converged=False), fit_of(10.0, converged=False)]
    candidates._converge_best(SimpleNamespace(fit_output_error=fit_further), fits)
    assert [(fit.cost, fit.converged) for fit in fits] == [(20.0, False), (7.0, True)]


@pytest.mark.parametrize(("cost", "expected"), [(500.0, 60.0), (90.0, 90.0), (110.0, 60.0), (50.0, 50.0)])
def test_a_law_with_a_large_misfit_is_fitted_afresh(cost, expected):
    fits = [fit_of(cost, converged=True)]
    problem = SimpleNamespace(fit_output_error_afresh=lambda *_: fit_of(60.0, converged=True))
    candidates._converge_best(problem, fits)
    assert fits[0].cost == expected


@pytest.mark.parametrize(("shapes", "strength"), [((0.5, 0.0), 54.0), ((1e-9, 1.0), 2.0), ((-0.5, 0.0), 54.0)])
def test_a_law_is_scaled_by_the_motion_of_a_location_that_moves_alike(monkeypatch, shapes, strength):
    """A cubic spring of 2 at a location of shapes (1, 0); the other moves a third as much, whatever its shapes say."""
    points = SimpleNamespace(shapes=np.array([(1.0, 0.0), shapes]))
    nuisance_prior = SimpleNamespace(
        modal_model=SimpleNamespace(at_locations=points), without_location=lambda nuisance: nuisance
    )
    empty = dict.fromkeys(("nuisance", "estimate_covariance", "motion", "velocity", "force", "misfit"), np.zeros(0))
    law = SimpleNamespace(degree=3)
    fit = LawFit(law=law, location=0, strength=2.0, shape=6.0, cost=1.0, n_rows=1, **empty)
    monkeypatch.setattr(candidates, "_motion_size", lambda _, fit: (3.0, 1.0)[fit.location])
    problem = SimpleNamespace(linear=SimpleNamespace(nuisance_prior=nuisance_prior))
    moved = candidates._move_law(problem, fit, 1)
    assert moved.location == 1
    assert (moved.strength, moved.shape) == pytest.approx((strength, 6.0 if strength == 2 else 2.0))


@pytest.mark.parametrize(("location", "best"), [(3, 3), (9, 9), (4, 7)])
def test_the_parameters_of_the_best_location_are_tried_at_the_next_best_and_its_neighbours(monkeypatch, location, best):
    """A law leaves 10 at location 7, 15 at 3 and 50 at 4 and 9, each from its own start; 6 from better parameters."""
    law = SimpleNamespace(name="friction")
    costs = {7: 10.0, 3: 15.0, 4: 50.0, 9: 50.0}
    fits = [
        SimpleNamespace(law=law, location=fitted, cost=cost, strength=1.0, n_rows=100) for fitted, cost in costs.items()
    ]
    costs[location] = 6.0
    monkeypatch.setattr(
        candidates, "_move_law", lambda _, fit, location: SimpleNamespace(law=fit.law, location=location)
    )
    problem = SimpleNamespace(
        neighbours_of=lambda _: [9],
        fit_output_error=lambda fit, _: SimpleNamespace(
            law=law, location=fit.location, cost=costs[fit.location], strength=1.0, converged=True
        ),
    )
    if location == 9:
        assert not candidates._exchange_locations(problem, list(fits), {}, neighbours=False)
    assert candidates._exchange_locations(problem, fits, {}, neighbours=True) == (best != 7)
    assert fits[0].location == best
    assert len(fits) == 4  # each location once


def test_no_location_is_tried_twice_with_the_same_parameters():
    law = SimpleNamespace(name="friction")
    best, other = (
        SimpleNamespace(law=law, location=at, cost=cost, strength=1.0, n_rows=100)
        for at, cost in ((7, 10.0), (3, 15.0))
    )
    problem = SimpleNamespace(neighbours_of=lambda _: [3, 9])  # it fits nothing
    moved_from = {("friction", 3): best, ("friction", 9): best}
    assert not candidates._exchange_locations(problem, [best, other], moved_from, neighbours=True)


def test_fits_that_come_close_to_the_best_converge_before_they_are_compared(monkeypatch):
    """Further steps take 20 off; the second one is 10 from the best, the third 50."""
    fits = [fit_of(100.0, converged=True), fit_of(110.0, converged=False), fit_of(150.0, converged=False)]
    monkeypatch.setattr(candidates, "_first_of_each", list)
    monkeypatch.setattr(candidates, "_simulate", lambda _, fits, **__: list(fits))
    monkeypatch.setattr(candidates, "_search_neighbours", lambda *_: None)
    monkeypatch.setattr(candidates, "_exchange_locations", lambda *_, **__: False)
    problem = SimpleNamespace(
        fit_output_error=lambda fit, _: fit_of(fit.cost - 20, converged=True),
        fit_output_error_afresh=lambda fit, _: fit_of(fit.cost, converged=True),
    )
    assert [fit.cost for fit in candidates._finish(problem, fits)] == [90.0, 100.0, 150.0]


@pytest.mark.parametrize(("ratio", "neighbours"), [(0.5, True), (0.999, False)])
def test_neighbours_are_fitted_again_if_the_cost_fell(monkeypatch, ratio, neighbours):
    calls = []
    monkeypatch.setattr(candidates, "_simulate", lambda _, fits, **__: list(fits))
    monkeypatch.setattr(candidates, "_search_neighbours", lambda *_: None)
    monkeypatch.setattr(candidates, "_converge_best", lambda _, fits: fits.append(law_at(7, ratio * fits[0].cost)))
    monkeypatch.setattr(
        candidates, "_exchange_locations", lambda *_, neighbours: calls.append(neighbours) or len(calls) == 1
    )
    candidates._finish(None, [law_at(7, 100.0)])
    assert calls == [neighbours, True]  # a better location has neighbours of its own


@pytest.mark.parametrize(
    ("by_short", "by_first", "expected"),
    [(300.0, 150.0, [7, 3]), (300.0, 299.0, [3]), (60.0, 80.0, [7, 3]), (0.5, 0.2, [3]), (300.0, 99.0, [3])],
)
def test_first_moments_lead_to_a_law_where_short_segments_do_not(monkeypatch, by_short, by_first, expected):
    """A linear model leaves 100 of the first moments, the law at location 7 leaves 10, or 90 in the last case."""
    localisation = ForceLocalisation(possible=LOCATIONS, equivalent=LOCATIONS)
    problems = {
        name: SimpleNamespace(
            name=name, linear=SimpleNamespace(cost=100.0), localisation=localisation, deadline=NO_LIMIT
        )
        for name in ("first", "short", "long")
    }
    costs = {
        ("first", 7): 90.0 if by_first == 99.0 else 10.0,
        ("short", 7): by_first,
        ("short", 3): by_short,
        ("long", 7): 50.0,
    }
    costs["long", 3] = 400.0 if by_short > 1 else 90.0
    monkeypatch.setattr(
        candidates, "_fit_scored", lambda problem, _: [law_at(7 if problem.name == "first" else 3, 1.0)]
    )
    monkeypatch.setattr(
        candidates,
        "_simulate",
        lambda problem, fits, **_: [law_at(fit.location, costs[problem.name, fit.location]) for fit in fits],
    )
    monkeypatch.setattr(candidates, "_of_law", lambda law, fits: [fit for fit in fits if fit.law.name == law])
    monkeypatch.setattr(candidates, "_first_of_each", lambda fits: list({fit.location: fit for fit in fits}.values()))
    monkeypatch.setattr(candidates, "_search_neighbours", lambda *_: None)
    monkeypatch.setattr(candidates, "_converge_best", lambda *_: None)
    monkeypatch.setattr(candidates, "_exchange_locations", lambda *_, **__: False)
    fits = candidates.find_candidates(problems["short"], problems["long"], ["cubic"], first=lambda: problems["first"])
    assert [fit.location for fit in fits] == expected


def test_a_law_that_was_fitted_is_not_fitted_again():
    law = SimpleNamespace(name="cubic")
    fits = [SimpleNamespace(law=law, location=location) for location in (3, 7, 8)]
    assert candidates._not_yet_fitted(fits, fits[:1]) == []
    assert candidates._not_yet_fitted(fits, fits[1:2]) == [fits[0], fits[2]]
