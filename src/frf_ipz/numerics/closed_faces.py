"""Faces to draw a model of which only lines are known: closed rings of three or four lines."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from frf_ipz.arrays import FloatArray

FLAT = 1e-6  # sine of an angle: rings whose corners lie on one line enclose nothing


def faces_between_lines(lines: Iterable[Sequence[int]], coordinates_m: FloatArray) -> list[tuple[int, ...]]:
    """Find the triangles and quadrilaterals that lines enclose.

    Parameters
    ----------
    lines : iterable of pairs of int
        Rows of `coordinates_m`.
    coordinates_m : (n, 3) array
        Where their ends are.

    Returns
    -------
    list of tuple of int
        Three or four corners in their order. A ring with a line across it is two triangles, and given as those.

    Examples
    --------
    >>> square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    >>> faces_between_lines([(0, 1), (1, 2), (2, 3), (3, 0)], square)
    [(0, 1, 2, 3)]
    >>> faces_between_lines([(0, 1), (1, 2), (2, 3), (3, 0), (0, 2)], square)
    [(0, 1, 2), (0, 2, 3)]
    """
    joined: dict[int, set[int]] = {}
    for a, b in lines:
        if a != b:
            joined.setdefault(int(a), set()).add(int(b))
            joined.setdefault(int(b), set()).add(int(a))
    triangles = [
        (a, b, c)
        for a in sorted(joined)
        for b in sorted(joined[a])
        if b > a
        for c in sorted(joined[a] & joined[b])
        if c > b
    ]
    between: dict[tuple[int, int], list[int]] = {}
    for middle in sorted(joined):
        for a, c in combinations(sorted(joined[middle]), 2):
            if c not in joined[a]:
                between.setdefault((a, c), []).append(middle)
    rings = [
        (a, b, c, d)
        for (a, c), middles in between.items()
        for b, d in combinations(middles, 2)
        if a < min(b, d) and d not in joined[b]
    ]
    return [face for face in (*triangles, *rings) if _has_area(coordinates_m[list(face)])]


def _has_area(corners: FloatArray) -> bool:
    sides = corners[1:] - corners[0]
    normals = np.cross(sides[:-1], sides[1:])
    lengths = np.linalg.norm(sides, axis=1)
    return bool((np.linalg.norm(normals, axis=1) > FLAT * lengths[:-1] * lengths[1:]).all())
