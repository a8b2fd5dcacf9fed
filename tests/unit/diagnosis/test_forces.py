"""Pulses of hammer blows, and what is noise around them."""

import numpy as np
import pytest

from frf_ipz.diagnosis.measured.forces import RINGING, TAPER, isolate_pulse
from frf_ipz.diagnosis.observations import Blow, Sensor
from frf_ipz.dofs import parse_dof
from frf_ipz.quantities import FrfQuantity

SAMPLES, TOP, PULSE = 20_000, 30, 7  # the pulse begins soon after the record
PEAK_N, NOISE_N = 77.0, 0.23


def blow(force):
    return Blow(
        name="b",
        input_channel="force",
        input_dof=parse_dof("5:+z"),
        sensors=(Sensor(channel="acc", dof=parse_dof("9:+z"), quantity=FrfQuantity.ACCELERANCE),),
        step_s=1e-3,
        force=force,
        responses=np.zeros((1, SAMPLES)),
    )


def a_force(drawn, *starts):
    force = NOISE_N * np.random.default_rng(drawn).standard_normal(SAMPLES)
    for start in starts:
        force[start : start + PULSE] += PEAK_N * np.sin(np.pi * (np.arange(PULSE) + 0.5) / PULSE)
    return force


def test_noise_of_a_long_record_is_no_part_of_a_weak_blow():
    """A few samples before the blow, by chance quiet ones, do not say how far noise reaches in thousands."""
    longest = PULSE + 2 * (RINGING + TAPER)
    pulses = [isolate_pulse(blow(a_force(drawn, TOP))) for drawn in range(300)]
    assert max(pulse.stop - pulse.start for pulse in pulses) <= longest


@pytest.mark.parametrize("second", [60, 400])
def test_a_second_touch_is_kept(second):
    force = a_force(0, TOP, second)
    pulse = isolate_pulse(blow(force))
    np.testing.assert_array_equal(pulse.blow.force[TOP - 3 : second + PULSE + 3], force[TOP - 3 : second + PULSE + 3])
    assert np.abs(pulse.blow.force[second + PULSE + 2 * (RINGING + TAPER) :]).max() < 1e-12
