"""What updating gives: the updated reduced model, its history, and its ensemble."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.display import Drawn, Tabulated
from frf_ipz.fe.response import compute_frfs
from frf_ipz.frf import FrfLabel
from frf_ipz.late_imports import import_late
from frf_ipz.numerics.rigid_motions import meet_no_force, without_force
from frf_ipz.pairing.pairs import Pairs
from frf_ipz.structure import ReducedModel
from frf_ipz.updating.expansion import ShapeExpansion
from frf_ipz.updating.scale import MeasuredScale
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    import pandas as pd
else:
    pd = import_late("pandas")

UNCERTAIN = (
    "the model is left as it was, and nothing tells how wrong it is: predictions have no band, and there are no "
    "members for robust design"
)


class UpdateStatus(Enum):
    """How an update ended; the values are the message.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> beam = frf_ipz.make_beam(
    ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=10,
    ...     left="clamped", modal_ratio=0.01,
    ... )
    >>> lines = np.arange(5, 400.0, 0.5)
    >>> tip, middle = frf_ipz.Dof(11, "z"), frf_ipz.Dof(6, "z")
    >>> labels = [frf_ipz.FrfLabel(output, tip, frf_ipz.FrfQuantity.ACCELERANCE) for output in (middle, tip)]
    >>> values = frf_ipz.compute_frfs(beam, labels, 2j * np.pi * lines)[:, :, None]
    >>> frfs = frf_ipz.FrfSet.from_arrays(
    ...     lines, values, outputs=[middle, tip], inputs=[tip], variance=np.full(values.shape, 1e-4)
    ... )
    >>> fit = frf_ipz.fit_modes(frfs)
    >>> reduced_model = frf_ipz.reduce_model(fit, beam, points=["9:+z"])
    >>> updated_model = frf_ipz.update_model(fit, reduced_model)
    >>> updated_model.status is frf_ipz.UpdateStatus.CONVERGED
    True
    """

    CONVERGED = "converged"
    MAX_ITERATIONS = "stopped at the largest number of iterations: allow more, or look at the pairs"
    NOTHING_TO_DO = "there is no target in the band: the model is unchanged"
    DIVERGED = "the misfit grew: a smaller step or other pairs may help"
    NO_BETTER = "it made the agreement with the measured FRFs worse: the model is as it was before"


@dataclass(frozen=True, slots=True, weakref_slot=True, kw_only=True, eq=False)
class UpdatedModel(Tabulated, Drawn):
    """A reduced model after updating.

    Parameters
    ----------
    model : ReducedModel
        With the updated matrices.
    nominal : ReducedModel
        The model before updating.
    method : str
        Name of the method.
    status : UpdateStatus
        How it ended.
    history : DataFrame
        One row an iteration: ``phase`` (stiffness or damping), ``iteration``, ``misfit``, ``step``, and the parameters.
    before, after : (n_targets,) complex array
        Poles and zeros of the model before and after, in the order of `Pairs.targets`, rad/s.
    ensemble : (n_members, 3, r, r) array
        Mass, damping and stiffness of models drawn from the posterior; empty for a method without one.
    unmet : tuple of str
        Targets that cannot be met, and why.
    warnings : tuple of str
        What the user has to know.
    parts : DataFrame
        Change of the stiffness of every part of the FE model, as `along_structure.change_along_structure` gives it;
        empty where the method has not changed parts.
    masses : DataFrame
        Masses at nodes that the nominal model lacks, or has too much of, as `local_masses.find_local_masses` gives
        them; empty where none is sure.
    scale, nominal_scale : MeasuredScale
        Gains of the measured FRFs over the updated and the nominal model, where the test does not know its scale;
        else gains of 1 whose draws carry the doubt of the model's mass.
    pairs : Pairs, optional
        The targets, where pairing with the model after a first update has changed them: named by the roots of the
        model before it.
    expansion : ShapeExpansion, optional
        What is known of it where `model` holds the measured modes, with their shapes expanded over the nominal model,
        as no change of its matrices meets the measurement.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> beam = frf_ipz.make_beam(
    ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=10,
    ...     left="clamped", modal_ratio=0.01,
    ... )
    >>> lines = np.arange(5, 400.0, 0.5)
    >>> tip, middle = frf_ipz.Dof(11, "z"), frf_ipz.Dof(6, "z")
    >>> labels = [frf_ipz.FrfLabel(output, tip, frf_ipz.FrfQuantity.ACCELERANCE) for output in (middle, tip)]
    >>> values = frf_ipz.compute_frfs(beam, labels, 2j * np.pi * lines)[:, :, None]
    >>> frfs = frf_ipz.FrfSet.from_arrays(
    ...     lines, values, outputs=[middle, tip], inputs=[tip], variance=np.full(values.shape, 1e-4)
    ... )
    >>> fit = frf_ipz.fit_modes(frfs)
    >>> reduced_model = frf_ipz.reduce_model(fit, beam, points=["9:+z"])
    >>> updated_model = frf_ipz.update_model(fit, reduced_model)
    >>> updated_model
    UpdatedModel: minimal-change, converged, 6 targets, 2 iterations, 6 DOFs
    >>> updated_model.ensemble.shape
    (200, 3, 6, 6)
    """

    model: ReducedModel
    nominal: ReducedModel
    method: str
    status: UpdateStatus
    history: pd.DataFrame
    before: ComplexArray
    after: ComplexArray
    ensemble: FloatArray
    unmet: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    parts: pd.DataFrame = field(default_factory=lambda: pd.DataFrame())
    masses: pd.DataFrame = field(default_factory=lambda: pd.DataFrame())
    scale: MeasuredScale = field(default_factory=MeasuredScale)
    nominal_scale: MeasuredScale = field(default_factory=MeasuredScale)
    pairs: Pairs | None = None
    expansion: ShapeExpansion | None = None

    def __repr__(self) -> str:
        counts = f"{len(self.after)} targets, {len(self.history)} iterations"
        return f"UpdatedModel: {self.method}, {self.status.value}, {counts}, {counted(len(self.model.dofs), 'DOF')}"

    def compute_frfs(self, labels: tuple[FrfLabel, ...], s: ComplexArray, *, nominal: bool = False) -> ComplexArray:
        """Compute FRFs in the unit of the measurement: those of the model times the gains over it.

        Parameters
        ----------
        labels : tuple of FrfLabel
            Which FRFs.
        s : (n_lines,) complex array
            Where, rad/s.
        nominal : bool
            Of the model before updating.

        Returns
        -------
        (n_lines, n_frfs) array
            Complex.
        """
        model, scale = (self.nominal, self.nominal_scale) if nominal else (self.model, self.scale)
        return np.asarray(compute_frfs(model, labels, s) * scale.gains(labels))


def nothing_to_do(model: ReducedModel, method: str) -> UpdatedModel:
    """Give the result of an update without targets.

    Parameters
    ----------
    model : ReducedModel
        The nominal model.
    method : str
        Name of the method.

    Returns
    -------
    UpdatedModel
        The nominal model.
    """
    order = len(model.dofs)
    no_roots = np.zeros(0, complex)
    return UpdatedModel(
        model=model,
        nominal=model,
        method=method,
        status=UpdateStatus.NOTHING_TO_DO,
        history=pd.DataFrame({"phase": [], "iteration": [], "misfit": [], "step": []}),
        before=no_roots,
        after=no_roots,
        ensemble=np.zeros((0, 3, order, order)),
        warnings=(UNCERTAIN,),
    )


def with_free_rigid_bodies(updated: UpdatedModel) -> UpdatedModel:
    """Take the rounding of an update off the rigid-body modes: what met no force before meets none now.

    Parameters
    ----------
    updated : UpdatedModel
        The result of a method, which may change everything but what holds the structure.

    Returns
    -------
    UpdatedModel
        With the same elastic modes.
    """
    nominal = updated.nominal
    if not nominal.rigid.size or updated.model is nominal:
        return updated
    model = updated.model
    mass, damping, stiffness = free_matrices(nominal, model.mass, model.damping, model.stiffness)
    return replace(
        updated,
        model=replace(model, mass=mass, damping=damping, stiffness=stiffness),
        ensemble=np.array([free_matrices(nominal, *member) for member in updated.ensemble]).reshape(
            updated.ensemble.shape
        ),
    )


def free_matrices(
    nominal: ReducedModel, mass: FloatArray, damping: FloatArray, stiffness: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Let the rigid-body modes that met no force before an update meet none after it.

    Parameters
    ----------
    nominal : ReducedModel
        Before the update.
    mass, damping, stiffness : (r, r) array
        After it.

    Returns
    -------
    tuple of (r, r) arrays
        The same but for rounding.
    """
    if not nominal.rigid.size:
        return mass, damping, stiffness
    unstrained, undamped = (
        nominal.rigid[:, meet_no_force(matrix, nominal.rigid)] for matrix in (nominal.stiffness, nominal.damping)
    )
    return mass, without_force(damping, mass, undamped), without_force(stiffness, mass, unstrained)
