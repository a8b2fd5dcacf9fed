"""Phases for drawing."""

from __future__ import annotations

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray

PHASE_CUT = 135.0  # degrees: structures stay near multiples of 90, so that noise does not make curves jump at the cut
PHASE_LIMITS = (PHASE_CUT - 365, PHASE_CUT + 5)


def phase_degrees(values: ComplexArray) -> FloatArray:
    """Phase, cut where structures hardly ever are.

    Parameters
    ----------
    values : complex array
        FRFs.

    Returns
    -------
    array
        From -225 to 135 degrees.

    Examples
    --------
    >>> phase_degrees(np.array([1j, -1 + 0.01j])).round(1).tolist()
    [90.0, -180.6]
    """
    return np.asarray((np.degrees(np.angle(values)) - PHASE_CUT) % -360.0 + PHASE_CUT)
