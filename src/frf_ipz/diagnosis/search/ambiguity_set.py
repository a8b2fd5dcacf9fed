"""The ambiguity set: what explains a test nearly as well as the best does, rescored with smaller model tolerances.

Tolerances are bounds that a user states; many a model is better. Where it is, an effect at a wrong location needs more
of them than at the right one, and that counts for little as long as they are thought to be large. Each candidate's
evidence is the mean of what it is with the stated tolerances and with parts of them: a model that needs them as they
are makes those vanish, and nothing changes. How much of its FRFs no parameter of the model stands for is a part of the
tolerance too; the best explanation says which part is likely.

A search steps to better locations and stops where none is; what is as good on the far side of a structure, or along a
flat valley, it need not have seen. Without these a location looks surer than it is, and now and then the best of them
is the true one. So candidates are added wherever a global scan finds the best effect likely, and beside the best ones
until all neighbours are worse.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from frf_ipz.diagnosis.evidence.inference_problem import weights_of, with_errors
from frf_ipz.diagnosis.evidence.map_fit import polish, same_modes
from frf_ipz.diagnosis.search.component_search import Ranking, keep, ranked
from frf_ipz.diagnosis.search.global_scan import wide_search
from frf_ipz.diagnosis.search.neighbourhood_search import (
    GAIN,
    Fits,
    bar_of,
    climb_all,
    fit_from_neighbour,
    imitators_of,
)
from frf_ipz.diagnosis.search.robust_refinement import REFINED_ERROR, refine, spread

if TYPE_CHECKING:
    from collections.abc import Container, Iterable

    from frf_ipz.diagnosis.evidence.fit import Data, Fit
    from frf_ipz.diagnosis.evidence.hypothesis import Cause
    from frf_ipz.diagnosis.evidence.inference_problem import InferenceProblem

FAR = 8  # places anywhere, not beside each other, by what a wide search says of them
EQUAL, MOST_EQUAL = 1.1, 4  # times the best cost there: places as good as the best, though beside it, and how many
PARTS = (0.3, 0.1)  # of the tolerances of stiffness, mass and frequencies
FLOORS = (0.3, 0.1)  # parts of the errors of FRFs that no parameter stands for
TIE = 8.0  # nats behind the best: what is so near is weighed again
EACH, MOST = 8, 24  # places of an effect that are, and of all effects
BESIDE, MOST_BESIDE = 4.0, 30  # nats behind the best of these, beside which places are looked at, and how many
MOST_ALIKE = 2  # times that what looks like the best may lead elsewhere
FITTED = 30  # places, by what a wide search says of them
ITERATIONS = 20


def fit_far(bench: InferenceProblem, ranking: Ranking, fits: Fits) -> int:
    """Fit the most probable effect wherever a wide search finds it likely, and around where that is better.

    Parameters
    ----------
    bench : InferenceProblem
        Data and effects.
    ranking : Ranking
        Of a search, with one fit at least.
    fits : dict
        By the key of their last cause; new ones are added.

    Returns
    -------
    int
        Places that were looked at.
    """
    best = ranking.best
    effect = best.hypothesis.causes[-1].effect
    starts = wide_search(replace(bench, effects={effect.name: effect}), ranking.base)
    equal = [start for start in starts[:MOST_EQUAL] if start.cost < EQUAL * starts[0].cost]
    for start in (*equal, *spread(starts, FAR)):
        if start.cause.key not in fits:
            bar = bar_of(fits.values())
            fits[start.cause.key] = fit_from_neighbour(bench, ranking.base, start.cause, best, bar)
    if max(fit.log_evidence for fit in fits.values()) > best.log_evidence + GAIN:
        climb_all(bench, ranking.base, fits, 1)
    return len(starts)


def next_beside(
    bench: InferenceProblem, near: Iterable[Fit], known: Container[tuple[object, ...]]
) -> tuple[Cause, Fit] | None:
    """Choose a place that is not known beside the first fit that has such.

    Parameters
    ----------
    bench : InferenceProblem
        Data and effects.
    near : iterable of Fit
        The best first.
    known : container of keys
        Of last causes.

    Returns
    -------
    (Cause, Fit) or None
        The cause, and the fit beside it; None where all are known.
    """
    for fit in near:
        cause = fit.hypothesis.causes[-1]
        for place in cause.effect.neighbours(bench.specimen, cause.place):
            other = replace(cause, place=place)
            if other.key not in known:
                return other, fit
    return None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Weighed:
    """A fit with the values of the likeliest tolerances, and its evidence with all of them."""

    fit: Fit
    log_evidence: float


_Settled: TypeAlias = dict[tuple[object, ...], _Weighed]


def settle_ties(bench: InferenceProblem, ranking: Ranking) -> Ranking:
    """Weigh again what is nearly as probable as the best, with what may be.

    Parameters
    ----------
    bench : InferenceProblem
        Data and effects.
    ranking : Ranking
        Of a search.

    Returns
    -------
    Ranking
        With other evidences relative to each other; the largest stays what it was.
    """
    if not ranking.fits or not ranking.fits[0].is_nearly_all:
        return ranking
    fits: Fits = {fit.hypothesis.causes[-1].key: fit for fit in ranking.fits}
    is_found = ranking.best.log_evidence > ranking.base.log_evidence + TIE
    n_tried = ranking.n_tried + (fit_far(bench, ranking, fits) if is_found else 0)
    near = _nearest(fits)
    settled: _Settled = {}
    if len(near) > 1:
        data = _likely_errors(bench, near[0])
        stricts = {part: replace(bench, nuisance=bench.nuisance.with_part(part), data=data) for part in PARTS}
        settled = {fit.hypothesis.causes[-1].key: _weigh(bench, stricts, fit) for fit in near}
        if is_found:
            _look_beside(bench, ranking.base, fits, settled, stricts)
            _look_alike(bench, ranking.base, fits, settled, stricts)
    return replace(ranking, fits=_in_order(fits, settled), n_tried=n_tried)


def _nearest(fits: Fits) -> list[Fit]:
    """Give what is nearly as probable as the best, some places of each effect, the best first."""
    order = sorted(fits.values(), key=lambda fit: -fit.log_evidence)
    counts = Counter[str]()
    near: list[Fit] = []
    for fit in order:
        effect = fit.hypothesis.causes[-1].effect.name
        counts[effect] += 1
        if fit.log_evidence > order[0].log_evidence - TIE and counts[effect] <= EACH:
            near.append(fit)
    return near[:MOST]


def _look_beside(
    bench: InferenceProblem, base: Fit, fits: Fits, settled: _Settled, stricts: dict[float, InferenceProblem]
) -> None:
    """Weigh places beside the best ones until all that are left are worse."""
    far: set[tuple[object, ...]] = set()
    for _ in range(MOST_BESIDE):
        order = sorted(settled.values(), key=lambda one: -one.log_evidence)
        near = [one.fit for one in order if one.log_evidence > order[0].log_evidence - BESIDE]
        found = next_beside(bench, near, far | settled.keys())
        if found is None:
            return
        cause, beside = found
        if not _add(bench, base, cause, beside, fits, settled, stricts):
            far.add(cause.key)


def _look_alike(
    bench: InferenceProblem, base: Fit, fits: Fits, settled: _Settled, stricts: dict[float, InferenceProblem]
) -> None:
    """Weigh what looks like the best where that sits now, and places beside it: theirs were found elsewhere before."""
    for _ in range(MOST_ALIKE):
        best = max(settled.values(), key=lambda one: one.log_evidence)
        others = [cause for cause in imitators_of(bench, best.fit) if cause.key not in settled]
        added = [cause for cause in others if _add(bench, base, cause, best.fit, fits, settled, stricts)]
        if all(settled[cause.key].log_evidence < best.log_evidence - BESIDE for cause in added):
            return
        _look_beside(bench, base, fits, settled, stricts)


def _add(
    bench: InferenceProblem,
    base: Fit,
    cause: Cause,
    like: Fit,
    fits: Fits,
    settled: _Settled,
    stricts: dict[float, InferenceProblem],
) -> bool:
    """Fit a cause from a similar one, and weigh it if it is near the best; False if it is not."""
    if cause.key not in fits:
        fits[cause.key] = fit_from_neighbour(bench, base, cause, like, bar_of(fits.values()))
    fit = fits[cause.key]
    is_near = fit.log_evidence > max(one.log_evidence for one in fits.values()) - TIE
    if is_near:
        settled[cause.key] = _weigh(bench, stricts, fit)
    return is_near


def _in_order(fits: Fits, settled: _Settled) -> tuple[Fit, ...]:
    """Sort fits by falling evidence; what was not weighed is worse than what was by as much as counts."""
    if not settled:
        return tuple(sorted(fits.values(), key=lambda fit: -fit.log_evidence))
    most = max(fit.log_evidence for fit in fits.values())
    shift = most - max(one.log_evidence for one in settled.values())
    weighed = [replace(one.fit, log_evidence=one.log_evidence + shift) for one in settled.values()]
    others = [
        replace(fit, log_evidence=min(fit.log_evidence, most - TIE)) for key, fit in fits.items() if key not in settled
    ]
    return tuple(sorted([*weighed, *others], key=lambda fit: -fit.log_evidence))


def _likely_errors(bench: InferenceProblem, best: Fit) -> Data:
    """Give the data the errors of FRFs that are likeliest by the best explanation."""
    data, options = bench.data, bench.specimen.options
    most = best.log_evidence + data.whitening.log_density
    for floor in FLOORS:
        smaller = with_errors(data.measured, options, free_gains=data.free_gains, floor=floor)
        again = polish(best.hypothesis, smaller, best.values, unknown=best.unknown, iterations=8, tolerance=0.1)
        likely = again.log_evidence + smaller.whitening.log_density
        if likely < most:
            break
        data, most = smaller, likely
    return data


def _weigh(bench: InferenceProblem, stricts: dict[float, InferenceProblem], fit: Fit) -> _Weighed:
    """Give a fit the mean evidence, and the values of the likeliest tolerances."""
    best, mean, last = fit, fit.log_evidence, fit
    for part, strict in stricts.items():
        last = _with_part(bench, strict, part, last)
        mean = float(np.logaddexp(mean, last.log_evidence))
        best = max(best, last, key=lambda one: one.log_evidence)
    return _Weighed(fit=replace(best, log_evidence=fit.log_evidence), log_evidence=mean)


def _with_part(bench: InferenceProblem, strict: InferenceProblem, part: float, fit: Fit) -> Fit:
    """Fit again with a part of the tolerances; everything but the evidence is given for all of them."""
    nuisance = bench.nuisance
    hypothesis = strict.suppose(fit.hypothesis.causes)
    unknown = nuisance.in_parts(fit.unknown, part)
    again = polish(hypothesis, strict.data, fit.values, unknown=unknown, iterations=8, tolerance=0.1)
    back = nuisance.in_parts(again.unknown, 1 / part)
    pulls, _ = nuisance.pulls(back)
    white = bench.data.misfit(fit.hypothesis.respond(again.values, back, bench.data.measured.s))
    return replace(
        fit,
        values=again.values,
        unknown=back,
        misfit=float(white @ white),
        pull=float(pulls @ pulls),
        log_evidence=again.log_evidence + strict.data.whitening.log_density - bench.data.whitening.log_density,
    )


def look_elsewhere(bench: InferenceProblem, ranking: Ranking) -> Ranking:
    """Fit the most probable cause at other places, where it explains the test but needs too much of the tolerances.

    A short stiff spring between two nodes does nearly what a softer one between nodes farther apart does, and on the
    way from one to the other everything is worse. The frequencies of what explains the test already are right, whatever
    the place: every likely place is fitted from there.

    Parameters
    ----------
    bench : InferenceProblem
        Data and effects.
    ranking : Ranking
        Of a search.

    Returns
    -------
    Ranking
        With more fits.
    """
    best, base = ranking.best, ranking.base
    effect = best.hypothesis.causes[-1].effect
    starts = wide_search(replace(bench, effects={effect.name: effect}), base)
    fits: Fits = {fit.hypothesis.causes[-1].key: fit for fit in ranking.fits}
    weights = weights_of(bench.coarse, REFINED_ERROR)
    for start in [start for start in starts if start.cause.key not in fits][:FITTED]:
        hypothesis = bench.suppose((*base.hypothesis.causes, start.cause))
        moved, _ = refine(hypothesis, bench.coarse, weights, best.values)  # far from the axis, where all is smooth
        for values in (np.concatenate([base.values, start.values]), moved):
            unknown = same_modes(hypothesis, hypothesis.physical(hypothesis.start_at(values)), best)
            bar = bar_of(fits.values())
            keep(fits, polish(hypothesis, bench.data, values, unknown=unknown, iterations=ITERATIONS, bar=bar))
    climb_all(bench, base, fits)
    return replace(ranking, fits=ranked(bench, fits.values()), n_tried=ranking.n_tried + len(starts))
