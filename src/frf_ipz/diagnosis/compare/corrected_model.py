"""A model corrected by its measurement: the nuisance that was fitted within tolerances, put into the matrices.

Errors of mass and stiffness act on the modes of the band. With their shapes Phi and with 1 + mu and Lambda + kappa for
mass and stiffness there, ``M + (M Phi) mu (M Phi)^T`` and ``K + (M Phi) kappa (M Phi)^T`` have exactly the fitted
modes, and every other mode as before.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg, sparse

from frf_ipz.fe.assembly import multiply

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray, Matrix
    from frf_ipz.diagnosis.evidence.hypothesis import Hypothesis
    from frf_ipz.diagnosis.model.modes import Modes
    from frf_ipz.structure import StructuralModel

MIN_SQUARE = 0.01  # of the model's: a mode below the band follows lines above it, but stays stable


def correct_model(hypothesis: Hypothesis, nuisance: FloatArray) -> StructuralModel:
    """Put what was fitted within tolerances into a model.

    Parameters
    ----------
    hypothesis : Hypothesis
        Nothing is missing: no components.
    nuisance : (n_nuisance,) array
        What was fitted, in standard deviations. Scatter of stiffness, mass and damping is used; positions, gains and
        suspension belong to the test.

    Returns
    -------
    StructuralModel
        With the fitted modes; one below the band whose stiffness would be negative gets little of it.
    """
    values = nuisance.copy()
    values[hypothesis.nuisance_prior.blocks.suspension] = 0.0
    modes = hypothesis.modes(np.zeros(0), values)
    model, m = hypothesis.context.model, hypothesis.nuisance_prior.n_modes
    plain = modes.vectors[:, :m] @ linalg.inv(modes.rotation)
    momentum = multiply(model.mass_all, hypothesis.basis.vectors @ plain)
    momentum[model.fixed] = 0.0  # a compliant support keeps its mass
    inverse = linalg.inv(modes.rotation)
    mass = inverse.T @ inverse - np.eye(m)
    squares = np.maximum(modes.squares[:m], MIN_SQUARE * modes.omega[:m] ** 2)
    stiffness = inverse.T @ np.diag(squares) @ inverse - np.diag(modes.omega[:m] ** 2)
    return replace(
        model,
        mass_all=_add_block(model.mass_all, momentum, mass),
        stiffness_all=_add_block(model.stiffness_all, momentum, stiffness),
        modal_damping=_damping(model, modes, hypothesis.nuisance_prior.n_rigid, m),
    )


def _add_block(matrix: Matrix, momentum: FloatArray, block: FloatArray) -> Matrix:
    added = momentum @ ((block + block.T) / 2) @ momentum.T
    return sparse.csr_array(matrix + sparse.csr_array((added + added.T) / 2))


def _damping(model: StructuralModel, modes: Modes, n_rigid: int, m: int) -> FloatArray:
    """Fitted ratios of elastic modes; beyond them what the model states."""
    if not model.modal_damping.size:
        return model.modal_damping
    return np.concatenate([modes.ratio[n_rigid:m], modes.stated_ratio[m : m + 1]])
