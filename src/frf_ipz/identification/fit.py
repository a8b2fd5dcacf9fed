"""The fitter: from measured FRFs to poles, residues and zeros with their covariance, without clicks.

Start: polyreference LSCF. Then maximum likelihood by variable projection, with poles added and dropped as the lines
demand. Then errors of everything, from the Fisher information at the optimum.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from scipy import sparse

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.errors import NumericalError
from frf_ipz.identification.likelihood.alike import levels_of_poles
from frf_ipz.identification.likelihood.compression import response
from frf_ipz.identification.likelihood.covariance import FitErrors, fit_errors, value_std
from frf_ipz.identification.likelihood.delay import find_delays
from frf_ipz.identification.likelihood.refinement import Refined, refine
from frf_ipz.identification.likelihood.smooth_terms import SmoothTerms, all_terms
from frf_ipz.identification.lines.measured import MeasuredLines, measured_lines, with_noise_of
from frf_ipz.identification.modal_fit import ModalFit
from frf_ipz.identification.results.gains import find_gains
from frf_ipz.identification.results.measured_model import measured_model, mode_order, residue_covariance
from frf_ipz.identification.results.tables import misfit_table, mode_table
from frf_ipz.identification.results.zeros import FoundZeros, find_zeros
from frf_ipz.identification.root_covariance import RootCovariance
from frf_ipz.identification.search.drift import Drift, find_drift
from frf_ipz.identification.search.judgement import Judgement, judge, peak_levels
from frf_ipz.identification.search.selection import Selected, select_modes
from frf_ipz.identification.start.stabilization import start_poles
from frf_ipz.progress import Progress, silent

if TYPE_CHECKING:
    from frf_ipz.frf import FrfSet
    from frf_ipz.identification.options import FitOptions

FIXED_POLES = 3  # beside the band, while modes are searched
DELAY_ROUNDS = 2  # of finding delays and poles in turn
HELD_ROUNDS = 3  # of fitting residues and finding the noise in turn
MODEL_ERROR = 1.3  # misfit over noise above which the model, not the noise, limits the fit


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Fitted:
    """Poles, and what they were fitted to; `noise` is the variance without what the model fails to follow."""

    lines: MeasuredLines
    terms: SmoothTerms
    fit: Refined
    judgement: Judgement
    excess: FloatArray
    noise: FloatArray
    noise_from: str
    drift: Drift | None
    poles_are_held: bool = False


def fit_modes(frfs: FrfSet, options: FitOptions, *, progress: Progress = silent) -> ModalFit:
    """Fit poles, residues and zeros to measured FRFs.

    Parameters
    ----------
    frfs : FrfSet
        Measured FRFs; with their variance where it is known.
    options : FitOptions
        Band, what the user has pinned and struck, kind of modes.
    progress : Progress
        Told how far the fit is.

    Returns
    -------
    ModalFit
        The fitted model with covariance, and how it was found.

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
    selected = _selected(lines, start.poles, terms, options)
    progress(0.7, "refining")
    fitted = _refined(lines, selected, terms)
    progress(0.8, "finding zeros and errors")
    return _as_modal_fit(frfs, fitted, options, start=start.table, decisions=selected.decisions, delay_s=delay_s)


def fit_residues(frfs: FrfSet, poles: ComplexArray, options: FitOptions) -> ModalFit:
    """Fit residues and zeros to measured FRFs, with poles that are known from elsewhere.

    Parameters
    ----------
    frfs : FrfSet
        Measured FRFs: one is enough.
    poles : (n_poles,) complex array
        rad/s, imaginary part > 0; they are not moved and count as exact.
    options : FitOptions
        Band and lines to leave out, kind of modes.

    Returns
    -------
    ModalFit
        The fitted model. Where natural frequencies of an FRF are off the poles by a common factor, a warning says by
        how much, and the FRF is fitted with that factor.

    Raises
    ------
    InputError
        If no lines are left to fit.
    """
    lines = measured_lines(frfs, options)
    terms = all_terms(lines.band_hz, lines.line_hz).first(FIXED_POLES)
    real_modes = options.modes == "real"
    for _ in range(1 if lines.known.all() else HELD_ROUNDS):
        data = replace(lines.weighted(), real_modes=real_modes)
        fit = refine(data, poles, terms, iterations=0)
        drift = None
        found = find_drift(data, fit, terms, poles_are_held=True)
        if found is not None:
            drift, fit = found
            data = replace(data, receptance=drift.moved)
        judgement = judge(data, fit, terms)
        lines = with_noise_of(lines, judgement.misfit / data.weight)
    lines = replace(lines, receptance=data.receptance)
    fitted = _Fitted(
        lines=lines,
        terms=terms,
        fit=fit,
        judgement=judgement,
        excess=_excess(judgement, fit),
        noise=lines.variance,
        noise_from="recordings" if lines.known.all() else "misfit",
        drift=drift,
        poles_are_held=True,
    )
    table = pd.DataFrame(columns=["order", "frequency_hz", "damping_ratio"])
    return _as_modal_fit(frfs, fitted, options, start=table, decisions=(), delay_s=np.zeros(frfs.n_frfs))


