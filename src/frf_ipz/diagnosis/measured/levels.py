"""FRFs and modes at low and at high levels: how a structure that is not linear changes with the level.

Each FRF is estimated once more from the weaker and from the stronger half of the records of an excited point. Around
each mode, the FRF of every single record gives a frequency and a damping ratio (`fit_local_pole`).
Records of a shaker are cut into segments as long as those of the FRFs. FRFs that were estimated elsewhere at several
levels are compared as they are, lowest with highest.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.measured.forces import isolate_pulse
from frf_ipz.diagnosis.measured.local_pole import LocalPole, fit_local_pole, lines_around_pole
from frf_ipz.frf import FrfLabel
from frf_ipz.ingest.signals.transients import transform_subrecords
from frf_ipz.late_imports import import_late

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    import pandas as pd

    from frf_ipz.diagnosis.observations import Observations, ObservedRecord
    from frf_ipz.frf import FrfSet
    from frf_ipz.identification.modal_fit import ModalFit
else:
    pd = import_late("pandas")

MIN_LEVEL_RATIO = 1.5  # of the strongest to the weakest record of a group: below, there is one level only
MIN_RECORDS = 2  # at one excited point, to compare levels
MIN_LINES = 8
FARTHEST_PEAK = 10.0  # half-widths of a mode from one level to the next: farther peaks are other modes
DOMINANT = 0.5  # of an FRF at its peak: the part of it that a mode needs to be fitted by itself
COLUMNS = (
    "mode",
    "frf",
    "record",
    "level_N",
    "frequency_hz",
    "frequency_std_hz",
    "damping_ratio",
    "damping_ratio_std",
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LevelDependence:
    """Weak beside strong records.

    Parameters
    ----------
    frequency_hz : (n_lines,) array
        Lines of the band, Hz.
    labels : tuple of FrfLabel
        FRFs of points that were excited at several levels.
    weak, strong : (n_lines, n_frfs) array
        Magnitudes, SI, under the window of the FRFs.
    weak_N, strong_N : (n_frfs,) array
        Mean peak force of the records behind them, N.
    modes : DataFrame
        One row a mode and record: ``mode`` (from 0), ``frf``, ``record``, ``level_N``, ``frequency_hz``,
        ``frequency_std_hz``, ``damping_ratio``, ``damping_ratio_std``.
    """

    frequency_hz: FloatArray
    labels: tuple[FrfLabel, ...]
    weak: FloatArray
    strong: FloatArray
    weak_N: FloatArray  # noqa: N815  a unit
    strong_N: FloatArray  # noqa: N815  a unit
    modes: pd.DataFrame


def compare_levels(observations: Observations, fit: ModalFit) -> LevelDependence:
    """Compare weak and strong records, FRF by FRF and mode by mode.

    Parameters
    ----------
    observations : Observations
        The records. Points that were excited at one level only do not count.
    fit : ModalFit
        Its modes are followed.

    Returns
    -------
    LevelDependence
        Without FRFs where nothing can be compared.
    """
    groups, frfs = list(_records_by_level(observations)), observations.frfs
    if not groups or frfs is None:
        return _as_level_dependence(np.zeros(0), [], [])
    low, high = observations.band_hz
    step, is_hammer = groups[0][0].step_s, observations.kind == "hammer"
    n = max(record.n_samples for group in groups for record in group)
    if not is_hammer:
        n = round(1 / (step * float(np.diff(frfs.frequency_hz[:2])[0])))
    frequency = np.asarray(np.fft.rfftfreq(n, step))
    used = (frequency >= low) & (frequency <= high)
    s = frfs.window_decay_1_s + 2j * np.pi * frequency[used]
    ends = is_hammer or frfs.window_decay_1_s > 0
    transform = partial(_transform_with_window, decay_1_s=frfs.window_decay_1_s) if ends else _transform_running
    curves: list[_Curve] = []
    rows: list[tuple[object, ...]] = []
    for group in groups:
        records = [isolate_pulse(record).record if is_hammer else record for record in group]
        spectra = [transform(record, n)[:, :, used] for record in records]
        curves += _compare_halves(group, spectra)
        durations_s = [record.duration_s if ends else n * step for record in records]
        rows += _fit_modes(group, spectra, s, fit, durations_s)
    return _as_level_dependence(frequency[used], curves, rows)


def compare_frf_levels(at_levels: Mapping[float, FrfSet], fit: ModalFit) -> LevelDependence:
    """Compare FRFs that were estimated elsewhere at several levels, FRF by FRF and mode by mode.

    Parameters
    ----------
    at_levels : mapping of float to FrfSet
        Amplitude of the excitation, N, in ascending order, and the FRFs measured with it.
    fit : ModalFit
        Its modes are followed.

    Returns
    -------
    LevelDependence
        Without FRFs where none was measured at several levels; its ``record`` is the level as a text.
    """
    levels = list(at_levels)
    frequency = _shared_lines([frfs.frequency_hz for frfs in at_levels.values()])
    curves = []
    for label in dict.fromkeys(label for frfs in at_levels.values() for label in frfs.labels):
        own = [level for level in levels if label in at_levels[level].labels]
        if len(own) > 1:
            weak, strong = (np.abs(_values_at(at_levels[level], label, frequency)) for level in (own[0], own[-1]))
            curves.append(_Curve(label, weak, strong, own[0], own[-1]))
    labels = [curve.label for curve in curves]
    rows: list[tuple[object, ...]] = []
    for mode, pole in enumerate(fit.model.poles[: fit.n_modes]):
        clearest = _find_clearest_sensor(labels, fit, mode)
        if clearest is not None:
            rows += _follow_pole(at_levels, labels[clearest], mode, complex(pole))
    return _as_level_dependence(frequency, curves, rows)


def _follow_pole(
    at_levels: Mapping[float, FrfSet], label: FrfLabel, mode: int, pole: complex
) -> list[tuple[object, ...]]:
    """Follow a mode upwards, each level from the peak that is nearest to where the level below has it."""
    rows: list[tuple[object, ...]] = []
    for level, frfs in at_levels.items():
        if label not in frfs.labels:
            continue
        s = np.asarray(frfs.window_decay_1_s + 2j * np.pi * frfs.frequency_hz, np.complex128)
        values = frfs.values[:, frfs.labels.index(label)]
        near = np.flatnonzero(np.abs(s.imag - pole.imag) <= FARTHEST_PEAK * (s[0].real - pole.real))
        if not len(near):
            continue
        start = complex(pole.real, s.imag[near[np.argmax(np.abs(values[near]))]])
        nearest = lines_around_pole(s, start)
        if len(nearest) < MIN_LINES:
            continue
        duration_s = 2 * np.pi / float(np.median(np.diff(s.imag)))  # lines as far apart as independent ones are
        local = fit_local_pole(s[nearest], values[nearest], start, duration_s=duration_s)
        if local is not None:
            pole = local.pole
            rows.append((mode, str(label), f"{level:g} N", level, *_frequency_and_damping(local)))
    return rows


def _shared_lines(grids: Sequence[FloatArray]) -> FloatArray:
    """Give the lines of the coarsest grid that all grids reach."""
    if not grids:
        return np.zeros(0)
    low, high = max(grid[0] for grid in grids), min(grid[-1] for grid in grids)
    inside = [grid[(grid >= low) & (grid <= high)] for grid in grids]
    return min(inside, key=len)


def _values_at(frfs: FrfSet, label: FrfLabel, frequency_hz: FloatArray) -> ComplexArray:
    """Interpolate an FRF to lines that it may lack."""
    return np.asarray(np.interp(frequency_hz, frfs.frequency_hz, frfs.values[:, frfs.labels.index(label)]))


@dataclass(frozen=True, slots=True)
class _Curve:
    """One FRF of weak and of strong records."""

    label: FrfLabel
    weak: FloatArray
    strong: FloatArray
    weak_level: float
    strong_level: float


def _as_level_dependence(
    frequency_hz: FloatArray, curves: Sequence[_Curve], rows: Sequence[tuple[object, ...]]
) -> LevelDependence:
    shape = len(curves), len(frequency_hz)
    return LevelDependence(
        frequency_hz=frequency_hz,
        labels=tuple(curve.label for curve in curves),
        weak=np.array([curve.weak for curve in curves]).reshape(shape).T,
        strong=np.array([curve.strong for curve in curves]).reshape(shape).T,
        weak_N=np.array([curve.weak_level for curve in curves]),
        strong_N=np.array([curve.strong_level for curve in curves]),
        modes=pd.DataFrame(list(rows), columns=list(COLUMNS)),
    )


def _compare_halves(group: Sequence[ObservedRecord], spectra: Sequence[ComplexArray]) -> list[_Curve]:
    parts = slice(len(group) // 2, None), slice(None, len(group) // 2)  # the strongest come first
    weak, strong = (np.abs(_h1(np.concatenate(spectra[part]))) for part in parts)
    levels = [float(np.mean([record.level for record in group[part]])) for part in parts]
    return [_Curve(label, weak[:, row], strong[:, row], *levels) for row, label in enumerate(_labels(group[0]))]


def _records_by_level(observations: Observations) -> Iterator[tuple[ObservedRecord, ...]]:
    """Group records of several levels with one excited point and the same sensors, the strongest first."""
    for dof in observations.input_dofs:
        records = [
            record for record in observations.records_at(dof) if record.starts_at_rest or observations.kind != "hammer"
        ]
        for labels in dict.fromkeys(tuple(_labels(record)) for record in records):
            group = tuple(record for record in records if tuple(_labels(record)) == labels)
            if len(group) >= MIN_RECORDS and group[0].level > MIN_LEVEL_RATIO * group[-1].level:
                yield group


def _labels(record: ObservedRecord) -> list[FrfLabel]:
    return [
        FrfLabel(sensor.dof, record.input_dof, sensor.quantity, sensor.channel, record.input_channel)
        for sensor in record.sensors
    ]


def _transform_with_window(record: ObservedRecord, n: int, decay_1_s: float) -> ComplexArray:
    """Transform force and responses under one window, (1, 1 + n_sensors, n_lines)."""
    signals = np.vstack([record.force, record.responses])
    window = np.exp(-decay_1_s * record.step_s * np.arange(record.n_samples))
    return np.asarray(np.fft.rfft(signals * window, n))[None] * record.step_s


def _transform_running(record: ObservedRecord, n: int) -> ComplexArray:
    """Transform segments without their transients, (n_segments, 1 + n_sensors, n_lines)."""
    segments = transform_subrecords(record.force, record.responses, n)
    return np.stack([np.vstack(segment) for segment in segments]) * record.step_s


def _h1(spectra: ComplexArray) -> ComplexArray:
    """H1 estimate of the FRFs from records or segments, (n_lines, n_sensors)."""
    force, responses = spectra[:, :1], spectra[:, 1:]
    cross = np.sum(responses * force.conj(), axis=0)
    return np.asarray((cross / np.sum(np.abs(force) ** 2, axis=0)).T)


def _fit_modes(
    group: Sequence[ObservedRecord],
    spectra: Sequence[ComplexArray],
    s: ComplexArray,
    fit: ModalFit,
    durations_s: Sequence[float],
) -> list[tuple[object, ...]]:
    labels = _labels(group[0])
    rows: list[tuple[object, ...]] = []
    for mode, pole in enumerate(fit.model.poles[: fit.n_modes]):
        sensor = _find_clearest_sensor(labels, fit, mode)
        nearest = lines_around_pole(s, complex(pole))
        if sensor is None or len(nearest) < MIN_LINES:
            continue
        for record, lines, duration_s in zip(group, spectra, durations_s, strict=True):
            local = fit_local_pole(s[nearest], _h1(lines)[nearest, sensor], complex(pole), duration_s=duration_s)
            if local is not None:
                rows.append((mode, str(labels[sensor]), record.name, record.level, *_frequency_and_damping(local)))
    return rows


def _find_clearest_sensor(labels: Sequence[FrfLabel], fit: ModalFit, mode: int) -> int | None:
    """Index of the sensor with the largest response of a mode; None where other modes hide it in all of them."""
    pole = complex(fit.model.poles[mode])
    peak = np.array([1j * pole.imag])
    alone = np.abs(fit.model.residues[mode] / (peak[0] - pole))
    share = alone / np.maximum(np.abs(fit.model(peak)[0]), np.finfo(float).tiny)
    ends = [(label.output_dof, label.input_dof, label.quantity) for label in fit.labels]
    dominated = [
        (float(alone[ends.index(key)]), row)
        for row, label in enumerate(labels)
        if (key := (label.output_dof, label.input_dof, label.quantity)) in ends and share[ends.index(key)] > DOMINANT
    ]
    return max(dominated)[1] if dominated else None


def _frequency_and_damping(local: LocalPole) -> tuple[float, float, float, float]:
    """Frequency, Hz, and damping ratio, each before its standard deviation."""
    size = abs(local.pole)
    return size / (2 * np.pi), local.std_rad_s / (2 * np.pi), -local.pole.real / size, local.std_rad_s / size
