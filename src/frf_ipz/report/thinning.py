"""Fewer points for the eye: peaks and notches stay, what no screen can show goes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray, IntArray

if TYPE_CHECKING:
    from collections.abc import Sequence

POINTS = 44_000  # of one kind of curve on the whole page: keeps a page of 100 FRFs below 10 MB
BINS = (150, 1200)  # of one curve: the fewest that still look like it, and as many as a screen has columns
LOGARITHMIC = 0.35  # of the bins are spread evenly over the logarithm of the frequency, the others over the frequency


def bins_for(n_curves: int) -> int:
    """How many bins each curve gets, so that a page with many of them stays small.

    Parameters
    ----------
    n_curves : int
        Curves of one kind on the page.

    Returns
    -------
    int
        Bins of each curve; two points are kept of each.
    """
    return int(np.clip(POINTS // (2 * max(n_curves, 1)), *BINS))


def thin(frequency_hz: FloatArray, curves: Sequence[FloatArray], n_bins: int) -> IntArray:
    """Choose the lines to draw: of every bin those with the smallest and the largest value of each curve.

    Bins are narrow at low frequencies too, so that the choice serves linear and logarithmic axes equally well.

    Parameters
    ----------
    frequency_hz : (n_lines,) array
        Ascending, Hz.
    curves : sequence of (n_lines,) array
        What is drawn, as it is drawn: the logarithm of a magnitude on a logarithmic axis. NaN counts as no value.
    n_bins : int
        About half as many points are kept of each curve.

    Returns
    -------
    (n_thinned,) int array
        Lines to draw, ascending; all of them where there are few.

    Examples
    --------
    >>> f = np.arange(10_000.0)
    >>> peak = np.where(f == 7_777, 1.0, 0.0)
    >>> lines = thin(f, [peak], 100)
    >>> 7_777 in lines, len(lines) <= 202
    (True, True)
    """
    n_lines = len(frequency_hz)
    if n_lines <= 2 * n_bins:
        return np.arange(n_lines)
    starts = _starts(frequency_hz, n_bins)
    lines = [np.zeros(1, int)]  # the last line is a bin of its own
    for curve in curves:
        lines += [_extreme(curve, starts), _extreme(-curve, starts)]
    return np.unique(np.concatenate(lines))


def _starts(frequency_hz: FloatArray, n_bins: int) -> IntArray:
    low, high = frequency_hz[frequency_hz > 0][0], frequency_hz[-1]
    logarithmic = int(n_bins * LOGARITHMIC)
    edges = np.concatenate(
        [np.geomspace(low, high, logarithmic), np.linspace(frequency_hz[0], high, n_bins - logarithmic)]
    )
    starts = np.unique(np.searchsorted(frequency_hz, np.sort(edges)))
    return np.unique(np.concatenate([[0], starts[starts < len(frequency_hz)]]))


def _extreme(curve: FloatArray, starts: IntArray) -> IntArray:
    """Line of the largest value of each bin."""
    values = np.where(np.isfinite(curve), curve, -np.inf)
    largest = np.maximum.reduceat(values, starts)
    widths = np.diff(np.append(starts, len(curve)))
    hits = np.flatnonzero(values == np.repeat(largest, widths))
    bins = np.searchsorted(starts, hits, side="right") - 1
    return hits[np.unique(bins, return_index=True)[1]]
