"""Constants of channels and motion left from before: what is in recordings besides the response to a blow."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import StateSpace, lsim

from frf_ipz.diagnosis.measured.forces import RINGING
from frf_ipz.diagnosis.measured.from_records import estimate_transfer_functions, survey_records
from frf_ipz.diagnosis.measured.group_spectra import group_records
from frf_ipz.diagnosis.measured.preprocessing.dc_offset import remove_dc_offset
from frf_ipz.diagnosis.measured.preprocessing.residual_motion import (
    DECAYS,
    LARGEST,
    _group,
    _whole,
    remove_residual_motion,
)
from frf_ipz.diagnosis.nonlinear.linearity import assess_linearity
from frf_ipz.dofs import parse_dof
from frf_ipz.quantities import FrfQuantity

PARTS = np.array([0.02, -0.007])  # of the largest response: constants of the two channels
N_SAMPLES = 8000  # of a shaker's record
LEFT = 0.05  # of the largest response: motion before a blow


def cubic(w, _):
    return 2e10 * w**3


def largest(observations):
    """(n_sensors, 1) array."""
    return np.max([np.abs(record.responses).max(1) for record in observations.records], 0)[:, None]


def shifted(observations, constants):
    return replace(
        observations,
        records=tuple(replace(record, responses=record.responses + constants) for record in observations.records),
    )


def taken_off(before, after):
    """(n_blows, n_sensors, n_samples) array."""
    return np.array([a.responses - b.responses for a, b in zip(before.records, after.records, strict=True)])


def accelerations(chain, rows):
    """State space of the chain from a force at node 1 to the accelerations of nodes."""
    zeros, unit = np.zeros((4, 4)), np.eye(4)
    return StateSpace(
        np.block([[zeros, unit], [-chain.K, -chain.C]]), np.vstack([zeros, unit])[:, :1],
        np.hstack([-chain.K, -chain.C])[rows], unit[rows, :1],
    )  # fmt: skip


def test_constants_of_a_linear_system_are_told_by_blows_of_several_levels(strike):
    constants = PARTS[:, None] * largest(strike())
    spoilt = shifted(strike(), constants)
    assert assess_linearity(spoilt).is_nonlinear
    restored = remove_residual_motion(spoilt)
    assert not assess_linearity(restored).is_nonlinear
    off = taken_off(spoilt, restored)[:, :, 0] - constants[:, 0]
    stds = np.array([record.constant_std for record in restored.records])
    assert np.all(np.abs(off) < 4 * stds + 1e-4 * largest(strike())[:, 0])
    assert np.all(stds < 1e-3 * largest(strike())[:, 0])


def test_where_there_are_no_constants_little_changes(strike):
    off = taken_off(strike(), remove_residual_motion(strike()))
    assert np.all(np.abs(off) < 2e-4 * largest(strike()))


def test_blows_of_one_level_tell_no_constant(strike):
    """It may as well be their response: it stays, and makes FRFs uncertain at the bottom of the band."""
    one, rng = strike().records[0], np.random.default_rng(2)
    noise = 1e-5 * largest(strike())
    late = 76  # samples: the blow comes with the fifth after that
    records = [
        replace(
            one,
            name=f"blow {n}",
            force=one.force[late:],
            responses=(one.responses + noise * rng.standard_normal(one.responses.shape))[:, late:],
        )
        for n in range(3)
    ]
    alike = replace(strike(), records=tuple(records))
    constants = PARTS[:, None] * largest(alike)
    restored = remove_residual_motion(shifted(alike, constants))
    stds = np.array([record.constant_std for record in restored.records])
    assert np.all(stds > 0.05 * LARGEST * largest(alike)[:, 0])
    s = np.array([2.0 + 2j * np.pi * 4.5, 2.0 + 2j * np.pi * 70.0])
    plain = estimate_transfer_functions(survey_records(alike), s)
    with_stds = estimate_transfer_functions(survey_records(replace(alike, records=restored.records)), s)
    grown = np.array(
        [
            np.abs(np.diag(one)) / np.abs(np.diag(other))
            for one, other in zip(with_stds.covariance, plain.covariance, strict=True)
        ]
    )
    assert np.all(grown[:, 0] > 10)
    assert np.all(grown[:, 0] > grown[:, 1])


def test_motion_left_by_the_blow_before_is_taken_off(strike, chain):
    values, shapes = np.linalg.eigh(chain.K)
    omega, damped = np.sqrt(values), np.sqrt(values * (1 - 1e-4))
    time = strike().records[0].step_s * np.arange(strike().records[0].n_samples)
    rng = np.random.default_rng(3)
    records, added = [strike().records[0]], [0.0]
    for record in strike().records[1:]:
        phase = rng.uniform(0, 2 * np.pi, len(omega))
        decaying = np.exp(-0.01 * np.outer(omega, time)) * np.cos(np.outer(damped, time) + phase[:, None])
        moving = shapes[[1, 3]] @ (rng.standard_normal(len(omega))[:, None] * decaying)
        moving *= LEFT * largest(strike()) / np.abs(moving).max()
        records.append(replace(record, responses=record.responses + moving, number=9))
        added.append(moving)
    spoilt = replace(strike(), records=tuple(records))
    assert assess_linearity(spoilt).is_nonlinear
    restored = remove_residual_motion(spoilt)
    assert not assess_linearity(restored).is_nonlinear
    off = taken_off(spoilt, restored)
    for found, moving in zip(off[1:], added[1:], strict=True):
        assert np.linalg.norm(found - moving) < 0.1 * np.linalg.norm(moving)


def test_ringing_that_recordings_lack_before_a_blow_is_no_constant(strike):
    """Near the axis it is as flat as first samples: with blows at other times it looks like constants by level."""
    late = (75, 76, 77, 76)  # samples: the blow comes with the fifth or so after that
    rng = np.random.default_rng(4)
    lacking = 0.02 * largest(strike()) * rng.standard_normal((4, 2, 2))
    records = []
    for record, start, lacks in zip(strike().records, late, lacking, strict=True):
        responses = record.responses[:, start:].copy()
        responses[:, :2] += lacks
        records.append(replace(record, force=record.force[start:], responses=responses))
    spoilt = replace(strike(), records=tuple(records))
    for before, after in zip(records, remove_residual_motion(spoilt).records, strict=True):
        assert np.all(np.abs((before.responses - after.responses)[:, -1:]) < 3e-3 * largest(strike()))


@pytest.fixture
def struck_on(strike, chain):
    """Give blows of one recording, each before the one before has rung out, and what each would be from rest."""
    single = strike().records
    system = accelerations(chain, [1, 3])

    def run(pause, number_of):
        step, rng = single[0].step_s, np.random.default_rng(7)
        force = np.concatenate([record.force[:pause] for record in single])
        whole = lsim(system, force, step * np.arange(len(force)))[1].T
        noise = 1e-5 * np.abs(whole).max()
        records, alone = [], []
        for number, record in enumerate(single):
            here = slice(number * pause, (number + 1) * pause)
            responses = whole[:, here] + noise * rng.standard_normal((2, pause))
            at = {"recording": "all", "number": number_of(number), "start_s": number * pause * step}
            records.append(replace(record, force=record.force[:pause], responses=responses, **at))
            alone.append(lsim(system, record.force[:pause], step * np.arange(pause))[1].T)
        return replace(strike(), records=tuple(records)), np.array(alone)

    return run


@pytest.mark.parametrize("lacking", [0, 5])
def test_motion_left_by_blows_before_is_taken_off_where_one_of_them_was_left_out_too(struck_on, lacking):
    spoilt, alone = struck_on(600, lambda number: number + 1 + lacking * (number > 0))
    left = np.array([record.responses for record in spoilt.records]) - alone
    assert np.abs(left).max() > 0.05 * np.abs(alone).max()
    restored = np.array([record.responses for record in remove_residual_motion(spoilt).records])
    assert np.linalg.norm(restored - alone) < 0.02 * np.linalg.norm(left)


def test_what_forces_before_have_left_of_each_mode_is_known_from_all_of_them(struck_on):
    observations, _ = struck_on(600, lambda number: number + 1)
    ordered = observations.records
    group = _group(group_records(observations)[0], observations, DECAYS / ordered[0].duration_s)
    step, force = ordered[0].step_s, np.concatenate([record.force for record in ordered])
    assert group.kicks(ordered[0]) is None
    for number, record in enumerate(ordered[1:], start=1):
        left, error = group.kicks(record)
        later = step * (600 * number - np.arange(600 * number))
        whole = step * np.exp(np.outer(group.poles, later)) @ force[: 600 * number]
        np.testing.assert_allclose(left, whole, rtol=1e-2)  # forces are cut where nothing touches
        assert np.all(error > 0.009 * np.abs(left))
    without_one = replace(observations, records=(ordered[0], *ordered[2:]))
    group = _group(group_records(without_one)[0], without_one, DECAYS / ordered[0].duration_s)
    assert group.kicks(ordered[2]) is None


def test_constants_of_a_nonlinear_structure_are_read_where_it_has_come_to_rest(strike):
    constants = PARTS[:, None] * largest(strike(cubic))
    spoilt = shifted(strike(cubic), constants)
    off = taken_off(spoilt, remove_dc_offset(spoilt))[:, :, 0]
    np.testing.assert_allclose(off, np.tile(constants[:, 0], (len(off), 1)), rtol=0.02)


def test_a_displacement_may_have_a_mean(strike):
    record = strike().records[0]
    sensors = tuple(replace(sensor, quantity=FrfQuantity.RECEPTANCE) for sensor in record.sensors)
    shown = replace(strike(), records=(replace(record, sensors=sensors, responses=record.responses + 1.0),))
    assert not taken_off(shown, remove_dc_offset(shown)).any()


@pytest.fixture
def shaken(strike, chain):
    """Three records of a shaker that starts at rest, at node 1, with noise."""
    system = accelerations(chain, [0, 2])
    one, rng = strike().records[0], np.random.default_rng(5)
    records = []
    for number in range(3):
        force = np.concatenate([[0.0], rng.standard_normal(N_SAMPLES - 1)])
        responses = lsim(system, force, one.step_s * np.arange(N_SAMPLES))[1].T
        responses += 1e-3 * responses.std() * rng.standard_normal(responses.shape)
        records.append(replace(one, name=f"record {number}", force=force, responses=responses))
    return replace(strike(), kind="random", records=tuple(records))


@pytest.mark.parametrize("lead", [0, 200])
def test_records_of_a_shaker_tell_constants_though_the_structure_moves_all_the_time(shaken, lead):
    rests = ((0, 0), (lead, 0))
    shaken = replace(
        shaken,
        records=tuple(
            replace(record, force=np.pad(record.force, (lead, 0)), responses=np.pad(record.responses, rests))
            for record in shaken.records
        ),
    )
    assert all(_whole(record).start == pytest.approx(max(lead - RINGING, 0), abs=5) for record in shaken.records)
    constants = PARTS[:, None] * largest(shaken)
    spoilt = shifted(shaken, constants)
    restored = remove_residual_motion(spoilt)
    off = taken_off(spoilt, restored)[:, :, 0] - constants[:, 0]
    stds = np.array([record.constant_std for record in restored.records])
    assert np.all(np.abs(off) < 4 * stds)
    assert np.all(stds < 1e-3 * largest(shaken)[:, 0])


def test_one_record_of_a_shaker_tells_no_constant(shaken):
    alone = replace(shaken, records=shaken.records[:1])
    assert remove_residual_motion(alone) is alone


@pytest.mark.parametrize("is_rested", [True, False])
def test_what_does_not_start_at_rest_is_left_alone(strike, is_rested):
    observations = shifted(strike(), largest(strike()) * PARTS[:, None])
    other = replace(observations, records=tuple(replace(record, rested=is_rested) for record in observations.records))
    assert (remove_residual_motion(other) is other) == (not is_rested)
    assert (remove_dc_offset(other) is other) == (not is_rested)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("everywhere", [False, True])
def test_a_channel_that_shows_nothing_does_no_harm(strike, everywhere):
    """Converters store zeros for what is smaller than their steps."""
    seen = strike()
    here = tuple(replace(record, responses=record.responses * np.array([[1.0], [0.0]])) for record in seen.records)
    elsewhere = parse_dof("3:+x")
    there = tuple(replace(record, name=f"{record.name} there", input_dof=elsewhere) for record in seen.records)
    together = replace(seen, records=here if everywhere else here + there)
    off = taken_off(together, remove_residual_motion(together))
    assert np.all(np.abs(off[: len(here), 1]) < 1e-6 * largest(seen)[1])
    plain = taken_off(seen, remove_residual_motion(seen))
    assert off[: len(here), 0] == pytest.approx(plain[:, 0], abs=1e-3 * float(np.abs(seen.records[0].responses).max()))
