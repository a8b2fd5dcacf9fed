"""Pure delays of output channels, as filters and converters cause them.

Poles held, the best delay is where residues and smooth terms explain the most of ``exp(s delay) y``. Delays and
residues act very differently over a band of several modes, so a grid that is refined finds it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.identification.likelihood.compression import model_columns
from frf_ipz.numerics.partial_fractions import stacked

if TYPE_CHECKING:
    from frf_ipz.identification.likelihood.smooth_terms import SmoothTerms
    from frf_ipz.identification.measured_lines import WeightedLines

EARLIEST, LATEST = -1.0, 3.0  # periods of the highest frequency
STEPS = 81
FINER = 0.1  # of the step, each time the grid is refined
REFINEMENTS = 5


def find_delays(data: WeightedLines, poles: ComplexArray, terms: SmoothTerms, channels: IntArray) -> FloatArray:
    """Find the delay of each channel.

    Parameters
    ----------
    data : WeightedLines
        Lines and weights.
    poles : (n_poles,) complex array
        rad/s.
    terms : SmoothTerms
        Terms for modes out of band.
    channels : (n_frfs,) int array
        Channel of each FRF.

    Returns
    -------
    (n_frfs,) array
        s.
    """
    weight = data.profile
    columns = model_columns(data.s, poles, terms, real_modes=data.real_modes) * np.tile(weight, 2)[:, None]
    basis = np.linalg.qr(columns)[0]
    period = 2 * np.pi / float(np.abs(data.s[-1]))
    delays = np.zeros(len(channels))
    for channel in np.unique(channels):
        frfs = np.flatnonzero(channels == channel)
        rows = data.receptance[:, frfs] * weight[:, None] * data.gain[frfs]
        delays[frfs] = _best_delay(rows, data.s, basis, period)
    return delays


def _best_delay(rows: ComplexArray, s: ComplexArray, basis: FloatArray, period: float) -> float:
    grid = np.linspace(EARLIEST, LATEST, STEPS) * period
    step = grid[1] - grid[0]
    for _ in range(REFINEMENTS):
        explained = [np.sum((basis.T @ stacked(rows * np.exp(1j * s.imag[:, None] * delay))) ** 2) for delay in grid]
        best = float(grid[int(np.argmax(explained))])
        grid = best + step * np.linspace(-1, 1, 11)
        step *= 2 * FINER
    return best
