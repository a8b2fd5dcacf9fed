"""What a law explains beyond anything linear: how much better all blows agree with one linear system without its force.

The best FRF of each line and struck place takes up whatever a linear model could be wrong by. What it leaves is how
blows of different levels disagree, and there a law has to earn its place: a mere spring or damper gains nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.nonlinear.linear.modal_model import respond

if TYPE_CHECKING:
    from frf_ipz.diagnosis.nonlinear.fitting.refine import LawFit
    from frf_ipz.diagnosis.nonlinear.linear.nuisance_prior import NuisancePrior
    from frf_ipz.diagnosis.nonlinear.recorded.segments import SegmentSet

ENOUGH = 2  # blows at a place
FLOOR = 0.002  # of the response: what blows on a linear structure may differ by, besides noise


@dataclass(frozen=True, slots=True)
class Agreement:
    """How well blows of different levels agree with one linear system besides a law.

    Parameters
    ----------
    gain : float
        Evidence of the law beyond anything linear, nats; NaN where stretches start in motion, or no place has two.
    left : float
        Mean square of what still disagrees, over the expected one.
    """

    gain: float
    left: float


def agreement_with(stretches: SegmentSet, nuisance_prior: NuisancePrior, fit: LawFit) -> Agreement:
    """Compare how blows agree with one linear system, before and after the law's force is taken out.

    Parameters
    ----------
    stretches : SegmentSet
        From rest.
    nuisance_prior : NuisancePrior
        Unknowns that the law was fitted with.
    fit : LawFit
        The law at its place.

    Returns
    -------
    Agreement
        Of the blows at all struck places.
    """
    counts = np.bincount(stretches.input_of)
    if stretches.moving.any() or counts.max() < ENOUGH:
        return Agreement(np.nan, np.nan)
    used = stretches.used
    response = respond(
        nuisance_prior.modal_model, stretches.s[used], nuisance_prior.deviations(fit.unknowns, fit.place)
    )
    motion = stretches.motion[:, :, used]
    without = motion + response.to_sensors(fit.place) * fit.force[:, None, used]
    present = np.isfinite(stretches.variance[:, :, used])
    variance = np.where(present, stretches.noise[:, :, used] + (FLOOR * np.abs(motion)) ** 2, np.inf)
    before, after = (_disagreement(stretches, values, variance) for values in (motion, without))
    expected = 2 * (np.sum(present) - np.count_nonzero(counts) * present[0].size)
    left = after / max(expected, 1)
    return Agreement(float(0.5 * (before - after) / max(1.0, left)), float(left))


def _disagreement(stretches: SegmentSet, motion: ComplexArray, variance: FloatArray) -> float:
    """Weighted sum of squares that the best FRF of each line and place leaves."""
    cost, weight = 0.0, 1 / variance
    for number in np.unique(stretches.input_of):
        mine = stretches.input_of == number
        force, y, w = stretches.force[mine][:, None, stretches.used], motion[mine], weight[mine]
        frf = np.sum(w * y * force.conj(), 0) / np.maximum(np.sum(w * np.abs(force) ** 2, 0), 1e-300)
        cost += float(np.sum(w * np.abs(y - frf * force) ** 2))
    return cost
