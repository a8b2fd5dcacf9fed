from dataclasses import replace

import numpy as np
import pytest

from frf_ipz.diagnosis.nonlinear.linearity import WIDTH, _quotient_misfit, assess_linearity

pytestmark = pytest.mark.slow

HALF_BAND = WIDTH / 2  # lines
ACROSS = np.linspace(-1, 1, WIDTH)  # a group of lines
LOUD = 0.2  # noise over the motion of the strongest record
GROUPS = 50
STEPS = 1e-3  # of the largest response
SLOW_HZ = 0.4  # far below the band


def test_impacts_on_a_linear_chain_agree(strike):
    linearity = assess_linearity(strike())
    assert not linearity.is_nonlinear
    assert linearity.score > 0  # something was compared


@pytest.mark.parametrize(
    "law",
    [lambda w, _: 2e10 * w**3, lambda _, v: 1.5 * np.tanh(v / 1e-3)],
    ids=["cubic", "friction"],
)
def test_impacts_on_a_nonlinear_chain_disagree(strike, law):
    assert assess_linearity(strike(law)).is_nonlinear


@pytest.mark.parametrize("law", [None, lambda w, _: 2e10 * w**3], ids=["linear", "cubic"])
def test_impacts_are_compared_where_sensors_rove(strike, law):
    """Each layout of sensors has impacts of several levels."""
    observations = strike(law)
    layouts = [
        replace(
            record,
            name=f"{record.name} {row}",
            sensors=record.sensors[row : row + 1],
            responses=record.responses[[row]],
        )
        for row in range(2)
        for record in observations.records
    ]
    linearity = assess_linearity(replace(observations, records=tuple(layouts)))
    assert linearity.score > 0
    assert linearity.is_nonlinear == (law is not None)


@pytest.mark.parametrize("follows", [True, False])
def test_residual_motion_is_no_nonlinearity(strike, follows):
    """A slow motion that goes on from impact to impact, of which too little is measured to remove it."""
    observations = strike()
    first, *later = observations.records
    slow = (
        STEPS * np.abs(first.responses).max() * np.cos(2 * np.pi * SLOW_HZ * first.step_s * np.arange(first.n_samples))
    )
    shifted = [replace(record, responses=record.responses + slow, number=2 if follows else 1) for record in later]
    linearity = assess_linearity(replace(observations, records=(first, *shifted)))
    assert linearity.is_nonlinear == (not follows)


def test_a_law_shows_beside_residual_motion(strike):
    observations = strike(lambda w, _: 2e10 * w**3)
    first, *later = observations.records
    records = (first, *(replace(record, number=2) for record in later))
    assert assess_linearity(replace(observations, records=records)).is_nonlinear


def test_a_channel_whose_noise_is_below_its_steps_is_not_taken_for_nonlinear(strike):
    """What has decayed below half a step is not recorded at all: as if there were no noise."""
    observations = strike()
    step = STEPS * np.abs(observations.records[0].responses).max()
    rounded = replace(
        observations,
        records=tuple(
            replace(record, responses=step * np.round(record.responses * decayed(record) / step))
            for record in observations.records
        ),
    )
    linearity = assess_linearity(rounded)
    assert linearity.score > 0
    assert not linearity.is_nonlinear


def test_groups_of_lines_keep_out_of_excluded_bands(strike):
    low, high = 30.0, 40.0
    linearity = assess_linearity(replace(strike(), exclude_hz=((low, high),)))
    spacing = 0.25 * HALF_BAND  # of lines, 4 s of record
    assert len(linearity.frequency_hz) > 4
    assert np.all((linearity.frequency_hz + spacing < low) | (linearity.frequency_hz - spacing > high))
    assert not linearity.is_nonlinear


def test_a_local_quotient_does_not_follow_loud_noise():
    """Where a system has no resonance, the poles of a quotient have only noise to go by."""
    rng = np.random.default_rng(4)
    misfits = []
    for _ in range(GROUPS):
        force = np.array([[1.0], [0.45], [0.15]]) * drawn(rng, 3, WIDTH)
        motion = force * np.exp(-0.5 * ACROSS) + LOUD * drawn(rng, 3, WIDTH) + drawn(rng, 3, 1)
        misfits.append(_quotient_misfit(force, motion, np.stack([np.zeros(WIDTH), np.full(WIDTH, LOUD**2)])))
    assert max(misfits) < 1.6  # of 1 that is expected: 66 squared moduli, the worst of many groups


@pytest.mark.parametrize("compliance", [1.0, 1e-13])
def test_a_resonance_of_a_stiff_machine_agrees_as_one_of_a_soft_machine_does(compliance):
    """A mode of a third of the group's width, motions in metres for forces in newtons."""
    rng = np.random.default_rng(7)
    force = np.array([[1.0], [0.45], [0.15]]) * drawn(rng, 3, WIDTH)
    motion = compliance * force / (1j * (ACROSS - 0.1) + 0.3)
    noise = (1e-4 * compliance) ** 2
    assert _quotient_misfit(force, motion, np.stack([np.zeros(WIDTH), np.full(WIDTH, noise)])) < 1.0


def test_three_close_resonances_agree():
    """Of a machine whose motion is far above the noise: no misfit may remain."""
    rng = np.random.default_rng(3)
    force = np.array([[1.0], [0.45], [0.15]]) * drawn(rng, 3, WIDTH)
    modes = ((1.0, -0.75), (0.8, -0.1), (0.7, 0.3))
    motion = force * sum(part / (1j * (ACROSS - location) + 0.05) for part, location in modes) + drawn(rng, 3, 1)
    assert _quotient_misfit(force, motion, np.stack([np.zeros(WIDTH), np.full(WIDTH, 1e-6)])) < 1.0


def decayed(record):
    """(n_samples,) window that makes a response die out within its record."""
    return np.exp(-4.0 * record.step_s * np.arange(record.n_samples))


def drawn(rng, *shape):
    """Complex numbers of variance 1."""
    return (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) / np.sqrt(2)
