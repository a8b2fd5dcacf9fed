"""Findings from fits: which effects are how probable, at which places, with which numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.result import Estimate, Finding, describe_location_set
from frf_ipz.diagnosis.search.component_search import group_by_effect

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.arrays import FloatArray
    from frf_ipz.diagnosis.evidence.fit import Fit

NORMAL_95 = 1.96
LISTED_PROBABILITY = 0.95  # probability that the listed places hold
MAX_LOCATIONS = 12
INSIGNIFICANT_RATIO = 2.0  # times a tolerance: a user's tolerances are half widths, not standard deviations


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RankedEffect:
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
        return self.best.hypothesis.components[-1].effect.name


def rank_effects(fits: Sequence[Fit], scale: float) -> list[RankedEffect]:
    """Turn evidence into probabilities of effects.

    Parameters
    ----------
    fits : sequence of Fit
        Each with one cause more than is known.
    scale : float
        What differences of evidence are divided by: more than 1 where the best fit leaves more than noise.

    Returns
    -------
    list of RankedEffect
        By falling probability; the first is the best of its ranking.
    """
    if not fits:
        return []
    top = max(fit.log_evidence for fit in fits)
    found = []
    for group in group_by_effect(fits):
        weights = np.exp(np.maximum((np.array([fit.log_evidence for fit in group]) - top) / scale, -700.0))
        found.append((group, float(weights.sum()), tuple((weights / weights.sum()).tolist())))
    total = sum(weight for _, weight, _ in found)
    return [RankedEffect(fits=group, probability=weight / total, shares=shares) for group, weight, shares in found]


def make_finding(weighed: RankedEffect, gain: float, scale: float) -> Finding:
    """Describe the newest cause of a fit.

    Parameters
    ----------
    weighed : RankedEffect
        The effect.
    gain : float
        Its evidence over that without it, nats.
    scale : float
        As for `rank_effects`: intervals grow with its root.

    Returns
    -------
    Finding
        To report.
    """
    return describe_component(
        weighed.best,
        -1,
        weighed.probability,
        gain,
        scale,
        location_set=_location_set(weighed),
        across=_variance_across_locations(weighed),
    )


def _variance_across_locations(weighed: RankedEffect) -> FloatArray:
    """Variance, as searched, of the newest cause's parameters from place to place: the place is not certain either."""
    count = weighed.best.hypothesis.counts[-1]
    own = [
        (share, fit.hypothesis.clip_to_searched(fit.values)[len(fit.values) - count :])
        for fit, share in zip(weighed.fits, weighed.shares, strict=True)
        if fit.hypothesis.counts[-1] == count and count
    ]
    if not own:
        return np.zeros(count)
    off = np.array([values - own[0][1] for _, values in own])
    return np.asarray(np.array([share for share, _ in own]) @ off**2)


def describe_component(
    fit: Fit,
    which: int,
    probability: float,
    gain: float,
    scale: float,
    *,
    location_set: tuple[dict[str, object], ...],
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
    location_set : tuple of dict
        Where else it could be, the most probable first.
    across : (n_parameters,) array or float
        Variance of its parameters, as searched, from place to place.

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
        location=dict(component.location.entries),
        parameters={**component.location.text, **estimates},
        probability=probability,
        log_evidence_gain=gain,
        statement=component.effect.statement(hypothesis.context, component.location, estimates)
        + describe_location_set(location_set),
        location_set=location_set,
        is_significant=is_significant(fit, index),
        key=component.location.key,
        values=tuple(float(value) for value in fit.values[start : start + hypothesis.counts[index]]),
    )


def _location_set(weighed: RankedEffect) -> tuple[dict[str, object], ...]:
    found: list[dict[str, object]] = []
    total = 0.0
    for fit, share in zip(weighed.fits[:MAX_LOCATIONS], weighed.shares, strict=False):
        location = dict(fit.hypothesis.components[-1].location.entries)
        if location not in found:
            found.append(location)
        total += share
        if total >= LISTED_PROBABILITY:
            break
    return tuple(found)


def _estimate_parameters(fit: Fit, which: int, scale: float, across: FloatArray | float) -> dict[str, Estimate]:
    hypothesis = fit.hypothesis
    component, start = hypothesis.components[which], sum(hypothesis.counts[:which])
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
        low, high = sorted(
            component.effect.report_value(component.location, parameter.name, float(end)) for end in ends
        )
        shown = component.effect.report_value(component.location, parameter.name, value)
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
    which %= len(hypothesis.components)
    start = sum(hypothesis.counts[:which])
    own = range(start, start + hypothesis.counts[which])
    stated = [index for index in own if hypothesis.parameters[index].tolerance > 0]
    if not stated:
        return True
    return any(
        abs(fit.values[index] - hypothesis.parameters[index].neutral)
        > INSIGNIFICANT_RATIO * hypothesis.parameters[index].tolerance
        for index in stated
    )
