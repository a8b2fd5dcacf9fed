from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose

from frf_ipz.diagnosis.nonlinear.model.modal_model import make_modal_model, nominal_values, respond

EXACT = 1e-9  # relative: all modes are kept, nothing is left out


def test_receptances_are_those_of_the_matrices(chain, strike):
    modal_model = make_modal_model(chain.model, strike())
    s = 3.0 + 2j * np.pi * np.linspace(2, 80, 9)
    response = respond(modal_model, s, nominal_values(modal_model))
    full = np.linalg.inv(chain.M * s[:, None, None] ** 2 + chain.C * s[:, None, None] + chain.K)
    location = next(i for i, p in enumerate(modal_model.locations) if p == {"nodes": [3]})
    driving_point, transfer = response.at_location(location)
    assert_allclose(response.from_inputs()[0], full[:, [1, 3], 0].T, rtol=EXACT, atol=0)
    assert_allclose(response.to_sensors(location), full[:, [1, 3], 2].T, rtol=EXACT, atol=0)
    assert_allclose(driving_point, full[:, 2, 2], rtol=EXACT, atol=0)
    assert_allclose(transfer[0], full[:, 2, 0], rtol=EXACT, atol=0)


def test_a_spring_moves_by_its_second_node_less_its_first(chain, strike):
    modal_model = make_modal_model(chain.model, strike())
    s = np.array([5.0 + 200j])
    full = np.linalg.inv(chain.M * s[0] ** 2 + chain.C * s[0] + chain.K)
    across = np.array([0, -1, 1, 0])
    location = next(i for i, p in enumerate(modal_model.locations) if p == {"springs": ["k3"]})
    driving_point, _ = respond(modal_model, s, nominal_values(modal_model)).at_location(location)
    assert_allclose(driving_point[0], across @ full @ across, rtol=EXACT, atol=0)


def test_a_spring_from_the_ground_is_named_with_its_node(chain, strike):
    locations = [dict(location) for location in make_modal_model(chain.model, strike()).locations]
    assert locations[:2] == [{"nodes": [1], "springs": ["k1"]}, {"nodes": [2]}]
    assert [entries["springs"] for entries in locations if "nodes" not in entries] == [["k2"], ["k3"], ["k4"]]


def test_nuisance_values_that_diverged_leave_finite_receptances(chain, strike):
    modal_model = make_modal_model(chain.model, strike())
    start = nominal_values(modal_model)
    diverged = replace(start, frequency=start.frequency + 1e4, damping=start.damping + 1e4)
    assert np.isfinite(respond(modal_model, np.array([5.0 + 200j]), diverged).modes).all()
    assert np.isfinite([size**2 for size in modal_model.poles(diverged)]).all()
