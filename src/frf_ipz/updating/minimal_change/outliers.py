"""Outliers among the targets, and targets that cannot be met: contradicted by all others, or moved by no parameter."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray, IntArray
from frf_ipz.updating.gaussian import contradicted, linearise, most_likely_scales, with_more_noise

if TYPE_CHECKING:
    from frf_ipz.updating.minimal_change.gauss_newton import PhaseResult
    from frf_ipz.updating.minimal_change.stiffness import StiffnessPhase
    from frf_ipz.updating.tracking import TrackedRoots

CONTRADICTED = 6.0  # standard deviations from the prediction by all other targets and the prior
MIN_ERROR = 0.02  # relative: a wrong pair of two modes is farther apart; smaller errors are real
CURVATURE = 0.5  # of the squared error: what a linear step cannot see
MAX_SHARE = 0.25  # of the targets may be excluded
EXCLUDED_STD = 1.0  # relative standard deviation of an excluded target
UNMET = 4.0  # standard deviations off from which a target counts as not met
TOLERANCE = 1e-4  # relative error that counts as met in any case
INSENSITIVE = 1e-3  # relative change by the prior's standard deviations below which no parameter moves a target


def contradicted_targets(phase: StiffnessPhase, start: TrackedRoots, theta: FloatArray) -> tuple[IntArray, FloatArray]:
    """Find targets that all others contradict: mostly pairs that join two different modes.

    They are judged by changes of the stiffness: where masses at many nodes may take part, which together move any root
    by some per cent, next to nothing is a contradiction.

    Parameters
    ----------
    phase : StiffnessPhase
        The stiffness phase.
    start : TrackedRoots
        Roots of the model from which the iteration starts.
    theta : (p,) array
        Its parameters.

    Returns
    -------
    outliers : (k,) int array
        Indices of the targets to exclude.
    scales : (t,) array
        Most likely standard deviations of the prior terms without them.
    """
    error = phase.errors(start)
    slopes = phase.slopes(theta, start)
    noise = phase.noise.plus((CURVATURE * error**2) ** 2)
    data = error + slopes @ theta
    stds = np.array([term.std for term in phase.terms])
    judging = np.flatnonzero(~phase.basis.is_of_nodes)
    terms, scales = tuple(phase.terms[place] for place in judging.tolist()), stds[judging]
    most, is_far = int(MAX_SHARE * len(error)), np.abs(data) >= MIN_ERROR
    outliers = np.zeros(0, int)
    linear = linearise((term.by_whitened(slopes) for term in terms), data, noise, scales=scales)
    del slopes  # large
    while len(outliers) <= most:
        scales = most_likely_scales(linear, terms, scales)
        further = contradicted(
            linear,
            scales,
            limit=CONTRADICTED,
            excluded_std=EXCLUDED_STD,
            most=most + 1 - len(outliers),
            judged=is_far,
        )
        if not len(further):
            likely = stds.copy()
            likely[judging] = scales
            return outliers, likely
        outliers = np.append(outliers, further)
        noise = noise.plus(np.where(np.isin(np.arange(len(error)), further), EXCLUDED_STD**2, 0.0))
        linear = with_more_noise(linear, noise, further)
    # so many contradictions are no exception: the model is far off, and all targets count
    return np.zeros(0, int), stds


def unmet_targets(result: PhaseResult, names: tuple[str, ...], excluded: IntArray) -> tuple[str, ...]:
    """Describe the targets that are not met.

    Parameters
    ----------
    result : PhaseResult
        Result of the stiffness phase.
    names : tuple of str
        Targets in words.
    excluded : (k,) int array
        Excluded targets.

    Returns
    -------
    tuple of str
        One sentence each.
    """
    deviation = np.sqrt(result.noise.variance)
    reach = np.empty(len(names))
    for place, rows in result.linear.sensitivity(result.scales[:-1]):
        reach[place] = np.linalg.norm(rows, axis=1)
    texts = []
    for target, name in enumerate(names):
        error = f"the {name} stays {abs(result.error[target]):.2g} of its value off"
        if target in excluded:
            texts.append(f"{error}: all other targets contradict it, so it was excluded; it may be paired wrongly")
        elif abs(result.error[target]) > max(UNMET * deviation[target], TOLERANCE):
            ratio = abs(result.error[target]) / deviation[target]
            why = "no parameter moves it" if reach[target] < INSENSITIVE else "other targets pull the other way"
            texts.append(f"{error} ({ratio:.0f} standard deviations): {why}")
    return tuple(texts)
