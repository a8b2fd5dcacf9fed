"""Residual motion in records: dc offsets of channels, and what earlier impacts have left of the structure's motion.

Near the axis an offset c looks like c / s, which is largest at the bottom of the band, and the few samples before an
impact do not determine it. What an earlier impact in the same recording has left decays at the poles of the structure,
each mode with as much as the earlier forces have left it times one residue; motion far below the band is as good as
another offset. Where a recording begins within the ringing of the converter's filter before an impact, its first
samples stand for the missing ones. None of it is proportional to the force, as every linear response to it is. On each
line the FRF is free, and what no FRF explains determines the residual motion of all records at once. What records do
not determine, since they are of one level, stays in them; the remaining uncertainty of the offsets goes on with them.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg
from scipy.linalg import block_diag
from scipy.ndimage import uniform_filter1d

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.diagnosis.measured.contour import WINDOW_DECAYS, find_resonances
from frf_ipz.diagnosis.measured.forces import (
    FIRST_SAMPLES,
    MISSING_SAMPLES,
    RINGING,
    Pulse,
    isolate_pulse,
    missing_ringing,
)
from frf_ipz.diagnosis.measured.group_spectra import FINER, GroupSpectra, group_records, transform_group
from frf_ipz.diagnosis.measured.local_pole import (
    LocalPole,
    fit_local_pole,
    lines_around_pole,
    lines_of_one_number,
)
from frf_ipz.diagnosis.measured.noise import Noise, fit_noise
from frf_ipz.diagnosis.observations import ResidualMotion

if TYPE_CHECKING:
    from frf_ipz.diagnosis.observations import Observations, ObservedRecord

LARGEST_OFFSET = 0.05  # of a channel's highest value: a larger offset has been removed already
OFFSET_DRIFT = 3.0  # times the noise: how far an offset drifts from record to record
MODAL_MOTION = 3.0  # times the motion just before an impact: standard deviation of each mode's residual motion
STATE_ERROR = 0.01  # of a mode's residual motion: impacts do not hit one exact point, and poles are not exact
MODEL_ERROR = 0.003  # of a response: misfit by sampling and by the positions of impacts
SMOOTHED_LINES = 11  # over which the energy that no FRF explains is averaged
ROUNDS = 3  # of weights: in the first one residual motion counts as noise
MOST_SAMPLES_BEFORE = 1000  # an impact, the last, that are weighed: their noise is solved for together
MIN_RECORDS = 2  # of a shaker in a group: a single one determines no offset
STARTED = 0.02  # of a shaker's largest force: with more it has started
MIN_SAMPLES_BEFORE = 4  # an impact, that show the residual motion
ROUNDING = 1e-6  # of the largest column of an uncertainty: smaller ones are left out
LEAST_NOISE = 1e-7  # of a channel's highest value: below the resolution of 24 bits, for channels that show nothing


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Group:
    """Records of a group, and the terms of the residual motion in each.

    The terms are an offset, first samples, and, where another impact came before, cosines and sines of decaying modes.
    """

    records: tuple[ObservedRecord, ...]
    pulses: tuple[Pulse, ...]  # of the same; of a shaker, from where it starts
    before: tuple[Pulse, ...]  # of all records at the excited point, those that lack a sensor too
    lines: GroupSpectra
    poles: ComplexArray
    pole_stds: FloatArray  # rad/s
    residues: FloatArray  # (n_poles, n_sensors), at most
    missing_samples: FloatArray  # (n_records, n_sensors), standard deviation of a first sample for the missing ones
    _spectra: dict[bool, ComplexArray] = field(init=False, default_factory=dict, repr=False)
    _signals: dict[tuple[bool, int], FloatArray] = field(init=False, default_factory=dict, repr=False)

    @property
    def n_samples(self) -> int:
        """Samples that are transformed."""
        return min(record.n_samples for record in self.records)

    @property
    def duration_s(self) -> float:
        """Time that is transformed."""
        return self.n_samples * self.records[0].step_s

    def n_terms(self, record: ObservedRecord) -> int:
        """Count the terms of the residual motion in a record."""
        return 1 + FIRST_SAMPLES + (2 * len(self.poles) if record.has_predecessor else 0)

    def unit_spectra(self, record: ObservedRecord) -> ComplexArray:
        """Transform terms of amplitude 1, (n_lines / FINER, n_terms): once for all records that have the same terms."""
        key = record.has_predecessor
        if key not in self._spectra:
            self._spectra[key] = self._transform_units(record)
        return self._spectra[key]

    def _transform_units(self, record: ObservedRecord) -> ComplexArray:
        step, s, n = record.step_s, self.lines.s[::FINER, None], self.n_samples

        def transformed(rates: ComplexArray) -> ComplexArray:
            turn = np.exp((rates - s) * step)
            return np.asarray(step * (1 - turn**n) / (1 - turn))

        first = np.hstack([transformed(np.zeros(1, complex)), step * np.exp(-s * step * np.arange(FIRST_SAMPLES))])
        if not record.has_predecessor:
            return first
        up, down = transformed(self.poles), transformed(self.poles.conj())
        return np.hstack([first, (up + down) / 2, (up - down) / 2j])

    def unit_signals(self, record: ObservedRecord) -> FloatArray:
        """Terms of amplitude 1 in time, (n_terms, n_samples); 0 for first samples, which FRFs allow for."""
        key = record.has_predecessor, record.n_samples
        if key not in self._signals:
            self._signals[key] = self._evaluate_units(record)
        return self._signals[key]

    def _evaluate_units(self, record: ObservedRecord) -> FloatArray:
        first = np.vstack([np.ones(record.n_samples), np.zeros((FIRST_SAMPLES, record.n_samples))])
        if not record.has_predecessor:
            return first
        turning = np.exp(np.outer(self.poles, record.step_s * np.arange(record.n_samples)))
        return np.concatenate([first, turning.real, turning.imag])

    def initial_state(self, record: ObservedRecord) -> tuple[ComplexArray, FloatArray] | None:
        """Compute the state of each mode at the first sample, for residues of 1, by the earlier forces.

        Returns
        -------
        tuple of (n_poles,) complex array and (n_poles,) array, or None
            States and their standard deviations; None if nothing came before, or one of the forces is unknown.
        """
        if not record.has_predecessor:
            return None
        earlier = [
            pulse.record
            for pulse in self.before
            if pulse.record.recording == record.recording and pulse.record.number < record.number
        ]
        if len(earlier) != record.number - 1:
            return None
        state, state_by_pole = np.zeros((2, len(self.poles)), complex)
        for previous in earlier:
            force, touched = previous.force, np.flatnonzero(previous.force)
            later = record.start_s - previous.start_s - record.step_s * touched
            decaying = record.step_s * np.exp(np.outer(self.poles, later))
            state += decaying @ force[touched]
            state_by_pole += decaying @ (later * force[touched])
        return state, np.hypot(STATE_ERROR * np.abs(state), self.pole_stds * np.abs(state_by_pole))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _NormalEquations:
    """Normal equations of the amplitudes in one channel of a group, record after record, each with its offset first."""

    n_terms: tuple[int, ...]
    noise: float
    curvature: FloatArray
    slope: FloatArray

    @property
    def offset_rows(self) -> IntArray:
        """Rows of the offsets."""
        return np.cumsum((0, *self.n_terms[:-1]))


def remove_residual_motion(observations: Observations) -> Observations:
    """Subtract what is no linear response to the force: dc offsets, and motion by an earlier impact.

    Parameters
    ----------
    observations : Observations
        Records from rest; others are returned unchanged.

    Returns
    -------
    Observations
        The same without residual motion, and with the uncertainty of their offsets.
    """
    if not observations.start_at_rest:
        return observations
    record_groups = group_records(observations)
    if observations.kind != "hammer" and min(len(records) for records in record_groups) < MIN_RECORDS:
        return observations
    decay = WINDOW_DECAYS / min(record.duration_s for record in observations.records)
    gate = isolate_pulse if observations.kind == "hammer" else _gate_from_start
    pulses = {record.name: gate(record) for record in observations.records}
    groups = [_prepare_group(records, pulses, observations, decay) for records in record_groups]
    residual: dict[tuple[str, str], _Estimate] = {}
    for channel in dict.fromkeys(sensor.channel for group in groups for sensor in group.records[0].sensors):
        rows = [
            (group, row)
            for group in groups
            for row, sensor in enumerate(group.records[0].sensors)
            if sensor.channel == channel
        ]
        residual |= {(name, channel): estimate for name, estimate in _estimate_channel(rows).items()}
    return replace(observations, records=tuple(_subtract(record, residual) for record in observations.records))


def _prepare_group(
    records: tuple[ObservedRecord, ...], all_pulses: dict[str, Pulse], observations: Observations, decay: float
) -> _Group:
    pulses = tuple(all_pulses[record.name] for record in records)
    before = tuple(all_pulses[record.name] for record in observations.records_at(records[0].input_dof))
    transformed = tuple(pulse.record for pulse in pulses)
    lines = transform_group(transformed, observations.band_hz, decay)
    poles: list[LocalPole] = []
    residues = np.zeros((0, len(records[0].sensors)))
    if any(record.has_predecessor for record in records):
        at_rest = tuple(pulse.record for pulse in before if not pulse.record.has_predecessor)
        own = tuple(record for record in transformed if not record.has_predecessor)
        from_rest = own or tuple(record for record in at_rest if record.sensors == at_rest[0].sensors)
        lines_from_rest = transform_group(from_rest, observations.band_hz, decay) if from_rest else lines
        duration_s = min(record.duration_s for record in from_rest or transformed)
        poles = _find_poles(lines_from_rest, decay, duration_s)
        of_all_sensors = lines_from_rest if own else lines
        peaks = [int(np.argmin(np.abs(of_all_sensors.s - pole.pole))) for pole in poles]
        distance = np.array(
            [np.abs(of_all_sensors.s[line] - pole.pole) for line, pole in zip(peaks, poles, strict=True)]
        )
        residues = np.abs(of_all_sensors.values[peaks]) * distance[:, None]
    return _Group(
        records=records,
        pulses=pulses,
        before=before,
        lines=lines,
        poles=np.array([pole.pole for pole in poles], complex),
        pole_stds=np.array([pole.std_rad_s for pole in poles]),
        residues=residues,
        missing_samples=np.array(
            [missing_ringing(pulse, pulse.record.responses)[1:] * (observations.kind == "hammer") for pulse in pulses]
        )
        * np.sqrt(MISSING_SAMPLES),
    )


def _gate_from_start(record: ObservedRecord) -> Pulse:
    """Gate a shaker's record from where its force starts: the structure moves from there on."""
    size = np.abs(record.force)
    return Pulse(
        record=record, start=max(int(np.argmax(size > STARTED * size.max())) - RINGING, 0), stop=record.n_samples
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Estimate:
    """The residual motion of a record in one channel, and how well it is known.

    The amplitudes of modes are uncertain by independent columns, (2 n_poles, n), shared by all records of the channel.
    """

    signal: FloatArray
    offset_std: float
    poles: ComplexArray
    columns: FloatArray


def _subtract(record: ObservedRecord, residual: dict[tuple[str, str], _Estimate]) -> ObservedRecord:
    estimates = [residual[record.name, sensor.channel] for sensor in record.sensors]
    poles, most = estimates[0].poles, max(estimate.columns.shape[1] for estimate in estimates)
    columns = np.zeros((len(estimates), 2 * len(poles), most))
    for row, estimate in enumerate(estimates):
        columns[row, :, : estimate.columns.shape[1]] = estimate.columns
    return replace(
        record,
        responses=record.responses - np.array([estimate.signal for estimate in estimates]),
        dc_offset_std=np.array([estimate.offset_std for estimate in estimates]),
        residual_motion=ResidualMotion(poles=poles, start_s=record.start_s, columns=columns) if len(poles) else None,
    )


def _find_poles(lines: GroupSpectra, decay: float, duration_s: float) -> list[LocalPole]:
    """Poles of the structure, as far as they stand out."""
    size = np.abs(lines.values) ** 2
    level = (size / np.maximum(np.median(size, axis=0), np.finfo(float).tiny)).sum(1)
    peaks = find_resonances(2 * np.pi * lines.frequency_hz, level, decay, at_ends=True)
    poles = []
    for omega, decay_rate in zip(peaks.omega_rad_s, peaks.decay_1_s, strict=True):
        start = complex(-decay_rate, omega)
        nearest = lines_around_pole(lines.s, start)
        sensor = int(np.argmax(size[nearest].sum(0) / size.sum(0)))
        pole = fit_local_pole(lines.s[nearest], lines.values[nearest, sensor], start, duration_s=duration_s)
        poles += [] if pole is None else [pole]
    return poles


def _estimate_channel(rows: list[tuple[_Group, int]]) -> dict[str, _Estimate]:
    """Estimate the residual motion of all records in one channel."""
    largest = max(float(np.abs(record.responses[row]).max()) for group, row in rows for record in group.records)
    least_noise = LEAST_NOISE * (largest or 1.0)  # of a channel that shows nothing at all, nothing is subtracted
    amplitudes = [[np.zeros(group.n_terms(record)) for record in group.records] for group, _ in rows]
    priors = [_prior_root(group, row) for group, row in rows]
    root, offsets = np.zeros((0, 0)), np.zeros(0, np.int64)
    for _ in range(ROUNDS):
        misfits = [
            _misfit(group, row, of_group, least_noise) for (group, row), of_group in zip(rows, amplitudes, strict=True)
        ]
        shown = [misfit for misfit in misfits if misfit is not None]
        equations = [
            _normal_equations(group, row, misfit, shown, least_noise)
            for (group, row), misfit in zip(rows, misfits, strict=True)
        ]
        before = np.cumsum([0, *(len(normal.slope) for normal in equations)])
        offsets = np.concatenate([start + normal.offset_rows for start, normal in zip(before, equations, strict=False)])
        drift = [
            OFFSET_DRIFT * normal.noise * _project_out_levels(group.records)
            for (group, _), normal in zip(rows, equations, strict=True)
        ]
        of_offsets = np.zeros((before[-1], 1 + len(offsets)))
        of_offsets[offsets] = np.hstack([np.full((len(offsets), 1), LARGEST_OFFSET * largest), block_diag(*drift)])
        spread = np.hstack([block_diag(*priors), of_offsets])
        information = spread.T @ block_diag(*(normal.curvature for normal in equations)) @ spread
        told, directions = linalg.eigh(information)  # by rounding, what little is told may fall below nothing
        root = spread @ (directions / np.sqrt(1 + np.maximum(told, 0.0)))  # of the covariance of what is estimated
        estimate = root @ (root.T @ np.concatenate([normal.slope for normal in equations]))
        amplitudes = [
            np.split(part, normal.offset_rows[1:])
            for part, normal in zip(np.split(estimate, before[1:-1]), equations, strict=True)
        ]
    records = [(group, record) for group, _ in rows for record in group.records]
    poles = [group.poles if record.has_predecessor else group.poles[:0] for group, record in records]
    of_modes = [
        offset + 1 + FIRST_SAMPLES + np.arange(2 * len(moving)) for offset, moving in zip(offsets, poles, strict=True)
    ]
    columns = _few_columns(root[np.concatenate(of_modes)])
    by_record = np.split(columns, np.cumsum([len(places) for places in of_modes])[:-1])
    return {
        record.name: _Estimate(
            signal=of_record @ group.unit_signals(record),
            offset_std=float(np.linalg.norm(root[offset])),
            poles=moving,
            columns=part,
        )
        for (group, record), of_record, offset, moving, part in zip(
            records, chain.from_iterable(amplitudes), offsets, poles, by_record, strict=True
        )
    }


def _few_columns(root: FloatArray) -> FloatArray:
    """Give as few columns as have the same covariance, but for rounding."""
    directions, sizes, _ = np.linalg.svd(root, full_matrices=False)
    large = sizes > ROUNDING * sizes.max(initial=0.0)
    return np.asarray(directions[:, large] * sizes[large])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Misfit:
    """What no FRF explains in one channel of a group, and the noise that it shows.

    Parameters
    ----------
    units : list of (n_lines / FINER, n_terms) complex array
        Terms of amplitude 1 of each record.
    variance : (n_lines / FINER, n_records) array
        Of the lines, by noise and by errors of the model.
    std : float
        Of a sample.
    noise : Noise
        Of the channel.
    n_records : int
        That show it.
    """

    units: list[ComplexArray]
    variance: FloatArray
    std: float
    noise: Noise
    n_records: int


def _misfit(group: _Group, row: int, amplitudes: list[FloatArray], least_noise: float) -> _Misfit | None:
    """Measure the misfit; None of a single record, which some FRF explains whatever is in it."""
    if len(group.records) < 2:
        return None
    units = [group.unit_spectra(record) for record in group.records]
    response, force = group.lines.responses[::FINER, :, row], group.lines.force[::FINER]
    rest = response - np.stack([unit @ size for unit, size in zip(units, amplitudes, strict=True)], 1)
    per_square = 2 * group.lines.s.real[0] / group.records[0].step_s
    energy = _unexplained_energy(force, rest) + least_noise**2 / per_square
    of_model = (MODEL_ERROR * np.abs(rest)) ** 2
    gain = np.full(len(energy), 0.5 / group.lines.s.real[0])
    noise = fit_noise(group.lines.frequency_hz[::FINER], energy, gain, np.mean(of_model, axis=1))
    quietest = float(np.min(energy / gain))  # where errors of the model may be all of a misfit, noise may be as well
    return _Misfit(
        units=units,
        variance=energy[:, None] + of_model,
        std=float(np.sqrt(np.median(energy) * per_square)),
        noise=replace(noise, white=max(noise.white, quietest)),
        n_records=len(group.records),
    )


def _normal_equations(
    group: _Group, row: int, misfit: _Misfit | None, shown: list[_Misfit], least_noise: float
) -> _NormalEquations:
    """Gather what lines and the samples before impacts tell; of a single record, no line tells anything."""
    before = [record.responses[row, : pulse.start] for record, pulse in zip(group.records, group.pulses, strict=True)]
    n_terms = tuple(group.n_terms(record) for record in group.records)
    if misfit is None:
        of_lines = np.zeros((sum(n_terms),) * 2), np.zeros(sum(n_terms))
        best = max(shown, key=lambda misfit: misfit.n_records, default=None)
        std, noise = (best.std, best.noise) if best else _noise_before(before, group.records[0].step_s, least_noise)
    else:
        of_lines = _equations_of_lines(group, row, misfit)
        std, noise = misfit.std, misfit.noise
    quiet = [
        _equations_before(group, record, samples, noise) for record, samples in zip(group.records, before, strict=True)
    ]
    return _NormalEquations(
        n_terms=n_terms,
        noise=std,
        curvature=of_lines[0] + block_diag(*(curvature for curvature, _ in quiet)),
        slope=of_lines[1] + np.concatenate([slope for _, slope in quiet]),
    )


def _noise_before(before: list[FloatArray], step_s: float, least_noise: float) -> tuple[float, Noise]:
    """Take all that moves before the impacts for white noise, where no repeated impact shows it."""
    std = max((float(np.std(samples)) for samples in before if len(samples)), default=0.0) or least_noise
    return std, Noise(white=std**2 * step_s)


def _equations_of_lines(group: _Group, row: int, misfit: _Misfit) -> tuple[FloatArray, FloatArray]:
    """Curvature and slope by the lines, on each of which the FRF is free."""
    response, force, units = group.lines.responses[::FINER, :, row], group.lines.force[::FINER], misfit.units
    weight = 1 / (lines_of_one_number(group.lines.s[::FINER], group.duration_s) * misfit.variance)
    shared = weight * force / np.sqrt(np.sum(weight * np.abs(force) ** 2, 1))[:, None]
    across = np.hstack([column[:, None].conj() * unit for column, unit in zip(shared.T, units, strict=True)])
    along = np.sum(shared.conj() * response, 1)
    weighted = [(unit.conj() * part[:, None]).T for unit, part in zip(units, weight.T, strict=True)]
    curvature = block_diag(*((part @ unit).real for part, unit in zip(weighted, units, strict=True)))
    slope = np.concatenate([(part @ values).real for part, values in zip(weighted, response.T, strict=True)])
    return curvature - (across.conj().T @ across).real, slope - (across.conj().T @ along).real


def _equations_before(
    group: _Group, record: ObservedRecord, before: FloatArray, noise: Noise
) -> tuple[FloatArray, FloatArray]:
    """Curvature and slope by the samples before the impact."""
    samples = before[-MOST_SAMPLES_BEFORE:]
    units = group.unit_signals(record)[:, len(before) - len(samples) : len(before)]
    if not len(samples):
        return np.zeros((len(units), len(units))), np.zeros(len(units))
    covariance = noise.autocovariance(len(samples), record.step_s, record.duration_s)
    weighted = linalg.solve_toeplitz(covariance, units.T)
    return np.asarray(units @ weighted), np.asarray(samples @ weighted)


def _prior_root(group: _Group, row: int) -> FloatArray:
    """Square root of the prior covariance of amplitudes, (n, any), but for the offsets' common part and their drift."""
    states = [group.initial_state(record) for record in group.records]
    motions = [
        MODAL_MOTION * float(np.sqrt(2 * np.mean(record.responses[row, : max(pulse.start, MIN_SAMPLES_BEFORE)] ** 2)))
        for record, pulse in zip(group.records, group.pulses, strict=True)
    ]
    residues = MODAL_MOTION * group.residues[:, row]
    for state, motion in zip(states, motions, strict=True):
        if state is not None:  # no mode moves more than the structure
            residues = np.fmin(residues, motion / np.maximum(np.abs(state[0]), np.finfo(float).tiny))
    parts = [
        _prior_of_record(record, state, residues, motion, missing)
        for record, state, motion, missing in zip(
            group.records, states, motions, group.missing_samples[:, row], strict=True
        )
    ]
    shared = np.concatenate([by_residues for _, by_residues in parts])
    return np.hstack([np.diag(np.concatenate([stds for stds, _ in parts])), shared])


def _prior_of_record(
    record: ObservedRecord,
    state: tuple[ComplexArray, FloatArray] | None,
    residues: FloatArray,
    motion: float,
    missing: float,
) -> tuple[FloatArray, FloatArray]:
    """Give standard deviations of a record's independent amplitudes, (n_terms,), and their part by residues.

    The latter, (n_terms, 2 n_poles), is shared with the other records of the group.
    """
    n = len(residues)
    if not record.has_predecessor:
        return np.array([0.0, *[missing] * FIRST_SAMPLES]), np.zeros((1 + FIRST_SAMPLES, 2 * n))
    if state is None:
        stds = np.array([motion, *[missing] * FIRST_SAMPLES, *[motion] * 2 * n])
        return stds, np.zeros((len(stds), 2 * n))
    amplitude, error = state[0] * residues, state[1] * residues
    real, imaginary = np.diag(amplitude.real), np.diag(amplitude.imag)
    shared = np.block([[np.zeros((1 + FIRST_SAMPLES, 2 * n))], [real, -imaginary], [-imaginary, -real]])
    return np.concatenate([[motion, *[missing] * FIRST_SAMPLES], error, error]), shared


def _project_out_levels(records: tuple[ObservedRecord, ...]) -> FloatArray:
    """Projector, (n_records, n_records), on what is not proportional to the levels, as a response would be."""
    levels = np.array([record.level for record in records])
    return np.asarray(np.eye(len(records)) - np.outer(levels, levels) / np.sum(levels**2))


def _unexplained_energy(force: ComplexArray, response: ComplexArray) -> FloatArray:
    """Energy, (n_lines,), that one FRF does not explain, averaged over neighbouring lines."""
    power = np.sum(np.abs(force) ** 2, 1)
    values = np.sum(response * force.conj(), 1) / power
    energy = np.sum(np.abs(response - values[:, None] * force) ** 2, 1) / (force.shape[1] - 1)
    floor = np.finfo(float).tiny + 1e-12 * float(np.mean(np.abs(response) ** 2))
    return np.asarray(uniform_filter1d(energy, SMOOTHED_LINES, mode="nearest") + floor)
