"""Rigid-body modes of a free model, as the suspension of a test has them.

A free structure hangs on soft springs when it is tested: what the model has at 0 Hz is measured at a few hertz. Such a
mode is a rigid-body motion, so the six of the model tell its shape at every point, and what is measured of it is six
numbers at most: its share in each. The mass of the model is what those shares are held to, where FRFs leave them open.
Elastic motion takes part in proportion to the squared ratio of its frequency to that of the first elastic mode. The
prediction, of FRFs as they would be measured, has these modes in the place of those at 0 Hz; the updated model stays
free.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.identification.modal_fit import ModalFit
from frf_ipz.late_imports import import_late
from frf_ipz.numerics.pencils import modes_of_stack
from frf_ipz.pairing.poles import measured_amplitudes
from frf_ipz.rational import natural_frequency_hz
from frf_ipz.updating.updated_model import UpdatedModel

if TYPE_CHECKING:
    from collections.abc import Callable

    from scipy import optimize

    from frf_ipz.frf import Measured
else:
    optimize = import_late("scipy.optimize")

SEED = 0  # of the draws: the same bands from the same inputs
MASS_STD = 0.1  # relative, of the inertia of a model: it only counts where FRFs leave a shape open
LINES = 200  # below the first elastic mode, at equal ratios
ROUNDING = 1e-6  # of the largest rigid-body motion of a measured point: a motion that none shows


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Suspension:
    """Measured modes of a structure that moves as a rigid body.

    Parameters
    ----------
    poles : (n,) complex array
        rad/s.
    shares : (n_rigid, n) array
        Of the rigid-body modes in each, mass-normalised as measured.
    drawn_poles : (m, n_seen) complex array
        One a member of the ensemble, for all motions that measured points show: modes that were not found follow.
    drawn_shares : (m, n_rigid, n_seen) array
        The same.
    """

    poles: ComplexArray
    shares: FloatArray
    drawn_poles: ComplexArray
    drawn_shares: FloatArray

    @property
    def statement(self) -> str:
        """What the prediction has in the place of modes at 0 Hz, for people."""
        listed = ", ".join(f"{hertz:.4g}" for hertz in natural_frequency_hz(self.poles))
        return (
            f"what was measured at {listed} Hz is the structure as a rigid body on its suspension: the prediction has "
            "it as measured, the updated model is free"
        )


def find_suspension(measured: Measured, updated: UpdatedModel) -> Suspension | None:
    """Find measured modes that are those of a rigid body on springs.

    Parameters
    ----------
    measured : ModalFit or FrfSet
        What was measured.
    updated : UpdatedModel
        The updated model.

    Returns
    -------
    Suspension or None
        None where the model is not free, where no mode lies below its elastic ones, and where FRFs follow better
        without.
    """
    model = updated.model
    if (
        not isinstance(measured, ModalFit)
        or not measured.labels
        or not model.rigid.size
        or updated.expansion is not None
    ):
        return None
    squares, _ = modes_of_stack(model.mass[None], model.stiffness[None])
    elastic = squares[0, model.rigid.shape[1] :]
    poles = measured.model.poles[: measured.n_modes]
    lowest = np.sqrt(max(float(elastic[0]), 0.0)) if len(elastic) else np.inf
    modes = np.flatnonzero(np.abs(poles) < lowest)
    rigid = _normalised(model.rigid, model.mass)
    outputs, inputs = (
        np.array([model.row(dof) for dof in dofs]) @ rigid
        for dofs in (
            [label.output_dof for label in measured.labels],
            [label.input_dof for label in measured.labels],
        )
    )
    _, sizes, motions = np.linalg.svd(np.vstack([outputs, inputs]), full_matrices=False)
    seen = motions[sizes > ROUNDING * sizes[0]].T
    low = max(measured.band_hz[0], float(measured.frequency_hz[measured.frequency_hz > 0][0]))
    s = 2j * np.pi * np.geomspace(low, max(lowest / 2 / np.pi, low), LINES)
    best, least = None, _misfit(measured, updated, s)
    for count in range(1, 1 + min(len(modes), seen.shape[1])):  # an elastic mode may lie just below that of the model
        shares, root = _fit_shares(measured, updated, modes[:count], (outputs @ seen, inputs @ seen), lowest)
        rng = np.random.default_rng(SEED)
        deviations = rng.standard_normal((len(updated.ensemble), len(root))) @ root.T
        drawn_poles = poles[modes[:count]] + _pole_errors(measured, modes[:count], len(updated.ensemble), rng)
        drawn_shares = shares + deviations.reshape(-1, *shares.shape)
        # what hangs hangs in all directions: a mode that was not found may lie anywhere below the lines
        others = np.linalg.svd(shares)[0][:, count:] + np.zeros((len(drawn_shares), 1, 1))
        below = 2j * np.pi * low * rng.random((len(drawn_shares), others.shape[2]))
        suspension = Suspension(
            poles=poles[modes[:count]],
            shares=seen @ shares,
            drawn_poles=np.hstack([drawn_poles, below]),
            drawn_shares=seen @ np.dstack([drawn_shares, others]),
        )
        misfit = _misfit(measured, on_suspension(updated, suspension), s)
        if misfit < least:
            best, least = suspension, misfit
    return best


def on_suspension(updated: UpdatedModel, suspension: Suspension) -> UpdatedModel:
    """Put measured modes of a rigid body in the place of those at 0 Hz.

    Parameters
    ----------
    updated : UpdatedModel
        The updated model, free.
    suspension : Suspension
        Measured modes.

    Returns
    -------
    UpdatedModel
        Its model and its ensemble hang; its elastic modes are as they were.
    """
    model = updated.model
    rigid = _normalised(model.rigid, model.mass)
    mass, damping, stiffness = _hung(
        (model.mass, model.damping, model.stiffness), rigid, rigid @ suspension.shares, suspension.poles
    )
    members = [
        np.stack(_hung(tuple(member), rigid, rigid @ shares, poles))
        for member, shares, poles in zip(updated.ensemble, suspension.drawn_shares, suspension.drawn_poles, strict=True)
    ]
    left, _, _ = np.linalg.svd(suspension.shares)
    free = rigid @ left[:, len(suspension.poles) :]
    return replace(
        updated,
        model=replace(
            model, mass=mass, damping=damping, stiffness=stiffness, rigid=free if free.size else np.zeros((0, 0))
        ),
        ensemble=np.array(members).reshape(updated.ensemble.shape),
    )


def _normalised(rigid: FloatArray, mass: FloatArray) -> FloatArray:
    """Mass-normalise rigid-body motions."""
    lower = np.linalg.cholesky(rigid.T @ mass @ rigid)
    return np.asarray(np.linalg.solve(lower, rigid.T).T)


def _hung(
    matrices: tuple[FloatArray, ...], rigid: FloatArray, shapes: FloatArray, poles: ComplexArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mass, damping and stiffness with `shapes`, which rigid-body motions make up, as modes with these poles.

    Rigid-body motions that are orthogonal to them stay as they are.
    """
    mass, damping, stiffness = matrices
    own = _normalised(rigid, mass)
    shares = own.T @ mass @ shapes
    left, _, _ = np.linalg.svd(shares)
    inverse = np.linalg.inv(np.hstack([shares, left[:, shares.shape[1] :]])) @ own.T @ mass
    unit = np.ones(len(inverse))
    rates, squares = np.zeros((2, len(inverse)))
    rates[: len(poles)], squares[: len(poles)] = -2 * poles.real, np.abs(poles) ** 2
    forces = own.T @ mass
    return (
        mass + (inverse.T * unit) @ inverse - forces.T @ forces,
        damping + (inverse.T * rates) @ inverse,
        stiffness + (inverse.T * squares) @ inverse,
    )


