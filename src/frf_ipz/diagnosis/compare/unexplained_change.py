"""What a model cannot follow whatever is corrected in it: it counts as an error of the measurement."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.diagnosis.model.layout import make_layout

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from frf_ipz.diagnosis.evidence.fit import Fit
    from frf_ipz.diagnosis.observations import Observations
    from frf_ipz.frf import FrfSet

SHARING_POINTS = 3.0  # points of a contour that share what a model cannot follow


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class UnexplainedPart:
    """What a model cannot follow.

    Parameters
    ----------
    frequency_hz : (n_lines,) array
        Hz.
    part : (n_lines, n_frfs) array
        Of the measured FRFs, the median over several states.
    """

    frequency_hz: FloatArray
    part: FloatArray


def find_unexplained_part(measured: Sequence[FrfSet | None], fits: Sequence[Fit]) -> UnexplainedPart | None:
    """Compare fits line by line with what they were fitted to.

    Parameters
    ----------
    measured : sequence of FrfSet
        Of the states.
    fits : sequence of Fit
        Of their models.

    Returns
    -------
    UnexplainedPart or None
        None where there are no FRFs on lines.
    """
    frfs = [frf_set for frf_set in measured if frf_set is not None]
    if len(frfs) < len(fits):
        return None
    frequency = frfs[0].frequency_hz[frfs[0].in_band(fits[0].hypothesis.context.band_hz)]
    s = np.asarray(2j * np.pi * frequency, np.complex128)
    parts = []
    for frf_set, fit in zip(frfs, fits, strict=True):
        values = np.stack([np.interp(frequency, frf_set.frequency_hz, column) for column in frf_set.values.T], axis=1)
        model = fit.hypothesis.respond(fit.values, fit.nuisance, s).values
        size = np.maximum(np.abs(values), np.finfo(float).tiny)
        products, squares = np.sum((model.conj() * values).real / size**2, 0), np.sum(np.abs(model) ** 2 / size**2, 0)
        scale = np.ones(frf_set.n_frfs) if frf_set.unknown_scale == "none" else products / squares
        parts.append(np.abs(values - scale * model) / size)
    return UnexplainedPart(frequency_hz=frequency, part=np.median(parts, axis=0))


def discount_unexplained(
    observed: Observations, gains: Mapping[str, float], unexplained: UnexplainedPart | None
) -> Observations:
    """Remove known gains from what was observed, and discount what the model cannot follow.

    Parameters
    ----------
    observed : Observations
        Of a state.
    gains : mapping of str to float
        Factors by channel.
    unexplained : UnexplainedPart, optional
        By the states before.

    Returns
    -------
    Observations
        Without gains; what is unexplained is a part of the variance of the FRFs, and records are left out.
    """
    without_gains = _remove_gains(observed, gains)
    frfs = without_gains.frfs
    if frfs is None or unexplained is None:
        return without_gains
    part = np.stack(
        [np.interp(frfs.frequency_hz, unexplained.frequency_hz, column) for column in unexplained.part.T], axis=1
    )
    known = np.where(np.isfinite(frfs.variance), frfs.variance, 0.0)
    variance = known + SHARING_POINTS * (part * np.abs(frfs.values)) ** 2
    return replace(without_gains, kind="frf", records=(), frfs=replace(frfs, variance=variance))


def _remove_gains(observed: Observations, gains: Mapping[str, float]) -> Observations:
    records = tuple(
        replace(
            record,
            force=record.force / gains.get(record.input_channel, 1.0),
            responses=record.responses / np.array([[gains.get(sensor.channel, 1.0)] for sensor in record.sensors]),
        )
        for record in observed.records
    )
    frfs = observed.frfs
    if frfs is None:
        return replace(observed, records=records)
    layout = make_layout(frfs.labels)
    factors = np.exp(-layout.gain_signs @ np.log([gains.get(channel, 1.0) for channel in layout.channels]))
    scaled = replace(frfs, values=frfs.values * factors, variance=frfs.variance * factors**2)
    return replace(observed, records=records, frfs=scaled)
