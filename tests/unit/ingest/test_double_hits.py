"""Double hits are found, and clean hits are not mistaken for them."""

import numpy as np
import pytest

from frf_ipz.ingest.signals.pulses import find_pulse, pulse_extent
from frf_ipz.ingest.survey.checks import SECOND_PULSE

RATE_HZ, N_SAMPLES = 8192, 32768
CAUGHT, FALSE_ALARMS = 0.97, 0.01  # shares: the aims of the project
N_FAST, N_SLOW = 50, 2000


def half_sine(height, at_s, length_s):
    time = np.arange(N_SAMPLES) / RATE_HZ
    inside = (time > at_s) & (time < at_s + length_s)
    return np.where(inside, height * np.sin(np.pi * (time - at_s) / length_s), 0.0)


def hit(rng, noise, *, twice):
    """A hit of about 100 N, and for `twice` one of 10 to 60 % of it 4 to 60 ms later."""
    length_s, height = 0.8e-3 * (1 + 0.1 * rng.standard_normal()), 100 * (1 + 0.2 * rng.standard_normal())
    force = half_sine(height, 0.02, length_s) + noise * rng.standard_normal(N_SAMPLES)
    if twice:
        force += half_sine(height * rng.uniform(0.1, 0.6), 0.02 + rng.uniform(4e-3, 6e-2), 1.2 * length_s)
    return force


def is_double(force):
    return find_pulse(force, threshold=SECOND_PULSE).bumps.size > 0


def share(count, noise, seed, *, twice):
    rng = np.random.default_rng(seed)
    return np.mean([is_double(hit(rng, noise, twice=twice)) for _ in range(count)])


@pytest.mark.parametrize("noise", [0.002, 0.02, 0.2])
def test_double_hits_are_caught_and_clean_ones_pass(noise):
    assert share(N_FAST, noise, 7, twice=True) >= CAUGHT
    assert share(N_FAST, noise, 8, twice=False) <= FALSE_ALARMS


@pytest.mark.slow
@pytest.mark.parametrize("noise", [0.002, 0.02, 0.2])
def test_double_hits_are_caught_and_clean_ones_pass_many_times(noise):
    assert share(N_SLOW, noise, 1001, twice=True) >= CAUGHT
    assert share(N_SLOW, noise, 1002, twice=False) <= FALSE_ALARMS


def test_the_second_hit_is_found_where_it_is():
    force = half_sine(100.0, 0.02, 0.8e-3) + half_sine(30.0, 0.035, 0.8e-3)
    pulse = find_pulse(force, threshold=SECOND_PULSE)
    assert list(pulse.bumps) == pytest.approx([(0.035 + 0.4e-3) * RATE_HZ], abs=1.0)
    assert list(pulse.ratios) == pytest.approx([0.3], rel=0.05)


def test_a_weaker_hit_before_the_strongest_counts():
    assert is_double(half_sine(40.0, 0.02, 0.8e-3) + half_sine(100.0, 0.03, 0.8e-3))


def test_pulses_may_push_the_other_way():
    force = -half_sine(100.0, 0.02, 0.8e-3)
    pulse = find_pulse(force, threshold=SECOND_PULSE)
    assert pulse.height == pytest.approx(-100.0, rel=0.05)
    assert pulse.bumps.size == 0
    assert is_double(force - half_sine(20.0, 0.04, 0.8e-3))


@pytest.mark.parametrize("kind", ["ringing", "slow ringing", "hum", "undershoot", "hump"])
def test_what_amplifiers_do_to_a_pulse_is_no_second_hit(kind):
    time = np.arange(N_SAMPLES) / RATE_HZ
    after = np.maximum(time - 0.0208, 0.0)
    force = half_sine(100.0, 0.02, 0.8e-3) + 0.01 * np.random.default_rng(2).standard_normal(N_SAMPLES)
    force += {
        "ringing": np.where(after > 0, 8.0 * np.exp(-after / 2e-3) * np.sin(2 * np.pi * 3600.0 * after), 0.0),
        "slow ringing": np.where(after > 0, 2.0 * np.exp(-after / 0.03) * np.sin(2 * np.pi * 200.0 * after), 0.0),
        "hum": 1.0 * np.sin(2 * np.pi * 50.0 * time),
        "hump": np.where(after > 0, 12.0 * (after / 0.02) * np.exp(-after / 0.02), 0.0),
        "undershoot": np.where(after > 0, -4.0 * np.exp(-after / 0.3), 0.0),
    }[kind]
    assert not is_double(force)


def test_strong_noise_is_no_second_hit():
    rng = np.random.default_rng(3)
    hits = [half_sine(100.0, 0.02, 0.8e-3) + 5.0 * rng.standard_normal(N_SAMPLES) for _ in range(10)]
    assert not any(is_double(force) for force in hits)


def test_the_extent_of_a_pulse_is_where_it_stands_out():
    force = half_sine(100.0, 0.02, 0.8e-3)
    start, stop = pulse_extent(force, find_pulse(force, threshold=SECOND_PULSE))
    loud = np.flatnonzero(np.abs(force) > 1e-3)
    assert start <= loud[0]
    assert loud[-1] < stop
    assert stop - start < 3 * len(loud)


def test_the_extent_ends_before_what_comes_much_later():
    alone = half_sine(100.0, 0.02, 0.8e-3)
    force = alone + half_sine(2.0, 0.5, 0.8e-3)
    assert pulse_extent(force, find_pulse(force, threshold=SECOND_PULSE)) == pulse_extent(
        alone, find_pulse(alone, threshold=SECOND_PULSE)
    )


def test_the_width_is_that_at_half_of_the_height():
    pulse = find_pulse(half_sine(100.0, 0.02, 3e-3), threshold=SECOND_PULSE)
    assert pulse.width / RATE_HZ == pytest.approx(2e-3, rel=0.02)  # a half sine is above half for two thirds
