"""Transfer functions and their errors from single records."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.measured.contour import COARSE, WINDOW_DECAYS, Resonances, find_resonances
from frf_ipz.diagnosis.measured.forces import (
    MISSING_SAMPLES,
    Pulse,
    estimate_force_noise,
    gate_covariance,
    gate_variance,
    isolate_pulse,
    missing_ringing,
)
from frf_ipz.diagnosis.measured.group_spectra import GroupSpectra, group_records, transform_group
from frf_ipz.diagnosis.measured.noise import Noise, fit_force_noise, fit_noise
from frf_ipz.diagnosis.measured.noise_growth import (
    STEADY,
    MeasuredNoise,
    RecordNoise,
    find_unexplained_share,
    fit_growth,
)
from frf_ipz.diagnosis.measured.transfer_functions import TransferFunctions
from frf_ipz.diagnosis.observations import Observations, ObservedRecord, transform_records
from frf_ipz.frf import FrfLabel

CERTAIN_PART = 0.6  # of a decay rate that was read from the width of a peak
LEAST_PART = 0.1  # of the window's decay rate: keeps the transforms of noise finite
UNREPEATED = 2e-3  # of the motion: noise that is assumed without repeated records
MIN_LEAD = 32  # samples before an impact that show the noise
LEAD = 100  # samples of a record before its pulse; the limits of the verdict were chosen with that many
MAX_BIAS = 0.5  # of the force's power that may be noise
COMPONENT_PART = 1e-2  # of a line's variance: weaker components of shared errors are left out


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RecordSurvey:
    """Records with their noise and resonances: what a contour and transfer functions on it need.

    Parameters
    ----------
    groups : tuple of tuple of ObservedRecord
        Records with the same excited point and the same sensors; impacts from shortly before their pulses on, with no
        force outside them.
    pulses : tuple of tuple of Pulse
        The gates of their forces; whole records for shakers.
    force : Noise
        Of the force channel.
    responses : dict of str to Noise
        Of each output channel, in the mean of its records.
    force_growth : RecordNoise
        How much of it each record has.
    response_growth : dict of str to RecordNoise
        The same of each output channel.
    resonances : Resonances
        Peaks of all FRFs.
    least_decay_1_s : float
        sigma that makes the ends of the records vanish.
    """

    groups: tuple[tuple[ObservedRecord, ...], ...]
    pulses: tuple[tuple[Pulse, ...], ...]
    force: Noise
    responses: dict[str, Noise]
    force_growth: RecordNoise
    response_growth: dict[str, RecordNoise]
    resonances: Resonances
    least_decay_1_s: float


def survey_records(observations: Observations) -> RecordSurvey:
    """Find resonances, noise, and how fast records decay.

    Parameters
    ----------
    observations : Observations
        Records from rest.

    Returns
    -------
    RecordSurvey
        For `estimate_transfer_functions`.
    """
    is_hammer = observations.kind == "hammer"
    whole = _pulses_by_group(observations)
    pulses = _cut_leads(whole, observations.kind)
    groups = _records_of(pulses)
    decay = window_decay_1_s(record for group in groups for record in group)
    group_spectra = [transform_group(group, observations.band_hz, decay) for group in groups]
    resonances = _find_resonances(group_spectra, decay)
    truncation = [
        _truncation_energy(resonances, spectra_of_group, group)
        for spectra_of_group, group in zip(group_spectra, groups, strict=True)
    ]
    if is_hammer:
        flat = tuple(pulse for group in whole for pulse in group)
        recorded = tuple(record for group in group_records(observations) for record in group)
        noise, force_growth = estimate_force_noise(recorded, flat)
    else:
        noise, force_growth = _shaker_force_noise(groups, group_spectra, truncation), STEADY
    responses, response_growth = _response_noise(whole, pulses, group_spectra, (noise, force_growth), truncation)
    return RecordSurvey(
        groups=groups,
        pulses=pulses,
        force=noise,
        responses=responses,
        force_growth=force_growth,
        response_growth=response_growth,
        resonances=resonances,
        least_decay_1_s=_least_decay(decay, resonances) if is_hammer else decay,
    )


def window_decay_1_s(records: Iterable[ObservedRecord]) -> float:
    """Give the sigma that makes the end of the shortest record vanish, 1/s."""
    return WINDOW_DECAYS / min(record.duration_s for record in records)


def with_records(survey: RecordSurvey, observations: Observations) -> RecordSurvey:
    """Give further records the noise and the resonances of a survey.

    Parameters
    ----------
    survey : RecordSurvey
        Of other records of the same test.
    observations : Observations
        The further records, with the same excited points and sensors.

    Returns
    -------
    RecordSurvey
        Of these.
    """
    pulses = _cut_leads(_pulses_by_group(observations), observations.kind)
    groups = _records_of(pulses)
    return replace(survey, groups=groups, pulses=pulses)


def _pulses_by_group(observations: Observations) -> tuple[tuple[Pulse, ...], ...]:
    """Isolate the pulses of the impacts of each group; of a shaker, give whole records."""
    groups = group_records(observations)
    if observations.kind != "hammer":
        return tuple(
            tuple(Pulse(record=record, start=0, stop=record.n_samples) for record in group) for group in groups
        )
    return tuple(tuple(isolate_pulse(record) for record in group) for group in groups)


def _cut_leads(pulses: tuple[tuple[Pulse, ...], ...], kind: str) -> tuple[tuple[Pulse, ...], ...]:
    """Cut what lies before the pulses of a hammer; records of a shaker stay whole."""
    if kind != "hammer":
        return pulses
    return tuple(tuple(_cut_lead(pulse) for pulse in group) for group in pulses)


def _records_of(pulses: tuple[tuple[Pulse, ...], ...]) -> tuple[tuple[ObservedRecord, ...], ...]:
    return tuple(tuple(pulse.record for pulse in group) for group in pulses)


def _cut_lead(pulse: Pulse) -> Pulse:
    """Cut what lies before a pulse: it is noise alone, and a transform beside the axis weighs it most of all."""
    begin, record = max(pulse.start - LEAD, 0), pulse.record
    later = replace(
        record,
        force=record.force[begin:],
        responses=record.responses[:, begin:],
        start_s=record.start_s + begin * record.step_s,
    )
    return Pulse(record=later, start=pulse.start - begin, stop=pulse.stop - begin)


def _least_decay(window_decay: float, resonances: Resonances) -> float:
    """Sigma that makes every mode vanish at the end of the records, together with the mode's own decay."""
    slowest = float(resonances.decay_1_s.min(initial=np.inf)) if len(resonances.decay_1_s) else 0.0
    return max(window_decay - CERTAIN_PART * slowest, LEAST_PART * window_decay)


