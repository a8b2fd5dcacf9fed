"""Findings from fits: which effects are how probable, at which places, with which numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.result import Estimate, Finding, doubt_of_place
from frf_ipz.diagnosis.search.component_search import by_effect

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.arrays import FloatArray
    from frf_ipz.diagnosis.evidence.fit import Fit

NORMAL_95 = 1.96
LISTED = 0.95  # probability that the listed places hold
MOST_PLACES = 12
INSIGNIFICANT = 2.0  # times a tolerance: a user's tolerances are half widths, not standard deviations


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Weighed:
    """An effect, with all its places weighed together.

    Parameters
    ----------
    fits : tuple of Fit
        Of one effect, by falling evidence.
    probability : float
        Of the effect, among all effects.
    shares : tuple of float
        Probability of each place, if it is this effect.
    """

    fits: tuple[Fit, ...]
    probability: float
    shares: tuple[float, ...]

    @property
    def best(self) -> Fit:
        """The fit at the most probable place."""
        return self.fits[0]

    @property
    def name(self) -> str:
        """The effect."""
        return self.best.hypothesis.causes[-1].effect.name


def weigh(fits: Sequence[Fit], scale: float) -> list[Weighed]:
    """Turn evidence into probabilities of effects.

    Parameters
    ----------
    fits : sequence of Fit
        Each with one cause more than is known.
    scale : float
        What differences of evidence are divided by: more than 1 where the best fit leaves more than noise.

    Returns
    -------
    list of Weighed
        By falling probability; the first is the best of its ranking.
    """
    if not fits:
        return []
    top = max(fit.log_evidence for fit in fits)
    found = []
    for group in by_effect(fits):
        weights = np.exp(np.maximum((np.array([fit.log_evidence for fit in group]) - top) / scale, -700.0))
        found.append((group, float(weights.sum()), tuple((weights / weights.sum()).tolist())))
    total = sum(weight for _, weight, _ in found)
    return [Weighed(fits=group, probability=weight / total, shares=shares) for group, weight, shares in found]


def finding_of(weighed: Weighed, gain: float, scale: float) -> Finding:
    """Describe the newest cause of a fit.

    Parameters
    ----------
    weighed : Weighed
        The effect.
    gain : float
        Its evidence over that without it, nats.
    scale : float
        As for `weigh`: intervals grow with its root.

    Returns
    -------
    Finding
        To report.
    """
    return describe(
        weighed.best, -1, weighed.probability, gain, scale, places=_places(weighed), across=_across_places(weighed)
    )


def _across_places(weighed: Weighed) -> FloatArray:
    """Variance, as searched, of the newest cause's parameters from place to place: the place is not certain either."""
    count = weighed.best.hypothesis.counts[-1]
    own = [
        (share, fit.hypothesis.start_at(fit.values)[len(fit.values) - count :])
        for fit, share in zip(weighed.fits, weighed.shares, strict=True)
        if fit.hypothesis.counts[-1] == count and count
    ]
    if not own:
        return np.zeros(count)
    off = np.array([values - own[0][1] for _, values in own])
    return np.asarray(np.array([share for share, _ in own]) @ off**2)


def describe(
    fit: Fit,
    which: int,
    probability: float,
    gain: float,
    scale: float,
    *,
    places: tuple[dict[str, object], ...],
    across: FloatArray | float = 0.0,
) -> Finding:
    """Describe one cause of a fit.

    Parameters
    ----------
    fit : Fit
        With one or more causes.
    which : int
        Index of the cause.
    probability : float
        Of the effect.
    gain : float
        Its evidence over that without it, nats.
    scale : float
        Intervals grow with its root.
    places : tuple of dict
        Where else it could be, the most probable first.
    across : (n_parameters,) array or float
        Variance of its parameters, as searched, from place to place.

    Returns
    -------
    Finding
        To report.
    """
    hypothesis = fit.hypothesis
    cause = hypothesis.causes[which]
    place = which % len(hypothesis.causes)
    numbers = _estimates(fit, place, scale, across)
    start = sum(hypothesis.counts[:place])
    return Finding(
        effect=cause.effect.name,
        location=dict(cause.place.location),
        parameters={**cause.place.text, **numbers},
        probability=probability,
        log_evidence_gain=gain,
        statement=cause.effect.statement(hypothesis.specimen, cause.place, numbers) + doubt_of_place(places),
        location_set=places,
        is_significant=is_significant(fit, place),
        key=cause.place.key,
        values=tuple(float(value) for value in fit.values[start : start + hypothesis.counts[place]]),
    )


def _places(weighed: Weighed) -> tuple[dict[str, object], ...]:
    found: list[dict[str, object]] = []
    total = 0.0
    for fit, share in zip(weighed.fits[:MOST_PLACES], weighed.shares, strict=False):
        location = dict(fit.hypothesis.causes[-1].place.location)
        if location not in found:
            found.append(location)
        total += share
        if total >= LISTED:
            break
    return tuple(found)


def _estimates(fit: Fit, which: int, scale: float, across: FloatArray | float) -> dict[str, Estimate]:
    hypothesis = fit.hypothesis
    cause, start = hypothesis.causes[which], sum(hypothesis.counts[:which])
    variance = np.maximum(scale, 1.0) * np.maximum(np.diag(fit.covariance), 0.0)
    variance[start : start + hypothesis.counts[which]] += across
    spread = np.sqrt(variance)
    spread = np.minimum(spread, hypothesis.high - hypothesis.low)  # where data say nothing, the range still does
    found = {}
    for index in range(start, start + hypothesis.counts[which]):
        parameter, value = hypothesis.parameters[index], float(fit.values[index])
        std = float(spread[index])
        if parameter.is_log:
            ends = value * np.exp(-NORMAL_95 * std), value * np.exp(NORMAL_95 * std)
            std *= abs(value)
        else:
            std *= parameter.high - parameter.low
            ends = value - NORMAL_95 * std, value + NORMAL_95 * std
        low, high = sorted(cause.effect.reported(cause.place, parameter.name, float(end)) for end in ends)
        shown = cause.effect.reported(cause.place, parameter.name, value)
        found[parameter.name] = Estimate(value=shown, std=std, low=low, high=high)
    return found


def is_significant(fit: Fit, which: int) -> bool:
    """Tell whether a cause is larger than a user's tolerances.

    Parameters
    ----------
    fit : Fit
        With the cause.
    which : int
        Its index.

    Returns
    -------
    bool
        False where every parameter lies within its tolerance.
    """
    hypothesis = fit.hypothesis
    which %= len(hypothesis.causes)
    start = sum(hypothesis.counts[:which])
    own = range(start, start + hypothesis.counts[which])
    stated = [index for index in own if hypothesis.parameters[index].tolerance > 0]
    if not stated:
        return True
    return any(
        abs(fit.values[index] - hypothesis.parameters[index].neutral)
        > INSIGNIFICANT * hypothesis.parameters[index].tolerance
        for index in stated
    )
