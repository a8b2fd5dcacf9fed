"""Transfer functions and their errors from single blows."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.measured.contour import COARSE, Resonances, find_resonances
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
from frf_ipz.diagnosis.measured.transfer_functions import TransferFunctions
from frf_ipz.diagnosis.observations import Observations, ObservedRecord, spectra
from frf_ipz.frf import FrfLabel

ENOUGH = 8.0  # decays within a record: of a mode 3e-4 is left
SURE_PART = 0.6  # of a decay rate that was read from the width of a peak
LEAST_PART = 0.1  # of the decay that is enough by itself: keeps the transforms of noise finite
UNREPEATED = 2e-3  # of the motion: noise that is supposed where no blow was repeated
BEFORE = 32  # samples before a blow that tell the noise
AHEAD = 100  # samples that records keep before a pulse: with as many the limits of the verdict were chosen
MOST_BIAS = 0.5  # of the force's power that may be noise
COMMON_PART = 1e-2  # of a line's own: independent parts of shared errors below are left out


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RecordSurvey:
    """What has to be known about recordings before a contour is laid.

    Parameters
    ----------
    groups : tuple of tuple of ObservedRecord
        Blows with the same place and the same sensors, from shortly before their pulses on, without noise around them.
    pulses : tuple of tuple of Pulse
        The stretches of the forces that were kept; all of them for shakers.
    force : Noise
        Of the force channel.
    responses : dict of str to Noise
        Of each output channel.
    resonances : Resonances
        Peaks of all FRFs.
    least_decay_1_s : float
        sigma that makes the ends of the records vanish.
    """

    groups: tuple[tuple[ObservedRecord, ...], ...]
    pulses: tuple[tuple[Pulse, ...], ...]
    force: Noise
    responses: dict[str, Noise]
    resonances: Resonances
    least_decay_1_s: float


def survey_records(observations: Observations) -> RecordSurvey:
    """Find resonances, noise, and how fast records decay.

    Parameters
    ----------
    observations : Observations
        Blows or records.

    Returns
    -------
    RecordSurvey
        What `estimate_transfer_functions` needs.
    """
    is_hammer = observations.kind == "hammer"
    whole = _pulses(observations)
    pulses = _from_pulses(whole, observations.kind)
    groups = _records_of(pulses)
    decay = window_decay_1_s(record for group in groups for record in group)
    line_sets = [transform_group(group, observations.band_hz, decay) for group in groups]
    resonances = _resonances(line_sets, decay)
    gone_on = [_gone_on_energy(resonances, lines, group) for lines, group in zip(line_sets, groups, strict=True)]
    if is_hammer:
        flat = tuple(p for group in whole for p in group)
        noise = estimate_force_noise(tuple(b for group in group_records(observations) for b in group), flat)
    else:
        noise = _noise_of_records(groups, line_sets, gone_on)
    responses = _response_noise(whole, pulses, line_sets, noise, gone_on)
    return RecordSurvey(
        groups=groups,
        pulses=pulses,
        force=noise,
        responses=responses,
        resonances=resonances,
        least_decay_1_s=_least_decay(decay, resonances) if is_hammer else decay,
    )


def window_decay_1_s(records: Iterable[ObservedRecord]) -> float:
    """Give the sigma that makes the end of the shortest record vanish, 1/s."""
    return ENOUGH / min(record.duration_s for record in records)


def with_records(found: RecordSurvey, observations: Observations) -> RecordSurvey:
    """Give further blows the noise and the resonances of a survey.

    Parameters
    ----------
    found : RecordSurvey
        Of other blows of the same test.
    observations : Observations
        The further blows, at the same places.

    Returns
    -------
    RecordSurvey
        Of these.
    """
    pulses = _from_pulses(_pulses(observations), observations.kind)
    return replace(found, groups=_records_of(pulses), pulses=pulses)


def _pulses(observations: Observations) -> tuple[tuple[Pulse, ...], ...]:
    """Pulses of the blows of each place; of a shaker, the whole records."""
    groups = group_records(observations)
    if observations.kind != "hammer":
        return tuple(
            tuple(Pulse(record=record, start=0, stop=record.n_samples) for record in group) for group in groups
        )
    return tuple(tuple(isolate_pulse(record) for record in group) for group in groups)


def _from_pulses(pulses: tuple[tuple[Pulse, ...], ...], kind: str) -> tuple[tuple[Pulse, ...], ...]:
    """Pulses in blows of a hammer that begin shortly before them; records of a shaker stay whole."""
    if kind != "hammer":
        return pulses
    return tuple(tuple(_from_pulse(pulse) for pulse in group) for group in pulses)


def _records_of(pulses: tuple[tuple[Pulse, ...], ...]) -> tuple[tuple[ObservedRecord, ...], ...]:
    return tuple(tuple(pulse.record for pulse in group) for group in pulses)


def _from_pulse(pulse: Pulse) -> Pulse:
    """Leave out what lies before a pulse: noise alone, which a transform beside the axis weighs most of all."""
    begin, record = max(pulse.start - AHEAD, 0), pulse.record
    later = replace(
        record,
        force=record.force[begin:],
        responses=record.responses[:, begin:],
        start_s=record.start_s + begin * record.step_s,
    )
    return Pulse(record=later, start=pulse.start - begin, stop=pulse.stop - begin)


def _least_decay(enough_1_s: float, resonances: Resonances) -> float:
    """Sigma that makes what is left of every mode vanish, together with the mode's own decay."""
    slowest = float(resonances.decay_1_s.min(initial=np.inf)) if len(resonances.decay_1_s) else 0.0
    return max(enough_1_s - SURE_PART * slowest, LEAST_PART * enough_1_s)


