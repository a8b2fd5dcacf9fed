"""Noise of records, and the errors of transfer functions by it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from frf_ipz.diagnosis.measured.from_records import estimate_transfer_functions, survey_records
from frf_ipz.diagnosis.measured.noise import Noise
from frf_ipz.diagnosis.observations import Observations, ObservedRecord, Sensor
from frf_ipz.dofs import parse_dof
from frf_ipz.quantities import FrfQuantity

RATE_HZ, SAMPLES = 1000.0, 4000
STEP = 0.02  # of the recorder, m/s^2
HALF_HZ, HARDLY = 200.0, 0.02  # above that line a shaker does less, by this factor
RESONANCE = np.poly(0.99 * np.exp([0.8j, -0.8j])).real  # of a digital filter, 127 Hz
LEAD = 100  # samples before a shaker begins
AS_READ = 0.3  # of the noise's density, which is read from three records


def impact(name, dof, level, gain):
    """A short pulse and a motion that dies out, as a recorder with coarse steps shows it."""
    time = np.arange(SAMPLES) / RATE_HZ
    force = np.where((time > 0.1) & (time < 0.103), level, 0.0)
    after = np.maximum(time - 0.1, 0.0)
    motion = gain * level * np.exp(-8 * after) * np.sin(2 * np.pi * 60 * after)
    return ObservedRecord(
        name=name,
        input_channel="force",
        input_dof=parse_dof(dof),
        sensors=(Sensor(channel="acc", dof=parse_dof("9:+z"), quantity=FrfQuantity.ACCELERANCE),),
        step_s=1 / RATE_HZ,
        force=force + 1e-3 * np.random.default_rng(len(name)).standard_normal(SAMPLES),
        responses=STEP * np.round(motion[None] / STEP),
    )


@pytest.mark.parametrize("gain", [0.0, 0.1])
def test_a_recorder_has_at_least_the_noise_of_its_steps(gain):
    """A channel on its node shows exact zeros for some impacts: that is no measure of its noise."""
    records = [impact(f"a{'x' * n}", "5:+z", level, 0.1) for n, level in enumerate((10.0, 17.0))]
    records += [impact(f"b{'y' * n}", "7:+z", level, gain) for n, level in enumerate((11.0, 23.0, 35.0))]
    survey = survey_records(Observations(kind="hammer", records=tuple(records), band_hz=(20.0, 200.0)))
    assert survey.responses["acc"].white >= STEP**2 / 12 / RATE_HZ * (1 - 1e-9)


def record(name, drawn, noise_n):
    """A shaker's record from rest: one half of the band is driven far less."""
    rng = np.random.default_rng(drawn)
    lines = np.fft.rfft(rng.standard_normal(SAMPLES))
    frequency = np.fft.rfftfreq(SAMPLES, 1 / RATE_HZ)
    force = np.fft.irfft(np.where(frequency < HALF_HZ, 1.0, HARDLY) * lines, SAMPLES)
    recorded_force = force + noise_n * rng.standard_normal(SAMPLES)
    return ObservedRecord(
        name=name,
        input_channel="force",
        input_dof=parse_dof("5:+z"),
        sensors=(Sensor(channel="acc", dof=parse_dof("9:+z"), quantity=FrfQuantity.ACCELERANCE),),
        step_s=1 / RATE_HZ,
        force=recorded_force,
        responses=lfilter([1.0], RESONANCE, force)[None],
    )


def test_noise_of_a_force_counts_on_strong_lines_as_on_weak_ones():
    noise_n, trials = 1e-3, 40
    frequency = np.concatenate([np.arange(40.0, 180.0, 10.0), np.arange(240.0, 380.0, 10.0)])
    s = 3.0 + 2j * np.pi * frequency
    errors, stated = [], []
    for trial in range(trials):
        records = tuple(record(f"r{k}", (trial, k), noise_n) for k in range(3))
        survey = survey_records(Observations(kind="random", records=records, band_hz=(30.0, 390.0)))
        measured = estimate_transfer_functions(survey, s)
        errors.append(np.abs(measured.values[:, 0] * np.polyval(RESONANCE[::-1], np.exp(-s / RATE_HZ)) - 1) ** 2)
        stated.append(np.sum(np.abs(measured.shared_errors[0]) ** 2, 1))
    ratio = np.mean(errors, 0) / np.mean(stated, 0)
    scatter = 4 / np.sqrt(trials)  # four standard deviations of a mean of squared moduli
    assert np.all(np.abs(ratio - 1) < scatter + AS_READ)


