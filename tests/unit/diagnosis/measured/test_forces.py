"""Pulses of impacts, and what is noise around them."""

import numpy as np
import pytest
from scipy import signal

from frf_ipz.diagnosis.measured.forces import RINGING, TAPER, is_sweep, isolate_pulse, missing_ringing
from frf_ipz.diagnosis.observations import ObservedRecord, Sensor
from frf_ipz.dofs import parse_dof
from frf_ipz.quantities import FrfQuantity

SAMPLES, TOP, PULSE = 20_000, 30, 7  # the pulse begins soon after the record
PEAK_N, NOISE_N = 77.0, 0.23


def record(force):
    return ObservedRecord(
        name="b",
        input_channel="force",
        input_dof=parse_dof("5:+z"),
        sensors=(Sensor(channel="acc", dof=parse_dof("9:+z"), quantity=FrfQuantity.ACCELERANCE),),
        step_s=1e-3,
        force=force,
        responses=np.zeros((1, len(force))),
    )


def noisy_force(drawn, *starts):
    force = NOISE_N * np.random.default_rng(drawn).standard_normal(SAMPLES)
    for start in starts:
        force[start : start + PULSE] += PEAK_N * np.sin(np.pi * (np.arange(PULSE) + 0.5) / PULSE)
    return force


def test_noise_of_a_long_record_is_no_part_of_a_weak_impact():
    """A few samples before the impact, by chance quiet ones, do not say how far noise reaches in thousands."""
    longest = PULSE + 2 * (RINGING + TAPER)
    pulses = [isolate_pulse(record(noisy_force(drawn, TOP))) for drawn in range(300)]
    assert max(pulse.stop - pulse.start for pulse in pulses) <= longest


@pytest.mark.parametrize("second", [60, 400, 12_000, 19_000])
def test_a_second_contact_stays_in_the_pulse(second):
    force = noisy_force(0, TOP, second)
    pulse = isolate_pulse(record(force))
    np.testing.assert_array_equal(pulse.record.force[TOP - 3 : second + PULSE + 3], force[TOP - 3 : second + PULSE + 3])
    assert np.abs(pulse.record.force[second + PULSE + 2 * (RINGING + TAPER) :]).max() < 1e-12


@pytest.mark.parametrize(("samples", "starts"), [(1000, (100, 700)), (2000, (30, 1200, 1500))])
def test_late_contacts_of_short_records_are_no_noise(samples, starts):
    force = 0.01 * np.random.default_rng(1).standard_normal(SAMPLES)[:samples]
    for part, start in zip((1.0, 0.8, 0.12), starts, strict=False):
        force[start : start + 20] += 100.0 * part * np.sin(np.pi * (np.arange(20) + 0.5) / 20)
    isolated = isolate_pulse(record(force)).record.force
    np.testing.assert_array_equal(isolated[starts[0] : starts[-1] + 20], force[starts[0] : starts[-1] + 20])


@pytest.mark.parametrize("level", [0.0, 0.5])
def test_an_impact_hidden_by_noise_stays_where_it_is_largest(level):
    force = level * noisy_force(3)
    top = int(np.argmax(np.abs(force)))
    assert isolate_pulse(record(force)).record.force[top] == force[top]


@pytest.mark.parametrize(("start", "rings"), [(4, True), (RINGING + TAPER + 5, False)])
def test_ringing_is_missing_where_a_record_begins_within_it(start, rings):
    force = noisy_force(5, start)
    force[max(start - 4, 0) : start] += PEAK_N / 50 * np.array([-1.0, 1.0, -1.0, 1.0])
    impact = record(force)
    sizes = missing_ringing(isolate_pulse(impact), np.full((1, SAMPLES), 0.25))
    if rings:
        np.testing.assert_allclose(sizes, [PEAK_N / 50, 0.25], rtol=0.2)
    else:
        assert not sizes.any()


def drifting(rng):
    lines = np.fft.rfft(rng.standard_normal(SAMPLES))
    noise = np.fft.irfft(lines / np.sqrt(np.maximum(np.arange(lines.size), 1)), SAMPLES)
    return NOISE_N * (0.74 * noise / noise.std() + 0.67 * rng.standard_normal(SAMPLES))


def test_drift_is_no_part_of_the_impulse_of_a_weak_impact():
    rng = np.random.default_rng(6)
    relative_errors = []
    for _ in range(40):
        weak = np.zeros(SAMPLES)
        weak[200 : 200 + PULSE] = 0.3 * PEAK_N * np.sin(np.pi * (np.arange(PULSE) + 0.5) / PULSE)
        relative_errors.append(isolate_pulse(record(weak + drifting(rng))).record.force.sum() / weak.sum() - 1)
    assert np.sqrt(np.mean(np.square(relative_errors))) < 0.03


def test_ringing_stays_as_far_as_it_stands_out_of_noise():
    clean = noisy_force(0, 300) - noisy_force(0)
    taps = signal.firwin(161, 0.9, window=("kaiser", 10.0))
    rung = np.convolve(clean, taps, mode="same")
    rng = np.random.default_rng(7)
    quiet, loud = (isolate_pulse(record(rung + std * rng.standard_normal(SAMPLES))) for std in (1e-5, 1.0))
    assert quiet.start <= 300 - RINGING
    assert quiet.stop >= 300 + PULSE + RINGING
    assert loud.stop - loud.start < PULSE + 2 * (RINGING - 10)
    assert abs(loud.record.force.sum() / clean.sum() - 1) < 0.05


def test_a_sweep_comes_to_a_part_of_the_band_too_late_noise_and_bursts_do_not():
    rng = np.random.default_rng(4)
    n, step, band = 8000, 1e-3, (20.0, 300.0)
    time = step * np.arange(n)
    sweep = np.sin(2 * np.pi * (20 * time + (300 - 20) * time**2 / (2 * time[-1])))
    burst = rng.standard_normal(n) * (time < 0.3 * time[-1])
    for force, expected in ((sweep, True), (rng.standard_normal(n), False), (burst, False)):
        assert is_sweep(record(force), band, 8 / time[-1]) is expected


@pytest.mark.parametrize(("part", "is_included"), [(0.0025, True), (0.0, False)])
def test_the_undershoot_of_a_high_pass_is_a_part_of_the_pulse(part, is_included):
    """Less than a pulse's least part in each sample, and a tenth of its impulse in all."""
    end = TOP + PULSE
    force = (noisy_force(5, TOP) - noisy_force(5)) + 0.05 * noisy_force(5)
    force[end:] -= part * PEAK_N * np.exp(-np.arange(SAMPLES - end) / 150)
    pulse = isolate_pulse(record(force))
    if is_included:
        assert pulse.record.force.sum() == pytest.approx(force[: pulse.stop].sum(), rel=0.01)
        assert pulse.stop > end + 400
    else:
        assert pulse.stop < end + 2 * (RINGING + TAPER)
