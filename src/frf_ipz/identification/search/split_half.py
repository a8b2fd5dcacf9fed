"""Whether modes come up again in each half of the lines, and what their standard deviations have to be raised by.

Where the noise is not known, or the model does not reach it, the choice of modes is uncertain as well, which no misfit
shows: another choice gives other poles. So the even and the odd lines are each fitted by themselves, the choice of
modes included [Quenouille1956]. Their differences over the stated standard deviations are what the latter lack. And a
mode that does not come up in both may be there or not: its neighbours are uncertain by what they would move without it
[Buckland1997].

[Quenouille1956] M. H. Quenouille, Notes on bias in estimation, Biometrika 43, 1956, 353-360, doi:10.2307/2332914.
[Buckland1997] S. T. Buckland, K. P. Burnham, N. H. Augustin, Model selection: an integral part of inference, Biometrics
53, 1997, 603-618, doi:10.2307/2533961.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import optimize, stats

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.errors import NumericalError
from frf_ipz.identification.likelihood.refinement import refine
from frf_ipz.identification.measured_lines import FEWEST_LINES
from frf_ipz.identification.search.find_modes import Fitted, find_modes, levels

if TYPE_CHECKING:
    from frf_ipz.frf import FrfSet
    from frf_ipz.identification.options import FitOptions

HALVES = 2
SAME = 0.5  # half widths of the narrower of two poles within which they are one mode
CHANCE = 0.05  # that halves with true standard deviations differ so much that these are raised
NARROW = 0.5  # half width, in lines of a half, below which a half may have no line on a peak: it tells nothing then
FEW_ITERATIONS = 4  # of a fit without one of its poles: the others are near their places


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Support:
    """What the two halves say of a fit.

    Parameters
    ----------
    times : (n_poles,) int array
        In how many of the halves each pole comes up; both, where it is too narrow for the lines of a half.
    scatter : float
        Difference of the halves over its standard deviation, root of mean square; 1 where chance explains it.
    raised : (2 n_poles,) array
        Factor on each pole's variance by which the stated one covers the halves' differences, at least 1: all real
        parts, then all imaginary parts.
    shift : (2 n_poles,) array
        Standard deviation of each pole by modes near it that may be there or not: all real parts, then all imaginary
        parts, rad/s.
    """

    times: IntArray
    scatter: float
    raised: FloatArray
    shift: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Half:
    poles: ComplexArray
    variance: FloatArray


def doubts(support: Support | None, modes: IntArray) -> tuple[str, ...]:
    """Say what speaks against modes.

    Parameters
    ----------
    support : Support or None
        What the halves say.
    modes : (n_modes,) int array
        Places of the modes among the poles.

    Returns
    -------
    tuple of str
        Empty for a mode that comes up in both halves.
    """
    if support is None:
        return ("",) * len(modes)
    said = {0: "comes up in neither half", 1: "comes up in one half only"}
    why = " of the lines (even, odd), when each is fitted by itself"
    return tuple(said[times] + why if times < HALVES else "" for times in support.times[modes].tolist())


def find_support(frfs: FrfSet, fitted: Fitted, options: FitOptions) -> Support | None:
    """Fit each half of the lines, the choice of modes included.

    Parameters
    ----------
    frfs : FrfSet
        What was fitted.
    fitted : Fitted
        The fit of all lines.
    options : FitOptions
        Of the fit.

    Returns
    -------
    Support or None
        None where the lines are too few.
    """
    if np.count_nonzero(fitted.lines.used) < 2 * HALVES * FEWEST_LINES:
        return None
    advanced = replace(frfs, values=frfs.values * np.exp(frfs.s[:, None] * fitted.delay_s))
    options = replace(options, band_hz=fitted.lines.band_hz, delay=False)
    numbers = np.arange(frfs.n_lines)
    halves = [_half(advanced.select_lines(numbers % HALVES == number), options) for number in range(HALVES)]
    poles = fitted.fit.poles
    partners = np.stack([_partners(poles, half.poles) for half in halves])
    both = (partners >= 0).all(axis=0)
    line = 2 * np.pi * HALVES * fitted.lines.line_hz
    times = np.where(-poles.real < NARROW * line, HALVES, np.sum(partners >= 0, axis=0))
    found = [
        (half.poles[partner[both]], half.variance[:, partner[both]])
        for half, partner in zip(halves, partners, strict=True)
    ]
    difference = found[0][0] - found[1][0]
    variance = found[0][1] + found[1][1]
    scatter = _scatter(np.stack([difference.real, difference.imag]) ** 2 / variance)
    raised = np.ones((2, len(poles)))
    if scatter > 1:
        # all lines have half the variance of one of the halves, that is a quarter of the difference's
        covered = scatter**2 * variance / HALVES**2 / (levels(fitted) * _stated(fitted)).reshape(2, -1)[:, both]
        raised[:, both] = covered
        raised[:, ~both] = np.median(covered)
    return Support(times=times, scatter=scatter, raised=np.maximum(raised, 1.0).ravel(), shift=_shift(fitted, times))


def _half(frfs: FrfSet, options: FitOptions) -> _Half:
    try:
        fitted = find_modes(frfs, options)
    except NumericalError:  # no mode stands out of the noise
        return _Half(poles=np.zeros(0, complex), variance=np.zeros((2, 0)))
    variance = levels(fitted) * _stated(fitted)
    return _Half(poles=fitted.fit.poles, variance=variance.reshape(2, -1))


def _stated(fitted: Fitted) -> FloatArray:
    """Variance of each pole by white noise, (2 n_poles,)."""
    return np.asarray(np.diag(np.linalg.pinv(fitted.fit.information, hermitian=True)))


def _partners(poles: ComplexArray, others: ComplexArray) -> IntArray:
    """Place of each pole's partner among others, or -1."""
    partners = np.full(len(poles), -1)
    width = np.minimum(-poles.real[:, None], -others.real)
    width = np.maximum(width, np.finfo(float).eps * np.abs(others))  # a single line has no width
    apart = np.minimum(np.abs(poles[:, None] - others) / (SAME * width), 2.0)
    mine, theirs = optimize.linear_sum_assignment(apart)
    same = apart[mine, theirs] < 1
    partners[mine[same]] = theirs[same]
    return partners


def _scatter(squares: FloatArray) -> float:
    if not squares.size or np.sum(squares) < stats.chi2.isf(CHANCE, squares.size):
        return 1.0
    return float(np.sqrt(np.mean(squares)))


def _shift(fitted: Fitted, times: IntArray) -> FloatArray:
    """Move each pole by leaving out, one by one, those that do not come up in both halves."""
    poles = fitted.fit.poles
    data = replace(fitted.lines.weighted(), real_modes=fitted.fit.system.real_modes)
    share = (1 + times) / (1 + HALVES)  # of the three fits that have it
    variance = np.zeros((2, len(poles)))
    for number in np.flatnonzero(times < HALVES).tolist():
        others = np.delete(np.arange(len(poles)), number)
        without = refine(data, poles[others], fitted.terms, iterations=FEW_ITERATIONS).poles
        if not len(without):
            continue
        nearest = without[np.argmin(np.abs(poles[others][:, None] - without), axis=1)]
        moved = nearest - poles[others]
        moved *= np.minimum(1.0, -poles[others].real / np.maximum(np.abs(moved), np.finfo(float).tiny))
        variance[:, others] += share[number] * (1 - share[number]) * np.stack([moved.real, moved.imag]) ** 2
    return np.asarray(np.sqrt(variance).ravel())
