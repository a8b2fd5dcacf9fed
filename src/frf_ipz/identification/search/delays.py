"""Delays of responses: of each channel where the user asks for them, or one that all FRFs share.

Complex residues follow a short delay almost exactly: they give good poles and no information on the delay. Normal modes
do not: a delay turns the phase of each mode in proportion to its frequency. So a delay is what makes modes look normal.
A delay that all FRFs share is tried where modes are not normal, and taken where it explains most of that, in all FRFs
together and in most of the modes by themselves: mode shapes that are truly complex turn one mode forth, another back.

A delay of one channel is told from complex modes by the phases at that channel alone. With q the part of a residue that
normal modes do not have, over its modulus, random phases of variance v + (variance of q by the noise) leave

    F = sum_k (q_k^2 without the delay - q_k^2 with it) / (v + var q_k)

distributed as Fisher's F of 1 and n - 1 degrees of freedom, v from what the delay leaves ([Paule1982], Eq. (8)).

[Paule1982]: R. C. Paule, J. Mandel, Consensus values and weighting factors, J. Res. NBS 87 (1982) 377-385
(doi:10.6028/jres.087.022).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from frf_ipz.identification.likelihood.compression import column_gains, compress, model_columns
from frf_ipz.identification.likelihood.delay import EARLIEST, LATEST, find_delays
from frf_ipz.identification.likelihood.sandwich import NoiseInTime
from frf_ipz.identification.measured_lines import MeasuredLines, WeightedLines
from frf_ipz.late_imports import import_late
from frf_ipz.numerics.partial_fractions import stacked, unstacked

if TYPE_CHECKING:
    from scipy.optimize import brentq

    from frf_ipz.frf import FrfLabel
    from frf_ipz.identification.likelihood.smooth_terms import SmoothTerms
else:
    brentq = import_late("scipy.optimize", "brentq")

ROUNDS = 2  # of finding delays and poles in turn
MOST = 0.5  # of the misfit, and of the modes
FEWEST_MODES = 3  # whose phases tell a delay from complex modes
FALSE_CLAIM = 1e-3  # chance that random phases of any channel are taken for a delay
PATTERNS = 2  # of phases that differ, in each period of the highest frequency that is tried: q repeats by pi
CHANCE = 0.05  # that delays of FRFs, which are the same, differ so much that the deviation is raised


@dataclass(frozen=True, slots=True, kw_only=True)
class CommonDelay:
    """A delay that all FRFs share.

    Parameters
    ----------
    delay_s : float
        By which responses are late, s; below 0 where the force is.
    std_s : float
        Its standard deviation, s.
    """

    delay_s: float
    std_s: float


def each_delay(
    labels: Sequence[FrfLabel],
    lines: MeasuredLines,
    terms: SmoothTerms,
    find_poles: Callable[[MeasuredLines], ComplexArray],
) -> FloatArray:
    """Find the delay of each output channel.

    Parameters
    ----------
    labels : sequence of FrfLabel
        Of the FRFs.
    lines : MeasuredLines
        Lines and weights.
    terms : SmoothTerms
        Terms for modes out of band.
    find_poles : callable
        Gives the poles of lines, with complex modes.

    Returns
    -------
    (n_frfs,) array
        s.
    """
    numbers = _channel_numbers(labels)
    delays = np.zeros(len(labels))
    for _ in range(ROUNDS):
        poles = find_poles(lines.advanced(delays))
        delays, _ = find_delays(_normal(lines), poles, terms, numbers)
    return delays


def explains_misfit(labels: Sequence[FrfLabel], lines: MeasuredLines, poles: ComplexArray, terms: SmoothTerms) -> bool:
    """Tell whether delays of single channels explain most of what a fit leaves.

    Parameters
    ----------
    labels : sequence of FrfLabel
        Of the FRFs.
    lines : MeasuredLines
        Lines, weighted by the noise.
    poles : (n_poles,) complex array
        Of the fit, rad/s.
    terms : SmoothTerms
        Terms for modes out of band.

    Returns
    -------
    bool
        True where even complex modes, which follow a short delay, are much closer to the lines with the delays.
    """
    numbers = _channel_numbers(labels)
    if not numbers.any():
        return False
    data = lines.weighted(shared=True)
    delays, _ = find_delays(data.with_real_modes(), poles, terms, numbers)
    late = lines.advanced(delays).weighted(shared=True)
    return _misfit(late, poles, terms) < MOST * _misfit(data, poles, terms)


def late_channels(
    labels: Sequence[FrfLabel], lines: MeasuredLines, poles: ComplexArray, terms: SmoothTerms
) -> FloatArray:
    """Find channels whose modes are normal but for a delay of their own.

    Parameters
    ----------
    labels : sequence of FrfLabel
        Of the FRFs.
    lines : MeasuredLines
        Lines, weighted by the noise.
    poles : (n_poles,) complex array
        Of the fit, rad/s.
    terms : SmoothTerms
        Terms for modes out of band.

    Returns
    -------
    (n_frfs,) array
        Their delays, s; 0 for all other channels.
    """
    numbers = _channel_numbers(labels)
    delays = np.zeros(len(labels))
    in_band = (np.abs(poles) >= np.abs(lines.s[0])) & (np.abs(poles) <= np.abs(lines.s[-1]))
    if not numbers.any() or np.count_nonzero(in_band) < FEWEST_MODES:
        return delays
    complex_modes = lines.weighted(shared=True)
    left, least = (compress(data, poles, terms).misfit for data in (complex_modes.with_real_modes(), complex_modes))
    by_number = float(np.log(2 * len(lines.s)))
    not_normal = np.bincount(numbers, left - least) > np.bincount(numbers) * len(poles) * by_number
    if not not_normal.any():
        return delays
    found, _ = find_delays(complex_modes.with_real_modes(), poles, terms, numbers)
    late = lines.advanced(found).weighted(shared=True)
    (before, _), (after, variance) = (_turns(data, poles, terms, in_band) for data in (complex_modes, late))
    chance = FALSE_CLAIM / (len(not_normal) * PATTERNS * (LATEST - EARLIEST))
    for channel in np.flatnonzero(not_normal):
        frfs = numbers == channel
        if _is_explained(before[:, frfs].ravel(), after[:, frfs].ravel(), variance[:, frfs].ravel(), chance):
            delays[frfs] = found[frfs]
    return delays


def _turns(
    data: WeightedLines, poles: ComplexArray, terms: SmoothTerms, modes: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Give the part of each residue that normal modes do not have, over its modulus, and its variance by the noise."""
    system = compress(data, poles, terms)
    gains = column_gains(system, [[system.n_smooth + number] for number in range(len(poles))])[modes]
    residues = system.residues()[modes]
    turn = residues.real / np.abs(residues)
    return turn, turn**2 / gains


