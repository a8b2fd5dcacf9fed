"""The one iteration of a minimal change: Gauss-Newton on the total change, under a prior whose scales are found too.

Each step solves the linearised problem from the nominal model again, so that the prior always weighs the whole change
and not the last step. A phase (stiffness, damping) says what its roots are and how they move; the loop is here.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.updating.gaussian import GaussianStep, most_likely_scales, slack_by_discrepancy, solve_step
from frf_ipz.updating.parameters import PriorTerm, unwhiten
from frf_ipz.updating.tracking import TrackedRoots

MAX_ITERATIONS = 30
SETTLED = 0.3  # standard deviations by which the model still misses what the last linear step promised
STILL = 0.03  # prior standard deviations that no parameter moved by: the optimum, whatever misfit is left
MET = 0.1  # of the number of targets: a misfit so far below what noise makes needs no further step
MAX_HALVINGS = 6
CURVATURE = 0.5  # of the squared error at first, then of what the last linear step did not foresee: taken as noise
SLACK_UNCERTAINTY = 1.5  # standard deviation of the logarithm of the factor on the slack
STALLED = 3.0  # times that noise is taken after a step of which no part was any good
SCALE_ITERATIONS = 3  # iterations that ask the evidence again: later ones would only chase their own change


class Phase(Protocol):
    """What the loop needs to know of the stiffness or of the damping."""

    @property
    def terms(self) -> tuple[PriorTerm, ...]:
        """Prior of the parameters."""

    @property
    def noise(self) -> FloatArray:
        """Covariance of the errors, (n, n)."""

    @property
    def slack(self) -> FloatArray:
        """Standard deviations of what no parameter explains, (n,), before the data are seen."""

    def roots(self, theta: FloatArray, near: TrackedRoots) -> TrackedRoots | None:
        """Give the roots that belong to the targets.

        Parameters
        ----------
        theta : (p,) array
            Parameters.
        near : TrackedRoots
            Those of a model close by.

        Returns
        -------
        TrackedRoots or None
            None where the matrices are no longer those of a structure.
        """

    def errors(self, tracked: TrackedRoots) -> FloatArray:
        """Give targets minus model.

        Parameters
        ----------
        tracked : TrackedRoots
            The model's roots.

        Returns
        -------
        (n,) array
            Relative errors.
        """

    def slopes(self, theta: FloatArray, tracked: TrackedRoots) -> FloatArray:
        """Give the derivatives of the model's values.

        Parameters
        ----------
        theta : (p,) array
            Parameters.
        tracked : TrackedRoots
            Roots for these parameters.

        Returns
        -------
        (n, p) array
            Per unit of the parameters.
        """

    def shown(self, theta: FloatArray) -> dict[str, float]:
        """Give the parameters that belong into the history.

        Parameters
        ----------
        theta : (p,) array
            Parameters.

        Returns
        -------
        dict of str to float
            By name.
        """

    def largest_part(self, theta: FloatArray, wanted: FloatArray) -> float:
        """Give the largest part of a step that may be tried.

        Parameters
        ----------
        theta, wanted : (p,) array
            Where the step starts and ends.

        Returns
        -------
        float
            At most 1.
        """


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PhaseResult:
    """Where the iteration ended.

    Parameters
    ----------
    whitened : (k,) array
        Unit normal numbers of all prior terms.
    theta : (p,) array
        Parameters.
    tracked : TrackedRoots
        Roots of the model.
    error : (n,) array
        Targets minus model.
    noise : (n, n) array
        Covariance of the targets and of what no parameter explains.
    scales : (t + 1,) array
        Standard deviations of the prior terms; last the factor on the slack.
    step : GaussianStep
        The last linear step.
    sensitivity : (n, k) array
        By whitened parameters, at the last step.
    rows : tuple of dict
        One an iteration, for the history.
    converged : bool
        True when a further step would change nothing that matters.
    """

    whitened: FloatArray
    theta: FloatArray
    tracked: TrackedRoots
    error: FloatArray
    noise: FloatArray
    scales: FloatArray
    step: GaussianStep
    sensitivity: FloatArray
    rows: tuple[dict[str, float], ...]
    converged: bool


@dataclass(frozen=True, slots=True, eq=False)
class _Place:
    """A point of the iteration."""

    whitened: FloatArray
    theta: FloatArray
    tracked: TrackedRoots
    error: FloatArray


def iterate(
    phase: Phase,
    tracked: TrackedRoots,
    *,
    start: FloatArray | None = None,
    scales: FloatArray | None = None,
    max_iterations: int | None = None,
) -> PhaseResult:
    """Bring the roots to their targets.

    Parameters
    ----------
    phase : Phase
        Stiffness or damping.
    tracked : TrackedRoots
        Roots at the start.
    start : (k,) array, optional
        Unit normal numbers of the prior terms to start from, for the scales given or stated; 0 where it is left out.
    scales : (t + 1,) array, optional
        Standard deviations of the prior terms and the factor on the slack, where they are known from before.
    max_iterations : int, optional
        Stop after that many.

    Returns
    -------
    PhaseResult
        Where it ended.
    """
    known = scales is not None
    terms = (
        *phase.terms,
        PriorTerm(
            name="what no parameter explains", root=np.zeros((0, 0)), std=1.0, scale_uncertainty=SLACK_UNCERTAINTY
        ),
    )
    scales = np.array([term.std for term in terms]) if scales is None else scales.copy()
    whitened = np.zeros(sum(term.root.shape[1] for term in phase.terms)) if start is None else start
    place = _Place(whitened, unwhiten(phase.terms, scales[:-1], whitened), tracked, phase.errors(tracked))
    bend, rows, converged = CURVATURE * place.error**2, [], False
    for iteration in range(1, (max_iterations or MAX_ITERATIONS) + 1):
        slopes = phase.slopes(place.theta, place.tracked)
        parts = [slopes @ term.root for term in phase.terms]
        data = place.error + slopes @ place.theta
        bent = np.diag(bend**2)
        if not known and iteration <= SCALE_ITERATIONS:
            found = most_likely_scales([*parts, np.diag(phase.slack)], terms, data, phase.noise + bent, scales)
            place = replace(place, whitened=_rescaled(phase.terms, scales / found, place.whitened))
            scales = found
        sensitivity = np.hstack([scale * part for scale, part in zip(scales[:-1], parts, strict=True)])
        scales[-1] = slack_by_discrepancy(sensitivity, data, phase.noise + bent, phase.slack, scales[-1])
        noise = phase.noise + np.diag((scales[-1] * phase.slack) ** 2)
        step = solve_step(sensitivity, data, noise + bent)
        before, (place, part) = place, _walk(phase, scales[:-1], place, step.mean, noise + bent)
        promised = before.error + part * (data - sensitivity @ step.mean - before.error)
        surprise = np.abs(place.error - promised)
        bend = CURVATURE * surprise if part else STALLED * np.maximum(bend, np.sqrt(np.diagonal(noise)))
        rows.append(_row(terms, iteration, place.error, noise, step, scales, part) | phase.shown(place.theta))
        converged = part == 1 and _is_settled(noise, surprise, place.whitened - before.whitened)
        if converged or rows[-1]["misfit"] < MET * len(data):
            converged = True
            break
    return PhaseResult(
        whitened=place.whitened,
        theta=place.theta,
        tracked=place.tracked,
        error=place.error,
        noise=noise,
        scales=scales,
        step=step,
        sensitivity=sensitivity,
        rows=tuple(rows),
        converged=converged,
    )


def _rescaled(terms: tuple[PriorTerm, ...], factors: FloatArray, whitened: FloatArray) -> FloatArray:
    """Whitened numbers of the same parameters under other scales."""
    sizes = [term.root.shape[1] for term in terms]
    return np.asarray(whitened * np.repeat(factors[: len(terms)], sizes))


def _is_settled(noise: FloatArray, surprise: FloatArray, moved: FloatArray) -> bool:
    as_promised = bool(np.all(surprise < SETTLED * np.sqrt(np.diagonal(noise))))
    return as_promised or float(np.abs(moved).max()) < STILL


def _walk(
    phase: Phase, scales: FloatArray, place: _Place, wanted: FloatArray, noise: FloatArray
) -> tuple[_Place, float]:
    """Go the largest part of the step that keeps the model sound and lets misfit and change together fall."""
    weights = np.linalg.inv(noise)

    def cost(whitened: FloatArray, error: FloatArray) -> float:
        return float(whitened @ whitened + error @ weights @ error)

    allowed = cost(place.whitened, place.error)
    part = phase.largest_part(place.theta, unwhiten(phase.terms, scales, wanted))
    for _ in range(MAX_HALVINGS):
        whitened = place.whitened + part * (wanted - place.whitened)
        theta = unwhiten(phase.terms, scales, whitened)
        found = phase.roots(theta, place.tracked)
        if found is not None:
            error = phase.errors(found)
            if cost(whitened, error) <= allowed:
                return _Place(whitened, theta, found, error), part
        part /= 2
    return place, 0.0


def _row(
    terms: tuple[PriorTerm, ...],
    iteration: int,
    error: FloatArray,
    noise: FloatArray,
    step: GaussianStep,
    scales: FloatArray,
    part: float,
) -> dict[str, float]:
    return {
        "iteration": iteration,
        "misfit": float(error @ np.linalg.solve(noise, error)),
        "step": part,
        "largest_error": float(np.abs(error).max(initial=0.0)),
        "size_of_change": float(np.linalg.norm(step.mean)),
        "data_left_free": step.freedom,
        **{f"std: {term.name}": float(scale) for term, scale in zip(terms, scales, strict=True)},
    }
