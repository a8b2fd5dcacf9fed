"""FRFs and modes of weak and of strong blows: what a structure that is not linear changes with the level.

Each FRF is estimated anew from the weaker and from the stronger half of the blows at a place. Around each mode, the FRF
of every single blow gives a frequency and a damping ratio (`fit_local_pole`).
Records of a shaker are cut into pieces as long as those of the FRFs.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.measured.forces import isolate_pulse
from frf_ipz.diagnosis.measured.local_pole import LocalPole, fit_local_pole, lines_around_pole
from frf_ipz.frf import FrfLabel
from frf_ipz.ingest.signals.transients import transform_subrecords

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from frf_ipz.diagnosis.observations import Observations, ObservedRecord
    from frf_ipz.identification.modal_fit import ModalFit

LEAST_RATIO = 1.5  # of the strongest to the weakest blow at a place: below, there is one level only
LEAST_BLOWS = 2
LEAST_LINES = 8
STANDS_OUT = 0.5  # of an FRF at its peak: a mode that has less of it is not seen by itself
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
    """Weak beside strong blows.

    Parameters
    ----------
    frequency_hz : (n_lines,) array
        Lines of the band, Hz.
    labels : tuple of FrfLabel
        FRFs of places that were struck at several levels.
    weak, strong : (n_lines, n_frfs) array
        Magnitudes, SI, under the window of the FRFs.
    weak_N, strong_N : (n_frfs,) array
        Mean peak force of the blows behind them, N.
    modes : DataFrame
        One row a mode and blow: ``mode`` (from 0), ``frf``, ``record``, ``level_N``, ``frequency_hz``,
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
    """Compare weak and strong blows, FRF by FRF and mode by mode.

    Parameters
    ----------
    observations : Observations
        The blows or records. Places that were struck at one level only say nothing.
    fit : ModalFit
        Says which modes there are.

    Returns
    -------
    LevelDependence
        Without FRFs where nothing can be compared.
    """
    groups, frfs = list(_groups(observations)), observations.frfs
    if not groups or frfs is None:
        return _put_together(np.zeros(0), [], [])
    low, high = observations.band_hz
    step, is_hammer = groups[0][0].step_s, observations.kind == "hammer"
    n = max(record.n_samples for group in groups for record in group)
    if not is_hammer:
        n = round(1 / (step * float(np.diff(frfs.frequency_hz[:2])[0])))
    frequency = np.asarray(np.fft.rfftfreq(n, step))
    used = (frequency >= low) & (frequency <= high)
    s = frfs.window_decay_1_s + 2j * np.pi * frequency[used]
    ends = is_hammer or frfs.window_decay_1_s > 0
    transform = partial(_decaying, decay_1_s=frfs.window_decay_1_s) if ends else _going_on
    curves: list[_Curve] = []
    rows: list[tuple[object, ...]] = []
    for group in groups:
        records = [isolate_pulse(record).record if is_hammer else record for record in group]
        spectra = [transform(record, n)[:, :, used] for record in records]
        curves += _halves(group, spectra)
        rows += _modes(group, spectra, s, fit)
    return _put_together(frequency[used], curves, rows)


@dataclass(frozen=True, slots=True)
class _Curve:
    """One FRF of weak and of strong blows."""

    label: FrfLabel
    weak: FloatArray
    strong: FloatArray
    weak_level: float
    strong_level: float


def _put_together(
    frequency_hz: FloatArray, curves: Sequence[_Curve], rows: Sequence[tuple[object, ...]]
) -> LevelDependence:
    shape = len(curves), len(frequency_hz)
    return LevelDependence(
        frequency_hz=frequency_hz,
        labels=tuple(one.label for one in curves),
        weak=np.array([one.weak for one in curves]).reshape(shape).T,
        strong=np.array([one.strong for one in curves]).reshape(shape).T,
        weak_N=np.array([one.weak_level for one in curves]),
        strong_N=np.array([one.strong_level for one in curves]),
        modes=pd.DataFrame(list(rows), columns=list(COLUMNS)),
    )


