"""Findings from fits: effects with their probability, locations and parameters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import expit

from frf_ipz.diagnosis.result import (
    LISTED_PROBABILITY,
    MAX_LOCATIONS,
    NORMAL_95,
    Estimate,
    Finding,
    describe_location_set,
    with_confidence,
)
from frf_ipz.diagnosis.search.component_search import group_by_effect

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.arrays import FloatArray
    from frf_ipz.diagnosis.evidence.fit import Fit
    from frf_ipz.diagnosis.location import Location

INSIGNIFICANT_RATIO = 2.0  # times a tolerance: a user's tolerances are half widths, not standard deviations


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RankedEffect:
    """An effect with all its locations together.

    Parameters
    ----------
    fits : tuple of Fit
        Of one effect, by falling evidence.
    probability : float
        Of the effect, among all effects.
    shares : tuple of float
        Probability of each location, if it is this effect.
    """

    fits: tuple[Fit, ...]
    probability: float
    shares: tuple[float, ...]

    @property
    def best(self) -> Fit:
        """The fit at the most probable location."""
        return self.fits[0]

    @property
    def name(self) -> str:
        """The effect."""
        return self.best.hypothesis.components[-1].effect.name


def rank_effects(fits: Sequence[Fit], scale: float) -> list[RankedEffect]:
    """Turn evidence into probabilities of effects.

    Parameters
    ----------
    fits : sequence of Fit
        Each with one component more than their base.
    scale : float
        Divisor of differences of log evidence: more than 1 where the best fit leaves more than noise.

    Returns
    -------
    list of RankedEffect
        By falling probability; the first is the best of its ranking.
    """
    if not fits:
        return []
    top = max(fit.log_evidence for fit in fits)
    groups = []
    for group in group_by_effect(fits):
        weights = np.exp(np.maximum((np.array([fit.log_evidence for fit in group]) - top) / scale, -700.0))
        groups.append((group, float(weights.sum()), tuple((weights / weights.sum()).tolist())))
    total = sum(weight for _, weight, _ in groups)
    return [RankedEffect(fits=group, probability=weight / total, shares=shares) for group, weight, shares in groups]


def make_finding(ranked_effect: RankedEffect, gain: float, scale: float) -> Finding:
    """Describe the newest component of a fit.

    Parameters
    ----------
    ranked_effect : RankedEffect
        The effect.
    gain : float
        Its log Bayes factor over the fit without it.
    scale : float
        As for `rank_effects`: intervals grow with its root.

    Returns
    -------
    Finding
        To report.
    """
    return describe_component(
        ranked_effect.best,
        -1,
        min(ranked_effect.probability, probability_of_need(gain, scale)),
        gain,
        scale,
        location_set=_location_set(ranked_effect),
        across=_variance_across_locations(ranked_effect),
    )


def _variance_across_locations(ranked_effect: RankedEffect) -> FloatArray:
    """Variance of the newest component's parameters, in search coordinates, over its possible locations."""
    count = ranked_effect.best.hypothesis.counts[-1]
    values_at = [
        (share, fit.hypothesis.clip_to_searched(fit.values)[len(fit.values) - count :])
        for fit, share in zip(ranked_effect.fits, ranked_effect.shares, strict=True)
        if fit.hypothesis.counts[-1] == count and count
    ]
    if not values_at:
        return np.zeros(count)
    deviations = np.array([values - values_at[0][1] for _, values in values_at])
    return np.asarray(np.array([share for share, _ in values_at]) @ deviations**2)


