"""The fitter: from measured FRFs to poles, residues and zeros with their covariance, without clicks.

Start: polyreference LSCF. Then maximum likelihood by variable projection, with poles added and dropped as the lines
support them. Then errors of everything, from the Fisher information at the optimum.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse
from scipy.special import gammaincinv

from frf_ipz.arguments import require_type, take_array
from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.errors import InputError
from frf_ipz.frf import FrfSet
from frf_ipz.identification.likelihood.compression import response
from frf_ipz.identification.likelihood.covariance import FitErrors, fit_errors, value_std
from frf_ipz.identification.likelihood.refinement import refine_poles
from frf_ipz.identification.likelihood.sandwich import shared_noise_factors
from frf_ipz.identification.likelihood.smooth_terms import smooth_terms_of_band
from frf_ipz.identification.measured_lines import measured_lines, with_misfit_noise
from frf_ipz.identification.modal_fit import ModalFit
from frf_ipz.identification.options import FitOptions
from frf_ipz.identification.results.gains import find_channel_gains
from frf_ipz.identification.results.measured_model import measured_model, residue_covariance
from frf_ipz.identification.results.repeated_roots import with_repeated_roots
from frf_ipz.identification.results.tables import misfit_table, mode_table
from frf_ipz.identification.results.zeros import ZerosWithErrors, find_zeros
from frf_ipz.identification.root_covariance import RootCovariance
from frf_ipz.identification.search.discrepancy import ONE_IMPACT, of_one_impact
from frf_ipz.identification.search.drift import Drift, find_drift
from frf_ipz.identification.search.find_modes import (
    FIXED_POLES,
    MODEL_ERROR,
    FittedModes,
    find_modes,
    misfit_over_noise,
    mode_order,
    variance_factors,
)
from frf_ipz.identification.search.force_error import ForceError
from frf_ipz.identification.search.goodness_of_fit import assess_fit
from frf_ipz.identification.search.split_half import (
    SplitHalf,
    fit_halves,
    unconfirmed_reasons,
    without_unconfirmed,
)
from frf_ipz.identification.stabilization import columns_of_modes
from frf_ipz.identification.stated_modes import take_stated_modes
from frf_ipz.late_imports import import_late
from frf_ipz.modes import ModalParameters
from frf_ipz.numerics.one_thread import on_one_thread
from frf_ipz.progress import Progress, silent
from frf_ipz.rational import damping_ratio, natural_frequency_hz
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    import pandas as pd
else:
    pd = import_late("pandas")

STAYS = "frf.parquet keeps the FRFs as measured, and says the delay of each in its metadata"
FRFS_SHOWN = 6  # in one warning
CHANCE = 1e-3  # that the noise of some FRF is known so badly that it is said to be missed
NOISE_ROUNDS = 3  # of fitting residues and estimating the noise in turn


@on_one_thread
def fit_modes(
    frfs: FrfSet | ModalParameters, *, options: FitOptions | None = None, progress: Progress = silent
) -> ModalFit:
    """Fit poles, residues and zeros to measured FRFs.

    Parameters
    ----------
    frfs : FrfSet or ModalParameters
        Measured FRFs; with their variance where it is known. Modes that were identified elsewhere are taken as they
        are.
    options : FitOptions, optional
        Band, pinned and rejected poles, kind of modes.
    progress : Progress
        Reports how far the fit is.

    Returns
    -------
    ModalFit
        The fitted model with covariance, and how it was identified.

    Raises
    ------
    InputError
        If too few lines remain to be fitted.
    NoModesError
        If no mode is found.

    Examples
    --------
    >>> import frf_ipz
    >>> lines = np.arange(60, 100.0, 0.1)
    >>> s, pole = 2j * np.pi * lines, 2 * np.pi * 80 * (-0.01 + 1j)
    >>> accelerance = s**2 * (1 / (s - pole) - 1 / (s - pole.conjugate())) / 2j
    >>> frfs = frf_ipz.FrfSet.from_arrays(lines, accelerance[:, None, None], outputs=["1:+x"], inputs=["1:+x"])
    >>> frf_ipz.fit_modes(frfs).modes[["frequency_hz", "damping_ratio"]].round(3)
       frequency_hz  damping_ratio
    0        80.004           0.01
    """
    require_type("frfs", frfs, FrfSet, ModalParameters)
    require_type("options", options, FitOptions, optional=True)
    chosen = options or FitOptions()
    if isinstance(frfs, ModalParameters):
        return take_stated_modes(frfs, chosen)
    fitted = find_modes(frfs, chosen, progress=progress)
    halves = None
    if fitted.noise_from == "misfit" or of_one_impact(frfs).any():
        progress(0.7, "fitting each half of the lines")
        halves = fit_halves(frfs, fitted, chosen)
        if halves is not None:
            fitted, halves = without_unconfirmed(fitted, halves, chosen)
    progress(0.9, "finding zeros and errors")
    return with_repeated_roots(_as_modal_fit(frfs, fitted, chosen, halves))


@on_one_thread
def fit_residues(frfs: FrfSet, *, poles: ComplexArray, options: FitOptions | None = None) -> ModalFit:
    """Fit residues and zeros to measured FRFs, with given poles.

    Parameters
    ----------
    frfs : FrfSet
        Measured FRFs: one is enough.
    poles : (n_poles,) complex array
        rad/s, imaginary part > 0; they are held and count as exact.
    options : FitOptions, optional
        Band and lines to leave out, kind of modes.

    Returns
    -------
    ModalFit
        The fitted model. Where natural frequencies of an FRF differ from the poles by a common factor, a warning gives
        it, and the FRF is fitted with that factor.

    Raises
    ------
    InputError
        If too few lines remain to be fitted.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> beam = frf_ipz.make_beam(
    ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=10,
    ...     left="clamped", modal_ratio=0.01,
    ... )
    >>> lines = np.arange(5, 400.0, 0.5)
    >>> tip, middle = frf_ipz.Dof(11, "z"), frf_ipz.Dof(6, "z")
    >>> labels = [frf_ipz.FrfLabel(output, tip, frf_ipz.FrfQuantity.ACCELERANCE) for output in (middle, tip)]
    >>> values = frf_ipz.compute_frfs(beam, labels, 2j * np.pi * lines)[:, :, None]
    >>> frfs = frf_ipz.FrfSet.from_arrays(
    ...     lines, values, outputs=[middle, tip], inputs=[tip], variance=np.full(values.shape, 1e-4)
    ... )
    >>> fit = frf_ipz.fit_modes(frfs)
    >>> one_frf = frfs.select_frfs([1])
    >>> poles = fit.model.poles[: fit.n_modes]
    >>> bool(np.allclose(frf_ipz.fit_residues(one_frf, poles=poles).model.poles[:3], poles))
    True
    """
    require_type("frfs", frfs, FrfSet)
    require_type("options", options, FitOptions, optional=True)
    poles = take_array("the poles", poles, np.complex128)
    if not (len(poles) and (poles.imag > 0).all()):
        raise InputError(f"the poles are {poles}; at least one is needed, each with an imaginary part above 0")
    options = options or FitOptions()
    lines = measured_lines(frfs, options)
    terms = smooth_terms_of_band(lines.band_hz, lines.line_hz).first(FIXED_POLES)
    real_modes = options.modes == "real"
    for _ in range(1 if lines.known.all() else NOISE_ROUNDS):
        data = replace(lines.weighted(), real_modes=real_modes)
        fit = refine_poles(data, poles, terms, iterations=0)
        drift = None
        drift_and_fit = find_drift(data, fit, terms, poles_are_held=True)
        if drift_and_fit is not None:
            drift, fit = drift_and_fit
            data = replace(data, receptance=drift.receptance)
        goodness = assess_fit(data, fit, terms)
        lines = with_misfit_noise(lines, goodness.misfit / data.weight)
    lines = replace(lines, receptance=data.receptance)
    fitted = FittedModes(
        lines=lines,
        terms=terms,
        fit=fit,
        goodness=goodness,
        misfit_ratio=misfit_over_noise(goodness, fit),
        noise=lines.variance,
        noise_from="recordings" if lines.known.all() else "misfit",
        drift=drift,
        force_error=None,
        start=pd.DataFrame(columns=["order", "frequency_hz", "damping_ratio"]),
        decisions=(),
        delay_s=np.zeros(frfs.n_frfs),
        poles_are_held=True,
    )
    return _as_modal_fit(frfs, fitted, options, None)


def _as_modal_fit(frfs: FrfSet, fitted: FittedModes, options: FitOptions, halves: SplitHalf | None) -> ModalFit:
    lines, fit, terms = fitted.lines, fitted.fit, fitted.terms
    order, n_modes = mode_order(fit.poles, (2 * np.pi * lines.band_hz[0], 2 * np.pi * lines.band_hz[1]))
    modes = order[:n_modes]
    unconfirmed = unconfirmed_reasons(halves, modes)
    factor, shift = (halves.variance_factor, halves.shift) if halves else (1.0, np.zeros(2 * len(fit.poles)))
    shared = _shared_noise_factors(frfs, fitted)
    errors = fit_errors(fit, terms, variance_factors(fitted) * factor, shift, pole_factors=shared)
    # errors of the poles change equal FRFs by the same: gains follow from the other errors alone
    residue_errors = replace(errors, pole_root=np.zeros_like(errors.pole_root))
    gains = find_channel_gains(
        frfs.labels,
        fit.system.residues()[modes],
        residue_covariance(residue_errors, np.zeros_like(lines.powers), modes),
        options.gain,
    )
    errors = residue_errors if fitted.poles_are_held else errors
    zeros = find_zeros(errors, lines.s)
    unit = np.abs(lines.s[:, None]) ** lines.powers
    computed = response(fit.system, terms, lines.s)
    of_frfs = pd.DataFrame({"delay_s": fitted.delay_s, "gain": gains.of_frf, "gain_std": gains.of_frf_std})
    misfit = (lines.receptance - computed) * unit
    misfit_frame = misfit_table(lines.frequency_hz, misfit, np.sqrt(fitted.noise) * unit, frfs.labels)
    model = measured_model(fit.system, terms, lines.powers, order, fitted.delay_s)
    common = _error_of_gain(fitted)
    # what it is at the poles themselves, residues have followed
    at_modes = np.array([np.interp(natural_frequency_hz(fit.poles[modes]), lines.frequency_hz, of) for of in common.T])
    of_force = at_modes.T**2 / 2 * np.abs(model.residues[:n_modes]) ** 2
    return ModalFit(
        model=model,
        n_modes=n_modes,
        labels=frfs.labels,
        band_hz=lines.band_hz,
        used_lines=lines.used,
        frequency_hz=frfs.frequency_hz[lines.used],
        zeros=zeros.zeros,
        covariance=_root_covariance(errors, zeros, modes, fitted.drift),
        residue_covariance=residue_covariance(errors, lines.powers, modes) + of_force[:, :, None, None] * np.eye(2),
        value_std=np.hypot(value_std(errors, lines.s) * unit, common * np.abs(computed) * unit),
        stabilization=columns_of_modes(fitted.start, natural_frequency_hz(fit.poles[modes]), options.stability),
        stability=options.stability,
        decisions=_decisions(fitted, modes, unconfirmed),
        modes=mode_table(fit.poles[modes], fit.system.residues()[modes], fitted.goodness, modes, halves),
        misfit=misfit_frame.join(of_frfs, on="frf"),
        gain=gains.of_frf,
        channel_gains=gains.table,
        noise_from=fitted.noise_from,
        warnings=(*_idle_exclusions(frfs, options), *_warnings(frfs, fitted, halves, unconfirmed), *gains.remarks),
        unknown_scale=frfs.unknown_scale,
        missed=_beyond_noise(misfit, np.sqrt(fitted.noise) * unit),
    )


def _beyond_noise(misfit: ComplexArray, noise_std: FloatArray) -> FloatArray:
    """Moduli of a misfit where they are beyond the largest that the noise of all lines has, on average; else 0."""
    size = np.abs(misfit)
    # squared moduli of complex noise are exponential: of n the largest is log n times the mean, on average
    return np.where(size**2 > noise_std**2 * np.log(misfit.size), size, 0.0)


def _error_of_gain(fitted: FittedModes) -> FloatArray:
    """Give the expected relative error of the force and by slow gains, (n_lines, n_frfs): residues follow it."""
    lines, shape = fitted.lines, fitted.lines.receptance.shape
    rms = 0.0 if fitted.force_error is None else fitted.force_error.rms_of_frfs
    of_force = rms * np.ones(shape) if lines.force_noise is None else np.abs(lines.force_noise.relative)
    if lines.gain_variance is None:
        return np.asarray(of_force)
    power = np.abs(lines.receptance) ** 2
    slow = np.divide(lines.gain_variance, power, out=np.zeros(shape), where=power > 0.0)
    return np.asarray(np.sqrt(of_force**2 + slow))


def _shared_noise_factors(frfs: FrfSet, fitted: FittedModes) -> FloatArray:
    """Find the factors on variances of poles by noise that lines share, where nothing larger hides it; else 1."""
    is_alone = fitted.noise_from == "recordings" and not of_one_impact(frfs).any()
    is_alone &= fitted.force_error is None or fitted.lines.force_noise is not None
    if fitted.poles_are_held or not is_alone:
        return np.ones(2 * len(fitted.fit.poles))
    return shared_noise_factors(fitted.lines, fitted.fit, fitted.terms, windowed_s=_length_under_window_s(frfs))


def _length_under_window_s(frfs: FrfSet) -> float:
    """Length of the records whose noise an exponential window weighed, s; 0 without one.

    Where the window would correlate more lines than are stated, the noise came after it and is each line's own.
    """
    length_s = 1 / float(np.median(np.diff(frfs.frequency_hz)))
    half = frfs.window_decay_1_s * length_s / 2
    return length_s if half > 0.0 and half / np.tanh(half) < frfs.correlated_lines + 1 else 0.0


def _decisions(fitted: FittedModes, modes: IntArray, unconfirmed: tuple[str, ...]) -> pd.DataFrame:
    poles = fitted.fit.poles[modes]
    rows = [
        {"frequency_hz": hz, "damping_ratio": ratio, "action": "unconfirmed", "reason": reason}
        for hz, ratio, reason in zip(natural_frequency_hz(poles), damping_ratio(poles), unconfirmed, strict=True)
        if reason
    ]
    return pd.DataFrame([*fitted.decisions, *rows], columns=["frequency_hz", "damping_ratio", "action", "reason"])


def _root_covariance(errors: FitErrors, zeros: ZerosWithErrors, modes: IntArray, drift: Drift | None) -> RootCovariance:
    real, imag = np.split(errors.pole_root, 2)
    poles = np.stack([real[modes], imag[modes]], axis=1).reshape(2 * len(modes), -1)
    unknown = np.repeat(~zeros.zeros.identifiable, 2)
    common = np.where(unknown[:, None], 0.0, zeros.common)
    of_frfs = [part @ part.T for part in zeros.white]
    blocks = sparse.block_diag([np.zeros((len(poles), len(poles))), *of_frfs], format="csr")
    known = sparse.diags_array(np.concatenate([np.ones(len(poles)), ~unknown]))
    blocks = known @ blocks @ known
    blocks.eliminate_zeros()
    diagonal = np.concatenate([np.zeros(len(poles)), np.where(unknown, np.inf, 0.0)])
    rows = np.flatnonzero(diagonal)
    infinite = sparse.csr_array((diagonal[rows], (rows, rows)), shape=blocks.shape)
    sources = np.concatenate([poles, common])
    if drift is not None:  # the mean that all recordings share moves all roots by one factor
        roots = np.concatenate([errors.system.poles[modes], np.nan_to_num(zeros.zeros.values)])
        moved = np.stack([roots.real, roots.imag], axis=1).ravel() * np.concatenate([np.ones(len(poles)), ~unknown])
        sources = np.column_stack([sources, drift.mean_std * moved])
    return RootCovariance(common=sources, blocks=sparse.csr_array(blocks + infinite))


def _by_chance(frfs: FrfSet) -> FloatArray:
    """Misfit over noise, (n_frfs,), that the scatter of a few records makes by chance, all lines alike at worst."""
    n_free = np.maximum(frfs.averages - 1.0, 1.0)  # complex numbers that tell the noise
    return np.where(frfs.averages > 1, np.sqrt(n_free / gammaincinv(n_free, CHANCE / frfs.n_frfs)), 1.0)


def _idle_exclusions(frfs: FrfSet, options: FitOptions) -> tuple[str, ...]:
    """Name bands that are excluded and hold no line that would be fitted without that."""
    lines_hz = frfs.frequency_hz
    low, high = options.band_hz or (float(lines_hz[0]), float(lines_hz[-1]))
    lines_hz = lines_hz[(lines_hz >= low) & (lines_hz <= high)]
    idle = [
        f"{first:g} to {last:g} Hz"
        for first, last in options.exclude_hz
        if not ((lines_hz >= first) & (lines_hz <= last)).any()
    ]
    if not idle:
        return ()
    text = f"[fit] exclude_hz takes out no line by {', '.join(idle)}: the lines of the band go from"
    return (f"{text} {lines_hz[0]:g} to {lines_hz[-1]:g} Hz",)


def _warnings(
    frfs: FrfSet, fitted: FittedModes, halves: SplitHalf | None, unconfirmed: tuple[str, ...]
) -> tuple[str, ...]:
    texts = []
    alone = of_one_impact(frfs)
    if alone.any() and not fitted.poles_are_held:
        which = "every FRF" if alone.all() else f"{alone.sum()} of {counted(len(alone), 'FRF')}"
        texts.append(
            f"one impact stands behind {which}: how the next would differ is not seen, so that the fit counts on "
            f"{100 * ONE_IMPACT:.0f} % of the FRF, in common over the width of a peak; three impacts or more show it"
        )
    ratio = fitted.misfit_ratio
    if np.median(ratio) > MODEL_ERROR:
        noise = "of the recordings" if fitted.lines.known.all() else "that differs from line to line"
        texts.append(
            f"the misfit is {np.median(ratio):.2g} times the noise {noise} (median FRF; {ratio.max():.2g} at worst, in "
            f"{frfs.labels[int(np.argmax(ratio))]}): "
            "no linear model with these modes describes the structure to within the noise, so standard deviations are "
            "taken from the misfit"
        )
    elif (missed := ratio > np.maximum(MODEL_ERROR, _by_chance(frfs))).any():
        worst_first = [int(frf) for frf in np.argsort(-ratio) if missed[frf]]
        listed = ", ".join(f"{frfs.labels[frf]} {ratio[frf]:.3g}" for frf in worst_first[:FRFS_SHOWN])
        texts.append(
            f"the fit misses {counted(len(worst_first), 'FRF')} of {len(ratio)} by more than noise, times the noise: "
            f"{listed}{', ...' if len(worst_first) > FRFS_SHOWN else ''}; they count by their misfit, and their "
            "residues and zeros have its deviations: look at these sensors and records"
        )
    if halves is not None and halves.scatter > 1:
        texts.append(
            f"even and odd lines, each fitted by itself, differ by {halves.scatter:.2g} of their standard "
            "deviations (root of mean square): standard deviations are raised to cover that"
        )
    if any(unconfirmed):
        texts.append(
            f"{sum(map(bool, unconfirmed))} of {len(unconfirmed)} modes do not come up in both halves of the lines: "
            "their quality is poor, and the decisions list them"
        )
    if fitted.common_delay is not None:
        delay, std = fitted.common_delay.delay_s, fitted.common_delay.std_s
        late = "responses come later than the force" if delay > 0 else "the force comes later than the responses"
        texts.append(
            f"{late}, all by {1e3 * abs(delay):.4g} ms (+- {1e3 * std:.1g} ms), which the fit takes off: without it "
            f"the modes are not normal; {STAYS}; [fit] delay = true fits each channel's delay, delay = false none"
        )
    if fitted.has_delayed_channels:
        delays = {
            str(label.output_channel or label.output_dof): delay_s
            for label, delay_s in zip(frfs.labels, fitted.delay_s, strict=True)
            if delay_s
        }
        listed = ", ".join(f"{channel} {1e3 * delay_s:+.4g} ms" for channel, delay_s in delays.items())
        texts.append(
            f"responses come later than the force, or before it, each by its own delay, which the fit takes off: "
            f"{listed}; {STAYS}; [fit] delay = false fits none"
        )
    if fitted.force_error is not None:
        texts.append(_force_error_text(frfs, fitted.force_error))
    if fitted.drift is not None:
        texts.append(_drift_warning(frfs, fitted.drift, against_poles=fitted.poles_are_held))
    return tuple(texts)


def _force_error_text(frfs: FrfSet, error: ForceError) -> str:
    dofs = [str(label.input_dof) for label in frfs.labels]
    of_dofs = [
        f"{dof} {rms:.2g} ({1e3 * window_s:.3g} ms)"
        for dof, rms, window_s in zip(np.unique(dofs), error.rms, error.window_s, strict=True)
        if rms > 0
    ]
    return (
        "all FRFs of an excited DOF are off by one factor that is smooth over the lines, as noise of the force in its "
        f"window makes it, which the fit takes off instead of broad modes; relative size (time): {', '.join(of_dofs)}"
    )


def _drift_warning(frfs: FrfSet, drift: Drift, *, against_poles: bool) -> str:
    ppm = drift.relative_change * 1e6
    if against_poles:
        changes = ", ".join(f"{label} {change:+.3g}" for label, change in zip(frfs.labels, ppm, strict=True))
        return (
            f"natural frequencies are off the given poles by a common factor, in ppm: {changes}; the fit allows for it"
        )
    return (
        f"natural frequencies differ between the FRFs by {np.ptp(ppm):.3g} ppm, the same for all modes: the structure "
        f"drifted while it was measured; highest in {frfs.labels[int(np.argmax(ppm))]}, lowest in "
        f"{frfs.labels[int(np.argmin(ppm))]}; the poles are those of the mean frequencies"
    )
