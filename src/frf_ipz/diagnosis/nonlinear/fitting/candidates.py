"""Candidates: the laws and locations that explain the data best.

Laws are scored, fitted in alternation, simulated, and moved to neighbouring locations.

Short segments come first: within them even strongly nonlinear motion is predictable, and a rough start is good enough.
The best of them are then fitted to the long ones, the very best until it converges. The stronger a law, the shorter the
segments from which a rough start leads to it: where even the first moments are nonlinear, they come first.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.nonlinear.fitting.alternating_fit import LawFit, LawStart, fit_alternating
from frf_ipz.diagnosis.nonlinear.fitting.force_localisation import start_from_force
from frf_ipz.diagnosis.nonlinear.fitting.linear_fit import linear_location_motion
from frf_ipz.diagnosis.nonlinear.fitting.output_error_fit import fit_output_error
from frf_ipz.diagnosis.nonlinear.fitting.score_tests import score_laws
from frf_ipz.diagnosis.nonlinear.model.modal_model import respond

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence
    from typing import TypeAlias

    from frf_ipz.diagnosis.nonlinear.fitting.problem import LawFitProblem
    from frf_ipz.diagnosis.nonlinear.laws.law import Law

    _Key: TypeAlias = tuple[str, int]  # of a law and its location

OF_EACH_LAW = 3  # scored locations that are fitted in alternation
OF_ALL_LAWS = 5
FEW_LOCATIONS = 4  # that only a law distinguishes: with more, the best fit at one of them may not be the best of all
BY_FREE_FORCE = 2  # locations at which laws are read from the free force
SIMULATED = 2  # locations of each law that are simulated on short segments
ROUNDS = 6  # of the fit in alternation
FIRST_STEPS, MORE_STEPS = 2, 6  # of the output-error fit: of all, and of those that are not given up
MAX_COST_RATIO, MAX_COST_RATIO_LONG = 10.0, 4.0  # to the least, on short and long segments: others are given up
MAX_COST_RATIO_NEIGHBOUR = 1.5  # to the cost of a neighbour that explains already
FINALISTS = 3  # that are simulated on long segments
FAR_OFF = 4.0  # mean square misfit over the expected one: with more, laws are simulated as read from the free force
MAX_EARLY_PART = 0.5  # of the linear model's cost for the first moments: with more, they say little about a law
BETTER = 0.02  # relative drop of the cost that justifies another start, or another fit of the neighbours
LEAST_OVERLAP = 0.01  # of the shapes of two locations: with less a law is not rescaled, or it would grow without limit
NEIGHBOUR_STEPS = 8  # to better neighbours
EXCHANGED, LIKELY = 2, 2.0  # locations of the best law that are fitted from its parameters; times its cost at most
EXCHANGES = 3  # times that this may lead to a better location
TIED = 20.0  # of the cost: fits that close to the best must converge before they are compared
CONVERGENCE_ROUNDS, FRESH_STEPS = 4, 12  # of further steps of the best fit until it converges; steps of a fresh one


def find_candidates(
    short: LawFitProblem,
    long: LawFitProblem,
    laws: Sequence[Law],
    *,
    first: Callable[[], LawFitProblem] | None = None,
) -> list[LawFit]:
    """Find the laws and locations that explain segments best.

    Parameters
    ----------
    short, long : LawFitProblem
        The data.
    laws : sequence of Law
        To be tried.
    first : callable, optional
        Gives still shorter segments. They are used where nothing explains the long ones as well as can be expected.

    Returns
    -------
    list of LawFit
        Fits to the long segments, the smallest cost first.
    """
    late = sorted(_fit_scored(long, laws) + _fit_from_free_force(long, laws), key=lambda fit: fit.cost)
    is_localised = len(long.localisation.equivalent) <= FEW_LOCATIONS and _explain(late)
    direct = _finish(long, [fit for law in laws for fit in _of_law(law, late)[:1]]) if is_localised else []
    if _explain(direct):
        return direct
    rough = _fit_scored(short, laws)
    by_free_force = [
        fit for fit in late if fit.location in [free.location for free in long.localisation.forces[:BY_FREE_FORCE]]
    ]
    early = _simulate_with_neighbours(
        short,
        [
            fit
            for law in laws
            for fit in _of_law(law, rough)[:SIMULATED] + _of_law(law, late)[:1] + _of_law(law, by_free_force)
        ],
    )
    finalists = early[:FINALISTS] + [_of_law(law, early)[0] for law in laws if _of_law(law, early)] + late[:1]
    fits = _best_of_each(direct + _finish(long, finalists))
    if fits and fits[0].cost > FAR_OFF * fits[0].n_rows:
        fits = _best_of_each(fits + _finish(long, _simulate_from_free_force(long, laws)))
    if first is None or _explain(fits):
        return fits
    earliest = _simulate_with_neighbours(short, _fit_first_moments(first(), laws))
    if not earliest or earliest[0].cost > max(earliest[0].n_rows, (1 - BETTER) * early[0].cost if early else np.inf):
        return fits
    return _best_of_each(fits + _finish(long, _not_yet_fitted(earliest[:FINALISTS], fits[:1])))


def is_explained(fit: LawFit) -> bool:
    """Tell whether the misfit of a fit is no larger than expected."""
    return fit.cost < fit.n_rows


def _explain(fits: Sequence[LawFit]) -> bool:
    return bool(fits) and is_explained(fits[0])


def _fit_first_moments(problem: LawFitProblem, laws: Sequence[Law]) -> list[LawFit]:
    """Fit the first moments; of each law those fits that explain most of what nothing linear explains."""
    scored = _fit_scored(problem, laws)
    fits = _simulate_with_neighbours(problem, [fit for law in laws for fit in _of_law(law, scored)[:SIMULATED]])
    good = [fit for fit in fits if fit.cost < min(MAX_EARLY_PART * problem.linear.cost, MAX_COST_RATIO * fits[0].cost)]
    return [fit for law in laws for fit in _of_law(law, good)[:SIMULATED]]


def _not_yet_fitted(fits: Sequence[LawFit], fitted: Sequence[LawFit]) -> list[LawFit]:
    """Leave out laws at locations that were fitted afresh already; all, if the best is one of them."""
    keys = {(fit.law.name, fit.location) for fit in fitted}
    new = [fit for fit in fits if (fit.law.name, fit.location) not in keys]
    return new if new[:1] == list(fits[:1]) else []


def _simulate_with_neighbours(problem: LawFitProblem, starts: Iterable[LawFit]) -> list[LawFit]:
    """Fit by simulation, the neighbours of the best too; the smallest cost first."""
    fits = _simulate(problem, _first_of_each(starts))
    _search_neighbours(problem, fits, {})
    return sorted(fits, key=lambda fit: fit.cost)


def _finish(problem: LawFitProblem, finalists: Iterable[LawFit]) -> list[LawFit]:
    """Fit to the long segments, the best until it converges; the smallest cost first."""
    fits = _simulate(problem, _first_of_each(finalists), max_ratio=MAX_COST_RATIO_LONG)
    moved_from: dict[_Key, LawFit] = {}
    _search_neighbours(problem, fits, moved_from)
    if fits:
        least = min(fit.cost for fit in fits)
        _converge_best(problem, fits)
        has_improved = min(fit.cost for fit in fits) < (1 - BETTER) * least
        for _ in range(EXCHANGES):
            if not _exchange_locations(problem, fits, moved_from, neighbours=has_improved):
                break
            _converge_best(problem, fits)
            has_improved = True
        _converge_ties(problem, fits)
    return sorted(fits, key=lambda fit: fit.cost)


def _best_of_each(fits: Iterable[LawFit]) -> list[LawFit]:
    """Give the best fit of each law and location; the smallest cost first."""
    return _first_of_each(sorted(fits, key=lambda fit: fit.cost))


def _of_law(law: Law, fits: Iterable[LawFit]) -> list[LawFit]:
    return [fit for fit in fits if fit.law is law]


def _first_of_each(fits: Iterable[LawFit]) -> list[LawFit]:
    """Give the first fit of each law and location whose strength is not zero."""
    first: dict[tuple[str, int], LawFit] = {}
    for fit in fits:
        if fit.strength != 0:
            first.setdefault((fit.law.name, fit.location), fit)
    return list(first.values())


def _fit_scored(problem: LawFitProblem, laws: Sequence[Law]) -> list[LawFit]:
    """Score all laws at all possible locations, and fit the best in alternation."""
    scored = score_laws(problem.segments, problem.linear, laws, locations=problem.localisation.possible)
    nuisance = problem.linear.start_nuisance
    selected = [score for law in laws for score in [s for s in scored if s.law is law][:OF_EACH_LAW]]
    selected += [score for score in scored[:OF_ALL_LAWS] if score not in selected]
    fits = []
    for score in selected:
        problem.deadline.check()
        start = LawStart(
            law=score.law, location=score.location, strength=score.strength, shape=score.shape, nuisance=nuisance
        )
        fit = fit_alternating(problem.segments, problem.linear.nuisance_prior, start, n_rounds=ROUNDS, known=False)
        fits.append(fit if fit.strength else replace(fit, strength=score.strength, shape=score.shape))
    return sorted(fits, key=lambda fit: fit.cost)


def _fit_from_free_force(problem: LawFitProblem, laws: Sequence[Law]) -> list[LawFit]:
    """Fit the laws in alternation, from parameters that are read from the free force."""
    return [
        fit_alternating(problem.segments, problem.linear.nuisance_prior, start, n_rounds=ROUNDS)
        for start in _free_force_starts(problem, laws)
    ]


def _simulate_from_free_force(problem: LawFitProblem, laws: Sequence[Law]) -> list[LawFit]:
    """Simulate the laws as read from the free force: the fit in alternation may have led away from them."""
    return [
        fit_output_error(problem.segments, problem.linear.nuisance_prior, start, iterations=FIRST_STEPS)
        for start in _free_force_starts(problem, laws)
    ]


def _free_force_starts(problem: LawFitProblem, laws: Sequence[Law]) -> list[LawStart]:
    """Read the laws from the free force at the likeliest locations."""
    starts = [
        start_from_force(problem.segments, problem.linear, free, law)
        for free in problem.localisation.forces[:BY_FREE_FORCE]
        for law in laws
    ]
    problem.deadline.check()
    return [start for start in starts if start.strength]


def _simulate(
    problem: LawFitProblem, fits: Sequence[LawFit], *, max_ratio: float = MAX_COST_RATIO, least: float = np.inf
) -> list[LawFit]:
    """Fit by simulation; those whose cost after a few steps is too far above the least, only so far."""
    simulated = [problem.fit_output_error(fit, FIRST_STEPS) for fit in fits]
    least = min(least, *(fit.cost for fit in simulated)) if simulated else least
    return [_continue_promising(problem, fit, is_promising=fit.cost <= max_ratio * least) for fit in simulated]


def _continue_promising(problem: LawFitProblem, fit: LawFit, *, is_promising: bool) -> LawFit:
    """Fit further unless it has converged; forget the simulation of what is given up, which takes memory."""
    if not is_promising:
        return replace(fit, simulation=None)
    return fit if fit.converged else problem.fit_output_error(fit, MORE_STEPS)


def _converge_best(problem: LawFitProblem, fits: list[LawFit]) -> None:
    """Fit the best law further, as long as its cost falls, and once more with the nominal linear model."""
    best, is_fresh = min(range(len(fits)), key=lambda i: fits[i].cost), False
    for _ in range(CONVERGENCE_ROUNDS):
        fit = fits[best]
        if not fit.converged:
            fits[best] = problem.fit_output_error(fit, MORE_STEPS)
        elif is_fresh or fit.cost < fit.n_rows:
            return
        else:  # a strong law has other minima, in which initial states are taken for its effect
            fresh, is_fresh = problem.fit_output_error_afresh(fit, FRESH_STEPS), True
            fits[best] = min(fit, fresh, key=lambda candidate: candidate.cost)


def _converge_ties(problem: LawFitProblem, fits: list[LawFit]) -> None:
    """Fit further what is so close to the best fit that the number of steps might decide between the two."""
    least = min(fit.cost for fit in fits)
    for number, fit in enumerate(fits):
        if not fit.converged and fit.cost < least + TIED:
            fits[number] = min(fit, problem.fit_output_error(fit, MORE_STEPS), key=lambda candidate: candidate.cost)


def _exchange_locations(
    problem: LawFitProblem, fits: list[LawFit], moved_from: dict[_Key, LawFit], *, neighbours: bool
) -> bool:
    """Fit the best law at its next best locations from its best parameters, and at its neighbours if asked.

    They were fitted from worse parameters, unless `moved_from` says that it was from these, and may have ended in a
    local minimum. True if one becomes the best of all; where that leaves more than expected, by more than half a nat of
    evidence: what explains so little is not polished.
    """
    best = min(fits, key=lambda fit: fit.cost)
    likely = [fit for fit in fits if fit.law is best.law and best.cost < fit.cost < LIKELY * best.cost]
    locations = [fit.location for fit in sorted(likely, key=lambda fit: fit.cost)[:EXCHANGED]]
    locations += [
        location
        for location in (problem.neighbours_of(best.location) if neighbours else [])
        if location not in locations
    ]
    new = [location for location in locations if moved_from.get((best.law.name, location)) is not best]
    moved_from.update(dict.fromkeys(((best.law.name, location) for location in new), best))
    refitted = _simulate(problem, [_move_law(problem, best, location) for location in new], least=best.cost)
    fits[:] = _best_of_each(fits + refitted)
    return best.cost - fits[0].cost > max(0.0, best.cost / best.n_rows - 1)


def _search_neighbours(problem: LawFitProblem, fits: list[LawFit], moved_from: dict[_Key, LawFit]) -> None:
    """Fit the neighbours of the best fit, as long as one of them is better; note in `moved_from` from which."""
    fitted = {(fit.law.name, fit.location) for fit in fits}
    for _ in range(NEIGHBOUR_STEPS if fits else 0):
        best = min(fits, key=lambda fit: fit.cost)
        new = [location for location in problem.neighbours_of(best.location) if (best.law.name, location) not in fitted]
        if not new:
            return
        fitted |= {(best.law.name, location) for location in new}
        moved_from.update(dict.fromkeys(((best.law.name, location) for location in new), best))
        moved = [_move_law(problem, best, location) for location in new]
        max_ratio = MAX_COST_RATIO_NEIGHBOUR if best.cost < best.n_rows else MAX_COST_RATIO
        fits += _simulate(problem, moved, max_ratio=max_ratio, least=best.cost)


def _move_law(problem: LawFitProblem, fit: LawFit, location: int) -> LawFit:
    """Move a law to another location, rescaled by the motion there so that its force does as much work."""
    nuisance_prior = problem.linear.nuisance_prior
    from_shapes, to_shapes = nuisance_prior.modal_model.at_locations.shapes[[fit.location, location]]
    moved = replace(fit, location=location, nuisance=nuisance_prior.without_location(fit.nuisance))
    if abs(float(from_shapes @ to_shapes)) < LEAST_OVERLAP * max(float(np.linalg.norm(from_shapes)), 1e-300) ** 2:
        return moved
    ratio = _motion_size(problem, moved) / max(_motion_size(problem, fit), 1e-300)
    return replace(moved, shape=fit.shape * ratio, strength=fit.strength / ratio**fit.law.degree)


def _motion_size(problem: LawFitProblem, fit: LawFit) -> float:
    """Motion of the location of a law in all segments, with the linear model of its fit but without its force."""
    segments, nuisance_prior = problem.segments, problem.linear.nuisance_prior
    nuisance_values = nuisance_prior.to_values(fit.nuisance, fit.location)
    response = respond(nuisance_prior.modal_model, segments.s, nuisance_values)
    _, motion = linear_location_motion(segments, nuisance_prior, fit.nuisance, response, fit.location)
    return float(np.linalg.norm(motion))
