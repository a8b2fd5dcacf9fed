"""What a diagnosis found, put into the model and taken out of the FRFs: the rest of the chain goes on from there."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from frf_ipz.arguments import require_type
from frf_ipz.diagnosis.catalogue.finder import shipped_effects
from frf_ipz.diagnosis.catalogue.joint_change import build_together
from frf_ipz.diagnosis.catalogue.model_context import ModelContext
from frf_ipz.diagnosis.model.basis import make_basis
from frf_ipz.diagnosis.model.change import NO_CHANGE, Change, place_sensor, with_change
from frf_ipz.diagnosis.model.layout import make_layout
from frf_ipz.diagnosis.options import DiagnoseOptions
from frf_ipz.diagnosis.result import Diagnosis
from frf_ipz.dofs import Dof
from frf_ipz.frf import FrfSet
from frf_ipz.structure import StructuralModel

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from frf_ipz.diagnosis.catalogue.effect import Effect
    from frf_ipz.diagnosis.result import Curves, LinearisedLaw
    from frf_ipz.frf import FrfLabel


def correct_model(
    diagnosis: Diagnosis, fe_model: StructuralModel, *, effects: Mapping[str, Effect] | None = None
) -> StructuralModel:
    """Put the findings into the model.

    Parameters
    ----------
    diagnosis : Diagnosis
        What the model lacks.
    fe_model : StructuralModel
        The nominal model that was diagnosed.
    effects : mapping of str to Effect, optional
        Those that were searched for; the shipped ones where it is left out. Needed for users' own effects.

    Returns
    -------
    StructuralModel
        The model with what it lacked; the same model where findings are in the measuring chain only, or none.

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
    >>> frf_ipz.correct_model(diagnosis, model).mass.toarray().diagonal().round(2).tolist()
    [2.0, 1.0, 1.2]
    """
    require_type("diagnosis", diagnosis, Diagnosis)
    require_type("fe_model", fe_model, StructuralModel)
    return prepare_correction(diagnosis, fe_model, effects)([finding.values for finding in diagnosis.findings])


def prepare_correction(
    diagnosis: Diagnosis, model: StructuralModel, effects: Mapping[str, Effect] | None = None
) -> Callable[[Sequence[Sequence[float]]], StructuralModel]:
    """Prepare to put the findings into the model, for any values of their parameters.

    Parameters
    ----------
    diagnosis, model, effects
        As for `correct_model`.

    Returns
    -------
    callable
        From the values of each finding to the model with what it lacked.
    """
    base = model if diagnosis.linearised_law is None else _add_linearised_law(model, diagnosis.linearised_law)
    known = effects or shipped_effects()
    structural = {
        number: known[finding.effect]
        for number, finding in enumerate(diagnosis.findings)
        if finding.effect in known and known[finding.effect].chain(finding.location) is None
    }
    if not structural or diagnosis.curves is None:
        return lambda _: base
    context = _model_context(base, diagnosis.curves)
    acting = [(effect, diagnosis.findings[number].location) for number, effect in structural.items()]
    builders = dict(zip(structural, build_together(context, acting), strict=True))

    def correct(values: Sequence[Sequence[float]]) -> StructuralModel:
        total = NO_CHANGE
        for number, build in builders.items():
            total = total + build(np.array(values[number]))
        return with_change(base, total)

    return correct


def _add_linearised_law(model: StructuralModel, law: LinearisedLaw) -> StructuralModel:
    """Put the spring and the damper that stand for a force law into a model."""
    rows = [model.full_index(end) for end in reversed(law.ends)]
    signs = [1.0, -1.0][: len(rows)]
    across = sparse.csr_array((signs, ([0] * len(rows), rows)), shape=(1, len(model.all_dofs)))
    pair = across.T @ across
    return replace(
        model,
        stiffness_all=sparse.csr_array(model.stiffness_all + law.stiffness * pair),
        damping_all=sparse.csr_array(model.damping_all + law.damping * pair),
    )


def _model_context(model: StructuralModel, curves: Curves) -> ModelContext:
    """Gather what effects may use, as it was when they were searched for."""
    layout = make_layout(curves.labels)
    highest = float(curves.s.imag.max())
    return ModelContext(
        basis=make_basis(model, highest, layout.dofs),
        layout=layout,
        band_hz=(float(curves.s.imag.min()) / (2 * np.pi), highest / (2 * np.pi)),
        contour=curves.s,
        options=DiagnoseOptions(),
    )


def correct_frfs(frfs: FrfSet, diagnosis: Diagnosis, *, effects: Mapping[str, Effect] | None = None) -> FrfSet:
    """Take the findings in the measuring chain out of FRFs.

    Parameters
    ----------
    frfs : FrfSet
        As measured.
    diagnosis : Diagnosis
        Of them.
    effects : mapping of str to Effect, optional
        As for `correct_model`.

    Returns
    -------
    FrfSet
        FRFs of a faultless measuring chain, its sensors where they really are.

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
    >>> frf_ipz.correct_frfs(frfs, diagnosis) is frfs
    True
    """
    require_type("frfs", frfs, FrfSet)
    require_type("diagnosis", diagnosis, Diagnosis)
    change = _chain_change(diagnosis, effects or shipped_effects())
    if not (change.channels or change.moved):
        return frfs
    factors = np.ones(frfs.values.shape, np.complex128)
    for index, label in enumerate(frfs.labels):
        output, excited = _channel_names(label)
        if output in change.channels:
            factor = change.channels[output](frfs.s)
            factors[:, index] /= np.where(factor == 0, 1.0, factor)  # a high-pass passes nothing at 0 Hz
        if excited in change.channels:
            factors[:, index] *= change.channels[excited](frfs.s)
    return replace(
        frfs,
        values=frfs.values * factors,
        variance=frfs.variance * np.abs(factors) ** 2,
        labels=tuple(_relabel(label, change.moved) for label in frfs.labels),
    )


def _chain_change(diagnosis: Diagnosis, known: Mapping[str, Effect]) -> Change:
    """Everything that the findings change in the measuring chain."""
    total = NO_CHANGE
    for finding in diagnosis.findings:
        build = known[finding.effect].chain(finding.location) if finding.effect in known else None
        if build is not None:
            total = total + build(np.array(finding.values))
    return total


def _channel_names(label: FrfLabel) -> tuple[str, str]:
    return label.output_channel or f"output {label.output_dof}", label.input_channel or f"input {label.input_dof}"


def _relabel(label: FrfLabel, moved: Mapping[str, int | Dof]) -> FrfLabel:
    return replace(label, output_dof=place_sensor(label.output_dof, moved.get(_channel_names(label)[0])))
