"""Modes, their number included, from measured lines, and how far the misfit, not the noise, limits them.

Start: polyreference LSCF. Then maximum likelihood by variable projection, with poles added and dropped as the lines
support them.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from math import log
from operator import itemgetter
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from frf_ipz.errors import NoModesError
from frf_ipz.identification.likelihood.compression import (
    CompressedSystem,
    column_gains,
    compress,
    response,
    solve_upper,
)
from frf_ipz.identification.likelihood.delay import find_delays
from frf_ipz.identification.likelihood.refinement import RefinedPoles, refine_poles
from frf_ipz.identification.likelihood.sandwich import pole_variance_factors
from frf_ipz.identification.likelihood.smooth_terms import SmoothTerms, smooth_terms_of_band
from frf_ipz.identification.measured_lines import (
    MeasuredLines,
    WeightedLines,
    measured_lines,
    misfit_square,
    with_misfit_noise,
)
from frf_ipz.identification.noise import smooth_level, squared_differences
from frf_ipz.identification.search.arrivals import find_arrivals
from frf_ipz.identification.search.candidates import find_candidates
from frf_ipz.identification.search.delays import (
    CommonDelay,
    common_delay,
    each_delay,
    explains_misfit,
    late_channels,
    measure_delay,
)
from frf_ipz.identification.search.discrepancy import with_discrepancy
from frf_ipz.identification.search.drift import Drift
from frf_ipz.identification.search.force_error import ForceError
from frf_ipz.identification.search.goodness_of_fit import LEVEL_SCATTER, GoodnessOfFit, assess_fit, peak_levels
from frf_ipz.identification.search.selection import (
    ROUGH_ITERATIONS,
    SelectedModes,
    drop_insignificant,
    select_modes,
)
from frf_ipz.identification.search.spurious_poles import half_widths_apart
from frf_ipz.identification.stabilization import StartPoles, find_start_poles
from frf_ipz.late_imports import import_late
from frf_ipz.progress import Progress, silent

if TYPE_CHECKING:
    import pandas as pd

    from frf_ipz.frf import FrfSet
    from frf_ipz.identification.options import FitOptions
else:
    pd = import_late("pandas")

FIXED_POLES = 3  # beside the band, while modes are searched
NOISE_ROUNDS = 3  # of fitting the start poles and estimating the noise in turn
FAR_LOWER = 0.25  # of a variance: the estimates themselves scatter by less
LEAST_SPARE = 0.25  # of the numbers that an FRF has must be left to tell the noise of a model
FAR_OFF = 1.0  # periods of the highest frequency: to within it an arrival is known
LATE_MISFIT = 0.5  # times the misfit that is left with the delay: it explains most of its square
MODEL_ERROR = 1.3  # misfit over noise above which the model, not the noise, limits the fit


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FittedModes:
    """Poles of the modes, and the lines that they were fitted to.

    Parameters
    ----------
    lines : MeasuredLines
        With the variance that weighs them.
    terms : SmoothTerms
        Terms for modes out of band.
    fit : RefinedPoles
        Poles and residues.
    goodness : GoodnessOfFit
        Of the fit.
    misfit_ratio : (n_frfs,) array
        Misfit over noise.
    noise : (n_lines, n_frfs) array
        Variance without the model error, as receptances, (m/N)^2.
    noise_from : str
        ``recordings`` or ``misfit``.
    drift : Drift or None
        The drift, where there is one.
    force_error : ForceError or None
        The error of the force that FRFs share, where there is one.
    start : DataFrame
        Start poles.
    decisions : tuple of dict
        Poles that were added, dropped, pinned and rejected, with the reason.
    delay_s : (n_frfs,) array
        Delays that were taken off.
    common_delay : CommonDelay or None
        The delay that all FRFs share, where there is one and the user asked for no other.
    has_delayed_channels : bool
        Each channel has a delay of its own, though the user did not ask for that.
    poles_are_held : bool
        Poles are given and were not fitted.
    model_error : (n_frfs,) array or None
        Mean square of the error of the model in parts of each FRF's, where it and not the noise limits the fit.
    """

    lines: MeasuredLines
    terms: SmoothTerms
    fit: RefinedPoles
    goodness: GoodnessOfFit
    misfit_ratio: FloatArray
    noise: FloatArray
    noise_from: str
    drift: Drift | None
    force_error: ForceError | None
    start: pd.DataFrame
    decisions: tuple[dict[str, object], ...]
    delay_s: FloatArray
    common_delay: CommonDelay | None = None
    has_delayed_channels: bool = False
    poles_are_held: bool = False
    model_error: FloatArray | None = None


def find_modes(
    frfs: FrfSet, options: FitOptions, *, model_error: FloatArray | None = None, progress: Progress = silent
) -> FittedModes:
    """Find the modes that the lines support.

    Parameters
    ----------
    frfs : FrfSet
        Measured FRFs; with their variance where it is known.
    options : FitOptions
        Band, pinned and rejected poles, kind of modes.
    model_error : (n_frfs,) array, optional
        Error of the model where it is known to limit the fit, as `FittedModes` has it.
    progress : Progress
        Reports how far the search is.

    Returns
    -------
    FittedModes
        Poles at the optimum.

    Raises
    ------
    InputError
        If too few lines remain to be fitted.
    NoModesError
        If no mode is found.
    """
    progress(0.0, "choosing lines")
    lines = measured_lines(frfs, options)
    if model_error is not None:
        return _find_by_model_error(frfs, lines, options, model_error)
    late = _fit_late_responses(frfs, lines, options, progress) if options.delay is None else None
    if late is not None and np.median(late.misfit_ratio) < MODEL_ERROR:
        return late
    try:
        fitted = _find_modes(frfs, lines, options, progress)
    except NoModesError:
        if late is None:
            raise
        return late
    if late is not None and np.median(late.misfit_ratio) < LATE_MISFIT * np.median(fitted.misfit_ratio):
        fitted = late
    if options.delay is not None:
        return fitted
    fitted = _without_late_channels(frfs, fitted, options)
    if LATE_MISFIT * _rms(fitted.misfit_ratio) > 1:  # at least the noise is left
        return _fit_delayed_channels(frfs, fitted, options) or fitted
    return fitted


def _fit_late_responses(
    frfs: FrfSet, lines: MeasuredLines, options: FitOptions, progress: Progress
) -> FittedModes | None:
    """Fit without a delay of periods, where the responses begin so much off the force; None where that is no better.

    It comes before all else, as enough poles describe any delay: of late responses they are modes that do not exist.
    """
    arrivals_s = find_arrivals(lines)
    if not len(arrivals_s) or abs(arrivals_s[0]) * lines.band_hz[1] < FAR_OFF:
        return None
    progress(0.02, "looking for responses that are far too late")
    _, misfit_without = _first_delay(frfs, lines, 0.0, options)
    trials = sorted((_first_delay(frfs, lines, float(first_s), options) for first_s in arrivals_s), key=itemgetter(1))
    best: tuple[float, FittedModes] | None = None
    for first_s, misfit in trials:
        if not misfit < LATE_MISFIT**2 * misfit_without:
            break
        late = _fit_from(frfs, first_s, options)
        if late is not None and (best is None or np.median(late.misfit_ratio) < np.median(best[1].misfit_ratio)):
            best = first_s, late
        if best is not None and np.median(best[1].misfit_ratio) < MODEL_ERROR:
            break
    if best is None:
        return None
    first_s, late = best
    delay_s = first_s + float(late.delay_s[0])
    weighed = replace(late.lines, variance=late.noise).advanced(np.full(frfs.n_frfs, -delay_s))
    delay = measure_delay(weighed, late.fit.poles, late.terms, delay_s)
    if not np.isfinite(delay.std_s):
        return None
    return replace(late, delay_s=np.full(frfs.n_frfs, delay_s), common_delay=delay)


def _first_delay(frfs: FrfSet, lines: MeasuredLines, first_s: float, options: FitOptions) -> tuple[float, float]:
    """Find a delay near a first one by normal modes that are roughly right, and their misfit.

    Where there is no mode, terms that are smooth over the lines may describe them all.
    """
    advanced = lines.advanced(np.full(frfs.n_frfs, first_s))
    start = find_start_poles(frfs, advanced, max_order=options.max_order)
    terms = smooth_terms_of_band(lines.band_hz, lines.line_hz).first(FIXED_POLES)
    data = advanced.weighted(shared=True)
    if not len(start.poles):
        return first_s, float(np.sum(compress(data, start.poles, terms).misfit))
    fit = refine_poles(data, start.poles, terms, iterations=ROUGH_ITERATIONS)
    delays_s, misfit = find_delays(data.with_real_modes(), fit.poles, terms, np.zeros(frfs.n_frfs, np.int64))
    return first_s + float(delays_s[0]), misfit


def _fit_from(frfs: FrfSet, first_s: float, options: FitOptions) -> FittedModes | None:
    """Fit without a first delay; None where no mode is found."""
    advanced = replace(frfs, values=frfs.values * np.exp(frfs.s[:, None] * first_s))
    try:
        return _find_modes(advanced, measured_lines(advanced, options), options, silent)
    except NoModesError:
        return None


def _rms(ratios: FloatArray) -> float:
    """Take FRFs together: where one sensor of several is late, the median FRF tells nothing of it."""
    return float(np.sqrt(np.mean(ratios**2)))


def _fit_delayed_channels(frfs: FrfSet, fitted: FittedModes, options: FitOptions) -> FittedModes | None:
    """Fit each channel's own delay, where that takes off most of the misfit; else None."""
    lines = replace(fitted.lines, variance=fitted.noise)
    if not explains_misfit(frfs.labels, lines, fitted.fit.poles, fitted.terms):
        return None
    own = replace(options, delay=True)
    delayed = _find_modes(frfs, measured_lines(frfs, own), own, silent)
    if _rms(delayed.misfit_ratio) > LATE_MISFIT * _rms(fitted.misfit_ratio):
        return None
    return replace(delayed, has_delayed_channels=True)


