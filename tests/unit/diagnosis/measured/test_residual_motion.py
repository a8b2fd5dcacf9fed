"""DC offsets of channels and residual motion: what is in records besides the response to their force."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import StateSpace, lsim

from frf_ipz.diagnosis.measured.forces import RINGING, isolate_pulse
from frf_ipz.diagnosis.measured.from_records import estimate_transfer_functions, survey_records
from frf_ipz.diagnosis.measured.group_spectra import group_records
from frf_ipz.diagnosis.measured.preprocessing.dc_offset import remove_dc_offset
from frf_ipz.diagnosis.measured.preprocessing.residual_motion import (
    LARGEST_OFFSET,
    LEAST_NOISE,
    WINDOW_DECAYS,
    _gate_from_start,
    _misfit,
    _prepare_group,
    remove_residual_motion,
)
from frf_ipz.diagnosis.nonlinear.linearity import assess_linearity
from frf_ipz.dofs import parse_dof
from frf_ipz.quantities import FrfQuantity

OFFSET_PARTS = np.array([0.02, -0.007])  # of the largest response: dc offsets of the two channels
N_SAMPLES = 8000  # of a shaker's record
RESIDUAL_PART = 0.05  # of the largest response: motion before an impact


def cubic(w, _):
    return 2e10 * w**3


def largest(observations):
    """(n_sensors, 1) array."""
    return np.max([np.abs(record.responses).max(1) for record in observations.records], 0)[:, None]


def shifted(observations, offsets):
    return replace(
        observations,
        records=tuple(replace(record, responses=record.responses + offsets) for record in observations.records),
    )


def subtracted(before, after):
    """(n_records, n_sensors, n_samples) array."""
    return np.array([a.responses - b.responses for a, b in zip(before.records, after.records, strict=True)])


def accelerations(chain, rows):
    """State space of the chain from a force at node 1 to the accelerations of nodes."""
    zeros, unit = np.zeros((4, 4)), np.eye(4)
    return StateSpace(
        np.block([[zeros, unit], [-chain.K, -chain.C]]), np.vstack([zeros, unit])[:, :1],
        np.hstack([-chain.K, -chain.C])[rows], unit[rows, :1],
    )  # fmt: skip


def test_impacts_of_several_levels_determine_dc_offsets(strike):
    offsets = OFFSET_PARTS[:, None] * largest(strike())
    disturbed = shifted(strike(), offsets)
    assert assess_linearity(disturbed).is_nonlinear
    restored = remove_residual_motion(disturbed)
    assert not assess_linearity(restored).is_nonlinear
    error = subtracted(disturbed, restored)[:, :, 0] - offsets[:, 0]
    stds = np.array([record.dc_offset_std for record in restored.records])
    assert np.all(np.abs(error) < 4 * stds + 1e-4 * largest(strike())[:, 0])
    assert np.all(stds < 1e-3 * largest(strike())[:, 0])


def test_records_without_dc_offset_hardly_change(strike):
    removed = subtracted(strike(), remove_residual_motion(strike()))
    assert np.all(np.abs(removed) < 2e-4 * largest(strike()))


def test_impacts_of_one_level_determine_no_dc_offset(strike):
    """It may as well be their response: it stays, and makes FRFs uncertain at the bottom of the band."""
    base_record, rng = strike().records[0], np.random.default_rng(2)
    noise = 1e-5 * largest(strike())
    late = 76  # samples: the impact comes with the fifth after that
    records = [
        replace(
            base_record,
            name=f"impact {n}",
            force=base_record.force[late:],
            responses=(base_record.responses + noise * rng.standard_normal(base_record.responses.shape))[:, late:],
        )
        for n in range(3)
    ]
    equal_levels = replace(strike(), records=tuple(records))
    offsets = OFFSET_PARTS[:, None] * largest(equal_levels)
    restored = remove_residual_motion(shifted(equal_levels, offsets))
    stds = np.array([record.dc_offset_std for record in restored.records])
    assert np.all(stds > 0.05 * LARGEST_OFFSET * largest(equal_levels)[:, 0])
    s = np.array([2.0 + 2j * np.pi * 4.5, 2.0 + 2j * np.pi * 70.0])
    plain = estimate_transfer_functions(survey_records(equal_levels), s)
    with_stds = estimate_transfer_functions(survey_records(replace(equal_levels, records=restored.records)), s)
    grown = np.array(
        [
            np.abs(np.diag(uncertain)) / np.abs(np.diag(certain))
            for uncertain, certain in zip(with_stds.covariance, plain.covariance, strict=True)
        ]
    )
    assert np.all(grown[:, 0] > 10)
    assert np.all(grown[:, 0] > grown[:, 1])


def test_residual_motion_of_the_impact_before_is_removed(strike, chain):
    values, shapes = np.linalg.eigh(chain.K)
    omega, damped = np.sqrt(values), np.sqrt(values * (1 - 1e-4))
    time = strike().records[0].step_s * np.arange(strike().records[0].n_samples)
    rng = np.random.default_rng(3)
    records, added = [strike().records[0]], [0.0]
    for record in strike().records[1:]:
        phase = rng.uniform(0, 2 * np.pi, len(omega))
        decaying = np.exp(-0.01 * np.outer(omega, time)) * np.cos(np.outer(damped, time) + phase[:, None])
        motion = shapes[[1, 3]] @ (rng.standard_normal(len(omega))[:, None] * decaying)
        motion *= RESIDUAL_PART * largest(strike()) / np.abs(motion).max()
        records.append(replace(record, responses=record.responses + motion, number=9))
        added.append(motion)
    disturbed = replace(strike(), records=tuple(records))
    assert assess_linearity(disturbed).is_nonlinear
    restored = remove_residual_motion(disturbed)
    assert not assess_linearity(restored).is_nonlinear
    removed = subtracted(disturbed, restored)
    for difference, motion in zip(removed[1:], added[1:], strict=True):
        assert np.linalg.norm(difference - motion) < 0.1 * np.linalg.norm(motion)


def test_missing_ringing_before_an_impact_is_no_dc_offset(strike):
    """Near the axis it is as flat as first samples: with impacts at other times it looks like offsets by level."""
    late = (75, 76, 77, 76)  # samples: the impact comes with the fifth or so after that
    rng = np.random.default_rng(4)
    missing = 0.02 * largest(strike()) * rng.standard_normal((4, 2, 2))
    records = []
    for record, start, missing_in_record in zip(strike().records, late, missing, strict=True):
        responses = record.responses[:, start:].copy()
        responses[:, :2] += missing_in_record
        records.append(replace(record, force=record.force[start:], responses=responses))
    disturbed = replace(strike(), records=tuple(records))
    for before, after in zip(records, remove_residual_motion(disturbed).records, strict=True):
        assert np.all(np.abs((before.responses - after.responses)[:, -1:]) < 3e-3 * largest(strike()))


@pytest.fixture
def successive_impacts(strike, chain):
    """Give impacts of one recording, each before the one before has rung out, and what each would be from rest."""
    single = strike().records
    system = accelerations(chain, [1, 3])

    def run(pause, number_of, *, noise_part=1e-5, seed=7):
        step, rng = single[0].step_s, np.random.default_rng(seed)
        force = np.concatenate([record.force[:pause] for record in single])
        whole = lsim(system, force, step * np.arange(len(force)))[1].T
        noise = noise_part * np.abs(whole).max()
        records, alone = [], []
        for number, record in enumerate(single):
            part = slice(number * pause, (number + 1) * pause)
            responses = whole[:, part] + noise * rng.standard_normal((2, pause))
            at = {"recording": "all", "number": number_of(number), "start_s": number * pause * step}
            records.append(replace(record, force=record.force[:pause], responses=responses, **at))
            alone.append(lsim(system, record.force[:pause], step * np.arange(pause))[1].T)
        return replace(strike(), records=tuple(records)), np.array(alone)

    return run


@pytest.mark.parametrize("missing", [0, 5])
def test_residual_motion_is_removed_though_an_impact_before_is_missing(successive_impacts, missing):
    disturbed, alone = successive_impacts(600, lambda number: number + 1 + missing * (number > 0))
    residual = np.array([record.responses for record in disturbed.records]) - alone
    assert np.abs(residual).max() > 0.05 * np.abs(alone).max()
    restored = np.array([record.responses for record in remove_residual_motion(disturbed).records])
    assert np.linalg.norm(restored - alone) < 0.02 * np.linalg.norm(residual)


def test_what_is_not_known_of_residual_motion_is_as_large_as_its_errors(successive_impacts):
    """A peak of noise that is taken for a mode does no harm then: what is subtracted for it is not known either."""
    exact, alone = successive_impacts(600, lambda number: number + 1, noise_part=0.0)
    motion = np.array([record.responses for record in exact.records]) - alone
    s = 15.0 + 2j * np.pi * np.linspace(5.0, 70.0, 14)
    errors, stated = [], []
    for seed in range(12):
        noisy, _ = successive_impacts(600, lambda number: number + 1, noise_part=3e-3, seed=seed)
        restored = remove_residual_motion(noisy)
        removed = subtracted(noisy, restored)
        for record, error in zip(restored.records[1:], (removed - motion)[1:], strict=True):
            times = record.step_s * np.arange(record.n_samples)
            lines = record.step_s * np.exp(-np.outer(s, times))
            for row in range(2):
                errors.append(np.abs(lines @ error[row]) ** 2)
                offset = record.dc_offset_std[row] * lines.sum(axis=1)
                columns = record.residual_motion.transform(s, row, record)
                stated.append(np.sum(np.abs(columns) ** 2, axis=1) + np.abs(offset) ** 2)
    ratio = np.mean(errors, axis=0) / np.mean(stated, axis=0)
    assert np.all((ratio > 0.2) & (ratio < 2.0)), ratio


def test_what_is_not_known_of_residual_motion_is_an_error_of_the_frfs(successive_impacts):
    noisy, _ = successive_impacts(600, lambda number: number + 1, noise_part=3e-3)
    restored = remove_residual_motion(noisy)
    taken_as_known = replace(
        restored, records=tuple(replace(record, residual_motion=None) for record in restored.records)
    )
    s = 15.0 + 2j * np.pi * np.linspace(5.0, 70.0, 14)
    survey = survey_records(restored)
    known = replace(survey, groups=survey_records(taken_as_known).groups)
    uncertain, certain = (estimate_transfer_functions(one, s).covariance for one in (survey, known))
    added = np.diagonal(uncertain - certain, axis1=1, axis2=2).real
    assert np.all(added > 0)
    assert np.all(np.linalg.eigvalsh(uncertain - certain)[:, 0] > -1e-9 * added.max(axis=1))


def test_records_without_noise_are_no_obstacle(successive_impacts):
    """What they tell of some amplitudes exceeds what they tell of others by more than double precision holds."""
    exact, alone = successive_impacts(600, lambda number: number + 1, noise_part=0.0)
    restored = np.array([record.responses for record in remove_residual_motion(exact).records])
    residual = np.array([record.responses for record in exact.records]) - alone
    assert np.linalg.norm(restored - alone) < 0.02 * np.linalg.norm(residual)


def test_residual_motion_of_a_record_whose_lead_was_cut_is_the_later_part(successive_impacts):
    noisy, _ = successive_impacts(600, lambda number: number + 1, noise_part=3e-3)
    record = remove_residual_motion(noisy).records[1]
    cut = 40
    later = replace(
        record,
        force=record.force[cut:],
        responses=record.responses[:, cut:],
        start_s=record.start_s + cut * record.step_s,
    )
    s = np.array([3.0 + 40.0j, 8.0 + 300.0j])
    whole, part = (one.residual_motion.transform(s, 0, one) for one in (record, later))
    first = replace(record, force=record.force[:cut], responses=record.responses[:, :cut])
    begin = record.residual_motion.transform(s, 0, first)
    np.testing.assert_allclose(begin + np.exp(-s * cut * record.step_s)[:, None] * part, whole, rtol=1e-9, atol=0)


def first_group(observations):
    pulses = {record.name: isolate_pulse(record) for record in observations.records}
    decay = WINDOW_DECAYS / observations.records[0].duration_s
    return _prepare_group(group_records(observations)[0], pulses, observations, decay)


@pytest.mark.parametrize("noise_part", [1e-7, 1e-5, 1e-3])
def test_noise_that_errors_of_a_model_may_be_is_known_all_the_same(strike, noise_part):
    """A trace of noise would make the samples before an impact exact, and their offset."""
    std, rng = noise_part * float(largest(strike()).max()), np.random.default_rng(11)
    noisy = replace(
        strike(),
        records=tuple(
            replace(record, responses=record.responses + std * rng.standard_normal(record.responses.shape))
            for record in strike().records
        ),
    )
    group = first_group(noisy)
    nothing = [np.zeros(group.n_terms(record)) for record in group.records]
    noise = _misfit(group, 0, nothing, LEAST_NOISE * std).noise
    assert noise.white > 0.1 * std**2 * group.records[0].step_s


def without_its_second_sensor(record):
    return replace(record, sensors=record.sensors[:1], responses=record.responses[:1])


def test_an_impact_that_lacks_a_sensor_left_its_motion_all_the_same(successive_impacts):
    """An overloaded channel is left out of the impact that it overloaded in: its force is known, and its noise is not.

    What no FRF explains is nothing at all where there is one impact, and not its noise.
    """
    noisy, alone = successive_impacts(600, lambda number: number + 1, noise_part=3e-4)
    first, *others = noisy.records
    lacking = replace(noisy, records=(without_its_second_sensor(first), *others))
    for removing in (noisy, lacking):
        restored = [record.responses for record in remove_residual_motion(removing).records[1:]]
        residual = np.array([record.responses for record in others]) - alone[1:]
        assert np.linalg.norm(np.array(restored) - alone[1:]) < 0.05 * np.linalg.norm(residual)


def test_a_single_impact_knows_its_offset_by_what_moves_before_it(strike):
    record, rng = strike().records[0], np.random.default_rng(8)
    noise = 1e-3 * largest(strike())
    stds = []
    for _ in range(20):
        responses = record.responses + noise * rng.standard_normal(record.responses.shape)
        single = replace(strike(), records=(replace(record, responses=responses),))
        restored = remove_residual_motion(single)
        stds.append(subtracted(single, restored)[0, :, 0] / restored.records[0].dc_offset_std)
    assert 0.6 < np.sqrt(np.mean(np.square(stds))) < 1.4


def test_the_initial_state_of_each_mode_follows_from_all_forces_before(successive_impacts):
    observations, _ = successive_impacts(600, lambda number: number + 1)
    ordered = observations.records
    group = first_group(observations)
    step, force = ordered[0].step_s, np.concatenate([record.force for record in ordered])
    assert group.initial_state(ordered[0]) is None
    for number, record in enumerate(ordered[1:], start=1):
        residual, error = group.initial_state(record)
        later = step * (600 * number - np.arange(600 * number))
        whole = step * np.exp(np.outer(group.poles, later)) @ force[: 600 * number]
        np.testing.assert_allclose(residual, whole, rtol=1e-2)  # forces are cut where nothing touches
        assert np.all(error > 0.009 * np.abs(residual))
    without_one = replace(observations, records=(ordered[0], *ordered[2:]))
    assert first_group(without_one).initial_state(ordered[2]) is None


@pytest.mark.slow
def test_dc_offsets_of_a_nonlinear_structure_are_read_where_it_has_come_to_rest(strike):
    offsets = OFFSET_PARTS[:, None] * largest(strike(cubic))
    disturbed = shifted(strike(cubic), offsets)
    removed = subtracted(disturbed, remove_dc_offset(disturbed))[:, :, 0]
    np.testing.assert_allclose(removed, np.tile(offsets[:, 0], (len(removed), 1)), rtol=0.02)


def test_a_displacement_may_have_a_mean(strike):
    record = strike().records[0]
    sensors = tuple(replace(sensor, quantity=FrfQuantity.RECEPTANCE) for sensor in record.sensors)
    displacements = replace(strike(), records=(replace(record, sensors=sensors, responses=record.responses + 1.0),))
    assert not subtracted(displacements, remove_dc_offset(displacements)).any()


@pytest.fixture
def shaken(strike, chain):
    """Three records of a shaker that starts at rest, at node 1, with noise."""
    system = accelerations(chain, [0, 2])
    base_record, rng = strike().records[0], np.random.default_rng(5)
    records = []
    for number in range(3):
        force = np.concatenate([[0.0], rng.standard_normal(N_SAMPLES - 1)])
        responses = lsim(system, force, base_record.step_s * np.arange(N_SAMPLES))[1].T
        responses += 1e-3 * responses.std() * rng.standard_normal(responses.shape)
        records.append(replace(base_record, name=f"record {number}", force=force, responses=responses))
    return replace(strike(), kind="random", records=tuple(records))


@pytest.mark.parametrize("lead", [0, 200])
def test_records_of_a_shaker_determine_dc_offsets_though_the_structure_moves_all_the_time(shaken, lead):
    rests = ((0, 0), (lead, 0))
    shaken = replace(
        shaken,
        records=tuple(
            replace(record, force=np.pad(record.force, (lead, 0)), responses=np.pad(record.responses, rests))
            for record in shaken.records
        ),
    )
    assert all(
        _gate_from_start(record).start == pytest.approx(max(lead - RINGING, 0), abs=5) for record in shaken.records
    )
    offsets = OFFSET_PARTS[:, None] * largest(shaken)
    disturbed = shifted(shaken, offsets)
    restored = remove_residual_motion(disturbed)
    error = subtracted(disturbed, restored)[:, :, 0] - offsets[:, 0]
    stds = np.array([record.dc_offset_std for record in restored.records])
    assert np.all(np.abs(error) < 4 * stds)
    assert np.all(stds < 1e-3 * largest(shaken)[:, 0])


def test_a_single_record_of_a_shaker_determines_no_dc_offset(shaken):
    alone = replace(shaken, records=shaken.records[:1])
    assert remove_residual_motion(alone) is alone


@pytest.mark.parametrize("is_rested", [True, False])
def test_records_that_do_not_start_at_rest_are_returned_unchanged(strike, is_rested):
    observations = shifted(strike(), largest(strike()) * OFFSET_PARTS[:, None])
    unchanged = replace(
        observations, records=tuple(replace(record, starts_at_rest=is_rested) for record in observations.records)
    )
    assert (remove_residual_motion(unchanged) is unchanged) == (not is_rested)
    assert (remove_dc_offset(unchanged) is unchanged) == (not is_rested)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("everywhere", [False, True])
def test_a_channel_that_shows_nothing_does_no_harm(strike, everywhere):
    """Converters store zeros for what is smaller than their steps."""
    observations = strike()
    with_silent_channel = tuple(
        replace(record, responses=record.responses * np.array([[1.0], [0.0]])) for record in observations.records
    )
    other_dof = parse_dof("3:+x")
    at_other_point = tuple(
        replace(record, name=f"{record.name} there", input_dof=other_dof) for record in observations.records
    )
    together = replace(
        observations, records=with_silent_channel if everywhere else with_silent_channel + at_other_point
    )
    removed = subtracted(together, remove_residual_motion(together))
    assert np.all(np.abs(removed[: len(with_silent_channel), 1]) < 1e-6 * largest(observations)[1])
    plain = subtracted(observations, remove_residual_motion(observations))
    assert removed[: len(with_silent_channel), 0] == pytest.approx(
        plain[:, 0], abs=1e-3 * float(np.abs(observations.records[0].responses).max())
    )
