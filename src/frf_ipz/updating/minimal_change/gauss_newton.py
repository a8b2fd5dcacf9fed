"""The iteration of a minimal change: Gauss-Newton on the total change, under a prior whose scales are estimated too.

Each step solves the linearised problem from the nominal model again, so that the prior always weighs the whole change
and not the last step. A phase (stiffness, damping) gives its roots and their derivatives; the loop is here.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.updating.gaussian import (
    GaussianStep,
    Linearised,
    distance_to_optimum,
    linearise,
    log_evidence,
    most_likely_scales,
    step_by_discrepancy,
)
from frf_ipz.updating.parameters import PriorTerm, unwhiten
from frf_ipz.updating.target_noise import TargetNoise
from frf_ipz.updating.tracking import TrackedRoots

MAX_ITERATIONS = 30
CONVERGED = 0.03  # posterior standard deviations from the optimum, all directions together
MET = 0.1  # of the number of targets: a misfit so far below that of noise needs no further step
MAX_HALVINGS = 6
CURVATURE = 0.5  # of the squared error at first, then of the error of the last linear prediction: counts as noise
SLACK_UNCERTAINTY = 1.5  # standard deviation of the logarithm of the factor on the slack
STALLED = 3.0  # factor on that noise after a step that had to be rejected
SCALE_ITERATIONS = 3  # iterations that maximise the evidence: later ones would only follow their own change


class Phase(Protocol):
    """What the loop needs of the stiffness or of the damping."""

    @property
    def terms(self) -> tuple[PriorTerm, ...]:
        """Prior of the parameters."""

    @property
    def noise(self) -> TargetNoise:
        """Covariance of the n errors."""

    @property
    def slack(self) -> FloatArray:
        """Standard deviations of what no parameter explains, (n,), before the data are seen."""

    def roots(self, theta: FloatArray, reference: TrackedRoots) -> TrackedRoots | None:
        """Give the roots that belong to the targets.

        Parameters
        ----------
        theta : (p,) array
            Parameters.
        reference : TrackedRoots
            Roots of a model close to this one.

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

    def history_columns(self, theta: FloatArray) -> dict[str, float]:
        """Give the parameters for the history.

        Parameters
        ----------
        theta : (p,) array
            Parameters.

        Returns
        -------
        dict of str to float
            By name.
        """

    def max_step_fraction(self, theta: FloatArray, proposed: FloatArray) -> float:
        """Give the largest fraction of a step that may be tried.

        Parameters
        ----------
        theta, proposed : (p,) array
            Parameters before and after the step.

        Returns
        -------
        float
            At most 1.
        """


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PhaseResult:
    """Result of the iteration of a phase.

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
    noise : TargetNoise
        Covariance of the targets and of what no parameter explains.
    scales : (t + 1,) array
        Standard deviations of the prior terms; last the factor on the slack.
    step : GaussianStep
        The last linear step.
    linear : Linearised
        The data of the last step.
    rows : tuple of dict
        One an iteration, for the history.
    converged : bool
        True where a further step would change nothing that matters.
    """

    whitened: FloatArray
    theta: FloatArray
    tracked: TrackedRoots
    error: FloatArray
    noise: TargetNoise
    scales: FloatArray
    step: GaussianStep
    linear: Linearised
    rows: tuple[dict[str, float], ...]
    converged: bool