def _response_noise(
    whole: tuple[tuple[Pulse, ...], ...],
    pulses: tuple[tuple[Pulse, ...], ...],
    group_spectra: list[GroupSpectra],
    force_noise: tuple[Noise, RecordNoise],
    truncation: list[FloatArray],
) -> tuple[dict[str, Noise], dict[str, RecordNoise]]:
    """Estimate the noise of each output channel, and its growth, from what repeated records do not share."""
    noise: dict[str, Noise] = {}
    growths: dict[str, RecordNoise] = {}
    of_force, force_growth = force_noise
    groups = _records_of(pulses)
    channels = dict.fromkeys(sensor.channel for group in groups for sensor in group[0].sensors)
    for channel in channels:
        stacks: list[tuple[FloatArray, ...]] = []
        having = [
            (index, [sensor.channel for sensor in group[0].sensors].index(channel))
            for index, group in enumerate(groups)
            if channel in [sensor.channel for sensor in group[0].sensors] and len(group) > 1
        ]
        parts = [(groups[index], group_spectra[index], sensor) for index, sensor in having]
        is_known = MeasuredNoise.is_known(record for group, _, _ in parts for record in group)
        growth = growths[channel] = MeasuredNoise(channel=channel) if is_known else fit_growth(parts)
        for index, sensor in having:
            group, lines = groups[index], group_spectra[index]
            gates = np.array([gate_variance(lines.s, pulse) for pulse in pulses[index]])
            gate_s = np.mean(force_growth.scales(group)[:, None] * gates, axis=0)
            known = np.abs(lines.values[:, sensor]) ** 2 * of_force.density(lines.frequency_hz) * gate_s
            known += truncation[index][:, sensor]
            share = find_unexplained_share(growth, group, lines)
            energy = lines.unexplained[:, sensor]
            stacks.append((lines.frequency_hz, energy, share * _noise_gain(group, lines), known))
        if stacks:
            fitted = fit_noise(*(np.concatenate(values) for values in zip(*stacks, strict=True)))
            noise[channel] = fitted.rounded(_signals(groups, channel), groups[0][0].step_s)
        else:
            noise[channel] = _unrepeated_noise(groups, whole, group_spectra, channel)
    return noise, growths


