"""Other versions of a beam: with shear and rotary inertia or without, and under an axial force."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

from scipy import sparse

from frf_ipz.errors import InputError
from frf_ipz.fe.assembly import add_up, mass_and_stiffness
from frf_ipz.fe.beams.beam_options import BeamFile, BeamOptions
from frf_ipz.fe.beams.elements import geometric_stiffness_matrices
from frf_ipz.fe.kinds.beam import beam_elements, element_parts

if TYPE_CHECKING:
    from frf_ipz.fe.beams.beam_options import Formulation
    from frf_ipz.structure import Matrix, StructuralModel


def with_formulation(model: StructuralModel, formulation: Formulation) -> StructuralModel:
    """Build the elements of a beam anew by another theory; everything else stays.

    Parameters
    ----------
    model : StructuralModel
        A beam.
    formulation : str
        ``timoshenko`` or ``euler-bernoulli``.

    Returns
    -------
    StructuralModel
        The beam with other elements. Elements that were scaled lose it: scale after this.

    Raises
    ------
    InputError
        If the model is no beam.
    """
    file = _beam_file(model)
    beam = replace(file.beam, formulation=formulation)
    elements = element_parts(beam)
    others = [part for part in model.parts if part.kind != "element"]
    old_mass, old_stiffness = mass_and_stiffness(
        [part for part in model.parts if part.kind == "element"], _order(model)
    )
    mass, stiffness = mass_and_stiffness(elements, _order(model))
    return replace(
        model,
        mass_all=sparse.csr_array(model.mass_all + (mass - old_mass)),
        stiffness_all=sparse.csr_array(model.stiffness_all + (stiffness - old_stiffness)),
        parts=(*elements, *others),
        source=replace(file, beam=beam),  # who interpolates between nodes asks it for the theory
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


@lru_cache(maxsize=2)  # a search for an axial load asks for the same one again and again
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
    return add_up(zip((part.indices for part in elements), shares, strict=True), _order(model))


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


def _beam_file(model: StructuralModel) -> BeamFile:
    if not isinstance(model.source, BeamFile):
        raise InputError(f"the model '{model.name}' is of kind '{model.kind}'; only a beam can be built anew")
    return model.source


def _order(model: StructuralModel) -> int:
    return len(model.all_dofs)
