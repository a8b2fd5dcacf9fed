"""Which machines are none of the others': a robust test whose false alarms are stated.

The generalised extreme Studentised deviate of [Rosner1983] takes the farthest machine away, again and again, and then
asks how many of these were too far off for chance: so several faulty machines do not hide each other. Its levels are
shared out among the steps, so that in a fleet without a faulty machine the probability that any is marked is at most
`FALSE_ALARMS`, over all poles and zeros together, where machines scatter normally about their mean.

[Rosner1983] B. Rosner, Percentage points for a generalized ESD many-outlier procedure, Technometrics 25 (2), 1983,
165-172, doi:10.1080/00401706.1983.10487848.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

if TYPE_CHECKING:
    from frf_ipz.arrays import BoolArray, FloatArray

FALSE_ALARMS = 0.05  # probability that any machine of a fleet without a faulty one is marked
FEWEST = 5  # machines: of fewer nothing tells which one is off
LARGEST_SHARE = 4  # at most one machine in so many is off; of more nobody knows which are the others


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Deviations:
    """How far each machine is from the others.

    Parameters
    ----------
    sigma : (n,) array
        Difference to the mean of the others, in standard deviations of a further machine as they scatter and as it was
        measured; NaN for too few machines.
    is_outlier : (n,) bool array
        True where that is no chance.
    """

    sigma: FloatArray
    is_outlier: BoolArray


def find_outliers(values: FloatArray, std: FloatArray, *, level: float) -> Deviations:
    """Say which of some numbers, one a machine, are none of the others'.

    Parameters
    ----------
    values : (n,) array
        The numbers.
    std : (n,) array
        With what standard deviation each was measured.
    level : float
        Probability that any is marked where all are of one kind.

    Returns
    -------
    Deviations
        In the order of `values`.

    Examples
    --------
    >>> found = find_outliers(np.array([9.9, 10.0, 10.1, 10.0, 9.95, 13.0]), np.zeros(6), level=0.05)
    >>> found.is_outlier.tolist()
    [False, False, False, False, False, True]
    """
    n = len(values)
    if n < FEWEST or not np.ptp(values) > 0:
        return Deviations(sigma=np.full(n, np.nan), is_outlier=np.zeros(n, bool))
    suspects = _extreme(values, level)
    clean = np.ones(n, bool)
    clean[suspects] = False
    sigma = np.array([_deviation(values, std, clean, place) for place in range(n)])
    n_clean = int(clean.sum())
    limit = -special.stdtrit(n_clean - 1, level / 2 / (2 * n))
    is_outlier = ~clean & (np.abs(sigma) > limit)  # one that was measured badly may be far off by that alone
    return Deviations(sigma=sigma, is_outlier=is_outlier)


def _extreme(values: FloatArray, level: float) -> list[int]:
    """Give those that are too far off, by [Rosner1983]."""
    n = len(values)
    steps = max(n // LARGEST_SHARE, 1)
    remaining = list(range(n))
    removed: list[int] = []
    found = 0
    for step in range(steps):
        left = values[remaining]
        count = len(remaining)
        distances = np.abs(left - left.mean())
        farthest = int(np.argmax(distances))
        spread = left.std(ddof=1)
        if not spread > 0:
            break
        share = level if steps == 1 else level / 2 if step == 0 else level / 2 / (steps - 1)
        t = -special.stdtrit(count - 2, share / (2 * count))
        limit = (count - 1) * t / np.sqrt((count - 2 + t**2) * count)
        removed.append(remaining.pop(farthest))
        if distances[farthest] > limit * spread:
            found = step + 1
    return removed[:found]


def _deviation(values: FloatArray, std: FloatArray, clean: BoolArray, place: int) -> float:
    others = values[clean & (np.arange(len(values)) != place)]
    variance = others.var(ddof=1) * (1 + 1 / len(others)) + std[place] ** 2
    return float((values[place] - others.mean()) / np.sqrt(variance)) if variance > 0 else float("nan")