def _signals(groups: tuple[tuple[ObservedRecord, ...], ...], channel: str) -> list[FloatArray]:
    return [
        values
        for group in groups
        for record in group
        for sensor, values in zip(record.sensors, record.responses, strict=True)
        if sensor.channel == channel
    ]


def _shaker_force_noise(
    groups: tuple[tuple[ObservedRecord, ...], ...], group_spectra: list[GroupSpectra], truncation: list[FloatArray]
) -> Noise:
    """Estimate the noise of a shaker's force from what repeated records do not share; the median of all channels."""
    estimates = []
    for group, lines, known in zip(groups, group_spectra, truncation, strict=True):
        if len(group) > 1:
            gain = _noise_gain(group, lines)
            sensors = zip(lines.unexplained.T, np.abs(lines.values.T) ** 2, known.T, strict=True)
            estimates += [fit_force_noise(lines.frequency_hz, energy, gain, *parts) for energy, *parts in sensors]
    white, pink = np.median([(noise.white, noise.pink) for noise in estimates], axis=0) if estimates else (0.0, 0.0)
    return Noise(white=float(white), pink=float(pink))


def _noise_gain(group: tuple[ObservedRecord, ...], lines: GroupSpectra) -> FloatArray:
    """Energy on each line of noise of density 1 over the whole record."""
    rate = 2 * lines.s.real
    return np.asarray((1 - np.exp(-rate * _duration_s(group))) / rate)


def _unrepeated_noise(
    groups: tuple[tuple[ObservedRecord, ...], ...],
    whole: tuple[tuple[Pulse, ...], ...],
    group_spectra: list[GroupSpectra],
    channel: str,
) -> Noise:
    """Estimate the noise without repeated records, from before the impact: not less than a small part of the motion."""
    white = 0.0
    for index, (group, lines) in enumerate(zip(groups, group_spectra, strict=True)):
        names = [sensor.channel for sensor in group[0].sensors]
        if channel not in names:
            continue
        sensor = names.index(channel)
        energy = np.abs(lines.responses[:, 0, sensor]) ** 2 / _noise_gain(group, lines)
        white = max(white, UNREPEATED**2 * float(np.median(energy)))
        before = whole[index][0].record.responses[sensor, : whole[index][0].start]
        if len(before) >= MIN_LEAD:
            white = max(white, float(np.var(before)) * group[0].step_s)
    return Noise(white=white)


def _duration_s(group: tuple[ObservedRecord, ...]) -> float:
    return min(record.duration_s for record in group)


def _find_resonances(group_spectra: list[GroupSpectra], decay: float) -> Resonances:
    lines = group_spectra[0]
    level = np.zeros(len(lines.frequency_hz))
    for spectra_of_group in group_spectra:
        size = np.abs(spectra_of_group.values) ** 2
        summed = (size / np.maximum(np.median(size, axis=0), np.finfo(float).tiny)).sum(1)
        level += np.interp(lines.frequency_hz, spectra_of_group.frequency_hz, summed)
    return find_resonances(2 * np.pi * lines.frequency_hz, level, decay)


