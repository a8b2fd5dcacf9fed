"""Sums of simple laws: what they approximate, and how they locate a force of unknown law."""

from types import SimpleNamespace

import numpy as np
import pytest

from frf_ipz.diagnosis.nonlinear.fitting import simple_laws
from frf_ipz.diagnosis.nonlinear.fitting.force_localisation import ForceLocalisation
from frf_ipz.diagnosis.nonlinear.fitting.simple_laws import simple_forces
from simple_forces import simple_laws_at

APPROXIMATION = 0.015  # of the force; springs that slip abruptly, which are not smooth, leave 0.12
LOCATIONS = tuple(range(20))


def gradual_slip(x, limit):
    """Give the extension of a spring whose slope falls to zero as it is loaded, z' = x' (1 - |z| / limit)."""
    extensions, extension = np.zeros_like(x), 0.0
    for k, step in enumerate(np.diff(x, prepend=0.0)):
        extension += step * (1 - abs(extension) / limit if step * extension > 0 else 1.0)
        extensions[k] = extension
    return extensions


@pytest.mark.parametrize("limit", [0.05, 0.07, 0.15, 0.3, 0.4])
def test_a_joint_that_slips_gradually_is_a_sum_of_simple_forces(limit):
    t = np.linspace(0, 1, 4000)
    x = np.exp(-3 * t) * (np.sin(60 * t) + 0.3 * np.sin(210 * t))
    x /= np.abs(x).max()
    v = np.gradient(x, t)
    basis, force = simple_forces(x[None], v[None])[:, 0], gradual_slip(x, limit)
    strengths = np.linalg.lstsq(basis.T, force, rcond=None)[0]
    assert np.linalg.norm(force - strengths @ basis) < APPROXIMATION * np.linalg.norm(force)


@pytest.fixture
def problems(monkeypatch):
    """Makes short and long problems, at whose locations simple laws leave costs."""

    def make(costs, locations, neighbours_of):
        monkeypatch.setattr(
            simple_laws,
            "fit_simple_laws",
            lambda problem, location, _: simple_laws_at(
                location, costs[problem.name, location], linear_mean_misfit=problem.mean_misfit
            ),
        )
        localisation = ForceLocalisation(possible=LOCATIONS, equivalent=locations)
        return [
            SimpleNamespace(name=name, mean_misfit=9.0, localisation=localisation, neighbours_of=neighbours_of)
            for name in ("short", "long")
        ]

    return make


def adjacent(location):
    return [location - 1, location + 1]


def test_locations_of_the_best_laws_are_fitted_whatever_the_first_moments_say(problems):
    costs = {("short", location): 10.0 + location for location in range(8)} | {
        ("long", location): 50.0 for location in range(8)
    }
    costs["long", 7] = 20.0
    short, long = problems(costs, LOCATIONS[:8], lambda _: [])
    by_long, by_short = simple_laws.locate_unknown_law(short, long, [7])
    assert (by_long.location, by_short.location) == (7, 0)
    assert simple_laws.locate_unknown_law(short, long, [])[0].location != 7
    long.localisation = ForceLocalisation(possible=LOCATIONS, equivalent=LOCATIONS[:7])
    located, _ = simple_laws.locate_unknown_law(short, long, [7])
    assert located.location != 7  # the free force rules it out


def test_the_location_of_a_force_is_found_however_far_it_is(problems):
    """The first moments and the law that fits best are both far off."""
    costs = {("short", location): 10.0 + location for location in LOCATIONS} | {
        ("long", location): 99.0 - location for location in LOCATIONS
    }
    short, long = problems(costs, LOCATIONS, adjacent)
    assert simple_laws.locate_unknown_law(short, long, [5])[0].location == 19


def test_neighbours_of_several_locations_are_searched(problems, monkeypatch):
    """The best start leads nowhere; the second best leads to the location of the force."""
    cost = dict.fromkeys(LOCATIONS, 99.0) | {0: 20.0, 10: 40.0, 11: 30.0, 12: 10.0}
    costs = {(name, location): cost[location] for name in ("short", "long") for location in LOCATIONS}
    short, long = problems(costs, LOCATIONS, adjacent)
    monkeypatch.setattr(simple_laws, "FINALISTS", 0)
    assert simple_laws.locate_unknown_law(short, long, [0, 10])[0].location == 12


def test_locations_that_explain_as_well_are_in_the_ambiguity_set():
    """Of 100 data 20 is left, so that a drop of 3 distinguishes locations."""
    costs = {4: 22.5, 5: 20.0, 6: 21.0, 7: 23.5}
    best = simple_laws._with_ambiguity_set([simple_laws_at(location, cost) for location, cost in costs.items()])
    assert best.ambiguity_set == (5, 6, 4)
    larger = simple_laws._with_ambiguity_set([simple_laws_at(location, 100 * cost) for location, cost in costs.items()])
    assert larger.ambiguity_set == (5,)
