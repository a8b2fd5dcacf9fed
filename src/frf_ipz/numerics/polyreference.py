"""Poles by the polyreference least-squares complex frequency method, for all model orders at once.

A right matrix fraction ``H(z) = N(z) D(z)^-1`` in the powers of ``z = exp(-i theta)`` is fitted to ``N - H D = 0``
[Peeters2004]. The numerators are eliminated; the leading blocks of the reduced matrix belong to the lower orders. With
the highest coefficient of D fixed to the identity, the poles that stand for noise come out unstable [Cauberghe2005].

[Peeters2004] B. Peeters, H. Van der Auweraer, P. Guillaume, J. Leuridan, The PolyMAX frequency-domain method, Shock and
Vibration 11, 2004, 395-409, doi:10.1155/2004/523692.
[Cauberghe2005] B. Cauberghe, P. Guillaume, P. Verboven, S. Vanlanduit, E. Parloo, On the influence of the parameter
constraint on the stability of the poles and the discrimination capabilities of the stabilisation diagrams, Mechanical
Systems and Signal Processing 19, 2005, 989-1014, doi:10.1016/j.ymssp.2004.11.005.
"""

from __future__ import annotations

import warnings

import numpy as np
from scipy import linalg

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.errors import IllConditionedError
from frf_ipz.numerics.chebyshev import chebyshev_nodes, interpolation, nodes_for_waves

LINES_AT_ONCE = 4096  # whose intermediate results stay in the cache
PHASE = 4.0  # of the highest wave at the ends of an interval: 2 to 8 take about the same time
ROUNDING = 1e-15  # of a wave between nodes
RIDGE = 1e-13  # of the mean diagonal: far above rounding, far below what moves a pole that the data show


def reduced_normal_matrix(theta: FloatArray, H: ComplexArray, order: int, *, real: bool) -> ComplexArray:
    """Build the normal matrix of the denominator's coefficients, the numerators eliminated.

    Parameters
    ----------
    theta : (n_lines,) array
        Angle of each frequency line on the circle.
    H : (n_lines, n_rows, n_references) complex array
        FRFs; rows of equal noise.
    order : int
        Highest order n.
    real : bool
        Coefficients are real: the lines cover the upper half circle and the lower half is its mirror image.

    Returns
    -------
    ((n + 1) n_references,) * 2 complex array
        Hermitian; real numbers where `real`. Blocks by power of z.
    """
    n_lines, n_rows, n_ref = H.shape
    products = [np.einsum("lr,lr->l", H[:, :, i].conj(), H[:, :, j]) for i in range(n_ref) for j in range(n_ref)]
    columns = np.concatenate([np.ones((n_lines, 1)), H.reshape(n_lines, -1), np.stack(products, axis=1)], axis=1)
    moments = _moments(theta, columns, order, real=real)
    k = np.arange(order + 1)
    toeplitz = moments[(k[None, :] - k[:, None]) + order]
    R, S = toeplitz[:, :, 0], toeplitz[:, :, 1 : 1 + n_rows * n_ref]
    T = toeplitz[:, :, 1 + n_rows * n_ref :].reshape(order + 1, order + 1, n_ref, n_ref)
    half = linalg.solve_triangular(_cholesky(R), S.reshape(order + 1, -1), lower=True)
    half = half.reshape(order + 1, order + 1, n_rows, n_ref).transpose(0, 2, 1, 3).reshape((order + 1) * n_rows, -1)
    full = T.transpose(0, 2, 1, 3).reshape((order + 1) * n_ref, -1)
    return np.asarray(full - half.conj().T @ half)


def denominator(M: ComplexArray, n_ref: int, order: int) -> ComplexArray:
    """Coefficients of one order.

    Parameters
    ----------
    M : array
        From `reduced_normal_matrix`, for this order or a higher one.
    n_ref : int
        Number of references.
    order : int
        The order m.

    Returns
    -------
    (m, n_ref, n_ref) complex array
        D_0 to D_(m-1); D_m is the identity.
    """
    size = order * n_ref
    normal = _with_ridge(M[:size, :size])
    with (
        warnings.catch_warnings()
    ):  # of a high order on FRFs without noise: its poles count where lower ones confirm them
        warnings.simplefilter("ignore", linalg.LinAlgWarning)
        coefficients = linalg.solve(normal, -M[:size, size : size + n_ref], assume_a="her", check_finite=False)
    return np.asarray(coefficients.reshape(order, n_ref, n_ref))


