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
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import cho_solve, cholesky, lapack

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
ROWS_AT_ONCE = 4096
ALIKE = 1e-4  # relative, of the noise of each datum: none is known as well
LARGEST_SHARES = 1e3  # in a mixture: what rounding may grow by
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
    data : (n,) array
        d, in units of the slack.
    parts : tuple of (n, m_i) arrays
        Sensitivity to each prior term's unit normal numbers, for a standard deviation of 1; or to those combinations
        of them that the data tell of.
    bases : tuple of (k_i, m_i) arrays, or None
        These combinations, orthonormal; None where they are the numbers themselves.
    common : (n, c) array
        Sensitivity to the errors that all data share.
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
    sums : list of pair of (n,) and (c + k + 1, c + k + 1) array
        Weights of the data, and the sums of products of sensitivity and data with them, as far as they are known.
    """

    data: FloatArray
    parts: tuple[FloatArray, ...]
    bases: tuple[FloatArray | None, ...]
    common: FloatArray
    level: FloatArray
    axes: tuple[FloatArray, ...]
    places: tuple[IntArray, ...]
    slack: FloatArray
    sums: list[tuple[FloatArray, FloatArray]] = field(default_factory=list)

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
        return _rotated(self.axes, self.places, self.slack, rows)

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

    def columns(self, scales: FloatArray) -> Iterator[tuple[slice, FloatArray]]:
        """Give the sensitivity to shared errors and scaled parameters, some rows at a time.

        Parameters
        ----------
        scales : (t,) array
            Standard deviations of the terms.

        Yields
        ------
        slice, (m, c + k) array
            Rows, and their sensitivity.
        """
        for first in range(0, len(self.data), ROWS_AT_ONCE):
            rows = slice(first, first + ROWS_AT_ONCE)
            scaled = [scale * part[rows] for scale, part in zip(scales, self.parts, strict=True)]
            yield rows, np.hstack([self.common[rows], *scaled])

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
        for rows, place, vectors in self.blocks():
            scaled = [scale * part[rows] for scale, part in zip(scales, self.parts, strict=True)]
            yield place, self.slack[place, None] * (vectors @ np.hstack(scaled))

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
        ends = np.cumsum([part.shape[1] for part in self.parts])[:-1]
        pieces = np.split(combined, ends, axis=-1)
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
        sizes = [part.shape[1] for part in self.parts]
        factors = np.concatenate([np.ones(self.common.shape[1]), np.repeat(scales, sizes), np.ones(1)])
        return np.asarray(self._sum(weights, weights if beside is None else beside) * factors[:, None] * factors)

    def _sum(self, weights: FloatArray, beside: FloatArray) -> FloatArray:
        if self.sums:
            known = np.stack([others / beside for others, _ in self.sums], axis=1)
            sizes = known.max(axis=0)
            known /= sizes
            shares = np.linalg.lstsq(known, weights / beside, rcond=None)[0]
            is_alike = bool(np.all(np.abs(known @ shares - weights / beside) < ALIKE))
            if is_alike and np.abs(shares).sum() < LARGEST_SHARES:
                mixed = np.zeros_like(self.sums[0][1])
                for share, (_, total) in zip(shares / sizes, self.sums, strict=True):
                    mixed += share * total
                return mixed
        total = _sum_of_products(self.common, self.parts, self.data, weights)
        self.sums.append((weights, total))
        return total

    def information(self, scales: FloatArray, factor: float) -> tuple[FloatArray, FloatArray]:
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
        """
        products = self.products(1 / (self.level + factor**2), scales)
        information = products[:-1, :-1].copy()
        information[np.diag_indices_from(information)] += 1.0
        return cholesky(information, check_finite=False), products[:-1, -1]


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
    levels, axes, places = [], [], []
    for part, block in noise.parts():
        values, vectors = np.linalg.eigh(block / np.outer(units[part], units[part]))
        levels.append(np.maximum(values, np.finfo(float).tiny))
        axes.append(vectors)
        places.append(part)
    turned = tuple(axes), tuple(places), units
    level = np.concatenate(levels) if levels else np.zeros(0)
    turned_parts = tuple(_rotated(*turned, part) for part in parts)
    common, values_of_data = _rotated(*turned, noise.common), _rotated(*turned, data)
    bases: tuple[FloatArray | None, ...] = (None,) * len(turned_parts)
    sums: list[tuple[FloatArray, FloatArray]] = []
    if combining and turned_parts:
        stds = np.ones(len(turned_parts)) if scales is None else scales
        total = _sum_of_products(common, turned_parts, values_of_data, 1 / level)
        ends = np.cumsum([common.shape[1], *(part.shape[1] for part in turned_parts)])
        columns = [slice(first, end) for first, end in pairwise(ends.tolist())]
        bases = tuple(_told(total[at, at] * std**2) for at, std in zip(columns, stds, strict=False))
        turned_parts = tuple(p if b is None else p @ b for p, b in zip(turned_parts, bases, strict=True))
        if np.isfinite(total).all():
            sums.append((1 / level, _combined(total, columns, bases)))
    return Linearised(
        data=values_of_data,
        parts=turned_parts,
        bases=bases,
        common=common,
        level=level,
        axes=turned[0],
        places=turned[1],
        slack=units,
        sums=sums,
    )


