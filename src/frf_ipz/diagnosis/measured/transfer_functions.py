"""TransferFunctions transfer functions on a contour, with the covariance of their errors."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg
from scipy.linalg import blas

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.frf import FrfLabel

SMOOTH_PART = 0.5  # of the model's tolerance: relative error of its FRFs that varies slowly along the band
SMOOTH_LENGTH = 0.05  # correlation length of that error, in the logarithm of frequency
ROUGH_PART = 0.15  # of the tolerance: relative error that is independent from point to point
NOISY = 25.0  # points whose noise is a fifth of the FRF say nothing about gains
FAINT = 0.01  # of the largest FRF of a quantity: transverse sensitivity and asymmetry make smaller ones
FAINT_POINTS = 0.9  # of the points: an FRF that is faint at so many says nothing
NEGLIGIBLE = 0.05  # of a whitened error that is shared: its effect is far below one standard deviation


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TransferFunctions:
    """Transfer functions on a contour.

    Parameters
    ----------
    s : (n_points,) complex array
        rad/s.
    labels : tuple of FrfLabel
        One an FRF.
    values : (n_points, n_frfs) complex array
        SI.
    size : (n_points, n_frfs) array
        How large the FRF is without its zeros: relative errors of a model refer to it.
    covariance : (n_frfs, n_points, n_points) complex array
        Of the noise.
    shared_errors : tuple of (n_points, n_shared) complex array
        For each input, errors that all its FRFs share as a factor, from the noise of the force; each column is one
        standard deviation.
    input_index : (n_frfs,) int array
        Which entry of `shared_errors` belongs to an FRF.
    """

    s: ComplexArray
    labels: tuple[FrfLabel, ...]
    values: ComplexArray
    size: FloatArray
    covariance: ComplexArray
    shared_errors: tuple[ComplexArray, ...]
    input_index: IntArray

    @property
    def values_above_noise(self) -> ComplexArray:
        """(n_points, n_frfs) values less what may be noise; relative errors of noisy values would follow the noise."""
        noise = np.array([np.diag(covariance).real for covariance in self.covariance]).T
        return np.asarray(
            self.values * np.maximum(1 - NOISY * noise / np.maximum(self.size**2, np.finfo(float).tiny), 0.0)
        )

    @property
    def frequency_hz(self) -> FloatArray:
        """Frequencies of the points, Hz."""
        return np.asarray(self.s.imag / (2 * np.pi))


def select_points(measured: TransferFunctions, points: IntArray) -> TransferFunctions:
    """Select points of a contour.

    Parameters
    ----------
    measured : TransferFunctions
        Transfer functions.
    points : (n,) int array
        Their indices.

    Returns
    -------
    TransferFunctions
        At those points.
    """
    s: ComplexArray = measured.s[points]
    return replace(
        measured,
        s=s,
        values=measured.values[points],
        size=measured.size[points],
        covariance=measured.covariance[:, points[:, None], points],
        shared_errors=tuple(shared[points] for shared in measured.shared_errors),
    )


def raise_faint_sizes(measured: TransferFunctions) -> TransferFunctions:
    """Let relative errors of a model refer to FRFs that are large enough to be predictable.

    A sensor on a node line of all modes measures its own misalignment and the asymmetry of the structure, which no
    model knows.

    Parameters
    ----------
    measured : TransferFunctions
        Transfer functions.

    Returns
    -------
    TransferFunctions
        The same, with sizes that are not far below that of the largest FRF of the same quantity and excited point.
    """
    return replace(measured, size=np.maximum(measured.size, FAINT * _largest(measured)))


def find_faint_frfs(measured: TransferFunctions) -> tuple[FrfLabel, ...]:
    """Find the FRFs that are too faint to be predictable over nearly all of the band.

    Parameters
    ----------
    measured : TransferFunctions
        Transfer functions, before or after `raise_faint_sizes`.

    Returns
    -------
    tuple of FrfLabel
        They do not show changes of the model at their sensors.
    """
    faint = np.mean(np.abs(measured.values) < FAINT * _largest(measured), axis=0) > FAINT_POINTS
    return tuple(label for label, is_faint in zip(measured.labels, faint, strict=True) if is_faint)


def _largest(measured: TransferFunctions) -> FloatArray:
    """Give the size of the largest FRF of the same quantity and excited point, (n_points, n_frfs) array."""
    largest = np.zeros_like(measured.size)
    quantities = np.array([label.quantity.power for label in measured.labels])
    for quantity in np.unique(quantities):
        for index in np.unique(measured.input_index):
            frfs = np.flatnonzero((quantities == quantity) & (measured.input_index == index))
            if len(frfs):
                largest[:, frfs] = measured.size[:, frfs].max(axis=1, keepdims=True)
    return largest


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Whitening:
    """Linear map that turns errors of all FRFs into independent ones of variance 1.

    Parameters
    ----------
    factors : (n_frfs, n_points, n_points) complex array
        Inverses of the lower Cholesky factors of each FRF's covariance.
    blocks : tuple of (FRFs, Q, shrink)
        Errors that several FRFs share: orthonormal directions in whitened space, and the part to remove from each.
    """

    factors: ComplexArray
    blocks: tuple[tuple[IntArray, FloatArray, FloatArray], ...]

    @property
    def log_density(self) -> float:
        """Log likelihood of zero error, less its constant: the smaller the expected errors, the larger."""
        separate = float(np.sum(np.log(np.abs(np.diagonal(self.factors, axis1=1, axis2=2)))))
        return 2 * separate + sum(float(np.sum(np.log1p(-shrink))) for *_, shrink in self.blocks)

    def __call__(self, errors: ComplexArray) -> FloatArray:
        """Whiten.

        Parameters
        ----------
        errors : (n_points, n_frfs, ...) complex array
            SI.

        Returns
        -------
        (2 n_points n_frfs, ...) array
            Real and imaginary parts, each of variance 1.
        """
        n_points, n_frfs, *rest = errors.shape
        white = _whiten_separately(self.factors, errors).reshape(n_frfs, 2 * n_points, -1)
        for frfs, directions, shrink in self.blocks:
            part = white[frfs].reshape(len(frfs) * 2 * n_points, -1)
            part -= directions @ (shrink[:, None] * (directions.T @ part))
            white[frfs] = part.reshape(len(frfs), 2 * n_points, -1)
        return np.ascontiguousarray(white.reshape(n_frfs * 2 * n_points, *rest))

    def transposed(self, columns: FloatArray) -> FloatArray:
        """Bring columns before what several FRFs share is removed: products with whitened errors stay.

        Parameters
        ----------
        columns : (2 n_points n_frfs, n) array
            To be multiplied by whitened errors.

        Returns
        -------
        (n_frfs, 2 n_points, n) array
            To be multiplied by errors that are whitened FRF by FRF.
        """
        n_frfs, n_points = self.factors.shape[:2]
        before = columns.reshape(n_frfs, 2 * n_points, -1).copy()
        for frfs, directions, shrink in reversed(self.blocks):
            part = before[frfs].reshape(len(frfs) * 2 * n_points, -1)
            part -= directions @ (shrink[:, None] * (directions.T @ part))
            before[frfs] = part.reshape(len(frfs), 2 * n_points, -1)
        return before

    def shared_rows(self) -> FloatArray:
        """Give what several FRFs share, (n_frfs, 2 n_points, n) array.

        The squares of its products with errors that are whitened FRF by FRF are what the removal takes off their
        square: ``|w - D s D^T w|^2 = |w|^2 - |sqrt(2 s - s^2) D^T w|^2``.
        """
        n_frfs, n_points = self.factors.shape[:2]
        rows = [np.zeros((n_frfs, 2 * n_points, 0))]
        for frfs, directions, shrink in self.blocks:
            embedded = np.zeros((n_frfs, 2 * n_points, len(shrink)))
            embedded[frfs] = (directions * np.sqrt(shrink * (2 - shrink))).reshape(len(frfs), 2 * n_points, -1)
            rows.append(embedded)
        return np.concatenate(rows, axis=2)


def _whiten_separately(factors: ComplexArray, errors: ComplexArray) -> FloatArray:
    """Whiten each FRF by itself, (n_frfs, 2 n_points, n) array; what leaves an FRF as it is costs nothing there."""
    columns = errors.reshape(*errors.shape[:2], -1)
    n_points, n_frfs, n = columns.shape
    white = np.zeros((n_frfs, 2 * n_points, n))
    for frf, factor in enumerate(factors):
        changed = np.flatnonzero(columns[:, frf].any(axis=0))
        raw = np.sqrt(2.0) * columns[:, frf, changed]
        part = blas.ztrmm(1.0, factor.T, raw, lower=0, trans_a=1) if n > 1 else factor @ raw  # half the work, for many
        white[frf, :n_points, changed], white[frf, n_points:, changed] = part.real.T, part.imag.T
    return white


def make_whitening(measured: TransferFunctions, *, tolerance: float, floor: float = 1.0) -> Whitening:
    """Prepare whitening by the noise and by the errors of any nominal model that no parameter stands for.

    Parameters
    ----------
    measured : TransferFunctions
        The data.
    tolerance : float
        Relative tolerance of the model: a part of it is the error of its FRFs that no parameter stands for.
    floor : float
        Factor of the model's errors: large ones smooth narrow peaks for a search.

    Returns
    -------
    Whitening
        To apply to misfits and their derivatives.
    """
    log_omega = np.log(measured.s.imag)
    apart = (log_omega[:, None] - log_omega[None, :]) / SMOOTH_LENGTH
    smooth = SMOOTH_PART**2 * np.exp(-0.5 * apart**2) + ROUGH_PART**2 * np.eye(len(measured.s))
    factors: list[ComplexArray] = []
    for frf in range(len(measured.labels)):
        relative = measured.size[:, frf] * np.exp(1j * np.angle(measured.values[:, frf]))
        model = (floor * tolerance) ** 2 * smooth * np.outer(relative, relative.conj())
        lower = linalg.cholesky(measured.covariance[frf] + model, lower=True, check_finite=False)
        inverse = linalg.solve_triangular(lower, np.eye(len(lower)), lower=True, check_finite=False)
        factors.append(np.asarray(inverse, np.complex128))
    inverses = np.array(factors, np.complex128)
    return Whitening(factors=inverses, blocks=tuple(_shared_blocks(measured, inverses)))


def _shared_blocks(measured: TransferFunctions, factors: ComplexArray) -> list[tuple[IntArray, FloatArray, FloatArray]]:
    """Blocks by the noise of the force at each excited point."""
    blocks = []
    for index, shared in enumerate(measured.shared_errors):
        frfs = np.flatnonzero(measured.input_index == index)
        if shared.shape[1]:
            blocks.append(_shared_block(measured, factors, frfs, np.hstack([shared, 1j * shared]) / np.sqrt(2.0)))
    return blocks


def _shared_block(
    measured: TransferFunctions, factors: ComplexArray, frfs: IntArray, shared: ComplexArray
) -> tuple[IntArray, FloatArray, FloatArray]:
    errors = measured.values_above_noise[:, frfs, None] * shared[:, None, :]
    columns = _whiten_separately(factors[frfs], errors).reshape(-1, shared.shape[1])
    strong = np.sum(columns**2, 0) > NEGLIGIBLE
    return (frfs, *_shared_directions(columns[:, strong]))


def _shared_directions(columns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Directions of shared errors, and the part of them that exceeds variance 1."""
    directions, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    strong = sizes**2 > NEGLIGIBLE
    return np.ascontiguousarray(directions[:, strong]), 1 - 1 / np.sqrt(1 + sizes[strong] ** 2)
