"""``kind = "lumped"``: point masses joined by springs and dampers, moving in one direction."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from frf_ipz.dofs import GROUND, Dof
from frf_ipz.errors import FileFormatError
from frf_ipz.fe.assembly import assemble, assemble_mass_and_stiffness, stated_damping
from frf_ipz.fe.model_options import DampingSection, ModelSection, PortSection
from frf_ipz.option_types import Name, Node, NodeOrGround, NotNegative, Positive
from frf_ipz.structure import Geometry, Part, StructuralModel
from frf_ipz.toml_files import STRICT

if TYPE_CHECKING:
    from pathlib import Path

    from frf_ipz.arrays import IntArray

KIND = "lumped"
DIFFERENCE = np.array([[1.0, -1.0], [-1.0, 1.0]])


@dataclass(frozen=True, slots=True, kw_only=True)
class LumpedMass:
    """``[[lumped.mass]]``: a node and its mass.

    Parameters
    ----------
    node : int
        Its number.
    mass_kg : float
        Its mass.
    """

    __pydantic_config__ = STRICT

    node: Node
    mass_kg: Positive


@dataclass(frozen=True, slots=True, kw_only=True)
class LumpedSpring:
    """``[[lumped.spring]]``: a spring, and a damper beside it.

    Parameters
    ----------
    id : str
        Its name.
    nodes : pair of int
        The nodes it joins; 0 is the ground.
    stiffness_N_m : float
        Of the spring.
    damping_Ns_m : float
        Of the damper.
    """

    __pydantic_config__ = STRICT

    id: Name
    nodes: tuple[NodeOrGround, NodeOrGround]
    stiffness_N_m: NotNegative  # noqa: N815 - the contract's key
    damping_Ns_m: NotNegative = 0.0  # noqa: N815 - the contract's key


@dataclass(frozen=True, slots=True, kw_only=True)
class LumpedOptions:
    """``[lumped]``: nodes that move in one direction.

    Parameters
    ----------
    mass : tuple of LumpedMass
        The nodes.
    spring : tuple of LumpedSpring
        The springs between them.
    direction : str
        The direction in which all of them move.
    """

    __pydantic_config__ = STRICT

    mass: tuple[LumpedMass, ...]
    spring: tuple[LumpedSpring, ...] = ()
    direction: Literal["x", "y", "z"] = "x"


@dataclass(frozen=True, slots=True, kw_only=True)
class LumpedFile:
    """A whole ``model.toml`` of a lumped model.

    Parameters
    ----------
    model : ModelSection
        ``[model]``.
    lumped : LumpedOptions
        ``[lumped]``.
    damping : DampingSection, optional
        ``[damping]``.
    port : tuple of PortSection
        ``[[port]]``.
    """

    __pydantic_config__ = STRICT

    model: ModelSection
    lumped: LumpedOptions
    damping: DampingSection | None = None
    port: tuple[PortSection, ...] = ()


FILE = LumpedFile


def files(file: LumpedFile, path: Path) -> tuple[Path, ...]:
    """Files besides ``model.toml``: none.

    Parameters
    ----------
    file : LumpedFile
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


