"""A shape in the plane: where points stand and how far each moves, for the page's script to animate."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.show.pictures.shapes import Motion, Shape
    from frf_ipz.structure import Geometry

FLAT = 1e-6  # of the largest extent: thinner than this is flat
MOST_NODES = 3000  # that are drawn; of more, some
REACH = 0.16  # of the largest extent: how far the drawing moves at most
MOST_BEYOND = 3.0  # a model that moves more than this many times what was measured leaves the drawing
TALL = 1.25  # of the drawing against what moves in it
BESIDE = 0.15  # of the margin above: a row of nodes moves upwards only
AXES = {"x": 0, "y": 1, "z": 2}


def draw_shape(shape: Shape, geometry: Geometry | None) -> dict[str, Any]:
    """Put a shape on the plane.

    Parameters
    ----------
    shape : Shape
        Measured and models.
    geometry : Geometry, optional
        Where the nodes are; without it they stand in a row.

    Returns
    -------
    dict
        ``title``, ``lines`` as pairs of points, ``frame`` (left, top, width, height), ``motions``, each with its
        points, ``at`` and ``move`` (real and imaginary part across and up), and whether it has ``lines``.
    """
    nodes, positions, lines = _plan(geometry, shape.motions)
    is_row = not np.ptp(positions[:, 1:]) if len(nodes) else True
    extent = (float(np.ptp(positions, axis=0).max()) if len(nodes) else 0.0) or 1.0
    place = {int(node): row for row, node in enumerate(nodes)}
    moves = [_move(motion, place, is_row=is_row) for motion in shape.motions]
    scale = _scale(shape, [move for _, move in moves], extent)
    ground = _project(positions, is_row=is_row)
    drawn = [
        {
            "name": motion.name,
            "title": motion.title,
            "at": _digits(ground[rows], extent),
            "move": _digits(np.concatenate([scale * move.real, scale * move.imag], axis=1), extent),
            "nodes": [int(node) for node in nodes[rows]],
            "hasLines": len(rows) == len(nodes),
        }
        for motion, (rows, move) in zip(shape.motions, moves, strict=True)
    ]
    return {
        "title": shape.title,
        "ground": _digits(ground, extent),
        "lines": [[place[int(a)], place[int(b)]] for a, b in lines if int(a) in place and int(b) in place],
        "frame": _frame(ground, extent, is_row=is_row),
        "motions": drawn,
    }


def _plan(geometry: Geometry | None, motions: Sequence[Motion]) -> tuple[IntArray, FloatArray, IntArray]:
    """Nodes, their positions in space, and lines as pairs of nodes."""
    if geometry is None:
        nodes = np.array(sorted({dof.node for motion in motions for dof in motion.dofs if dof.node > 0}), int)
        positions = np.zeros((len(nodes), 3))
        positions[:, 0] = nodes
        return nodes, positions, np.stack([nodes[:-1], nodes[1:]], 1)
    if len(geometry.nodes) <= MOST_NODES:
        return geometry.nodes, geometry.coordinates_m, geometry.lines
    measured = {dof.node for motion in motions if motion.name == "measured" for dof in motion.dofs}
    some = np.isin(geometry.nodes, list(measured))
    some[:: -(-len(geometry.nodes) // MOST_NODES)] = True
    return geometry.nodes[some], geometry.coordinates_m[some], geometry.lines


def _move(motion: Motion, place: dict[int, int], *, is_row: bool) -> tuple[IntArray, ComplexArray]:
    """Which points move, and how, across and up. In a row of nodes all motion is drawn upwards."""
    moved: dict[int, ComplexArray] = {}
    for dof, value in zip(motion.dofs, motion.values, strict=True):
        if dof.direction in AXES and dof.node in place:
            moved.setdefault(place[dof.node], np.zeros(3, complex))[AXES[dof.direction]] = value
    if len(moved) > len(place) / 2:  # a model that knows nearly all nodes: the others are held
        moved = {row: moved.get(row, np.zeros(3, complex)) for row in place.values()}
    rows = sorted(moved)
    space = np.array([moved[row] for row in rows], complex).reshape(-1, 3)
    if is_row:
        axis = int(np.argmax(np.abs(space).sum(axis=0)))
        space = np.stack([np.zeros(len(space)), space[:, axis], np.zeros(len(space))], 1)
    return np.array(rows, int), _project(space, is_row=is_row)


def _project(points: Any, *, is_row: bool) -> Any:  # noqa: ANN401  positions are real, motions complex
    x, y, z = points.T
    if is_row:
        return np.stack([x, y], 1)
    return np.stack([(x - y) * np.cos(np.pi / 6), z + (x + y) * np.sin(np.pi / 6)], 1)


def _scale(shape: Shape, moves: Sequence[ComplexArray], extent: float) -> float:
    """Metres drawn for a motion of 1: a model that is far off must not leave the measurement without a visible one."""
    sizes = {
        motion.name: float(np.abs(move).max(initial=0.0)) for motion, move in zip(shape.motions, moves, strict=True)
    }
    largest = min(max(sizes.values(), default=0.0), MOST_BEYOND * sizes.get("measured", np.inf))
    return REACH * extent / largest if largest > 0 else 0.0


def _frame(ground: FloatArray, extent: float, *, is_row: bool) -> list[float]:
    if not len(ground):
        return [0.0, 0.0, 1.0, 1.0]
    margin = TALL * REACH * extent * np.array([BESIDE if is_row else 1.0, 1.0])
    low, high = ground.min(axis=0) - margin, ground.max(axis=0) + margin
    return [float(low[0]), float(low[1]), float(high[0] - low[0]), float(high[1] - low[1])]


def _digits(values: FloatArray, extent: float) -> list[list[float]]:
    """Numbers with the digits that a screen can show."""
    digits = max(0, 4 - int(np.floor(np.log10(extent))))
    return [[round(float(value), digits) for value in row] for row in values]
