"""Localisation of a force of unknown law, by the sensors alone."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from frf_ipz.diagnosis.nonlinear.channel_noise import read_noise
from frf_ipz.diagnosis.nonlinear.fitting import candidates, force_localisation
from frf_ipz.diagnosis.nonlinear.fitting.alternating_fit import LawStart
from frf_ipz.diagnosis.nonlinear.fitting.force_localisation import (
    fit_free_force,
    localise_force,
    neighbours,
    start_from_force,
)
from frf_ipz.diagnosis.nonlinear.fitting.linear_fit import fit_linear
from frf_ipz.diagnosis.nonlinear.fitting.output_error_fit import fit_output_error
from frf_ipz.diagnosis.nonlinear.fitting.problem import LawFitProblem
from frf_ipz.diagnosis.nonlinear.laws.cubic_stiffness import CubicStiffness
from frf_ipz.diagnosis.nonlinear.laws.gap_contact import GapContact
from frf_ipz.diagnosis.nonlinear.model.modal_model import make_modal_model
from frf_ipz.diagnosis.nonlinear.model.nuisance_prior import make_nuisance_prior
from frf_ipz.diagnosis.nonlinear.segments import SegmentWindow, cut_segments
from frf_ipz.diagnosis.options import DiagnoseOptions

LAWS = {
    "cubic": (lambda w, _: 2e10 * w**3, (0, 0, 1, 0), {"nodes": [3]}),
    "gap": (lambda w, _: 3e4 * max(w - 2e-4, 0.0), (0, 0, 0, 1), {"nodes": [4]}),
    "outside the catalogue": (lambda w, v: 3e7 * w * abs(w) + 5.0 * v * abs(v), (0, -1, 1, 0), {"springs": ["k3"]}),
}
PARAMETERS = 0.3  # relative: by the nearest of a few gaps


def segments_and_linear_fit(model, observations, *, duration_s=2.0, floor=2e-3):
    modal_model = make_modal_model(model, observations)
    segments = cut_segments(
        observations, modal_model, read_noise(observations), SegmentWindow(duration_s=duration_s, floor=floor)
    )
    return segments, fit_linear(segments, make_nuisance_prior(modal_model, segments, 75.0, DiagnoseOptions()))


@pytest.fixture(scope="module")
def localised(chain, strike):
    """Segments, their linear fit and where the force of a law acts, computed once for each law."""

    @cache
    def localise(name):
        segments, linear = segments_and_linear_fit(chain.model, strike(*LAWS[name][:2]))
        return segments, linear, localise_force(segments, linear)

    return localise


@pytest.mark.parametrize(
    "name",
    ["cubic", *(pytest.param(name, marks=pytest.mark.slow) for name in ("gap", "outside the catalogue"))],
    ids=str,
)
def test_a_force_is_localised_whatever_its_law(localised, name):
    location = LAWS[name][2]
    _, linear, localisation = localised(name)
    assert dict(linear.nuisance_prior.modal_model.locations[localisation.equivalent[0]]) == location
    assert localisation.forces[0].cost < 1e-3 * linear.cost
    assert set(localisation.equivalent) <= set(localisation.possible)
    assert len(localisation.possible) < len(linear.nuisance_prior.modal_model.locations)


def test_a_location_is_fitted_from_a_neighbour_that_explains(localised, monkeypatch):
    """From the nominal model all locations but one end with a large misfit."""
    segments, linear, localisation = localised("cubic")
    best, modal_model = localisation.equivalent[0], linear.nuisance_prior.modal_model
    neighbour = next(
        location for location in range(len(modal_model.locations)) if best in neighbours(modal_model, location, 1)
    )

    def in_local_minimum(segments, linear, location, nuisance=None, **_):
        free = fit_free_force(segments, linear, location, nuisance)
        return free if location == neighbour or nuisance is not None else replace(free, cost=free.cost + 1e12)

    monkeypatch.setattr(force_localisation, "fit_free_force", in_local_minimum)
    assert localise_force(segments, linear).equivalent[0] == best


def test_a_location_is_fitted_only_as_far_as_a_force_may_act_there(localised, monkeypatch):
    """The better the best one so far explains, the less may be left elsewhere."""
    segments, linear, localisation = localised("cubic")
    limits = []

    def fit(*given, cost_limit):
        limits.append(cost_limit)
        return fit_free_force(*given, cost_limit=cost_limit)

    monkeypatch.setattr(force_localisation, "fit_free_force", fit)
    assert localise_force(segments, linear).equivalent == localisation.equivalent
    assert limits[0] == np.inf
    assert limits[1:] == sorted(limits[1:], reverse=True)
    assert limits[-1] < 0.01 * linear.cost


def test_of_many_locations_those_around_possible_ones_are_fitted(localised, monkeypatch):
    """The chain's nodes in a row, each of them two coarse places apart: what is near a possible one is fitted too."""
    segments, linear, _ = localised("cubic")
    modal_model, fitted = linear.nuisance_prior.modal_model, []
    nodes = [row for row, ends in enumerate(modal_model.ends) if len(ends) == 1]
    positions = np.arange(len(nodes), dtype=float)[:, None]

    def fit(segments, linear, location, nuisance=None, **options):
        fitted.append(location)
        free = fit_free_force(segments, linear, location, nuisance, **options)
        return replace(free, cost=free.cost + (1e12 if location in nodes[2:] else 0.0))

    monkeypatch.setattr(force_localisation, "PLACES_PER_MODE", 2 / len(linear.nuisance_prior.modes))
    monkeypatch.setattr(force_localisation, "_group_by_direction", lambda _: ([(nodes, positions)], []))
    monkeypatch.setattr(force_localisation, "fit_free_force", fit)
    monkeypatch.setattr(force_localisation, "NEIGHBOURS", 0)
    localise_force(segments, linear)
    assert set(fitted[:2]) == {nodes[0], nodes[-1]}
    assert nodes[1] in fitted[2:]


