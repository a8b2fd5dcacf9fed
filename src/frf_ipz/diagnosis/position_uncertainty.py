"""How far sensors and excited points may be from their nominal positions, for the stages that update the model."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arguments import require_type
from frf_ipz.diagnosis.model.layout import make_shift_rows, measure_extents
from frf_ipz.diagnosis.model.nuisance import UNIFORM_STD
from frf_ipz.errors import InputError
from frf_ipz.frf import require_measured
from frf_ipz.structure import ReducedModel, StructuralModel
from frf_ipz.updating.position_uncertainty import PositionUncertainty

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray
    from frf_ipz.frf import Measured


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
    >>> uncertain = frf_ipz.propagate_position_tolerance(
    ...     fit, reduced_model, fe_model=beam, tolerance_m_per_m=1e-3
    ... )
    >>> [str(position.dof) for position in uncertain]
    ['6:+z', '11:+z', '11:+z']
    """
    require_measured(measured)
    require_type("reduced_model", reduced_model, ReducedModel)
    require_type("fe_model", fe_model, StructuralModel)
    require_type("tolerance_m_per_m", tolerance_m_per_m, float, int)
    if not 0 <= tolerance_m_per_m < np.inf:
        raise InputError(f"tolerance_m_per_m is {tolerance_m_per_m}; it is 0 or positive")
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
