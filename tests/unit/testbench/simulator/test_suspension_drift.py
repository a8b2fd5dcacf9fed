"""Nonlinear laws sit where things vibrate, not where a free structure drifts in its suspension."""

from dataclasses import replace
from types import SimpleNamespace

import pytest
from numpy.testing import assert_allclose

from frf_testbench.simulator.cases.case import make_case
from frf_testbench.simulator.cases.records import peak_motion
from frf_testbench.simulator.effects import catalogue
from frf_testbench.simulator.effects.effect import Effect, EffectTarget
from frf_testbench.simulator.structures.structure import Point

ALGEBRA = 1e-12  # relative: the same sum of modes twice


def swings(structure):
    case = make_case(31, "null", structure=structure, analyse=False)
    set_up = case.ideal_system.set_up
    motion = (Point(set_up.excited_points[0][0], case.system.specimen.direction), None)
    hit = [replace(excitation, order=0) for excitation in case.excitations[:1]]
    return [peak_motion(case.ideal_system, hit, motion, drifting=drifting)[0] for drifting in (True, False)]


def test_a_hanging_beam_drifts_much_farther_than_it_vibrates():
    whole, peak_vibration = swings("free-free")
    assert whole > 3 * peak_vibration > 0


def test_a_held_beam_only_vibrates():
    whole, peak_vibration = swings("cantilever")
    assert_allclose(peak_vibration, whole, rtol=ALGEBRA)


def target(n_rigid, peak_vibration):
    return EffectTarget(
        specimen=None,
        set_up=None,
        structure=SimpleNamespace(n_rigid=n_rigid),
        modes=None,
        nodes=(),
        mass_kg=1.0,
        peak_motion=lambda _motion: (1.0, 0.0),
        peak_vibration=lambda _motion: peak_vibration,
    )


@pytest.mark.parametrize(("n_rigid", "peak_vibration", "fits"), [(3, 0.4, False), (3, 0.6, True), (0, 0.4, True)])
def test_a_law_is_drawn_where_half_of_the_motion_is_vibration(monkeypatch, n_rigid, peak_vibration, fits):
    law = Effect(name="gap_contact", law=object(), law_motion=(Point(3, "z"), None))
    monkeypatch.setitem(catalogue.CATALOGUE, "gap_contact", lambda _rng, _target: law)
    drawn = catalogue.draw_effects(None, ("gap_contact",), target(n_rigid, peak_vibration))
    assert drawn == ((law,) if fits else None)


def test_effects_without_a_law_do_not_care(monkeypatch):
    mass = Effect(name="added_mass")
    monkeypatch.setitem(catalogue.CATALOGUE, "added_mass", lambda _rng, _target: mass)
    assert catalogue.draw_effects(None, ("added_mass",), target(3, 0.0)) == (mass,)


def test_an_effect_outside_the_table_says_how_much_worse_the_closest_effect_of_the_table_is():
    shown = make_case(700, "unknown:rotary_inertia").truth["detectability"]
    assert 0 < shown["separation_nats"] < shown["evidence_nats"]
    assert shown["runner_up"][0]["nats"] == shown["separation_nats"]
    assert {one["effect"] for one in shown["runner_up"]} <= set(catalogue.CATALOGUE)
