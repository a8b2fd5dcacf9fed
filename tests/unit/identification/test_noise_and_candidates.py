"""Noise from scatter along the lines, candidates for missing modes, terms out of band."""

import numpy as np
import pytest

from frf_ipz.identification.likelihood.smooth_terms import smooth_terms_of_band
from frf_ipz.identification.noise import misfit_variance, rough_variance
from frf_ipz.identification.search.candidates import find_candidates
from frf_ipz.numerics.partial_fractions import unstacked

LINES_HZ = np.arange(1, 4097) * 0.25
MODE_ABOVE = 5e-3  # of the largest value: the misfit at the band's edge by a mode 20 % above it
S = 2j * np.pi * LINES_HZ


def white(shape, seed):
    rng = np.random.default_rng(seed)
    return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)


def test_noise_under_a_sharp_peak():
    peak = 1e4 / (S - (-1.0 + 3000j))
    level = np.where(LINES_HZ > 500, 3.0, 1.0)
    variance = rough_variance((peak + level * white(len(S), 1))[:, None])[:, 0]
    for part in (slice(100, 1800), slice(2300, 4000)):
        # of 40 blocks with 20 % each
        assert np.median(variance[part]) == pytest.approx(2 * level[part][0] ** 2, rel=0.15)


def test_noise_that_follows_the_response():
    size = np.abs(1e4 / (S - (-30.0 + 3000j)))
    noise = size * white(len(S), 2) * 0.01
    ratio = misfit_variance(noise[:, None], size[:, None])[:, 0] / (2 * (0.01 * size) ** 2)
    assert np.median(ratio) == pytest.approx(1.0, rel=0.1)
    assert ratio[np.argmax(size)] == pytest.approx(1.0, rel=0.6)  # from one block of lines


def test_noise_alone_gives_no_candidates():
    alarms = [len(find_candidates(LINES_HZ, white((len(S), 6), seed), 5).poles) for seed in range(40)]
    assert sum(alarms) <= 1  # one in a thousand each is meant


@pytest.mark.parametrize("half_width_hz", [0.1, 1.0, 20.0])
def test_a_missing_mode_is_found_at_its_frequency(half_width_hz):
    pole = 2 * np.pi * (-half_width_hz + 400.3j)
    energy = np.sqrt(np.sum(1 / np.abs(S - pole) ** 2))
    strength = 12.0 / energy
    misfit = white((len(S), 6), 3) + strength * np.exp(1j * np.arange(6)) / (S[:, None] - pole)
    candidates = find_candidates(LINES_HZ, misfit, 5)
    assert candidates.strength[0] > 1
    assert abs(candidates.poles[0].imag / 2 / np.pi - 400.3) < max(0.25, half_width_hz)
    assert 1 / 6 < -candidates.poles[0].real / 2 / np.pi / half_width_hz < 6


def test_errors_that_lines_share_raise_the_level():
    smooth = np.stack([np.convolve(column, np.ones(15) / np.sqrt(15), "same") for column in white((len(S), 6), 4).T], 1)
    candidates = find_candidates(LINES_HZ, smooth, 5)
    assert len(candidates.poles) == 0
    assert candidates.level[-1] > 5


@pytest.mark.parametrize("band", [(0.25, 1000.0), (300.0, 900.0)])
def test_terms_follow_modes_out_of_band(band):
    used = (band[0] <= LINES_HZ) & (band[1] >= LINES_HZ)
    s = S[used]
    terms = smooth_terms_of_band(band, 0.25).first(3)
    far = [omega * 2 * np.pi * complex(-0.005, 1) for omega in (1.2 * band[1], 1.6 * band[1], 3 * band[1])]
    values = sum(1j / (s - pole) - 1j / (s - np.conj(pole)) for pole in far) + 2e-3 / s**2
    columns = terms.columns(s)
    scale = np.linalg.norm(columns, axis=0)
    rows = np.concatenate([values.real, values.imag])
    misfit = rows - columns / scale @ np.linalg.lstsq(columns / scale, rows, rcond=None)[0]
    assert np.abs(unstacked(misfit)).max() < MODE_ABOVE * np.abs(values).max()
