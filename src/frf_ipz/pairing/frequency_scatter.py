"""Cost of a difference of frequencies where it is not known how well the model's agree with the measured ones.

A model that is wrong shifts frequencies by per cents. Where many agree far better, as those of local modes do that the
error does not reach, they tell dense modes apart that a scatter of per cents could not; others may still be far off.
So the likelihood is that of a mixture in equal parts of the wide scatter and of a narrow one, which is tried in steps.
"""

from __future__ import annotations

import numpy as np

from frf_ipz.arrays import FloatArray

NARROWER = 3.0 ** np.arange(1, 5)  # than the wide scatter: no model is right to less than a hundredth of that


def frequency_cost(gap: FloatArray, wide: float, narrow: float) -> FloatArray:
    """Give minus twice the logarithm of the mixture, over the density of the wide scatter at its middle.

    Parameters
    ----------
    gap : array
        Differences of logarithms of frequencies.
    wide, narrow : float
        Standard deviations of those that are off, and of those that agree.

    Returns
    -------
    array
        The squared deviation where both are the same.

    Examples
    --------
    >>> frequency_cost(np.array([0.1]), 0.05, 0.05)
    array([4.])
    """
    far = -((gap / wide) ** 2) / 2
    near = -((gap / narrow) ** 2) / 2 + np.log(wide / narrow)
    return np.asarray(-2 * (np.logaddexp(far, near) - np.log(2.0)))