def estimate_transfer_functions(survey: RecordSurvey, s: ComplexArray) -> TransferFunctions:
    """Evaluate transfer functions on a contour.

    Parameters
    ----------
    survey : RecordSurvey
        Of the records.
    s : (n_points,) complex array
        rad/s.

    Returns
    -------
    TransferFunctions
        With the covariance of their errors.
    """
    wide = np.asarray(np.maximum(s.real, COARSE.width * s.imag) + 1j * s.imag)
    labels, values, sizes, covariances, input_index, shared_errors = [], [], [], [], [], []
    for index, group in enumerate(survey.groups):
        points = _transform_to(group, s)
        bias_factor = _bias_factor(survey, index, points)
        size = np.maximum(np.abs(points.values), np.abs(_transform_to(group, wide).values))
        by_power = np.outer(points.power, points.power)
        units, amplitudes = _truncated_motion(survey.resonances, points, group)
        units *= (points.force.conj() / points.power[:, None])[..., None]
        shared_errors.append(_shared_errors(survey, index, points))
        for column, sensor in enumerate(group[0].sensors):
            labels.append(
                FrfLabel(sensor.dof, group[0].input_dof, sensor.quantity, sensor.channel, group[0].input_channel)
            )
            values.append(points.values[:, column] * bias_factor)
            sizes.append(size[:, column])
            scales = survey.response_growth[sensor.channel].scales(group)
            crossed = (points.force.conj() * scales) @ points.force.T / by_power
            noise = crossed * _noise_covariance(survey.responses[sensor.channel], s, _duration_s(group))
            errors = np.column_stack(
                [
                    _dc_offset_error(points, group, column),
                    _residual_motion_errors(points, group, column),
                    _missing_ringing_errors(survey, index, points, column),
                    (units * amplitudes[..., column]).reshape(len(s), -1),
                ]
            )
            covariances.append(noise + errors @ errors.conj().T)
            input_index.append(index)
    return TransferFunctions(
        s=s,
        labels=tuple(labels),
        values=np.stack(values, 1),
        size=np.stack(sizes, 1),
        covariance=np.array(covariances),
        shared_errors=tuple(shared_errors),
        input_index=np.array(input_index),
    )


def _dc_offset_error(points: GroupSpectra, group: tuple[ObservedRecord, ...], column: int) -> ComplexArray:
    """Error of an FRF, (n_points,), by one standard deviation of a channel's remaining dc offset."""
    durations = np.array([record.duration_s for record in group])
    units = (1 - np.exp(-np.outer(points.s, durations))) / points.s[:, None]
    stds = np.array([0.0 if record.dc_offset_std is None else record.dc_offset_std[column] for record in group])
    return np.asarray(np.sum(points.force.conj() * units * stds, 1) / points.power)


def _residual_motion_errors(points: GroupSpectra, group: tuple[ObservedRecord, ...], column: int) -> ComplexArray:
    """Errors of an FRF, as independent columns, by what is not known of the motion that earlier impacts have left."""
    parts = [
        (force.conj() / points.power)[:, None] * record.residual_motion.transform(points.s, column, record)
        for force, record in zip(points.force.T, group, strict=True)
        if record.residual_motion is not None
    ]
    return np.asarray(sum(parts)) if parts else np.zeros((len(points.s), 0), np.complex128)


def _missing_ringing_errors(survey: RecordSurvey, index: int, points: GroupSpectra, column: int) -> ComplexArray:
    """Errors of an FRF, as independent columns, by filter ringing that is missing at the start of records."""
    pulses, group = survey.pulses[index], survey.groups[index]
    sizes = np.array([missing_ringing(pulse, record.responses) for pulse, record in zip(pulses, group, strict=True)])
    if not sizes.any():
        return np.zeros((len(points.s), 0), np.complex128)
    step = group[0].step_s
    units = np.exp(np.outer(points.s, step * np.arange(1, MISSING_SAMPLES + 1))) * step
    of_force, of_response = (
        (points.force.conj() @ size / points.power)[:, None] * units for size in (sizes[:, 0], sizes[:, 1 + column])
    )
    return np.hstack([of_response, points.values[:, [column]] * of_force])


