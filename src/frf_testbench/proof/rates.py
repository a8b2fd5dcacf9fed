"""Rates with their intervals, and how far probabilities can be believed."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import beta

LEVEL = 0.95


@dataclass(frozen=True, slots=True, kw_only=True)
class Rate:
    """How many of how many, with the Clopper-Pearson interval.

    Parameters
    ----------
    hits, count : int
        Successes among trials.
    """

    hits: int
    count: int

    @classmethod
    def of(cls, claims: Iterable[bool]) -> Rate:
        """Count claims that hold."""
        values = [bool(claim) for claim in claims]
        return cls(hits=sum(values), count=len(values))

    @property
    def value(self) -> float:
        """Fraction of the trials that succeeded; nan without trials."""
        return self.hits / self.count if self.count else math.nan

    @property
    def interval(self) -> tuple[float, float]:
        """Exact interval of 95 %: (0, 1) without trials."""
        k, n, tail = self.hits, self.count, (1 - LEVEL) / 2
        low = 0.0 if k == 0 else float(beta.ppf(tail, k, n - k + 1))
        high = 1.0 if k == n else float(beta.ppf(1 - tail, k + 1, n - k))
        return low, high


@dataclass(frozen=True, slots=True, kw_only=True)
class Bin:
    """Cases of similar probability.

    Parameters
    ----------
    claimed, reached : float
        Mean probability, and the fraction that is right.
    count : int
        Cases.
    """

    claimed: float
    reached: float
    count: int


def calibration(probabilities: Sequence[float], right: Sequence[bool], *, n_bins: int = 10) -> list[Bin]:
    """Compare probabilities with how often they are right.

    Parameters
    ----------
    probabilities : sequence of float
        Between 0 and 1.
    right : sequence of bool
        As many.
    n_bins : int
        Bins of equal width; empty ones are left out.

    Returns
    -------
    list of Bin
        Ascending.
    """
    p, ok = np.asarray(probabilities, dtype=float), np.asarray(right, dtype=float)
    index = np.minimum((p * n_bins).astype(int), n_bins - 1)
    return [
        Bin(claimed=float(p[index == i].mean()), reached=float(ok[index == i].mean()), count=int((index == i).sum()))
        for i in range(n_bins)
        if (index == i).any()
    ]


def calibration_error(bins: Sequence[Bin]) -> float:
    """Compute the expected calibration error: the mean distance of claimed from reached; nan without cases."""
    count = sum(group.count for group in bins)
    return sum(group.count * abs(group.claimed - group.reached) for group in bins) / count if count else math.nan