def _response_noise(
    whole: tuple[tuple[Pulse, ...], ...],
    pulses: tuple[tuple[Pulse, ...], ...],
    line_sets: list[GroupSpectra],
    noise: Noise,
    gone_on: list[FloatArray],
) -> dict[str, Noise]:
    found = {}
    groups = _records_of(pulses)
    channels = dict.fromkeys(sensor.channel for group in groups for sensor in group[0].sensors)
    for channel in channels:
        stacks: list[tuple[FloatArray, ...]] = []
        for place, (group, lines) in enumerate(zip(groups, line_sets, strict=True)):
            names = [sensor.channel for sensor in group[0].sensors]
            if channel not in names or len(group) < 2:
                continue
            sensor = names.index(channel)
            energy = lines.unexplained[:, sensor]
            kept_s = np.mean([gate_variance(lines.s, pulse) for pulse in pulses[place]], axis=0)
            known = np.abs(lines.values[:, sensor]) ** 2 * noise.density(lines.frequency_hz) * kept_s
            known += gone_on[place][:, sensor]
            stacks.append((lines.frequency_hz, energy, _gain(group, lines), known))
        if stacks:
            fitted = fit_noise(*(np.concatenate(parts) for parts in zip(*stacks, strict=True)))
            found[channel] = fitted.rounded(_signals(groups, channel), groups[0][0].step_s)
        else:
            found[channel] = _noise_of_single(groups, whole, line_sets, channel)
    return found


def _signals(groups: tuple[tuple[ObservedRecord, ...], ...], channel: str) -> list[FloatArray]:
    return [
        values
        for group in groups
        for record in group
        for sensor, values in zip(record.sensors, record.responses, strict=True)
        if sensor.channel == channel
    ]


def _noise_of_records(
    groups: tuple[tuple[ObservedRecord, ...], ...], line_sets: list[GroupSpectra], gone_on: list[FloatArray]
) -> Noise:
    """Read the noise of a shaker's force from what records at a place do not share; channels agree on it."""
    found = []
    for group, lines, known in zip(groups, line_sets, gone_on, strict=True):
        if len(group) > 1:
            gain = _gain(group, lines)
            each = zip(lines.unexplained.T, np.abs(lines.values.T) ** 2, known.T, strict=True)
            found += [fit_force_noise(lines.frequency_hz, energy, gain, *others) for energy, *others in each]
    white, pink = np.median([(one.white, one.pink) for one in found], axis=0) if found else (0.0, 0.0)
    return Noise(white=float(white), pink=float(pink))


def _gain(group: tuple[ObservedRecord, ...], lines: GroupSpectra) -> FloatArray:
    """Energy on each line of noise of density 1 over the whole record."""
    rate = 2 * lines.s.real
    return np.asarray((1 - np.exp(-rate * _duration_s(group))) / rate)


