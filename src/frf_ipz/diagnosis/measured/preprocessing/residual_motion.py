"""What recordings of blows hold besides the response to the blow: constants of channels, and motion left from before.

Near the axis a constant c looks like c / s, which is largest at the bottom of the band, and the few samples before a
blow do not tell it. What a blow before in the same recording has left decays at the poles of the structure, each mode
with as much as the forces before have left it times one residue; what moves far below the band is as good as another
constant. Where a recording begins within the ringing of the converter's filter before a blow, its first samples stand
for what it lacks in the band. None of it grows with the blow, as all that a linear structure does in answer to it. On
each line the FRF is left free, and what no FRF explains gives it, for all blows at once. What the blows do not tell,
since they are of one level, stays in the recordings; how uncertain the constants are goes on with the blows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import block_diag
from scipy.ndimage import uniform_filter1d

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.diagnosis.measured.contour import find_resonances
from frf_ipz.diagnosis.measured.forces import MISSING_SAMPLES, RINGING, Pulse, isolate_pulse, missing_ringing
from frf_ipz.diagnosis.measured.group_spectra import FINER, GroupSpectra, group_records, transform_group
from frf_ipz.diagnosis.measured.local_pole import LocalPole, fit_local_pole, lines_around_pole

if TYPE_CHECKING:
    from frf_ipz.diagnosis.observations import Observations, ObservedRecord

DECAYS = 8.0  # sigma times the shortest record
LARGEST = 0.05  # of a channel's highest value: a larger constant has been taken off already
WANDERS = 3.0  # times the noise: how far a constant wanders from blow to blow
LEFT = 3.0  # times the motion just before a blow: what each mode may have of it
ASTRAY = 0.01  # of what a mode has left: blows do not fall on one place, and poles are not known
MISSED = 0.003  # of a response: what sampling and the places of blows leave
AROUND = 11  # lines over which what no FRF explains is averaged
ROUNDS = 3  # of weights: at first leftovers count as noise
AKIN = 0.1  # of a sample's variance: noise that the samples before a blow have in common
LEAST_RECORDS = 2  # of a shaker at a place: one alone tells no constant
SHAKEN = 0.02  # of a shaker's largest force: with more it has started
INSTEAD = 3  # first samples that stand for the ringing that a recording lacks
LEAST_BEFORE = 4  # samples before a blow that tell what is left
FAINTEST = 1e-7  # of a channel's highest value: noise below what 24 bits resolve, where blows at a place show nothing


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Group:
    """Blows at one place, and what may be in each: a constant, first samples and, after another, decaying modes."""

    records: tuple[ObservedRecord, ...]
    pulses: tuple[Pulse, ...]  # of the same; of a shaker, from where it starts
    lines: GroupSpectra
    poles: ComplexArray
    pole_stds: FloatArray  # rad/s
    residues: FloatArray  # (n_poles, n_sensors), at most
    lacking: FloatArray  # (n_blows, n_sensors), of the ringing before a blow: standard deviation of a sample instead

    @property
    def n_samples(self) -> int:
        """Samples that are transformed."""
        return min(record.n_samples for record in self.records)

    def count(self, record: ObservedRecord) -> int:
        """Count what may be left in a blow: a constant, first samples; after another one also cosines and sines."""
        return 1 + INSTEAD + (2 * len(self.poles) if record.follows else 0)

    def shapes(self, record: ObservedRecord) -> ComplexArray:
        """Transform unit leftovers, (n_lines / FINER, count)."""
        step, s, n = record.step_s, self.lines.s[::FINER, None], self.n_samples

        def transformed(rates: ComplexArray) -> ComplexArray:
            turn = np.exp((rates - s) * step)
            return np.asarray(step * (1 - turn**n) / (1 - turn))

        first = np.hstack([transformed(np.zeros(1, complex)), step * np.exp(-s * step * np.arange(INSTEAD))])
        if not record.follows:
            return first
        up, down = transformed(self.poles), transformed(self.poles.conj())
        return np.hstack([first, (up + down) / 2, (up - down) / 2j])

    def unit_signals(self, record: ObservedRecord) -> FloatArray:
        """Give unit leftovers in time, (count, n_samples); first samples stay: FRFs allow for what they lack."""
        first = np.vstack([np.ones(record.n_samples), np.zeros((INSTEAD, record.n_samples))])
        if not record.follows:
            return first
        turning = np.exp(np.outer(self.poles, record.step_s * np.arange(record.n_samples)))
        return np.concatenate([first, turning.real, turning.imag])

    def kicks(self, record: ObservedRecord) -> tuple[ComplexArray, FloatArray] | None:
        """Give what unit residues leave at the first sample, (n_poles,), and its error; None if a force is unknown."""
        if not record.follows:
            return None
        before = [
            (one, pulse.record.force)
            for one, pulse in zip(self.records, self.pulses, strict=True)
            if one.recording == record.recording and one.number < record.number
        ]
        if len(before) != record.number - 1:
            return None
        left, by_pole = np.zeros((2, len(self.poles)), complex)
        for one, force in before:
            touched = np.flatnonzero(force)
            later = record.start_s - one.start_s - record.step_s * touched
            decaying = record.step_s * np.exp(np.outer(self.poles, later))
            left += decaying @ force[touched]
            by_pole += decaying @ (later * force[touched])
        return left, np.hypot(ASTRAY * np.abs(left), self.pole_stds * np.abs(by_pole))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Told:
    """What blows at one place tell of the leftovers in one channel, blow after blow, each with its constant first."""

    counts: tuple[int, ...]
    noise: float
    curvature: FloatArray
    slope: FloatArray

    @property
    def constants(self) -> IntArray:
        """Where the constants stand."""
        return np.cumsum((0, *self.counts[:-1]))


def remove_residual_motion(observations: Observations) -> Observations:
    """Take off what no linear system answers to a blow with: constants, and motion left from a blow before.

    Parameters
    ----------
    observations : Observations
        Blows, or records from rest; others are given back as they are.

    Returns
    -------
    Observations
        The same without leftovers, and with what constants are still uncertain by.
    """
    if not observations.are_from_rest:
        return observations
    places = group_records(observations)
    if observations.kind != "hammer" and min(len(records) for records in places) < LEAST_RECORDS:
        return observations
    decay = DECAYS / min(record.duration_s for record in observations.records)
    groups = [_group(records, observations, decay) for records in places]
    found: dict[tuple[str, str], tuple[FloatArray, float]] = {}
    for channel in dict.fromkeys(sensor.channel for group in groups for sensor in group.records[0].sensors):
        rows = [
            (group, row)
            for group in groups
            for row, sensor in enumerate(group.records[0].sensors)
            if sensor.channel == channel
        ]
        found |= {(name, channel): left for name, left in _leftovers(rows).items()}
    return replace(observations, records=tuple(_without(record, found) for record in observations.records))


def _group(records: tuple[ObservedRecord, ...], observations: Observations, decay: float) -> _Group:
    is_hammer = observations.kind == "hammer"
    pulses = tuple(isolate_pulse(record) if is_hammer else _whole(record) for record in records)
    transformed = tuple(pulse.record for pulse in pulses)
    lines = transform_group(transformed, observations.band_hz, decay)
    found: list[LocalPole] = []
    residues = np.zeros((0, len(records[0].sensors)))
    if any(record.follows for record in records):
        from_rest = tuple(record for record in transformed if not record.follows)
        told = transform_group(from_rest, observations.band_hz, decay) if from_rest else lines
        found = _poles(told, decay)
        nearest = [int(np.argmin(np.abs(told.s - one.pole))) for one in found]
        away = np.array([np.abs(told.s[line] - one.pole) for line, one in zip(nearest, found, strict=True)])
        residues = np.abs(told.values[nearest]) * away[:, None]
    return _Group(
        records=records,
        pulses=pulses,
        lines=lines,
        poles=np.array([one.pole for one in found], complex),
        pole_stds=np.array([one.std_rad_s for one in found]),
        residues=residues,
        lacking=np.array([missing_ringing(pulse, pulse.record.responses)[1:] * is_hammer for pulse in pulses])
        * np.sqrt(MISSING_SAMPLES),
    )


def _whole(record: ObservedRecord) -> Pulse:
    """Give a shaker's record, which begins where its force does: the structure moves from there on."""
    size = np.abs(record.force)
    return Pulse(
        record=record, start=max(int(np.argmax(size > SHAKEN * size.max())) - RINGING, 0), stop=record.n_samples
    )


