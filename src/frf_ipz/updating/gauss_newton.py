"""The one iteration of a minimal change: Gauss-Newton on the total change, under a prior whose scales are found too.

Each step solves the linearised problem from the nominal model again, so that the prior always weighs the whole change
and not the last step. A phase (stiffness, damping) says what its roots are and how they move; the loop is here.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.updating.gaussian import GaussianStep, likely_scales, solve_step
from frf_ipz.updating.parameters import PriorTerm
from frf_ipz.updating.tracking import TrackedRoots

MAX_ITERATIONS = 30
SETTLED = 0.1  # standard deviations by which the model still misses what the last linear step promised
MAX_HALVINGS = 6
CURVATURE = 0.5  # of the squared error at first, then of what the last linear step did not foresee: taken as noise
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
    theta : (p,) array
        Parameters.
    tracked : TrackedRoots
        Roots of the model.
    error : (n,) array
        Targets minus model.
    scales : (t,) array
        Standard deviations of the prior terms.
    step : GaussianStep
        The last linear step.
    sensitivity : (n, k) array
        By whitened parameters, at the last step.
    rows : tuple of dict
        One an iteration, for the history.
    converged : bool
        True when the model does what the last step promised.
    """

    theta: FloatArray
    tracked: TrackedRoots
    error: FloatArray
    scales: FloatArray
    step: GaussianStep
    sensitivity: FloatArray
    rows: tuple[dict[str, float], ...]
    converged: bool


def iterate(phase: Phase, theta: FloatArray, tracked: TrackedRoots, *, max_iterations: int | None) -> PhaseResult:
    """Bring the roots to their targets.

    Parameters
    ----------
    phase : Phase
        Stiffness or damping.
    theta : (p,) array
        Where to start.
    tracked : TrackedRoots
        Roots there.
    max_iterations : int, optional
        Stop after that many.

    Returns
    -------
    PhaseResult
        Where it ended.
    """
    scales = np.array([term.std for term in phase.terms])
    deviations = np.sqrt(np.diagonal(phase.noise))
    error, rows, converged = phase.errors(tracked), [], False
    bend = CURVATURE * error**2
    for iteration in range(1, (max_iterations or MAX_ITERATIONS) + 1):
        slopes = phase.slopes(theta, tracked)
        parts = [slopes @ term.root for term in phase.terms]
        data = error + slopes @ theta
        noise = phase.noise + np.diag(bend**2)
        if iteration <= SCALE_ITERATIONS:
            scales = likely_scales(parts, phase.terms, data, noise, scales)
        sensitivity = np.hstack([scale * part for scale, part in zip(scales, parts, strict=True)])
        step = solve_step(sensitivity, data, noise)
        wanted = unwhiten(phase.terms, scales, step.mean)
        theta, tracked, part = _walk(phase, theta, wanted, tracked, 1 / np.diagonal(noise))
        promised = (1 - part) * error + part * (data - slopes @ wanted)
        error = phase.errors(tracked)
        bend = CURVATURE * np.abs(error - promised) if part else np.maximum(STALLED * bend, CURVATURE * np.abs(error))
        converged = part == 1 and bool(np.all(np.abs(error - promised) < SETTLED * deviations))
        rows.append(_row(phase, iteration, error, step, scales, part) | phase.shown(theta))
        if converged:
            break
    return PhaseResult(
        theta=theta,
        tracked=tracked,
        error=error,
        scales=scales,
        step=step,
        sensitivity=sensitivity,
        rows=tuple(rows),
        converged=converged,
    )


def unwhiten(terms: tuple[PriorTerm, ...], scales: FloatArray, whitened: FloatArray) -> FloatArray:
    """Turn whitened parameters into parameters.

    Parameters
    ----------
    terms : tuple of PriorTerm
        Prior of the parameters.
    scales : (t,) array
        Standard deviations of the terms.
    whitened : (..., k) array
        All terms' unit normal numbers.

    Returns
    -------
    (..., p) array
        Parameters.
    """
    root = np.hstack([scale * term.root for scale, term in zip(scales, terms, strict=True)])
    return np.asarray(whitened @ root.T)


def _walk(
    phase: Phase, theta: FloatArray, wanted: FloatArray, tracked: TrackedRoots, weights: FloatArray
) -> tuple[FloatArray, TrackedRoots, float]:
    """Go the largest part of the step that keeps the model sound and lets the misfit fall."""
    allowed = max(float(weights @ phase.errors(tracked) ** 2), float(len(weights)))
    part = phase.largest_part(theta, wanted)
    for _ in range(MAX_HALVINGS):
        trial = theta + part * (wanted - theta)
        found = phase.roots(trial, tracked)
        if found is not None and float(weights @ phase.errors(found) ** 2) <= allowed:
            return trial, found, part
        part /= 2
    return theta, tracked, 0.0


def _row(
    phase: Phase, iteration: int, error: FloatArray, step: GaussianStep, scales: FloatArray, part: float
) -> dict[str, float]:
    return {
        "iteration": iteration,
        "misfit": float(error @ np.linalg.solve(phase.noise, error)),
        "step": part,
        "largest_error": float(np.abs(error).max(initial=0.0)),
        "size_of_change": float(np.linalg.norm(step.mean)),
        "data_left_free": step.freedom,
        **{f"std: {term.name}": float(scale) for term, scale in zip(phase.terms, scales, strict=True)},
    }
