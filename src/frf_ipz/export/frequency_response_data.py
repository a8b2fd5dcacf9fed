"""Measured FRFs for python-control."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.errors import InputError

if TYPE_CHECKING:
    import control

    from frf_ipz.frf import FrfSet


def to_frd(frfs: FrfSet) -> control.FRD:
    """Hand measured FRFs to python-control.

    Parameters
    ----------
    frfs : FrfSet
        The FRFs.

    Returns
    -------
    control.FRD
        One row a sensor, one column an excited DOF, in the order of `FrfSet.output_dofs` and `FrfSet.input_dofs`,
        named by their DOFs; rad/s and SI units of each FRF's quantity. NaN where that pair was not measured.

    Raises
    ------
    InputError
        If an exponential window has added damping, which python-control cannot represent.
    """
    import control  # here, since it takes a second and loads pyplot

    if frfs.window_decay_1_s > 0:
        raise InputError(
            f"the FRFs were measured with an exponential window and hold at {frfs.window_decay_1_s:g} + i omega rad/s, "
            "which python-control cannot represent; use the fitted or the updated model, which have no window"
        )
    values, measured = frfs.matrix()
    values = np.where(measured, values, complex(np.nan, np.nan))
    return control.FRD(
        values.transpose(1, 2, 0),
        2 * np.pi * frfs.frequency_hz,
        inputs=[str(dof) for dof in frfs.input_dofs],
        outputs=[str(dof) for dof in frfs.output_dofs],
    )
