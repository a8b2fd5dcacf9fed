"""A structure in the plane of a drawing."""

from __future__ import annotations

import numpy as np

from frf_ipz.arrays import FloatArray

FLAT = 1e-6  # of the largest extent: thinner than this is flat


def project(coordinates_m: FloatArray) -> FloatArray:
    """Put nodes on paper: a flat structure as seen from its thin side, any other one from an elevated corner.

    Parameters
    ----------
    coordinates_m : (n_nodes, 3) array
        Positions, m.

    Returns
    -------
    (n_nodes, 2) array
        Positions on the drawing, m; the second column is constant for a structure that is a line.

    Examples
    --------
    >>> project(np.array([[0.0, 0.0, 0.0], [0.0, 2.0, 0.0]])).tolist()
    [[0.0, 0.0], [2.0, 0.0]]
    """
    extent = np.ptp(coordinates_m, axis=0)
    wide = [axis for axis in range(3) if extent[axis] > FLAT * max(float(extent.max()), np.finfo(float).tiny)]
    if len(wide) <= 2:
        thin = [axis for axis in range(3) if axis not in wide]
        return np.asarray(coordinates_m[:, [*wide, *thin][:2]], float)
    x, y, z = coordinates_m.T
    return np.stack([(x - y) * np.cos(np.pi / 6), z + (x + y) * np.sin(np.pi / 6)], 1)