def _is_explained(before: FloatArray, after: FloatArray, variance: FloatArray, chance: float) -> bool:
    """Tell whether a delay takes off more than chance does off random phases that scatter as much as is left."""
    spare = len(after) - 1

    def excess(own: float) -> float:
        return float(np.sum(after**2 / (own + variance))) - spare

    own = 0.0 if excess(0.0) <= 0 else brentq(excess, 0.0, float(np.sum(after**2)) / spare)
    return bool(np.sum((before**2 - after**2) / (own + variance)) > special.fdtri(1, spare, 1 - chance))


def _channel_numbers(labels: Sequence[FrfLabel]) -> IntArray:
    channels = [label.output_channel or label.output_dof.name for label in labels]
    return np.asarray(np.unique(channels, return_inverse=True)[1], np.int64)


def common_delay(
    lines: MeasuredLines,
    poles: ComplexArray,
    terms: SmoothTerms,
    find_poles: Callable[[MeasuredLines], ComplexArray],
) -> CommonDelay | None:
    """Find the delay that all FRFs share, if it explains why modes are not normal.

    Parameters
    ----------
    lines : MeasuredLines
        Lines, weighted by the noise.
    poles : (n_poles,) complex array
        Of a fit without delay, rad/s.
    terms : SmoothTerms
        Terms for modes out of band.
    find_poles : callable
        Gives the poles of lines, with complex modes.

    Returns
    -------
    CommonDelay or None
        None where there is none.
    """
    n_frfs = lines.receptance.shape[1]
    one_channel = np.zeros(n_frfs, np.int64)
    complex_modes, noise = lines.weighted(shared=True), 2.0 * lines.receptance.size
    normal = complex_modes.with_real_modes()
    left = _misfit(normal, poles, terms)
    by_number = float(np.log(2 * len(lines.s)))  # demanded by the BIC for each number more
    if left - _misfit(complex_modes, poles, terms) < len(poles) * n_frfs * by_number:
        return None  # modes are normal
    delay = 0.0
    for _ in range(ROUNDS):
        delays, misfit = find_delays(normal, poles, terms, one_channel)
        delay, gain = float(delays[0]), left - misfit
        if gain < by_number or gain < MOST * (left - noise):
            return None
        poles = find_poles(lines.advanced(np.full(n_frfs, delay)))
    late = lines.advanced(np.full(n_frfs, delay)).weighted(shared=True)
    if len(poles) < FEWEST_MODES or not _turns_most_modes(complex_modes, late, poles, terms):
        return None
    measured = measure_delay(lines, poles, terms, delay)
    return measured if measured.delay_s**2 > by_number * measured.std_s**2 else None


