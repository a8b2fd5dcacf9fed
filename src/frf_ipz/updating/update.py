"""Updating of the reduced model to the measured poles and zeros, by one of the methods in `updating.methods`.

Sits between pairing and prediction. A method is a module that offers
``update(problem, options, progress) -> UpdatedModel``; it is found by its name.
"""

from __future__ import annotations

import pkgutil
from dataclasses import replace
from importlib import import_module
from typing import TYPE_CHECKING, Protocol, cast

import numpy as np

from frf_ipz.arguments import require_type
from frf_ipz.errors import InputError, did_you_mean
from frf_ipz.identification.modal_fit import ModalFit
from frf_ipz.numerics.one_thread import on_one_thread
from frf_ipz.pairing.pair import pair_roots
from frf_ipz.pairing.pairs import Pairs
from frf_ipz.progress import silent
from frf_ipz.structure import ReducedModel, StructuralModel
from frf_ipz.updating import methods
from frf_ipz.updating.fall_back import keep_if_better
from frf_ipz.updating.mass_evidence import frequency_factor
from frf_ipz.updating.options import UpdateOptions
from frf_ipz.updating.pairing_again import PairingAgain
from frf_ipz.updating.parameters import ParameterBasis, make_structural_basis
from frf_ipz.updating.position_uncertainty import with_position_uncertainty
from frf_ipz.updating.problem import UpdateProblem, make_problem
from frf_ipz.updating.scale import fit_scale
from frf_ipz.updating.shape_expansion.expand import with_expanded_shapes
from frf_ipz.updating.updated_model import UpdatedModel, UpdateStatus, with_free_rigid_bodies

if TYPE_CHECKING:
    from collections.abc import Collection

    from frf_ipz.dofs import AnyDof
    from frf_ipz.frf import FrfLabel
    from frf_ipz.progress import Progress
    from frf_ipz.updating.position_uncertainty import PositionUncertainty


class Method(Protocol):
    """Interface of a module in `updating.methods`."""

    def update(self, problem: UpdateProblem, options: UpdateOptions, progress: Progress) -> UpdatedModel:
        """Update a model.

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
            The result.
        """


@on_one_thread
def update_model(
    fit: ModalFit,
    reduced_model: ReducedModel,
    *,
    pairs: Pairs | None = None,
    fe_model: StructuralModel | None = None,
    options: UpdateOptions | None = None,
    basis: ParameterBasis | None = None,
    position_uncertainty: tuple[PositionUncertainty, ...] = (),
    progress: Progress = silent,
) -> UpdatedModel:
    """Update a reduced model to the measured poles and zeros.

    Parameters
    ----------
    fit : ModalFit
        Poles and zeros as measured, with their covariance.
    reduced_model : ReducedModel
        The nominal model.
    pairs : Pairs, optional
        Measured poles and zeros with their counterparts; only the paired ones become targets. They are paired here
        where they are left out.
    fe_model : StructuralModel, optional
        The FE model that was reduced: the stiffness of its parts may then change, and masses may be found at its free
        ends. Without it and without `basis` the method uses its own generic parameters.
    options : UpdateOptions, optional
        Method and its settings.
    basis : ParameterBasis, optional
        What may change, and how likely: from `make_structural_basis`, or what a diagnosis has chosen
        (`make_diagnosed_basis`).
    position_uncertainty : tuple of PositionUncertainty
        Uncertainty of the positions of sensors and excitation: zeros weigh less by it.
    progress : Progress
        Reports how far the work is.

    Returns
    -------
    UpdatedModel
        The updated model, its history and its ensemble; see `status`.

    Raises
    ------
    InputError
        If there is no such method, or the method cannot work on this model.
    NumericalError
        If the matrices of the model cannot be worked with.

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
    >>> frf_ipz.update_model(fit, reduced_model, fe_model=beam)
    UpdatedModel: minimal-change, converged, 6 targets, 2 iterations, 6 DOFs
    """
    require_type("fit", fit, ModalFit)
    require_type("reduced_model", reduced_model, ReducedModel)
    require_type("pairs", pairs, Pairs, optional=True)
    require_type("fe_model", fe_model, StructuralModel, optional=True)
    require_type("options", options, UpdateOptions, optional=True)
    require_type("basis", basis, ParameterBasis, optional=True)
    chosen = options or UpdateOptions()
    available = method_names()
    if chosen.method not in available:
        raise InputError(f"[update] method: there is no '{chosen.method}'; {did_you_mean(chosen.method, available)}")
    module = import_module(f"{methods.__name__}.{chosen.method.replace('-', '_')}")
    if basis is None and fe_model is not None:
        basis = make_structural_basis(fe_model, reduced_model, mass=chosen.mass)
    paired = pairs or pair_roots(fit, reduced_model)

    def targets_of(chosen_pairs: Pairs, model: ReducedModel) -> UpdateProblem:
        targets = make_problem(model, fit, chosen_pairs, basis)
        return replace(targets, covariance=with_position_uncertainty(targets, position_uncertainty))

    again = PairingAgain(fit=fit, pairs=paired, make_problem=targets_of)
    problem = replace(targets_of(paired, reduced_model), pair_again=again if chosen.pair_again else None)
    updated = with_free_rigid_bodies(cast("Method", module).update(problem, chosen, progress))
    paired = updated.pairs or paired
    scaled = _with_scales(updated, fit, paired)
    kept = keep_if_better(scaled, fit)
    if kept is not scaled:
        kept = _with_scales(kept, fit, paired)
    if not chosen.expand or chosen.method != "minimal-change" or kept.status is UpdateStatus.NOTHING_TO_DO:
        return kept
    geometry = None if fe_model is None else fe_model.geometry
    final = problem if kept.pairs is None else targets_of(kept.pairs, reduced_model)  # after pairing again

    def update_without(points: Collection[AnyDof]) -> UpdatedModel:
        rows = tuple(row for row in paired.rows if row.frf < 0 or not _meets(fit.labels[row.frf], points))
        fewer = replace(paired, rows=rows)
        alone = cast("Method", module).update(targets_of(fewer, reduced_model), replace(chosen, ensemble=0), silent)
        return _with_scales(with_free_rigid_bodies(alone), fit, fewer)

    expanded = with_expanded_shapes(kept, fit, final, update_without=update_without, geometry=geometry, options=chosen)
    if expanded.expansion is None:
        return kept
    # what is said of a way back to the nominal model does not hold for measured shapes
    return replace(expanded, status=scaled.status, warnings=(*scaled.warnings, *expanded.expansion.statements))


def _meets(label: FrfLabel, points: Collection[AnyDof]) -> bool:
    return label.output_dof in points or label.input_dof in points


def _with_scales(updated: UpdatedModel, fit: ModalFit, paired: Pairs) -> UpdatedModel:
    frequency = frequency_factor(paired, updated.before)
    none = np.zeros((0, *updated.ensemble.shape[1:]))
    return replace(
        updated,
        scale=fit_scale(fit, paired, updated.model, updated.after, updated.ensemble, frequency=frequency),
        nominal_scale=fit_scale(fit, paired, updated.nominal, updated.before, none, frequency=frequency),
    )


def method_names() -> tuple[str, ...]:
    """Names of the available methods.

    Returns
    -------
    tuple of str
        As [update] method has them.
    """
    return tuple(sorted(module.name.replace("_", "-") for module in pkgutil.iter_modules(methods.__path__)))