def _without_late_channels(frfs: FrfSet, fitted: FittedModes, options: FitOptions) -> FittedModes:
    """Fit anew without the delays of channels whose modes are normal but for these.

    Complex residues follow short delays: a fit without them leaves no more. Where it does, they were errors of it.
    """
    lines = fitted.lines  # but for what was taken off for an error of the force or a drift
    measured = frfs.values[lines.used] / lines.s[:, None] ** lines.powers
    weighed = replace(lines, receptance=measured, variance=fitted.noise).advanced(fitted.delay_s)
    own_s = late_channels(frfs.labels, weighed, fitted.fit.poles, fitted.terms)
    if not own_s.any():
        return fitted
    delay_s = fitted.delay_s + own_s
    delayed = _fit_advanced(frfs, delay_s, options)
    if _rms(delayed.misfit_ratio) > max(_rms(fitted.misfit_ratio), MODEL_ERROR):
        return fitted
    return replace(delayed, has_delayed_channels=True)


def _fit_advanced(frfs: FrfSet, delay_s: FloatArray, options: FitOptions) -> FittedModes:
    """Fit without delays, from the first poles on: those of late responses describe the delay as well."""
    advanced = replace(frfs, values=frfs.values * np.exp(frfs.s[:, None] * delay_s))
    without = replace(options, delay=False)
    return replace(_find_modes(advanced, measured_lines(advanced, without), without, silent), delay_s=delay_s)


