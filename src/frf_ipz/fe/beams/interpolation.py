"""Motion of a beam between its nodes, by the shapes that its elements are built on."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.errors import InputError
from frf_ipz.fe.beams.elements import deflection_polynomials
from frf_ipz.fe.beams.variants import beam_options
from frf_ipz.fe.kinds.beam import beam_elements

if TYPE_CHECKING:
    from frf_ipz.structure import StructuralModel


def deflection_row(model: StructuralModel, x_m: float) -> FloatArray:
    """Deflection at any place of a beam for unit motions of its DOFs.

    Parameters
    ----------
    model : StructuralModel
        A beam.
    x_m : float
        Distance from its left end, m.

    Returns
    -------
    (n_all,) array
        w(x) is this row times the motion of all DOFs, the held ones included.

    Raises
    ------
    InputError
        If the model is no beam, or the place is not on it.
    """
    return _row(model, x_m, derivative=0)


def slope_row(model: StructuralModel, x_m: float) -> FloatArray:
    """Slope dw/dx at any place of a beam for unit motions of its DOFs: how deflection changes with the place.

    Parameters
    ----------
    model : StructuralModel
        A beam.
    x_m : float
        Distance from its left end, m.

    Returns
    -------
    (n_all,) array
        1/m for deflections, 1 for rotations.

    Raises
    ------
    InputError
        If the model is no beam, or the place is not on it.
    """
    return _row(model, x_m, derivative=1)


def kink_at(model: StructuralModel, x_m: float) -> float:
    """Slope by shear on each side of a force: half of what jumps there.

    Parameters
    ----------
    model : StructuralModel
        A beam, by either theory.
    x_m : float
        Where the force acts, m from the left end.

    Returns
    -------
    float
        1/N: 1 / (2 kappa G A). Next to the force the deflection falls by it with every metre.

    Raises
    ------
    InputError
        If the model is no beam, or the place is not on it.
    """
    beam = replace(beam_options(model), formulation="timoshenko")
    elements, place = beam_elements(beam), _element_at(model, x_m)
    softness = elements.shear_parameter * elements.length**2 / (12 * elements.bending_stiffness)
    return float(softness[place] / 2)


def _row(model: StructuralModel, x_m: float, derivative: int) -> FloatArray:
    elements, place = beam_elements(beam_options(model)), _element_at(model, x_m)
    length = elements.length[place : place + 1]
    polynomials = deflection_polynomials(length, elements.shear_parameter[place : place + 1])[0]
    xi = float(np.clip(x_m / length[0] - place, 0.0, 1.0))
    powers = np.array([1.0, xi, xi**2, xi**3]) if derivative == 0 else np.array([0.0, 1.0, 2 * xi, 3 * xi**2]) / length
    row = np.zeros(len(model.all_dofs))
    row[2 * place : 2 * place + 4] = polynomials @ powers
    return row


def _element_at(model: StructuralModel, x_m: float) -> int:
    beam = beam_options(model)
    if not 0 <= x_m <= beam.length_m:
        raise InputError(f"x = {x_m:g} m is not on the beam '{model.name}', which goes from 0 to {beam.length_m:g} m")
    return min(int(x_m / beam.length_m * beam.elements), beam.elements - 1)
