"""Two modes at one frequency: where residues have rank two.

The residues of one mode over sensors and excited DOFs are a product of two vectors. Where two modes share a pole, the
fit finds one pole whose residues are the sum of two such products. They are told apart only up to a rotation, as any
two modes of a repeated root are; the two that are given agree at the driving points.

A second product may also be what the noise, or gains of FRFs that differ (a tilted sensor, a hammer beside its point),
leave. Both have a size that all modes share. With its prior, that of a second product being as large as the mode, the
evidence of rank one and of rank two of each mode follows (MacKay 2003, eq. 28.10: each number that is free costs the
ratio of its range and its error), and the sizes are marginalised on a grid, weighed by what all modes say of them.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg, sparse
from scipy.special import softmax

from frf_ipz.identification.results.shapes import product_factors
from frf_ipz.identification.root_covariance import RootCovariance, pair_blocks
from frf_ipz.modes import modal_phase_collinearity
from frf_ipz.numerics.low_rank_fit import fit_products

if TYPE_CHECKING:
    from frf_ipz.arrays import ComplexArray, FloatArray
    from frf_ipz.identification.modal_fit import ModalFit

RARE = 0.02  # modes that share their frequency with another, before anything is measured
BEYOND_DOUBT = 0.99  # probability of the second mode
NOISES = np.array([1.0, 2.0, 4.0])  # times the stated deviation, where errors are larger than what is known of them
GAINS = np.array([0.0, 0.002, 0.008, 0.03, 0.12])  # by which FRFs may differ, over that: as much as is met, and nothing
REMARK = "one of two modes at this frequency: its residues have rank two"


def with_repeated_roots(fit: ModalFit) -> ModalFit:
    """Give a mode of its own to each product that the residues of a pole hold.

    Parameters
    ----------
    fit : ModalFit
        One mode a pole.

    Returns
    -------
    ModalFit
        With two modes at each pole whose residues have rank two beyond doubt; else as it was.
    """
    outputs = list(dict.fromkeys(label.output_dof.unsigned for label in fit.labels))
    inputs = list(dict.fromkeys(label.input_dof.unsigned for label in fit.labels))
    rows = np.array([outputs.index(label.output_dof.unsigned) for label in fit.labels])
    columns = np.array([inputs.index(label.input_dof.unsigned) for label in fit.labels])
    shape = len(outputs), len(inputs)
    if min(shape) < 2 or len({*zip(rows, columns, strict=True)}) != len(fit.labels) or len(rows) != np.prod(shape):
        return fit
    factors = product_factors(fit)
    products = np.zeros((fit.n_modes, *shape), complex)
    products[:, rows, columns] = fit.model.residues[: fit.n_modes] * factors
    variance = np.ones((fit.n_modes, *shape))
    variance[:, rows, columns] = np.trace(fit.residue_covariance, axis1=2, axis2=3) * np.abs(factors) ** 2
    if not products.all():  # an FRF of zeros is no measurement: it has no error, and would weigh without bounds
        return fit
    repeated = np.flatnonzero(_probability_of_rank_two(products, variance) > BEYOND_DOUBT)
    driving = [(outputs.index(dof), inputs.index(dof)) for dof in outputs if dof in inputs]
    for mode in repeated[::-1].tolist():
        two = np.stack([part[rows, columns] for part in _two_products(products[mode], driving)])
        fit = _split(fit, mode, two / factors[mode])
    return fit


def _probability_of_rank_two(products: ComplexArray, variance: FloatArray) -> FloatArray:
    """Probability of each mode to be two, (n_modes,), errors of gains and of noise being of any size that all share."""
    n_outputs, n_inputs = products.shape[1:]
    squares = np.abs(products) ** 2
    by_row, by_column = squares.sum(axis=2, keepdims=True), squares.sum(axis=1, keepdims=True)
    expected = by_row * by_column / squares.sum(axis=(1, 2), keepdims=True)
    rounding = np.finfo(float).eps ** 2 * squares.mean(axis=(1, 2), keepdims=True)
    total = np.maximum(variance, rounding) + GAINS[:, None, None, None] ** 2 * expected
    n_left = [(n_outputs - rank) * (n_inputs - rank) for rank in (1, 2)]
    log_error, log_size = np.log(total).mean(axis=(2, 3)), np.log(squares.mean(axis=(1, 2)))
    one, two = (
        -_misfits(np.broadcast_to(products, total.shape), 1 / total, rank) / NOISES[:, None, None] ** 2
        - left * (log_error + 2 * np.log(NOISES[:, None, None]))
        for rank, left in zip((1, 2), n_left, strict=True)
    )
    one, two = np.log(1 - RARE) + one, np.log(RARE) + two - (n_left[0] - n_left[1]) * log_size
    either = np.logaddexp(one, two)
    return np.asarray(np.tensordot(softmax(either.sum(axis=2)), np.exp(two - either), 2))


def _misfits(matrices: ComplexArray, weights: FloatArray, rank: int) -> FloatArray:
    """Weighted sum of squares that products leave of each matrix."""
    rows, columns = fit_products(matrices, weights, rank)
    return np.asarray(np.sum(weights * np.abs(matrices - rows @ columns.mT) ** 2, axis=(-2, -1)))


def _two_products(matrix: ComplexArray, driving: list[tuple[int, int]]) -> list[ComplexArray]:
    """Divide a matrix of rank two into two products of vectors, symmetric at the driving points where these tell."""
    at_outputs = np.linalg.svd(np.concatenate([matrix.real, matrix.imag], axis=1))[0][:, :2]
    at_inputs = matrix.T @ at_outputs
    if len(driving) > 1:
        rows, columns = (list(indices) for indices in zip(*driving, strict=True))
        weights = np.linalg.lstsq(at_outputs[rows], at_inputs[columns], rcond=None)[0]
        root = linalg.sqrtm((weights + weights.T) / 2)
    else:
        root = np.eye(2)
    at_outputs, at_inputs = at_outputs @ root, np.linalg.solve(root, at_inputs.T).T
    parts = [np.outer(at_outputs[:, number], at_inputs[:, number]) for number in range(2)]
    return [part + (matrix - sum(parts)) / 2 for part in parts]


def _split(fit: ModalFit, mode: int, residues: ComplexArray) -> ModalFit:
    """Put two modes in the place of one."""
    order = np.sort(np.append(np.arange(len(fit.model.poles)), mode))
    all_residues = fit.model.residues[order]
    all_residues[mode : mode + 2] = residues
    model = replace(fit.model, poles=fit.model.poles[order], residues=all_residues)
    modes = order[: fit.n_modes + 1]
    table = fit.modes.iloc[modes].reset_index(drop=True)
    table["pole_id"] = np.arange(1, len(table) + 1)
    table.loc[[mode, mode + 1], "mpc"] = modal_phase_collinearity(residues.T)
    remarks = table["remarks"].astype(str).tolist()
    for row in (mode, mode + 1):
        remarks[row] = "; ".join(filter(None, (remarks[row], REMARK)))
    table["remarks"] = remarks
    hz = float(table["frequency_hz"].iloc[mode])
    return replace(
        fit,
        model=model,
        n_modes=fit.n_modes + 1,
        covariance=_with_twin(fit.covariance, mode),
        residue_covariance=fit.residue_covariance[modes],
        modes=table,
        warnings=(
            *fit.warnings,
            f"two modes share the frequency {hz:.6g} Hz: their residues over sensors and excited DOFs have rank two; "
            "any two mixtures of the two shapes are as good",
        ),
    )


def _with_twin(covariance: FloatArray | RootCovariance, mode: int) -> RootCovariance:
    """Repeat a pole: two independent estimates, each of twice the variance, whose mean has what the pole had."""
    n_roots = len(covariance) // 2 if isinstance(covariance, np.ndarray) else len(covariance.common) // 2
    own = pair_blocks(covariance)[mode]
    order = np.sort(np.append(np.arange(n_roots), mode))
    rows = np.stack([2 * order, 2 * order + 1], axis=1).ravel()
    if isinstance(covariance, np.ndarray):
        common, blocks = np.zeros((2 * n_roots, 0)), sparse.csr_array(covariance)
    else:
        common, blocks = covariance.common, covariance.blocks
    twin = sparse.lil_array((len(rows), len(rows)))
    first, second = slice(2 * mode, 2 * mode + 2), slice(2 * mode + 2, 2 * mode + 4)
    twin[first, first], twin[second, second], twin[first, second], twin[second, first] = own, own, -own, -own
    return RootCovariance(common=common[rows], blocks=sparse.csr_array(blocks[rows][:, rows] + twin.tocsr()))
