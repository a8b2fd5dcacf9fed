"""Impacts at one point that contradict the others: the majority decides, and what explains an impact names its fault.

The impacts that agree best, more than half, give an FRF and its scatter v (a smooth part of the response's noise and
one of the force's, as in `signals.scatter`). The others are tried in turn, nearest first: what the FRF leaves of
one, over v or its own noise and what a decay may leave at its end, averages to D over the lines. The errors of an
impact may be one number common to all lines (it was struck beside the point), so that D counts as one ratio of two
complex numbers, one from the impact and c - 1 from the c impacts that agree: it is beyond x with the probability
(1 + x / (c - 1))^(1 - c), an F distribution with 2 and 2 (c - 1) degrees of freedom. An impact with a probability above
the level is added, and the next is tried.

An impact in which a response does not stand out of its noise, though by the FRF of those in which it does it should,
holds nothing of it (a plug that came loose) and is no part of a majority.

Impacts that agree may still be two groups (some struck at another point): the scatter counts on errors of its own in
each, and is too small by far. Along the direction in which their FRFs scatter most, every split with two or more on
either side is tried; what is between groups over what is within one is an F distribution with 1 and c - 2 degrees of
freedom where there are none and the errors of an impact are one real number: how far beside the point it was struck.

A reversed sensor explains an impact if the other sign makes D as small as that of the others: the ratio of the
densities of D with and without must exceed the number of explanations over the level.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray
from frf_ipz.ingest.signals.scatter import ROUNDING, fit_noise_power
from frf_ipz.ingest.survey.noise_weights import noise_weights
from frf_ipz.late_imports import import_late

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scipy import special
else:
    special = import_late("scipy.special")

CUT_OFF = 1e-3  # of a mode's amplitude at the end of a record that is worth no window
LEVEL = 1e-3  # probability that a test without faults loses anything
GROUPS_BY_CHANCE = 0.01  # the same of two groups, which are said, while nothing is left out
FEWEST = 3  # impacts of which one can be told from the majority
FEWEST_OF_GROUP = 2  # impacts that are alike and unlike the others
FEWEST_WEIGHED = 2  # impacts whose noise can be compared
PASSES = 3  # of the weights
STANDS_OUT = 2.0  # times the power of the noise, median over the lines: there is as much signal as noise


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ImpactSpectra:
    """Transforms of all impacts at one point, on some lines.

    Parameters
    ----------
    force : (n_impacts, n_lines) complex array
        N.
    responses : (n_impacts, n_outputs, n_lines) complex array
        SI.
    noise : (n_impacts, n_outputs, n_lines) array
        Noise power of the responses as each impact shows it.
    force_noise : (n_impacts,) array
        That of the force.
    valid : (n_impacts, n_outputs) bool array
        Which responses are measurements at all.
    """

    force: ComplexArray
    responses: ComplexArray
    noise: FloatArray
    force_noise: FloatArray
    valid: np.ndarray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OutputComparison:
    """One response of all impacts.

    Parameters
    ----------
    agreeing : tuple of int
        Impacts that agree, ascending.
    contradicting : tuple of int
        Those that contradict them.
    reversed_sign : tuple of int
        Of these, those that agree with the opposite sign.
    frf : (n_lines,) complex array
        Of those that agree.
    scatter : (n_lines,) array
        Unexplained power of one of them.
    """

    agreeing: tuple[int, ...]
    contradicting: tuple[int, ...]
    reversed_sign: tuple[int, ...]
    frf: ComplexArray
    scatter: FloatArray

    def misfit(self, force: ComplexArray, response: ComplexArray, noise: FloatArray) -> float:
        """Average what the FRF leaves of a response, over its expectation.

        Parameters
        ----------
        force, response : (n_lines,) complex array
            Of an impact that is not among those that agree.
        noise : (n_lines,) array
            Noise power of the response.

        Returns
        -------
        float
            D: 1 for an impact like those that agree.
        """
        power = np.abs(response - self.frf * force) ** 2
        remainder = CUT_OFF**2 * np.max(np.abs(self.frf * force) ** 2)
        expected = np.maximum(self.scatter, noise) + remainder
        return float(np.mean(np.divide(power, expected, out=np.ones_like(power), where=expected > 0.0)))

    def probability(self, misfit: float) -> float:
        """Give the probability of a larger misfit of an impact without fault.

        Parameters
        ----------
        misfit : float
            D.

        Returns
        -------
        float
            Of the F distribution.
        """
        degrees = len(self.agreeing) - 1
        return float((1.0 + misfit / degrees) ** -degrees)

    def explains(self, misfit: float, explained: float, n_tried: int) -> bool:
        """Tell whether an explanation makes a misfit so much likelier that it counts.

        Parameters
        ----------
        misfit, explained : float
            D without and with it.
        n_tried : int
            Explanations that are tried.

        Returns
        -------
        bool
            True where the ratio of the densities exceeds their number over the level, and the explanation fits.
        """
        return self.log_ratio(misfit, explained) > np.log(n_tried / LEVEL) and self.probability(explained) > LEVEL

    def log_ratio(self, misfit: float, explained: float) -> float:
        """Compare the densities of a misfit with and without an explanation.

        Parameters
        ----------
        misfit, explained : float
            D without and with it.

        Returns
        -------
        float
            Natural logarithm of the ratio.
        """
        degrees = len(self.agreeing) - 1
        return float((degrees + 1) * (np.log1p(misfit / degrees) - np.log1p(explained / degrees)))


def compare_output(spectra: ImpactSpectra, output: int) -> OutputComparison | None:
    """Compare one response of all impacts.

    Parameters
    ----------
    spectra : ImpactSpectra
        All impacts.
    output : int
        Which response.

    Returns
    -------
    OutputComparison or None
        None where fewer than three impacts have it.
    """
    impacts = np.flatnonzero(spectra.valid[:, output])
    if len(impacts) < FEWEST:
        return None
    level = LEVEL / spectra.valid.sum()
    force, response, noise = spectra.force, spectra.responses[:, output], spectra.noise[:, output]
    agreeing = _nearest_majority(spectra.force[impacts], response[impacts])
    remaining = {int(impact) for place, impact in enumerate(impacts) if place not in agreeing}
    agreeing = [int(impacts[place]) for place in agreeing]
    reversed_sign: list[int] = []
    while True:
        reference = _agreement(force[agreeing], response[agreeing], agreeing)
        misfits = {impact: reference.misfit(force[impact], response[impact], noise[impact]) for impact in remaining}
        signs = {impact: reference.misfit(force[impact], -response[impact], noise[impact]) for impact in remaining}
        reversed_sign = [
            impact for impact in sorted(remaining) if reference.explains(misfits[impact], signs[impact], 1)
        ]
        others = [impact for impact in remaining if impact not in reversed_sign]
        nearest = min(others, key=misfits.__getitem__, default=-1)
        if nearest < 0 or reference.probability(misfits[nearest]) < level:
            break
        remaining.remove(nearest)
        agreeing = sorted([*agreeing, nearest])
    return OutputComparison(
        agreeing=tuple(agreeing),
        contradicting=tuple(sorted(remaining)),
        reversed_sign=tuple(reversed_sign),
        frf=reference.frf,
        scatter=reference.scatter,
    )


def leave_out(spectra: ImpactSpectra, output: int, comparison: OutputComparison, impact: int) -> OutputComparison:
    """Compare as if one of the impacts that agree did not.

    Parameters
    ----------
    spectra : ImpactSpectra
        All impacts.
    output : int
        Which response.
    comparison : OutputComparison
        That of all impacts.
    impact : int
        One of those that agree, of at least three.

    Returns
    -------
    OutputComparison
        The FRF and the scatter of the others, which the impact contradicts.
    """
    others = [number for number in comparison.agreeing if number != impact]
    reference = _agreement(spectra.force[others], spectra.responses[others, output], others)
    return replace(
        reference,
        contradicting=tuple(sorted([*comparison.contradicting, impact])),
        reversed_sign=comparison.reversed_sign,
    )


def follows_force(spectra: ImpactSpectra, output: int) -> bool:
    """Tell whether anything in a response follows the force.

    Without that, ``(1 - n) ln(1 - coherence)`` of n impacts has an exponential distribution at each line. Chance puts
    its mean over L lines beyond ``1 + x / sqrt(L)`` with the probability ``exp(-x^2 / 2)`` at most, for the many lines
    of a record, and the largest beyond x with ``L exp(-x)``. What has more power than its own noise, such as motion
    from before, is not asked.

    Parameters
    ----------
    spectra : ImpactSpectra
        All impacts.
    output : int
        Which response.

    Returns
    -------
    bool
        False where both are within what chance gives at the level.
    """
    impacts = np.flatnonzero(spectra.valid[:, output])
    noise = np.sqrt(spectra.noise[impacts, output])
    power = np.abs(spectra.responses[impacts, output]) ** 2
    if len(impacts) < FEWEST or not noise.all() or _stands_out(power, noise**2).any():
        return True
    return _is_coherent(spectra.force[impacts] / noise, spectra.responses[impacts, output] / noise)


def find_dead(spectra: ImpactSpectra, output: int) -> tuple[int, ...]:
    """Find the impacts in which a response holds nothing, though it does in others and should in them.

    Parameters
    ----------
    spectra : ImpactSpectra
        All impacts.
    output : int
        Which response.

    Returns
    -------
    tuple of int
        Those in which it does not stand out of its noise, where the FRF of those in which it does demands that, and
        which are more like nothing than like what that FRF makes of the force, of either sign; none where the others
        do not agree.
    """
    impacts = np.flatnonzero(spectra.valid[:, output])
    force, response, noise = spectra.force[impacts], spectra.responses[impacts, output], spectra.noise[impacts, output]
    alive = _stands_out(np.abs(response) ** 2, noise)
    if alive.all() or not alive.any() or (alive.sum() > 1 and not _is_coherent(force[alive], response[alive])):
        return ()
    expected = _estimate_h1(force[alive], response[alive]) * force
    is_dead = ~alive & _stands_out(np.abs(expected) ** 2, noise) & _is_rather_nothing(response, expected, noise)
    return tuple(int(impact) for impact in impacts[is_dead])


def _is_rather_nothing(response: ComplexArray, expected: ComplexArray, noise: FloatArray) -> BoolArray:
    """Tell for each impact whether a response is more likely as noise alone than with what is expected in it."""
    misfits = [
        np.sum(
            np.divide(np.abs(response - sign * expected) ** 2, noise, out=np.zeros(noise.shape), where=noise > 0.0), 1
        )
        for sign in (0.0, 1.0, -1.0)
    ]
    return np.asarray(misfits[0] < np.minimum(*misfits[1:]))


def _stands_out(power: FloatArray, noise: FloatArray) -> BoolArray:
    return np.asarray(np.median(power, axis=1) > STANDS_OUT * np.median(noise, axis=1))


def _is_coherent(force: ComplexArray, response: ComplexArray) -> bool:
    """Tell whether impacts have more coherence than chance gives at the level."""
    cross = np.abs(np.sum(force.conj() * response, axis=0)) ** 2
    product = np.sum(np.abs(force) ** 2, axis=0) * np.sum(np.abs(response) ** 2, axis=0)
    coherence = np.divide(cross, product, out=np.zeros_like(cross), where=product > 0.0)
    statistic = (1 - len(force)) * np.log1p(-np.minimum(coherence, 1.0 - np.finfo(float).eps))
    is_mean_high = np.mean(statistic) > 1.0 + np.sqrt(2.0 * np.log(1.0 / LEVEL) / len(statistic))
    return bool(is_mean_high or np.max(statistic) > np.log(len(statistic) / LEVEL))


def weigh_impacts(
    spectra: ImpactSpectra, agreeing: Sequence[int], output: int, n_shown: float
) -> tuple[FloatArray, FloatArray]:
    """Weigh impacts that agree by their noise, and estimate the noise power that remains under the weights.

    The weights are found twice: a loud impact hides in the first scatter what the others have.

    Parameters
    ----------
    spectra : ImpactSpectra
        All impacts.
    agreeing : sequence of int
        Those that agree in this response.
    output : int
        Which response.
    n_shown : float
        Lines of the spectra that show the noise, for each line here.

    Returns
    -------
    weights : (n_impacts, n_lines) array
        Their mean over the impacts that agree is 1; 1 for the others.
    scales : (n_impacts,) array
        Noise power of each under its weight, over the scatter; 1 for those that do not agree.
    """
    weights, scales = np.ones(spectra.force.shape), np.ones(len(spectra.force))
    impacts = list(agreeing)
    if len(impacts) < FEWEST_WEIGHED:
        return weights, scales
    force, response = spectra.force[impacts], spectra.responses[impacts, output]
    for _ in range(PASSES):
        root = np.sqrt(weights[impacts])
        reference = _agreement(root * force, root * response, impacts)
        scatter = np.maximum(reference.scatter, np.finfo(float).tiny)
        own = spectra.noise[impacts, output] + spectra.force_noise[impacts, None] * np.abs(reference.frf) ** 2
        scaled = root / np.sqrt(scatter)
        weights[impacts] *= noise_weights(scaled * force, scaled * response, own * weights[impacts] / scatter, n_shown)
        weights[impacts] /= weights[impacts].mean(axis=0)
    root = np.sqrt(weights[impacts])
    scales[impacts] = _noise_scales(root * force, root * response)
    return weights, scales


def _noise_scales(force: ComplexArray, response: ComplexArray) -> FloatArray:
    """Estimate the noise power of each impact over the scatter of all, not negative.

    What H1 leaves of impact k, whose share of the force's power is h_k, has the expectation
    ``v (s_k (1 - 2 h_k) + h_k sum h_m s_m)``, which is linear in the relative powers s. It is known to one over
    the root of the lines, and s is 1 within a deviation of 1 beforehand: of two impacts beside a loud one it tells
    no more than their mean.
    """
    ones = np.ones(len(force))
    power = np.abs(force) ** 2
    total = power.sum(axis=0)
    reference = _agreement(force, response, [])
    usable = (reference.scatter > 0.0) & (total > 0.0)
    if len(force) < FEWEST or not usable.any():
        return ones
    shares = power[:, usable] / total[usable]
    left = np.abs(response - reference.frf * force)[:, usable] ** 2 / reference.scatter[usable]
    matrix = np.diag(1.0 - 2.0 * shares.mean(axis=1)) + shares @ shares.T / shares.shape[1]
    beyond = left.mean(axis=1) - matrix.sum(axis=1)
    normal = matrix.T @ matrix + np.eye(len(force)) / shares.shape[1]
    scales = np.maximum(1.0 + np.linalg.solve(normal, matrix.T @ beyond), 0.0)
    return np.asarray(scales) if scales.any() else ones


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TwoGroups:
    """Impacts that fall into two groups.

    Parameters
    ----------
    first, second : tuple of int
        The impacts of each.
    between, within : float
        How far the groups' FRFs, and those of impacts of one group, are apart: root of mean square, relative, lines
        weighed by their noise.
    """

    first: tuple[int, ...]
    second: tuple[int, ...]
    between: float
    within: float

    @property
    def variance_factor(self) -> float:
        """What makes the variance of the mean, by the scatter of all, that of a mean of which either group is right."""
        n, m = len(self.first), len(self.second)
        return (n**2 + m**2) / 2 * (n + m - 1) / (n * m)


def find_two_groups(spectra: ImpactSpectra, outputs: Sequence[int], impacts: Sequence[int]) -> TwoGroups | None:
    """Find two groups among impacts that agree, whose FRFs differ by far more than those within a group.

    Parameters
    ----------
    spectra : ImpactSpectra
        All impacts.
    outputs : sequence of int
        Responses in which just these agree.
    impacts : sequence of int
        Those that agree.

    Returns
    -------
    TwoGroups or None
        None where there are none.
    """
    count, chosen = len(impacts), list(impacts)
    if count < 2 * FEWEST_OF_GROUP:
        return None
    frfs, weights = zip(*(_frfs_over_noise(spectra, output, chosen) for output in outputs), strict=True)
    values, weight = np.hstack(frfs), np.concatenate(weights)
    errors = (values - values.mean(axis=0)) * weight
    products = (errors @ errors.conj().T).real
    order = np.argsort(np.linalg.eigh(products)[1][:, -1])
    total = float(np.trace(products))
    splits = []
    for n_first in range(FEWEST_OF_GROUP, count - FEWEST_OF_GROUP + 1):
        first = order[:n_first]
        between = products[np.ix_(first, first)].sum() * count / (n_first * (count - n_first))
        splits.append((total - float(between), n_first))
    left, n_first = min(splits)
    spare = count - 2
    ratio = (total - left) * spare / left if left > 0.0 else np.inf
    n_splits = 2.0 ** (count - 1) - 1 - count  # with two or more on either side
    if special.fdtrc(1, spare, ratio) * n_splits > GROUPS_BY_CHANCE:
        return None
    groups = [tuple(sorted(chosen[place] for place in group)) for group in (order[:n_first], order[n_first:])]
    size = float(np.sum(np.abs(values.mean(axis=0) * weight) ** 2))
    part = count / (n_first * (count - n_first))  # of what is between groups, over the square of how far they are apart
    return TwoGroups(
        first=min(groups),
        second=max(groups),
        between=float(np.sqrt((total - left) * part / size)),
        within=float(np.sqrt(left / spare / size)),
    )


def _frfs_over_noise(spectra: ImpactSpectra, output: int, impacts: list[int]) -> tuple[ComplexArray, FloatArray]:
    """Give the FRF of each impact, (n_impacts, n_used), and one over the deviation of its noise, (n_used,)."""
    force, response = spectra.force[impacts], spectra.responses[impacts, output]
    noise = spectra.noise[impacts, output].mean(axis=0)
    noise = noise + spectra.force_noise[impacts].mean() * np.abs(_estimate_h1(force, response)) ** 2
    noise = noise + ROUNDING * np.sum(np.abs(response) ** 2, axis=0).max(initial=0.0)
    used = (np.abs(force) > 0.0).all(axis=0) & (noise > 0.0)
    power = np.mean(np.abs(force[:, used]) ** 2, axis=0)
    return response[:, used] / force[:, used], np.sqrt(power / noise[used])


def contradicts_pairwise(spectra: ImpactSpectra, output: int) -> bool:
    """Tell whether two impacts agree in one response only with the opposite sign.

    Parameters
    ----------
    spectra : ImpactSpectra
        Two impacts.
    output : int
        Which response.

    Returns
    -------
    bool
        True where the opposite sign leaves so little that the level is exceeded: one complex number against another.
    """
    (first_force, second_force), (first, second) = spectra.force, spectra.responses[:, output]
    same = np.sum(np.abs(first * second_force - second * first_force) ** 2)
    opposite = np.sum(np.abs(first * second_force + second * first_force) ** 2)
    return bool(opposite < LEVEL * same)


def difference_of_pair(spectra: ImpactSpectra, output: int) -> float:
    """Tell by how much two impacts differ in one response.

    Parameters
    ----------
    spectra : ImpactSpectra
        Two impacts.
    output : int
        Which response.

    Returns
    -------
    float
        Root mean square of the difference of their FRFs over that of the FRFs, without what their noise makes.
    """
    (first_force, second_force), (first, second) = spectra.force, spectra.responses[:, output]
    power = np.abs(spectra.force) ** 2
    noise = np.sum(power[1] * spectra.noise[0, output] + power[0] * spectra.noise[1, output])
    difference = np.sum(np.abs(first * second_force - second * first_force) ** 2)
    size = 0.5 * np.sum(np.abs(first * second_force) ** 2 + np.abs(second * first_force) ** 2)
    return float(np.sqrt(max(difference - noise, 0.0) / size)) if size else 0.0


def _nearest_majority(force: ComplexArray, response: ComplexArray) -> list[int]:
    """Find the impact and its nearest neighbours, more than half of all, that agree best."""
    count = len(force)
    size = count // 2 + 1
    pairs = np.array([(first, second) for first in range(count) for second in range(first)])
    difference = response[pairs[:, 0]] * force[pairs[:, 1]] - response[pairs[:, 1]] * force[pairs[:, 0]]
    power = np.abs(force) ** 2
    distance = np.abs(difference) ** 2 / np.maximum(power[pairs].sum(axis=1), np.finfo(float).tiny)
    usual = np.median(distance, axis=0)
    relative = np.divide(distance, usual, out=np.ones_like(distance), where=usual > 0.0).mean(axis=1)
    table = np.zeros((count, count))
    table[pairs[:, 0], pairs[:, 1]] = table[pairs[:, 1], pairs[:, 0]] = relative
    nearest = np.argsort(table, axis=1)[:, :size]
    best = int(np.argmin(np.take_along_axis(table, nearest, axis=1).sum(axis=1)))
    return sorted(int(place) for place in nearest[best])


def _estimate_h1(force: ComplexArray, response: ComplexArray) -> ComplexArray:
    """FRF of some impacts, (n_lines,) array."""
    power = np.sum(np.abs(force) ** 2, axis=0)
    return np.asarray(np.sum(force.conj() * response, axis=0) / np.maximum(power, np.finfo(float).tiny))


def _agreement(force: ComplexArray, response: ComplexArray, impacts: list[int]) -> OutputComparison:
    frf = _estimate_h1(force, response)
    left = np.sum(np.abs(response - frf * force) ** 2, axis=0) / (len(force) - 1)
    floor = ROUNDING * np.sum(np.abs(response) ** 2, axis=0).max(initial=0.0)
    scatter = fit_noise_power(np.maximum(left, floor), np.abs(frf) ** 2, len(force) - 1.0)
    return OutputComparison(agreeing=tuple(impacts), contradicting=(), reversed_sign=(), frf=frf, scatter=scatter)
