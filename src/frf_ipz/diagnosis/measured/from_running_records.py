"""FRFs of running records on lines that are closer together than the records' own.

A resonance may be narrower than the spacing of a record's lines. The record determines the FRF between two lines as
well: the transient is a different one there, as smooth, and is removed in the same way. The narrower the resonance, the
less accurately: what remains of the transient is a different error in each segment, so it shows in the scatter of the
segments.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import uniform_filter1d

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.diagnosis.observations import Observations
from frf_ipz.frf import FrfLabel, FrfSet
from frf_ipz.ingest.signals.transients import transform_subrecords

MAX_LINES = 2**16  # in the band
FINEST = 8  # lines for one of the record: off the axis 5 miss 3 % of a peak a quarter of a line wide, these 0.7 %
SMOOTHED_LINES = 2  # of the record, over which scatter is averaged
STATED_DOF = 8.0  # degrees of freedom that the stated variance of a line counts against its scatter


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Comb:
    """FRFs on one comb of lines.

    Parameters
    ----------
    values : (n_lines, n_frfs) complex array
        FRFs, SI.
    force : (n_lines, n_frfs) array
        Power of the force in all segments: where it happens to be low, FRFs err.
    scatter : (n_lines, n_frfs) array
        Variance of the FRFs by the scatter of the segments; 0 where there is one.
    scatter_dof : (n_frfs,) array
        Degrees of freedom of the scatter: the number of segments less one.
    """

    values: ComplexArray
    force: FloatArray
    scatter: FloatArray
    scatter_dof: FloatArray


def estimate_finer_frfs(observations: Observations, frfs: FrfSet) -> FrfSet:
    """Estimate FRFs of running records on finer lines.

    Parameters
    ----------
    observations : Observations
        Records that begin while the structure moves.
    frfs : FrfSet
        Estimated from them without their transients, in segments of the same length.

    Returns
    -------
    FrfSet
        In the band. The errors of neighbouring lines are correlated: each has the variance that makes all of them
        together as good as the record's own lines.
    """
    in_band = np.flatnonzero(frfs.in_band(observations.band_hz) & (frfs.frequency_hz > 0))
    factor = refinement_factor(len(in_band))
    spacing = float(frfs.frequency_hz[1] - frfs.frequency_hz[0])
    length = round(1 / (spacing * observations.records[0].step_s))
    lines = frfs.select_lines(np.repeat(in_band, factor))
    combs = [_estimate_comb(observations, frfs.labels, length, in_band, part / factor) for part in range(factor)]
    frequency = frfs.frequency_hz[in_band, None] + spacing * np.arange(factor) / factor
    noise = lines.variance * np.repeat(combs[0].force, factor, axis=0) / _interleave([comb.force for comb in combs])
    return replace(
        lines,
        frequency_hz=frequency.ravel(),
        values=np.stack([comb.values for comb in combs], 1).reshape(len(noise), -1),
        variance=noise * _excess_scatter(combs, noise)[:, None] * factor,
        correlated_lines=factor,
    )


def refinement_factor(n_lines: int) -> int:
    """Choose how many lines there are for one of the record.

    Parameters
    ----------
    n_lines : int
        Of the record, in the band.

    Returns
    -------
    int
        As many as it takes to go off the axis beside narrow resonances, unless the band has too many.
    """
    return int(np.clip(MAX_LINES // max(n_lines, 1), 1, FINEST))


def _interleave(values: list[FloatArray]) -> FloatArray:
    """(n_combs * n_lines, n_frfs) of all combs, by ascending frequency."""
    parts = np.stack(values, 1)
    return parts.reshape(-1, parts.shape[-1])


def _excess_scatter(combs: list[Comb], noise: FloatArray) -> FloatArray:
    """Scatter of segments on a line, and on those around it, over the stated variance; 1 at least."""
    dof, width = combs[0].scatter_dof, SMOOTHED_LINES * len(combs)
    if not dof.any():
        return np.ones(len(noise))
    smoothed_dof = SMOOTHED_LINES * dof.sum()
    scatter = _interleave([comb.scatter for comb in combs]) / np.maximum(noise, np.finfo(float).tiny)
    ratio = scatter @ dof / dof.sum()
    smoothed = uniform_filter1d(ratio, width, mode="nearest")
    return np.asarray(np.maximum((STATED_DOF + smoothed_dof * smoothed) / (STATED_DOF + smoothed_dof), 1.0))


def _estimate_comb(
    observations: Observations, labels: tuple[FrfLabel, ...], length: int, lines: IntArray, between: float
) -> Comb:
    force = np.zeros((len(lines), len(labels)))
    cross, power = np.zeros(force.shape, np.complex128), np.zeros(force.shape)
    n_segments = np.zeros(len(labels))
    column_of = {(label.output_channel, label.output_dof, label.input_dof): i for i, label in enumerate(labels)}
    for record in observations.records:
        columns = [column_of[sensor.channel, sensor.dof, record.input_dof] for sensor in record.sensors]
        for F, X in transform_subrecords(record.force, record.responses, length, lines, between=between):
            n_segments[columns] += 1
            force[:, columns] += (np.abs(F) ** 2)[:, None]
            cross[:, columns] += (F.conj() * X).T
            power[:, columns] += (np.abs(X) ** 2).T
    force = np.maximum(force, np.finfo(float).tiny)
    dof = np.maximum(n_segments - 1, 0.0)
    unexplained = np.maximum(power - np.abs(cross) ** 2 / force, 0.0)
    return Comb(values=cross / force, force=force, scatter=unexplained / force / np.maximum(dof, 1.0), scatter_dof=dof)
