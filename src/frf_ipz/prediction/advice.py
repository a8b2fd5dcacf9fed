"""Where a predicted band is wide, why, and which further sensor or excitation would narrow it most."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray, IntArray
from frf_ipz.dofs import node_dofs

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.dofs import AnyDof
    from frf_ipz.frf import FrfLabel
    from frf_ipz.prediction.ensemble import ModelEnsemble
    from frf_ipz.rational import ZeroSet
    from frf_ipz.structure import ReducedModel

WIDE_DB = 3.0  # half the 90 % band from which it is wide
JOINED = 0.05  # relative gap over which two wide bands are one
MIN_LINES = 3  # of a wide band worth a warning
MAX_BANDS = 3  # an FRF: the widest are named
MOST_PLACES = 6  # that a text names, of bands that have their reason in common
MAX_CANDIDATES = 40  # DOFs tried for a further sensor or excitation
TRIED_LINES = 12  # of a wide band
AMPLITUDE_NOISE = 0.03  # relative error of a mode's amplitude from a further measurement
Q95 = 1.645  # standard deviations of half a 90 % band


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WideBand:
    """Neighbouring lines on which the band of an FRF is wide.

    Parameters
    ----------
    frf : int
        Number of the predicted FRF.
    lines : (k,) int array
        Its lines.
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
    bands = []
    with np.errstate(divide="ignore", invalid="ignore"):  # a band may reach down to 0
        half = 10 * np.log10(high / low)
    for frf in range(half.shape[1]):
        lines = np.flatnonzero(half[:, frf] > WIDE_DB)
        gaps = np.flatnonzero(np.diff(frequency_hz[lines]) > JOINED * frequency_hz[lines][:-1]) + 1
        of_frf = [
            WideBand(frf=frf, lines=part, half_width_db=float(half[part, frf].max()))
            for part in np.split(lines, gaps)
            if len(part) >= MIN_LINES
        ]
        bands += sorted(of_frf, key=lambda band: -band.half_width_db)[:MAX_BANDS]
    return tuple(bands)


def explain_wide_bands(
    bands: Sequence[WideBand],
    updated_model: ReducedModel,
    ensemble: ModelEnsemble,
    measured: Sequence[FrfLabel],
    predicted: Sequence[FrfLabel],
    frequency_hz: FloatArray,
    zeros: ZeroSet,
) -> tuple[str, ...]:
    """Say why bands are wide, and what would narrow them most: once for all that have reason and remedy in common.

    Parameters
    ----------
    bands : sequence of WideBand
        The lines.
    updated_model : ReducedModel
        The updated model.
    ensemble : ModelEnsemble
        Models drawn from what targets and prior leave open.
    measured : sequence of FrfLabel
        What was measured.
    predicted : sequence of FrfLabel
        The FRFs of the bands.
    frequency_hz : (n_lines,) array
        Hz.
    zeros : ZeroSet
        Zeros of all predicted FRFs.

    Returns
    -------
    tuple of str
        The widest bands first.
    """
    alike: dict[str, list[tuple[WideBand, str]]] = {}
    for band in sorted(bands, key=lambda band: -band.half_width_db):
        lines = band.lines[np.unique(np.linspace(0, len(band.lines) - 1, TRIED_LINES).astype(int))]
        label = predicted[band.frf]
        deviations = _log_deviations(ensemble, updated_model, label, 2j * np.pi * frequency_hz[lines])
        reason = _reason(band, updated_model, ensemble, label, deviations, frequency_hz, zeros)
        alike.setdefault(reason, []).append((band, _advice(updated_model, ensemble, measured, label, deviations)))
    return tuple(
        f"the 90 % band is up to {group[0][0].half_width_db:.0f} dB to each side {reason}: "
        f"{_places([band for band, _ in group], predicted, frequency_hz)}; {_remedy(group, predicted, frequency_hz)}"
        for reason, group in alike.items()
    )


def _remedy(group: Sequence[tuple[WideBand, str]], predicted: Sequence[FrfLabel], frequency_hz: FloatArray) -> str:
    """Give the first advice there is, and for which band where there are several."""
    for band, advice in group:
        if advice:
            return advice if len(group) == 1 else f"for {_places([band], predicted, frequency_hz)} {advice}"
    return f"no single further sensor or excitation would narrow {'it' if len(group) == 1 else 'any of them'} by much"


def _places(bands: Sequence[WideBand], predicted: Sequence[FrfLabel], frequency_hz: FloatArray) -> str:
    """Name FRFs and lines of bands, the widest first."""
    places: dict[str, list[str]] = {}
    for band in bands[:MOST_PLACES]:
        low, high = frequency_hz[band.lines[[0, -1]]]
        places.setdefault(str(predicted[band.frf]), []).append(f"{low:.4g} to {high:.4g} Hz")
    text = ", ".join(f"{label} from {' and '.join(parts)}" for label, parts in places.items())
    rest = len(bands) - MOST_PLACES
    return f"{text} and {rest} more" if rest > 0 else text