def _find_modes(frfs: FrfSet, lines: MeasuredLines, options: FitOptions, progress: Progress) -> FittedModes:
    progress(0.05, "looking for first poles")
    start, all_terms, lines = _prepared(frfs, lines, options)
    terms = all_terms.first(FIXED_POLES)
    progress(0.2, "adding and dropping poles")
    noise_is_known = bool(lines.known.all())

    def fit_lines(lines: MeasuredLines, delay_s: FloatArray) -> FittedModes:
        selected, chosen = _select_with_terms(lines, start.poles, all_terms, options, noise_is_known=noise_is_known)
        progress(0.5, "refining")
        return _refine_with_final_weights(lines, selected, chosen, options, start=start.table, delay_s=delay_s)

    def find_poles(lines: MeasuredLines) -> ComplexArray:
        complex_modes = replace(options, modes="complex")
        return _select(lines, start.poles, terms, complex_modes, noise_is_known=noise_is_known).fit.poles

    if options.delay:
        delay_s = each_delay(frfs.labels, lines, terms, find_poles)
        fitted = fit_lines(lines.advanced(delay_s), delay_s)
    else:
        fitted = fit_lines(lines, np.zeros(frfs.n_frfs))
    if options.delay is None:
        progress(0.52, "looking for a delay that all responses share")
        weighed = replace(fitted.lines, receptance=lines.receptance, variance=fitted.noise)
        delay = common_delay(weighed, fitted.fit.poles, terms, find_poles)
        if delay is not None:
            return replace(_fit_advanced(frfs, np.full(frfs.n_frfs, delay.delay_s), options), common_delay=delay)
    if np.median(fitted.misfit_ratio) > MODEL_ERROR:
        progress(0.55, "adding and dropping poles by the model error")
        with suppress(NoModesError):  # where the model error hides them all, those of the noise alone are what there is
            fitted = _against_model_error(fitted, options)
    return fitted