def read(file: LumpedFile, path: Path) -> StructuralModel:
    """Check the keys against each other, and build the model.

    The ground is a DOF that is held, so that every spring has its two ends among the DOFs.

    Parameters
    ----------
    file : LumpedFile
        Content of ``model.toml``.
    path : Path
        Its path, for messages.

    Returns
    -------
    StructuralModel
        The model with its masses and springs as parts.

    Raises
    ------
    FileFormatError
        If a node or an id is given twice, or a spring ends at a node that does not exist.
    """
    lumped = file.lumped
    _check(lumped, path)
    nodes = sorted({mass.node for mass in lumped.mass} | {node for spring in lumped.spring for node in spring.nodes})
    row_of = {node: index for index, node in enumerate(nodes)}
    parts = (*_mass_parts(lumped, row_of), *_spring_parts(lumped, row_of))
    mass, stiffness = assemble_mass_and_stiffness(parts, len(nodes))
    modal_damping, damping = stated_damping(file.damping, mass, stiffness)
    dampers = [
        (_rows(spring, row_of), spring.damping_Ns_m * DIFFERENCE) for spring in lumped.spring if spring.damping_Ns_m
    ]
    return StructuralModel(
        name=file.model.name,
        kind=KIND,
        all_dofs=tuple(Dof(node, lumped.direction) for node in nodes),
        fixed=np.array([node == GROUND for node in nodes]),
        mass_all=mass,
        stiffness_all=stiffness,
        damping_all=damping + assemble(dampers, len(nodes)),
        modal_damping=modal_damping,
        geometry=_geometry(lumped, nodes),
        parts=parts,
        source=file,
    )


def _mass_parts(lumped: LumpedOptions, row_of: dict[int, int]) -> list[Part]:
    return [
        Part(
            kind="point",
            name=f"mass at node {mass.node}",
            nodes=(mass.node,),
            indices=np.array([row_of[mass.node]]),
            stiffness=np.zeros((1, 1)),
            mass=np.array([[mass.mass_kg]]),
        )
        for mass in lumped.mass
    ]


def _spring_parts(lumped: LumpedOptions, row_of: dict[int, int]) -> list[Part]:
    return [
        Part(
            kind="spring",
            name=spring.id,
            nodes=spring.nodes,
            indices=_rows(spring, row_of),
            stiffness=spring.stiffness_N_m * DIFFERENCE,
            mass=np.zeros((2, 2)),
        )
        for spring in lumped.spring
    ]


def _rows(spring: LumpedSpring, row_of: dict[int, int]) -> IntArray:
    return np.array([row_of[node] for node in spring.nodes])


def _geometry(lumped: LumpedOptions, nodes: list[int]) -> Geometry:
    coordinates = np.zeros((len(nodes), 3))
    coordinates[:, 0] = np.arange(len(nodes))
    return Geometry(
        nodes=np.array(nodes),
        coordinates_m=coordinates,
        lines=np.array([spring.nodes for spring in lumped.spring], dtype=np.int64).reshape(-1, 2),
        supports={node: "ground" for node in nodes if node == GROUND},
        is_schematic=True,
    )


def _check(lumped: LumpedOptions, path: Path) -> None:
    if not lumped.mass:
        raise FileFormatError(path, "there is no mass; give at least one [[lumped.mass]]", where="key 'lumped.mass'")
    repeated_node = _first_repeated([str(mass.node) for mass in lumped.mass])
    if repeated_node is not None:
        raise FileFormatError(
            path, f"node {repeated_node} has two masses; give their sum once", where="key 'lumped.mass'"
        )
    repeated_id = _first_repeated([spring.id for spring in lumped.spring])
    if repeated_id is not None:
        raise FileFormatError(path, f"two springs are called '{repeated_id}'; rename one", where="key 'lumped.spring'")
    known = {mass.node for mass in lumped.mass} | {GROUND}
    for number, spring in enumerate(lumped.spring, start=1):
        _check_spring(spring, known, path, f"key 'lumped.spring.[{number}].nodes'")


def _check_spring(spring: LumpedSpring, known: set[int], path: Path, where: str) -> None:
    if spring.nodes[0] == spring.nodes[1]:
        raise FileFormatError(path, f"spring '{spring.id}' has both its ends at node {spring.nodes[0]}", where=where)
    for node in spring.nodes:
        if node not in known:
            raise FileFormatError(
                path,
                f"spring '{spring.id}' ends at node {node}, which has no mass; nodes are {sorted(known)} (0 is ground)",
                where=where,
            )


def _first_repeated(items: list[str]) -> str | None:
    return next((item for item, times in Counter(items).items() if times > 1), None)
