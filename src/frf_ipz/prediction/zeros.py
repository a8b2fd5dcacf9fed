"""Zeros of predicted FRFs and how sure they are."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.numerics.pencils import damped_zeros
from frf_ipz.pairing.model_roots import model_zeros
from frf_ipz.rational import ZeroSet

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.frf import FrfLabel
    from frf_ipz.structure import ReducedModel

MOST_MEMBERS = 100  # of the ensemble: enough for a standard deviation
SAME = 0.2  # relative distance within which a member's zero can be the same one
SEEN = 0.8  # part of the members that must have the zero
SHARP = 0.05  # relative standard deviation up to which a zero is known
GAUSSIAN = 0.6745  # median absolute deviation over standard deviation


def predicted_zeros(
    model: ReducedModel, ensemble: FloatArray, labels: Sequence[FrfLabel], band_rad_s: tuple[float, float]
) -> tuple[ZeroSet, FloatArray]:
    """Zeros of FRFs of an updated model in a band.

    Parameters
    ----------
    model : ReducedModel
        The updated model.
    ensemble : (m, 3, r, r) array
        What remains open.
    labels : sequence of FrfLabel
        The FRFs.
    band_rad_s : pair of float
        The band, rad/s.

    Returns
    -------
    zeros : ZeroSet
        Identifiable where most members of the ensemble agree on them.
    std : (n, 2) array
        Standard deviations of real and imaginary part, rad/s; NaN without an ensemble.
    """
    values: list[complex] = []
    frf: list[int] = []
    kinds: list[str] = []
    spread: list[tuple[float, float, float]] = []
    for number, label in enumerate(labels):
        found = model_zeros(model, label)
        inside = (np.abs(found.values) > band_rad_s[0]) & (np.abs(found.values) < band_rad_s[1])
        places = np.flatnonzero(inside & (np.array(found.kind) != "real"))
        values += found.values[places].tolist()
        kinds += [found.kind[place] for place in places]
        frf += [number] * len(places)
        spread += _spread(model, ensemble[:MOST_MEMBERS], label, found.values[places])
    std = np.array(spread, float).reshape(-1, 3)
    reasons = tuple(_reason(value, row) for value, row in zip(values, std, strict=True))
    zeros = ZeroSet(
        values=np.array(values, complex),
        frf=np.array(frf, int),
        kind=tuple(kinds),
        identifiable=np.array([not reason for reason in reasons], bool),
        reason=reasons,
    )
    return zeros, std[:, :2]


def _spread(
    model: ReducedModel, ensemble: FloatArray, label: FrfLabel, values: ComplexArray
) -> list[tuple[float, float, float]]:
    """Give standard deviations of real and imaginary parts, and the part of the members that have the zero."""
    if not len(ensemble) or not len(values):
        return [(np.nan, np.nan, np.nan)] * len(values)
    output, force = model.row(label.output_dof), model.row(label.input_dof)
    nearest = np.full((len(ensemble), len(values)), complex(np.nan, np.nan))
    for member, (mass, damping, stiffness) in enumerate(ensemble):
        roots = damped_zeros(mass, damping, stiffness, output, force).values
        roots = roots[roots.imag > 0]
        distance = np.abs(roots[:, None] - values) / np.abs(values)
        best = distance.argmin(axis=0)
        close = distance[best, np.arange(len(values))] < SAME
        nearest[member, close] = roots[best[close]]
    result = []
    for column, value in zip(nearest.T, values, strict=True):
        off = column[~np.isnan(column)] - value
        # the median keeps members out in which two zeros have met and left the axis
        real, imag = (
            float(np.median(np.abs(part))) / GAUSSIAN if len(off) else np.nan for part in (off.real, off.imag)
        )
        result.append((real, imag, len(off) / len(ensemble)))
    return result


def _reason(value: complex, spread: FloatArray) -> str:
    if np.isnan(spread[2]):
        return ""
    if spread[2] < SEEN:
        return f"{1 - spread[2]:.0%} of the models that fit the measurements have no such zero"
    if spread[1] > SHARP * abs(value):
        return f"the measurements leave it open by {spread[1] / abs(value):.0%} of its frequency"
    return ""