def with_more_noise(linear: Linearised, noise: TargetNoise, datum: int) -> Linearised:
    """Diagonalise the noise of one block of data again: that of the others is as it was.

    Parameters
    ----------
    linear : Linearised
        The data, with combinations of the parameters that were found without slack.
    noise : TargetNoise
        With more noise of a datum.
    datum : int
        Which one.

    Returns
    -------
    Linearised
        The same data under that noise; with less information the combinations hold all the more.
    """
    blocks = zip(linear.blocks(), noise.parts(), strict=True)
    rows, vectors, place, block = next(
        (rows, vectors, place, block) for (rows, place, vectors), (_, block) in blocks if datum in place
    )
    units = linear.slack[place]
    values, new_vectors = np.linalg.eigh(block / np.outer(units, units))
    turn = new_vectors.T @ vectors

    def turned(before: FloatArray) -> FloatArray:
        after = before.copy()
        after[rows] = turn @ before[rows]
        return after

    level = linear.level.copy()
    level[rows] = np.maximum(values, np.finfo(float).tiny)
    changed = replace(
        linear,
        data=turned(linear.data),
        parts=tuple(turned(part) for part in linear.parts),
        common=turned(linear.common),
        level=level,
        axes=tuple(new_vectors if axes is vectors else axes for axes in linear.axes),
        sums=[],
    )

    def own(each: Linearised) -> FloatArray:
        parts = tuple(part[rows] for part in each.parts)
        return _sum_of_products(each.common[rows], parts, each.data[rows], 1 / each.level[rows])

    total = linear.products(1 / linear.level, np.ones(len(linear.parts)))
    changed.sums.append((1 / level, total - own(linear) + own(changed)))
    return changed


def _sum_of_products(
    common: FloatArray, parts: tuple[FloatArray, ...], data: FloatArray, weights: FloatArray
) -> FloatArray:
    size = common.shape[1] + sum(part.shape[1] for part in parts) + 1
    total = np.zeros((size, size))
    for first in range(0, len(weights), ROWS_AT_ONCE):
        rows = slice(first, first + ROWS_AT_ONCE)
        joined = np.hstack([common[rows], *(part[rows] for part in parts), data[rows, None]])
        joined *= np.sqrt(weights[rows])[:, None]
        total += joined.T @ joined
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
    axes: tuple[FloatArray, ...], places: tuple[IntArray, ...], slack: FloatArray, rows: FloatArray
) -> FloatArray:
    result = np.empty(rows.shape)
    first = 0
    for place, vectors in zip(places, axes, strict=True):
        result[first : first + len(place)] = (vectors.T / slack[place]) @ rows[place]
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
    root, right = linear.information(scales, factor)
    n_common = linear.common.shape[1]
    mean = cho_solve((root, False), right, check_finite=False)[n_common:]
    inverse_root = lapack.dtrtri(root)[0][n_common:]
    error = linear.data.copy()
    for rows, columns in linear.columns(scales):
        error[rows] -= columns[:, n_common:] @ mean
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
    now, n_common = linear.combined(whitened), linear.common.shape[1]
    turned, weights = linear.rotated(error), 1 / (linear.level + factor**2)
    right = np.zeros(len(step.root))
    for rows, columns in linear.columns(scales):
        right += columns.T @ (weights[rows] * (turned[rows] + columns[:, n_common:] @ now))
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


