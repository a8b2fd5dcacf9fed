"""The fitter: from measured FRFs to poles, residues and zeros with their covariance, without clicks.

Start: polyreference LSCF. Then maximum likelihood by variable projection, with poles added and dropped as the lines
demand. Then errors of everything, from the Fisher information at the optimum.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from scipy import sparse

from frf_ipz.arrays import ComplexArray, IntArray
from frf_ipz.identification.likelihood.compression import response
from frf_ipz.identification.likelihood.covariance import FitErrors, fit_errors, value_std
from frf_ipz.identification.likelihood.refinement import refine
from frf_ipz.identification.likelihood.smooth_terms import all_terms
from frf_ipz.identification.measured_lines import measured_lines, with_noise_of
from frf_ipz.identification.modal_fit import ModalFit
from frf_ipz.identification.results.gains import find_gains
from frf_ipz.identification.results.measured_model import measured_model, residue_covariance
from frf_ipz.identification.results.tables import misfit_table, mode_table
from frf_ipz.identification.results.zeros import FoundZeros, find_zeros
from frf_ipz.identification.root_covariance import RootCovariance
from frf_ipz.identification.search.drift import Drift, find_drift
from frf_ipz.identification.search.find_modes import (
    FIXED_POLES,
    MODEL_ERROR,
    Fitted,
    excess_of,
    find_modes,
    levels,
    mode_order,
)
from frf_ipz.identification.search.goodness_of_fit import judge
from frf_ipz.identification.search.split_half import Support, doubts, find_support
from frf_ipz.progress import Progress, silent
from frf_ipz.rational import damping_ratio, natural_frequency_hz

if TYPE_CHECKING:
    from frf_ipz.frf import FrfSet
    from frf_ipz.identification.options import FitOptions

HELD_ROUNDS = 3  # of fitting residues and finding the noise in turn


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
    fitted = find_modes(frfs, options, progress=progress)
    support = None
    if fitted.noise_from == "misfit":
        progress(0.7, "fitting each half of the lines")
        support = find_support(frfs, fitted, options)
    progress(0.9, "finding zeros and errors")
    return _as_modal_fit(frfs, fitted, options, support)


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
    fitted = Fitted(
        lines=lines,
        terms=terms,
        fit=fit,
        judgement=judgement,
        excess=excess_of(judgement, fit),
        noise=lines.variance,
        noise_from="recordings" if lines.known.all() else "misfit",
        drift=drift,
        start=pd.DataFrame(columns=["order", "frequency_hz", "damping_ratio"]),
        decisions=(),
        delay_s=np.zeros(frfs.n_frfs),
        poles_are_held=True,
    )
    return _as_modal_fit(frfs, fitted, options, None)


def _as_modal_fit(frfs: FrfSet, fitted: Fitted, options: FitOptions, support: Support | None) -> ModalFit:
    lines, fit, terms = fitted.lines, fitted.fit, fitted.terms
    order, n_modes = mode_order(fit.poles, (2 * np.pi * lines.band_hz[0], 2 * np.pi * lines.band_hz[1]))
    modes = order[:n_modes]
    doubted = doubts(support, modes)
    raised, shift = (support.raised, support.shift) if support else (1.0, np.zeros(2 * len(fit.poles)))
    errors = fit_errors(fit, terms, levels(fitted) * raised, shift)
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
    of_frfs = pd.DataFrame({"delay_s": fitted.delay_s, "gain": gains.of_frf, "gain_std": gains.of_frf_std})
    misfit = misfit_table(lines.frequency_hz, left * unit, np.sqrt(fitted.noise) * unit, frfs.labels)
    return ModalFit(
        model=measured_model(fit.system, terms, lines.powers, order, fitted.delay_s),
        n_modes=n_modes,
        labels=frfs.labels,
        band_hz=lines.band_hz,
        used_lines=lines.used,
        zeros=found.zeros,
        covariance=_covariance(errors, found, modes),
        residue_covariance=residue_covariance(errors, lines.powers, modes),
        value_std=value_std(errors, lines.s) * unit,
        stabilization=fitted.start,
        decisions=_decisions(fitted, modes, doubted),
        modes=mode_table(fit.poles[modes], fit.system.residues()[modes], fitted.judgement, modes, doubted),
        misfit=misfit.join(of_frfs, on="frf"),
        gain=gains.of_frf,
        channel_gains=gains.table,
        noise_from=fitted.noise_from,
        warnings=(*_warnings(frfs, fitted, support, doubted), *gains.remarks),
    )


def _decisions(fitted: Fitted, modes: IntArray, doubted: tuple[str, ...]) -> pd.DataFrame:
    poles = fitted.fit.poles[modes]
    rows = [
        {"frequency_hz": hz, "damping_ratio": ratio, "action": "doubted", "reason": reason}
        for hz, ratio, reason in zip(natural_frequency_hz(poles), damping_ratio(poles), doubted, strict=True)
        if reason
    ]
    return pd.DataFrame([*fitted.decisions, *rows], columns=["frequency_hz", "damping_ratio", "action", "reason"])


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


def _warnings(frfs: FrfSet, fitted: Fitted, support: Support | None, doubted: tuple[str, ...]) -> tuple[str, ...]:
    said = []
    excess = fitted.excess
    if np.median(excess) > MODEL_ERROR:
        noise = "of the recordings" if fitted.lines.known.all() else "that differs from line to line"
        said.append(
            f"the misfit is {np.median(excess):.2g} times the noise {noise} (median FRF; {excess.max():.2g} at worst): "
            "the structure does what no linear model with these modes does, so standard deviations are taken from the "
            "misfit"
        )
    if support is not None and support.scatter > 1:
        said.append(
            f"even and odd lines, each fitted by itself, differ by {support.scatter:.2g} of their standard "
            "deviations (root of mean square): standard deviations are raised to cover that"
        )
    if any(doubted):
        said.append(
            f"{sum(map(bool, doubted))} of {len(doubted)} modes do not come up in both halves of the lines: "
            "their quality is poor, and the decisions name them"
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