@dataclass(frozen=True, slots=True, eq=False)
class _Iterate:
    """Parameters, roots and errors at a step of the iteration."""

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
    likely: FloatArray | None = None,
    max_iterations: int | None = None,
) -> PhaseResult:
    """Iterate the roots to their targets.

    Parameters
    ----------
    phase : Phase
        Stiffness or damping.
    tracked : TrackedRoots
        Roots at the start.
    start : (k,) array, optional
        Unit normal numbers of the prior terms to start from; 0 by default.
    scales : (t + 1,) array, optional
        Standard deviations of the prior terms and the factor on the slack, if they are to be held.
    likely : (t,) array, optional
        Standard deviations of the prior terms from which the search for the most likely ones starts.
    max_iterations : int, optional
        Largest number of iterations.

    Returns
    -------
    PhaseResult
        Parameters, roots and errors at the end.
    """
    scales_are_held = scales is not None
    terms = _with_slack(phase.terms)
    scales = np.array([term.std for term in terms]) if scales is None else scales.copy()
    if likely is not None:
        scales[:-1] = likely
    whitened = np.zeros(sum(term.root.shape[1] for term in phase.terms)) if start is None else start
    state = _Iterate(whitened, unwhiten(phase.terms, scales[:-1], whitened), tracked, phase.errors(tracked))
    nonlinearity, rows, converged, best = CURVATURE * state.error**2, [], False, state
    last = max_iterations or MAX_ITERATIONS
    for iteration in range(1, last + 1):
        slopes = phase.slopes(state.theta, state.tracked)
        data = state.error + slopes @ state.theta
        searching = not scales_are_held and iteration <= SCALE_ITERATIONS
        now = phase.noise.plus(nonlinearity**2)
        parts = (term.by_whitened(slopes) for term in phase.terms)
        linear = linearise(parts, data, now, phase.slack, scales=scales[:-1], combining=searching)
        del slopes  # as large as all that is kept of it
        if searching:
            new_scales = most_likely_scales(linear, terms, scales)
            state = replace(state, whitened=_rescaled(phase.terms, scales / new_scales, state.whitened))
            best, scales = state, new_scales  # under other scales another change is the likeliest
        step, scales[-1] = step_by_discrepancy(linear, scales[:-1], float(scales[-1]))
        noise = phase.noise.plus((scales[-1] * phase.slack) ** 2)
        before = state
        state, fraction = _line_search(phase, scales, before, step.mean, linear)
        predicted = before.error + fraction * (data - _explained(linear, scales[:-1], step.mean) - before.error)
        deviation = np.abs(state.error - predicted)
        # change and misfit together, without the noise that stands for curvature
        best_square, square = noise.squares(np.stack([best.error, state.error], axis=1))
        gain = float(best.whitened @ best.whitened + best_square - state.whitened @ state.whitened - square)
        is_nearer = gain > 0
        best = state if is_nearer else best
        if fraction:
            nonlinearity = np.maximum(CURVATURE * deviation, 0.0 if is_nearer else nonlinearity)
        else:
            nonlinearity = STALLED * np.maximum(nonlinearity, np.sqrt(noise.variance))
        row = _history_row(terms, iteration, state.error, float(square), step, scales, fraction)
        rows.append(row | phase.history_columns(state.theta))
        distance = distance_to_optimum(linear, step, scales[:-1], float(scales[-1]), state.whitened, state.error)
        is_nearing = rows[-1]["misfit"] > len(data) and gain > CONVERGED**2  # what stands for curvature hides errors
        converged = distance < CONVERGED and not is_nearing
        if converged or rows[-1]["misfit"] < MET * len(data):
            converged = True
            break
        if iteration < last:
            del linear, step  # as large as those that take their place
    return PhaseResult(
        whitened=state.whitened,
        theta=state.theta,
        tracked=state.tracked,
        error=state.error,
        noise=noise,
        scales=scales,
        step=step,
        linear=linear,
        rows=tuple(rows),
        converged=converged,
    )


def log_evidence_of(phase: Phase, result: PhaseResult) -> float:
    """Give the logarithm of the evidence of what explains the targets, to be compared with that of other parameters.

    Parameters
    ----------
    phase : Phase
        Stiffness or damping.
    result : PhaseResult
        Its result.

    Returns
    -------
    float
        About the last linear step.
    """
    return log_evidence(result.linear, _with_slack(phase.terms), result.scales)


def _with_slack(terms: tuple[PriorTerm, ...]) -> tuple[PriorTerm, ...]:
    name = "what no parameter explains"
    return (*terms, PriorTerm(name=name, root=np.zeros((0, 0)), std=1.0, scale_uncertainty=SLACK_UNCERTAINTY))


def _explained(linear: Linearised, scales: FloatArray, mean: FloatArray) -> FloatArray:
    """Give what the parameters make of the data."""
    combined = linear.combined(mean)
    explained = np.empty(len(linear.data))
    for place, rows in linear.sensitivity(scales):
        explained[place] = rows @ combined
    return explained


def _rescaled(terms: tuple[PriorTerm, ...], factors: FloatArray, whitened: FloatArray) -> FloatArray:
    """Whitened parameters of the same parameters under other scales."""
    sizes = [term.root.shape[1] for term in terms]
    return np.asarray(whitened * np.repeat(factors[: len(terms)], sizes))


def _line_search(
    phase: Phase, scales: FloatArray, start: _Iterate, proposed: FloatArray, linear: Linearised
) -> tuple[_Iterate, float]:
    """Take the largest fraction of the step that keeps the model valid and reduces misfit and change together."""

    def cost(whitened: FloatArray, error: FloatArray) -> float:
        return float(whitened @ whitened) + linear.square(error, float(scales[-1]))

    initial_cost = cost(start.whitened, start.error)
    fraction = phase.max_step_fraction(start.theta, unwhiten(phase.terms, scales[:-1], proposed))
    for _ in range(MAX_HALVINGS):
        whitened = start.whitened + fraction * (proposed - start.whitened)
        theta = unwhiten(phase.terms, scales[:-1], whitened)
        tracked = phase.roots(theta, start.tracked)
        if tracked is not None:
            error = phase.errors(tracked)
            if cost(whitened, error) <= initial_cost:
                return _Iterate(whitened, theta, tracked, error), fraction
        fraction /= 2
    return start, 0.0


def _history_row(
    terms: tuple[PriorTerm, ...],
    iteration: int,
    error: FloatArray,
    misfit: float,
    step: GaussianStep,
    scales: FloatArray,
    fraction: float,
) -> dict[str, float]:
    return {
        "iteration": iteration,
        "misfit": misfit,
        "step": fraction,
        "largest_error": float(np.abs(error).max(initial=0.0)),
        "size_of_change": float(np.linalg.norm(step.mean)),
        "data_left_free": step.n_determined,
        **{f"std: {term.name}": float(scale) for term, scale in zip(terms, scales, strict=True)},
    }
