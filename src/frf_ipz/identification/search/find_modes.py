"""Modes, their number included, from measured lines, and how far the misfit, not the noise, limits them.

Start: polyreference LSCF. Then maximum likelihood by variable projection, with poles added and dropped as the lines
demand.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import log
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from frf_ipz.errors import NumericalError
from frf_ipz.identification.likelihood.compression import response
from frf_ipz.identification.likelihood.delay import find_delays
from frf_ipz.identification.likelihood.refinement import Refined, refine
from frf_ipz.identification.likelihood.sandwich import levels_of_poles
from frf_ipz.identification.likelihood.smooth_terms import SmoothTerms, all_terms
from frf_ipz.identification.measured_lines import MeasuredLines, measured_lines, with_noise_of
from frf_ipz.identification.search.drift import Drift
from frf_ipz.identification.search.goodness_of_fit import Judgement, judge, peak_levels
from frf_ipz.identification.search.selection import Selected, select_modes
from frf_ipz.identification.stabilization import start_poles
from frf_ipz.progress import Progress, silent

if TYPE_CHECKING:
    from frf_ipz.frf import FrfSet
    from frf_ipz.identification.options import FitOptions

FIXED_POLES = 3  # beside the band, while modes are searched
DELAY_ROUNDS = 2  # of finding delays and poles in turn
MODEL_ERROR = 1.3  # misfit over noise above which the model, not the noise, limits the fit


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fitted:
    """Poles, and what they were fitted to.

    Parameters
    ----------
    lines : MeasuredLines
        With the variance that weighs them.
    terms : SmoothTerms
        What lies out of band.
    fit : Refined
        Poles and residues.
    judgement : Judgement
        Of the fit.
    excess : (n_frfs,) array
        Misfit over noise.
    noise : (n_lines, n_frfs) array
        Variance without what the model fails to follow, as receptances, (m/N)^2.
    noise_from : str
        ``recordings`` or ``misfit``.
    drift : Drift or None
        The drift, where there is one.
    start : DataFrame
        Poles of the start.
    decisions : tuple of dict
        What was added, dropped, pinned and struck.
    delay_s : (n_frfs,) array
        Delays that were taken off.
    poles_are_held : bool
        Poles are known from elsewhere.
    """

    lines: MeasuredLines
    terms: SmoothTerms
    fit: Refined
    judgement: Judgement
    excess: FloatArray
    noise: FloatArray
    noise_from: str
    drift: Drift | None
    start: pd.DataFrame
    decisions: tuple[dict[str, object], ...]
    delay_s: FloatArray
    poles_are_held: bool = False


def find_modes(frfs: FrfSet, options: FitOptions, *, progress: Progress = silent) -> Fitted:
    """Find the modes that the lines ask for.

    Parameters
    ----------
    frfs : FrfSet
        Measured FRFs; with their variance where it is known.
    options : FitOptions
        Band, what the user has pinned and struck, kind of modes.
    progress : Progress
        Told how far the search is.

    Returns
    -------
    Fitted
        Poles at the optimum.

    Raises
    ------
    InputError
        If no lines are left to fit.
    NumericalError
        If no mode is found.
    """
    progress(0.0, "choosing lines")
    lines = measured_lines(frfs, options)
    progress(0.05, "looking for first poles")
    start = start_poles(frfs, lines, max_order=options.max_order)
    terms = all_terms(lines.band_hz, lines.line_hz).first(FIXED_POLES)
    progress(0.2, "adding and dropping poles")
    delay_s = np.zeros(frfs.n_frfs)
    if options.delay:
        lines, delay_s = _without_delays(frfs, lines, start.poles, terms, options)
    selected = _selected(lines, start.poles, terms, options, noise_is_known=bool(lines.known.all()))
    progress(0.5, "refining")
    fitted = _refined(lines, selected, terms, start=start.table, delay_s=delay_s)
    if np.median(fitted.excess) > MODEL_ERROR:
        progress(0.55, "adding and dropping poles by what no model follows")
        fitted = _against_model_error(fitted, options)
    return fitted


def _against_model_error(fitted: Fitted, options: FitOptions) -> Fitted:
    """Choose the modes anew, with an error that follows each FRF added to the noise.

    Weighed by the noise alone, the quietest lines decide, and which poles stand for what no model follows there is
    chance.
    """
    left = np.abs(fitted.lines.receptance - response(fitted.fit.system, fitted.terms, fitted.lines.s)) ** 2
    power = np.abs(fitted.lines.receptance) ** 2
    # an exponential distribution has ln 2 times its mean at the median
    error = np.median(np.maximum(left - fitted.noise, 0.0) / np.maximum(power, np.finfo(float).tiny), axis=0) / log(2)
    lines = replace(fitted.lines, variance=fitted.noise + error * power)
    selected = _selected(lines, fitted.fit.poles, fitted.terms, options, noise_is_known=False)
    lines = replace(lines, known=np.ones_like(lines.known))  # the model error is part of it: not to be found again
    second = _refined(lines, selected, fitted.terms, start=fitted.start, delay_s=fitted.delay_s, model_limits=True)
    left = np.abs(second.lines.receptance - response(second.fit.system, second.terms, second.lines.s)) ** 2
    free = len(left) - second.fit.system.n_linear / 2
    return replace(
        second,
        lines=replace(second.lines, known=fitted.lines.known),
        excess=np.sqrt(np.sum(left / fitted.noise, axis=0) / free),
        noise=fitted.noise,
        drift=second.drift or fitted.drift,
        decisions=(*fitted.decisions, *(one for one in second.decisions if one["action"] in ("added", "dropped"))),
    )


def _selected(
    lines: MeasuredLines,
    poles: ComplexArray,
    terms: SmoothTerms,
    options: FitOptions,
    *,
    noise_is_known: bool,
) -> Selected:
    data = replace(lines.weighted(shared=True), real_modes=options.modes == "real")
    selected = select_modes(data, poles, terms, options, noise_is_known=noise_is_known)
    if not mode_order(selected.fit.poles, (2 * np.pi * lines.band_hz[0], 2 * np.pi * lines.band_hz[1]))[1]:
        raise NumericalError(
            f"no mode stands out of the noise between {lines.band_hz[0]:g} and {lines.band_hz[1]:g} Hz; "
            "look at the FRFs and their coherence, set another [fit] band_hz, or pin a mode with pin_hz"
        )
    return selected


def _without_delays(
    frfs: FrfSet, lines: MeasuredLines, poles: ComplexArray, terms: SmoothTerms, options: FitOptions
) -> tuple[MeasuredLines, FloatArray]:
    """Find the delay of each channel that makes the modes look normal, and take it off.

    Complex residues follow a short delay almost exactly: they give good poles, and say nothing of the delay.
    """
    channels = [label.output_channel or label.output_dof.name for label in frfs.labels]
    numbers = np.asarray(np.unique(channels, return_inverse=True)[1], np.int64)
    advanced, delays = lines, np.zeros(frfs.n_frfs)
    for _ in range(DELAY_ROUNDS):
        complex_modes = replace(options, modes="complex")
        poles = _selected(advanced, poles, terms, complex_modes, noise_is_known=bool(lines.known.all())).fit.poles
        data = replace(lines.weighted(shared=True), real_modes=True)
        delays = find_delays(data, poles, terms, numbers)
        advanced = replace(lines, receptance=lines.receptance * np.exp(lines.s[:, None] * delays))
    return advanced, delays


def _refined(
    lines: MeasuredLines,
    selected: Selected,
    terms: SmoothTerms,
    *,
    start: pd.DataFrame,
    delay_s: FloatArray,
    model_limits: bool = False,
) -> Fitted:
    """Fit once more with the best weights, and find out whether noise or model limits the fit."""
    fit, data, judgement = selected.fit, selected.data, selected.judgement
    lines = replace(lines, receptance=data.receptance)
    if not lines.known.all():
        lines = with_noise_of(lines, judgement.misfit / data.weight)
    final = replace(lines.weighted(), real_modes=data.real_modes)
    if not (lines.known.all() and final.is_shared and fit.has_converged):  # otherwise the search has done it
        fit = refine(final, fit.poles, terms)
        judgement = judge(final, fit, terms)
    excess, noise, noise_from = excess_of(judgement, fit), lines.variance, "recordings"
    if model_limits or not lines.known.all() or np.median(excess) > MODEL_ERROR:
        noise_from = "misfit"
        lines = replace(lines, variance=lines.variance * judgement.level)
        fit = refine(replace(lines.weighted(), real_modes=data.real_modes), fit.poles, terms)
    return Fitted(
        lines=lines,
        terms=terms,
        fit=fit,
        judgement=judgement,
        excess=excess,
        noise=noise,
        noise_from=noise_from,
        drift=selected.drift,
        start=start,
        decisions=selected.decisions,
        delay_s=delay_s,
    )


def levels(fitted: Fitted) -> FloatArray:
    """Find the factor on the variance of each pole that the misfit shows.

    Parameters
    ----------
    fitted : Fitted
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
    left = (data.receptance - response(fitted.fit.system, fitted.terms, data.s)) * data.weight
    at_peaks = np.maximum(fitted.judgement.missing[-1].level_at(poles), peak_levels(data, fitted.fit, left))
    return np.asarray(np.maximum(np.tile(at_peaks, 2), levels_of_poles(data, fitted.fit, fitted.terms)))


def excess_of(judgement: Judgement, fit: Refined) -> FloatArray:
    """Set the misfit of each FRF against its noise.

    Parameters
    ----------
    judgement : Judgement
        Of the fit.
    fit : Refined
        The fit.

    Returns
    -------
    (n_frfs,) array
        Root of mean square.
    """
    free = 2 * len(judgement.misfit) - fit.system.n_linear
    return np.asarray(np.sqrt(np.sum(np.abs(judgement.misfit) ** 2, axis=0) / free))


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
        Places in the order wanted.
    n_modes : int
        How many lie in the band.
    """
    modulus = np.abs(poles)
    inside: BoolArray = (modulus >= band_rad_s[0]) & (modulus <= band_rad_s[1])
    return np.lexsort((modulus, ~inside)), int(np.count_nonzero(inside))
