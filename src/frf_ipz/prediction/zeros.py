"""Zeros of predicted FRFs with their standard deviations."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.numerics.pole_forms import every_damped_zero
from frf_ipz.pairing.model_roots import model_zeros
from frf_ipz.rational import ZeroSet

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.frf import FrfLabel
    from frf_ipz.structure import ReducedModel

MAX_MEMBERS = 100  # of the ensemble: enough for a standard deviation
SAME_ZERO = 0.2  # relative distance within which a member's zero can be the same one
MIN_SHARE = 0.8  # part of the members that must have the zero
MAX_STD = 0.05  # relative standard deviation up to which a zero is known
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
        Models drawn from what targets and prior leave open.
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
    of_members = _zeros_of_members(model, ensemble[:MAX_MEMBERS], labels)
    for number, zeros in enumerate(model_zeros(model, labels)):
        inside = (np.abs(zeros.values) > band_rad_s[0]) & (np.abs(zeros.values) < band_rad_s[1])
        indices = np.flatnonzero(inside & (np.array(zeros.kind) != "real"))
        values += zeros.values[indices].tolist()
        kinds += [zeros.kind[index] for index in indices]
        frf += [number] * len(indices)
        spread += _spread([member[number] for member in of_members], zeros.values[indices])
    std = np.array(spread, float).reshape(-1, 3)
    reasons = tuple(_reason(value, row) for value, row in zip(values, std, strict=True))
    zero_set = ZeroSet(
        values=np.array(values, complex),
        frf=np.array(frf, int),
        kind=tuple(kinds),
        identifiable=np.array([not reason for reason in reasons], bool),
        reason=reasons,
    )
    return zero_set, std[:, :2]


def _zeros_of_members(
    model: ReducedModel, ensemble: FloatArray, labels: Sequence[FrfLabel]
) -> list[list[ComplexArray]]:
    """Zeros of every FRF, of each member."""
    outputs = np.array([model.row(label.output_dof) for label in labels])
    inputs = np.array([model.row(label.input_dof) for label in labels])
    return [
        [roots.values for roots in every_damped_zero(mass, damping, stiffness, outputs, inputs)]
        for mass, damping, stiffness in ensemble
    ]


def _spread(of_members: list[ComplexArray], values: ComplexArray) -> list[tuple[float, float, float]]:
    """Give standard deviations of real and imaginary parts, and the part of the members that have the zero."""
    if not len(of_members) or not len(values):
        return [(np.nan, np.nan, np.nan)] * len(values)
    nearest = np.full((len(of_members), len(values)), complex(np.nan, np.nan))
    for member, zeros in enumerate(of_members):
        roots = zeros[zeros.imag > 0]
        distance = np.abs(roots[:, None] - values) / np.abs(values)
        best = distance.argmin(axis=0)
        is_same = distance[best, np.arange(len(values))] < SAME_ZERO
        nearest[member, is_same] = roots[best[is_same]]
    result = []
    for column, value in zip(nearest.T, values, strict=True):
        deviation = column[~np.isnan(column)] - value
        # the median ignores members in which two zeros have met and left the axis
        real, imag = (
            float(np.median(np.abs(part))) / GAUSSIAN if len(deviation) else np.nan
            for part in (deviation.real, deviation.imag)
        )
        result.append((real, imag, len(deviation) / len(of_members)))
    return result


def _reason(value: complex, spread: FloatArray) -> str:
    if np.isnan(spread[2]):
        return ""
    if spread[2] < MIN_SHARE:
        return f"{1 - spread[2]:.0%} of the models that fit the measurements have no such zero"
    if spread[1] > MAX_STD * abs(value):
        return f"the measurements determine it to {spread[1] / abs(value):.0%} of its frequency only"
    return ""