def _noise_of_single(
    groups: tuple[tuple[ObservedRecord, ...], ...],
    whole: tuple[tuple[Pulse, ...], ...],
    line_sets: list[GroupSpectra],
    channel: str,
) -> Noise:
    """Guess the noise where no blow was repeated, from before the blow: not less than a small part of the motion."""
    white = 0.0
    for place, (group, lines) in enumerate(zip(groups, line_sets, strict=True)):
        names = [sensor.channel for sensor in group[0].sensors]
        if channel not in names:
            continue
        sensor = names.index(channel)
        energy = np.abs(lines.responses[:, 0, sensor]) ** 2 / _gain(group, lines)
        white = max(white, UNREPEATED**2 * float(np.median(energy)))
        before = whole[place][0].record.responses[sensor, : whole[place][0].start]
        if len(before) >= BEFORE:
            white = max(white, float(np.var(before)) * group[0].step_s)
    return Noise(white=white)


def _duration_s(group: tuple[ObservedRecord, ...]) -> float:
    return min(record.duration_s for record in group)


def _resonances(line_sets: list[GroupSpectra], decay: float) -> Resonances:
    lines = line_sets[0]
    level = np.zeros(len(lines.frequency_hz))
    for one in line_sets:
        size = np.abs(one.values) ** 2
        summed = (size / np.maximum(np.median(size, axis=0), np.finfo(float).tiny)).sum(1)
        level += np.interp(lines.frequency_hz, one.frequency_hz, summed)
    return find_resonances(2 * np.pi * lines.frequency_hz, level, decay)


def estimate_transfer_functions(found: RecordSurvey, s: ComplexArray) -> TransferFunctions:
    """Evaluate transfer functions on a contour.

    Parameters
    ----------
    found : RecordSurvey
        Of the recordings.
    s : (n_points,) complex array
        rad/s.

    Returns
    -------
    TransferFunctions
        With the covariance of their errors.
    """
    wide = np.asarray(np.maximum(s.real, COARSE.width * s.imag) + 1j * s.imag)
    labels, values, sizes, covariances, input_of, common = [], [], [], [], [], []
    for place, group in enumerate(found.groups):
        points = _at(group, s)
        too_small = _bias(found, place, points)
        size = np.maximum(np.abs(points.values), np.abs(_at(group, wide).values))
        crossed = points.force.conj() @ points.force.T / np.outer(points.power, points.power)
        units, left = _gone_on(found.resonances, points, group)
        units *= (points.force.conj() / points.power[:, None])[..., None]
        common.append(_common(found, place, points))
        for column, sensor in enumerate(group[0].sensors):
            labels.append(
                FrfLabel(sensor.dof, group[0].input_dof, sensor.quantity, sensor.channel, group[0].input_channel)
            )
            values.append(points.values[:, column] * too_small)
            sizes.append(size[:, column])
            noise = crossed * _record_noise(found.responses[sensor.channel], s, _duration_s(group))
            errors = np.column_stack(
                [
                    _constants(points, group, column),
                    _cut_off(found, place, points, column),
                    (units * left[..., column]).reshape(len(s), -1),
                ]
            )
            covariances.append(noise + errors @ errors.conj().T)
            input_of.append(place)
    return TransferFunctions(
        s=s,
        labels=tuple(labels),
        values=np.stack(values, 1),
        size=np.stack(sizes, 1),
        covariance=np.array(covariances),
        common=tuple(common),
        input_of=np.array(input_of),
    )


def _constants(points: GroupSpectra, group: tuple[ObservedRecord, ...], column: int) -> ComplexArray:
    """Error of an FRF, (n_points,), by one standard deviation of what may be left of a channel's constant."""
    durations = np.array([record.duration_s for record in group])
    units = (1 - np.exp(-np.outer(points.s, durations))) / points.s[:, None]
    stds = np.array([0.0 if record.constant_std is None else record.constant_std[column] for record in group])
    return np.asarray(np.sum(points.force.conj() * units * stds, 1) / points.power)