def test_a_free_force_leaves_less_than_a_law_at_its_location_however_far_off_the_model_starts(chain_like, strike):
    """Where errors of the model are large beside the noise, whole Gauss-Newton steps diverge."""
    model = chain_like(ratio=0.006, stiffness_n_m=0.99 * 4e4)
    segments, linear = segments_and_linear_fit(model, strike(*LAWS["cubic"][:2]), duration_s=3.0, floor=5e-4)
    start = LawStart(law=CubicStiffness(), location=2, strength=2e10, shape=0.0, nuisance=linear.start_nuisance)
    law = fit_output_error(segments, linear.nuisance_prior, start, iterations=20)
    assert law.cost < linear.n_rows
    assert fit_free_force(segments, linear, 2).cost < law.cost
    assert localise_force(segments, linear).equivalent == (2,)


def test_a_single_sensor_localises_nothing(chain, strike):
    law, where, _ = LAWS["cubic"]
    observations = strike(law, where)
    records = tuple(
        replace(record, sensors=record.sensors[:1], responses=record.responses[:1]) for record in observations.records
    )
    segments, linear = segments_and_linear_fit(chain.model, replace(observations, records=records))
    localisation = localise_force(segments, linear)
    assert (
        localisation.equivalent
        == localisation.possible
        == tuple(range(len(linear.nuisance_prior.modal_model.locations)))
    )
    assert localisation.forces == ()


@pytest.mark.parametrize(
    ("name", "law", "strength", "shape"),
    [("cubic", CubicStiffness(), 2e10, 0.0), pytest.param("gap", GapContact(), 3e4, 2e-4, marks=pytest.mark.slow)],
)
def test_the_parameters_of_a_law_are_read_from_the_free_force(localised, name, law, strength, shape):
    segments, linear, localisation = localised(name)
    start = start_from_force(segments, linear, localisation.forces[0], law)
    assert start.strength == pytest.approx(strength, rel=PARAMETERS)
    assert start.shape == pytest.approx(shape, rel=PARAMETERS)
    assert np.isfinite(start.nuisance).all()


@pytest.mark.slow
@pytest.mark.parametrize("far_off", [True, False])
def test_a_law_that_the_alternating_fit_loses_is_simulated_as_read_from_the_free_force(localised, monkeypatch, far_off):
    segments, linear, localisation = localised("gap")
    problem = LawFitProblem(segments=segments, linear=linear, localisation=localisation)
    fit_alternating = candidates.fit_alternating

    def lose_law(*arguments, **options):
        fit = fit_alternating(*arguments, **options)
        return replace(fit, shape=20 * abs(fit.shape), strength=1e-3 * fit.strength)  # a gap that is never closed

    monkeypatch.setattr(candidates, "fit_alternating", lose_law)
    if not far_off:
        monkeypatch.setattr(candidates, "FAR_OFF", np.inf)
    fits = candidates.find_candidates(problem, problem, [GapContact()])
    is_found = bool(fits) and (fits[0].strength, fits[0].shape) == pytest.approx((3e4, 2e-4), rel=0.05)
    assert is_found is far_off


def test_the_location_of_the_best_free_force_is_simulated_whatever_the_alternating_fit_says(localised, monkeypatch):
    segments, linear, localisation = localised("cubic")
    everywhere = tuple(range(len(linear.nuisance_prior.modal_model.locations)))
    problem = LawFitProblem(segments=segments, linear=linear, localisation=replace(localisation, possible=everywhere))
    fit_scored, fit_from_free_force = candidates._fit_scored, candidates._fit_from_free_force
    monkeypatch.setattr(
        candidates, "_fit_scored", lambda *data: [fit for fit in fit_scored(*data) if fit.location != 2]
    )
    monkeypatch.setattr(
        candidates,
        "_fit_from_free_force",
        lambda *data: [replace(fit, cost=np.inf) for fit in fit_from_free_force(*data)],
    )
    monkeypatch.setattr(LawFitProblem, "neighbours_of", lambda *_: [])
    monkeypatch.setattr(candidates, "FEW_LOCATIONS", 0)
    monkeypatch.setattr(candidates, "FAR_OFF", np.inf)
    assert localisation.equivalent[0] == 2
    assert candidates.find_candidates(problem, problem, [CubicStiffness()])[0].location == 2


def test_neighbours_move_alike_or_in_opposite_directions():
    """Four locations of two modes: the fourth is a spring that is counted the other way round."""
    shapes = np.array([(1.0, 0.0), (0.2, 1.0), (1.0, 0.8), (-0.5, 0.02)])
    assert neighbours(SimpleNamespace(at_locations=SimpleNamespace(shapes=shapes)), 0, 2) == [3, 2]
