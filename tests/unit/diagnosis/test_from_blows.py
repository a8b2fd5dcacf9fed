"""Noise of recordings, as blows show it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from frf_ipz.diagnosis.measured.from_blows import measure, survey
from frf_ipz.diagnosis.observations import Blow, Observations, Sensor
from frf_ipz.dofs import parse_dof
from frf_ipz.quantities import FrfQuantity

RATE_HZ, SAMPLES = 1000.0, 4000
STEP = 0.02  # of the recorder, m/s^2
HALF_HZ, HARDLY = 200.0, 0.02  # above that line a shaker does less, by this factor
RESONANCE = np.poly(0.99 * np.exp([0.8j, -0.8j])).real  # of a digital filter, 127 Hz
AS_READ = 0.3  # of the noise's density, which is read from three records


def blow(name, place, level, shown):
    """A short pulse and a motion that dies out, as a recorder with coarse steps shows it."""
    time = np.arange(SAMPLES) / RATE_HZ
    force = np.where((time > 0.1) & (time < 0.103), level, 0.0)
    after = np.maximum(time - 0.1, 0.0)
    motion = shown * level * np.exp(-8 * after) * np.sin(2 * np.pi * 60 * after)
    return Blow(
        name=name,
        input_channel="force",
        input_dof=parse_dof(place),
        sensors=(Sensor(channel="acc", dof=parse_dof("9:+z"), quantity=FrfQuantity.ACCELERANCE),),
        step_s=1 / RATE_HZ,
        force=force + 1e-3 * np.random.default_rng(len(name)).standard_normal(SAMPLES),
        responses=STEP * np.round(motion[None] / STEP),
    )


@pytest.mark.parametrize("shown", [0.0, 0.1])
def test_a_recorder_has_at_least_the_noise_of_its_steps(shown):
    """A channel on its node shows exact zeros for some blows: that is no measure of its noise."""
    blows = [blow(f"a{'x' * n}", "5:+z", level, 0.1) for n, level in enumerate((10.0, 17.0))]
    blows += [blow(f"b{'y' * n}", "7:+z", level, shown) for n, level in enumerate((11.0, 23.0, 35.0))]
    found = survey(Observations(kind="hammer", blows=tuple(blows), band_hz=(20.0, 200.0)))
    assert found.responses["acc"].white >= STEP**2 / 12 / RATE_HZ * (1 - 1e-9)


def record(name, drawn, noise_n):
    """A shaker's record from rest: one half of the band is driven far less."""
    rng = np.random.default_rng(drawn)
    lines = np.fft.rfft(rng.standard_normal(SAMPLES))
    frequency = np.fft.rfftfreq(SAMPLES, 1 / RATE_HZ)
    force = np.fft.irfft(np.where(frequency < HALF_HZ, 1.0, HARDLY) * lines, SAMPLES)
    shown = force + noise_n * rng.standard_normal(SAMPLES)
    return Blow(
        name=name,
        input_channel="force",
        input_dof=parse_dof("5:+z"),
        sensors=(Sensor(channel="acc", dof=parse_dof("9:+z"), quantity=FrfQuantity.ACCELERANCE),),
        step_s=1 / RATE_HZ,
        force=shown,
        responses=lfilter([1.0], RESONANCE, force)[None],
    )


def test_noise_of_a_force_counts_on_strong_lines_as_on_weak_ones():
    noise_n, trials = 1e-3, 40
    frequency = np.concatenate([np.arange(40.0, 180.0, 10.0), np.arange(240.0, 380.0, 10.0)])
    s = 3.0 + 2j * np.pi * frequency
    errors, stated = [], []
    for trial in range(trials):
        blows = tuple(record(f"r{k}", (trial, k), noise_n) for k in range(3))
        found = survey(Observations(kind="random", blows=blows, band_hz=(30.0, 390.0)))
        measured = measure(found, s)
        errors.append(np.abs(measured.values[:, 0] * np.polyval(RESONANCE[::-1], np.exp(-s / RATE_HZ)) - 1) ** 2)
        stated.append(np.sum(np.abs(measured.common[0]) ** 2, 1))
    ratio = np.mean(errors, 0) / np.mean(stated, 0)
    scatter = 4 / np.sqrt(trials)  # four standard deviations of a mean of squared moduli
    assert np.all(np.abs(ratio - 1) < scatter + AS_READ)


@pytest.mark.parametrize("lead_s", [0.05, 1.5])
def test_what_lies_before_a_blow_does_not_blur_its_frfs(lead_s):
    """A transform beside the axis weighs the first samples most: at 1.5 s the blow itself would count for nothing."""
    place, shown, drawn = "5:+z", 0.1, np.random.default_rng(1)

    def late(name, level):
        one = blow(name, place, level, shown)
        lead = round((lead_s - 0.05) * RATE_HZ)
        quiet = 1e-3 * drawn.standard_normal((1, lead))
        hum = 1e-4 * drawn.standard_normal((1, lead + SAMPLES - 50))
        force = np.concatenate([1e-3 * drawn.standard_normal(lead), one.force[50:]])
        responses = np.concatenate([quiet, shown * level * _decaying(SAMPLES - 50)[None]], axis=1) + hum
        return replace(one, force=force, responses=responses)

    blows = tuple(late(f"a{'x' * n}", level) for n, level in enumerate((10.0, 17.0, 30.0)))
    found = survey(Observations(kind="hammer", blows=blows, band_hz=(20.0, 200.0)))
    s = np.array([12.0 + 2j * np.pi * 120.0])
    measured = measure(found, s)
    pulse = np.where((np.arange(SAMPLES) > 100) & (np.arange(SAMPLES) < 103), 1.0, 0.0)[50:]
    turned = np.exp(-s * np.arange(SAMPLES - 50) / RATE_HZ)
    true = shown * (turned @ _decaying(SAMPLES - 50)) / (turned @ pulse)
    assert abs(measured.values[0, 0] / true - 1) < 0.01
    assert np.sqrt(measured.covariance[0, 0, 0].real) < 0.01 * abs(true)


def _decaying(samples):
    after = np.maximum((np.arange(samples) + 50) / RATE_HZ - 0.1, 0.0)
    return np.exp(-8 * after) * np.sin(2 * np.pi * 60 * after)
