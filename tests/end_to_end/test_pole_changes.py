"""What `pipelines/pole_changes.py` expects of fits to overlapping data is what estimates from such data differ by."""

import importlib.util
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import frf_ipz

SCRIPT = Path(__file__).parents[2] / "pipelines" / "pole_changes.py"
POLE, RESIDUES = -8.0 + 2j * np.pi * 100.0, np.array([[1.0, 0.5j, 2.0]])
BAND = (80.0, 130.0)
TRIALS = 1000
SCATTER = 0.1  # of a variance that so many trials tell: three times its deviation, 1 / sqrt(1000)


@pytest.fixture(scope="module")
def script():
    specification = importlib.util.spec_from_file_location("pole_changes", SCRIPT)
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def case():
    """FRFs of one mode with noise that differs from line to line, and a fit of them that knows all but the pole."""
    lines = np.arange(60.0, 150.0, 0.5)
    variance = np.random.default_rng(1).uniform(0.5, 2.0, (len(lines), 3)) * [1.0, 0.3, 2.0]
    values = RESIDUES / (2j * np.pi * lines[:, None] - POLE)
    sensors = [frf_ipz.Dof(node, "z") for node in (1, 2, 3)]
    frfs = frf_ipz.FrfSet.from_arrays(
        lines, values[:, :, None], outputs=sensors, inputs=sensors[:1], variance=variance[:, :, None]
    )
    slopes = np.abs(RESIDUES / (frfs.s[:, None] - POLE) ** 2) ** 2
    told = 1 / (slopes / variance)[frfs.in_band(BAND)].sum()
    fit = SimpleNamespace(
        covariance=told * np.eye(2),
        model=SimpleNamespace(poles=np.array([POLE]), residues=RESIDUES),
        n_modes=1,
        band_hz=BAND,
    )
    return frfs, fit


HALF, THIRD, ALL = np.arange(180)[:, None] % 2 == 0, np.arange(180)[:, None] % 3 == 1, np.ones((1, 1))
OVERLAPPING = {
    "half of the lines": (BAND, HALF, 0.0),
    "a third of the lines": (BAND, THIRD, 0.0),
    "one FRF less": (BAND, np.arange(3)[None] != 2, 0.0),
    "noise": (BAND, ALL, 0.7),
    "a band within": ((95.0, 105.0), ALL, 0.0),
    "a wider band": ((70.0, 140.0), ALL, 0.0),
    "a band that is moved": ((99.0, 140.0), ALL, 0.0),
}


@pytest.mark.parametrize("of", OVERLAPPING)
def test_changes_that_overlapping_data_leave(script, case, of):
    frfs, fit = case
    band, kept, noise = OVERLAPPING[of]
    rng = np.random.default_rng(2)
    slopes = RESIDUES / (frfs.s[:, None] - POLE) ** 2
    before = frfs.in_band(BAND)[:, None] / frfs.variance
    after = frfs.in_band(band)[:, None] * kept / (frfs.variance + noise)

    def estimates(errors, weights):
        return (np.conj(slopes) * errors * weights).sum(axis=(1, 2)) / (np.abs(slopes) ** 2 * weights).sum()

    def draw(variance):
        parts = rng.standard_normal((2, TRIALS, *frfs.values.shape))
        return (parts[0] + 1j * parts[1]) * np.sqrt(variance / 2)

    errors = draw(frfs.variance)
    first = estimates(errors, before)
    change = estimates(errors + draw(noise), after) - first
    due = script.expected(fit, frfs, band, (kept, noise))
    np.testing.assert_allclose(np.mean(np.abs(change) ** 2) / np.mean(np.abs(first) ** 2), due, rtol=2 * SCATTER)


def test_a_share_of_the_same_lines_differs_by_the_rest_of_them(script, case):
    frfs, fit = case
    for share in (1 / 2, 1 / 3, 4 / 5):
        due = script.expected(fit, frfs, BAND, (np.full((1, 1), share), 0.0))
        np.testing.assert_allclose(due, 1 / share - 1, rtol=1e-12)