def _prepared(frfs: FrfSet, lines: MeasuredLines, options: FitOptions) -> tuple[StartPoles, SmoothTerms, MeasuredLines]:
    """Find first poles and the terms that there may be, and give the lines the variance that no model is needed for."""
    start = find_start_poles(frfs, lines, max_order=options.max_order, stability=options.stability)
    all_terms = smooth_terms_of_band(lines.band_hz, lines.line_hz)
    terms = all_terms.first(FIXED_POLES)
    lines = _with_noise_beside_peaks(lines, start.poles, terms)
    return start, all_terms, with_discrepancy(frfs, lines, start.poles, terms, options)


def _select_with_terms(
    lines: MeasuredLines, poles: ComplexArray, all_terms: SmoothTerms, options: FitOptions, *, noise_is_known: bool
) -> tuple[SelectedModes, SmoothTerms]:
    """Choose the modes, and anew where the lines ask for more fixed poles: some modes may have stood for them."""
    few = all_terms.first(FIXED_POLES)
    selected = _select(lines, poles, few, options, noise_is_known=noise_is_known)
    more = _needed_terms(selected.data, selected.fit.poles, all_terms)
    if more.n_columns == few.n_columns:
        return selected, few
    other = _select(lines, selected.fit.poles, more, options, noise_is_known=noise_is_known)
    n_shared, n_shared_before = (
        np.count_nonzero(np.triu(half_widths_apart(one.fit.poles) < 1, 1)) for one in (other, selected)
    )
    return (selected, few) if n_shared > n_shared_before else (other, more)  # more shared: a drift, no lack of poles


def _find_by_model_error(
    frfs: FrfSet, lines: MeasuredLines, options: FitOptions, model_error: FloatArray
) -> FittedModes:
    """Find the modes where the error of the model is known: weighed by the noise alone, they would be chosen twice."""
    start, all_terms, lines = _prepared(frfs, lines, options)
    noise = lines.variance
    weighed = _with_model_error(lines, model_error)
    selected, terms = _select_with_terms(weighed, start.poles, all_terms, options, noise_is_known=False)
    fitted = _refine_with_final_weights(
        replace(weighed, known=np.ones_like(weighed.known)),
        selected,
        terms,
        options,
        start=start.table,
        delay_s=np.zeros(frfs.n_frfs),
        model_limits=True,
    )
    return replace(fitted, noise=noise, model_error=model_error)


def _with_model_error(lines: MeasuredLines, model_error: FloatArray) -> MeasuredLines:
    return replace(lines, variance=lines.variance + model_error * np.abs(lines.receptance) ** 2)


