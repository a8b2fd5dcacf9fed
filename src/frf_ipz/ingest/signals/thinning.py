"""Signals with few enough points to draw, minima and maxima kept."""

from __future__ import annotations

import numpy as np

from frf_ipz.arrays import FloatArray


def thin(values: FloatArray, n_points: int) -> tuple[np.ndarray, FloatArray]:
    """Keep the lowest and the highest sample of each stretch of a signal.

    Parameters
    ----------
    values : (n,) array
        The signal.
    n_points : int
        Points to keep at most.

    Returns
    -------
    places : (m,) int array
        Which samples, ascending; m is at most `n_points`.
    values : (m,) array
        Their values.

    Examples
    --------
    >>> places, kept = thin(np.sin(np.arange(10_000.0)), 100)
    >>> len(places) <= 100, bool(kept.max() > 0.999)
    (True, True)
    """
    if len(values) <= n_points:
        return np.arange(len(values)), values
    size = -(-len(values) // max(n_points // 2, 1))
    cells = np.pad(values, (0, -len(values) % size), mode="edge").reshape(-1, size)
    starts = np.arange(len(cells)) * size
    places = np.unique(np.concatenate([starts + cells.argmin(axis=1), starts + cells.argmax(axis=1)]))
    return places, values[places]
