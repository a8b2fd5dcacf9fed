"""Two causes at once.

Where one cause explains nearly everything, the second is searched on top of it, and then the first anew. Where it does
not, it may be the wrong one: then several first causes get companions far from the axis, where all is smooth, and the
best pairs are fitted.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.search.bench import Bench, weights_of
from frf_ipz.diagnosis.search.polish import Fit, polish
from frf_ipz.diagnosis.search.refine import refine
from frf_ipz.diagnosis.search.search import (
    NEARLY_RIGHT,
    REFINED_ERROR,
    Fits,
    Ranking,
    climb_all,
    ranked,
    search,
    spread,
)
from frf_ipz.diagnosis.search.sketches import Start
from frf_ipz.diagnosis.search.wide import wide_search

if TYPE_CHECKING:
    from collections.abc import Callable

    from frf_ipz.diagnosis.search.hypothesis import Cause

FIRSTS = 5  # causes that get companions
COMPANIONS = 4  # of each that are refined
EARLY_PAIRS, EXACT_PAIRS = 6, 3  # that are fitted with large errors, and exactly
GAIN = 0.5  # nats


def search_second(bench: Bench, first: Ranking, is_good: Callable[[Fit], bool]) -> Ranking:
    """Search for two causes.

    Parameters
    ----------
    bench : Bench
        Data and effects.
    first : Ranking
        Of one cause.
    is_good : callable
        Tells whether a fit leaves nothing to explain: then the first cause needs no second look.

    Returns
    -------
    Ranking
        Its base has one cause, its fits have two.
    """
    size = 2 * bench.data.measured.values.size
    if first.best.misfit > NEARLY_RIGHT * size and first.refined:
        return _of_pairs(bench, first)
    beside = search(bench, first.best)
    if not beside.fits or is_good(beside.best):
        return beside
    exchanged = search(bench, _newest_alone(bench, beside.best))
    return exchanged if exchanged.best.log_evidence > beside.best.log_evidence + GAIN else beside


def _newest_alone(bench: Bench, fit: Fit) -> Fit:
    count = fit.hypothesis.counts[-1]
    return bench.fit((fit.hypothesis.causes[-1],), fit.values[len(fit.values) - count :])


def _of_pairs(bench: Bench, first: Ranking) -> Ranking:
    pairs: list[tuple[Cause, Start]] = []
    for start in spread(first.refined, 1)[:FIRSTS]:
        pairs += [(start.cause, both) for both in _companions(bench, start)]
    pairs.sort(key=lambda pair: pair[1].cost)
    early = [bench.fit_early((cause, both.cause), both.values) for cause, both in pairs[:EARLY_PAIRS]]
    early.sort(key=lambda fit: fit.cost)
    exact = [bench.fit_from(fit) for fit in early[:EXACT_PAIRS]]
    best = max(exact, key=lambda fit: fit.log_evidence)
    best = _climbed(bench, _climbed(bench, best))
    base = bench.fit(best.hypothesis.causes[:1], best.values[: best.hypothesis.counts[0]])
    fits: Fits = {best.hypothesis.causes[-1].key: best}
    climb_all(bench, base, fits)
    return Ranking(base=base, fits=ranked(bench, fits), n_tried=first.n_tried * FIRSTS)


def _companions(bench: Bench, start: Start) -> list[Start]:
    """Find what explains most beside a cause, far from the axis."""
    base = polish(bench.suppose((start.cause,)), bench.early, start.values, iterations=1)
    starts = [one for one in wide_search(bench, base) if one.cause.key != start.cause.key]
    weights = weights_of(bench.coarse, REFINED_ERROR)
    found = []
    for one in sorted(spread(starts, 1), key=lambda one: one.cost)[:COMPANIONS]:
        hypothesis = bench.suppose((start.cause, one.cause))
        values, cost = refine(hypothesis, bench.coarse, weights, np.concatenate([base.values, one.values]))
        found.append(Start(cause=one.cause, values=values, cost=cost))
    return found


def _climbed(bench: Bench, fit: Fit) -> Fit:
    """Exchange the two causes and step the new last one to better places."""
    hypothesis = fit.hypothesis
    count = hypothesis.counts[0]
    values = np.concatenate([fit.values[count:], fit.values[:count]])
    turned = polish(
        bench.suppose(hypothesis.causes[::-1]), bench.data, values, unknown=fit.unknown, iterations=4, tolerance=0.5
    )
    alone = bench.fit_early(turned.hypothesis.causes[:1], turned.values[: turned.hypothesis.counts[0]])
    fits: Fits = {turned.hypothesis.causes[-1].key: turned}
    climb_all(bench, alone, fits)
    return max(fits.values(), key=lambda one: one.log_evidence)