def _needed_terms(data: WeightedLines, poles: ComplexArray, terms: SmoothTerms) -> SmoothTerms:
    """Take fixed poles beyond the first where the BIC of any FRF demands them and their lack bends the modes.

    It bends them where a residue, or the step to a better pole, changes by more than the largest of as many errors.
    Else the numbers that fixed poles cost are better spent on zeros.
    """
    n_lines, n_frfs = data.receptance.shape
    system = compress(data, poles, terms)
    few = terms.first(FIXED_POLES)
    n_spare = 2 * n_lines - system.n_linear
    if n_spare <= 0:
        return few
    level = np.maximum(system.misfit / n_spare, 1.0)
    fewer = range(FIXED_POLES, len(terms.poles))
    columns = [list(range(terms.first(n_fixed).n_columns, terms.n_columns)) for n_fixed in fewer]
    demanded = np.array([len(group) * log(2 * n_lines) + 2 * log(n_frfs) for group in columns])
    is_too_few = (column_gains(system, columns) / level > demanded[:, None]).any(axis=1)
    if not is_too_few.any():
        return few
    many = terms.first(int(np.max(np.array(fewer)[is_too_few])) + 1)
    of_modes, std = _numbers_of_modes(system if many.n_columns == terms.n_columns else compress(data, poles, many))
    moved = (of_modes - _numbers_of_modes(compress(data, poles, few))[0]) / (std * np.sqrt(level)[:, None])
    return many if np.abs(moved).max() > np.sqrt(2 * log(max(moved.size, 2))) else few


def _numbers_of_modes(system: CompressedSystem) -> tuple[FloatArray, FloatArray]:
    """Residues and changes of the poles, as all are free, (n_frfs, n), and their errors at noise as stated."""
    inverses = np.linalg.inv(system.U)
    std = np.sqrt(np.einsum("kij,kij->ki", inverses, inverses))
    return solve_upper(system.U, system.z)[:, system.n_smooth :], std[:, system.n_smooth :]


def _with_noise_beside_peaks(lines: MeasuredLines, poles: ComplexArray, terms: SmoothTerms) -> MeasuredLines:
    """Estimate anew the noise of FRFs whose peaks, on lines as far apart as their widths, were taken for it."""
    for _ in range(NOISE_ROUNDS):
        data = lines.weighted(shared=True)
        system = compress(data, poles, terms)
        spare = 1.0 - (system.n_linear + 2 * system.n_poles / lines.receptance.shape[1]) / (2 * len(lines.s))
        if lines.known.all() or spare < LEAST_SPARE:
            break
        misfit = lines.receptance - response(system, terms, lines.s)
        variance = with_misfit_noise(lines, misfit).variance / spare
        is_lower = lines.receptance.any(axis=0) & (np.median(variance / lines.variance, axis=0) < FAR_LOWER)
        if not is_lower.any():
            break
        lines = replace(lines, variance=np.where(is_lower, variance, lines.variance))
        poles = refine_poles(lines.weighted(shared=True), poles, terms, iterations=ROUGH_ITERATIONS).poles
    return lines


def _against_model_error(fitted: FittedModes, options: FitOptions) -> FittedModes:
    """Choose the modes anew, with an error in proportion to each FRF added to the noise.

    Weighted by the noise alone, the lines with the least noise decide, and it is chance which poles stand for the model
    error there.
    """
    squares = np.abs(fitted.lines.receptance - response(fitted.fit.system, fitted.terms, fitted.lines.s)) ** 2
    power = np.abs(fitted.lines.receptance) ** 2
    relative = np.maximum(squares - fitted.noise, 0.0) / np.maximum(power, np.finfo(float).tiny)
    error = np.median(relative, axis=0) / log(2)  # an exponential distribution has ln 2 times its mean at the median
    lines = _with_model_error(replace(fitted.lines, variance=fitted.noise), error)
    selected = _select(lines, fitted.fit.poles, fitted.terms, options, noise_is_known=False, drift=fitted.drift)
    lines = replace(lines, known=np.ones_like(lines.known))  # the model error is part of it: not to be estimated again
    refitted = _refine_with_final_weights(
        lines, selected, fitted.terms, options, start=fitted.start, delay_s=fitted.delay_s, model_limits=True
    )
    squares = np.abs(refitted.lines.receptance - response(refitted.fit.system, refitted.terms, refitted.lines.s)) ** 2
    degrees_of_freedom = len(squares) - refitted.fit.system.n_linear / 2
    return replace(
        refitted,
        common_delay=fitted.common_delay,
        lines=replace(refitted.lines, known=fitted.lines.known),
        misfit_ratio=np.sqrt(np.sum(squares / fitted.noise, axis=0) / degrees_of_freedom),
        noise=fitted.noise,
        model_error=error,
        drift=refitted.drift,
        force_error=refitted.force_error or fitted.force_error,
        decisions=(
            *fitted.decisions,
            *(decision for decision in refitted.decisions if decision["action"] in ("added", "dropped")),
        ),
    )


