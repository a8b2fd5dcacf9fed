"""Measured FRFs for python-control."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arguments import require_type
from frf_ipz.errors import InputError
from frf_ipz.frf import FrfSet

if TYPE_CHECKING:
    import control


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
    >>> response = frf_ipz.to_frd(frfs)
    >>> response.ninputs, response.noutputs, response.output_labels
    (1, 2, ['6:+z', '11:+z'])
    """
    require_type("frfs", frfs, FrfSet)
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
