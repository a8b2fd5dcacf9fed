"""How far sensors and excited points may be from their nominal positions, for the stages that update the model."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.model.layout import make_shift_rows, measure_extents
from frf_ipz.diagnosis.model.nuisance import UNIFORM_STD
from frf_ipz.updating.position_uncertainty import PositionUncertainty

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray
    from frf_ipz.frf import Measured
    from frf_ipz.structure import ReducedModel, StructuralModel


def propagate_position_tolerance(
    measured: Measured, reduced_model: ReducedModel, *, fe_model: StructuralModel, tolerance_m_per_m: float
) -> tuple[PositionUncertainty, ...]:
    """Propagate a tolerance of positions into rows of the reduced model.

    Parameters
    ----------
    measured : ModalFit or FrfSet
        What was measured.
    reduced_model : ReducedModel
        Made from the FE model.
    fe_model : StructuralModel
        The FE model.
    tolerance_m_per_m : float
        Half width of the tolerance, over the size of the structure along an axis.

    Returns
    -------
    tuple of PositionUncertainty
        Of each sensor and each excited point along each axis; none for lumped models, whose masses have no positions.
    """
    spans = measure_extents(fe_model)
    ends = dict.fromkeys(
        end for label in measured.labels for end in ((label.output_dof, True), (label.input_dof, False))
    )
    return tuple(
        PositionUncertainty(
            dof=dof,
            is_output=is_output,
            row=tolerance_m_per_m * UNIFORM_STD * spans[axis] * _reduce_row(fe_model, reduced_model, row),
        )
        for dof, is_output in ends
        for axis, row in make_shift_rows(fe_model, dof).items()
    )


def _reduce_row(model: StructuralModel, reduced: ReducedModel, row: FloatArray) -> FloatArray:
    """Weights of all DOFs, as a row of the reduced model; fixed DOFs do not move."""
    reduced_row = np.zeros(len(reduced.dofs))
    for row_index in np.flatnonzero(row).tolist():
        if not model.fixed[row_index]:
            reduced_row += row[row_index] * reduced.row(model.all_dofs[row_index])
    return reduced_row
