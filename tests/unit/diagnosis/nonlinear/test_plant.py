from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose

from frf_ipz.diagnosis.nonlinear.linear.modal_model import make_modal_model, nominal_values, respond

EXACT = 1e-9  # relative: all modes are followed, nothing is left out


def test_receptances_are_those_of_the_matrices(chain, strike):
    modal_model = make_modal_model(chain.model, strike())
    s = 3.0 + 2j * np.pi * np.linspace(2, 80, 9)
    response = respond(modal_model, s, nominal_values(modal_model))
    full = np.linalg.inv(chain.M * s[:, None, None] ** 2 + chain.C * s[:, None, None] + chain.K)
    place = next(i for i, p in enumerate(modal_model.places) if p.location == {"nodes": [3]})
    own, driven = response.at_place(place)
    assert_allclose(response.from_inputs()[0], full[:, [1, 3], 0].T, rtol=EXACT, atol=0)
    assert_allclose(response.to_sensors(place), full[:, [1, 3], 2].T, rtol=EXACT, atol=0)
    assert_allclose(own, full[:, 2, 2], rtol=EXACT, atol=0)
    assert_allclose(driven[0], full[:, 2, 0], rtol=EXACT, atol=0)


def test_a_spring_feels_its_second_node_less_its_first(chain, strike):
    modal_model = make_modal_model(chain.model, strike())
    s = np.array([5.0 + 200j])
    full = np.linalg.inv(chain.M * s[0] ** 2 + chain.C * s[0] + chain.K)
    across = np.array([0, -1, 1, 0])
    place = next(i for i, p in enumerate(modal_model.places) if p.location == {"springs": ["k3"]})
    own, _ = respond(modal_model, s, nominal_values(modal_model)).at_place(place)
    assert_allclose(own[0], across @ full @ across, rtol=EXACT, atol=0)


def test_a_spring_from_the_ground_is_named_with_its_node(chain, strike):
    locations = [dict(place.location) for place in make_modal_model(chain.model, strike()).places]
    assert locations[:2] == [{"nodes": [1], "springs": ["k1"]}, {"nodes": [2]}]
    assert [one["springs"] for one in locations if "nodes" not in one] == [["k2"], ["k3"], ["k4"]]


def test_deviations_that_ran_away_leave_finite_receptances(chain, strike):
    modal_model = make_modal_model(chain.model, strike())
    start = nominal_values(modal_model)
    away = replace(start, frequency=start.frequency + 1e4, damping=start.damping + 1e4)
    assert np.isfinite(respond(modal_model, np.array([5.0 + 200j]), away).modes).all()
    assert np.isfinite([size**2 for size in modal_model.poles(away)]).all()
