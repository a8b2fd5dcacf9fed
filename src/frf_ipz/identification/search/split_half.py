"""Split-half check: whether modes come up in each half of the lines, and by how much to raise standard deviations.

Where the noise is not known, or the model does not reach it, the choice of modes is uncertain as well, which no misfit
shows: another choice gives other poles. So the even and the odd lines are each fitted by themselves, the choice of
modes included [Quenouille1956]. Where the halves differ by more than the stated standard deviations, these are raised.
A mode that does not come up in both halves may exist or not: its neighbours are uncertain by the distance that they
move without it [Buckland1997].

[Quenouille1956] M. H. Quenouille, Notes on bias in estimation, Biometrika 43, 1956, 353-360, doi:10.2307/2332914.
[Buckland1997] S. T. Buckland, K. P. Burnham, N. H. Augustin, Model selection: an integral part of inference, Biometrics
53, 1997, 603-618, doi:10.2307/2533961.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.errors import NoModesError
from frf_ipz.identification.likelihood.refinement import refine_poles
from frf_ipz.identification.measured_lines import FEWEST_LINES
from frf_ipz.identification.search.find_modes import FittedModes, find_modes, variance_factors
from frf_ipz.identification.search.spurious_poles import DEMANDED, half_widths_apart
from frf_ipz.late_imports import import_late
from frf_ipz.rational import damping_ratio, natural_frequency_hz

if TYPE_CHECKING:
    from scipy import optimize

    from frf_ipz.frf import FrfSet
    from frf_ipz.identification.options import FitOptions
else:
    optimize = import_late("scipy.optimize")

HALVES = 2
SAME_POLE = 0.5  # half widths of the narrower of two poles within which they are one mode
CHANCE = 0.05  # that halves with true standard deviations differ so much that these are raised
NARROW = 0.5  # half width, in lines of a half, below which a half may have no line on a peak: it confirms nothing then
FEW_ITERATIONS = 4  # of a fit without one of its poles: the rest hardly move


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SplitHalf:
    """How a fit to all lines compares with those to the two halves.

    Parameters
    ----------
    n_halves : (n_poles,) int array
        In how many of the halves each pole comes up; both, where it is too narrow for the lines of a half.
    scatter : float
        Difference of the halves over its standard deviation, root of mean square; 1 where chance explains it.
    variance_factor : (2 n_poles,) array
        Factor by which the stated variance of each pole covers the differences of the halves, at least 1: all real
        parts, then all imaginary parts.
    shift : (2 n_poles,) array
        Standard deviation of each pole by neighbouring modes that may exist or not: all real parts, then all
        imaginary parts, rad/s.
    """

    n_halves: IntArray
    scatter: float
    variance_factor: FloatArray
    shift: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Half:
    poles: ComplexArray
    variance: FloatArray


def unconfirmed_reasons(halves: SplitHalf | None, modes: IntArray) -> tuple[str, ...]:
    """Give the reason why a mode is not confirmed by the halves.

    Parameters
    ----------
    halves : SplitHalf or None
        The check; None where there was none.
    modes : (n_modes,) int array
        Indices of the modes among the poles.

    Returns
    -------
    tuple of str
        Empty for a mode that comes up in both halves.
    """
    if halves is None:
        return ("",) * len(modes)
    reasons = {0: "comes up in neither half", 1: "comes up in one half only"}
    why = " of the lines (even, odd), when each is fitted by itself"
    return tuple(reasons[count] + why if count < HALVES else "" for count in halves.n_halves[modes].tolist())


def without_unconfirmed(fitted: FittedModes, halves: SplitHalf, options: FitOptions) -> tuple[FittedModes, SplitHalf]:
    """Drop the modes that neither half has, though it would see them, or that are weak or under another's peak.

    A mode that is wider than the spacing of a half's lines would stand in each half as it stands in all, where the
    errors of lines are their own; those of one impact are common to the lines of a peak.

    Parameters
    ----------
    fitted : FittedModes
        The fit of all lines.
    halves : SplitHalf
        How it compares with those of the halves.
    options : FitOptions
        Pinned poles, which stay.

    Returns
    -------
    (FittedModes, SplitHalf)
        Without these modes; the decisions list them.
    """
    poles, significance = fitted.fit.poles, fitted.goodness.significance
    hertz = natural_frequency_hz(poles)
    inside = (hertz >= fitted.lines.band_hz[0]) & (hertz <= fitted.lines.band_hz[1])
    shares_peak = (
        (half_widths_apart(poles) < 1) & (halves.n_halves == HALVES) & (significance > significance[:, None])
    ).any(axis=1)
    has_own_errors = fitted.noise_from == "misfit"
    is_resolved = has_own_errors & (-poles.real / np.pi > HALVES * fitted.lines.line_hz)
    dropped = inside & (halves.n_halves == 0) & (shares_peak | is_resolved | (significance < DEMANDED))
    for pin in options.pinned:
        dropped[np.argmin(np.abs(hertz - pin.hz))] = False
    if not dropped.any() or not (inside & ~dropped).any():  # no fit without a mode
        return fitted, halves
    data = replace(fitted.lines.weighted(), real_modes=fitted.fit.system.real_modes)
    fit = refine_poles(data, poles[~dropped], fitted.terms)
    kept = optimize.linear_sum_assignment(np.abs(fit.poles[:, None] - poles) / np.abs(poles))[1]
    decisions = [
        {
            "frequency_hz": float(hertz[number]),
            "damping_ratio": float(damping_ratio(poles[[number]])[0]),
            "action": "dropped",
            "reason": "comes up in neither half of the lines (even, odd), when each is fitted by itself, and "
            + _why_dropped(shares_peak=shares_peak[number], is_resolved=is_resolved[number])
            + f"; [fit] pin_hz = [{hertz[number]:.6g}] calls it back",
        }
        for number in np.flatnonzero(dropped).tolist()
    ]
    goodness = fitted.goodness.of_poles(poles, fit.poles)
    parts = np.concatenate([kept, kept + len(poles)])
    return (
        replace(fitted, fit=fit, goodness=goodness, decisions=(*fitted.decisions, *decisions)),
        replace(
            halves,
            n_halves=halves.n_halves[kept],
            variance_factor=halves.variance_factor[parts],
            shift=halves.shift[parts],
        ),
    )


def _why_dropped(*, shares_peak: bool, is_resolved: bool) -> str:
    if shares_peak:
        return "shares the peak of a mode that does"
    return "is wide enough to stand in each" if is_resolved else "hardly stands out"


def fit_halves(frfs: FrfSet, fitted: FittedModes, options: FitOptions) -> SplitHalf | None:
    """Fit each half of the lines, the choice of modes included.

    Parameters
    ----------
    frfs : FrfSet
        The measured FRFs.
    fitted : FittedModes
        The fit of all lines.
    options : FitOptions
        Of the fit.

    Returns
    -------
    SplitHalf or None
        None where the lines are too few.
    """
    if np.count_nonzero(fitted.lines.used) < 2 * HALVES * FEWEST_LINES:
        return None
    advanced = replace(frfs, values=frfs.values * np.exp(frfs.s[:, None] * fitted.delay_s))
    options = replace(options, band_hz=fitted.lines.band_hz, delay=False)
    numbers = np.arange(frfs.n_lines)
    halves = [
        _fit_half(advanced.select_lines(numbers % HALVES == number), options, fitted.model_error)
        for number in range(HALVES)
    ]
    poles = fitted.fit.poles
    partners = np.stack([_partners(poles, half.poles) for half in halves])
    in_both = (partners >= 0).all(axis=0)
    line = 2 * np.pi * HALVES * fitted.lines.line_hz
    n_halves = np.where(-poles.real < NARROW * line, HALVES, np.sum(partners >= 0, axis=0))
    pairs = [
        (half.poles[partner[in_both]], half.variance[:, partner[in_both]])
        for half, partner in zip(halves, partners, strict=True)
    ]
    difference = pairs[0][0] - pairs[1][0]
    variance = pairs[0][1] + pairs[1][1]
    scatter = _scatter(np.stack([difference.real, difference.imag]) ** 2 / variance)
    factor = np.ones((2, len(poles)))
    if scatter > 1:
        # all lines have half the variance of one of the halves, that is a quarter of the difference's
        stated = (variance_factors(fitted) * _white_noise_variance(fitted)).reshape(2, -1)
        needed = scatter**2 * variance / HALVES**2 / stated[:, in_both]
        factor[:, in_both] = needed
        factor[:, ~in_both] = np.median(needed)
    return SplitHalf(
        n_halves=n_halves,
        scatter=scatter,
        variance_factor=np.maximum(factor, 1.0).ravel(),
        shift=_shift_without_unconfirmed(fitted, n_halves),
    )


def _fit_half(frfs: FrfSet, options: FitOptions, model_error: FloatArray | None) -> _Half:
    try:
        fitted = find_modes(frfs, options, model_error=model_error)
    except NoModesError:  # no mode stands out of the noise
        return _Half(poles=np.zeros(0, complex), variance=np.zeros((2, 0)))
    variance = variance_factors(fitted) * _white_noise_variance(fitted)
    return _Half(poles=fitted.fit.poles, variance=variance.reshape(2, -1))


def _white_noise_variance(fitted: FittedModes) -> FloatArray:
    """Variance of each pole by white noise, (2 n_poles,)."""
    return np.asarray(np.diag(np.linalg.pinv(fitted.fit.information, hermitian=True)))


def _partners(poles: ComplexArray, half_poles: ComplexArray) -> IntArray:
    """Index of each pole's partner among those of a half, or -1."""
    partners = np.full(len(poles), -1)
    width = np.minimum(-poles.real[:, None], -half_poles.real)
    width = np.maximum(width, np.finfo(float).eps * np.abs(half_poles))  # a single line has no width
    distance = np.minimum(np.abs(poles[:, None] - half_poles) / (SAME_POLE * width), 2.0)
    rows, columns = optimize.linear_sum_assignment(distance)
    is_same = distance[rows, columns] < 1
    partners[rows[is_same]] = columns[is_same]
    return partners


