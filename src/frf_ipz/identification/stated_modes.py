"""Modes that were identified elsewhere, as the fit of a test without FRFs.

What a fit of FRFs gives besides poles stays empty: residues, zeros, misfit. Where a deviation is not stated, that of a
usual test takes its place: [Ewins2000], D. J. Ewins, Modal Testing: Theory, Practice and Application, 2nd ed., Research
Studies Press, 2000, sec. 4.2 and 5.1, for frequencies to a part in a thousand and damping ratios to a tenth.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.errors import InputError
from frf_ipz.identification.modal_fit import ModalFit
from frf_ipz.late_imports import import_late
from frf_ipz.modes import ModalParameters, modal_phase_collinearity
from frf_ipz.rational import PoleResidueModel, ZeroSet, underdamped_poles

if TYPE_CHECKING:
    import pandas as pd

    from frf_ipz.arrays import FloatArray
    from frf_ipz.identification.options import FitOptions
else:
    pd = import_late("pandas")

FREQUENCY_STD, DAMPING_STD = 1e-3, 0.1  # relative, where none is stated
STATED = "stated"
OUTSIDE = "outside of the band"
OF_FRFS = ("pin_hz", "max_order", "delay", "gain")  # keys of [fit] that a fit to FRFs asks for
STRUCK = 1e-2  # relative distance within which a pole is the one that the user has struck


def take_stated_modes(modes: ModalParameters, options: FitOptions) -> ModalFit:
    """Take modes as a fit.

    Parameters
    ----------
    modes : ModalParameters
        The modes.
    options : FitOptions
        `band_hz`, `exclude_hz` and `strike` choose among them.

    Returns
    -------
    ModalFit
        Without FRFs: its `modes_given` are those of the band.

    Raises
    ------
    InputError
        If no mode lies in the band.
    """
    band_hz = options.band_hz or modes.band_hz
    options.require_within(band_hz)
    decisions = [_left_out(float(hz), band_hz, options) for hz in modes.natural_frequency_hz]
    kept = [place for place, reason in enumerate(decisions) if not reason]
    if not kept:
        listed = ", ".join(f"{hz:.6g}" for hz in modes.natural_frequency_hz)
        taken_out = [reason for reason in decisions if reason != OUTSIDE]
        problem = f"no mode of the test {'is left' if taken_out else 'lies'} in the band"
        way_out = "take less out by [fit] exclude_hz and strike" if taken_out else "set another [fit] band_hz"
        raise InputError(f"{problem} {band_hz[0]:g} to {band_hz[1]:g} Hz; they are at {listed} Hz: {way_out}")
    given = modes.select(kept)
    frequency_std, ratio_std, note = _deviations(given)
    poles = underdamped_poles(given.natural_frequency_hz, given.damping_ratio)
    used_lines = (modes.lines_hz >= band_hz[0]) & (modes.lines_hz <= band_hz[1])
    count, lines_hz = len(poles), modes.lines_hz[used_lines]
    collinearity = modal_phase_collinearity(given.shapes) if len(given.dofs) > 1 else np.ones(count)
    table = {
        "pole_id": np.arange(1, count + 1),
        "frequency_hz": given.natural_frequency_hz,
        "damping_ratio": given.damping_ratio,
        "mpc": collinearity,
        "damping_std_ratio": ratio_std / given.damping_ratio,
        "quality": ["stated"] * count,
        "remarks": ["identified elsewhere"] * count,
    }
    rows = [
        {"frequency_hz": hz, "damping_ratio": ratio, "action": "left out", "reason": reason}
        for hz, ratio, reason in zip(modes.natural_frequency_hz, modes.damping_ratio, decisions, strict=True)
        if reason
    ]
    return ModalFit(
        model=PoleResidueModel(
            poles=poles,
            residues=np.zeros((count, 0), complex),
            powers=(0,),
            coefficients=np.zeros((1, 0)),
            scale_rad_s=1.0,
            delay_s=np.zeros(0),
        ),
        n_modes=count,
        labels=(),
        band_hz=band_hz,
        used_lines=used_lines,
        frequency_hz=lines_hz,
        zeros=ZeroSet(
            values=np.zeros(0, complex), frf=np.zeros(0, np.int64), kind=(), identifiable=np.zeros(0, bool), reason=()
        ),
        covariance=_covariance(given, frequency_std, ratio_std),
        residue_covariance=np.zeros((count, 0, 2, 2)),
        value_std=np.zeros((len(lines_hz), 0)),
        stabilization=pd.DataFrame(columns=["order", "frequency_hz", "damping_ratio"]),
        decisions=pd.DataFrame(rows, columns=["frequency_hz", "damping_ratio", "action", "reason"]),
        modes=pd.DataFrame(table),
        misfit=pd.DataFrame(columns=["frf", "output_dof", "input_dof", "band_low_hz", "band_high_hz"]),
        gain=np.zeros(0),
        channel_gains=pd.DataFrame(columns=["channel", "gain", "gain_std"]),
        noise_from=STATED,
        warnings=(*note, *_idle_keys(modes, options)),
        modes_given=given,
    )


def _left_out(hertz: float, band_hz: tuple[float, float], options: FitOptions) -> str:
    """Say why a mode does not count; empty where it does."""
    if not band_hz[0] <= hertz <= band_hz[1]:
        return OUTSIDE
    if any(low <= hertz <= high for low, high in options.exclude_hz):
        return "in a band that is left out"
    return next((pole.why for pole in options.strike if abs(pole.hz / hertz - 1) < STRUCK), "")


def _idle_keys(modes: ModalParameters, options: FitOptions) -> tuple[str, ...]:
    """Name keys of ``[fit]`` that have no effect on modes that were identified elsewhere."""
    idle = [key for key in OF_FRFS if getattr(options, key) not in (None, ())]
    texts = [f"[fit] {', '.join(idle)}: no effect, as the modes were identified elsewhere"] if idle else []
    hertz = modes.natural_frequency_hz
    missed = [f"{pole.hz:g} Hz" for pole in options.strike if not (np.abs(pole.hz / hertz - 1) < STRUCK).any()]
    if missed:
        texts.append(f"[fit] strike takes out no mode at {', '.join(missed)}: none is there")
    return tuple(texts)


def _deviations(modes: ModalParameters) -> tuple[FloatArray, FloatArray, tuple[str, ...]]:
    """Deviations of frequencies and damping ratios, and what has to be said of them."""
    frequency_std, ratio_std = np.asarray(modes.frequency_std_hz), np.asarray(modes.damping_ratio_std)
    lacking = [
        f"{text} (taken: {share:.2g} of it)"
        for text, values, share in (
            ("frequency_std_hz", frequency_std, FREQUENCY_STD),
            ("damping_ratio_std", ratio_std, DAMPING_STD),
        )
        if np.isnan(values).any()
    ]
    note = f"deviations are not stated for all modes: {' and '.join(lacking)}; bands are as right as these are"
    return (
        np.where(np.isnan(frequency_std), FREQUENCY_STD * modes.natural_frequency_hz, frequency_std),
        np.where(np.isnan(ratio_std), DAMPING_STD * modes.damping_ratio, ratio_std),
        (note,) if lacking else (),
    )


def _covariance(modes: ModalParameters, frequency_std: FloatArray, ratio_std: FloatArray) -> FloatArray:
    """(2 n, 2 n) covariance of the poles' real and imaginary parts, to first order."""
    omega, ratio = 2 * np.pi * modes.natural_frequency_hz, modes.damping_ratio
    root = np.sqrt(1 - ratio**2)
    slopes = np.stack(
        [np.stack([-ratio, root], axis=1), np.stack([-omega, -omega * ratio / root], axis=1)], axis=2
    )  # of real and imaginary part, by omega and ratio
    errors = slopes * np.stack([2 * np.pi * frequency_std, ratio_std], axis=1)[:, None, :]
    covariance = np.zeros((2 * len(omega), 2 * len(omega)))
    for place, block in enumerate(errors @ errors.transpose(0, 2, 1)):
        covariance[2 * place : 2 * place + 2, 2 * place : 2 * place + 2] = block
    return covariance
