"""What only a model of a beam can do: follow another beam theory, carry an axial force, move between its nodes."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from frf_ipz.arrays import FloatArray
from frf_ipz.errors import InputError
from frf_ipz.fe.assembly import assemble, assemble_mass_and_stiffness
from frf_ipz.fe.beam_elements import deflection_polynomials, geometric_stiffness_matrices
from frf_ipz.fe.kinds.beam import BeamFile, BeamOptions, beam_elements, element_parts

if TYPE_CHECKING:
    from frf_ipz.arrays import Matrix
    from frf_ipz.fe.kinds.beam import Formulation
    from frf_ipz.structure import StructuralModel


def with_formulation(model: StructuralModel, formulation: Formulation) -> StructuralModel:
    """Build the elements of a beam by another theory; everything else stays.

    Parameters
    ----------
    model : StructuralModel
        A beam.
    formulation : str
        ``timoshenko`` or ``euler-bernoulli``.

    Returns
    -------
    StructuralModel
        The beam with new elements. Scaling of elements is lost: scale afterwards.

    Raises
    ------
    InputError
        If the model is no beam.
    """
    file = _beam_file(model)
    beam = replace(file.beam, formulation=formulation)
    elements = element_parts(beam)
    point_parts = [part for part in model.parts if part.kind != "element"]
    old_mass, old_stiffness = assemble_mass_and_stiffness(
        [part for part in model.parts if part.kind == "element"], _order(model)
    )
    mass, stiffness = assemble_mass_and_stiffness(elements, _order(model))
    return replace(
        model,
        mass_all=sparse.csr_array(model.mass_all + (mass - old_mass)),
        stiffness_all=sparse.csr_array(model.stiffness_all + (stiffness - old_stiffness)),
        parts=(*elements, *point_parts),
        source=replace(file, beam=beam),  # interpolation between nodes takes the theory from it
    )


def with_axial_force(model: StructuralModel, force_N: float) -> StructuralModel:
    """Put a beam under an axial force that is the same all along.

    Parameters
    ----------
    model : StructuralModel
        A beam.
    force_N : float
        N, tension positive.

    Returns
    -------
    StructuralModel
        The beam, stiffened by tension or softened by compression.

    Raises
    ------
    InputError
        If the model is no beam.
    """
    return replace(model, stiffness_all=sparse.csr_array(model.stiffness_all + force_N * geometric_stiffness(model)))


@lru_cache(maxsize=2)  # a search for an axial load needs the same one many times
def geometric_stiffness(model: StructuralModel) -> Matrix:
    """Stiffness that an axial tension of 1 N adds to a beam.

    Parameters
    ----------
    model : StructuralModel
        A beam.

    Returns
    -------
    (n_all, n_all) sparse array
        For all DOFs, N/m per N and its rotational counterparts.

    Raises
    ------
    InputError
        If the model is no beam.
    """
    elements = [part for part in model.parts if part.kind == "element"]
    shares = geometric_stiffness_matrices(beam_elements(beam_options(model)))
    return assemble(zip((part.indices for part in elements), shares, strict=True), _order(model))


def beam_options(model: StructuralModel) -> BeamOptions:
    """Options that a beam was built from.

    Parameters
    ----------
    model : StructuralModel
        A beam.

    Returns
    -------
    BeamOptions
        ``[beam]`` of its file.

    Raises
    ------
    InputError
        If the model is no beam.
    """
    return _beam_file(model).beam


def deflection_row(model: StructuralModel, x_m: float) -> FloatArray:
    """Deflection at any position on a beam for unit motions of its DOFs.

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
        If the model is no beam, or the position is not on it.
    """
    return _polynomial_row(model, x_m, derivative=0)


def slope_row(model: StructuralModel, x_m: float) -> FloatArray:
    """Slope dw/dx at any position on a beam for unit motions of its DOFs.

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
        If the model is no beam, or the position is not on it.
    """
    return _polynomial_row(model, x_m, derivative=1)


def shear_slope_at(model: StructuralModel, x_m: float) -> float:
    """Slope by shear on each side of a force: half of the jump of the slope there.

    Parameters
    ----------
    model : StructuralModel
        A beam, by either theory.
    x_m : float
        Where the force acts, m from the left end.

    Returns
    -------
    float
        1/N: 1 / (2 kappa G A), the change of deflection with distance from the force, per newton.

    Raises
    ------
    InputError
        If the model is no beam, or the position is not on it.
    """
    beam = replace(beam_options(model), formulation="timoshenko")
    elements, index = beam_elements(beam), _element_index(model, x_m)
    shear_flexibility = elements.shear_parameter * elements.length**2 / (12 * elements.bending_stiffness)
    return float(shear_flexibility[index] / 2)


def _polynomial_row(model: StructuralModel, x_m: float, derivative: int) -> FloatArray:
    elements, index = beam_elements(beam_options(model)), _element_index(model, x_m)
    length = elements.length[index : index + 1]
    polynomials = deflection_polynomials(length, elements.shear_parameter[index : index + 1])[0]
    xi = float(np.clip(x_m / length[0] - index, 0.0, 1.0))
    powers = np.array([1.0, xi, xi**2, xi**3]) if derivative == 0 else np.array([0.0, 1.0, 2 * xi, 3 * xi**2]) / length
    row = np.zeros(len(model.all_dofs))
    row[2 * index : 2 * index + 4] = polynomials @ powers
    return row


def _element_index(model: StructuralModel, x_m: float) -> int:
    beam = beam_options(model)
    if not 0 <= x_m <= beam.length_m:
        raise InputError(f"x = {x_m:g} m is not on the beam '{model.name}', which goes from 0 to {beam.length_m:g} m")
    return min(int(x_m / beam.length_m * beam.elements), beam.elements - 1)


def _beam_file(model: StructuralModel) -> BeamFile:
    if not isinstance(model.source, BeamFile):
        raise InputError(
            f"the model '{model.name}' is of kind '{model.kind}'; only a beam has elements that can be rebuilt"
        )
    return model.source


def _order(model: StructuralModel) -> int:
    return len(model.all_dofs)
