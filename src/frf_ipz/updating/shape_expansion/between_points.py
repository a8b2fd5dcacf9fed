"""Which points lie between measured ones, and which beyond all of them.

Between measured points a shape is interpolated, beyond them it is extrapolated, and errors of the model grow. So points
in the convex hull of the measured ones are judged by left-out points in the hull of the others, and all other points by
those as well that lie at ends when they are left out.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.dofs import AnyDof, Dof
from frf_ipz.late_imports import import_late

if TYPE_CHECKING:
    from collections.abc import Iterable

    from scipy.optimize import nnls

    from frf_ipz.arrays import BoolArray, FloatArray
    from frf_ipz.structure import Geometry
else:
    nnls = import_late("scipy.optimize", "nnls")

ROUNDING = 1e-6  # of the extent of the measured points: printed coordinates


def lies_between(place: FloatArray, others: FloatArray) -> bool:
    """Tell whether a point is in the convex hull of others.

    Parameters
    ----------
    place : (3,) array
        Coordinates, m.
    others : (n, 3) array
        Of the others.

    Returns
    -------
    bool
        False where there are none.

    Examples
    --------
    >>> line = np.array([[0.1, 0, 0], [0.3, 0, 0], [0.5, 0, 0]])
    >>> lies_between(np.array([0.4, 0, 0]), line), lies_between(np.array([0.6, 0, 0]), line)
    (True, False)
    """
    if not len(others):
        return False
    extent = float(np.max(np.ptp(others, axis=0)))
    if extent == 0.0:
        return False
    scaled = (others - place) / extent
    # weights that add up to 1 and bring the others to the point
    _, left_over = nnls(np.vstack([scaled.T, np.ones(len(others))]), np.array([0.0, 0.0, 0.0, 1.0]))
    return bool(left_over < ROUNDING)


def inner_points(
    left_out: tuple[AnyDof, ...], measured: tuple[AnyDof, ...], dofs: Iterable[AnyDof], geometry: Geometry | None
) -> tuple[tuple[int, ...], BoolArray]:
    """Find the nodes between measured points, and the left-out points that lie between others.

    Parameters
    ----------
    left_out : tuple of Dof or PortDof
        Points that were left out.
    measured : tuple of Dof or PortDof
        All measured points of that side.
    dofs : iterable of Dof or PortDof
        DOFs of the model.
    geometry : Geometry, optional
        Where the nodes are.

    Returns
    -------
    nodes : tuple of int
        Nodes in the hull of the measured points; none where their places, or errors between them, are not known.
    is_inner : (n_left_out,) bool array
        Left-out points in the hull of the others; none where there are no such nodes.
    """
    nowhere: tuple[int, ...] = ()
    none = np.zeros(len(left_out), bool)
    if geometry is None or geometry.is_schematic or not all(isinstance(dof, Dof) for dof in measured):
        return nowhere, none
    numbers = np.asarray(geometry.nodes).tolist()
    place_of = dict(zip(numbers, np.asarray(geometry.coordinates_m, float), strict=True))
    nodes = {dof.node for dof in measured if isinstance(dof, Dof)}
    if not nodes <= place_of.keys():
        return nowhere, none
    is_inner = [
        isinstance(point, Dof)
        and lies_between(place_of[point.node], np.array([place_of[node] for node in nodes - {point.node}]))
        for point in left_out
    ]
    if not any(is_inner):
        return nowhere, none
    places = np.array([place_of[node] for node in sorted(nodes)])
    candidates = sorted({dof.node for dof in dofs if isinstance(dof, Dof)} & place_of.keys())
    inner = tuple(node for node in candidates if lies_between(place_of[node], places))
    return inner, np.array(is_inner, bool)
