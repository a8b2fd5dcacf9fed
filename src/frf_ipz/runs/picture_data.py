"""What pictures and pages draw of a run beside its results: the models at the measured points, targets, parts."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import eigh

from frf_ipz.identification.results.shapes import mode_shapes
from frf_ipz.late_imports import import_late
from frf_ipz.modes import modal_assurance
from frf_ipz.updating.targets import Target, target_rows

if TYPE_CHECKING:
    import pandas as pd

    from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
    from frf_ipz.dofs import AnyDof
    from frf_ipz.frf import FrfLabel, FrfSet
    from frf_ipz.runs.results import Results
else:
    pd = import_late("pandas")

FRFS_SHOWN_AT_FIRST = 6  # the others are a click away
AT_REST = 1e-9  # of the largest eigenvalue: a rigid-body mode, which no fit has


@dataclass(frozen=True, kw_only=True, eq=False)
class ModelsBesideMeasurement:
    """FRFs at the measured points, on all lines of the band.

    Parameters
    ----------
    frequency_hz : (n_lines,) array
        Hz.
    labels : tuple of FrfLabel
        What each connects.
    measured, nominal, updated : (n_lines, n_frfs) complex array
        As measured, and of the models before and after updating.
    has_fitted_gains : bool
        The scale of the measurement is unknown, so that each model's FRF has a gain that was fitted.
    has_window : bool
        Force and response share an exponential window, which widens the peaks.
    """

    frequency_hz: FloatArray
    labels: tuple[FrfLabel, ...]
    measured: ComplexArray
    nominal: ComplexArray
    updated: ComplexArray
    has_fitted_gains: bool
    has_window: bool = False

    @cached_property
    def names(self) -> list[str]:
        """Name each FRF; with its quantity where the same two DOFs were measured in several."""
        texts = [str(label) for label in self.labels]
        counts = Counter(texts)
        return [
            text if counts[text] == 1 else f"{text}, {label.quantity.value} ({place + 1})"
            for place, (text, label) in enumerate(zip(texts, self.labels, strict=True))
        ]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ShapeAgreement:
    """Measured mode shapes against those of a model.

    Parameters
    ----------
    model : str
        ``nominal model`` or ``updated model``.
    n_dofs : int
        At how many DOFs they are compared.
    measured_hz : (n_measured,) array
        Natural frequencies of the fit.
    computed_hz : (n_computed,) array
        Of the model's modes up to the first above the band, and as many as were measured at least.
    mac : (n_measured, n_computed) array
        Modal assurance criterion.
    """

    model: str
    n_dofs: int
    measured_hz: FloatArray
    computed_hz: FloatArray
    mac: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ModeIndicator:
    """The complex mode indicator function of measured FRFs.

    Parameters
    ----------
    frequency_hz : (n_lines,) array
        Hz.
    values : (n_lines, n_values) array
        Singular values of the FRF matrix at each line, the largest first; each peaks at the modes, and the second one
        where two modes share a peak.
    outputs, inputs : tuple of Dof
        What the matrix connects: the largest part of it in which every output was measured with every input.
    title : str
        Quantity and unit of the singular values.
    """

    frequency_hz: FloatArray
    values: FloatArray
    outputs: tuple[AnyDof, ...]
    inputs: tuple[AnyDof, ...]
    title: str


def hidden_frfs(run: Results) -> list[int]:
    """List the measured FRFs that are not shown at first.

    Parameters
    ----------
    run : Results
        The run.

    Returns
    -------
    list of int
        Places among the measured FRFs.
    """
    return list(range(FRFS_SHOWN_AT_FIRST, len(run.labels)))


def fitted_lines(run: Results) -> IntArray:
    """Give the lines of the measured FRFs that were fitted; all of them without a fit.

    Parameters
    ----------
    run : Results
        The run.

    Returns
    -------
    (n_used,) int array
        Places on the frequency axis; empty without a measurement.
    """
    if run.frfs is None:
        return np.zeros(0, int)
    return np.arange(run.frfs.n_lines) if run.fit is None else np.flatnonzero(run.fit.used_lines)


def models_beside_measurement(run: Results) -> ModelsBesideMeasurement | None:
    """Give measured FRFs beside those of the models before and after updating.

    Parameters
    ----------
    run : Results
        The run.

    Returns
    -------
    ModelsBesideMeasurement or None
        None without a measurement or an update.
    """
    if run.frfs is None or run.updated_model is None:
        return None
    lines = np.flatnonzero(run.frfs.in_band(run.band_hz))
    labels, s = run.frfs.labels, run.frfs.s[lines]
    return ModelsBesideMeasurement(
        frequency_hz=run.frfs.frequency_hz[lines],
        labels=labels,
        measured=np.asarray(run.frfs.values[lines]),
        nominal=run.updated_model.compute_frfs(labels, s, nominal=True),
        updated=run.updated_model.compute_frfs(labels, s),
        has_fitted_gains=run.updated_model.scale.is_relative and run.updated_model.scale.is_fitted,
        has_window=bool(run.frfs.window_decay_1_s),
    )


def shape_agreements(run: Results) -> list[ShapeAgreement]:
    """Compare the measured mode shapes with those of the models before and after updating.

    Parameters
    ----------
    run : Results
        The run.

    Returns
    -------
    list of ShapeAgreement
        Nominal model first; empty without modes on both sides, or where fewer than two DOFs have a shape.
    """
    if run.fit is None or run.updated_model is None or not run.fit.n_modes:
        return []
    modes = mode_shapes(run.fit)
    known = [dof for dof in modes.dofs if dof in run.updated_model.model.expanded_dofs]
    if len(known) < 2:
        return []
    rows = [modes.dofs.index(dof) for dof in known]
    agreements = []
    for name, model in (("nominal model", run.updated_model.nominal), ("updated model", run.updated_model.model)):
        eigenvalues, vectors = eigh(model.stiffness, model.mass)
        moving = eigenvalues > AT_REST * eigenvalues[-1]
        hertz = np.sqrt(eigenvalues[moving]) / (2 * np.pi)
        count = max(int(np.sum(hertz <= run.band_hz[1])) + 1, run.fit.n_modes)
        shapes = (np.stack([model.row(dof) for dof in known]) @ vectors[:, moving])[:, :count]
        agreements.append(
            ShapeAgreement(
                model=name,
                n_dofs=len(known),
                measured_hz=modes.natural_frequency_hz,
                computed_hz=hertz[:count],
                mac=modal_assurance(modes.shapes[rows], shapes.astype(complex)),
            )
        )
    return agreements


def mode_indicator(frfs: FrfSet) -> ModeIndicator:
    """Compute the complex mode indicator function.

    C. Y. Shih, Y. G. Tsuei, R. J. Allemang and D. L. Brown, Complex mode indication function and its applications to
    spatial domain parameter estimation, Mech. Syst. Signal Process. 2 (1988) 367-377,
    doi:10.1016/0888-3270(88)90060-X.

    Parameters
    ----------
    frfs : FrfSet
        Measured FRFs. Where they are of several quantities, all are turned into that of the first; where they are of
        several units, as of forces and moments, those of the commonest one are taken.

    Returns
    -------
    ModeIndicator
        Its singular values. An entry that was not measured has no place in them: with a zero for it, one mode would
        have two peaks.
    """
    quantity = frfs.labels[0].quantity
    units = [quantity.unit(label.output_dof.direction, label.input_dof.direction) for label in frfs.labels]
    unit = max(dict.fromkeys(units), key=units.count)
    places = {
        (label.output_dof.unsigned, label.input_dof.unsigned): frf
        for frf, label in enumerate(frfs.labels)
        if units[frf] == unit
    }
    outputs, inputs = _largest_block(set(places))
    columns = [[places[output, input_dof] for input_dof in inputs] for output in outputs]
    powers = quantity.power - np.array([label.quantity.power for label in frfs.labels])
    s = np.where(frfs.s == 0, 1.0, frfs.s)  # of the line at 0 Hz only FRFs of one quantity are comparable
    values = frfs.values * np.where(powers == 0, 1.0, s[:, None] ** powers)
    return ModeIndicator(
        frequency_hz=frfs.frequency_hz,
        values=np.asarray(np.linalg.svd(values[:, columns], compute_uv=False), float),
        outputs=outputs,
        inputs=inputs,
        title=f"{quantity.value.capitalize()}, {unit}",
    )


def _largest_block(measured: set[tuple[AnyDof, AnyDof]]) -> tuple[tuple[AnyDof, ...], tuple[AnyDof, ...]]:
    """Choose outputs and inputs that were all measured with each other: most singular values, then most FRFs."""
    inputs_of: dict[AnyDof, set[AnyDof]] = {}
    for output, input_dof in measured:
        inputs_of.setdefault(output, set()).add(input_dof)
    blocks = []
    for inputs in {frozenset(inputs) for inputs in inputs_of.values()}:
        outputs = [output for output, others in inputs_of.items() if inputs <= others]
        blocks.append((sorted(outputs, key=str), sorted(inputs, key=str)))
    best = max(blocks, key=lambda block: (min(map(len, block)), len(block[0]) * len(block[1]), str(block)))
    return tuple(best[0]), tuple(best[1])


def update_targets(run: Results) -> list[Target]:
    """List the targets of the update, before and after.

    Parameters
    ----------
    run : Results
        The run.

    Returns
    -------
    list of Target
        Poles first; empty without an update.
    """
    if run.updated_model is None or run.pairs is None:
        return []
    return target_rows(run.updated_model, run.pairs)


def changed_parts(run: Results) -> pd.DataFrame:
    """Give the change of the stiffness of every part of the FE model by the update.

    Parameters
    ----------
    run : Results
        The run.

    Returns
    -------
    DataFrame
        As `UpdatedModel.parts`; empty where that is not known.
    """
    return pd.DataFrame() if run.updated_model is None else run.updated_model.parts
