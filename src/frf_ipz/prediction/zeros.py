"""Zeros of predicted FRFs with their standard deviations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.numerics.pole_forms import every_damped_zero
from frf_ipz.pairing.model_roots import ModelZeros, model_zeros
from frf_ipz.rational import ZeroSet

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.frf import FrfLabel
    from frf_ipz.prediction.ensemble import ModelEnsemble
    from frf_ipz.structure import ReducedModel

MAX_MEMBERS = 100  # of the ensemble: enough for a standard deviation
SAME_ZERO = 0.2  # relative distance within which a member's zero can be the same one
HALFWAY = 0.5  # of the distance to the next zero
MIN_SHARE = 0.8  # part of the members that must have the zero
MAX_STD = 0.05  # relative standard deviation up to which a zero is known
GAUSSIAN = 0.6745  # median absolute deviation over standard deviation


def predicted_zeros(
    model: ReducedModel, ensemble: ModelEnsemble, labels: Sequence[FrfLabel], band_rad_s: tuple[float, float]
) -> tuple[ZeroSet, FloatArray]:
    """Zeros of FRFs of an updated model in a band.

    Parameters
    ----------
    model : ReducedModel
        The updated model.
    ensemble : ModelEnsemble
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
    found = [_Inside.of(zeros, band_rad_s) for zeros in model_zeros(model, labels)]
    nearest = _nearest_of_members(model, ensemble, labels, found)
    for number, (inside, of_members) in enumerate(zip(found, nearest, strict=True)):
        values += inside.values.tolist()
        kinds += inside.kinds
        frf += [number] * len(inside.values)
        spread += _spread(of_members, inside.values)
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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Inside:
    """Zeros of an FRF in the band with their kinds, and the distance of each from the next of all zeros."""

    values: ComplexArray
    kinds: tuple[str, ...]
    gaps: FloatArray

    @classmethod
    def of(cls, zeros: ModelZeros, band_rad_s: tuple[float, float]) -> _Inside:
        """Choose from all zeros of an FRF."""
        kinds = np.array(zeros.kind, str)
        size = np.abs(zeros.values)
        chosen = np.flatnonzero((size > band_rad_s[0]) & (size < band_rad_s[1]) & (kinds != "real"))
        every = np.concatenate([zeros.values, -zeros.values[kinds == "quadruple"].conj()])
        distance = np.abs(zeros.values[chosen, None] - every)
        distance[np.arange(len(chosen)), chosen] = np.inf
        return cls(
            values=zeros.values[chosen],
            kinds=tuple(zeros.kind[index] for index in chosen),
            gaps=distance.min(axis=1, initial=np.inf),
        )


def _nearest_of_members(
    model: ReducedModel, ensemble: ModelEnsemble, labels: Sequence[FrfLabel], found: Sequence[_Inside]
) -> list[ComplexArray]:
    """Zeros of each member nearest to those of the model, (m, n) of every FRF; NaN where a member has none."""
    outputs = np.array([model.row(label.output_dof) for label in labels])
    inputs = np.array([model.row(label.input_dof) for label in labels])
    members = ensemble.matrices[:MAX_MEMBERS]
    nearest = [np.full((len(members), len(inside.values)), complex(np.nan, np.nan)) for inside in found]
    start = np.concatenate([*(inside.values for inside in found), np.zeros(0, complex)])
    gaps = np.concatenate([*(inside.gaps for inside in found), np.zeros(0)])
    frf = np.repeat(np.arange(len(found)), [len(inside.values) for inside in found])
    if not len(start):
        return nearest
    for member, (mass, damping, stiffness) in enumerate(members):
        is_near, zeros = np.zeros(len(start), bool), start
        by_poles = ensemble.by_poles(member)
        if by_poles is not None:
            zeros, is_found = by_poles.damped.zeros(outputs[frf], inputs[frf], start)
            is_near = is_found & (np.abs(zeros - start) < HALFWAY * gaps)
        # where none of an FRF has come halfway to another, each is still the nearest
        far = np.unique(frf[~is_near])
        for number in np.setdiff1d(frf, far).tolist():
            nearest[number][member] = _if_same(zeros[frf == number], found[number].values)
        every_zero = (
            every_damped_zero(mass, damping, stiffness, outputs[far], inputs[far])
            if by_poles is None
            else by_poles.every_zero(outputs[far], inputs[far])
        )
        for number, every in zip(far.tolist(), every_zero, strict=True):
            upper, values = every.values[every.values.imag > 0], found[number].values
            if len(upper):
                best = np.abs(upper[:, None] - values).argmin(axis=0)
                nearest[number][member] = _if_same(upper[best], values)
    return nearest


def _if_same(zeros: ComplexArray, values: ComplexArray) -> ComplexArray:
    is_same = (zeros.imag > 0) & (np.abs(zeros - values) < SAME_ZERO * np.abs(values))
    return np.where(is_same, zeros, complex(np.nan, np.nan))


def _spread(nearest: ComplexArray, values: ComplexArray) -> list[tuple[float, float, float]]:
    """Give standard deviations of real and imaginary parts, and the part of the members that have the zero."""
    if not len(nearest) or not len(values):
        return [(np.nan, np.nan, np.nan)] * len(values)
    result = []
    for column, value in zip(nearest.T, values, strict=True):
        deviation = column[~np.isnan(column)] - value
        # the median ignores members in which two zeros have met and left the axis
        real, imag = (
            float(np.median(np.abs(part))) / GAUSSIAN if len(deviation) else np.nan
            for part in (deviation.real, deviation.imag)
        )
        result.append((real, imag, len(deviation) / len(nearest)))
    return result


def _reason(value: complex, spread: FloatArray) -> str:
    if np.isnan(spread[2]):
        return ""
    if spread[2] < MIN_SHARE:
        return f"{100 * (1 - spread[2]):.0f} % of the models that fit the measurements have no such zero"
    if spread[1] > MAX_STD * abs(value):
        return f"the measurements leave it open by {100 * spread[1] / abs(value):.0f} % of its frequency"
    return ""