def _without(record: ObservedRecord, found: dict[tuple[str, str], tuple[FloatArray, float]]) -> ObservedRecord:
    left, stds = zip(*(found[record.name, sensor.channel] for sensor in record.sensors), strict=True)
    return replace(record, responses=record.responses - np.array(left), constant_std=np.array(stds))


def _poles(lines: GroupSpectra, decay: float) -> list[LocalPole]:
    """Poles of the structure, as far as they stand out."""
    size = np.abs(lines.values) ** 2
    level = (size / np.maximum(np.median(size, axis=0), np.finfo(float).tiny)).sum(1)
    peaks = find_resonances(2 * np.pi * lines.frequency_hz, level, decay, at_ends=True)
    found = []
    for omega, own in zip(peaks.omega_rad_s, peaks.decay_1_s, strict=True):
        start = complex(-own, omega)
        near = lines_around_pole(lines.s, start)
        sensor = int(np.argmax(size[near].sum(0) / size.sum(0)))
        pole = fit_local_pole(lines.s[near], lines.values[near, sensor], start)
        found += [] if pole is None else [pole]
    return found


def _leftovers(rows: list[tuple[_Group, int]]) -> dict[str, tuple[FloatArray, float]]:
    """Give the leftovers of all blows in one channel, as signals, and the standard deviations of the constants."""
    largest = max(float(np.abs(record.responses[row]).max()) for group, row in rows for record in group.records)
    faintest = FAINTEST * (largest or 1.0)  # of a channel that shows nothing at all, nothing is taken off
    sizes = [[np.zeros(group.count(record)) for record in group.records] for group, _ in rows]
    priors = [_prior(group, row) for group, row in rows]
    stds = np.zeros(0)
    for _ in range(ROUNDS):
        told = [_told(group, row, own, faintest) for (group, row), own in zip(rows, sizes, strict=True)]
        before = np.cumsum([0, *(len(one.slope) for one in told)])
        constants = np.concatenate([start + one.constants for start, one in zip(before, told, strict=False)])
        wandering = [
            WANDERS * one.noise * _unlike_levels(group.records) for (group, _), one in zip(rows, told, strict=True)
        ]
        of_constants = np.zeros((before[-1], 1 + len(constants)))
        of_constants[constants] = np.hstack([np.full((len(constants), 1), LARGEST * largest), block_diag(*wandering)])
        spread = np.hstack([block_diag(*priors), of_constants])
        known = spread.T @ block_diag(*(one.curvature for one in told)) @ spread
        covariance = spread @ np.linalg.solve(np.eye(len(known)) + known, spread.T)
        found = covariance @ np.concatenate([one.slope for one in told])
        sizes = [
            np.split(part, one.constants[1:]) for part, one in zip(np.split(found, before[1:-1]), told, strict=True)
        ]
        stds = np.sqrt(np.maximum(np.diag(covariance)[constants], 0.0))
    records = [(group, record) for group, _ in rows for record in group.records]
    return {
        record.name: (size @ group.unit_signals(record), float(std))
        for (group, record), size, std in zip(records, chain.from_iterable(sizes), stds, strict=True)
    }


