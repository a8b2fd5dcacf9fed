"""The pole of a single resonance."""

import numpy as np
import pytest

from frf_ipz.diagnosis.measured.local_pole import fit_local_pole, lines_around_pole

POLE = 2 * np.pi * 50 * (-0.01 + 1j)
S = 6.0 + 2j * np.pi * np.linspace(48.0, 52.0, 30)


def resonance(noise):
    return (1 / (S - POLE) + 0.01) * (1 + noise * np.random.default_rng(0).standard_normal(len(S)))


def test_standard_deviations_do_not_depend_on_the_unit():
    """Of one resonance with noise, as accelerance and as faint as compliances in m/N are."""
    strong, faint = (fit_local_pole(S, unit * resonance(1e-3), 1.001 * POLE, duration_s=8.0) for unit in (1.0, 1e-9))
    np.testing.assert_allclose([faint.pole, faint.std_rad_s], [strong.pole, strong.std_rad_s], rtol=1e-6)
    assert strong.std_rad_s > 1e-5 * abs(strong.pole)
    assert abs(strong.pole - POLE) < 4 * strong.std_rad_s


def test_noise_alone_has_no_pole():
    rng = np.random.default_rng(1)
    assert (
        fit_local_pole(S, rng.standard_normal(len(S)) + 1j * rng.standard_normal(len(S)), POLE, duration_s=8.0) is None
    )


@pytest.mark.parametrize("padded", [1, 4])
@pytest.mark.parametrize("sigma", [0.0, 2.0])
@pytest.mark.parametrize("decay", [4.0, 12.0])
def test_deviations_are_the_scatter_of_poles_though_lines_share_their_noise(sigma, padded, decay):
    """A window makes neighbouring lines alike, and so do zeros behind a record: eight times too small they were."""
    rate_hz, count, pole = 1000.0, 4000, complex(-decay, 2 * np.pi * 60)
    time = np.arange(count) / rate_hz
    s = sigma + 2j * np.pi * np.fft.rfftfreq(padded * count, 1 / rate_hz)
    nearest = lines_around_pole(s, pole)
    poles, stated = [], []
    for seed in range(100):
        signal = np.exp(-decay * time) * np.sin(pole.imag * time)
        signal += 0.02 * np.random.default_rng(seed).standard_normal(count)
        lines = np.fft.rfft(signal * np.exp(-sigma * time), padded * count) / rate_hz
        local = fit_local_pole(s[nearest], lines[nearest], pole, duration_s=count / rate_hz)
        poles.append(local.pole)
        stated.append(local.std_rad_s)
    scatter = np.sqrt(np.var(poles) / 2)
    assert 0.75 < scatter / np.mean(stated) < 1.25
