"""The surface of a mesh: faces of shells, and those faces of solids that no second solid has."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from frf_ipz.arrays import IntArray

LINE, TRIANGLE, QUADRILATERAL = "line", "triangle", "quadrilateral"
TETRAHEDRON, PYRAMID, WEDGE, HEXAHEDRON = "tetrahedron", "pyramid", "wedge", "hexahedron"
CORNERS = {LINE: 2, TRIANGLE: 3, QUADRILATERAL: 4, TETRAHEDRON: 4, PYRAMID: 5, WEDGE: 6, HEXAHEDRON: 8}
FACES = {  # places of corners: the base around, then the top around
    TRIANGLE: ((0, 1, 2),),
    QUADRILATERAL: ((0, 1, 2, 3),),
    TETRAHEDRON: ((0, 1, 2), (0, 1, 3), (1, 2, 3), (2, 0, 3)),
    PYRAMID: ((0, 1, 2, 3), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)),
    WEDGE: ((0, 1, 2), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
    HEXAHEDRON: ((0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)),
}
SOLIDS = (TETRAHEDRON, PYRAMID, WEDGE, HEXAHEDRON)
FEWEST, MOST = 3, 4  # corners of a face
NO_FACES = np.zeros((0, MOST), np.int64)


def outer_faces(elements: Iterable[tuple[str, Sequence[int]]]) -> IntArray:
    """Find the faces that can be seen.

    Parameters
    ----------
    elements : iterable of (str, sequence of int)
        Shape, and its corners: the base around, then the top around. A corner may stand there twice, where a brick
        has been made a wedge.

    Returns
    -------
    (n_faces, 4) int array
        Corners around; the last one of a triangle twice.

    Examples
    --------
    >>> bricks = [("hexahedron", (1, 2, 3, 4, 5, 6, 7, 8)), ("hexahedron", (5, 6, 7, 8, 9, 10, 11, 12))]
    >>> len(outer_faces(bricks))  # of 12 faces one is shared
    10
    >>> outer_faces([("triangle", (1, 2, 3))]).tolist()
    [[1, 2, 3, 3]]
    """
    by_shape: dict[str, list[Sequence[int]]] = {}
    for shape, corners in elements:
        by_shape.setdefault(shape, []).append(corners)
    solids, shells = [NO_FACES], [NO_FACES]
    for shape, rows in by_shape.items():
        table = np.array(rows, np.int64)
        for places in FACES.get(shape, ()):
            around = table[:, [*places, *places[-1:] * (MOST - len(places))]]
            (solids if shape in SOLIDS else shells).append(around)
    faces, counts = _distinct(np.concatenate(solids))
    return _distinct(np.concatenate([faces[counts == 1], *shells]))[0]


def _distinct(faces: IntArray) -> tuple[IntArray, IntArray]:
    """Give each face once, its corners around, and how often it stands there; those of two corners are none."""
    ascending = np.sort(faces, axis=1)
    is_again = np.diff(ascending, axis=1, prepend=-1) == 0
    keys = np.sort(np.where(is_again, np.iinfo(np.int64).max, ascending), axis=1)
    has_area = is_again.sum(axis=1) <= MOST - FEWEST
    _, first, counts = np.unique(keys[has_area], axis=0, return_index=True, return_counts=True)
    return _triangles_last(faces[has_area][first]), counts


def _triangles_last(faces: IntArray) -> IntArray:
    """Turn triangles so that the corner that stands there twice is the last one."""
    turned = faces.copy()
    for place in range(MOST):  # twice at this place and the next one
        is_twice = (faces[:, place] == faces[:, (place + 1) % MOST])[:, None]
        turned = np.where(is_twice, np.roll(faces, 2 - place, axis=1), turned)
    return turned


def edges_of(faces: IntArray, lines: Iterable[tuple[int, int]]) -> IntArray:
    """Join the sides of faces and further lines.

    Parameters
    ----------
    faces : (n_faces, 4) int array
        Corners around.
    lines : iterable of pairs of int
        Further ones.

    Returns
    -------
    (n_lines, 2) int array
        Each once, ascending.

    Examples
    --------
    >>> edges_of(np.array([[1, 2, 3, 3]]), [(3, 4)]).tolist()
    [[1, 2], [1, 3], [2, 3], [3, 4]]
    """
    sides = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    pairs = np.vstack([sides, np.array(list(lines), np.int64).reshape(-1, 2)])
    pairs = np.sort(pairs[pairs[:, 0] != pairs[:, 1]], axis=1)
    return np.unique(pairs, axis=0) if len(pairs) else pairs
