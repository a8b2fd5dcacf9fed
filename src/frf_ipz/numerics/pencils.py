"""Poles and zeros of (M, B, K) as roots of matrix pencils, and how they move with the matrices.

Poles are the roots of ``det(s^2 M + s B + K)``. The zeros of the FRF from an input row b to an output row c are the
roots of the bordered determinant ``det [[s^2 M + s B + K, b], [c, 0]]``; on the complements of b (from the left) and c
(from the right) that is a smaller pencil of the same kind, eq. (5) of [Dorosti2018]
(doi:10.1016/j.conengprac.2017.11.002) for general rows.

A root that is simple moves by ``-(y^T dP x) / (y^T P'(s) x)``, with x and y the right and left vectors of ``P(s)``.
Eqs. (21) and (23) of the paper lack the minus sign, and have x in the place of y: sensor and actuator differ, so the
pencil of the zeros is not symmetric.

LAPACK's generalised solver is called directly: it keeps zeros at infinity apart, and SciPy's front end would take
longer than the computation itself for matrices of this size.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.errors import NumericalError

INFINITE = 1e-13  # beta over alpha of a root that QZ cannot distinguish from infinity
EQUAL = 1e-6  # relative, of omega^2: far below what a test resolves, far above rounding


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Roots:
    """Roots of a pencil with their vectors.

    Parameters
    ----------
    values : (n,) complex array
        rad/s, or (rad/s)^2 for an undamped pencil.
    right_vectors, left_vectors : (r, n) complex array
        ``P(s) x = 0`` and ``y^T P(s) = 0`` on the complements, in the coordinates of the matrices.
    slope : (n,) complex array
        ``y^T P'(s) x``.
    """

    values: ComplexArray
    right_vectors: ComplexArray
    left_vectors: ComplexArray
    slope: ComplexArray

    def take(self, indices: object) -> Roots:
        """Select roots.

        Parameters
        ----------
        indices : index array
            Indices of the roots, in the order of the result.

        Returns
        -------
        Roots
            The selected ones.
        """
        index = np.asarray(indices)
        return Roots(
            values=self.values[index],
            right_vectors=self.right_vectors[:, index],
            left_vectors=self.left_vectors[:, index],
            slope=self.slope[index],
        )


def complement(row: FloatArray) -> FloatArray:
    """Orthonormal basis of all vectors that a row maps to zero, by one Householder reflection.

    Parameters
    ----------
    row : (r,) array
        Not zero.

    Returns
    -------
    (r, r - 1) array
        Columns orthogonal to the row and to one another.

    Examples
    --------
    >>> complement(np.array([0.0, 2.0]))
    array([[1.],
           [0.]])
    """
    pivot = int(np.argmax(np.abs(row)))
    unit = row / np.linalg.norm(row)
    reflected = unit.copy()
    reflected[pivot] += np.copysign(1.0, unit[pivot])
    basis = np.eye(len(row)) - np.outer(reflected, reflected) / (1.0 + abs(unit[pivot]))
    return np.asarray(np.delete(basis, pivot, axis=1))


def damped_poles(mass: FloatArray, damping: FloatArray, stiffness: FloatArray) -> Roots:
    """Roots of det(s^2 M + s B + K).

    Parameters
    ----------
    mass, damping, stiffness : (r, r) array
        They need not be symmetric.

    Returns
    -------
    Roots
        All 2 r of them, conjugates included, rad/s.
    """
    return _quadratic_roots(mass, damping, stiffness, None, None)


def damped_zeros(
    mass: FloatArray, damping: FloatArray, stiffness: FloatArray, output_row: FloatArray, input_row: FloatArray
) -> Roots:
    """Zeros of the FRF from one input to one output.

    Parameters
    ----------
    mass, damping, stiffness : (r, r) array
        They need not be symmetric.
    output_row, input_row : (r,) array
        Motion of the sensor's and of the excited DOF for unit motions of the coordinates.

    Returns
    -------
    Roots
        At most 2 r - 2, conjugates included, rad/s; without those at infinity.
    """
    return _quadratic_roots(mass, damping, stiffness, complement(input_row), complement(output_row))


def generalised_eigh(first: FloatArray, second: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Solve first @ v = value * second @ v, each symmetric.

    Parameters
    ----------
    first, second : (n, n) array
        Symmetric; the second positive definite.

    Returns
    -------
    values : (n,) array
        Ascending.
    vectors : (n, n) array
        Columns, of unit size in the second matrix.

    Raises
    ------
    LinAlgError
        If the second matrix is not positive definite.
    """
    values, vectors, info = lapack.dsygvd(first, second)
    if info:
        raise np.linalg.LinAlgError
    return values, vectors