def _fit_shares(
    fit: ModalFit, updated: UpdatedModel, modes: np.ndarray, ends: tuple[FloatArray, FloatArray], lowest: float
) -> tuple[FloatArray, FloatArray]:
    """Shares of the rigid-body motions that are seen in each mode, (n_seen, n), and a root of their covariance."""
    outputs, inputs = ends
    gains = updated.scale.gains(fit.labels) if updated.scale.is_relative else fit.gain
    amplitudes, noise = (values[modes] / np.abs(gains) for values in measured_amplitudes(fit))
    amplitudes = amplitudes.real * np.sign(gains.real)
    size = np.sqrt(np.mean(amplitudes**2, axis=1, keepdims=True))
    elastic = (np.abs(fit.model.poles[modes])[:, None] / lowest) ** 2
    error = np.hypot(noise, elastic * size)
    shape = outputs.shape[1], len(modes)
    above = np.triu_indices(len(modes))

    def residuals(unknowns: FloatArray) -> FloatArray:
        shares = unknowns.reshape(shape)
        missed = (amplitudes - ((outputs @ shares) * (inputs @ shares)).T) / error
        inertia = (shares.T @ shares - np.eye(len(modes))) / MASS_STD
        return np.concatenate([missed.ravel(), inertia[above]])

    found = min(
        (_least(residuals, start) for start in _starts(amplitudes, outputs, inputs)), key=lambda optimum: optimum.cost
    )
    values, vectors = np.linalg.eigh(found.jac.T @ found.jac)
    variance = max(2 * found.cost / max(len(found.fun) - len(found.x), 1), 1.0)
    tiny = np.finfo(float).eps * values.max()
    return found.x.reshape(shape), vectors * np.sqrt(variance / np.maximum(values, tiny))


