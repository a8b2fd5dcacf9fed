"""The table of the modes: shapes at the measured DOFs, how alike and how complex they are, and their quality."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.export.run_tables import frame_table
from frf_ipz.export.tables import Column
from frf_ipz.identification.results.shapes import driving_points, mode_shapes
from frf_ipz.modes import modal_assurance

if TYPE_CHECKING:
    import pyarrow as pa

    from frf_ipz.identification.modal_fit import ModalFit

KNOWN = (
    Column("pole_id", "int", "", "number of the pole, by ascending frequency"),
    Column("frequency_hz", "float", "Hz", "undamped natural frequency"),
    Column("damping_ratio", "float", "1", "damping ratio"),
    Column("dof", "text", "", "measured DOF, unsigned"),
    Column("shape_real", "float", "1/sqrt(kg), or 1 where not mass-normalised", "mode shape, real part"),
    Column("shape_imag", "float", "1/sqrt(kg), or 1 where not mass-normalised", "mode shape, imaginary part"),
    Column("mass_normalised", "flag", "", "true where a driving point was measured and the scale is known"),
    Column("mpc", "float", "1", "modal phase collinearity: 1 for a normal mode"),
    Column("mac", "float", "1", "largest modal assurance criterion with another mode"),
    Column("mac_pole_id", "int", "", "the mode that it is with"),
    Column("quality", "text", "", "good, fair or poor"),
    Column("remarks", "text", "", "why"),
)


def mode_table(fit: ModalFit, *, scale_is_known: bool = True) -> pa.Table:
    """Table of the modes, one row a mode and measured DOF.

    Parameters
    ----------
    fit : ModalFit
        The fitted model.
    scale_is_known : bool
        False where the channels' absolute scale is not.

    Returns
    -------
    pyarrow.Table
        ``modes.parquet``.
    """
    modes = mode_shapes(fit)
    count = len(modes.dofs)
    assurance = modal_assurance(modes.shapes, modes.shapes)
    np.fill_diagonal(assurance, 0.0)
    frame = fit.modes.drop(columns=["mac", "mac_pole_id"], errors="ignore")
    frame = frame.loc[frame.index.repeat(count)].reset_index(drop=True)
    frame["dof"] = [dof.name for dof in modes.dofs] * fit.n_modes
    frame["shape_real"], frame["shape_imag"] = modes.shapes.T.real.ravel(), modes.shapes.T.imag.ravel()
    frame["mass_normalised"] = bool(driving_points(fit.labels)) and scale_is_known
    if fit.n_modes:
        frame["mac"] = np.repeat(assurance.max(axis=1), count)
        frame["mac_pole_id"] = np.repeat(assurance.argmax(axis=1) + 1, count)
    return frame_table(frame, {column.name: column for column in KNOWN}, meaning="what the quality rests on")
