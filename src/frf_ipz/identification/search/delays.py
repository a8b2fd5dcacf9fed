"""Delays of responses: of each channel where the user asks for them, or one that all FRFs share.

Complex residues follow a short delay almost exactly: they give good poles and no information on the delay. Normal modes
do not: a delay turns the phase of each mode in proportion to its frequency. So a delay is what makes modes look normal.
A delay that all FRFs share is tried where modes are not normal, and taken where it explains most of that, in all FRFs
together and in most of the modes by themselves: mode shapes that are truly complex turn one mode forth, another back.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.identification.likelihood.compression import column_gains, compress
from frf_ipz.identification.likelihood.delay import find_delays
from frf_ipz.identification.measured_lines import MeasuredLines, WeightedLines

if TYPE_CHECKING:
    from frf_ipz.frf import FrfLabel
    from frf_ipz.identification.likelihood.smooth_terms import SmoothTerms

ROUNDS = 2  # of finding delays and poles in turn
MOST = 0.5  # of the misfit, and of the modes
FEWEST_MODES = 3  # whose phases tell a delay from complex modes
STEP = 0.01  # of the shortest period, over which the misfit is differentiated


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
        By the curvature of the misfit, or by the scatter over FRFs where that is more.
    """
    n_frfs = lines.receptance.shape[1]
    step = STEP * 2 * np.pi / float(np.abs(lines.s[-1]))
    before, at, after = (
        _misfit(_normal(lines.advanced(np.full(n_frfs, delay_s + change))), poles, terms)
        for change in (-step, 0.0, step)
    )
    curvature = (before - 2 * at + after) / step**2
    by_noise = float(np.sqrt(2 / curvature * max(1.0, at / (2.0 * lines.receptance.size)))) if curvature > 0 else np.inf
    each, _ = find_delays(_normal(lines.advanced(np.full(n_frfs, delay_s))), poles, terms, np.arange(n_frfs))
    return CommonDelay(delay_s=delay_s, std_s=max(by_noise, _std_of_median(each)))


def _std_of_median(values: FloatArray) -> float:
    """Give the standard deviation of the median of normally distributed values by their own scatter."""
    deviation = np.median(np.abs(values - np.median(values))) / special.ndtri(0.75)
    return float(np.sqrt(np.pi / 2) * deviation / np.sqrt(len(values)))


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
