"""One FRF among good ones that no modes of theirs explain: it is named, counts by its misfit, and draws no poles."""

from dataclasses import replace

import numpy as np
import pytest

from frf_ipz.identification.fit import fit_modes
from synthetic_frfs import accelerances, random_modes

BAD = 3
LINES_HZ = np.arange(60, 801) * 0.5


def errors_over_std(seed, spoil):
    """Give errors over deviations of poles, of the bad FRF's residues and of the others', and the warnings."""
    truth = random_modes([71.0, 134.0, 236.0, 329.0], 0.007, n_outputs=5, n_inputs=1, seed=seed)
    frfs = accelerances(truth, LINES_HZ, noise=1e-3, seed=seed)
    rng = np.random.default_rng(seed)
    noise = (rng.standard_normal(frfs.n_lines) + 1j * rng.standard_normal(frfs.n_lines)) / np.sqrt(2)
    values = frfs.values.copy()
    values[:, BAD] += spoil(noise, np.sqrt(frfs.variance[:, BAD]), values[:, BAD])
    fit = fit_modes(replace(frfs, values=values))
    near = [int(np.argmin(np.abs(fit.model.poles[: fit.n_modes] - pole))) for pole in truth.poles]
    residues = np.abs(fit.model.residues[near] - truth.residues() * truth.poles[:, None] ** 2)
    residues /= np.sqrt(np.trace(fit.residue_covariance[near], axis1=2, axis2=3))
    stds = np.sqrt(np.diag(fit.covariance)[: 2 * fit.n_modes].reshape(-1, 2).sum(axis=1))
    poles = np.abs(fit.model.poles[near] - truth.poles) / stds[near]
    return poles, residues[:, BAD], np.delete(residues, BAD, axis=1), fit.warnings


@pytest.mark.parametrize(
    "spoil",
    [lambda noise, std, frf: 20 * noise * std, lambda noise, std, frf: 0.03 * noise * frf],  # noqa: ARG005
    ids=["more noise than is stated", "a gain that wavers"],
)
def test_an_frf_that_the_fit_misses_is_named_and_has_the_deviations_of_its_misfit(spoil):
    for seed in (1, 2):  # of the first a factor common to all FRFs was made
        poles, of_bad, of_others, warnings = errors_over_std(seed, spoil)
        for errors in (poles, of_bad, of_others):
            assert np.sqrt(np.mean(errors**2)) < 2.0
        assert any("misses 1 FRF of 5" in text and "4:+z / 1:+z" in text for text in warnings)


def test_the_scatter_of_few_records_makes_no_missed_frf():
    frfs = accelerances(random_modes([71.0, 134.0, 236.0], 0.007, n_outputs=3, n_inputs=1, seed=1), LINES_HZ, seed=1)
    said = []
    for averages in (4, 100):  # of an FRF whose scatter is 1.5 times too small
        variance = frfs.variance * np.array([1.0, 1 / 1.5**2, 1.0])
        fit = fit_modes(replace(frfs, variance=variance, averages=np.full(3, averages)))
        said.append(any("misses 1 FRF of 3" in text for text in fit.warnings))
    assert said == [False, True]


def test_good_frfs_are_not_named():
    assert not errors_over_std(1, lambda noise, std, frf: 0.0)[3]  # noqa: ARG005
