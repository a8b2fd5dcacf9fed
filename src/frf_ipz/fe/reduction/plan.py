"""Requirements of a reduction, from the test and from the options."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.dofs import AnyDof, parse_label
from frf_ipz.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.fe.reduction.options import ReduceOptions
    from frf_ipz.structure import StructuralModel


MAX_DAMPED = 12  # DOFs with dampers: more are damping of the structure, not single dampers


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReductionPlan:
    """Required DOFs, and what the user has fixed; all DOFs are unsigned and free in the model.

    Parameters
    ----------
    required : tuple of Dof
        Actuators, sensors and points of interest, each once.
    residual : tuple of Dof
        DOFs whose residual flexibility joins the basis.
    residual_is_given : bool
        True where the user named them.
    dofs : tuple of Dof
        DOFs to retain; empty where the program chooses them.
    modes : int, optional
        Number of modes, where the user gives it.
    """

    required: tuple[AnyDof, ...]
    residual: tuple[AnyDof, ...]
    residual_is_given: bool
    dofs: tuple[AnyDof, ...]
    modes: int | None


def plan_reduction(
    model: StructuralModel,
    options: ReduceOptions,
    *,
    actuators: Sequence[AnyDof],
    sensors: Sequence[AnyDof],
    points: Sequence[AnyDof],
) -> ReductionPlan:
    """Combine test and options, and check that they fit the model and each other.

    Parameters
    ----------
    model : StructuralModel
        The FE model.
    options : ReduceOptions
        What the user has fixed.
    actuators, sensors, points : sequence of Dof
        DOFs of the test and points of interest; signs are ignored.

    Returns
    -------
    ReductionPlan
        Required DOFs, residual vectors and modes.

    Raises
    ------
    InputError
        If the model lacks a DOF or holds it, one is named twice, or the numbers do not fit.
    """
    excited, observed = unsigned(actuators), unsigned([*sensors, *points])
    named = options.residual_flexibility
    fewer = min((side for side in (excited, observed) if side), key=len, default=())
    plan = ReductionPlan(
        required=unsigned([*actuators, *sensors, *points]),
        residual=_parse_dofs(named, "residual_flexibility")
        if named is not None
        else unsigned([*fewer, *_damped_dofs(model)]),
        residual_is_given=named is not None,
        dofs=_parse_dofs(options.dofs, "dofs"),
        modes=options.modes,
    )
    model.rows((*plan.required, *plan.residual, *plan.dofs))
    _require_counts(plan, model)
    return plan


def _damped_dofs(model: StructuralModel) -> tuple[AnyDof, ...]:
    """DOFs on which dampers act: their forces bend the shapes in a way that undamped modes alone do not follow."""
    damped = np.flatnonzero(model.damping.diagonal())
    return tuple(model.dofs[row] for row in damped.tolist()) if len(damped) <= MAX_DAMPED else ()


def unsigned(dofs: Sequence[AnyDof]) -> tuple[AnyDof, ...]:
    """List each DOF once, in the positive direction.

    Parameters
    ----------
    dofs : sequence of Dof
        DOFs with signs.

    Returns
    -------
    tuple of Dof
        In the order of their first appearance.
    """
    return tuple(dict.fromkeys(dof.unsigned for dof in dofs))


def _parse_dofs(labels: Sequence[str], key: str) -> tuple[AnyDof, ...]:
    dofs = tuple(parse_label(label).unsigned for label in labels)
    for index, dof in enumerate(dofs):
        if dof in dofs[:index]:
            raise InputError(f"[reduce] {key} names the DOF {dof.name} twice; name it once")
    return dofs


def _require_counts(plan: ReductionPlan, model: StructuralModel) -> None:
    order = model.n_modes
    if plan.modes is not None and plan.modes > order:
        raise InputError(f"[reduce] modes is {plan.modes}; the model '{model.name}' has {order} free DOFs")
    if not plan.dofs:
        return
    if plan.modes is not None and plan.residual_is_given and len(plan.dofs) != plan.modes + len(plan.residual):
        raise InputError(
            f"[reduce] dofs names {len(plan.dofs)} DOFs, but {plan.modes} modes and {len(plan.residual)} residual "
            f"vectors need {plan.modes + len(plan.residual)}; change one of the three, or omit dofs"
        )
    if len(plan.dofs) <= len(plan.residual):
        raise InputError(
            f"[reduce] dofs names {len(plan.dofs)} DOFs: no mode remains beside {len(plan.residual)} residual vectors; "
            "name more, or omit dofs"
        )