def _told(group: _Group, row: int, sizes: list[FloatArray], faintest: float) -> _Told:
    shapes = [group.shapes(record) for record in group.records]
    response, force = group.lines.responses[::FINER, :, row], group.lines.force[::FINER]
    left = response - np.stack([shape @ size for shape, size in zip(shapes, sizes, strict=True)], 1)
    per_square = 2 * group.lines.s.real[0] / group.records[0].step_s
    energy = _unshared(force, left) + faintest**2 / per_square
    noise = float(np.sqrt(np.median(energy) * per_square))
    weight = 1 / (energy[:, None] + (MISSED * np.abs(left)) ** 2)
    shared = weight * force / np.sqrt(np.sum(weight * np.abs(force) ** 2, 1))[:, None]
    across = np.hstack([column[:, None].conj() * shape for column, shape in zip(shared.T, shapes, strict=True)])
    along = np.sum(shared.conj() * response, 1)
    own = [(shape.conj() * part[:, None]).T for shape, part in zip(shapes, weight.T, strict=True)]
    before = [record.responses[row, : pulse.start] for record, pulse in zip(group.records, group.pulses, strict=True)]
    quiet = [_quiet(group, record, samples, noise) for record, samples in zip(group.records, before, strict=True)]
    straight = [(one @ shape).real + more for one, shape, (more, _) in zip(own, shapes, quiet, strict=True)]
    slopes = [(one @ values).real + more for one, values, (_, more) in zip(own, response.T, quiet, strict=True)]
    return _Told(
        counts=tuple(shape.shape[1] for shape in shapes),
        noise=noise,
        curvature=block_diag(*straight) - (across.conj().T @ across).real,
        slope=np.concatenate(slopes) - (across.conj().T @ along).real,
    )


