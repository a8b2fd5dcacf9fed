"""Evidence of a law beyond anything linear: how much better one linear system explains all records without its force.

The best FRF of each line and excited point takes up all errors of a linear model. Its misfit is the disagreement of
records of different levels, and a law has to explain that: a mere spring or damper explains none of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.nonlinear.model.modal_model import respond

if TYPE_CHECKING:
    from frf_ipz.diagnosis.nonlinear.fitting.alternating_fit import LawFit
    from frf_ipz.diagnosis.nonlinear.model.nuisance_prior import NuisancePrior
    from frf_ipz.diagnosis.nonlinear.segments import SegmentSet

MIN_SEGMENTS = 2  # of an excited point
FLOOR = 0.002  # of the response: expected disagreement of records of a linear structure, besides noise


@dataclass(frozen=True, slots=True)
class Agreement:
    """How well records of different levels agree with one linear system beside a law.

    Parameters
    ----------
    gain : float
        Log evidence of the law beyond anything linear; NaN where segments start in motion, or no point has two.
    mean_misfit : float
        Mean square of the remaining disagreement over the expected one.
    """

    gain: float
    mean_misfit: float


def assess_agreement(segments: SegmentSet, nuisance_prior: NuisancePrior, fit: LawFit) -> Agreement:
    """Compare how records agree with one linear system, before and after the law's force is subtracted.

    Parameters
    ----------
    segments : SegmentSet
        From rest.
    nuisance_prior : NuisancePrior
        That the law was fitted with.
    fit : LawFit
        The law at its location.

    Returns
    -------
    Agreement
        Of the records of all excited points.
    """
    counts = np.bincount(segments.input_of)
    if segments.moving.any() or counts.max() < MIN_SEGMENTS:
        return Agreement(np.nan, np.nan)
    used = segments.used
    nuisance_values = nuisance_prior.to_values(fit.nuisance, fit.location)
    response = respond(nuisance_prior.modal_model, segments.s[used], nuisance_values)
    motion = segments.motion[:, :, used]
    without = motion + response.to_sensors(fit.location) * fit.force[:, None, used]
    present = np.isfinite(segments.variance[:, :, used])
    variance = np.where(present, segments.noise[:, :, used] + (FLOOR * np.abs(motion)) ** 2, np.inf)
    before, after = (_disagreement(segments, values, variance) for values in (motion, without))
    expected = 2 * (np.sum(present) - np.count_nonzero(counts) * present[0].size)
    mean_misfit = after / max(expected, 1)
    return Agreement(float(0.5 * (before - after) / max(1.0, mean_misfit)), float(mean_misfit))


def _disagreement(segments: SegmentSet, motion: ComplexArray, variance: FloatArray) -> float:
    """Weighted sum of squared misfits of the best FRF of each line and excited point."""
    cost, weight = 0.0, 1 / variance
    for number in np.unique(segments.input_of):
        of_input = segments.input_of == number
        force, y, w = segments.force[of_input][:, None, segments.used], motion[of_input], weight[of_input]
        frf = np.sum(w * y * force.conj(), 0) / np.maximum(np.sum(w * np.abs(force) ** 2, 0), 1e-300)
        cost += float(np.sum(w * np.abs(y - frf * force) ** 2))
    return cost
