"""Shapes of measured modes at sensors and excited DOFs, from the residues of all FRFs.

The residue matrix of a normal mode has rank one: it is the shape at the sensors times that at the excited DOFs. Only
the product shows; how its size divides between the two is left to the model.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.numerics.low_rank_fit import fit_products
from frf_ipz.pairing.poles import measured_amplitudes
from frf_ipz.rational import damping_ratio

if TYPE_CHECKING:
    from collections.abc import Mapping

    from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray, IntArray
    from frf_ipz.dofs import AnyDof
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.updating.shape_expansion.wrong_gains import WrongGain


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MeasuredShapes:
    """Modes as products of a shape at the sensors and one at the excited DOFs.

    Parameters
    ----------
    outputs, inputs : tuple of Dof or PortDof
        Sensors and excited DOFs, with their signs.
    poles : (n_modes,) complex array
        rad/s.
    size : (n_modes,) array
        Size of the amplitudes of a mode, in the unit of the measurement over kg.
    at_outputs : (n_modes, n_outputs) array
        Directions, of norm 1.
    at_inputs : (n_modes, n_inputs) array
        Directions, of norm 1.
    noise : (n_modes,) array
        Relative variance of the amplitudes of a mode.
    doubt : (n_outputs + n_inputs,) array
        Relative variance of the gain of a point, where a wrong one was taken off.
    """

    outputs: tuple[AnyDof, ...]
    inputs: tuple[AnyDof, ...]
    poles: ComplexArray
    size: FloatArray
    at_outputs: FloatArray
    at_inputs: FloatArray
    noise: FloatArray
    doubt: FloatArray

    @property
    def omega(self) -> FloatArray:
        """(n_modes,) natural frequencies, rad/s."""
        return np.asarray(np.abs(self.poles))

    @property
    def damping(self) -> FloatArray:
        """(n_modes,) damping ratios."""
        return damping_ratio(self.poles)


def measured_shapes(
    fit: ModalFit, *, kept: BoolArray | None = None, wrong_gains: Mapping[AnyDof, WrongGain] | None = None
) -> MeasuredShapes | None:
    """Take the shapes out of a fit.

    Parameters
    ----------
    fit : ModalFit
        Of FRFs.
    kept : (n_frfs,) bool array, optional
        FRFs to take them from; all where it is left out.
    wrong_gains : mapping of Dof or PortDof to WrongGain, optional
        Of points of the side that has more of them; they are taken off.

    Returns
    -------
    MeasuredShapes or None
        None where no FRF remains, or where the FRFs fall in groups that share neither a sensor nor an excited DOF, so
        that no product relates them.
    """
    kept = np.ones(len(fit.labels), bool) if kept is None else kept
    labels = [label for label, is_kept in zip(fit.labels, kept, strict=True) if is_kept]
    if not labels or not fit.n_modes:
        return None
    outputs = tuple(dict.fromkeys(label.output_dof for label in labels))
    inputs = tuple(dict.fromkeys(label.input_dof for label in labels))
    rows = np.array([outputs.index(label.output_dof) for label in labels])
    columns = np.array([inputs.index(label.input_dof) for label in labels])
    if not _are_joined(rows, columns):
        return None
    amplitudes, std = (values[:, kept] for values in measured_amplitudes(fit))
    wrong = wrong_gains or {}
    gain = np.abs(gains_of_frfs(fit, wrong)[kept])
    more = side_with_more(fit)
    doubt = np.concatenate(
        [[wrong[dof].std ** 2 if dof in wrong and side == more else 0.0 for dof in side] for side in (outputs, inputs)]
    )
    products = [_leading_product(mode, rows, columns) for mode in (amplitudes / gain).real]
    return MeasuredShapes(
        outputs=outputs,
        inputs=inputs,
        poles=fit.model.poles[: fit.n_modes],
        size=np.array([size for size, _, _ in products]),
        at_outputs=np.array([output for _, output, _ in products]),
        at_inputs=np.array([force for _, _, force in products]),
        noise=np.mean((std / gain) ** 2, axis=1) / np.maximum(np.mean(np.abs(amplitudes / gain) ** 2, axis=1), 1e-300),
        doubt=doubt,
    )


def gains_of_frfs(fit: ModalFit, wrong_gains: Mapping[AnyDof, WrongGain]) -> FloatArray:
    """Give the gain of each FRF, as far as it is known.

    Parameters
    ----------
    fit : ModalFit
        The test.
    wrong_gains : mapping of Dof or PortDof to WrongGain
        Of points of the side that has more of them.

    Returns
    -------
    (n_frfs,) array
        What amplitudes are to be divided by.
    """
    gain = fit.gain if fit.unknown_scale == "none" else np.ones(len(fit.labels))
    is_output = side_with_more(fit) == _sides(fit)[0]
    ends = [label.output_dof if is_output else label.input_dof for label in fit.labels]
    return np.asarray(gain * np.exp([wrong_gains[end].log_gain if end in wrong_gains else 0.0 for end in ends]))


def side_with_more(fit: ModalFit) -> tuple[AnyDof, ...]:
    """Name the points of the side of a test that has more of them.

    Parameters
    ----------
    fit : ModalFit
        The test.

    Returns
    -------
    tuple of Dof or PortDof
        Sensors or excited DOFs; sensors where there are as many.
    """
    outputs, inputs = _sides(fit)
    return outputs if len(outputs) >= len(inputs) else inputs


def _sides(fit: ModalFit) -> tuple[tuple[AnyDof, ...], tuple[AnyDof, ...]]:
    return (
        tuple(dict.fromkeys(label.output_dof for label in fit.labels)),
        tuple(dict.fromkeys(label.input_dof for label in fit.labels)),
    )


def _are_joined(rows: IntArray, columns: IntArray) -> bool:
    """Tell whether every FRF is reached from the first by shared sensors and excited DOFs."""
    reached: BoolArray = np.arange(len(rows)) == 0
    for _ in range(len(rows)):
        shares = np.isin(rows, rows[reached]) | np.isin(columns, columns[reached])
        if (shares == reached).all():
            break
        reached = shares
    return bool(reached.all())


def _leading_product(amplitudes: FloatArray, rows: IntArray, columns: IntArray) -> tuple[float, FloatArray, FloatArray]:
    """Size and directions of the product that is nearest to the amplitudes of a mode."""
    shape = rows.max() + 1, columns.max() + 1
    counts, sums = np.zeros(shape), np.zeros(shape)
    np.add.at(counts, (rows, columns), 1.0)
    np.add.at(sums, (rows, columns), amplitudes)
    is_measured = (counts > 0).astype(float)
    left, right = (vectors[:, 0].real for vectors in fit_products(sums / np.maximum(counts, 1.0), is_measured, 1))
    sizes = [max(float(np.linalg.norm(vector)), np.finfo(float).tiny) for vector in (left, right)]
    return sizes[0] * sizes[1], left / sizes[0], right / sizes[1]
