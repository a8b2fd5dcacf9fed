"""How far linear records disagree by chance, where few numbers make the errors of a whole group of lines."""

import numpy as np
import pytest

from frf_ipz.diagnosis.nonlinear.linearity import (
    LIMIT_HAMMER,
    WIDTH,
    _frf_misfit,
    _quotient_misfit_of,
    decaying_correlation,
    largest_mean,
)

DURATION_S, GATE_S, DECAYS = 1.0, 0.005, 8.0
LEVELS = np.array([1.0, 0.3, 0.1])
DRAWS, PROBABILITY = 1500, 0.03


@pytest.mark.parametrize(("n_records", "of_force"), [(2, 0.0), (3, 0.5), (2, 1.0)])
def test_linear_records_pass_the_computed_limit_as_often_as_stated(n_records, of_force):
    rng = np.random.default_rng(11)
    s = DECAYS / DURATION_S + 2j * np.pi * np.arange(WIDTH) / DURATION_S
    correlation = np.array([decaying_correlation(s, duration) for duration in (GATE_S, DURATION_S)])
    force = 100 * LEVELS[:n_records, None] * np.ones(WIDTH)
    frf = np.exp(0.1j * np.arange(WIDTH))
    energies = np.array([np.full(force.shape, part) for part in (of_force, 1 - of_force)]) + 1e-9
    roots = [np.linalg.cholesky(matrix + 1e-9 * np.eye(WIDTH)).T for matrix in correlation]
    rows = []
    for _ in range(DRAWS):
        errors = [drawn(rng, n_records) @ root * np.sqrt(energy) for root, energy in zip(roots, energies, strict=True)]
        signals = force + errors[0], frf * force + errors[1]
        rows.append(_frf_misfit(*signals, energies, np.zeros_like(energies), correlation))
    misfits, cumulants = np.array(rows)[:, 0], np.array(rows)[:, 1:]
    assert np.mean(misfits) == pytest.approx(1.0, abs=0.1)
    expected = PROBABILITY * DRAWS
    above = np.sum(misfits > largest_mean(cumulants, PROBABILITY))
    assert above == pytest.approx(expected, abs=3 * np.sqrt(expected))


def test_noise_of_a_gate_may_exceed_the_fixed_limit_by_chance():
    single = largest_mean(np.array([1.0, 1.0]), 1e-6)  # one number on all lines, of two impacts
    many = largest_mean(np.array([1 / WIDTH, 1 / WIDTH**2]), 1e-6)
    np.testing.assert_allclose(single, np.log(1e6), rtol=1e-9)
    assert many < LIMIT_HAMMER < single


def drawn(rng, n_records):
    """Complex numbers of variance 1, (n_records, WIDTH)."""
    parts = rng.standard_normal((2, n_records, WIDTH))
    return (parts[0] + 1j * parts[1]) / np.sqrt(2)


def test_transients_are_projected_out_as_if_they_were_fitted():
    """One round of one record after another is least squares by all columns, those of each transient too."""
    rng = np.random.default_rng(6)
    force, motion = rng.standard_normal((2, 5, WIDTH)) + 1j * rng.standard_normal((2, 5, WIDTH))
    noise = np.array([np.zeros((5, WIDTH)), np.full((5, WIDTH), 1e6)])  # so loud that all lines weigh the same
    above = np.linspace(-1, 1, WIDTH)[:, None] ** np.arange(3)
    of_frf = (above * force[..., None]).reshape(5 * WIDTH, -1)
    columns = np.hstack([of_frf, np.kron(np.eye(5), above)])
    left = motion.ravel() - columns @ np.linalg.lstsq(columns, motion.ravel(), rcond=None)[0]
    expected = np.sum(np.abs(left) ** 2) / 1e6 / (motion.size - columns.shape[1])
    assert _quotient_misfit_of((0, 2), force, motion, noise) == pytest.approx(expected, rel=1e-5)