def _select(
    lines: MeasuredLines,
    poles: ComplexArray,
    terms: SmoothTerms,
    options: FitOptions,
    *,
    noise_is_known: bool,
    drift: Drift | None = None,
) -> SelectedModes:
    data = replace(lines.weighted(shared=True), real_modes=options.modes == "real")
    selected = select_modes(data, poles, terms, options, noise_is_known=noise_is_known, drift=drift)
    _require_modes(lines, selected.fit.poles)
    return selected


def _require_modes(lines: MeasuredLines, poles: ComplexArray) -> None:
    if not mode_order(poles, (2 * np.pi * lines.band_hz[0], 2 * np.pi * lines.band_hz[1]))[1]:
        raise NoModesError(
            f"no mode stands out of the noise between {lines.band_hz[0]:g} and {lines.band_hz[1]:g} Hz; "
            "look at the FRFs and their coherence, set another [fit] band_hz, or pin a mode with pin_hz"
        )


def _refine_with_final_weights(
    lines: MeasuredLines,
    selected: SelectedModes,
    terms: SmoothTerms,
    options: FitOptions,
    *,
    start: pd.DataFrame,
    delay_s: FloatArray,
    model_limits: bool = False,
) -> FittedModes:
    """Fit once more with the best weights, and find out whether noise or model limits the fit."""
    fit, data, goodness, decisions = selected.fit, selected.data, selected.goodness, selected.decisions
    lines = replace(lines, receptance=data.receptance)
    if not lines.known.all():
        lines = with_misfit_noise(lines, goodness.misfit / data.weight)
    final = replace(lines.weighted(), real_modes=data.real_modes)

    def refine(data: WeightedLines, poles: ComplexArray) -> tuple[RefinedPoles, GoodnessOfFit]:
        nonlocal decisions
        fit = refine_poles(data, poles, terms)
        noise_is_known = bool(lines.known.all())
        while True:  # what the search believed by its own weights
            rest, goodness, dropped = drop_insignificant(data, fit, terms, options, noise_is_known=noise_is_known)
            if not dropped:
                break
            decisions += dropped
            fit = refine_poles(data, rest.poles, terms)
        _require_modes(lines, fit.poles)
        return fit, goodness

    if not (lines.known.all() and final.is_shared and fit.has_converged):  # otherwise the search has done it
        fit, goodness = refine(final, fit.poles)
    misfit_ratio, noise, noise_from = misfit_over_noise(goodness, fit), lines.variance, "recordings"
    if model_limits or not lines.known.all() or np.median(misfit_ratio) > MODEL_ERROR:
        noise_from = "misfit"
        lower = _variance_below_model_error(lines, goodness, fit)
        lines = replace(lines, variance=np.where(np.isfinite(lower), lower, lines.variance * goodness.level))
        assessed, weighed = fit.poles, replace(lines.weighted(), real_modes=data.real_modes)
        fit = refine_poles(weighed, assessed, terms)
        goodness = goodness.of_poles(assessed, fit.poles)
        if np.isfinite(lower).any():  # correlation shows in what is left over its own size
            goodness = replace(goodness, candidates=assess_fit(weighed, fit, terms).candidates)
    elif (missed := misfit_ratio > MODEL_ERROR).any():
        for _ in range(NOISE_ROUNDS):  # what is missed draws the poles less each time
            lines = _with_missed_frfs(replace(lines, variance=noise), fit, terms, missed)
            fit, goodness = refine(replace(lines.weighted(), real_modes=data.real_modes), fit.poles)
        misfit = np.abs(lines.receptance - response(fit.system, terms, lines.s)) ** 2 / noise
        misfit_ratio = np.sqrt(np.sum(misfit, axis=0) / (len(misfit) - fit.system.n_linear / 2))
    return FittedModes(
        lines=lines,
        terms=terms,
        fit=fit,
        goodness=goodness,
        misfit_ratio=misfit_ratio,
        noise=noise,
        noise_from=noise_from,
        drift=selected.drift,
        force_error=selected.force_error,
        start=start,
        decisions=decisions,
        delay_s=delay_s,
    )


