"""What a fitter would report: the truth, and a draw of its covariance."""

import numpy as np
from numpy.testing import assert_allclose

from frf_testbench.updating.random_structures import draw_structure
from frf_testbench.updating.synthetic_fit import TrueModes, choose_band, list_labels, simulate_fit

SEED = 3
DRAWS = 40
EXACT = 1e-9  # relative: the poles are those of the truth
LIMIT = 1e-6  # relative distance from a pole at which the residue is read: what all else adds there


def problem():
    structure = draw_structure(SEED)
    true_modes = TrueModes(structure.true_model, structure.damping)
    labels = list_labels(structure.input_dofs, structure.sensors)
    return true_modes, labels, choose_band(true_modes, structure.n_modes)


def test_without_noise_the_fit_is_the_truth_in_its_band():
    true_modes, labels, band = problem()
    fit = simulate_fit(true_modes, labels, band, noise=0.0)
    inside = (true_modes.omega > 2 * np.pi * band[0]) & (true_modes.omega < 2 * np.pi * band[1])
    assert_allclose(np.abs(fit.model.poles), true_modes.omega[inside], rtol=EXACT)
    beside = fit.model.poles * (1 + LIMIT)
    for frf, label in enumerate(labels):
        residues = (beside - fit.model.poles) * true_modes.receptance(beside, label)
        scale = np.abs(residues).max()
        assert_allclose(fit.model.residues[:, frf], residues, rtol=0, atol=1e-3 * scale)
    assert list(fit.zeros.frf) == sorted(fit.zeros.frf)
    for zero, frf in zip(fit.zeros.values, fit.zeros.frf, strict=True):
        size = np.abs(true_modes.receptance(1.1 * zero[None], labels[frf]))
        assert np.abs(true_modes.receptance(zero[None], labels[frf])) < 1e-6 * size


def test_zeros_of_a_label_make_its_receptance_vanish():
    true_modes, labels, _ = problem()
    for label in labels:
        zeros = true_modes.zeros(label)[:3]
        size = np.abs(true_modes.receptance(1.1 * zeros, label))
        assert np.all(np.abs(true_modes.receptance(zeros, label)) < 1e-6 * size)


def test_reported_poles_scatter_about_the_truth_as_their_covariance_says():
    true_modes, labels, band = problem()
    exact = simulate_fit(true_modes, labels, band, noise=0.002)
    n = 2 * exact.n_modes
    errors = []
    for seed in range(DRAWS):
        fit = simulate_fit(true_modes, labels, band, noise=0.002, rng=np.random.default_rng(seed))
        off = fit.model.poles - exact.model.poles
        errors.append(np.column_stack([off.real, off.imag]).ravel())
    chi2 = np.einsum("di,ij,dj->d", errors, np.linalg.inv(exact.covariance[:n, :n]), errors)
    assert abs(chi2.mean() / n - 1) < 4 * np.sqrt(2 / (n * DRAWS))  # four standard deviations of the mean
