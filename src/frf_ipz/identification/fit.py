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

from frf_ipz.arrays import FloatArray, IntArray
from frf_ipz.errors import NumericalError
from frf_ipz.identification.likelihood.compression import Weighted, response
from frf_ipz.identification.likelihood.covariance import FitErrors, fit_errors, value_std
from frf_ipz.identification.likelihood.refinement import Refined, refine
from frf_ipz.identification.likelihood.smooth_terms import SmoothTerms, all_terms
from frf_ipz.identification.lines.measured import MeasuredLines, measured_lines, with_noise_of
from frf_ipz.identification.modal_fit import ModalFit
from frf_ipz.identification.results.measured_model import measured_model, mode_order, residue_covariance
from frf_ipz.identification.results.tables import misfit_table, mode_table
from frf_ipz.identification.results.zeros import FoundZeros, find_zeros
from frf_ipz.identification.root_covariance import RootCovariance
from frf_ipz.identification.search.judgement import Judgement, judge
from frf_ipz.identification.search.selection import Selected, select_modes
from frf_ipz.identification.start.stabilization import Start, start_poles
from frf_ipz.progress import Progress, silent

if TYPE_CHECKING:
    from frf_ipz.frf import FrfSet
    from frf_ipz.identification.options import FitOptions

FIXED_POLES = 3  # beside the band, while modes are searched
MODEL_ERROR = 1.3  # misfit over noise above which the model, not the noise, limits the fit


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Fitted:
    """Poles, and what they were fitted to."""

    lines: MeasuredLines
    data: Weighted
    terms: SmoothTerms
    fit: Refined
    judgement: Judgement
    excess: FloatArray
    noise_from: str


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
    data = replace(lines.weighted(shared=True), real_modes=options.modes == "real")
    selected = select_modes(data, start.poles, terms, options, noise_is_known=bool(lines.known.all()))
    if not len(selected.fit.poles):
        raise NumericalError(
            f"no mode stands out of the noise between {lines.band_hz[0]:g} and {lines.band_hz[1]:g} Hz; "
            "look at the FRFs and their coherence, set another [fit] band_hz, or pin a mode with pin_hz"
        )
    progress(0.7, "refining")
    fitted = _refined(lines, selected, terms)
    progress(0.8, "finding zeros and errors")
    return _as_modal_fit(frfs, start, selected, fitted)


def _refined(lines: MeasuredLines, selected: Selected, terms: SmoothTerms) -> _Fitted:
    """Fit once more with the best weights, and find out whether noise or model limits the fit."""
    fit, data, judgement = selected.fit, selected.data, selected.judgement
    lines = replace(lines, receptance=data.receptance)
    if not lines.known.all():
        lines = with_noise_of(lines, judgement.misfit / data.weight)
    data = replace(lines.weighted(), real_modes=data.real_modes)
    fit = refine(data, fit.poles, terms)
    judgement = judge(data, fit, terms)
    free = 2 * len(data.s) - fit.system.n_linear
    excess = np.sqrt(np.sum(np.abs(judgement.misfit) ** 2, axis=0) / free)
    noise_from = "recordings"
    if not lines.known.all() or np.median(excess) > MODEL_ERROR:
        noise_from = "misfit"
        lines = replace(lines, variance=lines.variance * judgement.level)
        data = replace(lines.weighted(), real_modes=data.real_modes)
        fit = refine(data, fit.poles, terms)
    return _Fitted(
        lines=lines, data=data, terms=terms, fit=fit, judgement=judgement, excess=excess, noise_from=noise_from
    )


def _as_modal_fit(frfs: FrfSet, start: Start, selected: Selected, fitted: _Fitted) -> ModalFit:
    lines, fit, terms = fitted.lines, fitted.fit, fitted.terms
    band = 2 * np.pi * lines.band_hz[0], 2 * np.pi * lines.band_hz[1]
    order, n_modes = mode_order(fit.poles, band)
    level = (
        fitted.judgement.missing[-1].level_at(fit.poles) if fitted.noise_from == "misfit" else np.ones(len(fit.poles))
    )
    errors = fit_errors(fit, terms, level)
    found = find_zeros(errors, lines.s)
    of_residues = residue_covariance(errors, lines.powers, order[:n_modes])
    unit = np.abs(lines.s[:, None]) ** lines.powers
    left = lines.receptance - response(fit.system, terms, lines.s)
    return ModalFit(
        model=measured_model(fit.system, terms, lines.powers, order, np.zeros(frfs.n_frfs)),
        n_modes=n_modes,
        labels=frfs.labels,
        band_hz=lines.band_hz,
        used_lines=lines.used,
        zeros=found.zeros,
        covariance=_covariance(errors, found, order[:n_modes]),
        residue_covariance=of_residues,
        value_std=value_std(errors, lines.s) * unit,
        stabilization=start.table,
        decisions=pd.DataFrame(selected.decisions, columns=["frequency_hz", "damping_ratio", "action", "reason"]),
        modes=mode_table(
            fit.poles[order[:n_modes]], fit.system.residues()[order[:n_modes]], fitted.judgement, order[:n_modes]
        ),
        misfit=misfit_table(lines.frequency_hz, left * unit, np.sqrt(lines.variance) * unit, frfs.labels),
        noise_from=fitted.noise_from,
        warnings=_warnings(frfs, selected, fitted),
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


def _warnings(frfs: FrfSet, selected: Selected, fitted: _Fitted) -> tuple[str, ...]:
    said = []
    excess = fitted.excess
    if fitted.lines.known.all() and np.median(excess) > MODEL_ERROR:
        said.append(
            f"the misfit is {np.median(excess):.2g} times the noise of the recordings (median FRF; "
            f"{excess.max():.2g} at worst): the structure does what no linear model with these modes does, so standard "
            "deviations are taken from the misfit"
        )
    if selected.drift is not None:
        change = selected.drift.relative
        said.append(
            f"natural frequencies differ between the FRFs by {np.ptp(change) * 1e6:.3g} ppm, all modes alike: the "
            f"structure drifted while it was measured; highest in {frfs.labels[int(np.argmax(change))]}, lowest in "
            f"{frfs.labels[int(np.argmin(change))]}; the poles given are those of the mean"
        )
    return tuple(said)