def _log_deviations(ensemble: ModelEnsemble, updated_model: ReducedModel, label: FrfLabel, s: np.ndarray) -> FloatArray:
    """Magnitudes of all members in dB without their mean, (m, lines)."""
    values = np.abs(ensemble.receptance(updated_model.row(label.output_dof), updated_model.row(label.input_dof), s))
    magnitude_db = 20 * np.log10(np.maximum(values, np.finfo(float).tiny))
    return np.asarray(magnitude_db - magnitude_db.mean(axis=0))


def _reason(
    band: WideBand,
    updated_model: ReducedModel,
    ensemble: ModelEnsemble,
    predicted: FrfLabel,
    deviations: FloatArray,
    frequency_hz: FloatArray,
    zeros: ZeroSet,
) -> str:
    low, high = frequency_hz[band.lines[[0, -1]]] * np.array([1 - JOINED, 1 + JOINED])
    hertz = np.abs(zeros.values) / (2 * np.pi)
    inside = (zeros.frf == band.frf) & (hertz > low) & (hertz < high)
    if inside.any():
        return "about zeros that depend on shapes which the measured points do not determine"
    count = int(np.count_nonzero(np.sqrt(ensemble.modes[0].mean(axis=0)) < 4 * np.pi * frequency_hz[-1])) or 1
    amplitudes = ensemble.amplitudes(
        updated_model.row(predicted.output_dof), updated_model.row(predicted.input_dof), count
    )
    amplitudes = amplitudes - amplitudes.mean(axis=0)
    size = np.linalg.norm(amplitudes, axis=0) * np.linalg.norm(deviations, axis=0).max()
    share = np.abs(amplitudes.T @ deviations).max(axis=1) / np.maximum(size, np.finfo(float).tiny)
    mode = int(np.argmax(share))
    hertz_of_mode = float(np.sqrt(ensemble.modes[0][:, mode].mean()) / (2 * np.pi))
    return f"where the shape of the mode at {hertz_of_mode:.4g} Hz is not determined"


def _advice(
    updated_model: ReducedModel,
    ensemble: ModelEnsemble,
    measured: Sequence[FrfLabel],
    predicted: FrfLabel,
    deviations: FloatArray,
) -> str:
    """Say what would narrow a band most, and by how much; nothing where nothing does."""
    before = float(np.sqrt(np.mean(deviations**2)))
    best, advice = before, ""
    candidates = _candidates(updated_model, measured, predicted)
    places = {dof: place for place, dof in enumerate({dof: None for _, *ends in candidates for dof in ends})}
    rows = np.array([updated_model.row(dof) for dof in places]).reshape(-1, len(updated_model.dofs))
    motions = rows @ ensemble.modes[1][:, :, : _observed_modes(ensemble)]
    for text, output, force in candidates:
        after = _remaining_deviation(deviations, motions[:, places[output]] * motions[:, places[force]])
        if after < best:
            best, advice = after, text
    if not advice or best > 0.9 * before:
        return ""
    return f"{advice} would narrow it most, from {Q95 * before:.1f} to about {Q95 * best:.1f} dB on the mean"


def _observed_modes(ensemble: ModelEnsemble) -> int:
    """Count the modes whose amplitudes a further measurement would give: about half the order of the model."""
    return max(int(ensemble.modes[0].shape[1]) // 2, 1)


def _candidates(
    updated_model: ReducedModel, measured: Sequence[FrfLabel], predicted: FrfLabel
) -> list[tuple[str, AnyDof, AnyDof]]:
    sensors = list(dict.fromkeys(label.output_dof.unsigned for label in measured))
    excited = list(dict.fromkeys(label.input_dof.unsigned for label in measured))
    directions = {dof.direction for dof in (*sensors, *excited)}
    dofs: list[AnyDof] = [
        dof
        for dof in node_dofs(updated_model.expanded_dofs)
        if dof.direction in directions and dof != predicted.output_dof.unsigned
    ]
    kept = np.unique(np.linspace(0, len(dofs) - 1, MAX_CANDIDATES).astype(int)) if dofs else ()
    dofs = [dofs[index] for index in kept]
    measured_pairs = {(label.output_dof.unsigned, label.input_dof.unsigned) for label in measured}
    further = [(f"a sensor at {dof.name}", dof, excited[0]) for dof in dofs]
    further += [(f"an excitation at {dof.name}", sensors[0], dof) for dof in dofs]
    return [(text, output, force) for text, output, force in further if (output, force) not in measured_pairs]


def _remaining_deviation(deviations: FloatArray, amplitudes: FloatArray) -> float:
    """Root mean square of the deviations once the amplitudes are known, by linear regression over the members."""
    scale = np.sqrt(np.mean(amplitudes**2))
    known = (amplitudes - amplitudes.mean(axis=0)) / scale
    count = len(known)
    covariance = known.T @ known / count + AMPLITUDE_NOISE**2 * np.eye(known.shape[1])
    cross = known.T @ deviations / count
    explained = np.sum(cross * np.linalg.solve(covariance, cross), axis=0)
    return float(np.sqrt(np.mean(np.maximum(np.mean(deviations**2, axis=0) - explained, 0.0))))