def denominator_roots(D: ComplexArray) -> ComplexArray:
    """Roots z of det D(z) = 0.

    Parameters
    ----------
    D : (m, n_ref, n_ref) complex array
        From `denominator`.

    Returns
    -------
    (m n_ref,) complex array
        Eigenvalues of the block companion matrix.
    """
    order, n_ref, _ = D.shape
    companion = np.zeros((order * n_ref,) * 2, D.dtype)
    companion[:-n_ref, n_ref:] = np.eye((order - 1) * n_ref)
    companion[-n_ref:] = -D.transpose(1, 0, 2).reshape(n_ref, -1)
    return np.asarray(np.linalg.eigvals(companion), complex)


def participation(D: ComplexArray, z: ComplexArray) -> ComplexArray:
    """Participation of the references in each pole: the left null vector of D(z).

    Parameters
    ----------
    D : (m, n_ref, n_ref) complex array
        From `denominator`.
    z : (n_poles,) complex array
        Roots of det D.

    Returns
    -------
    (n_poles, n_ref) complex array
        Vectors of unit length.
    """
    order, n_ref, _ = D.shape
    powers = z[:, None] ** np.arange(order + 1)
    coefficients = np.concatenate([D.reshape(order, -1), np.eye(n_ref).reshape(1, -1)])
    values = (powers @ coefficients).reshape(-1, n_ref, n_ref)
    return np.asarray(np.linalg.svd(values)[0][:, :, -1].conj())


def _moments(theta: FloatArray, columns: ComplexArray, order: int, *, real: bool) -> ComplexArray:
    """Sum over lines of each column times exp(-i theta m), for m from -order to order."""
    theta, columns = _carried_to_nodes(theta, columns, order)
    even, odd, even_imag, odd_imag = np.zeros((4, order + 1, columns.shape[1]))
    for first in range(0, len(theta), LINES_AT_ONCE):
        part = slice(first, first + LINES_AT_ONCE)
        powers = np.ones((order + 1, len(theta[part])), complex)
        powers[1:] = np.exp(1j * theta[part])
        powers = np.cumprod(powers, axis=0)
        cosine, sine, values = powers.real.copy(), powers.imag.copy(), columns[part]
        even += cosine @ values.real
        odd += sine @ values.imag
        if not real:
            even_imag += cosine @ values.imag
            odd_imag += sine @ values.real
    if real:
        return np.concatenate([(even - odd)[:0:-1], even + odd])
    positive = even + odd + 1j * (even_imag - odd_imag)
    negative = even - odd + 1j * (even_imag + odd_imag)
    return np.asarray(np.concatenate([negative[:0:-1], positive]))


def _carried_to_nodes(theta: FloatArray, columns: ComplexArray, order: int) -> tuple[FloatArray, ComplexArray]:
    """Give the few angles at which waves up to an order make the same sums to rounding as over all lines."""
    half = float(theta[-1] - theta[0]) / 2
    count = max(1, int(np.ceil(order * half / PHASE)))
    n_nodes = nodes_for_waves(order * half / count, ROUNDING)
    if count * n_nodes >= len(theta):
        return theta, columns
    edges = theta[0] + 2 * half / count * np.arange(count + 1)
    middles = (edges[1:] + edges[:-1]) / 2
    first = np.concatenate([[0], np.searchsorted(theta, edges[1:-1]), [len(theta)]])
    carried = np.empty((count, n_nodes, columns.shape[1]), complex)
    for number, middle in enumerate(middles.tolist()):
        lines = slice(first[number], first[number + 1])
        weights = interpolation((theta[lines] - middle) * count / half, n_nodes)
        carried[number] = weights.T @ columns[lines]
    angles = middles[:, None] + half / count * chebyshev_nodes(n_nodes)
    return angles.ravel(), carried.reshape(len(angles) * n_nodes, -1)


def _with_ridge(matrix: ComplexArray) -> ComplexArray:
    """Bound the condition of a normal matrix: where lines are missing, high orders are nearly dependent."""
    return np.asarray(matrix + RIDGE * np.trace(matrix).real / len(matrix) * np.eye(len(matrix)))


def _cholesky(R: ComplexArray) -> ComplexArray:
    try:
        return np.asarray(linalg.cholesky(_with_ridge(R), lower=True))
    except linalg.LinAlgError:
        raise IllConditionedError(
            f"the model order {len(R) - 1} of the stabilisation diagram is too high for the lines of the band; "
            "set a lower [fit] max_order",
            key="fit.max_order",
        ) from None
