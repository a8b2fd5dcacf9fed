"""Which stretches laws are fitted to, when a law is bent, and where an unknown one sits."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from frf_ipz.diagnosis.nonlinear import search
from frf_ipz.diagnosis.nonlinear.fitting import candidates
from frf_ipz.diagnosis.nonlinear.fitting import simple_laws as anywhere
from frf_ipz.diagnosis.nonlinear.fitting.fitted_segments import FINE, FittedSegments
from frf_ipz.diagnosis.nonlinear.fitting.force_localisation import Whereabouts, neighbours
from frf_ipz.diagnosis.nonlinear.nonlinear_evidence import Agreement

EVERY = tuple(range(10))


def recordings(missed, most=float("inf"), *, kind="hammer"):
    """Tracks that say how long they were asked to be; a linear model leaves so much."""

    def cut(duration_s, floor, *, loudest):
        n_samples = min(round(duration_s), most)
        return SimpleNamespace(
            missed=missed, floor=floor, loudest=loudest, stretches=SimpleNamespace(n_samples=n_samples)
        )

    return SimpleNamespace(track=cut, training=SimpleNamespace(band_hz=(0.1, 1.0), kind=kind, records=()))


def lengths(found):
    return [track.stretches.n_samples for track in found]


@pytest.mark.parametrize(
    ("missed", "most", "expected"),
    [(30.0, 1e9, [80, 320]), (0.8, 1e9, [320, 640]), (0.8, 330, [80, 320])],
)
def test_stretches_are_longer_where_a_linear_model_leaves_little(missed, most, expected):
    assert lengths(FittedSegments._tracks(recordings(missed, most))) == expected


def test_a_record_that_starts_linear_is_looked_at_where_it_is_loudest():
    short, long = FittedSegments._tracks(recordings(0.3, kind="random"))
    assert short.loudest
    assert long.loudest
    assert lengths((short, long)) == [320, 640]
    assert long.floor < FINE


def a_fit(cost, *, settled):
    return SimpleNamespace(cost=cost, settled=settled, n_rows=100)


def test_the_best_law_is_fitted_until_it_settles():
    def further(fit, _):
        return a_fit(fit.cost - 1, settled=fit.cost < 9)

    fits = [a_fit(20.0, settled=False), a_fit(10.0, settled=False)]
    candidates._settle(SimpleNamespace(fit_output_error=further), fits)
    assert [(fit.cost, fit.settled) for fit in fits] == [(20.0, False), (7.0, True)]


@pytest.mark.parametrize(("left", "expected"), [(500.0, 60.0), (90.0, 90.0), (110.0, 60.0), (50.0, 50.0)])
def test_a_law_that_leaves_much_is_fitted_afresh(left, expected):
    fits = [a_fit(left, settled=True)]
    candidates._settle(SimpleNamespace(fit_output_error_afresh=lambda *_: a_fit(60.0, settled=True)), fits)
    assert fits[0].cost == expected


@pytest.mark.parametrize(("drop", "least", "bent"), [(150.0, 0.0, True), (150.0, 250.0, False), (90.0, 0.0, False)])
def test_a_small_bend_is_too_much_only_where_noise_may_hide_a_larger_one(drop, least, bent):
    """Errors of the model imitate 100."""
    track = SimpleNamespace(
        stretches=SimpleNamespace(moving=SimpleNamespace(any=lambda: False)), linear=SimpleNamespace(cost=9e3)
    )
    fit = SimpleNamespace(cost=1e3, n_rows=5000)
    assert search._is_bent(track, fit, drop, least=least) == bent


@pytest.mark.parametrize(("drop", "bent"), [(2500.0, False), (3900.0, True)])
def test_starts_in_motion_imitate_a_larger_bend(drop, bent):
    """Of 10000 that a law leaves: a two-sided stop that was taken for a cubic spring would gain 3900."""
    track = SimpleNamespace(
        stretches=SimpleNamespace(moving=SimpleNamespace(any=lambda: True)), linear=SimpleNamespace(cost=3.5e4)
    )
    assert search._is_bent(track, SimpleNamespace(cost=1e4, n_rows=16848), drop, least=250.0) == bent


def a_look(fits, bend_of):
    return SimpleNamespace(short=None, long=a_track(), fits=fits, bend_of=bend_of)


def a_force(place, cost, *, n_rows=100, missed=50.0):
    return search.AnyForce(place=place, cost=cost, left=cost / n_rows, missed=missed)


def a_track(n_rows=100, missed=50.0, equal=EVERY):
    return SimpleNamespace(
        linear=SimpleNamespace(n_rows=n_rows, cost=n_rows * missed), missed=missed, where=where(equal)
    )


def where(equal):
    return Whereabouts(possible=EVERY, equal=equal)


@pytest.mark.parametrize(("drop", "place"), [(300.0, 7), (950.0, 3)])
def test_only_a_small_force_besides_a_law_is_believed_without_being_fitted(monkeypatch, drop, place):
    """A law at place 7 leaves 1000; any force, fitted, leaves 2000 at place 3."""
    monkeypatch.setattr(search, "find_place", lambda *_: (a_force(3, 2000.0), a_force(5, 2000.0)))
    assert search._anywhere(a_look([a_law_at(7, 1000.0)], lambda _: drop)).place == place


@pytest.mark.parametrize(
    ("left", "first", "early", "place"),
    [(500.0, 20.0, 50.0, 5), (500.0, 20.0, 30.0, 3), (500.0, 150.0, 500.0, 3), (300.0, 20.0, 50.0, 3)],
)
def test_first_moments_place_a_law_where_later_ones_are_not_reached(monkeypatch, left, first, early, place):
    """Long stretches say place 3, the first moments place 5: they are believed where they leave nothing there alone."""
    monkeypatch.setattr(search, "find_place", lambda *_: (a_force(3, left), a_force(5, first)))
    monkeypatch.setattr(search, "fit_anything", lambda _, one, __: a_force(one, early))
    assert search._anywhere(a_look([a_law_at(7, 1000.0)], lambda _: 950.0)).place == place


def test_places_of_the_best_laws_are_asked_for_whatever_the_first_moments_say(monkeypatch):
    costs = {("short", place): 10.0 + place for place in range(8)} | {("long", place): 50.0 for place in range(8)}
    costs["long", 7] = 20.0
    tracks = {
        name: SimpleNamespace(name=name, missed=9.0, where=where(EVERY[:8]), beside=lambda _: [])
        for name in ("short", "long")
    }
    monkeypatch.setattr(
        anywhere, "fit_anything", lambda track, place, _: a_force(place, costs[track.name, place], missed=track.missed)
    )
    by_long, by_short = anywhere.find_place(tracks["short"], tracks["long"], [7])
    assert (by_long.place, by_short.place) == (7, 0)
    assert anywhere.find_place(tracks["short"], tracks["long"], [])[0].place != 7
    tracks["long"].where = where(EVERY[:7])
    assert anywhere.find_place(tracks["short"], tracks["long"], [7])[0].place != 7  # any force tells that it is not


def test_the_place_of_a_force_is_climbed_to_however_far_it_is(monkeypatch):
    """The first moments and the law that fits best are both far off."""
    far = tuple(range(20))
    costs = {("short", place): 10.0 + place for place in far} | {("long", place): 99.0 - place for place in far}
    tracks = {
        name: SimpleNamespace(name=name, missed=9.0, where=where(far), beside=lambda place: [place - 1, place + 1])
        for name in ("short", "long")
    }
    monkeypatch.setattr(
        anywhere, "fit_anything", lambda track, place, _: a_force(place, costs[track.name, place], missed=track.missed)
    )
    assert anywhere.find_place(tracks["short"], tracks["long"], [5])[0].place == 19


def test_neighbours_move_alike_or_the_other_way_round():
    """Four places of two modes: the fourth is a spring that is counted the other way round."""
    shapes = np.array([(1.0, 0.0), (0.2, 1.0), (1.0, 0.8), (-0.5, 0.02)])
    assert neighbours(SimpleNamespace(at_places=SimpleNamespace(shapes=shapes)), 0, 2) == [3, 2]


@pytest.mark.parametrize(("left", "linear", "said"), [(3.0, 50.0, True), (10.0, 50.0, False), (10.0, 260.0, True)])
def test_the_place_of_an_unknown_law_is_said_where_a_force_there_explains_nearly_all(left, linear, said):
    modal_model = SimpleNamespace(places=[SimpleNamespace(words="node 1", location={"nodes": [1]})])
    found = search.LawSearch(verdict=search.UNEXPLAINED, linearity=None)
    again = search._with_place(found, modal_model, a_force(0, 100 * left, missed=linear), search.MOSTLY)
    assert bool(again.location) == said


def test_places_that_explain_alike_are_said_with_the_place_of_an_unknown_law():
    """Of 100 data 20 is left, so that a drop of 3 tells places apart."""
    costs = {4: 22.5, 5: 20.0, 6: 21.0, 7: 23.5}
    found = anywhere._with_alike([a_force(place, cost) for place, cost in costs.items()])
    assert found.alike == (5, 6, 4)
    modal_model = SimpleNamespace(
        places=[SimpleNamespace(words=f"node {i}", location={"nodes": [i]}) for i in range(9)]
    )
    said = search._with_place(search.LawSearch(verdict=search.UNEXPLAINED, linearity=None), modal_model, found, 0.5)
    assert said.location == {"nodes": [5]}
    assert said.statement.endswith("no closer than nodes 4 to 6.")
    far = anywhere._with_alike([a_force(place, 100 * cost) for place, cost in costs.items()])
    assert far.alike == (5,)


@pytest.mark.parametrize(("costs", "linear", "can"), [({3: 90.0}, 5e3, True), ({3: 90.0}, 150.0, False)])
def test_sensors_tell_where_a_force_is_whatever_it_does(costs, linear, can):
    """Of 100 data a force at place 3, free at every moment, leaves 90; one at place 5 leaves 4000."""
    forces = tuple(SimpleNamespace(place=place, cost=cost) for place, cost in {**costs, 5: 4e3}.items())
    track = SimpleNamespace(linear=SimpleNamespace(n_rows=100, cost=linear), where=SimpleNamespace(forces=forces))
    assert search._can_explain(track, 3) == can
    assert not search._can_explain(track, 5)
    assert not search._can_explain(track, 4)


@pytest.mark.parametrize(("free", "said"), [(90.0, 3), (400.0, 5)])
def test_long_stretches_are_believed_where_sensors_tell_the_place(monkeypatch, free, said):
    """Sums of laws leave much of the long stretches at place 3, and nothing of the first moments at place 5."""
    monkeypatch.setattr(search, "find_place", lambda *_: (a_force(3, 5000.0), a_force(5, 50.0)))
    monkeypatch.setattr(search, "fit_anything", lambda _, one, __: a_force(one, 500.0))
    look = a_look([a_law_at(7, 1000.0)], lambda _: 950.0)
    look.long.where = replace(look.long.where, forces=(SimpleNamespace(place=3, cost=free),))
    assert search._anywhere(look).place == said


def test_several_places_are_climbed_from(monkeypatch):
    """The best start leads nowhere; the second best leads to the place of the force."""
    costs = dict.fromkeys(range(20), 99.0) | {0: 20.0, 10: 40.0, 11: 30.0, 12: 10.0}
    tracks = {
        name: SimpleNamespace(
            name=name, missed=9.0, where=where(tuple(range(20))), beside=lambda place: [place - 1, place + 1]
        )
        for name in ("short", "long")
    }
    monkeypatch.setattr(
        anywhere, "fit_anything", lambda track, place, _: a_force(place, costs[place], missed=track.missed)
    )
    monkeypatch.setattr(anywhere, "FINALISTS", 0)
    assert anywhere.find_place(tracks["short"], tracks["long"], [0, 10])[0].place == 12


@pytest.mark.parametrize(("there", "strength"), [((0.5, 0.0), 54.0), ((1e-9, 1.0), 2.0), ((-0.5, 0.0), 54.0)])
def test_a_law_is_scaled_by_how_much_a_place_that_moves_alike_moves(monkeypatch, there, strength):
    """A cubic spring of 2 at a place of shapes (1, 0); the other moves a third as much, whatever its shapes say."""
    points = SimpleNamespace(shapes=np.array([(1.0, 0.0), there]))
    nuisance_prior = SimpleNamespace(
        modal_model=SimpleNamespace(at_places=points), of_no_place=lambda unknowns: unknowns
    )
    nothing = dict.fromkeys(("unknowns", "covariance", "motion", "velocity", "force", "misfit"), np.zeros(0))
    law = SimpleNamespace(degree=3)
    fit = candidates.LawFit(law=law, place=0, strength=2.0, shape=6.0, cost=1.0, n_rows=1, **nothing)
    monkeypatch.setattr(candidates, "_size", lambda _, one: (3.0, 1.0)[one.place])
    moved = candidates._moved(SimpleNamespace(linear=SimpleNamespace(nuisance_prior=nuisance_prior)), fit, 1)
    assert moved.place == 1
    assert (moved.strength, moved.shape) == pytest.approx((strength, 6.0 if strength == 2 else 2.0))


@pytest.mark.parametrize(("place", "best"), [(3, 3), (9, 9), (4, 7)])
def test_the_numbers_of_the_best_place_are_tried_at_the_next_best_and_beside_it(monkeypatch, place, best):
    """A law leaves 10 at place 7, 15 at place 3 and 50 at 4 and 9, each from its own start; 6 from better numbers."""
    law = SimpleNamespace(name="friction")
    costs = {7: 10.0, 3: 15.0, 4: 50.0, 9: 50.0}
    fits = [SimpleNamespace(law=law, place=one, cost=cost, strength=1.0) for one, cost in costs.items()]
    costs[place] = 6.0
    monkeypatch.setattr(candidates, "_moved", lambda _, fit, there: SimpleNamespace(law=fit.law, place=there))
    track = SimpleNamespace(
        beside=lambda _: [9],
        fit_output_error=lambda fit, _: SimpleNamespace(
            law=law, place=fit.place, cost=costs[fit.place], strength=1.0, settled=True
        ),
    )
    if place == 9:
        assert not candidates._exchange(track, list(fits), beside=False)
    assert candidates._exchange(track, fits, beside=True) == (best != 7)
    assert fits[0].place == best
    assert len(fits) == 4  # each place once


def test_fits_that_come_close_to_the_best_are_settled_before_they_are_compared(monkeypatch):
    """Further steps take 20 off; the second one is 10 from the best, the third 50."""
    fits = [a_fit(100.0, settled=True), a_fit(110.0, settled=False), a_fit(150.0, settled=False)]
    monkeypatch.setattr(candidates, "_different", list)
    monkeypatch.setattr(candidates, "_simulated", lambda _, fits, **__: list(fits))
    monkeypatch.setattr(candidates, "_climb", lambda *_: None)
    monkeypatch.setattr(candidates, "_exchange", lambda *_, **__: False)
    track = SimpleNamespace(
        fit_output_error=lambda fit, _: a_fit(fit.cost - 20, settled=True),
        fit_output_error_afresh=lambda fit, _: a_fit(fit.cost, settled=True),
    )
    assert [fit.cost for fit in candidates._finished(track, fits)] == [90.0, 100.0, 150.0]


@pytest.mark.parametrize(("settled", "beside"), [(0.5, True), (0.999, False)])
def test_places_beside_are_fitted_again_if_the_numbers_moved(monkeypatch, settled, beside):
    asked = []
    monkeypatch.setattr(candidates, "_simulated", lambda _, fits, **__: list(fits))
    monkeypatch.setattr(candidates, "_climb", lambda *_: None)
    monkeypatch.setattr(candidates, "_settle", lambda _, fits: fits.append(a_law_at(7, settled * fits[0].cost)))
    monkeypatch.setattr(candidates, "_exchange", lambda _, __, beside: asked.append(beside) or len(asked) == 1)
    candidates._finished(None, [a_law_at(7, 100.0)])
    assert asked == [beside, True]  # a better place has neighbours of its own


def test_blows_that_were_compared_already_are_not_compared_again(monkeypatch):
    monkeypatch.setattr(search, "assess_linearity", None)
    found = search.search_laws(None, None, None, linearity=SimpleNamespace(is_nonlinear=False))
    assert found.verdict == search.LINEAR


def a_law_at(place, cost):
    law = SimpleNamespace(name="cubic")
    return SimpleNamespace(law=law, place=place, cost=cost, n_rows=100, strength=1.0, settled=True)


@pytest.mark.parametrize(
    ("by_short", "by_first", "expected"),
    [(300.0, 150.0, [7, 3]), (300.0, 299.0, [3]), (60.0, 80.0, [7, 3]), (0.5, 0.2, [3]), (300.0, 99.0, [3])],
)
def test_first_moments_lead_to_a_law_where_short_stretches_do_not(monkeypatch, by_short, by_first, expected):
    """A linear model leaves 100 of the first moments, the law at place 7 leaves 10, or 90 in the last case."""
    tracks = {
        name: SimpleNamespace(name=name, linear=SimpleNamespace(cost=100.0), where=where(EVERY))
        for name in ("first", "short", "long")
    }
    costs = {
        ("first", 7): 90.0 if by_first == 99.0 else 10.0,
        ("short", 7): by_first,
        ("short", 3): by_short,
        ("long", 7): 50.0,
    }
    costs["long", 3] = 400.0 if by_short > 1 else 90.0
    monkeypatch.setattr(candidates, "_refined", lambda track, _: [a_law_at(7 if track.name == "first" else 3, 1.0)])
    monkeypatch.setattr(
        candidates,
        "_simulated",
        lambda track, fits, **_: [a_law_at(fit.place, costs[track.name, fit.place]) for fit in fits],
    )
    monkeypatch.setattr(candidates, "_of", lambda law, fits: [fit for fit in fits if fit.law.name == law])
    monkeypatch.setattr(candidates, "_different", lambda fits: list({fit.place: fit for fit in fits}.values()))
    monkeypatch.setattr(candidates, "_climb", lambda *_: None)
    monkeypatch.setattr(candidates, "_settle", lambda *_: None)
    monkeypatch.setattr(candidates, "_exchange", lambda *_, **__: False)
    found = candidates.find_candidates(tracks["short"], tracks["long"], ["cubic"], first=lambda: tracks["first"])
    assert [fit.place for fit in found] == expected


def a_first_track(left: float, *, afresh: float, is_moving: bool = False) -> SimpleNamespace:
    """Of which a linear model leaves 10000."""

    def shoot(cost: float) -> SimpleNamespace:
        return SimpleNamespace(cost=cost, n_rows=3000, misfit=None, numbers={"cubic": (1.0, 1e-4)})

    return SimpleNamespace(
        stretches=SimpleNamespace(moving=SimpleNamespace(any=lambda: is_moving)),
        linear=SimpleNamespace(cost=1e4, nuisance_prior=None),
        fit_output_error=lambda *_: shoot(left),
        fit_output_error_afresh=lambda *_: shoot(afresh),
    )


@pytest.mark.parametrize(
    ("left", "drop", "disagree", "explains"),
    [
        ([(90.0, 90.0)], 50.0, 2.0, True),
        ([(900.0, 900.0)], 50.0, 2.0, False),
        ([(90.0, 90.0)], 150.0, 2.0, False),
        ([(90.0, 90.0)], 50.0, 50.0, False),
        ([(900.0, 900.0), (90.0, 90.0)], 50.0, 2.0, True),
        ([(90.0, 900.0)], 50.0, 2.0, True),
        ([(900.0, 90.0)], 50.0, 2.0, True),
    ],
)
def test_a_law_that_explains_all_but_little_of_the_first_moments_is_believed(
    monkeypatch, left, drop, disagree, explains
):
    """Of stretches of any length, by the better of both starts; errors of the model imitate a bend of 100.

    No more where stretches start in motion: nothing later bears out what first moments say.
    """
    monkeypatch.setattr(search, "agreement_with", lambda *_: Agreement(1e4, disagree))
    monkeypatch.setattr(search, "relative_misfit", lambda *_: 0.03)
    monkeypatch.setattr(search, "_bend", lambda *_: drop)
    for is_moving in (False, True):
        firsts = (a_first_track(one, afresh=afresh, is_moving=is_moving) for one, afresh in left)
        assert search._explains_first(firsts, SimpleNamespace()) == explains


def test_what_leads_to_the_same_law_is_not_fitted_again():
    law = SimpleNamespace(name="cubic")
    fits = [SimpleNamespace(law=law, place=place) for place in (3, 7, 8)]
    assert candidates._others(fits, fits[:1]) == []
    assert candidates._others(fits, fits[1:2]) == [fits[0], fits[2]]
