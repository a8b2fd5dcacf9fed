"""Places that may explain a test as well as the best that a search came to.

A search steps to better places and stops where none is; what is as good on the far side of a structure, or along a
flat valley, it need not have seen. Without these a place looks surer than it is, and now and then the best of them is
what caused the mismatch.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from frf_ipz.diagnosis.search.global_scan.grid_scan import wide_search
from frf_ipz.diagnosis.search.global_scan.starts import spread
from frf_ipz.diagnosis.search.neighbourhood_search import GAIN, Fits, bar_of, climb_all, fit_from_neighbour

if TYPE_CHECKING:
    from collections.abc import Container, Iterable

    from frf_ipz.diagnosis.search.fit import Fit
    from frf_ipz.diagnosis.search.hypothesis import Cause
    from frf_ipz.diagnosis.search.inference_problem import InferenceProblem
    from frf_ipz.diagnosis.search.search import Ranking

FAR = 8  # places anywhere, not beside each other, by what a wide search says of them
EQUAL, MOST_EQUAL = 1.1, 4  # times the best cost there: places as good as the best, though beside it, and how many


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
