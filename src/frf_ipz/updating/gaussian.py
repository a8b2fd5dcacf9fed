"""The linear Gaussian step of an update: the smallest change that meets the targets to within their noise.

With the whitened parameters xi (prior: unit normal), data ``d = G xi + noise`` and the noise covariance R, the mean is
``G^T (G G^T + R)^-1 d``: the change of least norm for weights that follow from R. The size of the changes is not known
beforehand; the standard deviations of the prior terms are those of the largest evidence ([MacKay1992],
doi:10.1162/neco.1992.4.3.415), each with a log-normal prior.

How closely targets are met follows from the discrepancy principle: the weighted misfit must not exceed their number.
Where the most likely change leaves a larger misfit, the targets contradict one another (or a reduced model cannot
express them), and the slack, a variance on top of their covariance, grows until it does not.

Whatever is computed of n data costs ``n k^2`` for k parameters. The covariance of the data, their slack left out, is
diagonalised once (`Linearised`), block by block and in units of the slack; the errors that all data share become
parameters of unit variance. From there on every slack is a number on a diagonal.

The information for any slack is a sum over the data with other weights. As functions of the level of noise all these
weights are much alike, so that those of a few slacks, mixed, are those of any other to `ALIKE`: the sum over the data
is formed for these only, and the search for the slack costs what the parameters do.

Zeros of many FRFs say little more than the shapes of a few modes do, so most combinations of parameters are moved by no
datum. Those of which the data say less than `UNTOLD` of what the prior says are left out, by a Cholesky factor with
pivots of the information (LAPACK's ``pstrf``), and keep their prior.

[Nocedal2006]: J. Nocedal, S. J. Wright, Numerical Optimization, 2nd ed., Springer 2006, doi:10.1007/978-0-387-40065-5.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import blas, cho_solve, lapack, solve_triangular

from frf_ipz.arrays import BoolArray, FloatArray, IntArray

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from frf_ipz.updating.parameters import PriorTerm
    from frf_ipz.updating.target_noise import TargetNoise

GROWTH = 1.5  # of the slack from trial to trial
MAX_TRIALS = 40  # up to ten million times the slack
MAX_SCALE_STEPS = 25  # the evidence is flat near its top: more steps change nothing that matters
MAX_DEVIATION = 6.0  # standard deviations of a scale's prior within which the search stays: a line search may overflow
LARGEST_SCALE_STEP = 2.0  # of the logarithm of a scale in one step
FLAT = 1e-4  # of the logarithm of the evidence: what a further step would gain is nothing (1e-2 moves printed digits)
MAX_HALVINGS = 10
FAR = 1.0  # of the logarithm of the evidence: a step that gains more ends where the curvature is another one
LEAST_SHARE = 0.1  # of a step that was too long
ROWS_AT_ONCE = 4096
DRAWS_OF_A_SCALE = 4  # of parameters, on average, for each draw of their terms' standard deviations
ROWS_OF_A_TILE = 128  # when a matrix is mirrored: both tiles stay in the cache
SIZES = (0.25, 0.5, 1.0, 2.0)  # of further parameters that are tried, over their standard deviation before the data
ALIKE = 1e-4  # relative, of the noise of each datum: none is known as well
LARGEST_SHARES = 1e3  # in a mixture: what rounding may grow by
OF_PRIOR = 1e-2  # of its information: what rounding may take of it
INDEFINITE = "the information of an update is not positive definite"
UNTOLD = 1e-4  # of the prior's information: a deviation that so few data narrow is the prior's to four digits


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GaussianStep:
    """Posterior mean of a linear step, and what draws from the posterior need.

    Parameters
    ----------
    mean : (k,) array
        Whitened parameters.
    misfit : float
        ``(d - G mean)^T R^-1 (d - G mean)``, to be compared with the number of data.
    n_determined : float
        Effective number of data that determine parameters against the prior: the trace of ``G^T (G G^T + R)^-1 G``.
    root : (c + k, c + k) array
        Upper Cholesky factor of the information about the errors that all data share, and about the parameters.
    """

    mean: FloatArray
    misfit: float
    n_determined: float
    root: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Linearised:
    """Linear data in coordinates in which their noise is diagonal, whatever the slack.

    Parameters
    ----------
    joined : (n, c + k + 1) array
        Sensitivity to the errors that all data share; that to each prior term's unit normal numbers, for a standard
        deviation of 1, or to those combinations of them that the data tell of; and d: all in units of the slack.
    ends : tuple of int
        Where the columns of the shared errors end, and of each term.
    bases : tuple of (k_i, m_i) arrays, or None
        These combinations, orthonormal; None where they are the numbers themselves.
    level : (n,) array
        Variance for a slack of 0.
    log_slack : float
        Sum of the logarithms of the units.
    axes : tuple of (m, m) arrays
        Directions of each block, by columns, in units of the slack.
    places : tuple of (m,) int arrays
        The data of each block.
    slack : (n,) array
        The units.
    rounding : (n,) array
        Variance that each datum got besides, since double precision cannot tell less of it from none.
    sums : list of pair of (n,) and (c + k + 1, c + k + 1) array
        Weights of the data, and the sums of products of sensitivity and data with them, as far as they are known.
    latest : list of pair of (n,) and (c + k + 1, c + k + 1) array
        The weights that were asked for last, and their sum: scales are searched for at one slack too.
    """

    joined: FloatArray
    ends: tuple[int, ...]
    bases: tuple[FloatArray | None, ...]
    level: FloatArray
    axes: tuple[FloatArray, ...]
    places: tuple[IntArray, ...]
    slack: FloatArray
    rounding: FloatArray
    sums: list[tuple[FloatArray, FloatArray]] = field(default_factory=list)
    latest: list[tuple[FloatArray, FloatArray]] = field(default_factory=list)

    @property
    def data(self) -> FloatArray:
        """d, in units of the slack, (n,)."""
        return np.asarray(self.joined[:, -1])

    @property
    def common(self) -> FloatArray:
        """Sensitivity to the errors that all data share, (n, c)."""
        return np.asarray(self.joined[:, : self.ends[0]])

    @property
    def parts(self) -> tuple[FloatArray, ...]:
        """Sensitivity to the combinations of each term, (n, m_i)."""
        return tuple(self.joined[:, first:end] for first, end in pairwise(self.ends))

    def factors(self, scales: FloatArray) -> FloatArray:
        """Give the standard deviation of each column.

        Parameters
        ----------
        scales : (t,) array
            Standard deviations of the terms.

        Returns
        -------
        (c + k,) array
            1 for shared errors.
        """
        return np.concatenate([np.ones(self.ends[0]), np.repeat(scales, np.diff(self.ends))])

    def rotated(self, rows: FloatArray) -> FloatArray:
        """Express numbers of the data in these coordinates.

        Parameters
        ----------
        rows : (n, ...) array
            One a datum.

        Returns
        -------
        (n, ...) array
            The same.
        """
        return _rotated(self.axes, self.places, self.slack, rows.reshape(len(rows), -1)).reshape(rows.shape)

    def square(self, error: FloatArray, factor: float) -> float:
        """Weigh an error by the inverse of the noise.

        Parameters
        ----------
        error : (n,) array
            Of the data, as they were given.
        factor : float
            On the slack.

        Returns
        -------
        float
            ``e^T R^-1 e``.
        """
        return self._square(self.rotated(error), factor)

    def _square(self, turned: FloatArray, factor: float) -> float:
        weights = 1 / (self.level + factor**2)
        whole = float(weights @ turned**2)
        if not self.common.shape[1]:
            return whole
        weighted = self.common * weights[:, None]
        shared = weighted.T @ turned
        information = np.eye(len(shared)) + weighted.T @ self.common
        return whole - float(shared @ np.linalg.solve(information, shared))

    def blocks(self) -> Iterator[tuple[slice, IntArray, FloatArray]]:
        """Give the blocks of the noise.

        Yields
        ------
        slice, (m,) int array, (m, m) array
            Rows in these coordinates, the data they are made of, and the axes.
        """
        first = 0
        for place, vectors in zip(self.places, self.axes, strict=True):
            yield slice(first, first + len(place)), place, vectors
            first += len(place)

    def sensitivity(self, scales: FloatArray) -> Iterator[tuple[IntArray, FloatArray]]:
        """Give the sensitivity of the data, as they were given, to scaled combinations, block by block.

        Parameters
        ----------
        scales : (t,) array
            Standard deviations of the terms.

        Yields
        ------
        (m,) int array, (m, k) array
            Which data, and their sensitivity.
        """
        columns = slice(self.ends[0], self.ends[-1])
        factors = self.factors(scales)[columns]
        for rows, place, vectors in self.blocks():
            yield place, (self.slack[place, None] * vectors) @ self.joined[rows, columns] * factors

    def whole(self, combined: FloatArray) -> FloatArray:
        """Turn values of the combinations into those of all whitened parameters.

        Parameters
        ----------
        combined : (..., m) array
            Of the combinations.

        Returns
        -------
        (..., k) array
            Of the parameters.
        """
        pieces = np.split(combined, np.array(self.ends[1:-1], int) - self.ends[0], axis=-1)
        return np.concatenate(
            [p if basis is None else p @ basis.T for p, basis in zip(pieces, self.bases, strict=True)], axis=-1
        )

    def combined(self, whole: FloatArray) -> FloatArray:
        """Turn values of all whitened parameters into those of the combinations.

        Parameters
        ----------
        whole : (..., k) array
            Of the parameters.

        Returns
        -------
        (..., m) array
            Of the combinations.
        """
        sizes = [p.shape[1] if b is None else len(b) for p, b in zip(self.parts, self.bases, strict=True)]
        pieces = np.split(whole, np.cumsum(sizes)[:-1], axis=-1)
        return np.concatenate(
            [p if basis is None else p @ basis for p, basis in zip(pieces, self.bases, strict=True)], axis=-1
        )

    def products(self, weights: FloatArray, scales: FloatArray, *, beside: FloatArray | None = None) -> FloatArray:
        """Add up products of sensitivity and data over all data.

        Parameters
        ----------
        weights : (n,) array
            Of the data, positive.
        scales : (t,) array
            Standard deviations of the terms.
        beside : (n,) array, optional
            Weights that the error of a mixture is relative to; `weights` where they are left out.

        Returns
        -------
        (c + k + 1, c + k + 1) array
            Of the sensitivity to shared errors and scaled parameters; last of the data.
        """
        factors = np.append(self.factors(scales), 1.0)
        total = self._sum(weights, weights if beside is None else beside)
        total *= factors[:, None]
        total *= factors
        return total

    def _sum(self, weights: FloatArray, beside: FloatArray) -> FloatArray:
        """Give the sum, which the caller may change: that of before where weights are the same."""
        if beside is not weights:  # of a derivative: no one asks for it again
            return self._mixed(weights, beside)
        if not (self.latest and np.array_equal(self.latest[0][0], weights)):
            self.latest[:] = [(weights, self._mixed(weights, beside))]
        return self.latest[0][1].copy()

    def _mixed(self, weights: FloatArray, beside: FloatArray) -> FloatArray:
        """Mix known sums, or form another."""
        if self.sums:
            known = np.stack([others / beside for others, _ in self.sums], axis=1)
            sizes = known.max(axis=0)
            known /= sizes
            shares = np.linalg.lstsq(known, weights / beside, rcond=None)[0]
            is_alike = bool(np.all(np.abs(known @ shares - weights / beside) < ALIKE))
            if is_alike and np.abs(shares).sum() < LARGEST_SHARES:
                mixed = np.zeros_like(self.sums[0][1])
                for share, (_, total) in zip(shares / sizes, self.sums, strict=True):
                    blas.daxpy(total.ravel(), mixed.ravel(), a=share)
                return mixed
        total = _sum_of_products(self.joined, weights)
        self.sums.append((weights, total))
        return total.copy()

    def information(self, scales: FloatArray, factor: float) -> tuple[FloatArray, FloatArray, float]:
        """Give the information of shared errors and parameters, with that of their prior.

        Parameters
        ----------
        scales : (t,) array
            Standard deviations of the terms.
        factor : float
            On the slack.

        Returns
        -------
        root : (c + k, c + k) array
            Its upper Cholesky factor.
        right : (c + k,) array
            Weighted data.
        square : float
            Sum of the weighted squares of the data: with the same weights, which a mixture has to `ALIKE` only.
        """
        products = self.products(1 / (self.level + factor**2), scales)
        information = products[:-1, :-1].copy()
        information[np.diag_indices_from(information)] += 1.0
        # symmetric: what LAPACK takes for its columns are the rows, so that nothing is copied
        root, info = lapack.dpotrf(information.T, lower=0, clean=1, overwrite_a=1)
        if info:
            raise np.linalg.LinAlgError(INDEFINITE)
        return np.asarray(root), products[:-1, -1], float(products[-1, -1])


def linearise(
    parts: Iterable[FloatArray],
    data: FloatArray,
    noise: TargetNoise,
    slack: FloatArray | None = None,
    *,
    scales: FloatArray | None = None,
    combining: bool = True,
) -> Linearised:
    """Diagonalise the noise of linear data, and find the combinations of parameters that they tell of.

    Parameters
    ----------
    parts : iterable of (n, k_i) arrays
        Sensitivity of the data to each term's unit normal numbers, for a standard deviation of 1.
    data : (n,) array
        d.
    noise : TargetNoise
        R without slack, positive definite.
    slack : (n,) array, optional
        Standard deviations of what no parameter explains, for a factor of 1.
    scales : (t,) array, optional
        Standard deviations of the terms, about which it is judged what data tell; 1 by default.
    combining : bool
        False where data are solved for once or twice: to find the combinations would cost more than it saves.

    Returns
    -------
    Linearised
        The same data.
    """
    units = np.ones(len(data)) if slack is None else slack
    pieces = [noise.common, *parts]
    rounding = _rounding(noise, pieces[1:], np.ones(len(pieces)) if scales is None else scales)
    if rounding.any():
        noise = noise.plus(rounding)
    levels, axes, places = [], [], []
    for part, block in noise.parts():
        values, vectors = np.linalg.eigh(block / np.outer(units[part], units[part]))
        levels.append(np.maximum(values, np.finfo(float).tiny))
        axes.append(vectors)
        places.append(part)
    turned = tuple(axes), tuple(places), units
    level = np.concatenate(levels) if levels else np.zeros(0)
    ends = tuple(np.cumsum([piece.shape[1] for piece in pieces]).tolist())
    joined = _rotated(*turned, *pieces, data[:, None])
    del pieces  # large
    linear = Linearised(
        joined=joined,
        ends=ends,
        bases=(None,) * (len(ends) - 1),
        level=level,
        axes=turned[0],
        places=turned[1],
        slack=units,
        rounding=rounding,
    )
    return (
        _with_combinations(linear, np.ones(len(ends) - 1) if scales is None else scales, 0.0) if combining else linear
    )


def _with_combinations(linear: Linearised, scales: FloatArray, factor: float) -> Linearised:
    """Find the combinations of parameters that the data tell of at a slack; with more slack they tell less."""
    if any(basis is not None for basis in linear.bases):
        return linear
    weights = 1 / (linear.level + factor**2)
    total = linear._sum(weights, weights)
    columns = [slice(first, end) for first, end in pairwise(linear.ends)]
    bases = tuple(_told(total[at, at] * std**2) for at, std in zip(columns, scales, strict=False))
    joined, ends = linear.joined, linear.ends
    if any(basis is not None for basis in bases):
        combined = [
            joined[:, at] if basis is None else joined[:, at] @ basis for at, basis in zip(columns, bases, strict=True)
        ]
        joined = np.hstack([joined[:, : ends[0]], *combined, joined[:, -1:]])
        ends = tuple(np.cumsum([ends[0], *(piece.shape[1] for piece in combined)]).tolist())
        total = _combined(total, columns, bases)
    sums = [(weights, total)] if np.isfinite(total).all() else []
    return replace(linear, joined=joined, ends=ends, bases=bases, sums=sums, latest=[])


def _rounding(noise: TargetNoise, parts: Sequence[FloatArray], stds: FloatArray) -> FloatArray:
    """Give the variance that data need for their information, and the prior's, to have a sum in double precision.

    A target that runs off for the least change of a parameter, as a zero does that meets another, would be known better
    than the prior has it by more decades than a number has. It tells no less with a little more noise.
    """
    spread = np.sum(noise.common**2, axis=1)
    for part, std in zip(parts, stds, strict=False):
        spread += std**2 * np.einsum("ij,ij->i", part, part)
    own = np.zeros(len(spread))
    for place, block in noise.parts():
        own[place] = np.diagonal(block)
    least = spread * len(spread) * np.finfo(float).eps / OF_PRIOR
    return np.where(least > own, least, 0.0)


def with_more_noise(linear: Linearised, noise: TargetNoise, data: IntArray) -> Linearised:
    """Diagonalise the noise of some blocks of data again: that of the others is as it was.

    Parameters
    ----------
    linear : Linearised
        The data, with combinations of the parameters that were found without slack.
    noise : TargetNoise
        With more noise of some data.
    data : (m,) int array
        Which ones.

    Returns
    -------
    Linearised
        The same data under that noise; with less information the combinations hold all the more.
    """
    joined, level, axes = linear.joined.copy(), linear.level.copy(), list(linear.axes)
    total = linear.products(1 / linear.level, np.ones(len(linear.bases)))
    blocks = zip(linear.blocks(), noise.parts(), strict=True)
    for number, ((rows, place, vectors), (_, block)) in enumerate(blocks):
        if not np.isin(place, data).any():
            continue
        units = linear.slack[place]
        values, axes[number] = np.linalg.eigh((block + np.diag(linear.rounding[place])) / np.outer(units, units))
        joined[rows] = axes[number].T @ vectors @ linear.joined[rows]
        level[rows] = np.maximum(values, np.finfo(float).tiny)
        total -= _sum_of_products(linear.joined[rows], 1 / linear.level[rows])
        total += _sum_of_products(joined[rows], 1 / level[rows])
    return replace(linear, joined=joined, level=level, axes=tuple(axes), sums=[(1 / level, total)], latest=[])


def _sum_of_products(joined: FloatArray, weights: FloatArray) -> FloatArray:
    total = np.zeros((joined.shape[1],) * 2)
    for first in range(0, len(weights), ROWS_AT_ONCE):
        rows = slice(first, first + ROWS_AT_ONCE)
        weighted = joined[rows] * np.sqrt(weights[rows])[:, None]
        total += weighted.T @ weighted
    return total


def _combined(total: FloatArray, places: Sequence[slice], bases: Sequence[FloatArray | None]) -> FloatArray:
    """Products of combinations from those of all parameters."""
    for at, basis in zip(reversed(places), reversed(bases), strict=True):
        if basis is not None:
            total = np.vstack([total[: at.start], basis.T @ total[at], total[at.stop :]])
            total = np.hstack([total[:, : at.start], total[:, at] @ basis, total[:, at.stop :]])
    return total


def _told(information: FloatArray) -> FloatArray | None:
    """Find combinations that data tell of; the prior is the same along all of them, and with slack data tell less."""
    factor, pivots, rank, _ = lapack.dpstrf(information, tol=UNTOLD, lower=1)
    if rank == len(information):
        return None
    directions = np.zeros((len(information), rank))
    directions[pivots - 1] = np.tril(factor[:, :rank])
    return np.asarray(np.linalg.qr(directions)[0])


def _rotated(
    axes: tuple[FloatArray, ...], places: tuple[IntArray, ...], slack: FloatArray, *pieces: FloatArray
) -> FloatArray:
    """Turn data whose columns come in pieces, and join them: written where they stay, as they are large."""
    ends = [0, *np.cumsum([piece.shape[1] for piece in pieces]).tolist()]
    result = np.empty((len(slack), ends[-1]))
    first = 0
    for place, vectors in zip(places, axes, strict=True):
        turn, target = vectors.T / slack[place], result[first : first + len(place)]
        rows = slice(place[0], place[-1] + 1) if np.all(np.diff(place) == 1) else place  # a slice copies nothing
        for piece, (start, end) in zip(pieces, pairwise(ends), strict=True):
            np.matmul(turn, piece[rows], out=target[:, start:end])
        first += len(place)
    return result


def solve_step(linear: Linearised, scales: FloatArray, factor: float = 0.0) -> GaussianStep:
    """Mean of the whitened parameters, given linear data.

    Parameters
    ----------
    linear : Linearised
        The data.
    scales : (t,) array
        Standard deviations of the terms.
    factor : float
        On the slack.

    Returns
    -------
    GaussianStep
        The posterior.
    """
    root, right, _ = linear.information(scales, factor)
    n_common = linear.ends[0]
    mean = cho_solve((root, False), right, check_finite=False)[n_common:]
    inverse_root = lapack.dtrtri(root)[0][n_common:]
    columns = slice(n_common, linear.ends[-1])
    error = linear.data - linear.joined[:, columns] @ (linear.factors(scales)[columns] * mean)
    return GaussianStep(
        mean=linear.whole(mean),
        misfit=linear._square(error, factor),
        n_determined=float(len(mean) - np.sum(inverse_root**2)),
        root=root,
    )


def distance_to_optimum(
    linear: Linearised, step: GaussianStep, scales: FloatArray, factor: float, whitened: FloatArray, error: FloatArray
) -> float:
    """Measure how far parameters are from where their own error would take them.

    Parameters
    ----------
    linear : Linearised
        Sensitivity and noise near these parameters.
    step : GaussianStep
        The posterior, with the same scales and factor.
    scales : (t,) array
        Standard deviations of the terms.
    factor : float
        On the slack.
    whitened : (k,) array
        Whitened parameters.
    error : (n,) array
        Targets minus model for them.

    Returns
    -------
    float
        Posterior standard deviations, over all directions together, whatever the number of data.
    """
    now, n_common = linear.combined(whitened), linear.ends[0]
    turned, weights = linear.rotated(error), 1 / (linear.level + factor**2)
    factors, columns = linear.factors(scales), linear.joined[:, : linear.ends[-1]]
    right = factors * (columns.T @ (weights * (turned + columns[:, n_common:] @ (factors[n_common:] * now))))
    change = cho_solve((step.root, False), right, check_finite=False)[n_common:] - now
    beyond = float(np.sum((whitened - linear.whole(now)) ** 2))  # along combinations that no datum moves
    return float(np.sqrt(np.sum((step.root[n_common:, n_common:] @ change) ** 2) + beyond))


def step_by_discrepancy(linear: Linearised, scales: FloatArray, factor: float) -> tuple[GaussianStep, float]:
    """Find the smallest factor on the slack with which the misfit is no more than the number of data.

    Parameters
    ----------
    linear : Linearised
        The data.
    scales : (t,) array
        Standard deviations of the terms.
    factor : float
        The most likely factor, where the search starts.

    Returns
    -------
    step : GaussianStep
        The posterior with that factor.
    factor : float
        The factor by the discrepancy principle, to within its growth from trial to trial.
    """
    step = solve_step(linear, scales, factor)
    for _ in range(MAX_TRIALS - 1):
        if step.misfit <= len(linear.data):
            break
        factor *= GROWTH
        step = solve_step(linear, scales, factor)
    return step, factor


def contradicted(
    linear: Linearised,
    scales: FloatArray,
    *,
    limit: float,
    excluded_std: float,
    most: int,
    judged: BoolArray | None = None,
) -> IntArray:
    """Find the data that all others and the prior contradict: the worst first, then those that are without it.

    With K the covariance of the data under noise and prior, datum i lies ``(K^-1 d)_i / (K^-1)_ii`` from what the
    others predict, with the variance ``1 / (K^-1)_ii``; more noise of a datum changes ``K^-1`` by a matrix of rank one.

    Parameters
    ----------
    linear : Linearised
        The data, without slack.
    scales : (t,) array
        Standard deviations of the terms.
    limit : float
        Standard deviations from the prediction by the other data beyond which a datum is contradicted.
    excluded_std : float
        Standard deviation that a contradicted datum gets, so that the others are no longer judged by it.
    most : int
        At most so many.
    judged : (n,) bool array, optional
        Which data may be named; all where it is left out.

    Returns
    -------
    (m,) int array
        Their indices; none where none is beyond the limit.
    """
    inverse = _InverseCovariance.of(linear, scales)
    weighted, own = inverse.weighted.copy(), inverse.diagonal.copy()
    open_to = np.ones(len(own), bool) if judged is None else judged
    found: list[int] = []
    columns: list[FloatArray] = []
    variance = excluded_std**2
    while len(found) < min(most, len(own)):
        distance = np.where(open_to, np.abs(weighted) / np.sqrt(own), 0.0)
        worst = int(np.argmax(distance))
        if not distance[worst] > limit:
            break
        column = inverse.column(worst)
        for other in columns:
            column -= other * other[worst]
        found.append(worst)
        columns.append(column * np.sqrt(variance / (1 + variance * own[worst])))
        weighted -= columns[-1] * (columns[-1][worst] / own[worst] * weighted[worst])
        rest = own[worst] / (1 + variance * own[worst])
        own = np.maximum(own - columns[-1] ** 2, np.finfo(float).tiny)
        own[worst] = rest
    return np.array(found, int)


@dataclass(frozen=True, kw_only=True, eq=False)
class _InverseCovariance:
    """``K^-1`` of the data: its diagonal, its product with the data, its columns."""

    linear: Linearised
    weights: FloatArray
    factors: FloatArray
    root: FloatArray
    weighted: FloatArray
    diagonal: FloatArray

    @classmethod
    def of(cls, linear: Linearised, scales: FloatArray) -> _InverseCovariance:
        root, right, _ = linear.information(scales, 0.0)
        mean = cho_solve((root, False), right, check_finite=False)
        weights, factors = 1 / linear.level, linear.factors(scales)
        columns = linear.joined[:, : linear.ends[-1]]
        error = weights * (linear.data - columns @ (factors * mean))
        inverse_root = lapack.dtrtri(root)[0] * factors[:, None]
        weighted, diagonal = np.empty((2, len(weights)))
        first, seen = 0, np.zeros((0, len(mean)))
        for rows, place, vectors in linear.blocks():
            if rows.stop > first + len(seen):
                first = rows.start
                chunk = slice(first, max(rows.stop, first + ROWS_AT_ONCE))
                seen = weights[chunk, None] * (columns[chunk] @ inverse_root)
            explained = np.sum((vectors @ seen[rows.start - first : rows.stop - first]) ** 2, axis=1)
            weighted[place] = vectors @ error[rows]
            diagonal[place] = np.maximum(vectors**2 @ weights[rows] - explained, np.finfo(float).tiny)
        return cls(linear=linear, weights=weights, factors=factors, root=root, weighted=weighted, diagonal=diagonal)

    def column(self, datum: int) -> FloatArray:
        """One column, (n,)."""
        linear, weights = self.linear, self.weights
        rows, at = next(
            (rows, vectors[place == datum][0]) for rows, place, vectors in linear.blocks() if datum in place
        )
        columns = linear.joined[:, : linear.ends[-1]]
        told = cho_solve(
            (self.root, False), self.factors * (columns[rows].T @ (weights[rows] * at)), check_finite=False
        )
        turned = -weights * (columns @ (self.factors * told))
        turned[rows] += weights[rows] * at
        column = np.empty(len(weights))
        for its_rows, place, vectors in linear.blocks():
            column[place] = vectors @ turned[its_rows]
        return column


def draw_posterior(
    linear: Linearised,
    terms: Sequence[PriorTerm],
    scales: FloatArray,
    noise: TargetNoise,
    rng: np.random.Generator,
    count: int,
    *,
    factor: float,
) -> FloatArray:
    """Draw whitened parameters from the posterior: draws of the prior, corrected by their data.

    What the data leave open of the terms' standard deviations is open in the draws too: few data tell these hardly
    better than to a factor of two, and those that are the most likely alone give bands that are too narrow.

    Parameters
    ----------
    linear : Linearised
        The data.
    terms : sequence of PriorTerm
        The terms.
    scales : (t,) array
        Their most likely standard deviations.
    noise : TargetNoise
        Of the data, with their slack.
    rng : Generator
        Source of randomness.
    count : int
        Number of draws.
    factor : float
        On the slack.

    Returns
    -------
    (count, k) array
        Draws, in units of `scales`.
    """
    prior = rng.standard_normal((count, sum(term.root.shape[1] for term in terms)))
    errors = linear.rotated(noise.draw(rng.standard_normal((count, len(linear.data)))).T)
    linear = _with_combinations(linear, scales, factor)  # at this slack, whatever the scales that are drawn
    chosen, n_common, weights = linear.combined(prior), linear.ends[0], 1 / (linear.level + factor**2)
    by_errors = linear.joined[:, : linear.ends[-1]].T @ (weights[:, None] * errors)
    held = _HeldSlack.of(linear, factor)
    sizes = [term.root.shape[1] for term in terms]
    drawn = np.empty_like(prior)
    for its_scales, members in _drawn_scales(held, terms, scales, rng, count):
        factors = linear.factors(its_scales)[:, None]
        right = held.information[:, n_common:] @ (factors[n_common:] * chosen[members].T) + by_errors[:, members]
        changed = held.solve(its_scales, factors * (held.right[:, None] - right))[n_common:]
        drawn[members] = (prior[members] + linear.whole(changed.T)) * np.repeat(its_scales / scales, sizes)
    return drawn


@dataclass(frozen=True, kw_only=True, eq=False)
class _HeldSlack:
    """Information at one slack under any standard deviations of the terms.

    The block of the largest term is diagonalised once, so that another standard deviation costs ``k m^2`` for the m
    numbers beside it.
    """

    linear: Linearised
    factor: float
    information: FloatArray
    right: FloatArray
    square: float
    big: slice
    values: FloatArray
    axes: FloatArray
    beside: FloatArray

    @classmethod
    def of(cls, linear: Linearised, factor: float) -> _HeldSlack:
        products = linear.products(1 / (linear.level + factor**2), np.ones(len(linear.bases)))
        places = [slice(first, end) for first, end in pairwise(linear.ends)]
        big = max(places, key=lambda place: place.stop - place.start)
        information = products[:-1, :-1]
        values, axes = np.linalg.eigh(information[big, big])
        others = np.delete(np.arange(len(information)), big)
        return cls(
            linear=linear,
            factor=factor,
            information=information,
            right=products[:-1, -1],
            square=float(products[-1, -1]),
            big=big,
            values=np.maximum(values, 0.0),
            axes=axes,
            beside=information[others, big] @ axes,
        )

    def _parts(self, scales: FloatArray) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]:
        """Which numbers stand beside the large block, its diagonal, their coupling, and the root of what is left."""
        factors = self.linear.factors(scales)
        others = np.asarray(np.delete(np.arange(len(factors)), self.big), np.int64)
        own, its = factors[others], factors[self.big]
        diagonal = 1.0 + its**2 * self.values
        coupling = its * own[:, None] * self.beside
        left = own[:, None] * self.information[np.ix_(others, others)] * own - (coupling / diagonal) @ coupling.T
        left[np.diag_indices_from(left)] += 1.0
        return others, diagonal, coupling, np.asarray(np.linalg.cholesky(left), np.float64)

    def solve(self, scales: FloatArray, right: FloatArray) -> FloatArray:
        """Solve for the information with that of the prior, (c + k, m)."""
        others, diagonal, coupling, root = self._parts(scales)
        turned = self.axes.T @ right[self.big]
        solution = np.empty_like(right)
        solution[others] = cho_solve((root, True), right[others] - coupling @ (turned / diagonal[:, None]))
        solution[self.big] = self.axes @ ((turned - coupling.T @ solution[others]) / diagonal[:, None])
        return solution

    def value(self, scales: FloatArray) -> float:
        """Minus the logarithm of the evidence, but for a constant; infinite where rounding leaves no information."""
        try:
            others, diagonal, coupling, root = self._parts(scales)
        except np.linalg.LinAlgError:
            return np.inf
        right = self.linear.factors(scales) * self.right
        turned = self.axes.T @ right[self.big]
        left = solve_triangular(root, right[others] - coupling @ (turned / diagonal), lower=True)
        explained = float(turned @ (turned / diagonal) + left @ left)
        return 0.5 * (self.square - explained + float(np.log(diagonal).sum())) + float(np.log(np.diagonal(root)).sum())


def _drawn_scales(
    held: _HeldSlack, terms: Sequence[PriorTerm], scales: FloatArray, rng: np.random.Generator, count: int
) -> Iterator[tuple[FloatArray, IntArray]]:
    """Share draws out among standard deviations of the terms, in proportion to the evidence of these.

    They are drawn about the most likely ones with the expected curvature of the evidence, in opposite pairs, and taken
    by their evidence over that of the draw (sampling-importance resampling).
    """
    free = np.array([term.scale_uncertainty > 0 for term in terms])
    if not free.any() or not len(held.linear.data) or not count:
        yield scales, np.arange(count)
        return
    search = _ScaleSearch(held.linear, terms, free, scales, held.factor)
    center = np.log(scales)[free]
    root = np.linalg.cholesky(search.evidence(center).curvature())
    white = rng.standard_normal(((count + DRAWS_OF_A_SCALE - 1) // DRAWS_OF_A_SCALE, len(center)))
    white[len(white) // 2 :] = -white[: len(white) - len(white) // 2]
    tried = np.tile(scales, (len(white), 1))
    tried[:, free] = np.exp(center + np.linalg.solve(root.T, white.T).T)
    values = np.array([held.value(some) + search.of_prior(np.log(some[free])) for some in tried])
    told = np.isfinite(values)
    logs_of_weights = 0.5 * np.sum(white[told] ** 2, axis=1) - values[told]
    shares = np.cumsum(np.exp(logs_of_weights - logs_of_weights.max()))
    owners = np.flatnonzero(told)[np.searchsorted(shares, (np.arange(count) + 0.5) / count * shares[-1])]
    for owner in np.unique(owners).tolist():
        yield tried[owner], np.flatnonzero(owners == owner)


def most_likely_scales(linear: Linearised, terms: Sequence[PriorTerm], start: FloatArray) -> FloatArray:
    """Find the standard deviations of the prior terms under which the data are most likely.

    Quasi-Newton steps of their logarithms that begin with the expected curvature of the evidence. Alone, as in Fisher's
    scoring, that leads there slowly: what it says of the slack may be off by far.

    Parameters
    ----------
    linear : Linearised
        The data.
    terms : sequence of PriorTerm
        The terms, with the priors of their standard deviations; one more than the data have parts, where the last is
        the slack.
    start : (t,) array
        Standard deviations to start from.

    Returns
    -------
    (t,) array
        Standard deviations; fixed ones as they were.
    """
    free = np.array([term.scale_uncertainty > 0 for term in terms])
    if not free.any() or not len(linear.data):
        return start
    search = _ScaleSearch(linear, terms, free, start)
    logs = np.clip(np.log(start)[free], search.low, search.high)
    evidence = search.evidence(logs)
    curvature = evidence.curvature()
    for _ in range(MAX_SCALE_STEPS):
        step = search.step(logs, evidence.slope, curvature)
        if -0.5 * float(evidence.slope @ step) < FLAT:
            logs = np.clip(logs + step, search.low, search.high)
            break
        found = _better_scales(search, logs, evidence, step)
        if found is None:
            break
        moved, change, gain = found[0] - logs, found[1].slope - evidence.slope, evidence.value - found[1].value
        logs, evidence = found
        curvature = _curvature_seen(evidence.curvature() if gain > FAR else curvature, moved, change)
    scales = start.copy()
    scales[free] = np.exp(logs)
    return scales


def _better_scales(
    search: _ScaleSearch, logs: FloatArray, evidence: _Evidence, step: FloatArray
) -> tuple[FloatArray, _Evidence] | None:
    """Shorten a step until the data are likelier: to the top of the parabola through what is known of it."""
    for _ in range(MAX_HALVINGS):
        tried = np.clip(logs + step, search.low, search.high)
        new = search.try_evidence(tried)
        if new is not None and new.value <= evidence.value:
            return tried, new
        rise = float(evidence.slope @ step)
        above = np.inf if new is None else new.value - evidence.value - rise
        step = step * np.clip(-rise / (2 * above), LEAST_SHARE, 0.5)
    return None


def _curvature_seen(curvature: FloatArray, step: FloatArray, change: FloatArray) -> FloatArray:
    """Correct a curvature by the change of the slope over a step: the BFGS formula, eq. (6.19) of [Nocedal2006].

    Left as it is where that leaves no curvature of a valley, as where the slope is rounding.
    """
    told, before = float(step @ change), curvature @ step
    if told <= 0.0:
        return curvature
    corrected = curvature - np.outer(before, before) / float(step @ before) + np.outer(change, change) / told
    values = np.linalg.eigvalsh(corrected)
    return np.asarray(corrected if values[0] > len(values) * np.finfo(float).eps * values[-1] else curvature)


def log_evidence(linear: Linearised, terms: Sequence[PriorTerm], scales: FloatArray) -> float:
    """Give the logarithm of the evidence for some standard deviations of the prior terms, with their own prior.

    Parameters
    ----------
    linear : Linearised
        The data.
    terms : sequence of PriorTerm
        The terms; the last one may be the slack.
    scales : (t,) array
        Their standard deviations.

    Returns
    -------
    float
        But for a constant that the same data have whatever the terms.
    """
    free = np.array([term.scale_uncertainty > 0 for term in terms])
    logs = np.log(np.maximum(scales, np.finfo(float).tiny))[free]
    return -_ScaleSearch(linear, terms, free, scales).evidence(logs).value


def gain_of_further_terms(linear: Linearised, further: FloatArray, scales: FloatArray, factor: float) -> float:
    """Give by how much further parameters would make the data likelier, all else held.

    With C the covariance of the data d, and F the sensitivity to the further parameters, the logarithm of the evidence
    grows by ``b^T (1 + s^2 B)^-1 b s^2 / 2 - ln det(1 + s^2 B) / 2``, where ``B = F^T C^-1 F``, ``b = F^T C^-1 d``.

    Parameters
    ----------
    linear : Linearised
        The data, with the parameters that there are.
    further : (n, m) array
        Sensitivity of the data, as they were given, to the unit normal numbers of further ones.
    scales : (t,) array
        Standard deviations of the terms that there are.
    factor : float
        On the slack.

    Returns
    -------
    float
        At the likeliest of some sizes ``s`` of the further parameters.
    """
    further = linear.rotated(further)
    weighted = further / (linear.level + factor**2)[:, None]
    root, right, _ = linear.information(scales, factor)
    beside = linear.factors(scales)[:, None] * (linear.joined[:, : linear.ends[-1]].T @ weighted)
    solved = cho_solve((root, False), np.column_stack([beside, right]), check_finite=False)
    told = further.T @ weighted - beside.T @ solved[:, :-1]
    asked = weighted.T @ linear.data - beside.T @ solved[:, -1]
    values, axes = np.linalg.eigh((told + told.T) / 2.0)
    values, asked = np.maximum(values, 0.0), axes.T @ asked
    growth = [1.0 + size**2 * values for size in SIZES]
    gains = [size**2 * asked @ (asked / by) - np.log(by).sum() for size, by in zip(SIZES, growth, strict=True)]
    return float(max(gains)) / 2.0


@dataclass(frozen=True, slots=True, eq=False)
class _ScaleSearch:
    """Minus the logarithm of the evidence, by the logarithms of the free scales.

    Without a term for the slack, the factor on it is held.
    """

    linear: Linearised
    terms: Sequence[PriorTerm]
    free: BoolArray
    start: FloatArray
    held: float = 0.0

    @property
    def _center(self) -> FloatArray:
        return np.log([term.std for term in self.terms])[self.free]

    @property
    def _spread(self) -> FloatArray:
        return np.array([term.scale_uncertainty for term in self.terms])[self.free]

    @property
    def low(self) -> FloatArray:
        """Least logarithms."""
        return np.asarray(self._center - MAX_DEVIATION * self._spread)

    @property
    def high(self) -> FloatArray:
        """Largest logarithms."""
        return np.asarray(self._center + MAX_DEVIATION * self._spread)

    def step(self, logs: FloatArray, slope: FloatArray, curvature: FloatArray) -> FloatArray:
        """Newton's step of the scales that are not at an end of their range."""
        held = ((logs <= self.low) & (slope > 0)) | ((logs >= self.high) & (slope < 0))
        step = np.zeros(len(logs))
        open_ones = np.flatnonzero(~held)
        if len(open_ones):
            step[open_ones] = -np.linalg.solve(curvature[np.ix_(open_ones, open_ones)], slope[open_ones])
        return step * min(1.0, LARGEST_SCALE_STEP / max(float(np.abs(step).max()), np.finfo(float).tiny))

    def try_evidence(self, logs: FloatArray) -> _Evidence | None:
        """Value there; None where scales are so large that what rounding leaves of the prior is not positive."""
        try:
            return self.evidence(logs)
        except np.linalg.LinAlgError:
            return None

    def of_prior(self, logs: FloatArray) -> float:
        """Minus the logarithm of the prior of the free scales."""
        deviation = (logs - self._center) / self._spread
        return 0.5 * float(deviation @ deviation)

    def evidence(self, logs: FloatArray) -> _Evidence:
        """Value there; slope and expected curvature on demand."""
        scales = self.start.copy()
        scales[self.free] = np.exp(logs)
        linear, count = self.linear, len(self.linear.bases)
        has_slack = len(self.terms) > count
        factor = float(scales[-1]) if has_slack else self.held
        root, right, square = linear.information(scales[:count], factor)
        mean = cho_solve((root, False), right, check_finite=False)
        weights = 1 / (linear.level + factor**2)
        value = 0.5 * (square - float(right @ mean)) + float(np.log(np.diagonal(root)).sum())
        deviation = (logs - self._center) / self._spread
        value += self.of_prior(logs) - 0.5 * float(np.log(weights).sum())
        return _Evidence(
            value=value,
            search=self,
            scales=scales[:count],
            factor=factor,
            of_slack=has_slack and bool(self.free[-1]),
            deviation=deviation,
            root=root,
            mean=mean,
            weights=weights,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Evidence:
    """Minus the logarithm of the evidence for some scales; each derivative costs the third power of the parameters."""

    value: float
    search: _ScaleSearch
    scales: FloatArray
    factor: float
    of_slack: bool
    deviation: FloatArray
    root: FloatArray
    mean: FloatArray
    weights: FloatArray

    @cached_property
    def covariance(self) -> FloatArray:
        """Of shared errors and parameters, (c + k, c + k)."""
        return _inverse(self.root)

    @cached_property
    def _places(self) -> list[slice]:
        return [slice(first, end) for first, end in pairwise(self.search.linear.ends)]

    @cached_property
    def _by_slack(self) -> FloatArray:
        """Sums over the data by which the information falls as the slack grows, (c + k + 1, c + k + 1)."""
        square = self.factor**2
        products = self.search.linear.products(square * self.weights**2, self.scales, beside=self.weights)
        products /= square
        return products

    @cached_property
    def _share(self) -> float:
        """Mean share of a datum that parameters explain."""
        explained = np.einsum("ij,ij->", self.covariance.T, self._by_slack[:-1, :-1])
        return float(explained) / float(self.weights.sum())

    @cached_property
    def slope(self) -> FloatArray:
        """By the logarithms of the free scales."""
        search, known = self.search, 1 - np.diagonal(self.covariance)
        slope = np.zeros(len(search.terms))
        for number, place in enumerate(self._places):
            slope[number] = known[place].sum() - self.mean[place] @ self.mean[place]
        if self.of_slack:
            error = np.append(-self.mean, 1.0)
            misfit = float(error @ self._by_slack @ error)
            slope[-1] = self.factor**2 * (float(self.weights.sum()) * (1 - self._share) - misfit)
        return np.asarray(slope[search.free] + self.deviation / search._spread)

    def curvature(self) -> FloatArray:
        """Give the expected curvature."""
        search, covariance = self.search, self.covariance
        curvature = np.zeros((len(search.terms),) * 2)
        for number, place in enumerate(self._places):
            for other, its_place in enumerate(self._places):
                block = covariance[place, its_place]
                curvature[number, other] = 2 * float(np.einsum("ij,ij->", block, block))
            size = place.stop - place.start
            curvature[number, number] += 2 * float(size - 2 * np.trace(covariance[place, place]))
        if self.of_slack:
            curvature[-1] = curvature[:, -1] = self._row_of_slack()
        return np.asarray(curvature[np.ix_(search.free, search.free)] + np.diag(1 / search._spread**2))

    def _row_of_slack(self) -> FloatArray:
        square, told = self.factor**2, self._by_slack[:-1, :-1]
        row = np.zeros(len(self._places) + 1)
        for number, place in enumerate(self._places):
            columns = self.covariance[:, place]
            row[number] = 2 * square * float(np.einsum("ij,ij->", told, columns @ columns.T))
        # the trace of the square of R^-1 without what parameters explain, as if they explained the same of every datum
        row[-1] = 2 * (square * (1 - self._share)) ** 2 * float(np.sum(self.weights**2))
        return row


def _inverse(root: FloatArray) -> FloatArray:
    """Inverse of a matrix from its upper Cholesky factor, with zeros below."""
    inverse = np.asarray(lapack.dpotri(root)[0])
    for first in range(0, len(inverse), ROWS_OF_A_TILE):
        end = first + ROWS_OF_A_TILE
        corner = inverse[first:end, first:end]
        corner += np.triu(corner, 1).T
        inverse[end:, first:end] = inverse[first:end, end:].T
    return inverse
