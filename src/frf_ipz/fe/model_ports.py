"""``[[port]]`` of ``model.toml``: sums of DOFs, and points of the mesh, as ports of a model."""

from __future__ import annotations

from typing import TYPE_CHECKING

from frf_ipz.dofs import DIRECTIONS, Port
from frf_ipz.errors import FileFormatError, InputError
from frf_ipz.fe.mesh_points import interpolate_motion

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from frf_ipz.fe.model_options import PortSection
    from frf_ipz.structure import StructuralModel

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
ANGLES = ("rx", "ry", "rz")


def with_stated_ports(model: StructuralModel, sections: Sequence[PortSection], path: Path) -> StructuralModel:
    """Add the ports of a file to its model.

    Parameters
    ----------
    model : StructuralModel
        The model.
    sections : sequence of PortSection
        Content of ``[[port]]``.
    path : Path
        ``model.toml``, for messages.

    Returns
    -------
    StructuralModel
        Which knows the ports.

    Raises
    ------
    FileFormatError
        If a port names a DOF that the model lacks, lies outside its mesh, or has a name or a unit that does not fit.
    """
    for section in sections:
        try:
            model = model.with_ports([_make_port(model, section)])
        except InputError as error:
            raise FileFormatError(path, str(error), where=f"[[port]] '{section.name}'") from None
    return model


def _make_port(model: StructuralModel, section: PortSection) -> Port:
    if section.dofs is not None:
        return Port(section.name, section.dofs, section.unit or "m")
    point, direction = section.point_m or (0.0, 0.0, 0.0), section.direction
    if not isinstance(direction, str):
        return _checked(section, Port(section.name, interpolate_motion(model, point, direction or (0.0, 0.0, 0.0))))
    sign, along = -1.0 if direction.startswith("-") else 1.0, direction.lstrip("+-")
    if along not in DIRECTIONS or len(direction) - len(along) > 1:
        raise InputError(
            f"'{direction}' is no direction; expected is one of {', '.join(DIRECTIONS)}, with a sign or without, or a "
            "vector such as [0.6, 0.0, 0.8]"
        )
    motion = interpolate_motion(model, point, AXES.get(along, along))
    unit = "rad" if along in ANGLES else "m"
    return _checked(section, Port(section.name, {dof: sign * weight for dof, weight in motion.items()}, unit))


def _checked(section: PortSection, port: Port) -> Port:
    if section.unit not in (None, port.unit):
        raise InputError(f"unit is '{section.unit}', but a motion along {section.direction} is in {port.unit}; omit it")
    return port