def describe_component(
    fit: Fit,
    which: int,
    probability: float,
    gain: float,
    scale: float,
    *,
    location_set: tuple[Location, ...],
    across: FloatArray | float = 0.0,
) -> Finding:
    """Describe one component of a fit.

    Parameters
    ----------
    fit : Fit
        With one or more components.
    which : int
        Index of the component.
    probability : float
        Of the effect.
    gain : float
        Its log Bayes factor over the fit without it.
    scale : float
        Intervals grow with its root.
    location_set : tuple of Location
        Its possible locations, the most probable first.
    across : (n_parameters,) array or float
        Variance of its parameters over its possible locations, in search coordinates.

    Returns
    -------
    Finding
        To report.
    """
    hypothesis = fit.hypothesis
    component = hypothesis.components[which]
    index = which % len(hypothesis.components)
    estimates = _estimate_parameters(fit, index, scale, across)
    start = sum(hypothesis.counts[:index])
    return Finding(
        effect=component.effect.name,
        location=component.location,
        parameters={**component.effect.texts(component.location), **estimates},
        probability=probability,
        log_evidence_gain=gain,
        statement=with_confidence(
            component.effect.statement(hypothesis.context, component.location, estimates), probability
        )
        + describe_location_set(location_set),
        location_set=location_set,
        is_significant=is_significant(fit, index),
        values=tuple(float(value) for value in fit.values[start : start + hypothesis.counts[index]]),
    )


def probability_of_need(gain: float, scale: float) -> float:
    """Give the probability that an effect is needed beside what else was found: even before the measurement.

    Parameters
    ----------
    gain : float
        Its log Bayes factor over the fit without it.
    scale : float
        As for `rank_effects`.

    Returns
    -------
    float
        Below one half where the evidence speaks against it.
    """
    return float(expit(gain / scale))


def _location_set(ranked_effect: RankedEffect) -> tuple[Location, ...]:
    locations: list[Location] = []
    total = 0.0
    for fit, share in zip(ranked_effect.fits[:MAX_LOCATIONS], ranked_effect.shares, strict=False):
        location = fit.hypothesis.components[-1].location.place
        if location not in locations:
            locations.append(location)
        total += share
        if total >= LISTED_PROBABILITY:
            break
    return tuple(locations)


def _estimate_parameters(fit: Fit, which: int, scale: float, across: FloatArray | float) -> dict[str, Estimate]:
    hypothesis = fit.hypothesis
    component, start = hypothesis.components[which], sum(hypothesis.counts[:which])
    variance = np.maximum(scale, 1.0) * np.maximum(np.diag(fit.covariance), 0.0)
    variance[start : start + hypothesis.counts[which]] += across
    spread = np.sqrt(variance)
    spread = np.minimum(spread, hypothesis.high - hypothesis.low)  # no wider than the range, where data say nothing
    estimates = {}
    for index in range(start, start + hypothesis.counts[which]):
        parameter, value = hypothesis.parameters[index], float(fit.values[index])
        std = float(spread[index])
        if parameter.is_log:
            ends = value * np.exp(-NORMAL_95 * std), value * np.exp(NORMAL_95 * std)
            std *= abs(value)
        else:
            std *= parameter.high - parameter.low
            ends = value - NORMAL_95 * std, value + NORMAL_95 * std
        low, high = sorted(
            component.effect.report_value(component.location, parameter.name, float(end)) for end in ends
        )
        reported = component.effect.report_value(component.location, parameter.name, value)
        estimates[parameter.name] = Estimate(value=reported, std=std, low=low, high=high)
    return estimates


def is_significant(fit: Fit, which: int) -> bool:
    """Tell whether a component is larger than a user's tolerances.

    Parameters
    ----------
    fit : Fit
        With the component.
    which : int
        Its index.

    Returns
    -------
    bool
        False where every parameter lies within its tolerance.
    """
    hypothesis = fit.hypothesis
    which %= len(hypothesis.components)
    start = sum(hypothesis.counts[:which])
    indices = range(start, start + hypothesis.counts[which])
    stated = [index for index in indices if hypothesis.parameters[index].tolerance > 0]
    if not stated:
        return True
    return any(
        abs(fit.values[index] - hypothesis.parameters[index].neutral)
        > INSIGNIFICANT_RATIO * hypothesis.parameters[index].tolerance
        for index in stated
    )
