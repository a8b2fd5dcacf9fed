"""Every law at every place, in one step each.

The motion of each place is estimated from the data, so a law's force is known but for its strength, and what remains is
a linear least-squares problem with the unknowns of the linear model beside the strength. These are the same for all
hypotheses and are projected out once.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.nonlinear.fitting.motion import Clock, place_motion
from frf_ipz.diagnosis.nonlinear.fitting.normal_equations import solve_even
from frf_ipz.diagnosis.nonlinear.linear.modal_model import ModalResponse, nominal_values, respond
from frf_ipz.numerics.least_squares import cholesky_with_prior

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.diagnosis.nonlinear.laws.law import Law
    from frf_ipz.diagnosis.nonlinear.linear.nuisance_prior import NuisancePrior
    from frf_ipz.diagnosis.nonlinear.recorded.segments import SegmentSet

STEPS, SETTLED = 6, 0.01  # of the linear model: at most, and the relative drop of the cost that is worth a step
LEAST_MOTION = 1e-9  # of the largest motion of all places: nothing can be said of a place that rests


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Guess:
    """A law at a place, roughly fitted.

    Parameters
    ----------
    law : Law
        Which.
    place : int
        Index in `Plant.places`.
    shape, strength : float
        Of the law.
    cost : float
        Weighted sum of squared misfits.
    """

    law: Law
    place: int
    shape: float
    strength: float
    cost: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LinearFit:
    """The linear model with its unknowns, fitted to the data.

    Parameters
    ----------
    response : ModalResponse
        Of the nominal model, on all lines.
    beyond : (n_blows, n_sensors, n_lines) complex array
        Data minus nominal model with the starts of the best linear model, m s.
    misfit : (n_rows,) array
        Data minus nominal model on the used lines, weighted, real and imaginary parts in turn.
    columns : (n_unknowns, n_rows) array
        Change by each unknown.
    factor : (n_unknowns, n_unknowns) array
        Lower Cholesky factor of columns columns^T + 1.
    cost : float
        Of the best linear model, its prior included.
    nuisance_prior : NuisancePrior
        The unknowns.
    unknowns : (n_unknowns,) array
        Of the best linear model.
    """

    response: ModalResponse
    beyond: ComplexArray
    misfit: FloatArray
    columns: FloatArray
    factor: FloatArray
    cost: float
    nuisance_prior: NuisancePrior
    unknowns: FloatArray

    @property
    def n_rows(self) -> int:
        """Number of real data."""
        return len(self.misfit)

    @property
    def as_stated(self) -> FloatArray:
        """(n_unknowns,) unknowns of the model as it is stated, and how stretches start in the best linear one."""
        return self.nuisance_prior.as_stated(self.unknowns)


def fit_linear(stretches: SegmentSet, nuisance_prior: NuisancePrior) -> LinearFit:
    """Fit the linear model alone.

    Parameters
    ----------
    stretches : SegmentSet
        The data.
    nuisance_prior : NuisancePrior
        Its unknowns.

    Returns
    -------
    LinearFit
        One step from the nominal model; its cost is what further steps come down to.
    """
    modal_model, used = nuisance_prior.modal_model, stretches.used
    response = respond(modal_model, stretches.s, nominal_values(modal_model))
    beyond = stretches.motion - linear_motion(stretches, nuisance_prior, response)
    on_used = respond(modal_model, stretches.s[used], nominal_values(modal_model))
    nothing = np.zeros((stretches.n_records, len(used)), complex)
    columns = as_real(nuisance_prior.columns(stretches, on_used, nothing, None))
    misfit = as_real(beyond[:, :, used] / np.sqrt(stretches.variance[:, :, used]))
    factor = cholesky_with_prior(columns)
    seen = linalg.solve_triangular(factor, columns @ misfit, lower=True)
    unknowns = linalg.solve_triangular(factor.T, seen, lower=False)
    beyond[nuisance_prior.moving] -= nuisance_prior.sensor_starts(unknowns, response)
    cost = float(misfit @ misfit - seen @ seen)
    return LinearFit(
        response=response,
        nuisance_prior=nuisance_prior,
        unknowns=unknowns,
        beyond=beyond,
        misfit=misfit,
        columns=columns,
        factor=factor,
        cost=min(cost, _settled_cost(stretches, nuisance_prior, unknowns)),
    )


def _settled_cost(stretches: SegmentSet, nuisance_prior: NuisancePrior, unknowns: FloatArray) -> float:
    """Cost of the linear model after a few steps: a law must gain more than the first one has left."""
    used, best = stretches.used, np.inf
    nothing = np.zeros((stretches.n_records, len(used)), complex)
    for _ in range(STEPS):
        response = respond(nuisance_prior.modal_model, stretches.s, nuisance_prior.deviations(unknowns))
        shown = linear_motion(stretches, nuisance_prior, response)
        shown[nuisance_prior.moving] += nuisance_prior.sensor_starts(unknowns, response)
        misfit = as_real((stretches.motion - shown)[:, :, used] / np.sqrt(stretches.variance[:, :, used]))
        cost = float(misfit @ misfit + unknowns @ unknowns)
        if cost > (1 - SETTLED) * best:
            return min(best, cost)
        best = cost
        columns = as_real(nuisance_prior.columns(stretches, response.on(used), nothing, None, unknowns))
        normal = columns @ columns.T + np.eye(len(columns))
        unknowns = unknowns + solve_even(normal, columns @ misfit - unknowns)
    return best


def score_laws(
    stretches: SegmentSet, fit: LinearFit, laws: Sequence[Law], *, places: Sequence[int] | None = None
) -> list[Guess]:
    """Try every law at every place.

    Parameters
    ----------
    stretches : SegmentSet
        The data.
    fit : LinearFit
        The linear model.
    laws : sequence of Law
        To be tried.
    places : sequence of int, optional
        Only these.

    Returns
    -------
    list of Guess
        For each law and place the best shape, the smallest cost first; those that lower the cost only.
    """
    modal_model = fit.response.modal_model
    clock = Clock(stretches)
    contracted = _Contracted(stretches, fit)
    linear_size = np.array([_of_place(fit, stretches, place)[1].std() for place in range(len(modal_model.places))])
    chosen = range(len(modal_model.places)) if places is None else places
    guesses: list[Guess] = []
    for place in chosen:
        if linear_size[place] > LEAST_MOTION * linear_size.max():
            guesses += _at_place(stretches, fit, contracted, clock, laws, place)
    return sorted(guesses, key=lambda guess: guess.cost)


def linear_motion(stretches: SegmentSet, nuisance_prior: NuisancePrior, response: ModalResponse) -> ComplexArray:
    """Give what sensors show of the force, without unknown starts.

    Where a stretch starts in motion, modes above the free ones follow the force as if at rest; the force's own start
    is then missing in a velocity or an acceleration that is integrated from rest.

    Parameters
    ----------
    stretches : SegmentSet
        The forces.
    nuisance_prior : NuisancePrior
        Which modes are free.
    response : ModalResponse
        On all lines.

    Returns
    -------
    (n_blows, n_sensors, n_lines) complex array
        As `SegmentSet.motion`.
    """
    s, moving = stretches.s, nuisance_prior.moving
    motion = response.from_inputs()[stretches.input_of] * stretches.force[:, None]
    if len(moving):
        above = response.from_inputs(len(nuisance_prior.modes))[stretches.input_of[moving]]
        force, slope = stretches.start_force[moving].T[:, :, None]
        lost = np.array([np.zeros((len(moving), len(s))), force / s, force / s + slope / s**2])
        powers = [sensor.quantity.power for sensor in response.modal_model.sensors]
        motion[moving] -= above * lost[powers].swapaxes(0, 1)
    return motion


def linear_motion_of_place(
    stretches: SegmentSet, nuisance_prior: NuisancePrior, unknowns: FloatArray, response: ModalResponse, place: int
) -> tuple[ComplexArray, ComplexArray]:
    """Give the motion of a place by the linear model alone, and how it answers a force on itself.

    Parameters
    ----------
    stretches : SegmentSet
        The forces.
    nuisance_prior : NuisancePrior
        Unknowns of the linear model.
    unknowns : (n_unknowns,) array
        In prior standard deviations: how stretches start that start in motion.
    response : ModalResponse
        With these unknowns, on all lines.
    place : int
        Index in `Plant.places`.

    Returns
    -------
    own : (n_lines,) complex array
        Receptance of the place to itself, m/N.
    motion : (n_blows, n_lines) complex array
        m s.
    """
    own, driven = response.at_place(place)
    motion = driven[stretches.input_of] * stretches.force
    motion[nuisance_prior.moving] += nuisance_prior.place_starts(unknowns, response, place)
    return own, motion


def as_real(values: ComplexArray) -> FloatArray:
    """Lay complex arrays out as rows of real numbers: (..., n_blows, n_sensors, n_lines) to (..., n_rows)."""
    lead = values.shape[:-3]
    return np.ascontiguousarray(values.reshape(*lead, -1)).view(np.float64)


def _of_place(fit: LinearFit, stretches: SegmentSet, place: int) -> tuple[ComplexArray, ComplexArray]:
    return linear_motion_of_place(stretches, fit.nuisance_prior, fit.unknowns, fit.response, place)


class _Contracted:
    """What is summed over sensors once for all features of a place."""

    def __init__(self, stretches: SegmentSet, fit: LinearFit) -> None:
        used = stretches.used
        self.weight = 1 / np.sqrt(stretches.variance[:, :, used])
        shape = self.weight.shape
        self.misfit = np.ascontiguousarray(fit.misfit).view(complex).reshape(shape)
        self.columns = np.ascontiguousarray(fit.columns).view(complex).reshape(-1, *shape)
        # sums over sensors are matrix products when lines come first
        self.both = np.concatenate([self.columns, self.misfit[None]]) * self.weight
        self.both = np.ascontiguousarray(self.both.transpose(3, 1, 0, 2))  # line, blow, unknown, sensor

    def at(self, to_sensors: ComplexArray) -> tuple[ComplexArray, FloatArray]:
        """Products of a unit force's response with unknowns and misfit, and with itself."""
        products = (self.both @ to_sensors.conj().T[:, None, :, None])[..., 0]  # line, blow, unknown
        own = np.einsum("bsl,sl->bl", self.weight**2, np.abs(to_sensors) ** 2)
        return products.transpose(2, 1, 0), own


