"""Targets that cannot be met, and why: contradicted by all others, or beyond what the parameters can move."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import IntArray
from frf_ipz.updating.gaussian import most_contradicted, most_likely_scales

if TYPE_CHECKING:
    from frf_ipz.updating.minimal_change.gauss_newton import PhaseResult
    from frf_ipz.updating.minimal_change.stiffness import StiffnessPhase
    from frf_ipz.updating.tracking import TrackedRoots

CONTRADICTED = 6.0  # standard deviations from what all other targets and the prior say
LEAST_ERROR = 0.02  # relative: a pair of two different modes is farther apart; what is nearer is small and true
CURVATURE = 0.5  # of the squared error: what a linear step cannot see
MOST = 0.25  # part of the targets that may be left out
LEFT_OUT = 1.0  # relative standard deviation of a target while it is left out
UNMET = 4.0  # standard deviations off from which a target counts as not met
NEAR_ENOUGH = 1e-4  # relative; what is nearer counts as met all the same
DEAF = 1e-3  # relative change by the prior's standard deviations below which nothing moves a target


def contradicted_targets(phase: StiffnessPhase, start: TrackedRoots) -> IntArray:
    """Find targets that all others contradict: mostly pairs that join two different modes.

    Parameters
    ----------
    phase : StiffnessPhase
        The stiffness phase.
    start : TrackedRoots
        Roots of the nominal model.

    Returns
    -------
    (k,) int array
        Places of the targets to leave out.
    """
    theta = np.zeros(len(phase.basis.names))
    error = phase.errors(start)
    slopes = phase.slopes(theta, start)
    parts = [slopes @ term.root for term in phase.terms]
    noise = phase.noise + np.diag((CURVATURE * error**2) ** 2)
    scales = np.array([term.std for term in phase.terms])
    found: list[int] = []
    while len(found) <= MOST * len(error):
        scales = most_likely_scales(parts, phase.terms, error, noise, scales)
        sensitivity = np.hstack([scale * part for scale, part in zip(scales, parts, strict=True)])
        worst = most_contradicted(sensitivity, error, noise, CONTRADICTED, least=LEAST_ERROR)
        if worst < 0:
            return np.array(found, int)
        found.append(worst)
        noise[worst, worst] += LEFT_OUT**2
    return np.array([], int)  # so many contradictions are no exception: the model is far off, and all targets count


def unmet_targets(result: PhaseResult, names: tuple[str, ...], left_out: IntArray) -> tuple[str, ...]:
    """Say which targets are not met.

    Parameters
    ----------
    result : PhaseResult
        Where it ended.
    names : tuple of str
        Targets in words.
    left_out : (k,) int array
        Those that were left out.

    Returns
    -------
    tuple of str
        One sentence each.
    """
    deviation = np.sqrt(np.diagonal(result.noise))
    reach = np.linalg.norm(result.sensitivity, axis=1)
    texts = []
    for place, name in enumerate(names):
        off = f"the {name} stays {abs(result.error[place]):.2g} of its value off"
        if place in left_out:
            texts.append(f"{off}: all other targets contradict it, so it was left out; it may be paired wrongly")
        elif abs(result.error[place]) > max(UNMET * deviation[place], NEAR_ENOUGH):
            many = abs(result.error[place]) / deviation[place]
            why = "nothing that may change moves it" if reach[place] < DEAF else "other targets pull the other way"
            texts.append(f"{off} ({many:.0f} standard deviations): {why}")
    return tuple(texts)
