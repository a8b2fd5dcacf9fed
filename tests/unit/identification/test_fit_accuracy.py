"""Poles and zeros are at the statistical limit, and their standard deviations are true."""

import importlib.util

import numpy as np
import pytest

from frf_ipz.identification.fit import fit_modes
from frf_ipz.identification.options import FitOptions
from synthetic_frfs import accelerances, count, normalised_errors, of_bench, random_modes

LINES_HZ = np.arange(1, 2049) * 0.5
SPREAD = np.array([60.0, 135.0, 210.0, 340.0, 430.0, 520.0, 655.0, 790.0, 910.0])
CALIBRATED = (0.8, 1.2)  # rms of errors over their standard deviations: the bar of the project
AT_THE_LIMIT = 1.1  # times the Cramer-Rao bound: the bar of the project
UNBIASED = 0.2  # standard deviations: the bar of the project
FEW_SEEDS = 0.35  # 3 standard deviations of the rms of 36 numbers
FRESH = 40_000  # seeds that no threshold was chosen on


@pytest.fixture(scope="module")
def truth_sets(bench_fit):
    spec = importlib.util.spec_from_file_location("make_truth", bench_fit / "make_truth.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return {name: getattr(module, f"set_{name}") for name in "abc"}


def poles_of(truth):
    omega = 2 * np.pi * truth["fn"]
    return omega * (-truth["zeta"] + 1j * np.sqrt(1 - truth["zeta"] ** 2))


def errors_over_seeds(truth, seeds):
    """Normalised errors of frequency and damping, (n_seeds, 2, n_modes); every seed must find every mode."""
    poles = poles_of(truth)
    errors = []
    for seed in seeds:
        fit = fit_modes(of_bench(truth, seed=FRESH + seed), options=FitOptions())
        assert count(fit.model.poles[: fit.n_modes], poles) == (len(poles), 0, 0)
        assert fit.noise_from == "recordings"
        errors.append(normalised_errors(fit, poles))
    return np.array(errors)


def zero_errors(fit, truth):
    """Normalised errors of the identifiable zeros that are not real, parts in turn."""
    omega, ratio = 2 * np.pi * truth["fn_all"], truth["zeta_all"]
    products = (truth["phi_o"][:, None] * truth["phi_i"][None]).reshape(-1, len(omega))
    low, high = (float(np.ravel(truth[name])[0]) if name in truth else 0.0 for name in ("lr", "ur"))
    errors = []
    for index in np.flatnonzero(fit.zeros.identifiable):
        if fit.zeros.kind[index] == "real":
            continue
        z = value = fit.zeros.values[index]
        product = products[fit.zeros.frf[index]]
        for _ in range(20):  # Newton's method from the estimate to the zero of the truth
            stiffness = z**2 + 2 * ratio * omega * z + omega**2
            slope = -np.sum(product * (2 * z + 2 * ratio * omega) / stiffness**2) - 2 * low / z**3
            z = z - (np.sum(product / stiffness) + low / z**2 + high) / slope
        rows = slice(2 * (fit.n_modes + index), 2 * (fit.n_modes + index) + 2)
        std = np.sqrt(np.diagonal(fit.covariance[rows, rows]))
        errors.append(np.array([(value - z).real, (value - z).imag]) / std)
    return np.array(errors)


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.mark.parametrize("modes", ["complex", "real"])
def test_standard_deviations_are_calibrated(modes):
    truth = random_modes(SPREAD, 0.005)
    errors = []
    for seed in range(2):
        fit = fit_modes(accelerances(truth, LINES_HZ, seed=seed), options=FitOptions(modes=modes))
        errors.append(normalised_errors(fit, truth.poles))
    assert rms(errors) == pytest.approx(1.0, abs=FEW_SEEDS)


def test_single_beam_at_the_limit(truth_sets):
    errors = errors_over_seeds(truth_sets["a"](), range(6))
    assert rms(errors) < AT_THE_LIMIT + FEW_SEEDS
    assert abs(errors[:, 1].mean()) < UNBIASED + 3 / np.sqrt(30)


def test_plate_with_two_close_pairs(truth_sets):
    truth = truth_sets["b"]()
    errors = errors_over_seeds(truth, range(2))
    assert rms(errors) == pytest.approx(1.0, abs=FEW_SEEDS)


def test_zeros_of_a_plate_are_calibrated(truth_sets):
    truth = truth_sets["b"]()
    errors = zero_errors(fit_modes(of_bench(truth, seed=FRESH), options=FitOptions()), truth)
    assert len(errors) > 200
    assert CALIBRATED[0] < rms(errors[np.abs(errors).max(axis=1) < 6]) < CALIBRATED[1]
    assert np.mean(np.abs(errors).max(axis=1) > 6) < 0.02  # zeros beside another one, to which Newton may run


def test_large_plate_is_complete(truth_sets):
    truth = truth_sets["c"]()
    errors = errors_over_seeds(truth, range(1))
    assert rms(errors) == pytest.approx(1.0, abs=FEW_SEEDS)


@pytest.mark.slow
def test_set_a_over_many_seeds(truth_sets):
    truth = truth_sets["a"]()
    errors = errors_over_seeds(truth, range(60))
    assert rms(errors[:, 0]) < AT_THE_LIMIT
    assert rms(errors[:, 1]) < AT_THE_LIMIT
    assert abs(errors[:, 1].mean()) < UNBIASED


@pytest.mark.slow
@pytest.mark.parametrize("name", ["b", "c"])
def test_sets_b_and_c_over_ten_seeds(truth_sets, name):
    errors = errors_over_seeds(truth_sets[name](), range(10))
    assert CALIBRATED[0] < rms(errors) < CALIBRATED[1]
