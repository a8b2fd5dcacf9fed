"""FRFs of running records on lines that lie closer than the records' own.

A resonance may be narrower than the lines of a record lie apart. What is between two lines is in the record as well:
the transient is another one there, as smooth, and is taken off in the same way.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.diagnosis.observations import Observations
from frf_ipz.frf import FrfLabel, FrfSet
from frf_ipz.ingest.signals.transients import pieces_without_transients

MOST_LINES = 2**15  # in the band
FINEST = 8  # lines for one of the record


def finer_frfs(observations: Observations, frfs: FrfSet) -> FrfSet:
    """Estimate FRFs of running records on finer lines.

    Parameters
    ----------
    observations : Observations
        Records that go on at their beginning.
    frfs : FrfSet
        Estimated from them without their transients, in pieces of the same length.

    Returns
    -------
    FrfSet
        In the band. Neighbouring lines share what the record holds: each has the variance that makes all of them
        together as good as the record's own lines.
    """
    kept = np.flatnonzero(frfs.in_band(observations.band_hz) & (frfs.frequency_hz > 0))
    finer = int(np.clip(MOST_LINES // max(len(kept), 1), 1, FINEST))
    spacing = float(frfs.frequency_hz[1] - frfs.frequency_hz[0])
    length = round(1 / (spacing * observations.blows[0].step_s))
    lines = frfs.lines(np.repeat(kept, finer))
    combs = [_comb(observations, frfs.labels, length, kept, part / finer) for part in range(finer)]
    between = frfs.frequency_hz[kept, None] + spacing * np.arange(finer) / finer
    values, force = (np.stack(parts, 1).reshape(len(kept) * finer, -1) for parts in zip(*combs, strict=True))
    noise = lines.variance * np.repeat(combs[0][1], finer, axis=0)
    return replace(
        lines,
        frequency_hz=between.ravel(),
        values=values,
        variance=noise / force * finer,
        correlated_lines=finer,
    )


def _comb(
    observations: Observations, labels: tuple[FrfLabel, ...], length: int, lines: IntArray, between: float
) -> tuple[ComplexArray, FloatArray]:
    """FRFs on one comb of lines, and the force's power, (n_lines, n_frfs): where it happens to be weak they err."""
    force = np.zeros((len(lines), len(labels)))
    cross = np.zeros(force.shape, np.complex128)
    places = {(label.output_channel, label.output_dof, label.input_dof): place for place, label in enumerate(labels)}
    for blow in observations.blows:
        columns = [places[sensor.channel, sensor.dof, blow.input_dof] for sensor in blow.sensors]
        for F, X in pieces_without_transients(blow.force, blow.responses, length, lines, between=between):
            force[:, columns] += (np.abs(F) ** 2)[:, None]
            cross[:, columns] += (F.conj() * X).T
    force = np.maximum(force, np.finfo(float).tiny)
    return np.asarray(cross / force), force
