"""Refines where a wide search led to, steps to better places, and comes half the way back to the axis.

Far from the axis every step down leads on: near it, only the right place has a way. Half-way, values are exact enough
for a fit near the axis to find narrow peaks.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from frf_ipz.diagnosis.search.global_scan.refine import refine
from frf_ipz.diagnosis.search.global_scan.signatures import Start
from frf_ipz.diagnosis.search.hypothesis import Cause
from frf_ipz.diagnosis.search.inference_problem import InferenceProblem, weights_of

if TYPE_CHECKING:
    from frf_ipz.diagnosis.measured.transfer_functions import TransferFunctions
    from frf_ipz.diagnosis.search.fit import Fit

Supposed: TypeAlias = tuple[tuple[Cause, ...], Start]
"""What is supposed already, and one more cause with the values of all."""

REFINED_ERROR = 0.01  # of an FRF's size: what counts as a misfit after the wide search
PLACES_EACH = 3  # of an effect that are refined
STEPPED, NOT_FAR = 8, 4.0  # hypotheses whose neighbours are looked at far from the axis, and times the best cost
STEPPED_CLOSER = 3  # the same half-way to the axis
NEAR = 2  # nodes or elements: places so near count as one there
MOST_STEPS = 12
GAIN = 0.5  # nats: a neighbour must be better by that


def refine_far(bench: InferenceProblem, base: Fit, starts: Sequence[Start]) -> list[Start]:
    """Refine the best starts of a wide search, and step to better places.

    Parameters
    ----------
    bench : InferenceProblem
        Data and effects.
    base : Fit
        What is supposed already.
    starts : sequence of Start
        By rising cost.

    Returns
    -------
    list of Start
        With the values of all causes, by rising cost.
    """
    weights = weights_of(bench.coarse, REFINED_ERROR)
    found = []
    for start in spread(starts, PLACES_EACH):
        hypothesis = bench.suppose((*base.hypothesis.causes, start.cause))
        values, cost = refine(hypothesis, bench.coarse, weights, np.concatenate([base.values, start.values]))
        found.append(Start(cause=start.cause, values=values, cost=cost))
    found.sort(key=lambda start: start.cost)
    stepped = [
        step_far(bench, base.hypothesis.causes, start)
        for start in found[:STEPPED]
        if start.cost < NOT_FAR * found[0].cost
    ]
    best: dict[tuple[object, ...], Start] = {}
    for start in sorted([*stepped, *found[len(stepped) :]], key=lambda start: start.cost):
        best.setdefault(start.cause.key, start)
    return list(best.values())


def bring_closer(bench: InferenceProblem, starts: Sequence[Supposed]) -> list[Supposed]:
    """Bring starts half the way to the axis: their values, and the places of the best.

    Parameters
    ----------
    bench : InferenceProblem
        Data and effects.
    starts : sequence of (tuple of Cause, Start)
        Each with what is supposed besides.

    Returns
    -------
    list of (tuple of Cause, Start)
        By rising cost half-way.
    """
    weights = weights_of(bench.middle, REFINED_ERROR)
    closer = []
    for known, start in starts:
        values, cost = refine(bench.suppose((*known, start.cause)), bench.middle, weights, start.values)
        closer.append((known, Start(cause=start.cause, values=values, cost=cost)))
    closer.sort(key=lambda one: one[1].cost)
    best = [(known, _step(bench, known, start, bench.middle)) for known, start in closer[:STEPPED_CLOSER]]
    return sorted([*best, *closer[STEPPED_CLOSER:]], key=lambda one: one[1].cost)


def step_far(bench: InferenceProblem, known: tuple[Cause, ...], start: Start) -> Start:
    """Step to neighbours far from the axis, where every step down leads on: near it, only the right place has a way.

    Parameters
    ----------
    bench : InferenceProblem
        Data and effects.
    known : tuple of Cause
        What is supposed besides, at the same places.
    start : Start
        With the values of all.

    Returns
    -------
    Start
        The same cause at a better place.
    """
    return _step(bench, known, start, bench.coarse)


def _step(bench: InferenceProblem, known: tuple[Cause, ...], start: Start, measured: TransferFunctions) -> Start:
    weights = weights_of(measured, REFINED_ERROR)
    seen = {start.cause.key}
    for _ in range(MOST_STEPS):
        better = start
        for place in start.cause.effect.neighbours(bench.specimen, start.cause.place):
            cause = Cause(effect=start.cause.effect, place=place, n_places=start.cause.n_places)
            hypothesis = bench.suppose((*known, cause))
            if cause.key in seen or len(hypothesis.parameters) != len(start.values):
                continue
            seen.add(cause.key)
            values, cost = refine(hypothesis, measured, weights, start.values, iterations=3)
            if cost < better.cost - GAIN:
                better = Start(cause=cause, values=values, cost=cost)
        if better is start:
            break
        start = better
    return start


def spread(starts: Iterable[Start], each: int) -> list[Start]:
    """Take the best places of each effect that are not beside each other.

    Parameters
    ----------
    starts : iterable of Start
        By rising cost.
    each : int
        How many of each effect.

    Returns
    -------
    list of Start
        Those taken, by effect.
    """
    taken: dict[str, list[Start]] = {}
    for start in starts:
        mine = taken.setdefault(start.cause.effect.name, [])
        if len(mine) < each and not any(_beside(start.cause, other.cause) for other in mine):
            mine.append(start)
    return [start for mine in taken.values() for start in mine]


def _beside(first: Cause, second: Cause) -> bool:
    if len(first.place.key) != len(second.place.key):
        return False
    pairs = list(zip(first.place.key, second.place.key, strict=True))
    numbers = [abs(a - b) for a, b in pairs if isinstance(a, int) and isinstance(b, int)]
    others_agree = all(a == b for a, b in pairs if not (isinstance(a, int) and isinstance(b, int)))
    return others_agree and bool(numbers) and max(numbers) <= NEAR
