"""Nonlinear laws sit where things vibrate, not where a free structure drifts in its cords."""

from dataclasses import replace
from types import SimpleNamespace

import pytest
from numpy.testing import assert_allclose

from frf_testbench.simulator.cases.campaign import swing
from frf_testbench.simulator.cases.case import make_case
from frf_testbench.simulator.effects import catalogue
from frf_testbench.simulator.effects.effect import Bench, Effect
from frf_testbench.simulator.structures.points import Point

ALGEBRA = 1e-12  # relative: the same sum of modes twice


def swings(structure):
    case = make_case(31, "null", structure=structure, analyse=False)
    set_up = case.ideal.set_up
    motion = (Point(set_up.struck[0][0], case.world.specimen.direction), None)
    hit = [replace(drive, order=0) for drive in case.drives[:1]]
    return [swing(case.ideal, hit, motion, drifting=drifting)[0] for drifting in (True, False)]


def test_a_hanging_beam_drifts_much_farther_than_it_vibrates():
    whole, vibration = swings("free-free")
    assert whole > 3 * vibration > 0


def test_a_held_beam_only_vibrates():
    whole, vibration = swings("cantilever")
    assert_allclose(vibration, whole, rtol=ALGEBRA)


def bench(n_rigid, vibration):
    return Bench(
        specimen=None,
        set_up=None,
        structure=SimpleNamespace(n_rigid=n_rigid),
        modes=None,
        nodes=(),
        mass_kg=1.0,
        swing=lambda _motion: (1.0, 0.0),
        vibration=lambda _motion: vibration,
    )


@pytest.mark.parametrize(("n_rigid", "vibration", "fits"), [(3, 0.4, False), (3, 0.6, True), (0, 0.4, True)])
def test_a_law_is_drawn_where_half_of_the_motion_is_vibration(monkeypatch, n_rigid, vibration, fits):
    law = Effect(name="gap_contact", law=object(), law_motion=(Point(3, "z"), None))
    monkeypatch.setitem(catalogue.CONTRACT, "gap_contact", lambda _rng, _bench: law)
    drawn = catalogue.draw_effects(None, ("gap_contact",), bench(n_rigid, vibration))
    assert drawn == ((law,) if fits else None)


def test_effects_without_a_law_do_not_care(monkeypatch):
    mass = Effect(name="added_mass")
    monkeypatch.setitem(catalogue.CONTRACT, "added_mass", lambda _rng, _bench: mass)
    assert catalogue.draw_effects(None, ("added_mass",), bench(3, 0.0)) == (mass,)


def test_an_effect_outside_the_table_says_how_much_worse_the_closest_effect_of_the_table_is():
    shown = make_case(700, "unknown:rotary_inertia").truth["detectability"]
    assert 0 < shown["separation_nats"] < shown["evidence_nats"]
    assert shown["runner_up"][0]["nats"] == shown["separation_nats"]
    assert {one["effect"] for one in shown["runner_up"]} <= set(catalogue.CONTRACT)
