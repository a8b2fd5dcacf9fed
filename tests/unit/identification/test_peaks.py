"""A first look at FRFs finds the modes that make a peak, their shapes, and nothing where there is only noise."""

from dataclasses import replace

import numpy as np
import pytest

import frf_ipz
from frf_ipz.identification import peaks as peaks_module
from frf_ipz.identification.peaks import find_peaks

LINES_HZ = np.arange(5.0, 700.0, 0.25)
BEAM = frf_ipz.make_beam(
    length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=20,
    left="clamped", modal_ratio=0.004,
)  # fmt: skip
OUTPUTS, INPUTS = ("21:+z", "14:-z"), ("17:+z",)
NOISE = 0.01  # of the median modulus


def measured(*, noise, seed=3, only_noise=False):
    """Accelerances of the beam with noise of known variance."""
    dofs = [frf_ipz.parse_dof(text) for text in (*OUTPUTS, *INPUTS)]
    labels = [frf_ipz.FrfLabel(dof, dofs[2], frf_ipz.FrfQuantity.ACCELERANCE) for dof in dofs[:2]]
    values = frf_ipz.compute_frfs(BEAM, labels, 2j * np.pi * LINES_HZ)[:, :, None]
    size = noise * np.median(np.abs(values))
    errors = size * np.random.default_rng(seed).normal(size=(*values.shape, 2)).view(complex)[..., 0] / np.sqrt(2)
    return frf_ipz.FrfSet.from_arrays(
        LINES_HZ,
        errors if only_noise else values + errors,
        outputs=OUTPUTS,
        inputs=INPUTS,
        variance=np.full(values.shape, size**2),
    )


def test_frequencies_and_products_of_shapes_are_those_of_the_model():
    modes = frf_ipz.solve_modes(BEAM, n_modes=6)
    peaks = find_peaks(measured(noise=NOISE), frf_ipz.FitOptions(band_hz=(10.0, 690.0)))
    inside = modes.natural_frequency_hz < 690
    np.testing.assert_allclose(peaks.frequency_hz, modes.natural_frequency_hz[inside], rtol=2e-4)
    shapes = {dof.name: row[inside] for dof, row in zip(modes.dofs, modes.shapes, strict=True)}
    for column, output in enumerate(("21:z", "14:z")):  # the sign of the label is taken out
        expected = shapes[output] * shapes["17:z"]
        assert np.all(np.abs(peaks.products[:, column] - expected) < 5 * peaks.deviations[:, column])
        np.testing.assert_allclose(peaks.products[:, column], expected, atol=0.02 * np.abs(expected).max())
    np.testing.assert_allclose(peaks.damping_ratio, 0.004, rtol=0.05)


@pytest.mark.parametrize("seed", range(4))
def test_noise_makes_no_peak(seed):
    frfs = measured(noise=1.0, seed=seed, only_noise=True)
    assert not len(find_peaks(frfs, frf_ipz.FitOptions(band_hz=(10.0, 690.0))).frequency_hz)


def start_with(monkeypatch, change):
    """Let the polyreference method give other poles than it does."""
    find = peaks_module.find_start_poles

    def find_other(*arguments, **options):
        start = find(*arguments, **options)
        return replace(start, poles=np.sort_complex(change(start.poles)))

    monkeypatch.setattr(peaks_module, "find_start_poles", find_other)


def test_a_pole_that_stands_for_noise_is_no_peak(monkeypatch):
    false = 2 * np.pi * np.array([200.0, 450.0]) * (-0.01 + 1j)
    start_with(monkeypatch, lambda poles: np.concatenate([poles, false]))
    peaks = find_peaks(measured(noise=NOISE), frf_ipz.FitOptions(band_hz=(10.0, 690.0)))
    assert len(peaks.frequency_hz) == 4


def test_without_start_poles_what_stands_out_of_the_noise_is_taken(monkeypatch):
    """As happens in short bands with few lines."""
    start_with(monkeypatch, lambda poles: poles[:0])
    peaks = find_peaks(measured(noise=NOISE), frf_ipz.FitOptions(band_hz=(80.0, 120.0)))
    modes = frf_ipz.solve_modes(BEAM, n_modes=2)
    np.testing.assert_allclose(peaks.frequency_hz, modes.natural_frequency_hz[1:], rtol=1e-3)