def _with_missed_frfs(lines: MeasuredLines, fit: RefinedPoles, terms: SmoothTerms, missed: BoolArray) -> MeasuredLines:
    """Weigh FRFs that the fit of all misses by what it leaves, and by how alike that is over the width of a mode."""
    misfit = lines.receptance - response(fit.system, terms, lines.s)
    variance = lines.variance.copy()
    squares = np.maximum(misfit_square(lines, misfit), variance)
    for frf in np.flatnonzero(missed):
        over_level = misfit[:, [frf]] * np.sqrt(2 / squares[:, [frf]])
        alike = find_candidates(lines.frequency_hz, over_level, 0).level_at(fit.poles)
        variance[:, frf] = squares[:, frf] * np.max(alike, initial=1.0)
    return replace(lines, variance=variance)


def _variance_below_model_error(lines: MeasuredLines, goodness: GoodnessOfFit, fit: RefinedPoles) -> FloatArray:
    """Give the mean square of the misfit where the noise is not known and it is clearly less than expected; else NaN.

    The search takes no structure for better than linear to a part in a thousand; the fit shows that this one is.
    """
    n_lines, n_frfs = goodness.misfit.shape
    spare = 1.0 - (fit.system.n_linear + 2 * fit.system.n_poles / n_frfs) / (2 * n_lines)
    if lines.known.all() or spare < LEAST_SPARE:
        return np.full((n_lines, n_frfs), np.nan)
    level = smooth_level(np.abs(goodness.misfit) ** 2) / (2 * spare)
    misfit = goodness.misfit / lines.weighted().weight
    variance = misfit_square(lines, misfit) / spare
    is_less = ~lines.known & (level < 1 / LEVEL_SCATTER)
    on_peaks = is_less * np.abs(lines.receptance) / variance**1.5
    differs = LEVEL_SCATTER * np.sum(on_peaks * squared_differences(misfit)) >= np.sum(on_peaks * np.abs(misfit) ** 2)
    return np.where(is_less & differs, variance, np.nan)  # what is alike on neighbouring lines is no noise


def variance_factors(fitted: FittedModes) -> FloatArray:
    """Find the factor on the variance of each pole that the misfit shows.

    Parameters
    ----------
    fitted : FittedModes
        Poles at the optimum.

    Returns
    -------
    (2 n_poles,) array
        For all real parts, then all imaginary parts: 1 where the noise is that of the recordings.
    """
    poles = fitted.fit.poles
    if fitted.noise_from == "recordings":
        return np.ones(2 * len(poles))
    data = fitted.lines.weighted()
    misfit = (data.receptance - response(fitted.fit.system, fitted.terms, data.s)) * data.weight
    at_peaks = np.maximum(fitted.goodness.candidates.level_at(poles), peak_levels(data, fitted.fit, misfit))
    return np.asarray(np.maximum(np.tile(at_peaks, 2), pole_variance_factors(data, fitted.fit, fitted.terms)))


def misfit_over_noise(goodness: GoodnessOfFit, fit: RefinedPoles) -> FloatArray:
    """Misfit of each FRF over its noise.

    Parameters
    ----------
    goodness : GoodnessOfFit
        Of the fit.
    fit : RefinedPoles
        The fit.

    Returns
    -------
    (n_frfs,) array
        Root of mean square.
    """
    degrees_of_freedom = 2 * len(goodness.misfit) - fit.system.n_linear
    return np.asarray(np.sqrt(np.sum(np.abs(goodness.misfit) ** 2, axis=0) / degrees_of_freedom))


def mode_order(poles: ComplexArray, band_rad_s: tuple[float, float]) -> tuple[IntArray, int]:
    """Order poles: modes of the band by frequency, then what lies beside it.

    Parameters
    ----------
    poles : (n_poles,) complex array
        rad/s.
    band_rad_s : pair of float
        The fitted band.

    Returns
    -------
    order : (n_poles,) int array
        Indices of the poles in that order.
    n_modes : int
        Number of poles in the band.
    """
    modulus = np.abs(poles)
    inside: BoolArray = (modulus >= band_rad_s[0]) & (modulus <= band_rad_s[1])
    return np.lexsort((modulus, ~inside)), int(np.count_nonzero(inside))
