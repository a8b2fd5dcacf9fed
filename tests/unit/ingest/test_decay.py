"""How much of a response remains at its end, and the noise under it."""

import numpy as np
import pytest

from frf_ipz.ingest.signals.decay import measure_decay, noise_power
from frf_ipz.ingest.signals.windows import correlated_lines

STEP_S, N_SAMPLES = 1 / 4096, 16384
TIME = np.arange(N_SAMPLES) * STEP_S
DURATION_S = N_SAMPLES * STEP_S


def ringing(frequency_hz, remainder, amplitude=1.0):
    return amplitude * remainder ** (TIME / DURATION_S) * np.sin(2 * np.pi * frequency_hz * TIME)


@pytest.mark.parametrize("remainder", [0.3, 0.03, 3e-3])
@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_the_remaining_amplitude_of_a_mode(remainder, noise):
    response = ringing(211.3, remainder) + noise * np.random.default_rng(1).standard_normal(N_SAMPLES)
    decay = measure_decay(response, STEP_S, 2)
    assert decay.remaining_amplitude == pytest.approx(remainder, rel=0.05)
    assert decay.frequency_hz == pytest.approx(211.3, abs=1.0)


def test_a_signal_in_coarse_steps_rests_at_0_without_a_word_of_numpy():
    response = np.round(ringing(211.3, 1e-4) / 0.05) * 0.05
    with np.errstate(all="raise", under="ignore"):
        decay = measure_decay(response, STEP_S, 2)
    assert decay.remaining_amplitude < 0.05


def test_the_slowest_of_several_modes_counts():
    response = ringing(90.0, 5e-3, 10.0) + ringing(211.3, 0.02) + ringing(700.0, 1e-3)
    decay = measure_decay(response, STEP_S, 2)
    assert decay.remaining_amplitude == pytest.approx(0.02, rel=0.05)
    assert decay.frequency_hz == pytest.approx(211.3, abs=1.0)


def test_modes_below_the_noise_and_noise_alone_do_not_ring():
    rng = np.random.default_rng(2)
    assert measure_decay(rng.standard_normal(N_SAMPLES), STEP_S, 2).remaining_amplitude == 0.0
    response = ringing(211.3, 1e-12) + 1e-3 * rng.standard_normal(N_SAMPLES)
    assert measure_decay(response, STEP_S, 2).remaining_amplitude == 0.0


def test_hum_does_not_ring_down():
    response = ringing(211.3, 1e-4) + ringing(150.0, 0.95, 0.05)
    assert measure_decay(response, STEP_S, 2).remaining_amplitude < 1e-3
    mode = ringing(211.3, 1e-4) + ringing(163.0, 0.95, 0.05)
    assert measure_decay(mode, STEP_S, 2).remaining_amplitude > 0.5


@pytest.mark.parametrize("seed", range(5))
def test_hum_of_any_frequency_does_not_ring_down(seed):
    rng = np.random.default_rng(seed)
    hum = 0.3 * np.sin(2 * np.pi * 31.4 * TIME + seed)
    response = ringing(211.3, 0.01) + hum + 1e-3 * rng.standard_normal(N_SAMPLES)
    decay = measure_decay(response, STEP_S, 2)
    assert decay.frequency_hz == pytest.approx(211.3, abs=1.0)
    assert decay.remaining_amplitude == pytest.approx(0.01, rel=0.05)


def test_the_lowest_lines_have_the_noise_of_their_neighbours():
    """What is left of it at 0 Hz where an offset was taken off is no measure of them; it was counted 25 times."""
    n_samples, lines = 4096, np.arange(3, 12) / (2048 * STEP_S)
    noise = np.random.default_rng(7).standard_normal((200, n_samples))
    noise -= noise[:, n_samples // 2 :].mean(axis=1, keepdims=True)
    powers = np.array([noise_power(signal, STEP_S, lines) for signal in noise])
    np.testing.assert_allclose(powers.mean(axis=0), 1.0, atol=0.1)
    assert powers.min() > 0.2


def test_the_noise_is_measured_under_a_ringing_response():
    response = ringing(211.3, 0.1) + 0.01 * np.random.default_rng(3).standard_normal(N_SAMPLES)
    assert measure_decay(response, STEP_S, 2).noise == pytest.approx(0.01, rel=0.1)


def test_a_slow_mode_that_is_small_as_an_acceleration_counts_by_its_velocity():
    response = ringing(900.0, 1e-3, 1.0) + ringing(12.0, 0.2, 1e-3)
    assert measure_decay(response, STEP_S, 2).frequency_hz == pytest.approx(12.0, abs=1.0)
    weak = ringing(900.0, 1e-6, 1.0) + ringing(12.0, 0.2, 6e-6)
    assert measure_decay(weak, STEP_S, 2).remaining_amplitude < 0.1


def test_the_noise_power_follows_its_colour():
    rng = np.random.default_rng(4)
    white = rng.standard_normal(N_SAMPLES + 1)
    lines = np.array([100.0, 1000.0, 1900.0])
    expected = np.abs(1 - 0.9 * np.exp(-2j * np.pi * lines * STEP_S)) ** 2
    power = noise_power(white[1:] - 0.9 * white[:-1], STEP_S, lines)
    np.testing.assert_allclose(power, expected, rtol=0.5)  # the median of 51 lines varies by 20 %


def test_signals_that_are_too_short_give_no_decay_and_no_noise():
    assert measure_decay(np.ones(100), STEP_S, 2).remaining_amplitude == 0.0
    assert np.isnan(noise_power(np.ones(100), STEP_S, np.array([1.0]))).all()


def test_windowed_noise_is_independent_on_lines_far_enough_apart():
    """Monte Carlo: lines apart by what `correlated_lines` says hardly correlate, neighbours do."""
    rng = np.random.default_rng(5)
    decay, n_samples = 8.0, 1024
    window = np.exp(-decay * np.arange(n_samples) / n_samples)
    spectra = np.fft.rfft(rng.standard_normal((2000, n_samples)) * window)[:, 100:200]
    step = correlated_lines(decay)
    power = np.mean(np.abs(spectra) ** 2)

    def correlation(apart):
        return abs(np.mean(spectra[:, apart:] * spectra[:, :-apart].conj())) / power

    assert step == 4
    assert correlation(1) > 0.9
    assert correlation(step) < 0.6
    assert correlated_lines(0.0) == 1
