"""Error ellipses hold what they promise; deviations are those of many draws."""

import numpy as np
import pytest
from matplotlib.path import Path

from frf_ipz.plotting.curves import phase_degrees
from frf_ipz.plotting.ellipses import error_ellipses, root_deviations
from frf_ipz.plotting.projection import project
from frf_ipz.rational import damping_ratio, natural_frequency_hz

DRAWS = 20_000
OF_95 = 0.01  # three deviations of a share of 20 000 draws, and what 33 corners cut off
ROOT = -2.0 + 300.0j
COVARIANCE = np.array([[0.04, 0.03], [0.03, 0.09]])


@pytest.fixture(scope="module")
def draws():
    rng = np.random.default_rng(4)
    parts = rng.multivariate_normal([ROOT.real, ROOT.imag], COVARIANCE, DRAWS)
    return parts[:, 0] + 1j * parts[:, 1]


def test_ellipses_hold_95_percent(draws):
    hertz, ratio = error_ellipses(np.array([ROOT]), COVARIANCE[None])
    outline = Path(np.stack([hertz[0], ratio[0]], 1))
    inside = outline.contains_points(np.stack([natural_frequency_hz(draws), damping_ratio(draws)], 1))
    assert abs(inside.mean() - 0.95) < OF_95


def test_deviations_are_those_of_draws(draws):
    hertz, ratio = root_deviations(np.array([ROOT]), COVARIANCE[None])
    by_draws = natural_frequency_hz(draws).std(), damping_ratio(draws).std()
    np.testing.assert_allclose([hertz[0], ratio[0]], by_draws, rtol=0.03, atol=0)  # of 20 000 draws, and first order


def test_a_root_without_a_covariance_has_no_ellipse():
    hertz, _ = error_ellipses(np.array([ROOT, ROOT]), np.stack([np.full((2, 2), np.inf), COVARIANCE]))
    assert np.isnan(hertz[0]).all()
    assert np.isfinite(hertz[1]).all()


def test_phases_do_not_jump_at_multiples_of_90_degrees():
    rng = np.random.default_rng(5)
    noise = np.exp(1j * rng.uniform(-0.3, 0.3, 500))
    for angle in (-180, -90, 0, 90):
        phase = phase_degrees(np.exp(1j * np.radians(angle)) * noise)
        assert np.ptp(phase) < np.degrees(0.61)
        np.testing.assert_allclose(np.exp(1j * np.radians(phase)), np.exp(1j * np.radians(angle)) * noise, atol=1e-12)


def test_a_flat_structure_is_seen_from_its_thin_side():
    corners = np.array([[0, 1.5, 0], [2, 1.5, 0], [2, 1.5, 3], [0, 1.5, 3.0]])
    np.testing.assert_array_equal(project(corners), corners[:, [0, 2]])


def test_nodes_of_a_solid_do_not_fall_on_each_other():
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1.3) for z in (0, 0.7)], float)
    projected = project(corners)
    distance = np.linalg.norm(projected[:, None] - projected[None], axis=2) + np.eye(8)
    assert distance.min() > 0.05
