"""Motion of a point between the nodes of a mesh, as weights of DOFs.

Between the nodes of the simplex that holds the point (an interval, a triangle or a tetrahedron of the Delaunay
triangulation of the nodes) the motion is linear; along a beam it is that of its elements. Motions as a rigid body are
exact.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from frf_ipz.arrays import FloatArray, IntArray
from frf_ipz.dofs import Dof
from frf_ipz.errors import InputError
from frf_ipz.fe.beam_models import deflection_row
from frf_ipz.late_imports import import_late

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from scipy import spatial

    from frf_ipz.structure import StructuralModel
else:
    spatial = import_late("scipy.spatial")

AXES = ("x", "y", "z")
PRINTED = (
    1e-6  # of the extent: coordinates are printed with six or seven digits, and are no farther from what was meant
)
DETERMINED = 1e-6  # of a unit rotation: what nodes that do not lie exactly on a line or a plane leave open


def interpolate_motion(
    model: StructuralModel, point_m: Sequence[float], direction: Sequence[float] | str
) -> Mapping[Dof, float]:
    """Find the weights of DOFs in the motion of a point.

    Parameters
    ----------
    model : StructuralModel
        The model.
    point_m : (3,) sequence of float
        Where, m.
    direction : (3,) sequence of float or str
        A vector along which the motion is taken, or ``rx``, ``ry``, ``rz`` for the rotation about an axis: that of the
        nodes, where they have one, else of the rigid body that follows the motions of the nodes around best.

    Returns
    -------
    mapping of Dof to float
        Weights; 1/m where a rotation follows from motions.

    Raises
    ------
    InputError
        If the point is not in the mesh, or the nodes around do not determine the motion.

    Examples
    --------
    >>> import frf_ipz
    >>> beam = frf_ipz.make_beam(
    ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=10,
    ...     left="clamped",
    ... )
    >>> motion = interpolate_motion(beam, (0.475, 0.0, 0.0), (0.0, 0.0, 1.0))
    >>> {dof.name: round(weight, 3) for dof, weight in motion.items()}
    {'10:z': 0.5, '10:ry': -0.006, '11:z': 0.5, '11:ry': 0.006}
    """
    if model.geometry.is_schematic or model.kind == "lumped":
        raise InputError("the nodes of this model have no positions; give 'dofs' with weights in place of a point")
    corners = _corners(model, np.asarray(point_m, float))
    if isinstance(direction, str):
        return _rotation(model, corners, direction)
    along = np.asarray(direction, float)
    size = float(np.linalg.norm(along))
    if not size:
        raise InputError("the direction is a vector of zeros; give the one along which the motion is measured")
    along = along / size
    if model.kind == "beam" and np.array_equal(np.abs(along), [0.0, 0.0, 1.0]):
        row = along[2] * deflection_row(model, float(np.clip(point_m[0], *corners.span_m)))
        return {model.all_dofs[index]: float(row[index]) for index in np.flatnonzero(row).tolist()}
    weights = {
        Dof(node, axis): share * part
        for node, share in corners.shares()
        for axis, part in zip(AXES, along.tolist(), strict=True)
        if part
    }
    return _existing(model, weights)


class _Corners:
    """Nodes of the simplex around a point, and their shares in its motion."""

    def __init__(self, nodes: IntArray, offsets_m: FloatArray, barycentric: FloatArray, span_m: FloatArray) -> None:
        self.nodes, self.offsets_m, self.span_m = nodes, offsets_m, span_m
        self._shares = np.where(np.abs(barycentric) > PRINTED, barycentric, 0.0)

    def shares(self) -> list[tuple[int, float]]:
        """Nodes that take part, and how much."""
        pairs = zip(self.nodes.tolist(), self._shares.tolist(), strict=True)
        return [(node, share) for node, share in pairs if share]


def _corners(model: StructuralModel, point_m: FloatArray) -> _Corners:
    geometry = model.geometry
    known = {dof.node for dof in (*model.all_dofs, *model.held_dofs)}
    used = np.flatnonzero(np.isin(geometry.nodes, list(known)))
    nodes, positions = geometry.nodes[used], geometry.coordinates_m[used]
    origin = positions.mean(axis=0)
    _, sizes, axes = np.linalg.svd(positions - origin, full_matrices=False)
    extent = float(np.ptp(positions, axis=0).max())
    axes = axes[sizes > PRINTED * max(float(sizes.max()), np.finfo(float).tiny)]
    flat, here = (positions - origin) @ axes.T, axes @ (point_m - origin)
    beside = float(np.linalg.norm(point_m - origin - here @ axes))
    if beside > PRINTED * extent:
        raise _outside(model, point_m, f"it lies {beside:.3g} m beside the {('line', 'plane')[len(axes) - 1]} of nodes")
    places, barycentric = _simplex(flat, here) if len(axes) > 1 else _interval(flat[:, 0], float(here[0]))
    if not places.size:
        nearest = int(np.argmin(np.linalg.norm(positions - point_m, axis=1)))
        raise _outside(model, point_m, f"the nearest node is {nodes[nearest]} at {_text(positions[nearest])} m")
    taking_part = nodes[places[np.abs(barycentric) > PRINTED]]
    apart = _apart(model, taking_part.tolist())
    if apart:
        raise _outside(model, point_m, f"it lies in a gap, since nothing joins nodes {apart[0]} and {apart[1]}")
    span = np.array([positions[:, 0].min(), positions[:, 0].max()])
    return _Corners(nodes[places], positions[places] - point_m, barycentric, span)


def _interval(positions: FloatArray, here: float) -> tuple[IntArray, FloatArray]:
    order = np.argsort(positions)
    tolerance = PRINTED * float(np.ptp(positions))
    if not positions[order[0]] - tolerance <= here <= positions[order[-1]] + tolerance:
        return np.zeros(0, np.int64), np.zeros(0)
    above = int(np.clip(np.searchsorted(positions[order], here), 1, len(order) - 1))
    ends = order[above - 1 : above + 1]
    share = float(np.clip((here - positions[ends[0]]) / (positions[ends[1]] - positions[ends[0]]), 0.0, 1.0))
    return ends, np.array([1.0 - share, share])


def _simplex(positions: FloatArray, here: FloatArray) -> tuple[IntArray, FloatArray]:
    try:
        mesh = spatial.Delaunay(positions)
    except spatial.QhullError:
        raise InputError("the nodes span no mesh in which a point could lie; give 'dofs' with weights") from None
    found = int(mesh.find_simplex(here, tol=PRINTED))
    if found < 0:
        return np.zeros(0, np.int64), np.zeros(0)
    transform = mesh.transform[found]
    leading = transform[:-1] @ (here - transform[-1])
    barycentric = np.clip(np.append(leading, 1.0 - leading.sum()), 0.0, 1.0)
    return np.asarray(mesh.simplices[found], np.int64), barycentric / barycentric.sum()


def _apart(model: StructuralModel, nodes: Sequence[int]) -> tuple[int, int] | None:
    """Two nodes that no element joins, nor two elements that share a node."""
    moving = [node for node in nodes if any(dof.node == node for dof in model.all_dofs)]
    number = {node: place for place, node in enumerate(dict.fromkeys(dof.node for dof in model.all_dofs))}
    members = np.array([number[dof.node] for dof in model.all_dofs])
    gather = sparse.csr_array((np.ones(len(members)), (np.arange(len(members)), members)))
    chosen = np.flatnonzero(np.isin(members, [number[node] for node in moving]))
    reached = (abs(sparse.csr_array(model.stiffness_all))[chosen] @ gather).toarray() > 0
    by_node = {node: reached[members[chosen] == number[node]].any(axis=0) for node in moving}
    for place, first in enumerate(moving):
        for second in moving[:place]:
            if not (by_node[first] & by_node[second]).any():
                return second, first
    return None


def _rotation(model: StructuralModel, corners: _Corners, about: str) -> dict[Dof, float]:
    held, shares = set(model.held_dofs), corners.shares()
    if all(Dof(node, about) in model.full_indices or Dof(node, about) in held for node, _ in shares):
        return {Dof(node, about): share for node, share in shares}
    dofs, rows = [], []
    for node, offset in zip(corners.nodes.tolist(), corners.offsets_m, strict=True):
        for axis, name in enumerate(AXES):
            if Dof(node, name) in model.full_indices or Dof(node, name) in held:
                dofs.append(Dof(node, name))
                rows.append(np.concatenate([np.eye(3)[axis], np.cross(np.eye(3), offset)[:, axis]]))
    motion = np.array(rows)
    size = max(float(np.linalg.norm(corners.offsets_m, axis=1).max()), np.finfo(float).tiny)
    scale = np.array([1.0, 1.0, 1.0, size, size, size])
    inverse = np.linalg.pinv(motion / scale, rcond=DETERMINED) / scale[:, None]
    row = 3 + ("rx", "ry", "rz").index(about)
    if not np.allclose((inverse @ motion)[row] * scale / size, np.eye(6)[row], rtol=0, atol=DETERMINED):
        raise InputError(
            f"the motions of nodes {', '.join(map(str, corners.nodes))} do not determine a rotation {about}"
        )
    return {dof: float(weight) for dof, weight in zip(dofs, inverse[row], strict=True) if weight}


def _existing(model: StructuralModel, weights: dict[Dof, float]) -> dict[Dof, float]:
    """Refuse a direction in which a node has no DOF."""
    held = set(model.held_dofs)
    for dof in weights:
        if dof not in held:
            model.full_index(dof)
    return weights


def _outside(model: StructuralModel, point_m: FloatArray, reason: str) -> InputError:
    return InputError(
        f"the point {_text(point_m)} m is outside the mesh of the model '{model.name}': {reason}; correct point_m (in "
        "m), or give 'dofs' with weights"
    )


def _text(position_m: FloatArray) -> str:
    return "[" + ", ".join(f"{value:g}" for value in position_m.tolist()) + "]"
