"""What uncertain poles and zeros may be: ellipses in the plane of frequency and damping ratio."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray
from frf_ipz.identification.root_covariance import RootCovariance
from frf_ipz.rational import damping_ratio, natural_frequency_hz

if TYPE_CHECKING:
    from frf_ipz.identification.modal_fit import ModalFit

Q95_PLANE = float(np.sqrt(-2 * np.log(0.05)))  # standard deviations of the ellipse that holds 95 % of a normal pair
CORNERS = 33
OVERDAMPED = 0.999  # damping ratio from which a root has no place in the map


def root_covariances(fit: ModalFit) -> FloatArray:
    """Covariance of each pole and zero alone.

    Parameters
    ----------
    fit : ModalFit
        The fit.

    Returns
    -------
    (n_modes + n_zeros, 2, 2) array
        Of real and imaginary part, (rad/s)^2.
    """
    if isinstance(fit.covariance, RootCovariance):
        return fit.covariance.pair_blocks()
    rows = 2 * np.arange(len(fit.covariance) // 2)[:, None] + np.array([0, 1])
    return np.asarray(fit.covariance[rows[:, :, None], rows[:, None, :]])


def shown_zeros(fit: ModalFit) -> BoolArray:
    """Which zeros a map shows: those with a number that are not overdamped.

    Parameters
    ----------
    fit : ModalFit
        The fit.

    Returns
    -------
    (n_zeros,) bool array
        True for those.
    """
    return np.asarray(fit.zeros.identifiable & (np.abs(damping_ratio(fit.zeros.values)) < OVERDAMPED))


def error_ellipses(roots: ComplexArray, covariance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Outline the ellipses that hold the true roots with 95 % probability.

    The ellipses are those of real and imaginary part; each corner is turned into frequency and damping ratio, so the
    outline is right where they are not small.

    Parameters
    ----------
    roots : (n,) complex array
        rad/s.
    covariance : (n, 2, 2) array
        Of real and imaginary part, (rad/s)^2.

    Returns
    -------
    frequency_hz, damping_ratio : (n, n_corners) array
        Closed outlines; NaN for roots without a finite covariance.

    Examples
    --------
    >>> root, covariance = np.array([-1.0 + 100j]), np.array([[[0.01, 0.0], [0.0, 0.01]]])
    >>> hertz, _ = error_ellipses(root, covariance)
    >>> round(float(2 * np.pi * (hertz.max() - hertz.min()) / 2 / 0.1), 2)
    2.45
    """
    known = np.isfinite(covariance).all(axis=(1, 2)) & (np.abs(roots) > 0)
    angle = np.linspace(0, 2 * np.pi, CORNERS)
    circle = Q95_PLANE * np.stack([np.cos(angle), np.sin(angle)])
    outlines = np.full((len(roots), CORNERS), np.nan, complex)
    if known.any():
        values, vectors = np.linalg.eigh(covariance[known])
        step = vectors @ (np.sqrt(np.maximum(values, 0.0))[:, :, None] * circle)
        outlines[known] = roots[known, None] + step[:, 0] + 1j * step[:, 1]
    return natural_frequency_hz(outlines), damping_ratio(outlines)


def root_deviations(roots: ComplexArray, covariance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Propagate to standard deviations of frequency and damping ratio, to first order.

    Parameters
    ----------
    roots : (n,) complex array
        rad/s.
    covariance : (n, 2, 2) array
        Of real and imaginary part, (rad/s)^2.

    Returns
    -------
    frequency_std_hz, damping_ratio_std : (n,) array
        NaN or infinite where the covariance is.

    Examples
    --------
    >>> hertz, _ = root_deviations(np.array([100j]), np.array([[[1.0, 0.0], [0.0, 4.0]]]))
    >>> round(float(2 * np.pi * hertz[0]), 12)
    2.0
    """
    modulus = np.where(np.abs(roots) > 0, np.abs(roots), 1.0)
    real, imag = roots.real / modulus, roots.imag / modulus
    to_frequency = np.stack([real, imag], 1) / (2 * np.pi)
    to_damping = np.stack([-(imag**2), real * imag], 1) / modulus[:, None]
    blocks = np.where(np.isfinite(covariance).all(axis=(1, 2), keepdims=True), covariance, np.nan)
    frequency, damping = (np.einsum("ni,nij,nj->n", slope, blocks, slope) for slope in (to_frequency, to_damping))
    return np.sqrt(frequency), np.sqrt(damping)