def _cut_off(found: RecordSurvey, place: int, points: GroupSpectra, column: int) -> ComplexArray:
    """Errors of an FRF, as independent columns, by the ringing that records lack at their beginning."""
    pulses, group = found.pulses[place], found.groups[place]
    sizes = np.array([missing_ringing(pulse, record.responses) for pulse, record in zip(pulses, group, strict=True)])
    if not sizes.any():
        return np.zeros((len(points.s), 0), np.complex128)
    step = group[0].step_s
    units = np.exp(np.outer(points.s, step * np.arange(1, MISSING_SAMPLES + 1))) * step
    of_force, of_response = (
        (points.force.conj() @ size / points.power)[:, None] * units for size in (sizes[:, 0], sizes[:, 1 + column])
    )
    return np.hstack([of_response, points.values[:, [column]] * of_force])


def _gone_on(
    resonances: Resonances, points: GroupSpectra, group: tuple[ObservedRecord, ...]
) -> tuple[ComplexArray, FloatArray]:
    """Transform what resonances went on to do after records ended, and say with how much of it each record ended.

    Each is by itself and of unknown phase: (n_points, n_blows, n_peaks) for half an amplitude of 1, and these halves,
    (n_blows, n_peaks, n_sensors).
    """
    decay = ENOUGH / _duration_s(group)
    backwards = [replace(record, force=record.force[::-1], responses=record.responses[:, ::-1]) for record in group]
    pairs = spectra(backwards, np.asarray(decay + 1j * resonances.omega_rad_s, np.complex128))
    poles = -resonances.decay_1_s + 1j * resonances.omega_rad_s
    ends = np.exp(-np.outer(points.s, [record.duration_s for record in group]))
    return ends[:, :, None] / (points.s[:, None, None] - poles), decay * np.abs([shown for _, shown in pairs])


def _gone_on_energy(resonances: Resonances, lines: GroupSpectra, group: tuple[ObservedRecord, ...]) -> FloatArray:
    """Energy, (n_lines, n_sensors), that blows do not share because of what went on after records ended."""
    units, left = _gone_on(resonances, lines, group)
    part = (1 - np.abs(lines.force) ** 2 / lines.power[:, None]) / max(len(group) - 1, 1)
    return np.asarray(np.einsum("pb,pbr,brs->ps", part, np.abs(units) ** 2, left**2, optimize=True))


def _bias(found: RecordSurvey, place: int, points: GroupSpectra) -> FloatArray:
    """Undo what noise of the force takes off the FRFs: it adds to the force's power."""
    noise = found.force.density(points.frequency_hz)
    added = noise * np.sum([gate_variance(points.s, pulse) for pulse in found.pulses[place]], axis=0)
    return np.asarray(1 / (1 - np.minimum(added / points.power, MOST_BIAS)))


def _at(group: tuple[ObservedRecord, ...], s: ComplexArray) -> GroupSpectra:
    pairs = spectra(group, s)
    return GroupSpectra(
        s=s,
        force=np.stack([force for force, _ in pairs], 1),
        responses=np.stack([responses for _, responses in pairs], 1),
    )


def _record_noise(noise: Noise, s: ComplexArray, duration_s: float) -> ComplexArray:
    """Covariance of the transform of noise over a whole record."""
    rate = s[:, None] + s[None, :].conj()
    root = np.sqrt(noise.density(s.imag / (2 * np.pi)))
    return np.asarray(np.outer(root, root) * (1 - np.exp(-rate * duration_s)) / rate)


def _common(found: RecordSurvey, place: int, points: GroupSpectra) -> ComplexArray:
    """Errors that the force's noise puts on all FRFs of a place, as independent columns."""
    n = len(points.frequency_hz)
    if found.force.white == 0:
        return np.zeros((n, 0), np.complex128)
    s = points.s
    root = np.sqrt(found.force.density(points.frequency_hz))
    total = np.zeros((n, n), np.complex128)
    for column, pulse in enumerate(found.pulses[place]):
        force = points.force[:, column]
        total += np.outer(force.conj(), force) * gate_covariance(s, pulse)
    total *= np.outer(root, root) / np.outer(points.power, points.power)
    own = np.sqrt(np.diag(total).real)  # lines that a shaker hardly drives err by far more than others
    values, vectors = linalg.eigh(total / np.outer(own, own))
    kept = values > COMMON_PART
    return np.asarray(own[:, None] * vectors[:, kept] * np.sqrt(values[kept]))