def most_contradicted(linear: Linearised, scales: FloatArray, limit: float, *, least: float = 0.0) -> int:
    """Find the datum that all other data and the prior contradict most.

    Parameters
    ----------
    linear : Linearised
        The data, without slack.
    scales : (t,) array
        Standard deviations of the terms.
    limit : float
        Standard deviations from the prediction by the other data beyond which a datum is contradicted.
    least : float
        Data of a smaller modulus are ignored.

    Returns
    -------
    int
        Its index; -1 where none is beyond the limit.
    """
    root, right = linear.information(scales, 0.0)
    mean = cho_solve((root, False), right, check_finite=False)
    weights = 1 / linear.level
    weighted_error, explained = np.empty(len(weights)), np.empty(len(weights))
    data, own = np.empty(len(weights)), np.empty(len(weights))
    inverse_root = lapack.dtrtri(root)[0]
    for rows, place, vectors in linear.blocks():
        columns = np.hstack(
            [linear.common[rows], *(s * part[rows] for s, part in zip(scales, linear.parts, strict=True))]
        )
        weighted_error[place] = vectors @ (weights[rows] * (linear.data[rows] - columns @ mean))
        explained[place] = np.sum((vectors @ (weights[rows, None] * (columns @ inverse_root))) ** 2, axis=1)
        own[place] = vectors**2 @ weights[rows]
        data[place] = vectors @ linear.data[rows]
    remaining = np.maximum(own - explained, np.finfo(float).tiny)
    distance = np.where(np.abs(data) >= least, np.abs(weighted_error) / np.sqrt(remaining), 0.0)
    worst = int(np.argmax(distance))
    return worst if distance[worst] > limit else -1


def draw_posterior(
    step: GaussianStep,
    linear: Linearised,
    scales: FloatArray,
    noise: TargetNoise,
    rng: np.random.Generator,
    count: int,
    *,
    factor: float,
) -> FloatArray:
    """Draw whitened parameters from the posterior: a draw of the prior, corrected by its data.

    Parameters
    ----------
    step : GaussianStep
        The posterior.
    linear : Linearised
        The data.
    scales : (t,) array
        Standard deviations of the terms.
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
        Draws.
    """
    prior = rng.standard_normal((count, len(step.mean)))
    chosen = linear.combined(prior)
    errors = linear.rotated(noise.draw(rng.standard_normal((count, len(linear.data)))).T)
    n_common = linear.common.shape[1]
    weights = 1 / (linear.level + factor**2)
    right = np.zeros((len(step.root), count))
    for rows, columns in linear.columns(scales):
        pretended = columns[:, n_common:] @ chosen.T + errors[rows]
        right += columns.T @ (weights[rows, None] * pretended)
    correction = cho_solve((step.root, False), right, check_finite=False)[n_common:]
    return np.asarray(step.mean + prior - linear.whole(correction.T))