def measure_delay(lines: MeasuredLines, poles: ComplexArray, terms: SmoothTerms, delay_s: float) -> CommonDelay:
    """Give a delay that all FRFs share its standard deviation.

    Parameters
    ----------
    lines : MeasuredLines
        Lines, weighted by the noise, as they were measured.
    poles : (n_poles,) complex array
        Of a fit without the delay, rad/s.
    terms : SmoothTerms
        Terms for modes out of band.
    delay_s : float
        The delay, s.

    Returns
    -------
    CommonDelay
        By the noise, that which lines share included, and by the scatter over FRFs where that is more than chance.
        Where records begin within the pulse, by as much as what they lack of it makes of a delay.
    """
    n_frfs = lines.receptance.shape[1]
    late = lines.advanced(np.full(n_frfs, delay_s))
    data = _normal(late)
    columns = model_columns(data.s, poles, terms, real_modes=True) * np.tile(data.profile, 2)[:, None]
    basis = np.linalg.qr(columns)[0]

    def beside_modes(values: ComplexArray) -> ComplexArray:
        weighted = stacked(values * data.weight)
        return unstacked(weighted - basis @ (basis.T @ weighted))

    slopes, misfit = beside_modes(data.receptance * data.s[:, None]), beside_modes(data.receptance)
    information = np.sum(np.abs(slopes) ** 2, axis=0)
    each_s = -np.sum((slopes.conj() * misfit).real, axis=0) / information
    own, shared = _variances_of_sums(late, slopes * data.weight)
    own = own * max(1.0, float(np.mean(np.abs(misfit) ** 2)) / 2)
    differs = np.sum((each_s - np.average(each_s, weights=information**2 / own)) ** 2 * information**2 / own)
    if n_frfs > 1 and differs > special.chdtri(n_frfs - 1, CHANCE):
        own = own * differs / (n_frfs - 1)
    variance = (np.sum(own) + shared) / np.sum(information) ** 2 + _by_missing_force(late, poles, terms) ** 2
    return CommonDelay(delay_s=delay_s, std_s=float(np.sqrt(variance)))


def _variances_of_sums(lines: MeasuredLines, factors: ComplexArray) -> tuple[FloatArray, float]:
    """Give the variance of the real part of the noise times conjugate factors: of each FRF, and what they share."""
    own, shared = lines.variance, 0.0
    if lines.missing_force is not None:
        own = own - np.abs(lines.receptance * lines.missing_force) ** 2
    if lines.force_noise is not None:
        noise = lines.force_noise
        of_force = NoiseInTime.within(lines.frequency_hz, noise.interval_s)
        error = lines.receptance * noise.relative
        own = own - np.abs(error) ** 2
        error = error * np.exp(-2j * np.pi * lines.frequency_hz * np.mean(noise.interval_s))[:, None]
        for force in np.unique(noise.force):
            alike = noise.force == force
            sums = np.sum(factors[:, alike].conj() * error[:, alike], axis=1, keepdims=True)
            shared += float(np.sum(of_force(sums) ** 2))
    return np.sum(np.abs(factors) ** 2 * np.maximum(own, 0.0) / 2, axis=0), shared


def _by_missing_force(late: MeasuredLines, poles: ComplexArray, terms: SmoothTerms) -> float:
    """Give the delay that records seem to have because they begin within the pulse, s."""
    if late.missing_force is None:
        return 0.0
    whole = replace(late, receptance=late.receptance / (1 + late.missing_force))
    one_channel = np.zeros(late.receptance.shape[1], np.int64)
    return float(np.ptp([find_delays(_normal(lines), poles, terms, one_channel)[0][0] for lines in (late, whole)]))


def _normal(lines: MeasuredLines) -> WeightedLines:
    return lines.weighted(shared=True).with_real_modes()


def _misfit(data: WeightedLines, poles: ComplexArray, terms: SmoothTerms) -> float:
    return float(np.sum(compress(data, poles, terms).misfit))


def _turns_most_modes(before: WeightedLines, after: WeightedLines, poles: ComplexArray, terms: SmoothTerms) -> bool:
    """Check that the residues of most modes have less of a real part with the delay."""
    gains = []
    for data in (before, after):
        system = compress(data, poles, terms)
        real_parts = [[system.n_smooth + number] for number in range(len(poles))]
        gains.append(column_gains(system, real_parts).sum(axis=1))
    return bool(np.count_nonzero(gains[1] < MOST * gains[0]) > MOST * len(poles))
