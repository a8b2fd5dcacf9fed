"""Other places of a cause that explains the test but needs too much of the tolerances.

A short stiff spring between two nodes does nearly what a softer one between nodes farther apart does, and on the way
from one to the other everything is worse. The frequencies of what explains the test already are right, whatever
the place: every likely place is fitted from there.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.search.global_scan.grid_scan import wide_search
from frf_ipz.diagnosis.search.global_scan.refine import refine
from frf_ipz.diagnosis.search.global_scan.starts import REFINED_ERROR
from frf_ipz.diagnosis.search.inference_problem import weights_of
from frf_ipz.diagnosis.search.map_fit import polish, same_modes
from frf_ipz.diagnosis.search.neighbourhood_search import Fits, bar_of, climb_all
from frf_ipz.diagnosis.search.search import Ranking, keep, ranked

if TYPE_CHECKING:
    from frf_ipz.diagnosis.search.inference_problem import InferenceProblem

FITTED = 30  # places, by what a wide search says of them
ITERATIONS = 20


def look_elsewhere(bench: InferenceProblem, ranking: Ranking) -> Ranking:
    """Fit the most probable cause at other places.

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
