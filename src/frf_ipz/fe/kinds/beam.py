"""``kind = "beam"``: a straight beam along x that bends in z."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import Field

from frf_ipz.dofs import Dof
from frf_ipz.errors import FileFormatError
from frf_ipz.fe.assembly import assemble_mass_and_stiffness, stated_damping
from frf_ipz.fe.beam_elements import BeamElements, mass_matrices, shear_coefficient, stiffness_matrices
from frf_ipz.fe.model_options import DampingSection, ModelSection, PortSection
from frf_ipz.option_types import Count, Node, NotNegative, Positive
from frf_ipz.structure import Geometry, Part, StructuralModel
from frf_ipz.toml_files import STRICT, to_options

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.arrays import BoolArray, IntArray

KIND = "beam"
DIRECTIONS = ("z", "ry")
HELD = {"clamped": ("z", "ry"), "pinned": ("z",), "sliding": ("ry",), "free": ()}
MAX_ELEMENTS = 100_000  # beyond, rounding in a beam's stiffness leaves no digit of the first modes
End = Literal["clamped", "pinned", "sliding", "free"]
Formulation = Literal["timoshenko", "euler-bernoulli"]
PoissonRatio = Annotated[float, Field(gt=-1, le=0.5, allow_inf_nan=False, strict=True)]
NumberOfElements = Annotated[int, Field(ge=1, le=MAX_ELEMENTS, strict=True)]


@dataclass(frozen=True, slots=True, kw_only=True)
class BeamSection:
    """``[[beam.section]]``: another cross-section for some elements.

    Parameters
    ----------
    elements : pair of int
        First and last element, both included.
    thickness_m, width_m : float, optional
        Of these elements; by default that of the beam.

    Examples
    --------
    >>> import frf_ipz
    >>> root = frf_ipz.BeamSection(elements=(1, 3), thickness_m=0.008)
    >>> beam = frf_ipz.make_beam(
    ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=10,
    ...     left="clamped", section=[root],
    ... )
    >>> frf_ipz.solve_modes(beam, n_modes=1).natural_frequency_hz.round(2)
    array([25.38])
    """

    __pydantic_config__ = STRICT

    elements: tuple[Count, Count]
    thickness_m: Positive | None = None
    width_m: Positive | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class BeamPointMass:
    """``[[beam.point_mass]]``: a mass at a node.

    Parameters
    ----------
    node : int
        Its node.
    mass_kg : float
        The mass.
    rotary_inertia_kgm2 : float
        Its moment of inertia about y.

    Examples
    --------
    >>> import frf_ipz
    >>> sensor = frf_ipz.BeamPointMass(node=11, mass_kg=0.005)
    >>> beam = frf_ipz.make_beam(
    ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=10,
    ...     left="clamped", point_mass=[sensor],
    ... )
    >>> frf_ipz.solve_modes(beam, n_modes=1).natural_frequency_hz.round(2)
    array([15.35])
    """

    __pydantic_config__ = STRICT

    node: Node
    mass_kg: NotNegative
    rotary_inertia_kgm2: NotNegative = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class BeamPointSpring:
    """``[[beam.point_spring]]``: a spring between a node and the ground.

    Parameters
    ----------
    node : int
        Its node.
    stiffness_N_m : float
        Against its displacement z.
    rotational_stiffness_Nm_rad : float
        Against its rotation ry.

    Examples
    --------
    >>> import frf_ipz
    >>> support = frf_ipz.BeamPointSpring(node=11, stiffness_N_m=1e3)
    >>> beam = frf_ipz.make_beam(
    ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=10,
    ...     left="clamped", point_spring=[support],
    ... )
    >>> frf_ipz.solve_modes(beam, n_modes=1).natural_frequency_hz.round(2)
    array([30.96])
    """

    __pydantic_config__ = STRICT

    node: Node
    stiffness_N_m: NotNegative = 0.0  # noqa: N815 - the contract's key
    rotational_stiffness_Nm_rad: NotNegative = 0.0  # noqa: N815 - the contract's key


@dataclass(frozen=True, slots=True, kw_only=True)
class BeamOptions:
    """``[beam]``: a rectangular cross-section that bends about its width.

    Parameters
    ----------
    length_m : float
        Length along x.
    width_m, thickness_m : float
        Of the cross-section: its second moment of area is width thickness^3 / 12.
    elements : int
        Elements of equal length; nodes are 1 to elements + 1 from the left.
    formulation : str
        ``timoshenko`` or ``euler-bernoulli``.
    youngs_modulus_Pa, density_kg_m3 : float
        Of the material.
    poisson_ratio : float
        Of the material; matters for Timoshenko only. 0.3 is that of most metals.
    left, right : str
        Support of an end: ``clamped`` (z, ry), ``pinned`` (z), ``sliding`` (ry) or ``free``.
    section : tuple of BeamSection
        Other cross-sections.
    point_mass : tuple of BeamPointMass
        Masses at nodes.
    point_spring : tuple of BeamPointSpring
        Springs to the ground.
    """

    __pydantic_config__ = STRICT

    length_m: Positive
    elements: NumberOfElements
    youngs_modulus_Pa: Positive  # noqa: N815 - the contract's key
    density_kg_m3: Positive
    width_m: Positive
    thickness_m: Positive
    formulation: Formulation = "timoshenko"
    poisson_ratio: PoissonRatio = 0.3
    left: End = "free"
    right: End = "free"
    section: tuple[BeamSection, ...] = ()
    point_mass: tuple[BeamPointMass, ...] = ()
    point_spring: tuple[BeamPointSpring, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class BeamFile:
    """A whole ``model.toml`` of a beam.

    Parameters
    ----------
    model : ModelSection
        ``[model]``.
    beam : BeamOptions
        ``[beam]``.
    damping : DampingSection, optional
        ``[damping]``.
    port : tuple of PortSection
        ``[[port]]``.
    """

    __pydantic_config__ = STRICT

    model: ModelSection
    beam: BeamOptions
    damping: DampingSection | None = None
    port: tuple[PortSection, ...] = ()


FILE = BeamFile


def files(file: BeamFile, path: Path) -> tuple[Path, ...]:
    """Files besides ``model.toml``: none.

    Parameters
    ----------
    file : BeamFile
        Content of ``model.toml``.
    path : Path
        Its path.

    Returns
    -------
    tuple of Path
        Empty.
    """
    del file, path
    return ()


def read(file: BeamFile, path: Path) -> StructuralModel:
    """Check the keys against each other, and build the beam.

    Parameters
    ----------
    file : BeamFile
        Content of ``model.toml``.
    path : Path
        Its path, for messages.

    Returns
    -------
    StructuralModel
        The beam.

    Raises
    ------
    FileFormatError
        If a section, a point mass or a spring lies outside the beam, sections overlap, or nothing can move.
    """
    _check_sections(file.beam, path)
    _check_points(file.beam, path)
    model = build_beam(file)
    if model.fixed.all():
        raise FileFormatError(path, "the supports hold every DOF of the beam; use more elements", where="key 'beam'")
    return model


def make_beam(  # noqa: PLR0913 - one argument a key of [beam]
    *,
    length_m: float,
    width_m: float,
    thickness_m: float,
    youngs_modulus_Pa: float,
    density_kg_m3: float,
    elements: int = 100,
    formulation: Formulation = "timoshenko",
    poisson_ratio: float = 0.3,
    left: End = "free",
    right: End = "free",
    section: Sequence[BeamSection] = (),
    point_mass: Sequence[BeamPointMass] = (),
    point_spring: Sequence[BeamPointSpring] = (),
    modal_ratio: float | Sequence[float] | None = None,
    name: str = "beam",
) -> StructuralModel:
    """Build a straight beam along x that bends in z.

    Parameters
    ----------
    length_m, width_m, thickness_m : float
        m; the beam bends about its width.
    youngs_modulus_Pa, density_kg_m3, poisson_ratio : float
        Material.
    elements : int
        Elements of equal length; nodes are 1 to elements + 1 from the left.
    formulation : str
        ``timoshenko`` or ``euler-bernoulli``.
    left, right : str
        How an end is held: ``clamped``, ``pinned``, ``sliding`` or ``free``.
    section : sequence of BeamSection
        Other cross-sections of some elements.
    point_mass, point_spring : sequence of BeamPointMass and of BeamPointSpring
        At nodes.
    modal_ratio : float or sequence of float, optional
        Damping ratios of the modes that are no rigid-body motion; the last one holds for all further modes.
    name : str
        What it is called.

    Returns
    -------
    StructuralModel
        DOFs ``z`` and ``ry`` of every node.

    Raises
    ------
    InputError
        If a value is out of range, or an element or a node does not exist.

    Examples
    --------
    >>> beam = make_beam(
    ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, left="clamped"
    ... )
    >>> beam.dofs[-2].name
    '101:z'
    """
    options = {
        "length_m": length_m, "width_m": width_m, "thickness_m": thickness_m, "youngs_modulus_Pa": youngs_modulus_Pa,
        "density_kg_m3": density_kg_m3, "elements": elements, "formulation": formulation,
        "poisson_ratio": poisson_ratio, "left": left, "right": right, "section": tuple(section),
        "point_mass": tuple(point_mass), "point_spring": tuple(point_spring),
    }  # fmt: skip
    table: dict[str, object] = {"model": {"kind": KIND, "name": name}, "beam": options}
    if modal_ratio is not None:
        table["damping"] = {"modal_ratio": modal_ratio}
    source = Path("make_beam")
    return read(to_options(table, BeamFile, source), source)


def build_beam(file: BeamFile) -> StructuralModel:
    """Build a beam from options that have been checked.

    Parameters
    ----------
    file : BeamFile
        Options of the whole file; stored as the model's `source`.

    Returns
    -------
    StructuralModel
        The beam with its elements, point masses and springs as parts.
    """
    beam = file.beam
    dofs = tuple(Dof(node, direction) for node in range(1, beam.elements + 2) for direction in DIRECTIONS)
    parts = (*element_parts(beam), *_point_parts(beam))
    mass, stiffness = assemble_mass_and_stiffness(parts, len(dofs))
    modal_damping, damping = stated_damping(file.damping, mass, stiffness)
    return StructuralModel(
        name=file.model.name,
        kind=KIND,
        all_dofs=dofs,
        fixed=_is_held(beam, dofs),
        mass_all=mass,
        stiffness_all=stiffness,
        damping_all=damping,
        modal_damping=modal_damping,
        geometry=_geometry(beam),
        parts=parts,
        source=file,
    )


def beam_elements(beam: BeamOptions) -> BeamElements:
    """Properties of a beam's elements.

    Parameters
    ----------
    beam : BeamOptions
        The beam.

    Returns
    -------
    BeamElements
        One number an element.
    """
    width, thickness = np.full(beam.elements, beam.width_m), np.full(beam.elements, beam.thickness_m)
    for section in beam.section:
        elements = slice(section.elements[0] - 1, section.elements[1])
        width[elements] = section.width_m or beam.width_m
        thickness[elements] = section.thickness_m or beam.thickness_m
    length = np.full(beam.elements, beam.length_m / beam.elements)
    area, second_moment = width * thickness, width * thickness**3 / 12
    bending = beam.youngs_modulus_Pa * second_moment
    shear_modulus = beam.youngs_modulus_Pa / (2 * (1 + beam.poisson_ratio))
    shear = shear_coefficient(beam.poisson_ratio) * shear_modulus * area
    is_timoshenko = float(beam.formulation == "timoshenko")
    return BeamElements(
        length=length,
        bending_stiffness=bending,
        shear_parameter=is_timoshenko * 12 * bending / (shear * length**2),
        mass_per_length=beam.density_kg_m3 * area,
        rotary_inertia_per_length=is_timoshenko * beam.density_kg_m3 * second_moment,
    )


def element_parts(beam: BeamOptions) -> list[Part]:
    """Elements of a beam as parts of a model.

    Parameters
    ----------
    beam : BeamOptions
        The beam.

    Returns
    -------
    list of Part
        Named by their numbers, from 1 at the left.
    """
    elements = beam_elements(beam)
    shares = zip(stiffness_matrices(elements), mass_matrices(elements), strict=True)
    return [
        Part(
            kind="element",
            name=str(number),
            nodes=(number, number + 1),
            indices=np.arange(2 * number - 2, 2 * number + 2),
            stiffness=stiffness,
            mass=mass,
        )
        for number, (stiffness, mass) in enumerate(shares, start=1)
    ]


def _point_parts(beam: BeamOptions) -> list[Part]:
    masses = [
        _point_part("mass", number, mass.node, mass=(mass.mass_kg, mass.rotary_inertia_kgm2))
        for number, mass in enumerate(beam.point_mass, start=1)
    ]
    springs = [
        _point_part("spring", number, spring.node, stiffness=(spring.stiffness_N_m, spring.rotational_stiffness_Nm_rad))
        for number, spring in enumerate(beam.point_spring, start=1)
    ]
    return masses + springs


def _point_part(
    what: str,
    number: int,
    node: int,
    *,
    mass: tuple[float, float] = (0.0, 0.0),
    stiffness: tuple[float, float] = (0.0, 0.0),
) -> Part:
    return Part(
        kind="point",
        name=f"{what} {number} at node {node}",
        nodes=(node,),
        indices=_rows(node),
        stiffness=np.diag(stiffness),
        mass=np.diag(mass),
    )


def _rows(node: int) -> IntArray:
    return np.arange(2 * node - 2, 2 * node)


def _is_held(beam: BeamOptions, dofs: tuple[Dof, ...]) -> BoolArray:
    held = {Dof(1, direction) for direction in HELD[beam.left]}
    held |= {Dof(beam.elements + 1, direction) for direction in HELD[beam.right]}
    return np.array([dof in held for dof in dofs])


def _geometry(beam: BeamOptions) -> Geometry:
    nodes = np.arange(1, beam.elements + 2)
    coordinates = np.zeros((len(nodes), 3))
    coordinates[:, 0] = np.linspace(0.0, beam.length_m, len(nodes))
    ends = {1: beam.left, beam.elements + 1: beam.right}
    return Geometry(
        nodes=nodes,
        coordinates_m=coordinates,
        lines=np.stack([nodes[:-1], nodes[1:]], 1),
        supports={node: how for node, how in ends.items() if how != "free"},
    )


def _check_sections(beam: BeamOptions, path: Path) -> None:
    section_of: dict[int, int] = {}
    for number, section in enumerate(beam.section, start=1):
        where = f"key 'beam.section.[{number}]'"
        first, last = section.elements
        if first > last or last > beam.elements:
            raise FileFormatError(
                path, f"elements {first} to {last} are not in the beam, which has 1 to {beam.elements}", where=where
            )
        if section.thickness_m is None and section.width_m is None:
            raise FileFormatError(path, "changes nothing; give thickness_m or width_m", where=where)
        shared = section_of.keys() & range(first, last + 1)
        if shared:
            raise FileFormatError(
                path,
                f"element {min(shared)} is in section {section_of[min(shared)]} too; sections must not overlap",
                where=where,
            )
        section_of |= dict.fromkeys(range(first, last + 1), number)


def _check_points(beam: BeamOptions, path: Path) -> None:
    keys = [(f"point_mass.[{number}]", mass.node) for number, mass in enumerate(beam.point_mass, start=1)]
    keys += [(f"point_spring.[{number}]", spring.node) for number, spring in enumerate(beam.point_spring, start=1)]
    for key, node in keys:
        if node > beam.elements + 1:
            raise FileFormatError(
                path,
                f"there is no node {node}; the beam has nodes 1 to {beam.elements + 1}",
                where=f"key 'beam.{key}.node'",
            )
    for number, spring in enumerate(beam.point_spring, start=1):
        if not (spring.stiffness_N_m or spring.rotational_stiffness_Nm_rad):
            raise FileFormatError(
                path,
                "has no stiffness; give stiffness_N_m or rotational_stiffness_Nm_rad",
                where=f"key 'beam.point_spring.[{number}]'",
            )
