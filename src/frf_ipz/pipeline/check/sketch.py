"""The structure of a model as a drawing in characters, with sensors, inputs and points of interest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.dofs import node_dofs

if TYPE_CHECKING:
    from collections.abc import Iterable

    from frf_ipz.arrays import FloatArray
    from frf_ipz.dofs import AnyDof
    from frf_ipz.structure import Geometry

WIDTH = 72
HEIGHT = 18
MARKS = {"node": "-", "support": "#", "sensor": "S", "input": "F", "both": "X", "point": "*"}
FLAT = 1e-6  # of the largest extent: a structure thinner than this is a line


def draw(
    geometry: Geometry, sensors: Iterable[AnyDof], inputs: Iterable[AnyDof], points: Iterable[AnyDof]
) -> list[str]:
    """Draw a structure in characters.

    Parameters
    ----------
    geometry : Geometry
        Where the nodes are.
    sensors, inputs, points : iterable of Dof
        What to mark.

    Returns
    -------
    list of str
        Lines of text.
    """
    columns, rows = _places(geometry.coordinates_m)
    canvas = [[" "] * WIDTH for _ in range(int(rows.max()) + 1)]
    place = {int(node): index for index, node in enumerate(geometry.nodes)}
    excited, sensed = {dof.node for dof in node_dofs(inputs)}, {dof.node for dof in node_dofs(sensors)}
    marks = dict.fromkeys(place, MARKS["node"]) | {
        node: MARKS["support"] for node in geometry.supports if node in place
    }
    marks |= {dof.node: MARKS["point"] for dof in node_dofs(points)}
    marks |= {node: MARKS["both" if node in sensed else "input"] for node in excited}
    marks |= dict.fromkeys(sensed - excited, MARKS["sensor"])
    for node in sorted(marks, key=lambda node: marks[node] != MARKS["node"]):
        if node in place:
            canvas[rows[place[node]]][columns[place[node]]] = marks[node]
    return ["".join(row).rstrip() for row in canvas]


def _places(coordinates: FloatArray) -> tuple[np.ndarray, np.ndarray]:
    """Columns and rows of the nodes, looking along the direction in which the structure is thinnest."""
    extent = np.ptp(coordinates, axis=0)
    across, up = np.argsort(-extent, kind="stable")[:2]
    largest = max(float(extent[across]), np.finfo(float).tiny)
    columns = (coordinates[:, across] - coordinates[:, across].min()) / largest * (WIDTH - 1)
    height = extent[up] / largest
    rows = np.zeros(len(coordinates))
    if height > FLAT:
        rows = (coordinates[:, up].max() - coordinates[:, up]) / extent[up] * min(HEIGHT, max(2, height * WIDTH / 2))
    return np.rint(columns).astype(int), np.rint(rows).astype(int)
