"""Which complex values stand above their noise, so far that noise alone would not."""

from __future__ import annotations

import numpy as np

from frf_ipz.arrays import BoolArray, FloatArray

CHANCE = 0.01  # that noise alone lifts a single one of all values above the limit


def above_noise(magnitude: FloatArray, std: FloatArray) -> BoolArray:
    """Tell which magnitudes stand above what noise alone reaches.

    The squared modulus of complex normal noise over its variance is exponentially distributed: the largest of ``n``
    exceeds ``ln(n / chance)`` with that chance. A limit at the standard deviation itself lets through a third of an FRF
    that is nothing but noise.

    Parameters
    ----------
    magnitude : (...) array
        Moduli.
    std : (...) array
        Standard deviations of the complex values: roots of the mean squared modulus of their noise.

    Returns
    -------
    (...) bool array
        False where a value is 0.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> noise = np.abs(rng.standard_normal((100000, 2)) @ [1, 1j]) / np.sqrt(2)
    >>> round(float(np.mean(noise > 1)), 2), int(np.sum(above_noise(noise, np.ones(100000))))
    (0.37, 0)
    """
    return np.asarray(magnitude > std * np.sqrt(np.log(max(magnitude.size, 1) / CHANCE)))