def _at_place(
    stretches: SegmentSet,
    fit: LinearFit,
    contracted: _Contracted,
    clock: Clock,
    laws: Sequence[Law],
    place: int,
) -> list[Guess]:
    to_sensors = fit.response.to_sensors(place)
    own, linear = _of_place(fit, stretches, place)
    w = clock.at_times(place_motion(stretches, fit.beyond, linear, to_sensors / own))
    v = clock.velocity(w)
    tried = [(law, float(shape)) for law in laws for shape in law.shapes(np.abs(w).max(), np.abs(v).max())]
    forces = np.array([law.unit_force(w, v, shape) for law, shape in tried])
    sizes = np.maximum(np.abs(forces).max((1, 2)), 1e-300)
    lines = clock.at_lines(forces / sizes[:, None, None])[..., stretches.used]
    products, squares = contracted.at(-to_sensors[:, stretches.used])
    flat = lines.reshape(len(tried), -1)
    seen = (flat.conj() @ products.reshape(len(products), -1).T).real  # law, unknown and misfit
    seen[:, :-1] = linalg.solve_triangular(fit.factor, seen[:, :-1].T, lower=True).T
    linear_part = linalg.solve_triangular(fit.factor, fit.columns @ fit.misfit, lower=True)
    norm = np.sum(np.abs(lines) ** 2 * squares, (1, 2)) - np.sum(seen[:, :-1] ** 2, 1)
    slope = seen[:, -1] - seen[:, :-1] @ linear_part
    strength = slope / np.maximum(norm, 1e-300)
    guesses = []
    for law in laws:
        mine = [
            i for i, (other, _) in enumerate(tried) if other is law and (law.strength_can_be_negative or slope[i] > 0)
        ]
        if mine:
            best = max(mine, key=lambda i: slope[i] * strength[i])
            cost = fit.cost - float(slope[best] * strength[best])
            number = float(strength[best] / sizes[best])
            guesses.append(Guess(law=law, place=place, shape=tried[best][1], strength=number, cost=cost))
    return guesses