def modes_of_stack(mass: FloatArray, stiffness: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Modes of many undamped models at once.

    Parameters
    ----------
    mass, stiffness : (..., r, r) array
        Symmetric; masses positive definite.

    Returns
    -------
    squares : (..., r) array
        Squared natural frequencies, ascending.
    shapes : (..., r, r) array
        Columns, mass-normalised.

    Raises
    ------
    LinAlgError
        If a mass matrix is not positive definite.
    """
    lower = np.linalg.inv(np.linalg.cholesky(mass))
    values, vectors = np.linalg.eigh(lower @ stiffness @ lower.swapaxes(-1, -2))
    return values, lower.swapaxes(-1, -2) @ vectors


def separate_equal_modes(eigenvalues: FloatArray, at_ports: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Turn modes of one frequency so that as many as can keep still at the ports do.

    Any combination of them is a mode too: of a square tube, bending along its axes as well as along its diagonals. What
    moves the ports, in order of how far, are the right singular vectors of the shapes there.

    Parameters
    ----------
    eigenvalues : (r,) array
        Ascending, (rad/s)^2.
    at_ports : (n_ports, r) array
        Mass-normalised shapes there.

    Returns
    -------
    eigenvalues : (r,) array
        The mean of those that are equal to within 1e-6, far below what a test resolves.
    turn : (r, r) array
        Orthogonal: shapes @ turn are the new ones.
    """
    values, turn = eigenvalues.copy(), np.eye(len(eigenvalues))
    steps = np.diff(eigenvalues) > EQUAL * np.abs(eigenvalues[1:])
    for modes in np.split(np.arange(len(eigenvalues)), np.flatnonzero(steps) + 1):
        if len(modes) > 1:
            values[modes] = values[modes].mean()
            turn[np.ix_(modes, modes)] = np.linalg.svd(at_ports[:, modes])[2].T
    return values, turn


def undamped_poles(mass: FloatArray, stiffness: FloatArray) -> Roots:
    """Squared natural frequencies of a symmetric pair.

    Parameters
    ----------
    mass, stiffness : (r, r) array
        Symmetric; the mass positive definite.

    Returns
    -------
    Roots
        Roots of K x = mu M x, ascending, (rad/s)^2; right and left vectors are the same.

    Raises
    ------
    NumericalError
        If the mass is not positive definite.
    """
    try:
        values, vectors = generalised_eigh(stiffness, mass)
    except np.linalg.LinAlgError:
        message = "the mass matrix of the reduced model is not positive definite: check masses and units"
        raise NumericalError(message) from None
    shapes = vectors.astype(complex)
    return Roots(
        values=values.astype(complex), right_vectors=shapes, left_vectors=shapes, slope=np.ones(len(values), complex)
    )


def undamped_zeros(mass: FloatArray, stiffness: FloatArray, output_row: FloatArray, input_row: FloatArray) -> Roots:
    """Squared zeros of the undamped FRF from one input to one output.

    Parameters
    ----------
    mass, stiffness : (r, r) array
        Mass and stiffness.
    output_row, input_row : (r,) array
        As for `damped_zeros`.

    Returns
    -------
    Roots
        ``-s^2`` of each zero, (rad/s)^2: positive on the imaginary axis of s, negative for real zeros, complex for
        quadruples.
    """
    rows, columns = complement(input_row), complement(output_row)
    small_mass = rows.T @ mass @ columns
    if small_mass.size == 0:
        return _no_roots(len(rows))
    values, y, x = _generalised_eig(rows.T @ stiffness @ columns, small_mass)
    slope = np.sum(y * (small_mass @ x), axis=0)
    return Roots(values=values, right_vectors=columns @ x, left_vectors=rows @ y, slope=slope)


def damped_sensitivity(
    roots: Roots,
    *,
    mass: FloatArray | None = None,
    damping: FloatArray | None = None,
    stiffness: FloatArray | None = None,
) -> ComplexArray:
    """How roots of a quadratic pencil move with parameters.

    Parameters
    ----------
    roots : Roots
        Of `damped_poles` or `damped_zeros`.
    mass, damping, stiffness : (p, r, r) array, optional
        Derivatives of the matrices by the parameters; without those that depend on none.

    Returns
    -------
    (n, p) complex array
        Derivatives of the roots, rad/s per unit of the parameter.
    """
    powers = ((2, mass), (1, damping), (0, stiffness))
    change = sum(
        roots.values[:, None] ** power * _bilinear_forms(roots, derivative)
        for power, derivative in powers
        if derivative is not None
    )
    return np.asarray(-change / roots.slope[:, None])


def undamped_sensitivity(roots: Roots, stiffness: FloatArray, mass: FloatArray | None = None) -> ComplexArray:
    """How roots of an undamped pencil move with parameters.

    Parameters
    ----------
    roots : Roots
        Of `undamped_poles` or `undamped_zeros`.
    stiffness : (p, r, r) array
        Derivatives of the stiffness by the parameters.
    mass : (p, r, r) array, optional
        Derivatives of the mass, where it depends on any.

    Returns
    -------
    (n, p) complex array
        Derivatives of the squared roots, (rad/s)^2 per unit of the parameter.
    """
    change = _bilinear_forms(roots, stiffness)
    if mass is not None:
        change = change - roots.values[:, None] * _bilinear_forms(roots, mass)
    return np.asarray(change / roots.slope[:, None])


def unpack_vectors(imaginary: FloatArray, packed: FloatArray) -> ComplexArray:
    """Turn LAPACK's real storage of vectors of a real pencil into complex vectors.

    Parameters
    ----------
    imaginary : (n,) array
        Imaginary parts of the roots; a positive one is followed by its conjugate.
    packed : (r, n) array
        Real part, then imaginary part, of each conjugate pair.

    Returns
    -------
    (r, n) complex array
        One vector a root.
    """
    vectors = packed.astype(complex)
    first = np.flatnonzero(imaginary > 0)
    vectors[:, first] += 1j * packed[:, first + 1]
    vectors[:, first + 1] = vectors[:, first].conj()
    return vectors


def _bilinear_forms(roots: Roots, matrices: FloatArray) -> ComplexArray:
    """y^T A x of every root and matrix."""
    size = roots.right_vectors.shape[0] ** 2
    products = (roots.left_vectors.T[:, :, None] * roots.right_vectors.T[:, None, :]).reshape(-1, size)
    flat = matrices.reshape(-1, size).T
    # real and imaginary parts apart: a product with a complex factor would first make the matrices complex
    result = np.zeros((len(products), flat.shape[1]), complex)
    result.real = np.ascontiguousarray(products.real) @ flat
    if np.any(products.imag):
        result.imag = np.ascontiguousarray(products.imag) @ flat
    return result


def _quadratic_roots(
    mass: FloatArray, damping: FloatArray, stiffness: FloatArray, rows: FloatArray | None, columns: FloatArray | None
) -> Roots:
    if rows is not None and columns is not None:
        mass, damping, stiffness = (rows.T @ matrix @ columns for matrix in (mass, damping, stiffness))
    order = len(mass)
    norm = np.linalg.norm(stiffness) or np.linalg.norm(mass)  # a free rigid body has no stiffness
    if norm == 0.0:
        return _no_roots(0 if rows is None else len(rows))
    scale = _time_scale(norm, np.linalg.norm(damping), np.linalg.norm(mass))
    first, second = np.zeros((2, 2 * order, 2 * order))
    first[:order, order:] = second[:order, :order] = np.eye(order)
    first[order:, :order] = stiffness / -norm
    first[order:, order:] = damping * (-scale / norm)
    second[order:, order:] = mass * (scale**2 / norm)
    values, y, x = _generalised_eig(first, second)
    values, y, x = values * scale, y[order:], x[:order]
    slope = 2 * values * np.sum(y * (mass @ x), axis=0) + np.sum(y * (damping @ x), axis=0)
    if rows is not None and columns is not None:
        y, x = rows @ y, columns @ x
    return Roots(values=values, right_vectors=x, left_vectors=y, slope=slope)


def _time_scale(stiffness: np.floating, damping: np.floating, mass: np.floating) -> float:
    """Scale time so that mass and stiffness are of one size: QZ is accurate relative to the norm of the whole pencil.

    Between two masses that only a spring and a damper connect, no mass acts.
    """
    if mass > 0.0:
        return float(np.sqrt(stiffness / mass))
    return float(stiffness / damping) if damping > 0.0 else 1.0


def _no_roots(size: int) -> Roots:
    none, vectors = np.zeros(0, complex), np.zeros((size, 0), complex)
    return Roots(values=none, right_vectors=vectors, left_vectors=vectors, slope=none)


def _generalised_eig(first: FloatArray, second: FloatArray) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Finite roots of first x = s second x with left vectors (of y^T, not y^H) and right ones."""
    real, imaginary, beta, y, x, _, info = lapack.dggev(first, second)
    if info:
        raise NumericalError(
            "the reduced model's eigenvalues cannot be computed: its matrices hold values far too large or not finite"
        )
    finite = np.abs(beta) > INFINITE * np.hypot(real, imaginary)
    alpha = real + 1j * imaginary
    values = alpha[finite] / beta[finite]
    return (
        values,
        unpack_vectors(imaginary, y)[:, finite].conj(),
        unpack_vectors(imaginary, x)[:, finite],
    )
