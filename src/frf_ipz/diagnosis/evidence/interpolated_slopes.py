"""Whitened derivatives of FRFs by nuisance parameters, from few points of the contour.

FRFs of some ten modes have hundreds of derivatives, and nearly all of them are products of the same few functions: what
poles let a function do over a band has far fewer dimensions than the contour has points. A basis of these functions is
found from sums of products of the modal motions with arbitrary coefficients [Halko2011]. The points at which it is
conditioned best are chosen by a pivoted QR factorization [Drmac2016]: a derivative is then known everywhere from its
values at these points, and only the functions of the basis have to be whitened, once for each FRF.

[Halko2011] N. Halko, P. G. Martinsson, J. A. Tropp, Finding structure with randomness, SIAM Review 53 (2011) 217-288.
[Drmac2016] Z. Drmač, S. Gugercin, A new selection operator for the discrete empirical interpolation method, SIAM J.
Sci. Comput. 38 (2016) A631-A648.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg
from scipy.linalg import blas

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.diagnosis.model.response import Response, nuisance_jacobian

if TYPE_CHECKING:
    from frf_ipz.diagnosis.evidence.fit import Data
    from frf_ipz.diagnosis.model.layout import Layout
    from frf_ipz.diagnosis.model.nuisance import NuisancePrior

ACCURACY = 1e-10  # of the largest function: with what interpolation adds, some digits below that of a fit
PER_MODE = 4  # functions that a mode gives to products of motions: its pole once and twice, each with two coefficients
OVERSAMPLING = 10  # sums of products beside those: Halko, Martinsson, Tropp, section 4.2


@dataclass(frozen=True, slots=True, eq=False)
class WhitenedSlopes:
    """Whitened derivatives of all FRFs at all points: the derivatives are fewer than the sums that show the functions.

    Parameters
    ----------
    columns : (n_data, n) array
        The derivatives.
    """

    columns: FloatArray

    def products(self) -> FloatArray:
        """Products of the derivatives with each other, (n, n) array."""
        return self.columns.T @ self.columns

    def products_with(self, white: FloatArray) -> FloatArray:
        """Products of the derivatives with whitened values, (n_data, n_values): (n, n_values) array."""
        return self.columns.T @ white


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class InterpolatedSlopes:
    """Whitened derivatives of all FRFs, along a few orthonormal directions of each.

    Parameters
    ----------
    data : Data
        Whose errors whiten them.
    response : Response
        Of the model, at the point of linearisation.
    directions : (n_frfs, n_points, r) complex array
        Orthonormal, in the space of each FRF whitened by itself.
    columns : (n_frfs, 2 r, n) array
        Derivatives along them, real and imaginary parts, without regard of the errors that FRFs share.
    shared : tuple of (n_frfs of the block, 2 r, n_shared) array
        Directions of each block of errors that FRFs share, along the same.
    """

    data: Data
    response: Response
    directions: ComplexArray
    columns: FloatArray
    shared: tuple[FloatArray, ...]

    def products(self) -> FloatArray:
        """Products of the derivatives with each other, (n, n) array."""
        n_frfs, n_rows, n = self.columns.shape
        stacked = self.columns.reshape(n_frfs * n_rows, n)
        products = stacked.T @ stacked
        for removed in self._removed():
            products -= removed.T @ removed
        return np.asarray(products)

    def products_with(self, white: FloatArray) -> FloatArray:
        """Products of the derivatives with whitened values.

        Parameters
        ----------
        white : (n_data, n_values) array
            Whitened values.

        Returns
        -------
        (n, n_values) array
            The products.
        """
        gains = self.data.gain_directions(self.response)
        return self._products_with(white - gains @ (gains.T @ white))

    def _removed(self) -> list[FloatArray]:
        """Give what shared errors and unknown gains take off the derivatives, as rows of products to subtract."""
        removed = []
        for (frfs, _, shrink), along in zip(self.data.whitening.blocks, self.shared, strict=True):
            part = np.tensordot(along, self.columns[frfs], ((0, 1), (0, 1)))
            removed.append(np.sqrt(shrink * (2 - shrink))[:, None] * part)
        gains = self.data.gain_directions(self.response)
        return [*removed, self._products_with(gains).T] if gains.size else removed

    def _products_with(self, white: FloatArray) -> FloatArray:
        n_frfs, n_points, _ = self.directions.shape
        by_frf = white.reshape(n_frfs, 2, n_points, -1)
        along = _along(self.directions, by_frf[:, 0] + 1j * by_frf[:, 1])
        for (frfs, directions, shrink), shared in zip(self.data.whitening.blocks, self.shared, strict=True):
            part = directions.T @ by_frf[frfs].reshape(len(directions), -1)
            along[frfs] -= shared @ (shrink[:, None] * part)
        return np.asarray(np.tensordot(self.columns, along, ((0, 1), (0, 1))))


def differentiate_by_nuisance(
    data: Data, response: Response, nuisance_prior: NuisancePrior, layout: Layout
) -> WhitenedSlopes | InterpolatedSlopes:
    """Differentiate whitened FRFs by nuisance parameters, in the way that costs less.

    Parameters
    ----------
    data : Data
        Whose errors whiten them.
    response : Response
        At the point of linearisation, on the contour of the data.
    nuisance_prior : NuisancePrior
        The parameters.
    layout : Layout
        Sensors and excited points.

    Returns
    -------
    WhitenedSlopes or InterpolatedSlopes
        Per standard deviation of each parameter.
    """
    if nuisance_prior.size <= 2 * _count_sums(nuisance_prior):  # few beside the sums that would show the functions
        return WhitenedSlopes(data.slopes(response, nuisance_jacobian(response, nuisance_prior, layout)))
    return interpolate_slopes(data, response, nuisance_prior, layout)


def interpolate_slopes(
    data: Data, response: Response, nuisance_prior: NuisancePrior, layout: Layout
) -> InterpolatedSlopes:
    """Differentiate whitened FRFs by nuisance parameters, at a few points.

    Parameters
    ----------
    data : Data
        Whose errors whiten them.
    response : Response
        At the point of linearisation, on the contour of the data.
    nuisance_prior : NuisancePrior
        The parameters.
    layout : Layout
        Sensors and excited points.

    Returns
    -------
    InterpolatedSlopes
        Per standard deviation of each parameter.
    """
    points, functions = choose_points(response, nuisance_prior, data.measured.size)
    jacobian = nuisance_jacobian(response.receptances_at(points), nuisance_prior, layout)
    gains = data.gains(response)
    n_functions, n_frfs = functions.shape[1], len(data.whitening.factors)
    directions = np.empty((n_frfs, *functions.shape), np.complex128)
    columns = np.empty((n_frfs, 2 * n_functions, nuisance_prior.size))
    for frf, factor in enumerate(data.whitening.factors):
        raw = (np.sqrt(2.0) * gains[frf] * response.chain[:, frf])[:, None] * functions
        white = blas.ztrmm(1.0, factor.T, raw, lower=0, trans_a=1)
        directions[frf], triangle = linalg.qr(white, mode="economic", check_finite=False)
        along = triangle @ jacobian[:, frf]
        columns[frf, :n_functions], columns[frf, n_functions:] = along.real, along.imag
    shared = []
    for frfs, of_errors, _ in data.whitening.blocks:
        parts = of_errors.reshape(len(frfs), 2, len(response.s), -1)
        shared.append(_along(directions[frfs], parts[:, 0] + 1j * parts[:, 1]))
    return InterpolatedSlopes(
        data=data, response=response, directions=directions, columns=columns, shared=tuple(shared)
    )


def choose_points(response: Response, nuisance_prior: NuisancePrior, size: FloatArray) -> tuple[IntArray, ComplexArray]:
    """Choose points of the contour from which derivatives of receptances follow at all others.

    Parameters
    ----------
    response : Response
        At the point of linearisation.
    nuisance_prior : NuisancePrior
        The parameters.
    size : (n_points, n_frfs) array
        Of the FRFs: what is accurate refers to it.

    Returns
    -------
    points : (r,) int array
        Indices.
    functions : (n_points, r) complex array
        What a derivative of 1 at one of these points and 0 at the others is everywhere.
    """
    weights = np.mean(np.abs(response.chain) / size, axis=1)[:, None]
    sums = np.zeros((len(weights), _count_sums(nuisance_prior)), np.complex128)
    for part in _sum_products(response, nuisance_prior):
        sums += weights * part / np.linalg.norm(weights * part, axis=0)
    basis, triangle, _ = linalg.qr(sums, mode="economic", pivoting=True, check_finite=False)
    remaining = np.abs(np.diag(triangle))
    basis = basis[:, : np.count_nonzero(remaining > ACCURACY * remaining[0])]
    _, order = linalg.qr(basis.T, mode="r", pivoting=True, check_finite=False)
    points = np.sort(order[: basis.shape[1]]).astype(np.int64)
    functions = linalg.solve(basis[points].T, basis.T, check_finite=False).T
    return points, np.asarray(functions * weights[points, 0] / weights)


def _sum_products(response: Response, nuisance_prior: NuisancePrior) -> tuple[ComplexArray, ...]:
    """Sum products of modal motions, and motions, with arbitrary coefficients, beside a constant; each column is a sum.

    All are of the same few functions, so one column may add one of each.
    """
    m, n_points, s = nuisance_prior.n_modes, len(response.s), response.s[:, None]
    stiffness = np.maximum(response.modes.omega[:m], np.abs(s).min())[:, None]  # what a change acts on a motion by
    outputs = (stiffness * response.output_motion[:, :m]).reshape(n_points, -1)
    inputs = (stiffness * response.input_motion[:, :m]).reshape(n_points, -1)
    count = _count_sums(nuisance_prior)
    powers = (s / np.abs(s).max()) ** np.arange(3) @ _coefficients(3, count)
    products = (outputs @ _coefficients(outputs.shape[1], count)) * (inputs @ _coefficients(inputs.shape[1], count))
    motions = np.concatenate([response.output_motion, response.input_motion], axis=2).reshape(n_points, -1)
    all_motions = motions @ _coefficients(motions.shape[1], count)
    return tuple(np.asarray(part, np.complex128) for part in (products * powers, all_motions, np.ones((n_points, 1))))


def _count_sums(nuisance_prior: NuisancePrior) -> int:
    return PER_MODE * nuisance_prior.n_modes + OVERSAMPLING


@lru_cache(maxsize=16)
def _coefficients(n_terms: int, n_sums: int) -> FloatArray:
    """Give arbitrary coefficients, the same ones always."""
    return np.random.default_rng(n_terms).standard_normal((n_terms, n_sums))


def _along(directions: ComplexArray, values: ComplexArray) -> FloatArray:
    """Bring values, (n_frfs, n_points, n), to directions of each FRF: real and imaginary parts, (n_frfs, 2 r, n)."""
    along = np.matmul(directions.conj().swapaxes(1, 2), values)
    return np.concatenate([along.real, along.imag], axis=1)