def _selected(lines: MeasuredLines, poles: ComplexArray, terms: SmoothTerms, options: FitOptions) -> Selected:
    data = replace(lines.weighted(shared=True), real_modes=options.modes == "real")
    selected = select_modes(data, poles, terms, options, noise_is_known=bool(lines.known.all()))
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
        poles = _selected(advanced, poles, terms, replace(options, modes="complex")).fit.poles
        data = replace(lines.weighted(shared=True), real_modes=True)
        delays = find_delays(data, poles, terms, numbers)
        advanced = replace(lines, receptance=lines.receptance * np.exp(lines.s[:, None] * delays))
    return advanced, delays


def _refined(lines: MeasuredLines, selected: Selected, terms: SmoothTerms) -> _Fitted:
    """Fit once more with the best weights, and find out whether noise or model limits the fit."""
    fit, data, judgement = selected.fit, selected.data, selected.judgement
    lines = replace(lines, receptance=data.receptance)
    if not lines.known.all():
        lines = with_noise_of(lines, judgement.misfit / data.weight)
    final = replace(lines.weighted(), real_modes=data.real_modes)
    if not (lines.known.all() and final.is_shared and fit.has_converged):  # otherwise the search has done it
        fit = refine(final, fit.poles, terms)
        judgement = judge(final, fit, terms)
    excess, noise, noise_from = _excess(judgement, fit), lines.variance, "recordings"
    if not lines.known.all() or np.median(excess) > MODEL_ERROR:
        noise_from = "misfit"
        lines = replace(lines, variance=lines.variance * judgement.level)
        fit = refine(replace(lines.weighted(), real_modes=data.real_modes), fit.poles, terms)
    return _Fitted(
        lines=lines,
        terms=terms,
        fit=fit,
        judgement=judgement,
        excess=excess,
        noise=noise,
        noise_from=noise_from,
        drift=selected.drift,
    )


def _levels(fitted: _Fitted) -> FloatArray:
    """Factor on the variance of each pole's real and imaginary part: 1 where the noise is that of the recordings."""
    poles = fitted.fit.poles
    if fitted.noise_from == "recordings":
        return np.ones(2 * len(poles))
    data = fitted.lines.weighted()
    left = (data.receptance - response(fitted.fit.system, fitted.terms, data.s)) * data.weight
    at_peaks = np.maximum(fitted.judgement.missing[-1].level_at(poles), peak_levels(data, fitted.fit, left))
    return np.asarray(np.maximum(np.tile(at_peaks, 2), levels_of_poles(data, fitted.fit, fitted.terms)))


def _excess(judgement: Judgement, fit: Refined) -> FloatArray:
    """Misfit over noise of each FRF, as roots of mean squares."""
    free = 2 * len(judgement.misfit) - fit.system.n_linear
    return np.asarray(np.sqrt(np.sum(np.abs(judgement.misfit) ** 2, axis=0) / free))


