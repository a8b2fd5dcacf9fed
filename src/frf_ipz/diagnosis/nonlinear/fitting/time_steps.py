"""How many time steps the simulations of a search need: as many as it takes that twice as many change nothing.

A search begins with steps that resolve the top of the band. Its best fits are then simulated in steps half as long: the
change of the weighted misfit is an estimate of its error by the steps, in standard deviations of the data. No parameter
is off by more of its standard deviations than that change is long, so that a short one changes no answer. A best fit
that does not converge at once in the steps that it needs has been found by a wrong simulation: another one may be best.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from frf_ipz.diagnosis.nonlinear.segments import REFINEMENT

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.diagnosis.nonlinear.fitting.alternating_fit import LawFit
    from frf_ipz.diagnosis.nonlinear.fitting.problem import LawFitProblem
    from frf_ipz.diagnosis.nonlinear.segments import SegmentSet

STEPS_PER_PERIOD = 8.0  # of the top of the band: two in each quarter of a swing
LARGEST_CHANGE = 0.3  # standard deviations, of all data together: what no parameter may be off by for the steps
NOT_FAR = 4.0  # times the smallest cost: laws that more steps might put first
STEPS = 6  # of a fit in new time steps


def first_steps(segments: SegmentSet, top_hz: float) -> int:
    """Give the number of time steps per sample that a search begins with.

    Parameters
    ----------
    segments : SegmentSet
        The data.
    top_hz : float
        Top of the band.

    Returns
    -------
    int
        A power of two.
    """
    steps = 1
    while steps < REFINEMENT and steps < STEPS_PER_PERIOD * top_hz * segments.step_s:
        steps *= 2
    return steps


def resolve_in_time(problem: LawFitProblem, fits: Sequence[LawFit]) -> tuple[LawFitProblem, list[LawFit] | None]:
    """Fit in more time steps, until twice as many change nothing.

    Parameters
    ----------
    problem : LawFitProblem
        The data.
    fits : sequence of LawFit
        To them, the smallest cost first.

    Returns
    -------
    problem : LawFitProblem
        With the time steps that were needed.
    fits : list of LawFit or None
        In these steps, the smallest cost first; those of fits that cannot be the best stay as they are. None where the
        best does not converge in few steps: the search has to be made in these time steps.
    """
    resolved = list(fits)
    while problem.segments.steps_per_sample < REFINEMENT:
        near = [fit for fit in resolved if fit.cost < NOT_FAR * resolved[0].cost]
        best_of_each_law = {fit.law.name: fit for fit in reversed(near)}
        finer = problem.with_steps(2 * problem.segments.steps_per_sample)
        if all(_is_resolved(finer, fit) for fit in best_of_each_law.values()):
            break
        problem = finer
        refitted = [finer.fit_output_error(fit, STEPS) for fit in near]
        resolved = sorted(refitted + resolved[len(near) :], key=lambda fit: fit.cost)
        if not resolved[0].converged:
            return problem, None
    return problem, resolved


def _is_resolved(finer: LawFitProblem, fit: LawFit) -> bool:
    """Tell whether steps half as long change a simulation by little, beside what the law leaves."""
    change = finer.fit_output_error(fit, 0).misfit - fit.misfit
    return bool(change @ change <= LARGEST_CHANGE**2 * max(1.0, fit.cost / fit.n_rows))