def _least(residuals: Callable[[FloatArray], FloatArray], start: FloatArray) -> optimize.OptimizeResult:
    return optimize.least_squares(residuals, start.ravel(), method="trf")


def _starts(amplitudes: FloatArray, outputs: FloatArray, inputs: FloatArray) -> list[FloatArray]:
    """Shares to start from: the leading vectors of the symmetric matrices that suit each mode best, of either order."""
    rows, columns = np.triu_indices(outputs.shape[1])
    design = outputs[:, rows] * inputs[:, columns] + outputs[:, columns] * inputs[:, rows]
    vectors = []
    for amplitude in amplitudes:
        products = np.zeros((outputs.shape[1],) * 2)
        products[rows, columns] = np.linalg.lstsq(design, amplitude, rcond=None)[0]
        products = products + products.T
        values, shapes = np.linalg.eigh(products)
        vectors.append(shapes[:, -1] * np.sqrt(max(values[-1], 1e-3)))
    orthogonal, _ = np.linalg.qr(np.stack(vectors, axis=1))
    return [np.stack(vectors, axis=1), np.asarray(orthogonal)]


def _pole_errors(fit: ModalFit, modes: np.ndarray, count: int, rng: np.random.Generator) -> ComplexArray:
    """Errors of the poles, (count, n), rad/s."""
    variances = fit.covariance.diagonal()[: 2 * fit.n_modes].reshape(-1, 2)[modes]
    normal = rng.standard_normal((count, len(modes), 2)) * np.sqrt(variances)
    return np.asarray(normal @ np.array([1.0, 1.0j]))


def _misfit(fit: ModalFit, updated: UpdatedModel, s: ComplexArray) -> float:
    """Sum of the squared differences of logarithms of magnitudes, beside a factor that all FRFs share."""
    computed, measured = np.abs(updated.compute_frfs(fit.labels, s)), np.abs(fit.model(s))
    tiny = np.finfo(float).tiny
    difference = np.log(np.maximum(computed, tiny) / np.maximum(measured, tiny))
    return float(np.sum((difference - np.median(difference)) ** 2))