def _as_modal_fit(
    frfs: FrfSet,
    fitted: _Fitted,
    options: FitOptions,
    *,
    start: pd.DataFrame,
    decisions: tuple[dict[str, object], ...],
    delay_s: FloatArray,
) -> ModalFit:
    lines, fit, terms = fitted.lines, fitted.fit, fitted.terms
    order, n_modes = mode_order(fit.poles, (2 * np.pi * lines.band_hz[0], 2 * np.pi * lines.band_hz[1]))
    modes = order[:n_modes]
    errors = fit_errors(fit, terms, _levels(fitted))
    own = replace(errors, pole_root=np.zeros_like(errors.pole_root))  # errors of poles move equal FRFs alike
    gains = find_gains(
        frfs.labels,
        fit.system.residues()[modes],
        residue_covariance(own, np.zeros_like(lines.powers), modes),
        options.gain,
    )
    errors = own if fitted.poles_are_held else errors
    found = find_zeros(errors, lines.s)
    unit = np.abs(lines.s[:, None]) ** lines.powers
    left = lines.receptance - response(fit.system, terms, lines.s)
    of_frfs = pd.DataFrame({"delay_s": delay_s, "gain": gains.of_frf, "gain_std": gains.of_frf_std})
    misfit = misfit_table(lines.frequency_hz, left * unit, np.sqrt(fitted.noise) * unit, frfs.labels)
    return ModalFit(
        model=measured_model(fit.system, terms, lines.powers, order, delay_s),
        n_modes=n_modes,
        labels=frfs.labels,
        band_hz=lines.band_hz,
        used_lines=lines.used,
        zeros=found.zeros,
        covariance=_covariance(errors, found, modes),
        residue_covariance=residue_covariance(errors, lines.powers, modes),
        value_std=value_std(errors, lines.s) * unit,
        stabilization=start,
        decisions=pd.DataFrame(decisions, columns=["frequency_hz", "damping_ratio", "action", "reason"]),
        modes=mode_table(fit.poles[modes], fit.system.residues()[modes], fitted.judgement, modes),
        misfit=misfit.join(of_frfs, on="frf"),
        gain=gains.of_frf,
        channel_gains=gains.table,
        noise_from=fitted.noise_from,
        warnings=(*_warnings(frfs, fitted), *gains.remarks),
    )


def _covariance(errors: FitErrors, found: FoundZeros, modes: IntArray) -> RootCovariance:
    real, imag = np.split(errors.pole_root, 2)
    poles = np.stack([real[modes], imag[modes]], axis=1).reshape(2 * len(modes), -1)
    unknown = np.repeat(~found.zeros.identifiable, 2)
    common = np.where(unknown[:, None], 0.0, found.common)
    blocks = [part @ part.T for part in found.own]
    own = sparse.block_diag([np.zeros((len(poles), len(poles))), *blocks], format="csr")
    known = sparse.diags_array(np.concatenate([np.ones(len(poles)), ~unknown]))
    infinite = np.concatenate([np.zeros(len(poles)), np.where(unknown, np.inf, 0.0)])
    own = known @ own @ known
    own.eliminate_zeros()
    places = np.flatnonzero(infinite)
    added = sparse.csr_array((infinite[places], (places, places)), shape=own.shape)
    return RootCovariance(common=np.concatenate([poles, common]), own=sparse.csr_array(own + added))


def _warnings(frfs: FrfSet, fitted: _Fitted) -> tuple[str, ...]:
    said = []
    excess = fitted.excess
    if np.median(excess) > MODEL_ERROR:
        noise = "of the recordings" if fitted.lines.known.all() else "that differs from line to line"
        said.append(
            f"the misfit is {np.median(excess):.2g} times the noise {noise} (median FRF; {excess.max():.2g} at worst): "
            "the structure does what no linear model with these modes does, so standard deviations are taken from the "
            "misfit"
        )
    if fitted.drift is not None:
        said.append(_about_drift(frfs, fitted.drift, against_poles=fitted.poles_are_held))
    return tuple(said)


def _about_drift(frfs: FrfSet, drift: Drift, *, against_poles: bool) -> str:
    ppm = drift.relative * 1e6
    if against_poles:
        each = ", ".join(f"{label} {change:+.3g}" for label, change in zip(frfs.labels, ppm, strict=True))
        return f"natural frequencies are off the given poles by a common factor, in ppm: {each}; the fit allows for it"
    return (
        f"natural frequencies differ between the FRFs by {np.ptp(ppm):.3g} ppm, all modes alike: the structure drifted "
        f"while it was measured; highest in {frfs.labels[int(np.argmax(ppm))]}, lowest in "
        f"{frfs.labels[int(np.argmin(ppm))]}; the poles given are those of the mean"
    )
