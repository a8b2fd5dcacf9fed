"""Interpolation at Chebyshev nodes: smooth functions from few values."""

from __future__ import annotations

import math

import numpy as np
from numpy.polynomial import chebyshev

from frf_ipz.arrays import FloatArray


def chebyshev_nodes(n_nodes: int) -> FloatArray:
    """Give the nodes of an interval from -1 to 1.

    Parameters
    ----------
    n_nodes : int
        How many.

    Returns
    -------
    (n_nodes,) array
        In descending order.
    """
    return np.asarray(np.cos((2 * np.arange(n_nodes) + 1) * np.pi / (2 * n_nodes)))


def interpolation(places: FloatArray, n_nodes: int) -> FloatArray:
    """Values at places of the polynomials that are one at a node and zero at the others.

    Parameters
    ----------
    places : (n_places,) array
        Between -1 and 1.
    n_nodes : int
        Number of nodes.

    Returns
    -------
    (n_places, n_nodes) array
        What values at the nodes are multiplied by.

    Examples
    --------
    >>> weights = interpolation(np.array([0.3]), 8)
    >>> bool(np.allclose(weights @ np.exp(chebyshev_nodes(8)), np.exp(0.3), rtol=1e-6, atol=0))
    True
    """
    at_places, at_nodes = (chebyshev.chebvander(at, n_nodes - 1) for at in (places, chebyshev_nodes(n_nodes)))
    at_nodes[:, 0] /= 2
    return np.asarray(at_places @ at_nodes.T * (2 / n_nodes))


def nodes_for_waves(phase: float, error: float) -> int:
    """Give the number of nodes at which ``exp(i phase x)``, x from -1 to 1, is interpolated to an error.

    With m nodes it is about ``(e phase / (2 m))^m``, that of the first Bessel function left out.

    Parameters
    ----------
    phase : float
        Largest phase, rad.
    error : float
        Largest error.

    Returns
    -------
    int
        At least 1.

    Examples
    --------
    >>> nodes_for_waves(4 * np.pi, 1e-10)
    34
    """
    n_nodes = 1
    while (math.e * phase / (2 * n_nodes)) ** n_nodes > error:
        n_nodes += 1
    return n_nodes