def test_noise_of_a_force_that_falls_with_the_frequency_is_known_at_both_ends_of_the_band():
    """Two resonances, a decade apart; white noise alone would miss the lower one's by a factor of five."""
    white, pink, densities = 1e-9, 2e-7, []
    two = np.convolve(
        np.poly(0.995 * np.exp([0.12j, -0.12j])).real, np.poly(0.98 * np.exp([1.6j, -1.6j])).real
    )  # 19 and 255 Hz
    frequency = np.fft.rfftfreq(SAMPLES, 1 / RATE_HZ)
    density = white + pink / np.maximum(frequency, frequency[1])
    for trial in range(8):
        records = []
        for k in range(3):
            rng = np.random.default_rng((trial, k))
            base_record = record(f"r{k}", (trial, k), 0.0)
            noise = np.fft.irfft(np.fft.rfft(rng.standard_normal(SAMPLES)) * np.sqrt(density * RATE_HZ), SAMPLES)
            force = np.random.default_rng((k, trial)).standard_normal(SAMPLES)
            force[:LEAD] = 0.0
            responses = lfilter([1.0], two, force)[None]
            responses += 1e-4 * np.abs(responses).max() * rng.standard_normal(responses.shape)
            records.append(replace(base_record, force=force + noise, responses=responses))
        survey = survey_records(Observations(kind="random", records=tuple(records), band_hz=(10.0, 390.0)))
        densities.append(survey.force.density(np.array([19.0, 255.0])))
    ratio = np.median(densities, axis=0) / (white + pink / np.array([19.0, 255.0]))
    assert np.all((ratio > 0.5) & (ratio < 2.0))


def test_noise_of_a_force_counts_where_none_of_it_is_white():
    """Two of the densities that are read from channels may have no white part, and the median of all then neither."""
    records = tuple(record(f"r{k}", k, 1e-3) for k in range(3))
    survey = survey_records(Observations(kind="random", records=records, band_hz=(30.0, 390.0)))
    s = 3.0 + 2j * np.pi * np.arange(40.0, 180.0, 10.0)
    no_white, traces = (
        estimate_transfer_functions(replace(survey, force=Noise(white=white, pink=1e-6)), s).shared_errors[0]
        for white in (0.0, 1e-20)
    )
    assert np.abs(no_white).max() > 0
    np.testing.assert_allclose(no_white @ no_white.conj().T, traces @ traces.conj().T, rtol=1e-6)


def test_records_that_end_in_motion_have_the_error_of_what_is_missing():
    """A slow resonance is excited over the whole record: a transform beside the axis misses its end."""
    slow = np.poly(0.9995 * np.exp([0.3j, -0.3j])).real  # 48 Hz, and its motion lasts for 2 s of 4
    s = 2.0 + 2j * np.pi * np.arange(30.0, 70.0, 2.5)
    errors, stated = [], []
    for trial in range(40):
        records = []
        for k in range(3):
            base_record = record(f"r{k}", (trial, k), 0.0)
            force = np.where(np.arange(SAMPLES) > LEAD, base_record.force, 0.0)
            records.append(replace(base_record, force=force, responses=lfilter([1.0], slow, force)[None]))
        survey = survey_records(Observations(kind="random", records=tuple(records), band_hz=(20.0, 190.0)))
        measured = estimate_transfer_functions(survey, s)
        true = 1 / np.polyval(slow[::-1], np.exp(-s / RATE_HZ))
        errors.append(np.abs((measured.values[:, 0] - true) / true) ** 2)
        shared = np.sum(np.abs(measured.shared_errors[0]) ** 2, 1)
        separate = np.diagonal(measured.covariance[0]).real / np.abs(measured.values[:, 0]) ** 2
        stated.append(shared + separate)
    ratio = np.sqrt(np.mean(errors, 0) / np.mean(stated, 0))
    assert np.all((ratio > 0.3) & (ratio < 2.0)), ratio


@pytest.mark.parametrize("lead_s", [0.05, 1.5])
def test_the_time_before_an_impact_does_not_blur_its_frfs(lead_s):
    """A transform beside the axis weighs the first samples most: at 1.5 s the impact itself would count for nothing."""
    dof, gain, drawn = "5:+z", 0.1, np.random.default_rng(1)

    def late(name, level):
        base_record = impact(name, dof, level, gain)
        lead = round((lead_s - 0.05) * RATE_HZ)
        quiet = 1e-3 * drawn.standard_normal((1, lead))
        hum = 1e-4 * drawn.standard_normal((1, lead + SAMPLES - 50))
        force = np.concatenate([1e-3 * drawn.standard_normal(lead), base_record.force[50:]])
        responses = np.concatenate([quiet, gain * level * _decaying(SAMPLES - 50)[None]], axis=1) + hum
        return replace(base_record, force=force, responses=responses)

    records = tuple(late(f"a{'x' * n}", level) for n, level in enumerate((10.0, 17.0, 30.0)))
    survey = survey_records(Observations(kind="hammer", records=records, band_hz=(20.0, 200.0)))
    s = np.array([12.0 + 2j * np.pi * 120.0])
    measured = estimate_transfer_functions(survey, s)
    pulse = np.where((np.arange(SAMPLES) > 100) & (np.arange(SAMPLES) < 103), 1.0, 0.0)[50:]
    turned = np.exp(-s * np.arange(SAMPLES - 50) / RATE_HZ)
    true = gain * (turned @ _decaying(SAMPLES - 50)) / (turned @ pulse)
    assert abs(measured.values[0, 0] / true - 1) < 0.01
    assert np.sqrt(measured.covariance[0, 0, 0].real) < 0.01 * abs(true)


def _decaying(samples):
    after = np.maximum((np.arange(samples) + 50) / RATE_HZ - 0.1, 0.0)
    return np.exp(-8 * after) * np.sin(2 * np.pi * 60 * after)
