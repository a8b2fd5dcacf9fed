"""FRFs that were measured under an exponential window, carried over to the imaginary axis.

The values are exact at s = sigma + i omega. What a fitted model changes between there and i omega is added to them;
noise and all that the model does not contain stay as they were measured. A part u of the FRF that is not in the model
changes too, by about ``sigma du/ds``, which the lines show: FRFs are analytic, so the slope along the lines is that
across them. To this order that is the error of what is carried, where it exceeds what noise gives. With noise of the
variance v, of which the window exp(-sigma t) leaves the first part, on lines 2 pi / T apart, central differences give
``v / (2 + 2 (2 pi / (sigma T))^2)``.

Beside the band, terms that stand for what lies outside are known by what they do in the band only. There they carry
where that leaves less of the FRF to change than the modes of the band alone.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.late_imports import import_late
from frf_ipz.rational import PoleResidueModel

if TYPE_CHECKING:
    from scipy.ndimage import uniform_filter1d

    from frf_ipz.arrays import ComplexArray, FloatArray
    from frf_ipz.frf import FrfSet
else:
    uniform_filter1d = import_late("scipy.ndimage", "uniform_filter1d")


def remove_window(
    frfs: FrfSet, model: PoleResidueModel, n_modes: int, *, band_hz: tuple[float, float]
) -> tuple[ComplexArray, FloatArray]:
    """Carry FRFs over to the imaginary axis.

    Parameters
    ----------
    frfs : FrfSet
        Measured under a window.
    model : PoleResidueModel
        Fitted to them.
    n_modes : int
        Its first poles are modes of the band.
    band_hz : pair of float
        The band.

    Returns
    -------
    values : (n_lines, n_frfs) complex array
        Without a window; at 0 Hz, where the model may have no value, as they were.
    unmodelled : (n_lines, n_frfs) array
        Squared modulus of the change of parts that the model does not contain; at 0 Hz of all.
    """
    is_carried = (frfs.frequency_hz > 0.0)[:, None]
    s = 2j * np.pi * np.where(is_carried[:, 0], frfs.frequency_hz, frfs.frequency_hz[1])
    modes = replace(
        model,
        poles=model.poles[:n_modes],
        residues=model.residues[:n_modes],
        powers=(),
        coefficients=np.zeros((0, frfs.n_frfs)),
    )
    by_all, by_modes = (_unmodelled_change(frfs, part(frfs.s)) for part in (model, modes))
    with_all = frfs.in_band(band_hz)[:, None] | (by_all <= by_modes)
    change = np.where(with_all, model(s) - model(frfs.s), modes(s) - modes(frfs.s))
    unmodelled = np.where(with_all, by_all, by_modes)
    whole = _unmodelled_change(frfs, np.zeros_like(frfs.values))
    return frfs.values + np.where(is_carried, change, 0.0), np.where(is_carried, unmodelled, whole)


def _unmodelled_change(frfs: FrfSet, fitted: ComplexArray) -> FloatArray:
    """Estimate |sigma du/ds|^2 of what a model leaves of FRFs, without what noise gives: (n_lines, n_frfs)."""
    omega, sigma = frfs.s.imag, frfs.window_decay_1_s
    is_known = np.isfinite(frfs.variance) | ~np.isfinite(frfs.variance).any(axis=0)
    left = np.where(is_known, frfs.values - fitted, np.nan)
    slopes = np.gradient(left, omega, axis=0)
    by_noise = np.nan_to_num(frfs.variance) / (2.0 + 2.0 * (np.gradient(omega) / sigma)[:, None] ** 2)
    return np.maximum(_local_mean(np.abs(sigma * slopes) ** 2 - by_noise, 2 * frfs.correlated_lines + 1), 0.0)


def _local_mean(values: FloatArray, n_lines: int) -> FloatArray:
    """Average (n_lines, n_frfs) over neighbouring lines, those left out that are not a number; 0 where none is one."""
    is_number = np.isfinite(values)
    total, share = (
        uniform_filter1d(np.asarray(part, float), n_lines, axis=0, mode="constant")
        for part in (np.where(is_number, values, 0.0), is_number)
    )
    return np.divide(total, share, out=np.zeros_like(total), where=share > 0.5 / n_lines)
