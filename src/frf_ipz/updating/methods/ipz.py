"""``ipz``: the Iterative Pole-Zero update as published by [Dorosti2018], for reference.

Eigenvalues of the stiffness matrix and of its substructures are changed until poles and zeros meet their targets; then
those of the damping matrices. With one FRF this is section 3.1 of the paper, apart from the minus sign and the left
vectors that eqs. (21) to (26) lack; with several, every iteration makes the step of each FRF in turn. Parameters from a
diagnosis replace the eigenvalues.

[Dorosti2018] M. Dorosti, R. H. B. Fey, M. F. Heertjes, H. Nijmeijer, Iterative Pole-Zero model updating: A combined
sensitivity approach, Control Engineering Practice 71, 2018, 164-174, doi:10.1016/j.conengprac.2017.11.002.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.errors import InputError
from frf_ipz.late_imports import import_late
from frf_ipz.updating.ipz.chosen_parameters import iterate_parameters
from frf_ipz.updating.ipz.loop import LoopResult, published_loop
from frf_ipz.updating.ipz.step import PublishedStep, StepSettings
from frf_ipz.updating.updated_model import UpdatedModel, UpdateStatus, nothing_to_do

if TYPE_CHECKING:
    import pandas as pd

    from frf_ipz.progress import Progress
    from frf_ipz.structure import ReducedModel
    from frf_ipz.updating.options import UpdateOptions
    from frf_ipz.updating.parameters import ParameterBasis
    from frf_ipz.updating.problem import UpdateProblem
else:
    pd = import_late("pandas")

MAX_ITERATIONS = 50_000


def update(problem: UpdateProblem, options: UpdateOptions, progress: Progress) -> UpdatedModel:
    """Update a model by the published iteration.

    Parameters
    ----------
    problem : UpdateProblem
        Model, targets, parameters.
    options : UpdateOptions
        Options of the user.
    progress : Progress
        Reports how far the work is.

    Returns
    -------
    UpdatedModel
        Without an ensemble: the method has no posterior.

    Raises
    ------
    InputError
        If no FRF with targets has its sensor and its excited DOF among the retained ones.
    NumericalError
        If the model shows fewer poles or zeros than are to be updated.
    """
    if not len(problem.values):
        return nothing_to_do(problem.model, "ipz")
    if problem.basis is not None and problem.basis.is_from_diagnosis:
        return _update_chosen_parameters(problem, problem.basis, options)
    model, frfs, unused = problem.model, *_usable_frfs(problem)
    result = _phase(problem, model, frfs, options, progress, damping=False)
    model = replace(model, stiffness=result.matrix)
    phases = [("stiffness", result)]
    if options.damping and result.status is not UpdateStatus.DIVERGED:
        result = _phase(problem, model, frfs, options, progress, damping=True)
        model = replace(model, damping=result.matrix)
        phases.append(("damping", result))
    history = pd.concat([result.history.assign(phase=name) for name, result in phases], ignore_index=True)
    worst = max((result.status for _, result in phases), key=list(UpdateStatus).index)
    return _updated(problem, model, worst, history, unused)


def _phase(
    problem: UpdateProblem,
    model: ReducedModel,
    frfs: tuple[int, ...],
    options: UpdateOptions,
    progress: Progress,
    *,
    damping: bool,
) -> LoopResult:
    computed = problem.nearest_roots(model, problem.computed)
    settings = StepSettings(
        alpha=options.alpha,
        beta=options.beta,
        cross_sensitivities=options.cross_sensitivities,
        damping=damping,
    )
    steps = tuple(_step(problem, model, frf, computed, settings) for frf in frfs)
    return published_loop(
        steps,
        model.damping if damping else model.stiffness,
        delta=options.delta_damping if damping else options.delta,
        max_iterations=options.max_iterations or MAX_ITERATIONS,
        progress=progress,
    )


def _step(
    problem: UpdateProblem, model: ReducedModel, frf: int, computed: ComplexArray, settings: StepSettings
) -> PublishedStep:
    label = problem.labels[frf]
    poles = np.flatnonzero(problem.frf < 0)
    indices = np.concatenate([poles, np.flatnonzero(problem.frf == frf)])
    return PublishedStep(
        model.mass,
        model.damping,
        model.stiffness,
        sensor=model.dofs.index(label.output_dof.unsigned),
        actuator=model.dofs.index(label.input_dof.unsigned),
        targets=problem.values[indices],
        computed=computed[indices],
        n_poles=len(poles),
        settings=settings,
    )


def _usable_frfs(problem: UpdateProblem) -> tuple[tuple[int, ...], tuple[str, ...]]:
    """FRFs whose sensor and excited DOF are retained: the substructure lacks their row and column."""
    retained = set(problem.model.dofs)

    def usable(frf: int) -> bool:
        label = problem.labels[frf]
        return {label.output_dof.unsigned, label.input_dof.unsigned} <= retained

    with_targets = problem.frfs or tuple(range(len(problem.labels)))
    frfs = tuple(frf for frf in with_targets if usable(frf))
    if not frfs:
        names = ", ".join(str(problem.labels[frf]) for frf in with_targets)
        raise InputError(
            f"[update] method = 'ipz' needs sensor and excited DOF of an FRF among [reduce] dofs; {names} have not both"
        )
    unused = tuple(
        f"the zeros of {problem.labels[frf]} are not used: 'ipz' needs its sensor and excited DOF among [reduce] dofs"
        for frf in with_targets
        if frf not in frfs
    )
    return frfs if problem.frfs else frfs[:1], unused


def _update_chosen_parameters(problem: UpdateProblem, basis: ParameterBasis, options: UpdateOptions) -> UpdatedModel:
    theta, _, status, history = iterate_parameters(
        problem,
        basis,
        alpha=options.alpha,
        beta=options.beta,
        delta=options.delta,
        max_iterations=options.max_iterations or MAX_ITERATIONS,
    )
    amounts, model = basis.amounts(theta), problem.model
    updated = replace(
        model,
        mass=model.mass + np.tensordot(amounts, basis.mass, 1),
        damping=model.damping + np.tensordot(amounts, basis.damping, 1),
        stiffness=model.stiffness + np.tensordot(amounts, basis.stiffness, 1),
    )
    return _updated(problem, updated, status, history.assign(phase="chosen parameters"), ())


def _updated(
    problem: UpdateProblem, model: ReducedModel, status: UpdateStatus, history: pd.DataFrame, unmet: tuple[str, ...]
) -> UpdatedModel:
    order = len(model.dofs)
    asymmetry = _asymmetry(model.stiffness)
    warning = f"the updated stiffness is not symmetric: eta of eq. (42) is {asymmetry:.2g}"
    return UpdatedModel(
        model=model,
        nominal=problem.model,
        method="ipz",
        status=status,
        history=history[["phase", *history.columns.drop("phase")]],
        before=problem.computed,
        after=problem.nearest_roots(model, problem.values),
        ensemble=np.zeros((0, 3, order, order)),
        unmet=unmet,
        warnings=(warning,) if asymmetry > ROUNDING else (),
    )


ROUNDING = 1e-10  # of eta: a symmetric matrix after many sums


def _asymmetry(matrix: FloatArray) -> float:
    """Measure of eq. (42): how far from symmetric."""
    return float(np.linalg.norm(matrix - matrix.T, 2) / np.linalg.norm(matrix + matrix.T, 2))