def most_likely_scales(linear: Linearised, terms: Sequence[PriorTerm], start: FloatArray) -> FloatArray:
    """Find the standard deviations of the prior terms under which the data are most likely.

    Fisher's scoring on their logarithms: the expected curvature of the evidence comes with its slope.

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
    value, slope, curvature = search.evaluate(logs)
    for _ in range(MAX_SCALE_STEPS):
        held = ((logs <= search.low) & (slope > 0)) | ((logs >= search.high) & (slope < 0))
        step = np.zeros(len(logs))
        open_ones = np.flatnonzero(~held)
        if len(open_ones):
            step[open_ones] = -np.linalg.solve(curvature[np.ix_(open_ones, open_ones)], slope[open_ones])
        step *= min(1.0, LARGEST_SCALE_STEP / max(float(np.abs(step).max()), np.finfo(float).tiny))
        gain = -0.5 * float(slope @ step)
        if gain < FLAT:
            logs = np.clip(logs + step, search.low, search.high)
            break
        for _ in range(MAX_HALVINGS):
            tried = np.clip(logs + step, search.low, search.high)
            new = search.evaluate(tried)
            if new[0] <= value:
                break
            step /= 2
        else:
            break
        logs = tried
        value, slope, curvature = new
    scales = start.copy()
    scales[free] = np.exp(logs)
    return scales


@dataclass(frozen=True, slots=True, eq=False)
class _ScaleSearch:
    """Minus the logarithm of the evidence, by the logarithms of the free scales."""

    linear: Linearised
    terms: Sequence[PriorTerm]
    free: BoolArray
    start: FloatArray

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

    def evaluate(self, logs: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Value, slope and expected curvature."""
        scales = self.start.copy()
        scales[self.free] = np.exp(logs)
        linear, count = self.linear, len(self.linear.parts)
        has_slack = len(self.terms) > count
        factor = float(scales[-1]) if has_slack else 0.0
        root, right = linear.information(scales[:count], factor)
        mean = cho_solve((root, False), right, check_finite=False)
        covariance = _inverse(root)
        weights = 1 / (linear.level + factor**2)
        value = 0.5 * float(weights @ linear.data**2 - right @ mean) + float(np.log(np.diagonal(root)).sum())
        value -= 0.5 * float(np.log(weights).sum())
        ends = np.cumsum([linear.common.shape[1], *(part.shape[1] for part in linear.parts)])
        places = [slice(first, end) for first, end in zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True)]
        told = np.eye(len(mean)) - covariance
        slope, curvature = np.zeros(len(self.terms)), np.zeros((len(self.terms),) * 2)
        for number, place in enumerate(places):
            slope[number] = np.trace(told[place, place]) - mean[place] @ mean[place]
            for other, its_place in enumerate(places):
                curvature[number, other] = 2 * float(np.sum(told[place, its_place] ** 2))
        if has_slack and self.free[-1]:
            slope[-1], curvature[-1] = self._by_slack(scales[:count], factor, mean, covariance, places)
            curvature[:, -1] = curvature[-1]
        deviation = (logs - self._center) / self._spread
        value += 0.5 * float(deviation @ deviation)
        curvature = curvature[np.ix_(self.free, self.free)] + np.diag(1 / self._spread**2)
        return value, slope[self.free] + deviation / self._spread, curvature

    def _by_slack(
        self, scales: FloatArray, factor: float, mean: FloatArray, covariance: FloatArray, places: list[slice]
    ) -> tuple[float, FloatArray]:
        """Slope by the logarithm of the slack, and its row of the expected curvature."""
        linear, square = self.linear, factor**2
        weights = 1 / (linear.level + square)
        products = linear.products(square * weights**2, scales, beside=weights) / square
        told = products[:-1, :-1]  # by how much the information falls
        error = np.concatenate([-mean, np.ones(1)])
        misfit = float(error @ products @ error)
        fallen = covariance @ told
        share = float(np.trace(fallen)) / float(weights.sum())
        slope = square * (float(weights.sum()) * (1 - share) - misfit)
        row = np.zeros(len(places) + 1)
        for number, place in enumerate(places):
            row[number] = 2 * square * float(np.sum(fallen[place] * covariance[:, place].T))
        # the trace of the square of R^-1 without what parameters explain, as if they explained the same of every datum
        row[-1] = 2 * (square * (1 - share)) ** 2 * float(np.sum(weights**2))
        return slope, row


def _inverse(root: FloatArray) -> FloatArray:
    """Inverse of a matrix from its upper Cholesky factor."""
    upper = np.triu(lapack.dpotri(root)[0])
    return np.asarray(upper + np.triu(upper, 1).T)