def _truncated_motion(
    resonances: Resonances, points: GroupSpectra, group: tuple[ObservedRecord, ...]
) -> tuple[ComplexArray, FloatArray]:
    """Transform the motion of resonances that goes on after records have ended, and give its amplitudes.

    Each is independent and of unknown phase: (n_points, n_records, n_peaks) for half an amplitude of 1, and these
    halves, (n_records, n_peaks, n_sensors).
    """
    decay = WINDOW_DECAYS / _duration_s(group)
    backwards = [replace(record, force=record.force[::-1], responses=record.responses[:, ::-1]) for record in group]
    pairs = transform_records(backwards, np.asarray(decay + 1j * resonances.omega_rad_s, np.complex128))
    poles = -resonances.decay_1_s + 1j * resonances.omega_rad_s
    ends = np.exp(-np.outer(points.s, [record.duration_s for record in group]))
    return ends[:, :, None] / (points.s[:, None, None] - poles), decay * np.abs([response for _, response in pairs])


def _truncation_energy(resonances: Resonances, lines: GroupSpectra, group: tuple[ObservedRecord, ...]) -> FloatArray:
    """Energy, (n_lines, n_sensors), that records do not share because their motion goes on after they have ended."""
    units, amplitudes = _truncated_motion(resonances, lines, group)
    part = (1 - np.abs(lines.force) ** 2 / lines.power[:, None]) / max(len(group) - 1, 1)
    return np.asarray(np.einsum("pb,pbr,brs->ps", part, np.abs(units) ** 2, amplitudes**2, optimize=True))


def _bias_factor(survey: RecordSurvey, index: int, points: GroupSpectra) -> FloatArray:
    """Factor that corrects the bias of FRFs by noise of the force, which adds to the force's power."""
    noise = survey.force.density(points.frequency_hz)
    gates = np.array([gate_variance(points.s, pulse) for pulse in survey.pulses[index]])
    added = noise * (survey.force_growth.scales(survey.groups[index]) @ gates)
    return np.asarray(1 / (1 - np.minimum(added / points.power, MAX_BIAS)))


def _transform_to(group: tuple[ObservedRecord, ...], s: ComplexArray) -> GroupSpectra:
    pairs = transform_records(group, s)
    return GroupSpectra(
        s=s,
        force=np.stack([force for force, _ in pairs], 1),
        responses=np.stack([responses for _, responses in pairs], 1),
    )


def _noise_covariance(noise: Noise, s: ComplexArray, duration_s: float) -> ComplexArray:
    """Covariance of the transform of noise over a whole record."""
    rate = s[:, None] + s[None, :].conj()
    root = np.sqrt(noise.density(s.imag / (2 * np.pi)))
    return np.asarray(np.outer(root, root) * (1 - np.exp(-rate * duration_s)) / rate)


def _shared_errors(survey: RecordSurvey, index: int, points: GroupSpectra) -> ComplexArray:
    """Errors that the force's noise puts on all FRFs of a group, as independent columns."""
    n = len(points.frequency_hz)
    if survey.force.white == 0 and survey.force.pink == 0:
        return np.zeros((n, 0), np.complex128)
    s = points.s
    root = np.sqrt(survey.force.density(points.frequency_hz))
    total = np.zeros((n, n), np.complex128)
    scales = survey.force_growth.scales(survey.groups[index])
    for column, pulse in enumerate(survey.pulses[index]):
        force = points.force[:, column]
        total += scales[column] * np.outer(force.conj(), force) * gate_covariance(s, pulse)
    total *= np.outer(root, root) / np.outer(points.power, points.power)
    stds = np.sqrt(np.diag(total).real)  # lines that a shaker hardly drives err by far more than others
    values, vectors = linalg.eigh(total / np.outer(stds, stds))
    strong = values > COMPONENT_PART
    return np.asarray(stds[:, None] * vectors[:, strong] * np.sqrt(values[strong]))