def _quiet(group: _Group, record: ObservedRecord, before: FloatArray, noise: float) -> tuple[FloatArray, FloatArray]:
    """Give the curvature and slope that the samples before the blow add."""
    n = len(before)
    shapes = group.unit_signals(record)[:, :n]
    variance = noise**2 * (1 + AKIN * n)
    return np.asarray(shapes @ shapes.T / variance), np.asarray(shapes @ before / variance)


def _prior(group: _Group, row: int) -> FloatArray:
    """Give a square root of the covariance of leftovers, (n, any), but for constants in common and their wandering."""
    kicks = [group.kicks(record) for record in group.records]
    motions = [
        LEFT * float(np.sqrt(2 * np.mean(record.responses[row, : max(pulse.start, LEAST_BEFORE)] ** 2)))
        for record, pulse in zip(group.records, group.pulses, strict=True)
    ]
    residues = LEFT * group.residues[:, row]
    for kick, motion in zip(kicks, motions, strict=True):
        if kick is not None:  # no mode has left more than moves
            residues = np.fmin(residues, motion / np.maximum(np.abs(kick[0]), np.finfo(float).tiny))
    parts = [
        _parts(record, kick, residues, motion, lacking)
        for record, kick, motion, lacking in zip(group.records, kicks, motions, group.lacking[:, row], strict=True)
    ]
    shared = np.concatenate([of_residues for _, of_residues in parts])
    return np.hstack([np.diag(np.concatenate([own for own, _ in parts])), shared])


def _parts(
    record: ObservedRecord,
    kick: tuple[ComplexArray, FloatArray] | None,
    residues: FloatArray,
    motion: float,
    lacking: float,
) -> tuple[FloatArray, FloatArray]:
    """Give deviations of a blow's own leftovers, (count,), and what residues leave, (count, 2 n_poles)."""
    n = len(residues)
    if not record.follows:
        return np.array([0.0, *[lacking] * INSTEAD]), np.zeros((1 + INSTEAD, 2 * n))
    if kick is None:
        own = np.array([motion, *[lacking] * INSTEAD, *[motion] * 2 * n])
        return own, np.zeros((len(own), 2 * n))
    left, error = kick[0] * residues, kick[1] * residues
    real, imaginary = np.diag(left.real), np.diag(left.imag)
    shared = np.block([[np.zeros((1 + INSTEAD, 2 * n))], [real, -imaginary], [-imaginary, -real]])
    return np.concatenate([[motion, *[lacking] * INSTEAD], error, error]), shared


def _unlike_levels(records: tuple[ObservedRecord, ...]) -> FloatArray:
    """Project on what differs from the levels of blows: what is like them may as well be their response."""
    levels = np.array([record.level for record in records])
    return np.asarray(np.eye(len(records)) - np.outer(levels, levels) / np.sum(levels**2))


def _unshared(force: ComplexArray, response: ComplexArray) -> FloatArray:
    """Energy, (n_lines,), that one FRF does not explain, averaged over neighbouring lines."""
    power = np.sum(np.abs(force) ** 2, 1)
    values = np.sum(response * force.conj(), 1) / power
    left = np.sum(np.abs(response - values[:, None] * force) ** 2, 1) / max(force.shape[1] - 1, 1)
    floor = np.finfo(float).tiny + 1e-12 * float(np.mean(np.abs(response) ** 2))
    return np.asarray(uniform_filter1d(left, AROUND, mode="nearest") + floor)
