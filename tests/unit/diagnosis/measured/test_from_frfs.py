"""FRFs continued off their lines: errors by the unknown FRF outside the band."""

from types import SimpleNamespace

import numpy as np
from numpy.testing import assert_allclose

from frf_ipz.diagnosis.measured.contour import COARSE, fine_contour, wide_contour
from frf_ipz.diagnosis.measured.from_frfs import (
    _noise_covariance,
    continue_frfs,
    continue_frfs_coarsely,
    survey_frfs,
)
from frf_ipz.dofs import Dof
from frf_ipz.frf import FrfLabel, FrfQuantity, FrfSet

BAND_HZ = (4.0, 60.0)
INSIDE_HZ, OUTSIDE_HZ = (11.0, 24.0, 41.0), (2.9, 71.0, 120.0)


def modes(rng, outside_size):
    """Poles and residues of a structure of which the band shows three modes."""
    poles = 2 * np.pi * np.array(INSIDE_HZ + OUTSIDE_HZ) * (1j - 0.002)
    sizes = np.array([1.0] * 3 + [outside_size] * 3) * np.abs(poles)
    return poles, sizes * rng.choice([-1, 1], len(poles)) * rng.uniform(0.5, 1.5, len(poles))


def exact(structure, s):
    """(n_points,) receptance, m/N."""
    poles, sizes = structure
    return np.sum(sizes * np.abs(poles) / ((s[:, None] - poles) * (s[:, None] - poles.conj())), axis=1)


def survey(structure):
    """FRFs in the band."""
    frequency_hz = np.arange(2400, 37000) / 600
    values = exact(structure, 2j * np.pi * frequency_hz)[:, None]
    label = FrfLabel(output_dof=Dof(1, "z"), input_dof=Dof(2, "z"), quantity=FrfQuantity.RECEPTANCE)
    even = np.full(values.shape, 1e-12)
    frfs = FrfSet(
        frequency_hz=frequency_hz,
        values=values,
        labels=(label,),
        variance=even,
        coherence=np.ones(values.shape),
        averages=np.array([3]),
    )
    return survey_frfs(frfs, BAND_HZ)


def continued(structure):
    """The same, continued off their lines."""
    frf_survey = survey(structure)
    return continue_frfs(frf_survey, fine_contour(frf_survey.resonances, BAND_HZ, frf_survey.least_decay_1_s))


def measured_of(n, outside_size):
    """Structures with their FRFs."""
    structures = [modes(np.random.default_rng(seed), outside_size) for seed in range(n)]
    return [(structure, continued(structure)) for structure in structures]


def error_of(structure, measured):
    """(n_points,) array, m/N."""
    return measured.values[:, 0] - exact(structure, measured.s)


def test_an_frf_is_taken_as_constant_outside_the_band():
    """Were it taken to be there what it is in the band, errors would be three times as large."""
    missed = []
    for structure, measured in measured_of(5, 0.1):
        inner = np.abs(measured.frequency_hz - 30.0) < 18.0
        missed.append(np.median(np.abs(error_of(structure, measured))[inner] / measured.size[inner, 0]))
    assert np.median(missed) < 6e-5


def test_errors_by_the_frf_outside_the_band_are_correlated():
    """The few unknown numbers outside the band explain them, and their sizes are as expected."""
    for structure, measured in measured_of(8, 1.0):
        error, covariance = error_of(structure, measured), measured.covariance[0]
        variance = np.diag(covariance).real
        assert np.mean(np.abs(np.linalg.solve(np.linalg.cholesky(covariance), error)) ** 2) < 0.5
        assert np.max(np.abs(error) ** 2 / variance) < 16.0
        assert np.abs(covariance[20, 21]) > 0.9 * np.sqrt(variance[20] * variance[21])


def test_a_global_scan_takes_errors_as_independent():
    """A correlated error would make a model that is far off look wrong in its details alone."""
    structure = modes(np.random.default_rng(0), 1.0)
    frf_survey = survey(structure)
    measured = continue_frfs_coarsely(frf_survey, wide_contour(BAND_HZ, frf_survey.least_decay_1_s, COARSE))
    covariance = measured.covariance[0]
    variance = np.diag(covariance).real
    assert np.abs(covariance - np.diag(variance)).max() < 1e-6 * variance.max()
    assert np.max(np.abs(error_of(structure, measured)) ** 2 / variance) < 16.0


def test_errors_of_lines_are_those_of_their_weighted_sums():
    """The covariance is Hermitian, and that of sums of independent errors."""
    rng = np.random.default_rng(4)
    weights = rng.standard_normal((7, 40)) + 1j * rng.standard_normal((7, 40))
    of_lines = SimpleNamespace(variance=rng.random((40, 2)))
    covariance = _noise_covariance(of_lines, weights)
    for found, variance in zip(covariance, of_lines.variance.T, strict=True):
        assert_allclose(found, weights @ np.diag(variance) @ weights.conj().T, rtol=1e-9, atol=1e-9)
