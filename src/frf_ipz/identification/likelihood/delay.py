"""Pure delays of output channels, as filters and converters cause them.

Poles held, the best delay is where residues and smooth terms explain the most of ``exp(s delay) y``. Delays and
residues act very differently over a band of several modes, so a grid that is refined, and a parabola through its
last points, find it. Where the best of the grid is at its end, it goes on beyond.
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
    longest = np.pi / float(np.min(np.diff(data.s.imag)))  # half of what the lines tell apart
    delays = np.zeros(len(channels))
    for channel in np.unique(channels):
        frfs = np.flatnonzero(channels == channel)
        rows = data.receptance[:, frfs] * weight[:, None] * data.gain[frfs]
        delays[frfs] = _best_delay(rows, data.s, basis, period, longest)
    return delays


def _best_delay(rows: ComplexArray, s: ComplexArray, basis: FloatArray, period: float, longest: float) -> float:
    def explained(delays: FloatArray) -> FloatArray:
        return np.array(
            [np.sum((basis.T @ stacked(rows * np.exp(1j * s.imag[:, None] * delay))) ** 2) for delay in delays]
        )

    grid = np.linspace(EARLIEST, LATEST, STEPS) * period
    step = float(grid[1] - grid[0])
    values = explained(grid)
    while (best := int(np.argmax(values))) in {0, len(grid) - 1} and abs(grid[best]) < longest:
        beyond = grid[best] + (step if best else -step) * np.arange(1, STEPS)
        grid, values = np.append(grid, beyond), np.append(values, explained(beyond))
        order = np.argsort(grid)
        grid, values = grid[order], values[order]
    delay = float(grid[best])
    for _ in range(REFINEMENTS - 1):
        grid = delay + step * np.linspace(-1, 1, 11)
        values = explained(grid)
        best = int(np.argmax(values))
        delay, step = float(grid[best]), 2 * FINER * step
    before, at, after = values[[max(best - 1, 0), best, min(best + 1, len(grid) - 1)]].tolist()
    bend = before - 2 * at + after
    return delay + (step * (before - after) / (2 * bend) if bend < 0 else 0.0)  # to the top of the parabola
