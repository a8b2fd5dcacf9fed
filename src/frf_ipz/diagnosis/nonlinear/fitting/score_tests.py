"""Score test of every law at every location, in one step each.

The motion of each location is estimated from the data, so a law's force is known but for its strength, and the strength
follows from a linear least-squares problem beside the nuisance parameters of the linear model. These are the same for
all hypotheses and are projected out once.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.nonlinear.fitting.linear_fit import linear_location_motion
from frf_ipz.diagnosis.nonlinear.fitting.location_motion import NumericalLaplace, estimate_motion

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.diagnosis.nonlinear.fitting.linear_fit import LinearFit
    from frf_ipz.diagnosis.nonlinear.laws.law import Law
    from frf_ipz.diagnosis.nonlinear.segments import SegmentSet

LEAST_MOTION = 1e-9  # of the largest motion of all locations: a location that moves less cannot be tested


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ScoredLaw:
    """A law at a location, with its strength from one linear step.

    Parameters
    ----------
    law : Law
        Which.
    location : int
        Index in `ModalModel.locations`.
    shape, strength : float
        Of the law.
    cost : float
        Weighted sum of squared misfits.
    """

    law: Law
    location: int
    shape: float
    strength: float
    cost: float


def score_laws(
    segments: SegmentSet, fit: LinearFit, laws: Sequence[Law], *, locations: Sequence[int] | None = None
) -> list[ScoredLaw]:
    """Test every law at every location.

    Parameters
    ----------
    segments : SegmentSet
        The data.
    fit : LinearFit
        The linear model.
    laws : sequence of Law
        To be tested.
    locations : sequence of int, optional
        Only these.

    Returns
    -------
    list of ScoredLaw
        For each law and location the best shape, the smallest cost first; those that lower the cost only.
    """
    modal_model = fit.response.modal_model
    laplace = NumericalLaplace(segments)
    sums = _SensorSums(segments, fit)
    every = range(len(modal_model.locations))
    linear_size = np.array([_linear_motion(fit, segments, location)[1].std() for location in every])
    scored: list[ScoredLaw] = []
    for location in every if locations is None else locations:
        if linear_size[location] > LEAST_MOTION * linear_size.max():
            scored += _score_at(segments, fit, sums, laplace, laws, location)
    return sorted(scored, key=lambda law: law.cost)


def _linear_motion(fit: LinearFit, segments: SegmentSet, location: int) -> tuple[ComplexArray, ComplexArray]:
    return linear_location_motion(segments, fit.nuisance_prior, fit.nuisance, fit.response, location)


class _SensorSums:
    """Products of misfit and derivatives, prepared to be summed over sensors for all forces at a location."""

    def __init__(self, segments: SegmentSet, fit: LinearFit) -> None:
        used = segments.used
        self.weight = 1 / np.sqrt(segments.variance[:, :, used])
        shape = self.weight.shape
        self.misfit = np.ascontiguousarray(fit.misfit).view(complex).reshape(shape)
        self.columns = np.ascontiguousarray(fit.columns).view(complex).reshape(-1, *shape)
        # sums over sensors are matrix products when lines come first
        self.stacked = np.concatenate([self.columns, self.misfit[None]]) * self.weight
        self.stacked = np.ascontiguousarray(self.stacked.transpose(3, 1, 0, 2))  # line, segment, parameter, sensor

    def at(self, to_sensors: ComplexArray) -> tuple[ComplexArray, FloatArray]:
        """Products of a unit force's response with derivatives and misfit, and with itself."""
        products = (self.stacked @ to_sensors.conj().T[:, None, :, None])[..., 0]  # line, segment, parameter
        squares = np.einsum("bsl,sl->bl", self.weight**2, np.abs(to_sensors) ** 2)
        return products.transpose(2, 1, 0), squares


def _score_at(
    segments: SegmentSet,
    fit: LinearFit,
    sums: _SensorSums,
    laplace: NumericalLaplace,
    laws: Sequence[Law],
    location: int,
) -> list[ScoredLaw]:
    to_sensors = fit.response.to_sensors(location)
    driving_point, linear = _linear_motion(fit, segments, location)
    w = laplace.at_times(estimate_motion(segments, fit.excess, linear, to_sensors / driving_point))
    v = laplace.velocity(w)
    shaped = [(law, float(shape)) for law in laws for shape in law.shapes(np.abs(w).max(), np.abs(v).max())]
    forces = np.array([law.unit_force(w, v, shape) for law, shape in shaped])
    sizes = np.maximum(np.abs(forces).max((1, 2)), 1e-300)
    lines = laplace.at_lines(forces / sizes[:, None, None])[..., segments.used]
    products, squares = sums.at(-to_sensors[:, segments.used])
    flat = lines.reshape(len(shaped), -1)
    scores = (flat.conj() @ products.reshape(len(products), -1).T).real  # law, nuisance parameter and misfit
    scores[:, :-1] = linalg.solve_triangular(fit.factor, scores[:, :-1].T, lower=True).T
    linear_part = linalg.solve_triangular(fit.factor, fit.columns @ fit.misfit, lower=True)
    norm = np.sum(np.abs(lines) ** 2 * squares, (1, 2)) - np.sum(scores[:, :-1] ** 2, 1)
    slope = scores[:, -1] - scores[:, :-1] @ linear_part
    strength = slope / np.maximum(norm, 1e-300)
    scored = []
    for law in laws:
        allowed = [
            i
            for i, (shaped_law, _) in enumerate(shaped)
            if shaped_law is law and (law.strength_can_be_negative or slope[i] > 0)
        ]
        if allowed:
            best = max(allowed, key=lambda i: slope[i] * strength[i])
            cost = fit.cost - float(slope[best] * strength[best])
            number = float(strength[best] / sizes[best])
            scored.append(ScoredLaw(law=law, location=location, shape=shaped[best][1], strength=number, cost=cost))
    return scored
