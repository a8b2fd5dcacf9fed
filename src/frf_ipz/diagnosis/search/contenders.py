"""Places that may explain a test as well as the best that a search came to: all are fitted, so that none goes unseen.

A search steps to better places and stops where none is; what is as good on the far side of a structure, or along a
flat valley, it need not have seen. Without these a place looks surer than it is, and now and then the best of them is
what caused the mismatch.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from frf_ipz.diagnosis.search.climb import Fits, bar_of, fit_from_neighbour
from frf_ipz.diagnosis.search.far.starts import spread
from frf_ipz.diagnosis.search.far.wide import wide_search
from frf_ipz.diagnosis.search.search import Ranking, ranked

if TYPE_CHECKING:
    from frf_ipz.diagnosis.search.bench import Bench
    from frf_ipz.diagnosis.search.fit import Fit
    from frf_ipz.diagnosis.search.hypothesis import Cause

TIE = 8.0  # nats behind the best: so near, what is beside it may be as good
MOST = 30  # places that are fitted beside those
FAR = 8  # places anywhere, not beside each other, by what a wide search says of them


def fit_contenders(bench: Bench, ranking: Ranking) -> Ranking:
    """Fit the places beside all that is about as good as the best, and likely ones elsewhere.

    Parameters
    ----------
    bench : Bench
        Data and effects.
    ranking : Ranking
        Of a search, with one fit at least.

    Returns
    -------
    Ranking
        With more fits.
    """
    fits: Fits = {fit.hypothesis.causes[-1].key: fit for fit in ranking.fits}
    n_left = _flood(bench, ranking.base, fits, MOST)
    n_starts = _fit_far(bench, ranking, fits)
    _flood(bench, ranking.base, fits, n_left)
    return replace(ranking, fits=ranked(bench, fits.values()), n_tried=ranking.n_tried + n_starts)


def _flood(bench: Bench, base: Fit, fits: Fits, most: int) -> int:
    """Fit neighbours of what is nearly the best until there are none; give how many more might have been fitted."""
    while most and (found := _next(bench, fits)):
        cause, beside = found
        fits[cause.key] = fit_from_neighbour(bench, base, cause, beside, bar_of(fits.values()))
        most -= 1
    return most


def _next(bench: Bench, fits: Fits) -> tuple[Cause, Fit] | None:
    """Choose a place that was not fitted beside the best one that has such."""
    near = sorted(fits.values(), key=lambda fit: -fit.log_evidence)
    for fit in near:
        if fit.log_evidence < near[0].log_evidence - TIE:
            return None
        cause = fit.hypothesis.causes[-1]
        for place in cause.effect.neighbours(bench.specimen, cause.place):
            other = replace(cause, place=place)
            if other.key not in fits:
                return other, fit
    return None


def _fit_far(bench: Bench, ranking: Ranking, fits: Fits) -> int:
    """Fit the most probable effect wherever a wide search finds it likely; give how many places that looked at."""
    best = ranking.best
    effect = best.hypothesis.causes[-1].effect
    starts = wide_search(replace(bench, effects={effect.name: effect}), ranking.base)
    for start in spread(starts, FAR):
        if start.cause.key not in fits:
            bar = bar_of(fits.values())
            fits[start.cause.key] = fit_from_neighbour(bench, ranking.base, start.cause, best, bar)
    return len(starts)
