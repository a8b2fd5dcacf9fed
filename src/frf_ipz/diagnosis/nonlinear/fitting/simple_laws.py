"""Location of a force of unknown law: the best sum of many simple laws at one location, free in all their strengths.

Powers of the motion and of the velocity, dead zones on either side and friction approximate nearly any law without
memory; springs that slip, abruptly or gradually (Bouc 1967, Wen 1976), many a hysteresis. Such a sum says nothing about
the law, but only at the right location does it reach all sensors as it should.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.nonlinear.fitting.alternating_fit import CONVERGED, LawStart, estimate_location_motion
from frf_ipz.diagnosis.nonlinear.fitting.force_localisation import INDISTINGUISHABLE
from frf_ipz.diagnosis.nonlinear.fitting.linear_fit import LinearFit, as_real_rows, linear_sensor_motion
from frf_ipz.diagnosis.nonlinear.fitting.location_motion import NumericalLaplace
from frf_ipz.diagnosis.nonlinear.fitting.normal_equations import solve_with_prior
from frf_ipz.diagnosis.nonlinear.fitting.problem import LawFitProblem
from frf_ipz.diagnosis.nonlinear.laws.cubic_stiffness import CubicStiffness

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from frf_ipz.diagnosis.nonlinear.model.modal_model import ModalResponse
    from frf_ipz.diagnosis.nonlinear.segments import SegmentSet

DEAD_ZONES = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)  # parts of the largest motion
SLIP_LIMITS = (0.02, 0.05, 0.1, 0.2, 0.4)  # parts of the largest motion at which a spring slips
STEEP = 3e-3  # of the largest velocity: below, friction grows with it
FEW_ROUNDS, MANY_ROUNDS = 3, 8
FINALISTS = 4  # locations that are fitted on long segments
BEAM_WIDTH, SEARCH_STEPS = 3, 24  # locations whose neighbours are fitted, and steps: few, unless the law is far off
RIDGE = 1e-6  # of a column's own square: many of the laws are nearly equal


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SimpleLawsFit:
    """The best sum of simple laws at a location.

    Parameters
    ----------
    location : int
        Index in `ModalModel.locations`.
    cost : float
        Weighted sum of squared misfits, and of squared nuisance parameters.
    mean_misfit, linear_mean_misfit : float
        The cost, and that of the linear model, over the number of data.
    nuisance_chi2 : float
        Mean square of the structure's nuisance parameters beside the force, in prior standard deviations.
    ambiguity_set : tuple of int
        Locations at which such sums explain as well, with itself, the best first; empty where others were not compared.
    """

    location: int
    cost: float
    mean_misfit: float
    linear_mean_misfit: float
    nuisance_chi2: float
    ambiguity_set: tuple[int, ...] = ()

    @property
    def explains_all(self) -> bool:
        """No more is left than expected."""
        return self.mean_misfit < 1

    @classmethod
    def of_problem(cls, problem: LawFitProblem, location: int, cost: float, nuisance: FloatArray) -> SimpleLawsFit:
        """Compare the cost of a force at a location with the data and the linear model of a problem."""
        return cls(
            location=location,
            cost=cost,
            mean_misfit=cost / problem.linear.n_rows,
            linear_mean_misfit=problem.mean_misfit,
            nuisance_chi2=float(np.mean(nuisance[: problem.linear.nuisance_prior.n_structural] ** 2)),
        )


def locate_unknown_law(
    short: LawFitProblem, long: LawFitProblem, likely: Iterable[int]
) -> tuple[SimpleLawsFit, SimpleLawsFit]:
    """Locate a force of unknown law, among the locations at which a free force explains as well.

    Parameters
    ----------
    short, long : LawFitProblem
        The data.
    likely : iterable of int
        Locations that are fitted to the long segments, whatever the short ones say.

    Returns
    -------
    on_long, on_short : SimpleLawsFit
        The best location by the long segments, and by the short ones, on which sums of simple laws fit better.
    """
    equivalent = long.localisation.equivalent
    rough = sorted((fit_simple_laws(short, location, FEW_ROUNDS) for location in equivalent), key=_cost)
    fitted = {
        *(location for location in likely if location in equivalent),
        *(fit.location for fit in rough[:FINALISTS]),
    }
    fits = [fit_simple_laws(long, location, MANY_ROUNDS) for location in sorted(fitted)]
    for _ in range(SEARCH_STEPS):
        best = sorted(fits, key=_cost)[:BEAM_WIDTH]
        new = {
            location for fit in best for location in long.neighbours_of(fit.location) if location in equivalent
        } - fitted
        if not new:
            break
        fitted |= new
        fits += [fit_simple_laws(long, location, MANY_ROUNDS) for location in new]
    return _with_ambiguity_set(fits), fit_simple_laws(short, rough[0].location, MANY_ROUNDS)


def _cost(fit: SimpleLawsFit) -> float:
    return fit.cost


def _with_ambiguity_set(fits: Sequence[SimpleLawsFit]) -> SimpleLawsFit:
    """Take the best, with the locations that explain as well: a smaller misfit makes a difference more significant."""
    best_first = sorted(fits, key=_cost)
    best = best_first[0]
    limit = best.cost + INDISTINGUISHABLE * min(best.mean_misfit, 1.0)
    return replace(best, ambiguity_set=tuple(fit.location for fit in best_first if fit.cost <= limit))


def fit_simple_laws(problem: LawFitProblem, location: int, n_rounds: int) -> SimpleLawsFit:
    """Fit a sum of simple laws at a location.

    Parameters
    ----------
    problem : LawFitProblem
        The data, and the linear model.
    location : int
        Index in `ModalModel.locations`.
    n_rounds : int
        At most: motion, force and linear model are fitted in alternation.

    Returns
    -------
    SimpleLawsFit
        The best round.
    """
    problem.deadline.check()
    segments, linear = problem.segments, problem.linear
    laplace, nuisance_prior = NumericalLaplace(segments), linear.nuisance_prior
    nuisance = linear.start_nuisance
    force: ComplexArray | None = None
    best = np.inf
    for _ in range(n_rounds):
        start = LawStart(law=CubicStiffness(), location=location, strength=0.0, shape=0.0, nuisance=nuisance)
        response, w, v = estimate_location_motion(segments, nuisance_prior, start, laplace, force)
        forces = laplace.at_lines(simple_forces(w, v))
        rows, misfit = _derivative_rows(segments, linear, response, start, forces, force)
        step, _ = solve_with_prior(rows, misfit, nuisance, RIDGE)
        remaining = misfit - step @ rows
        n = len(nuisance)
        nuisance = nuisance + step[:n]
        force = np.tensordot(step[n:], forces, 1)
        before, best = best, min(best, float(remaining @ remaining + nuisance @ nuisance))
        if best > (1 - CONVERGED) * before:
            break
    return SimpleLawsFit.of_problem(problem, location, best, nuisance)


def simple_forces(w: FloatArray, v: FloatArray) -> FloatArray:
    """Give simple forces of many kinds, none of them above one.

    Parameters
    ----------
    w, v : (n_segments, n_times) array
        Motion and velocity of a location, m and m/s.

    Returns
    -------
    (n_forces, n_segments, n_times) array
        N.
    """
    x, y = w / max(float(np.abs(w).max()), 1e-300), v / max(float(np.abs(v).max()), 1e-300)
    forces = [x * x, x**3, x**5, x * np.abs(x), y * np.abs(y), y**3, x * x * y, np.tanh(y / STEEP)]
    for part in DEAD_ZONES:
        forces += [np.maximum(sign * x - part, 0.0) for sign in (1, -1)]
    return np.concatenate([np.array(forces), _slipping_springs(x)])


def _slipping_springs(x: FloatArray) -> FloatArray:
    """(2 n_limits, n_segments, n_times) extension of springs that slip abruptly at a limit, or gradually towards it.

    The latter is a model of Bouc and Wen, dz = dx (1 - |z| / limit) while it is loaded and dx while it is unloaded.
    Both are known in closed form between turning points of the motion.
    """
    limits = np.array(SLIP_LIMITS)[:, None]
    extensions = np.zeros((len(x), 2, len(limits), x.shape[1]))
    for path, (abrupt, gradual) in zip(np.pad(x, ((0, 0), (1, 0))), extensions, strict=True):
        signs = np.where(np.diff(path) < 0, -1.0, 1.0)
        abrupt_end = gradual_end = np.zeros_like(limits)
        for first, last in pairwise([0, *(np.flatnonzero(np.diff(signs)) + 1), len(signs)]):
            sign, part = signs[first], slice(first, last)
            travel = sign * (path[first + 1 : last + 1] - path[first])
            abrupt[:, part] = sign * np.minimum(sign * abrupt_end + travel, limits)
            loaded, unloaded = np.maximum(sign * gradual_end, 0.0), np.minimum(sign * gradual_end, 0.0) + travel
            loading = limits - (limits - loaded) * np.exp(-np.maximum(unloaded, 0.0) / limits)
            gradual[:, part] = sign * np.where(unloaded < 0, unloaded, loading)
            abrupt_end, gradual_end = abrupt[:, last - 1 : last], gradual[:, last - 1 : last]
    return np.concatenate((extensions / limits).transpose(1, 2, 0, 3))


def _derivative_rows(
    segments: SegmentSet,
    linear: LinearFit,
    response: ModalResponse,
    start: LawStart,
    forces: ComplexArray,
    force: ComplexArray | None,
) -> tuple[FloatArray, FloatArray]:
    """Derive by nuisance and strengths, and give the misfit without any force; weighted, (.., n_rows)."""
    nuisance_prior, used = linear.nuisance_prior, segments.used
    weight = 1 / np.sqrt(segments.variance[:, :, used])
    motion = linear_sensor_motion(segments, nuisance_prior, response)
    motion[nuisance_prior.moving] += nuisance_prior.sensor_free_vibration(start.nuisance, response)
    misfit = as_real_rows((segments.motion - motion)[:, :, used] * weight)
    location_force = np.zeros((segments.n_segments, len(used)), complex) if force is None else -force[:, used]
    by_nuisance = as_real_rows(nuisance_prior.jacobian(segments, response.on(used), location_force, start.location))
    to_sensors = response.to_sensors(start.location)[:, used]
    by_strengths = as_real_rows(-to_sensors * forces[:, :, None, used] * weight)
    return np.concatenate([by_nuisance, by_strengths]), misfit
