"""A gain that is wrong in all modes is found where the model is nearly right, and no other."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import frf_ipz
from frf_ipz.updating.shape_expansion.measured_shapes import measured_shapes
from frf_ipz.updating.shape_expansion.random_forces import FieldAtPoints, ModalModel
from frf_ipz.updating.shape_expansion.wrong_gains import DirectionDensity, find_wrong_gains
from frf_testbench.updating.synthetic_fit import TrueModes, simulate_fit

POINTS = [frf_ipz.Dof(node, "z") for node in (3, 8, 14, 19, 25, 30, 36, 40)]
SENSOR, WRONG = POINTS[3], POINTS[5]
SCATTER = 0.02  # of each amplitude, in each mode another: positions


def make_beam(youngs_modulus_Pa):
    return frf_ipz.make_beam(
        length_m=1.2,
        width_m=0.02,
        thickness_m=0.01,
        youngs_modulus_Pa=youngs_modulus_Pa,
        density_kg_m3=8000,
        elements=40,
        left="free",
        right="free",
        modal_ratio=0.002,
    )


@pytest.fixture(scope="module")
def measurement():
    """A beam struck at eight points, one sensor; the model is 2 % too soft."""
    labels = tuple(frf_ipz.FrfLabel(SENSOR, point, frf_ipz.FrfQuantity.ACCELERANCE) for point in POINTS)
    truth = TrueModes(make_beam(204e9), np.full(60, 0.002))
    fit = simulate_fit(truth, labels, (20.0, 500.0), rng=np.random.default_rng(3))
    residues = fit.model.residues.copy()
    residues[: fit.n_modes] *= 1 + SCATTER * np.random.default_rng(4).normal(size=(fit.n_modes, len(POINTS)))
    return replace(fit, model=replace(fit.model, residues=residues)), frf_ipz.reduce_model(fit, make_beam(200e9))


def with_gain(fit, point, gain):
    residues = fit.model.residues.copy()
    residues[: fit.n_modes] *= [gain if label.input_dof == point else 1.0 for label in fit.labels]
    return replace(fit, model=replace(fit.model, residues=residues))


@pytest.mark.parametrize("gain", [0.85, 1.25, 9.81])
def test_a_wrong_gain_is_found_with_its_deviation(measurement, gain):
    fit, reduced_model = measurement
    wrong = find_wrong_gains(reduced_model, measured_shapes(with_gain(fit, WRONG, gain)), POINTS[1:-1], scatter=0.03)
    assert list(wrong) == [WRONG]
    assert wrong[WRONG].log_gain == pytest.approx(np.log(gain), abs=3 * wrong[WRONG].std)
    assert wrong[WRONG].std < 0.05


def test_tolerances_are_no_wrong_gain(measurement):
    fit, reduced_model = measurement
    assert find_wrong_gains(reduced_model, measured_shapes(fit), POINTS[1:-1], scatter=0.03) == {}


def test_a_point_beyond_all_others_is_not_judged(measurement):
    fit, reduced_model = measurement
    measured = measured_shapes(with_gain(fit, POINTS[0], 0.85))
    assert find_wrong_gains(reduced_model, measured, POINTS[1:-1], scatter=0.03) == {}


def test_a_wrong_gain_is_taken_off(measurement):
    fit, reduced_model = measurement
    off = with_gain(fit, WRONG, 0.5)
    wrong = find_wrong_gains(reduced_model, measured_shapes(off), POINTS[1:-1], scatter=0.03)
    corrected, right = measured_shapes(off, wrong_gains=wrong), measured_shapes(fit)
    np.testing.assert_allclose(np.abs(corrected.at_inputs), np.abs(right.at_inputs), rtol=0, atol=0.05)
    assert corrected.doubt[1 + POINTS.index(WRONG)] == wrong[WRONG].std ** 2


def test_the_density_of_directions_is_one():
    """Over all directions of two points its sum is the same, whatever the gain of one of them."""
    rng = np.random.default_rng(1)
    root = rng.normal(size=(3, 3))
    field = FieldAtPoints(rows=root, power=np.ones(3), prior=root @ root.T, unit_variance=np.ones(3), own=np.zeros(3))
    sides = {"outputs": np.ones((1, 3)), "inputs": np.ones((2, 3))}
    density = DirectionDensity.of(
        ModalModel(omega=np.ones(3), shapes=np.eye(3), scatter=np.float64(0.03), **sides), is_output=False
    )
    log_gains = np.log([0.2, 5.0])
    sums = np.zeros(3)
    for angle in np.linspace(0.0, np.pi, 400, endpoint=False):
        directions = SimpleNamespace(at_outputs=[[1.0]], at_inputs=[[np.cos(angle), np.sin(angle)]])
        as_it_is, with_gain = density.of_mode(field, directions, 0, 0.1, log_gains)
        sums += np.exp([as_it_is, *with_gain[0]])
    np.testing.assert_allclose(sums, sums[0], rtol=1e-3, atol=0)
