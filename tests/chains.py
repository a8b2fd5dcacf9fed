"""Chains of masses as reduced models: small, and every number can be checked by hand."""

import numpy as np
import pandas as pd

from frf_ipz.dofs import Dof
from frf_ipz.frf import FrfLabel
from frf_ipz.quantities import FrfQuantity
from frf_ipz.structure import ReducedModel
from frf_ipz.updating.updated_model import UpdatedModel, UpdateStatus


def chain(order=5, *, stiffness=None, damping=0.01, free=False, seed=0, between=False):
    """Masses in a row, the first on the ground unless free; `damping` in parts of the stiffness over its frequency.

    With `between` the model also knows node 99, half way between the first two masses.
    """
    rng = np.random.default_rng(seed)
    springs = rng.uniform(0.5, 2.0, order) * 1e5 if stiffness is None else np.asarray(stiffness, float)
    if free:
        springs[0] = 0.0
    K = np.diag(springs) + np.diag(np.append(springs[1:], 0.0))
    K -= np.diag(springs[1:], 1) + np.diag(springs[1:], -1)
    mass = np.diag(rng.uniform(0.5, 2.0, order)) + 0.1 * (np.eye(order, k=1) + np.eye(order, k=-1))
    dofs = tuple(Dof(node, "x") for node in range(1, order + 1))
    expansion, expanded = np.eye(order), dofs
    if between:
        expansion = np.vstack([expansion, np.r_[0.5, 0.5, np.zeros(order - 2)]])
        expanded = (*dofs, Dof(99, "x"))
    return ReducedModel(
        mass=mass,
        damping=damping / 300.0 * K,
        stiffness=K,
        dofs=dofs,
        expansion=expansion,
        expanded_dofs=expanded,
        n_modes=order,
    )


def label(output, blow, quantity=FrfQuantity.RECEPTANCE, **channels):
    """An FRF between two nodes; a negative number turns the sign."""
    ends = [Dof(abs(node), "x", 1 if node > 0 else -1) for node in (output, blow)]
    return FrfLabel(*ends, quantity, **channels)


def random_matrices(rng, order, *, symmetric=True):
    """Mass, damping and stiffness without any pattern; stable where they are symmetric."""

    def definite(scale):
        root = rng.standard_normal((order, order))
        return scale * (root @ root.T / order + np.eye(order))

    matrices = definite(1.0), definite(0.3), definite(50.0)
    if symmetric:
        return matrices
    return tuple(matrix + 0.02 * np.linalg.norm(matrix) * rng.standard_normal((order, order)) for matrix in matrices)


def updated(model, ensemble=()):
    """The model as if an update had left it as it is, with members of a posterior."""
    order = len(model.dofs)
    return UpdatedModel(
        model=model,
        nominal=model,
        method="test",
        status=UpdateStatus.CONVERGED,
        history=pd.DataFrame(),
        before=np.zeros(0, complex),
        after=np.zeros(0, complex),
        ensemble=np.array(ensemble).reshape(-1, 3, order, order),
    )
