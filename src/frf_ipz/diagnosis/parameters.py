"""The parameters of what was found, for an update that changes these and nothing else."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from frf_ipz.arguments import require_type
from frf_ipz.diagnosis.apply import prepare_correction
from frf_ipz.diagnosis.result import Diagnosis
from frf_ipz.errors import InputError
from frf_ipz.fe.assembly import multiply
from frf_ipz.fe.eigen import stated_damping_ratios
from frf_ipz.numerics.one_thread import on_one_thread
from frf_ipz.numerics.pencils import undamped_poles
from frf_ipz.structure import ReducedModel, StructuralModel
from frf_ipz.updating.parameters import ParameterBasis, PriorTerm
from frf_ipz.updating.regions import motion_of_all_dofs

if TYPE_CHECKING:
    from collections.abc import Mapping

    from frf_ipz.arrays import FloatArray
    from frf_ipz.diagnosis.catalogue.effect import Effect
    from frf_ipz.diagnosis.result import Finding

STEP = 1e-4  # of a value, for the difference of two models: matrices are nearly linear in it
PRIOR = 0.1  # standard deviation of a value, relative: an update refines a diagnosis, and does not begin anew


@on_one_thread
def make_diagnosed_basis(
    diagnosis: Diagnosis,
    fe_model: StructuralModel,
    reduced_model: ReducedModel,
    *,
    effects: Mapping[str, Effect] | None = None,
) -> ParameterBasis:
    """Take the parameters of a diagnosis as those of an update.

    Parameters
    ----------
    diagnosis : Diagnosis
        What the FE model lacks.
    fe_model : StructuralModel
        The model that was diagnosed.
    reduced_model : ReducedModel
        Of the model with what it lacked, as `correct_model` gives it.
    effects : mapping of str to Effect, optional
        Those that were searched for; the shipped ones where it is left out.

    Returns
    -------
    ParameterBasis
        Relative changes of the values that were found, with matrices about these values.

    Raises
    ------
    InputError
        If no finding is in the structure.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> stiffness = 1e5 * np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    >>> dofs = ["1:x", "2:x", "3:x"]
    >>> masses = np.diag([2.0, 1.0, 1.0])
    >>> model = frf_ipz.StructuralModel.from_matrices(masses, stiffness, dofs=dofs, modal_damping=0.01)
    >>> heavier = frf_ipz.StructuralModel.from_matrices(
    ...     masses + np.diag([0.0, 0.0, 0.2]), stiffness, dofs=dofs, modal_damping=0.01
    ... )
    >>> lines = np.arange(5, 100.0, 0.5)
    >>> first, accelerance = frf_ipz.Dof(1, "x"), frf_ipz.FrfQuantity.ACCELERANCE
    >>> labels = [frf_ipz.FrfLabel(frf_ipz.parse_dof(dof), first, accelerance) for dof in dofs]
    >>> values = frf_ipz.compute_frfs(heavier, labels, 2j * np.pi * lines)[:, :, None]
    >>> frfs = frf_ipz.FrfSet.from_arrays(
    ...     lines, values, outputs=dofs, inputs=["1:x"], variance=np.full(values.shape, 2e-6)
    ... )
    >>> options = frf_ipz.DiagnoseOptions(effects=("added_mass",))
    >>> diagnosis = frf_ipz.diagnose(frfs, model, options=options)
    >>> corrected = frf_ipz.correct_model(diagnosis, model)
    >>> reduced_model = frf_ipz.reduce_model(frfs, corrected)
    >>> frf_ipz.make_diagnosed_basis(diagnosis, model, reduced_model).names
    ('added_mass mass_kg',)
    """
    require_type("diagnosis", diagnosis, Diagnosis)
    require_type("fe_model", fe_model, StructuralModel)
    require_type("reduced_model", reduced_model, ReducedModel)
    moving, corrected = [], prepare_correction(diagnosis, fe_model, effects)
    for number, finding in enumerate(diagnosis.findings):
        for index, name in enumerate(_value_names(finding)):
            low, high = (corrected(_scaled_values(diagnosis, number, index, factor)) for factor in (1 - STEP, 1 + STEP))
            slope = _reduce_difference(low, high, reduced_model) / (2 * STEP)
            if np.abs(slope).max() > 0:
                moving.append((f"{finding.effect} {name}", slope))
    if not moving:
        raise InputError(
            "the diagnosis found nothing in the structure that an update could change; leave out [update] parameters"
        )
    slopes = np.array([slope for _, slope in moving])
    return ParameterBasis(
        names=tuple(name for name, _ in moving),
        mass=slopes[:, 0],
        damping=slopes[:, 1],
        stiffness=slopes[:, 2],
        logarithmic=np.zeros(len(moving), bool),
        terms=(PriorTerm(name="what was found", root=np.eye(len(moving)), std=PRIOR),),
        is_from_diagnosis=True,
    )


def _value_names(finding: Finding) -> list[str]:
    """Names of the values; of one that the contract does not name, its number."""
    named = [name for name, value in finding.parameters.items() if not isinstance(value, str)]
    return named if len(named) == len(finding.values) else [str(number + 1) for number in range(len(finding.values))]


def _scaled_values(diagnosis: Diagnosis, number: int, index: int, factor: float) -> list[list[float]]:
    """Values of all findings, one of them times a factor."""
    values = [list(finding.values) for finding in diagnosis.findings]
    values[number][index] *= factor
    return values


def _reduce_difference(low: StructuralModel, high: StructuralModel, reduced: ReducedModel) -> FloatArray:
    """Difference of mass, damping and stiffness of two models in the coordinates of the reduced one, (3, r, r)."""
    motion, _ = motion_of_all_dofs(low, reduced)
    mass, viscous, stiffness = (
        motion.T @ multiply(sparse.csr_array(above - below), motion)
        for above, below in (
            (high.mass_all, low.mass_all),
            (high.damping_all, low.damping_all),
            (high.stiffness_all, low.stiffness_all),
        )
    )
    return np.array(
        [mass, viscous + _modal_damping_matrix(high, reduced) - _modal_damping_matrix(low, reduced), stiffness]
    )


def _modal_damping_matrix(model: StructuralModel, reduced: ReducedModel) -> FloatArray:
    """Damping matrix of a model's modal damping ratios, N s/m."""
    poles = undamped_poles(reduced.mass, reduced.stiffness)
    squares = np.maximum(poles.values.real, 0.0)
    ratios = stated_damping_ratios(model.modal_damping, len(squares), reduced.rigid.shape[1])
    omega = np.sqrt(squares)
    shapes = reduced.mass @ poles.right_vectors.real
    return np.asarray((shapes * (2 * ratios * omega)) @ shapes.T)
