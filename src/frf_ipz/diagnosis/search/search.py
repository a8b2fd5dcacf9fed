"""Finds the causes that explain the measurement best: wide search, refinement, exact fits, steps to neighbours."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.diagnosis.catalogue.effect import Effect
from frf_ipz.diagnosis.search.hypothesis import Cause, Hypothesis, suppose
from frf_ipz.diagnosis.search.polish import Data, Fit, polish
from frf_ipz.diagnosis.search.refine import refine, robust_misfit
from frf_ipz.diagnosis.search.sketches import Start, search_sketches

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.specimen import Specimen
    from frf_ipz.diagnosis.measured.transfer import Measured
    from frf_ipz.diagnosis.physics.nuisance import Nuisance

WIDE_ERROR, REFINED_ERROR = 0.02, 0.01  # of an FRF's size: what counts as a misfit in the wide search, and after
PLACES_EACH = 3  # of an effect that are refined
NEAR = 2  # nodes or elements: places so near count as one there
FITTED = 12  # hypotheses that are fitted exactly
CLIMBED = 6  # effects whose neighbours are looked at
HOPELESS = 2000.0  # nats behind the best: not looked at any more
GAIN = 0.5  # nats: a neighbour must be better by that
MOST_STEPS = 12


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Bench:
    """Everything a search works with.

    Parameters
    ----------
    specimen : Specimen
        What is tested.
    nuisance : Nuisance
        What cannot be known.
    effects : mapping of str to Effect
        What is looked for.
    coarse : Measured
        Transfer functions far from the axis.
    data : Data
        Those near the axis, with their errors.
    early : Data
        The same, with larger errors: for first steps.
    """

    specimen: Specimen
    nuisance: Nuisance
    effects: Mapping[str, Effect]
    coarse: Measured
    data: Data
    early: Data

    def weights(self, error: float) -> FloatArray:
        """Weights of squared misfits far from the axis, for a relative error of the model."""
        noise = np.array([np.diag(covariance).real for covariance in self.coarse.covariance]).T
        return np.asarray(1 / ((error * self.coarse.size) ** 2 + noise))

    def suppose(self, causes: tuple[Cause, ...], *, exact: bool = True) -> Hypothesis:
        """Make a hypothesis."""
        return suppose(self.specimen, self.nuisance, causes, exact=exact)

    def fit(self, causes: tuple[Cause, ...], values: FloatArray, unknown: FloatArray | None = None) -> Fit:
        """Fit causes, from values and what cannot be known."""
        hypothesis = self.suppose(causes)
        if unknown is None:
            first = polish(hypothesis, self.early, values, iterations=6, tolerance=1.0)
            values, unknown = first.values, first.unknown
        return polish(hypothesis, self.data, values, unknown=unknown, iterations=10)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ranking:
    """What a search found.

    Parameters
    ----------
    base : Fit
        What was supposed before: the nominal model, or a cause that is known already.
    fits : tuple of Fit
        Each one more cause, by falling evidence.
    n_tried : int
        Hypotheses that were looked at.
    """

    base: Fit
    fits: tuple[Fit, ...]
    n_tried: int

    @property
    def best(self) -> Fit:
        """The one with the largest evidence; the base where nothing was found."""
        return self.fits[0] if self.fits else self.base

    def by_effect(self) -> dict[str, Fit]:
        """Give the best fit of each effect, by falling evidence."""
        found: dict[str, Fit] = {}
        for fit in self.fits:
            found.setdefault(fit.hypothesis.causes[-1].effect.name, fit)
        return found


def fit_nothing(bench: Bench) -> Fit:
    """Fit the nominal model with what cannot be known."""
    return bench.fit((), np.zeros(0))


def search(bench: Bench, base: Fit) -> Ranking:
    """Search for one more cause.

    Parameters
    ----------
    bench : Bench
        Data and effects.
    base : Fit
        What is supposed already.

    Returns
    -------
    Ranking
        All that was fitted.
    """
    starts = wide_search(bench, base)
    refined = _refined(bench, base, starts)
    fits = _fitted(bench, base, refined)
    fits = _climbed(bench, base, fits)
    ranked = sorted(fits.values(), key=lambda fit: -fit.log_evidence)
    return Ranking(base=base, fits=tuple(ranked), n_tried=len(starts))


def wide_search(bench: Bench, base: Fit) -> list[Start]:
    """Look at all effects at all places for many values.

    Parameters
    ----------
    bench : Bench
        Data and effects.
    base : Fit
        What is supposed already.

    Returns
    -------
    list of Start
        The best values of each cause, by rising cost.
    """
    specimen = bench.specimen
    causes = [cause for effect in bench.effects.values() for cause in causes_of(effect, specimen)]
    sketches = [cause.effect.sketch(specimen, cause.place) for cause in causes]
    weights = bench.weights(WIDE_ERROR)
    response = base.hypothesis.respond(base.values, np.zeros(bench.nuisance.size), specimen.contour)
    sketched = [(cause, sketch) for cause, sketch in zip(causes, sketches, strict=True) if sketch is not None]
    found = search_sketches(
        [cause for cause, _ in sketched],
        [sketch for _, sketch in sketched],
        response,
        base.hypothesis.basis,
        specimen.layout,
        bench.coarse,
        weights,
    )
    direct = [cause for cause, sketch in zip(causes, sketches, strict=True) if sketch is None]
    found += [_best_start(bench, base, cause, weights) for cause in direct]
    return sorted(found, key=lambda start: start.cost)


def causes_of(effect: Effect, specimen: Specimen) -> list[Cause]:
    """Give an effect at all its places."""
    places = effect.places(specimen)
    return [Cause(effect=effect, place=place, n_places=len(places)) for place in places]


def _best_start(bench: Bench, base: Fit, cause: Cause, weights: FloatArray) -> Start:
    hypothesis = bench.suppose((*base.hypothesis.causes, cause), exact=False)
    unknown = np.zeros(bench.nuisance.size)
    n_own = hypothesis.counts[-1]
    grid = cause.effect.starts(bench.specimen, cause.place) if n_own else np.zeros((1, 0))
    costs = []
    for values in grid:
        response = hypothesis.respond(np.concatenate([base.values, values]), unknown, bench.specimen.contour)
        costs.append(robust_misfit(bench.coarse.values - response.values, weights))
    place = int(np.argmin(costs))
    return Start(cause=cause, values=grid[place], cost=costs[place])


def _refined(bench: Bench, base: Fit, starts: Sequence[Start]) -> list[Start]:
    weights = bench.weights(REFINED_ERROR)
    found = []
    for start in _spread(starts, PLACES_EACH):
        hypothesis = bench.suppose((*base.hypothesis.causes, start.cause))
        values, cost = refine(hypothesis, bench.coarse, weights, np.concatenate([base.values, start.values]))
        found.append(Start(cause=start.cause, values=values, cost=cost))
    return sorted(found, key=lambda start: start.cost)


def _spread(starts: Iterable[Start], each: int) -> list[Start]:
    """Take the best places of each effect that are not beside each other."""
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


def _fitted(bench: Bench, base: Fit, refined: Sequence[Start]) -> dict[tuple[object, ...], Fit]:
    fits: dict[tuple[object, ...], Fit] = {}
    best = -np.inf
    for start in refined[:FITTED]:
        fit = bench.fit((*base.hypothesis.causes, start.cause), start.values)
        fits[start.cause.key] = fit
        best = max(best, fit.log_evidence)
    return fits


def _climbed(bench: Bench, base: Fit, fits: dict[tuple[object, ...], Fit]) -> dict[tuple[object, ...], Fit]:
    """Step to neighbours as long as that makes an effect more probable."""
    ranked = sorted(fits.values(), key=lambda fit: -fit.log_evidence)
    leaders: dict[str, Fit] = {}
    for fit in ranked:
        leaders.setdefault(fit.hypothesis.causes[-1].effect.name, fit)
    for leader in list(leaders.values())[:CLIMBED]:
        best = max(fit.log_evidence for fit in fits.values())
        if leader.log_evidence > best - HOPELESS:
            _climb(bench, base, leader, fits)
    return fits


def _climb(bench: Bench, base: Fit, fit: Fit, fits: dict[tuple[object, ...], Fit]) -> None:
    for _ in range(MOST_STEPS):
        cause = fit.hypothesis.causes[-1]
        better = fit
        for place in cause.effect.neighbours(bench.specimen, cause.place):
            other = Cause(effect=cause.effect, place=place, n_places=cause.n_places)
            if other.key in fits:
                tried = fits[other.key]
            else:
                tried = fits[other.key] = _from_neighbour(bench, base, other, fit)
            if tried.log_evidence > better.log_evidence + GAIN:
                better = tried
        if better is fit:
            return
        fit = better


def _from_neighbour(bench: Bench, base: Fit, cause: Cause, fit: Fit) -> Fit:
    causes = (*base.hypothesis.causes, cause)
    hypothesis = bench.suppose(causes)
    if len(hypothesis.parameters) == len(fit.values):
        return polish(hypothesis, bench.data, fit.values, unknown=fit.unknown, iterations=6, tolerance=0.2)
    start = _best_start(bench, base, cause, bench.weights(REFINED_ERROR))
    values, _ = refine(
        hypothesis, bench.coarse, bench.weights(REFINED_ERROR), np.concatenate([base.values, start.values])
    )
    return bench.fit(causes, values)