def _scatter(squares: FloatArray) -> float:
    if not squares.size or np.sum(squares) < special.chdtri(squares.size, CHANCE):
        return 1.0
    return float(np.sqrt(np.mean(squares)))


def _shift_without_unconfirmed(fitted: FittedModes, n_halves: IntArray) -> FloatArray:
    """Find how far each pole moves without those, one by one, that do not come up in both halves."""
    poles = fitted.fit.poles
    data = replace(fitted.lines.weighted(), real_modes=fitted.fit.system.real_modes)
    share = (1 + n_halves) / (1 + HALVES)  # of the three fits that have it
    variance = np.zeros((2, len(poles)))
    for number in np.flatnonzero(n_halves < HALVES).tolist():
        neighbours = np.delete(np.arange(len(poles)), number)
        refitted = refine_poles(data, poles[neighbours], fitted.terms, iterations=FEW_ITERATIONS).poles
        if not len(refitted):
            continue
        nearest = refitted[np.argmin(np.abs(poles[neighbours][:, None] - refitted), axis=1)]
        shift = nearest - poles[neighbours]
        reach = -poles[neighbours].real
        shift *= reach / np.maximum(np.abs(shift), reach)
        variance[:, neighbours] += share[number] * (1 - share[number]) * np.stack([shift.real, shift.imag]) ** 2
    return np.asarray(np.sqrt(variance).ravel())
