"""Noise of recordings, as blows show it."""

import numpy as np
import pytest

from frf_ipz.diagnosis.measured.from_blows import survey
from frf_ipz.diagnosis.observations import Blow, Observations, Sensor
from frf_ipz.dofs import parse_dof
from frf_ipz.quantities import FrfQuantity

RATE_HZ, SAMPLES = 1000.0, 4000
STEP = 0.02  # of the recorder, m/s^2


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
