"""Wide search for large effects, all of them at all places for many values, far from the axis.

Everything is smooth there, and misfits count by their logarithm.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.diagnosis.search.global_scan.refine import robust_misfit
from frf_ipz.diagnosis.search.global_scan.signatures import Start, search_sketches
from frf_ipz.diagnosis.search.hypothesis import Cause
from frf_ipz.diagnosis.search.inference_problem import InferenceProblem, weights_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.diagnosis.catalogue.effect import Effect
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.measured.transfer_functions import TransferFunctions
    from frf_ipz.diagnosis.physics.response import Response
    from frf_ipz.diagnosis.search.fit import Fit

WIDE_ERROR = 0.02  # of an FRF's size: what counts as a misfit far from the axis
SCATTER_ERROR = 0.1  # the same where scatter was fitted
LOOKED_AROUND = 16  # places of each effect: where not all places are looked at, those beside the best are


def wide_search(bench: InferenceProblem, base: Fit) -> list[Start]:
    """Look for large effects, far from the axis.

    Parameters
    ----------
    bench : InferenceProblem
        Data and effects.
    base : Fit
        What is supposed already.

    Returns
    -------
    list of Start
        The best values of each cause, by rising cost.
    """
    return _search(bench, bench.specimen, bench.coarse, base, np.zeros(bench.nuisance.size), WIDE_ERROR)


def search_among_scatter(bench: InferenceProblem, base: Fit) -> list[Start]:
    """Look for large effects half-way to the axis, beside the scatter that was fitted without them.

    Scatter takes up what shifts natural frequencies; what it cannot, stands out.

    Parameters
    ----------
    bench : InferenceProblem
        Data and effects.
    base : Fit
        What is supposed already.

    Returns
    -------
    list of Start
        The best values of each cause, by rising cost.
    """
    specimen = replace(bench.specimen, contour=bench.middle.s)
    return _search(bench, specimen, bench.middle, base, base.unknown, SCATTER_ERROR)


def causes_of(effect: Effect, specimen: ModelContext) -> list[Cause]:
    """Give an effect at all its places.

    Parameters
    ----------
    effect : Effect
        What.
    specimen : ModelContext
        What is tested.

    Returns
    -------
    list of Cause
        One a place.
    """
    places = effect.places(specimen)
    return [Cause(effect=effect, place=place, n_places=len(places)) for place in places]


def _search(
    bench: InferenceProblem,
    specimen: ModelContext,
    measured: TransferFunctions,
    base: Fit,
    unknown: FloatArray,
    error: float,
) -> list[Start]:
    causes = [cause for effect in bench.effects.values() for cause in causes_of(effect, specimen)]
    weights = weights_of(measured, error)
    response = base.hypothesis.respond(base.values, unknown, measured.s)
    sketch = partial(_sketched, specimen, measured, base, response, weights)
    found, direct = sketch(causes)
    found.sort(key=lambda start: start.cost)
    found += sketch(_between(specimen, causes, found))[0]
    found += [best_start(bench, base, cause, measured, weights, unknown) for cause in direct]
    return sorted(found, key=lambda start: start.cost)


def _sketched(
    specimen: ModelContext,
    measured: TransferFunctions,
    base: Fit,
    response: Response,
    weights: FloatArray,
    causes: Sequence[Cause],
) -> tuple[list[Start], list[Cause]]:
    """Find the best values of causes that can be sketched, and which ones cannot."""
    sketches = [cause.effect.sketch(specimen, cause.place) for cause in causes]
    drawn = [(cause, sketch) for cause, sketch in zip(causes, sketches, strict=True) if sketch is not None]
    found = search_sketches(
        [cause for cause, _ in drawn], [sketch for _, sketch in drawn], response, base.hypothesis.basis,
        specimen.layout, measured, weights,
    )  # fmt: skip
    return found, [cause for cause, sketch in zip(causes, sketches, strict=True) if sketch is None]


def _between(specimen: ModelContext, causes: Sequence[Cause], starts: Sequence[Start]) -> list[Cause]:
    """Give the places beside the best of each effect that are none of those where it was looked for."""
    seen = {cause.key for cause in causes}
    counts, found = Counter[str](), list[Cause]()
    for start in starts:
        effect = start.cause.effect
        counts[effect.name] += 1
        if counts[effect.name] > LOOKED_AROUND:
            continue
        for place in effect.neighbours(specimen, start.cause.place):
            cause = Cause(effect=effect, place=place, n_places=start.cause.n_places)
            if cause.key not in seen:
                seen.add(cause.key)
                found.append(cause)
    return found


def best_start(
    bench: InferenceProblem,
    base: Fit,
    cause: Cause,
    measured: TransferFunctions,
    weights: FloatArray,
    unknown: FloatArray,
) -> Start:
    """Try the values that an effect proposes to start from.

    Parameters
    ----------
    bench : InferenceProblem
        Data and effects.
    base : Fit
        What is supposed already.
    cause : Cause
        Effect and place.
    measured : TransferFunctions
        Transfer functions.
    weights : (n_points, n_frfs) array
        Over the squared misfit.
    unknown : (n_nuisance,) array
        What cannot be known, in standard deviations.

    Returns
    -------
    Start
        The best of them.
    """
    hypothesis = bench.suppose((*base.hypothesis.causes, cause), exact=False)
    grid = cause.effect.starts(bench.specimen, cause.place)
    costs = []
    for values in grid:
        response = hypothesis.respond(np.concatenate([base.values, values]), unknown, measured.s)
        costs.append(robust_misfit(measured.values - response.values, weights))
    place = int(np.argmin(costs))
    return Start(cause=cause, values=grid[place], cost=costs[place])