def _halves(group: Sequence[ObservedRecord], spectra: Sequence[ComplexArray]) -> list[_Curve]:
    parts = slice(len(group) // 2, None), slice(None, len(group) // 2)  # the strongest come first
    weak, strong = (np.abs(_h1(np.concatenate(spectra[part]))) for part in parts)
    levels = [float(np.mean([record.level for record in group[part]])) for part in parts]
    return [_Curve(label, weak[:, row], strong[:, row], *levels) for row, label in enumerate(_labels(group[0]))]


def _groups(observations: Observations) -> Iterator[tuple[ObservedRecord, ...]]:
    """Blows of several levels at one place with the sensors in one place, the strongest first."""
    for dof in observations.input_dofs:
        records = [record for record in observations.at(dof) if record.rested or observations.kind != "hammer"]
        for labels in dict.fromkeys(tuple(_labels(record)) for record in records):
            group = tuple(record for record in records if tuple(_labels(record)) == labels)
            if len(group) >= LEAST_BLOWS and group[0].level > LEAST_RATIO * group[-1].level:
                yield group


def _labels(record: ObservedRecord) -> list[FrfLabel]:
    return [
        FrfLabel(sensor.dof, record.input_dof, sensor.quantity, sensor.channel, record.input_channel)
        for sensor in record.sensors
    ]


def _decaying(record: ObservedRecord, n: int, decay_1_s: float) -> ComplexArray:
    """Transform force and responses under one window, (1, 1 + n_sensors, n_lines)."""
    signals = np.vstack([record.force, record.responses])
    window = np.exp(-decay_1_s * record.step_s * np.arange(record.n_samples))
    return np.asarray(np.fft.rfft(signals * window, n))[None] * record.step_s


def _going_on(record: ObservedRecord, n: int) -> ComplexArray:
    """Transform pieces without what goes on at their ends, (n_pieces, 1 + n_sensors, n_lines)."""
    pieces = transform_subrecords(record.force, record.responses, n)
    return np.stack([np.vstack(piece) for piece in pieces]) * record.step_s


def _h1(spectra: ComplexArray) -> ComplexArray:
    """FRFs of some blows or segments together, (n_lines, n_sensors)."""
    force, responses = spectra[:, :1], spectra[:, 1:]
    cross = np.sum(responses * force.conj(), axis=0)
    return np.asarray((cross / np.sum(np.abs(force) ** 2, axis=0)).T)


def _modes(
    group: Sequence[ObservedRecord], spectra: Sequence[ComplexArray], s: ComplexArray, fit: ModalFit
) -> list[tuple[object, ...]]:
    labels = _labels(group[0])
    rows: list[tuple[object, ...]] = []
    for mode, pole in enumerate(fit.model.poles[: fit.n_modes]):
        sensor = _clearest(labels, fit, mode)
        near = lines_around_pole(s, complex(pole))
        if sensor is None or len(near) < LEAST_LINES:
            continue
        for record, lines in zip(group, spectra, strict=True):
            found = fit_local_pole(s[near], _h1(lines)[near, sensor], complex(pole))
            if found is not None:
                rows.append((mode, str(labels[sensor]), record.name, record.level, *_as_numbers(found)))
    return rows


def _clearest(labels: Sequence[FrfLabel], fit: ModalFit, mode: int) -> int | None:
    """Which of the sensors shows a mode best; none where others hide it in all of them."""
    pole = complex(fit.model.poles[mode])
    peak = np.array([1j * pole.imag])
    alone = np.abs(fit.model.residues[mode] / (peak[0] - pole))
    share = alone / np.maximum(np.abs(fit.model(peak)[0]), np.finfo(float).tiny)
    ends = [(label.output_dof, label.input_dof, label.quantity) for label in fit.labels]
    seen = [
        (float(alone[ends.index(own)]), row)
        for row, label in enumerate(labels)
        if (own := (label.output_dof, label.input_dof, label.quantity)) in ends and share[ends.index(own)] > STANDS_OUT
    ]
    return max(seen)[1] if seen else None


def _as_numbers(found: LocalPole) -> tuple[float, float, float, float]:
    """Frequency, Hz, and damping ratio, each before its standard deviation."""
    size = abs(found.pole)
    return size / (2 * np.pi), found.std_rad_s / (2 * np.pi), -found.pole.real / size, found.std_rad_s / size
