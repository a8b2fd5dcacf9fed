"""A coarse set of places all over a structure: few enough to look at each, and one of them near any other.

What an effect or a force explains varies from node to node as the shapes of the modes do. The m-th mode has at most m
domains of one sign [Courant1923]; with some places in each, one is near the true place, which is then among those
around the best.

[Courant1923] R. Courant, Ein allgemeiner Satz zur Theorie der Eigenfunktionen selbstadjungierter Differentialausdrücke,
Nachrichten von der Gesellschaft der Wissenschaften zu Göttingen (1923) 81-84.
[Gonzalez1985] T. F. Gonzalez, Clustering to minimize the maximum intercluster distance, Theoretical Computer Science 38
(1985) 293-306, doi:10.1016/0304-3975(85)90224-5.
"""

from __future__ import annotations

import numpy as np

from frf_ipz.arrays import FloatArray, IntArray

PLACES_PER_MODE = 8  # in each domain of the highest mode: some three across it


def spread_places(positions: FloatArray, count: int) -> tuple[IntArray, float]:
    """Choose places that are as far apart as can be, one after the other.

    Parameters
    ----------
    positions : (n, 3) array
        Of all places, m.
    count : int
        How many are chosen, at least 1.

    Returns
    -------
    chosen : (count,) int array
        Indices, ascending.
    reach : float
        How far the farthest place is from the nearest chosen one, m: at most twice that of the best choice
        [Gonzalez1985].

    Examples
    --------
    >>> chosen, reach = spread_places(np.linspace(0, 1, 5)[:, None], 3)
    >>> chosen.tolist(), reach
    ([0, 2, 4], 0.25)
    """
    chosen = [0]
    distance = np.linalg.norm(positions - positions[0], axis=1)
    while len(chosen) < count:
        farthest = int(np.argmax(distance))
        chosen.append(farthest)
        distance = np.minimum(distance, np.linalg.norm(positions - positions[farthest], axis=1))
    return np.sort(np.array(chosen, np.int64)), float(distance.max())
