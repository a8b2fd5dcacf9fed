"""Where a predicted band is wide, why, and which further sensor or blow would narrow it most."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray, IntArray

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.dofs import Dof
    from frf_ipz.frf import FrfLabel
    from frf_ipz.prediction.ensemble import ModelEnsemble
    from frf_ipz.rational import ZeroSet
    from frf_ipz.structure import ReducedModel

WIDE_DB = 3.0  # half the 90 % band from which a stretch is wide
JOINED = 0.05  # relative gap over which two wide stretches are one
FEWEST_LINES = 3  # of a stretch worth a warning
MOST_STRETCHES = 3  # an FRF: the widest are named
MOST_PLACES = 40  # places tried for a further sensor or blow
TRIED_LINES = 12  # of a wide stretch
AMPLITUDE_NOISE = 0.03  # relative error with which a further measurement would tell a mode's amplitude
Q95 = 1.645  # standard deviations of half a 90 % band


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WideBand:
    """Lines where the band is wide.

    Parameters
    ----------
    frf : int
        Which predicted FRF.
    lines : (k,) int array
        Lines of it.
    half_width_db : float
        The largest half width of the band there.
    """

    frf: int
    lines: IntArray
    half_width_db: float


def wide_bands(frequency_hz: FloatArray, low: FloatArray, high: FloatArray) -> tuple[WideBand, ...]:
    """Find where bands are wide.

    Parameters
    ----------
    frequency_hz : (n_lines,) array
        Hz.
    low, high : (n_lines, n_frfs) array
        90 % bands of the magnitudes; NaN where there is none.

    Returns
    -------
    tuple of WideBand
        The widest of each FRF.
    """
    stretches = []
    with np.errstate(divide="ignore", invalid="ignore"):  # a band may reach down to 0
        half = 10 * np.log10(high / low)
    for frf in range(half.shape[1]):
        lines = np.flatnonzero(half[:, frf] > WIDE_DB)
        gaps = np.flatnonzero(np.diff(frequency_hz[lines]) > JOINED * frequency_hz[lines][:-1]) + 1
        found = [
            WideBand(frf=frf, lines=part, half_width_db=float(half[part, frf].max()))
            for part in np.split(lines, gaps)
            if len(part) >= FEWEST_LINES
        ]
        stretches += sorted(found, key=lambda stretch: -stretch.half_width_db)[:MOST_STRETCHES]
    return tuple(stretches)


def explain_wide_band(
    stretch: WideBand,
    model: ReducedModel,
    members: ModelEnsemble,
    measured: Sequence[FrfLabel],
    predicted: FrfLabel,
    frequency_hz: FloatArray,
    zeros: ZeroSet,
) -> str:
    """Say why a band is wide, and what would narrow it most.

    Parameters
    ----------
    stretch : WideBand
        Where.
    model : ReducedModel
        The updated model.
    members : ModelEnsemble
        The ensemble.
    measured : sequence of FrfLabel
        What was measured.
    predicted : FrfLabel
        The FRF with the wide band.
    frequency_hz : (n_lines,) array
        Hz.
    zeros : ZeroSet
        Zeros of all predicted FRFs.

    Returns
    -------
    str
        One sentence or two.
    """
    lines = stretch.lines[np.unique(np.linspace(0, len(stretch.lines) - 1, TRIED_LINES).astype(int))]
    s = 2j * np.pi * frequency_hz[lines]
    logs = _logs(members, model, predicted, s)
    low, high = frequency_hz[stretch.lines[[0, -1]]]
    text = (
        f"{predicted}: from {low:.4g} to {high:.4g} Hz the 90 % band is up to {stretch.half_width_db:.0f} dB "
        f"to each side, {_reason(stretch, model, members, predicted, logs, frequency_hz, zeros)}"
    )
    return f"{text}; {_advice(model, members, measured, predicted, logs)}"


def _logs(members: ModelEnsemble, model: ReducedModel, label: FrfLabel, s: np.ndarray) -> FloatArray:
    """Magnitudes of all members in dB without their mean, (m, lines)."""
    values = np.abs(members.receptance(model.row(label.output_dof), model.row(label.input_dof), s))
    logs = 20 * np.log10(np.maximum(values, np.finfo(float).tiny))
    return np.asarray(logs - logs.mean(axis=0))


def _reason(
    stretch: WideBand,
    model: ReducedModel,
    members: ModelEnsemble,
    predicted: FrfLabel,
    logs: FloatArray,
    frequency_hz: FloatArray,
    zeros: ZeroSet,
) -> str:
    low, high = frequency_hz[stretch.lines[[0, -1]]] * np.array([1 - JOINED, 1 + JOINED])
    hertz = np.abs(zeros.values) / (2 * np.pi)
    here = (zeros.frf == stretch.frf) & (hertz > low) & (hertz < high)
    if here.any():
        return f"as the zero at {hertz[here][0]:.4g} Hz follows from shapes that the measured points leave open"
    count = int(np.count_nonzero(np.sqrt(members.modes[0].mean(axis=0)) < 4 * np.pi * frequency_hz[-1])) or 1
    amplitudes = members.amplitudes(model.row(predicted.output_dof), model.row(predicted.input_dof), count)
    amplitudes = amplitudes - amplitudes.mean(axis=0)
    size = np.linalg.norm(amplitudes, axis=0) * np.linalg.norm(logs, axis=0).max()
    share = np.abs(amplitudes.T @ logs).max(axis=1) / np.maximum(size, np.finfo(float).tiny)
    mode = int(np.argmax(share))
    hertz_of_mode = float(np.sqrt(members.modes[0][:, mode].mean()) / (2 * np.pi))
    return f"as the shape of the mode at {hertz_of_mode:.4g} Hz is open there"


def _advice(
    model: ReducedModel, members: ModelEnsemble, measured: Sequence[FrfLabel], predicted: FrfLabel, logs: FloatArray
) -> str:
    before = float(np.sqrt(np.mean(logs**2)))
    best, words = before, ""
    for text, output, force in _candidates(model, measured, predicted):
        after = _remaining(logs, members.amplitudes(model.row(output), model.row(force), _modes(members)))
        if after < best:
            best, words = after, text
    if not words or best > 0.9 * before:
        return "no single further sensor or blow would narrow it by much"
    return f"{words} would narrow it most, from {Q95 * before:.1f} to about {Q95 * best:.1f} dB on the mean"


def _modes(members: ModelEnsemble) -> int:
    """Count the modes that a further measurement would tell of: about half the order of the model."""
    return max(int(members.modes[0].shape[1]) // 2, 1)


def _candidates(model: ReducedModel, measured: Sequence[FrfLabel], predicted: FrfLabel) -> list[tuple[str, Dof, Dof]]:
    sensors = list(dict.fromkeys(label.output_dof.unsigned for label in measured))
    records = list(dict.fromkeys(label.input_dof.unsigned for label in measured))
    directions = {dof.direction for dof in (*sensors, *records)}
    places = [
        dof for dof in model.expanded_dofs if dof.direction in directions and dof != predicted.output_dof.unsigned
    ]
    places = [places[index] for index in np.unique(np.linspace(0, len(places) - 1, MOST_PLACES).astype(int))]
    taken = {(label.output_dof.unsigned, label.input_dof.unsigned) for label in measured}
    further = [(f"a sensor at {dof.name}", dof, records[0]) for dof in places]
    further += [(f"a blow at {dof.name}", sensors[0], dof) for dof in places]
    return [(text, output, force) for text, output, force in further if (output, force) not in taken]


def _remaining(logs: FloatArray, amplitudes: FloatArray) -> float:
    """Root mean square of the logarithms once the amplitudes are known, by linear regression over the members."""
    scale = np.sqrt(np.mean(amplitudes**2))
    known = (amplitudes - amplitudes.mean(axis=0)) / scale
    count = len(known)
    covariance = known.T @ known / count + AMPLITUDE_NOISE**2 * np.eye(known.shape[1])
    cross = known.T @ logs / count
    explained = np.sum(cross * np.linalg.solve(covariance, cross), axis=0)
    return float(np.sqrt(np.mean(np.maximum(np.mean(logs**2, axis=0) - explained, 0.0))))
