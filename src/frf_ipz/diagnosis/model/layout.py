"""Which motions are measured and excited, and in which directions sensors and excited points may be misplaced."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray, IntArray
from frf_ipz.dofs import AnyDof, Dof
from frf_ipz.fe.beam_models import shear_slope_at, slope_row

if TYPE_CHECKING:
    from frf_ipz.frf import FrfLabel
    from frf_ipz.structure import StructuralModel

AXES = ("x", "y", "z")
ROTATION = {("z", "x"): ("ry", -1.0), ("z", "y"): ("rx", 1.0), ("y", "x"): ("rz", 1.0),
            ("y", "z"): ("rx", -1.0), ("x", "y"): ("rz", -1.0), ("x", "z"): ("ry", 1.0)}  # fmt: skip
NEIGHBOURS = 6  # from which the slope of a motion is read, where a model has no rotations
FLAT = 1e-6  # of the largest extent: a structure has no extent in such a direction


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Layout:
    """Sensors and excited points of a test.

    Parameters
    ----------
    outputs : tuple of (str, Dof)
        Channel and DOF of each sensor position; one channel may have several.
    inputs : tuple of Dof
        Excited DOFs.
    input_channels : tuple of str
        Column of the force at each of them; the same for all, but for FRFs that were estimated elsewhere.
    output_index, input_index : (n_frfs,) int array
        Indices of the output and the input that each FRF connects.
    power : (n_frfs,) int array
        Power of s that makes a receptance the measured quantity.
    """

    outputs: tuple[tuple[str, AnyDof], ...]
    inputs: tuple[AnyDof, ...]
    input_channels: tuple[str, ...]
    output_index: IntArray
    input_index: IntArray
    power: IntArray

    @property
    def channels(self) -> tuple[str, ...]:
        """All channels, the force first."""
        return tuple(dict.fromkeys((*self.input_channels, *(channel for channel, _ in self.outputs))))

    @property
    def dofs(self) -> tuple[AnyDof, ...]:
        """Where sensors are, then excited points."""
        return (*(dof for _, dof in self.outputs), *self.inputs)

    @property
    def gain_signs(self) -> FloatArray:
        """How FRFs follow the gains of `channels`, (n_frfs, n_channels): outputs multiply (1), forces divide (-1)."""
        return _gain_signs(self)


@lru_cache(maxsize=4)  # a search asks for the same one at every step
def _gain_signs(layout: Layout) -> FloatArray:
    number = {channel: index for index, channel in enumerate(layout.channels)}
    signs = np.zeros((len(layout.output_index), len(number)))
    frf = np.arange(len(layout.output_index))
    signs[frf, np.array([number[channel] for channel, _ in layout.outputs])[layout.output_index]] = 1.0
    signs[frf, np.array([number[channel] for channel in layout.input_channels])[layout.input_index]] = -1.0
    signs.flags.writeable = False
    return signs


def make_layout(labels: Sequence[FrfLabel]) -> Layout:
    """List what FRFs connect.

    Parameters
    ----------
    labels : sequence of FrfLabel
        One an FRF.

    Returns
    -------
    Layout
        Each sensor position and each excited DOF once.
    """
    named = [(label.output_channel or f"output {label.output_dof}", label.output_dof) for label in labels]
    outputs = tuple(dict.fromkeys(named))
    excited = {label.input_dof: label.input_channel or f"input {label.input_dof}" for label in labels}
    inputs = tuple(excited)
    return Layout(
        outputs=outputs,
        inputs=inputs,
        input_channels=tuple(excited.values()),
        output_index=np.array([outputs.index(name) for name in named]),
        input_index=np.array([inputs.index(label.input_dof) for label in labels]),
        power=np.array([label.quantity.power for label in labels]),
    )


def make_motion_row(model: StructuralModel, dof: AnyDof) -> FloatArray:
    """Weights of all DOFs in the motion that a sensor at a DOF measures, with its sign.

    Parameters
    ----------
    model : StructuralModel
        The model.
    dof : Dof or PortDof
        The DOF.

    Returns
    -------
    (n_all,) array
        A single entry, or the weights of a port.
    """
    return np.asarray(model.full_rows([dof]).toarray()[0])


@lru_cache(maxsize=4)  # every hypothesis asks for it
def measure_extents(model: StructuralModel) -> Mapping[str, float]:
    """Size of a structure along each axis.

    Parameters
    ----------
    model : StructuralModel
        The model.

    Returns
    -------
    mapping of str to float
        m; axes along which it has no size are left out, and all of a lumped model, whose masses have no positions.
    """
    if model.kind == "lumped":
        return {}
    spans = np.ptp(model.geometry.coordinates_m, axis=0)
    return {axis: float(span) for axis, span in zip(AXES, spans, strict=True) if span > FLAT * spans.max()}


def make_shift_rows(model: StructuralModel, dof: AnyDof) -> dict[str, FloatArray]:
    """How the motion at a DOF changes with its position.

    Parameters
    ----------
    model : StructuralModel
        The model.
    dof : Dof or PortDof
        Of a sensor or an excited point.

    Returns
    -------
    dict of str to (n_all,) array
        For each axis along which it may be misplaced, weights of all DOFs in the derivative, 1/m.
    """
    if not isinstance(dof, Dof) or dof.direction not in AXES:
        return {}  # a port is defined by its weights: it has no place of its own
    axes = [axis for axis in measure_extents(model) if axis != dof.direction]
    return {axis: dof.sign * _shift_row(model, dof, axis) for axis in axes}


def list_turns(model: StructuralModel, dof: AnyDof) -> tuple[Dof, ...]:
    """List the DOFs of the same node towards which a direction may be turned.

    Parameters
    ----------
    model : StructuralModel
        The model.
    dof : Dof or PortDof
        Of a sensor or an excited point.

    Returns
    -------
    tuple of Dof
        None where the node moves in one direction only.
    """
    if not isinstance(dof, Dof) or dof.direction not in AXES:
        return ()  # the direction of a port is defined by its weights
    others = (Dof(dof.node, axis) for axis in AXES if axis != dof.direction)
    return tuple(other for other in others if other in model.full_indices)


def make_turn_rows(model: StructuralModel, dof: AnyDof) -> dict[str, FloatArray]:
    """How the motion at a DOF changes with its direction.

    Parameters
    ----------
    model : StructuralModel
        The model.
    dof : Dof or PortDof
        Of a sensor or an excited point.

    Returns
    -------
    dict of str to (n_all,) array
        For each direction of `list_turns`, weights of all DOFs in the derivative, 1/rad.
    """
    return {other.direction: make_motion_row(model, other) for other in list_turns(model, dof)}


def shear_slope_at_force(model: StructuralModel, dof: AnyDof) -> float:
    """How fast the motion falls on both sides of a force, by local shear.

    Parameters
    ----------
    model : StructuralModel
        The model.
    dof : Dof or PortDof
        Of the force.

    Returns
    -------
    float
        1/N; zero but for beams, where a force makes a corner.
    """
    if model.kind != "beam" or not isinstance(dof, Dof) or dof.direction not in AXES:
        return 0.0
    return shear_slope_at(
        model, float(model.geometry.coordinates_m[np.searchsorted(model.geometry.nodes, dof.node), 0])
    )


@lru_cache(maxsize=1024)  # every hypothesis asks for the same few
def _shift_row(model: StructuralModel, dof: Dof, axis: str) -> FloatArray:
    geometry = model.geometry
    position = geometry.coordinates_m[np.searchsorted(geometry.nodes, dof.node)]
    if model.kind == "beam":
        return slope_row(model, float(position[0]))
    row = np.zeros(len(model.all_dofs))
    rotation, sign = ROTATION[dof.direction, axis]
    if Dof(dof.node, rotation) in model.full_indices:
        row[model.full_indices[Dof(dof.node, rotation)]] = sign
        return row
    return _slope_from_neighbours(model, dof, AXES.index(axis))


def _slope_from_neighbours(model: StructuralModel, dof: Dof, axis: int) -> FloatArray:
    """Slope of a plane through the motion of the nearest nodes."""
    rows = [row for candidate, row in model.full_indices.items() if candidate.direction == dof.direction]
    nodes = np.array([model.all_dofs[row].node for row in rows])
    coordinates_m = model.geometry.coordinates_m[np.searchsorted(model.geometry.nodes, nodes)]
    here = coordinates_m[nodes == dof.node][0]
    distance = np.linalg.norm(coordinates_m - here, axis=1)
    nearest = np.argsort(distance)[: NEIGHBOURS + 1]
    offsets = (coordinates_m - here)[nearest]
    used = np.ptp(offsets, axis=0) > FLAT * distance[nearest].max()
    plane = np.hstack([np.ones((len(nearest), 1)), offsets[:, used]])
    row = np.zeros(len(model.all_dofs))
    if used[axis]:
        column = 1 + int(np.count_nonzero(used[:axis]))
        row[np.array(rows)[nearest]] = np.linalg.pinv(plane)[column]
    return row
