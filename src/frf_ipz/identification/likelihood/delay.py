"""Pure delays of output channels, as filters and converters cause them.

Poles held, the best delay is where residues and smooth terms explain the most of ``exp(s delay) y``. Delays and
residues act very differently over a band of several modes, so a grid that is refined where parabolas through its points
are highest, and one through its last points, find it. Where the best of the grid is at its end, it goes on beyond. What
the columns have in common with ``exp(s delay) y`` is no faster in the delay than the highest line: few delays of a grid
are computed, and the others interpolated.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.identification.likelihood.compression import compress, model_columns
from frf_ipz.numerics.chebyshev import chebyshev_nodes, interpolation, nodes_for_waves

if TYPE_CHECKING:
    from frf_ipz.identification.likelihood.smooth_terms import SmoothTerms
    from frf_ipz.identification.measured_lines import WeightedLines

EARLIEST, LATEST = -1.0, 3.0  # periods of the highest frequency
STEPS = 321
FINER = 0.1  # of the step, each time the grid is refined
REFINEMENTS = 5
ERROR = 1e-10  # of a wave between the delays that are computed
VALUES_AT_ONCE = 2**19  # delayed FRFs that are in memory


def find_delays(
    data: WeightedLines, poles: ComplexArray, terms: SmoothTerms, channels: IntArray
) -> tuple[FloatArray, float]:
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
    delays : (n_frfs,) array
        s.
    misfit : float
        Weighted sum of squares that is left with them.
    """
    weight, system = data.profile, compress(data, poles, terms)
    U = system.U[0, : system.n_linear, : system.n_linear]
    columns = model_columns(data.s, poles, terms, real_modes=data.real_modes) * np.tile(weight, 2)[:, None]
    period = 2 * np.pi / float(np.abs(data.s[-1]))
    longest = np.pi / float(np.min(np.diff(data.s.imag)))  # half of what the lines tell apart
    delays, misfit = np.zeros(len(channels)), float(np.sum(system.total))
    for channel in np.unique(channels):
        frfs = np.flatnonzero(channels == channel)
        rows = data.receptance[:, frfs] * weight[:, None] * data.gain[frfs]
        explained = _Explained(rows=rows, omega=data.s.imag, columns=columns, U=U)
        delays[frfs], taken_off = _best_delay(explained, period, longest)
        misfit -= taken_off
    return delays, misfit


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Explained:
    """What residues and smooth terms explain of delayed FRFs.

    Parameters
    ----------
    rows : (n_lines, n_frfs) complex array
        Weighted FRFs.
    omega : (n_lines,) array
        rad/s.
    columns : (2 n_lines, n_columns) array
        Weighted columns of the model.
    U : (n_columns, n_columns) array
        Their triangular factor.
    """

    rows: ComplexArray
    omega: FloatArray
    columns: FloatArray
    U: FloatArray

    def at(self, delays: FloatArray) -> FloatArray:
        """Sum of squares of what is explained at each of a grid's delays, (n_delays,)."""
        middle, reach = (delays[-1] + delays[0]) / 2, abs(delays[-1] - delays[0]) / 2
        n_nodes = nodes_for_waves(float(self.omega[-1] * reach), ERROR)
        weights = interpolation((delays - middle) / reach, n_nodes)
        products = weights @ self._products(middle + reach * chebyshev_nodes(n_nodes))
        parts = products.reshape(len(delays), len(self.U), -1).swapaxes(0, 1).reshape(len(self.U), -1)
        squares = linalg.solve_triangular(self.U, parts, trans="T", check_finite=False) ** 2
        return np.asarray(np.sum(squares.reshape(len(self.U), len(delays), -1), axis=(0, 2)))

    def _products(self, delays: FloatArray) -> FloatArray:
        """Products of the columns with the delayed FRFs, (n_delays, n_columns * n_frfs)."""
        n_frfs, n_lines = self.rows.shape[1], len(self.omega)
        total = np.zeros((len(self.U), len(delays) * n_frfs))
        real, imag = np.split(self.columns, 2)
        step = max(1, VALUES_AT_ONCE // total.shape[1])
        for first in range(0, n_lines, step):
            lines = slice(first, first + step)
            waves = np.exp(1j * self.omega[lines, None] * delays)
            delayed = (waves[:, :, None] * self.rows[lines, None]).reshape(len(waves), -1)
            total += real[lines].T @ delayed.real + imag[lines].T @ delayed.imag
        return total.reshape(len(self.U), len(delays), n_frfs).swapaxes(0, 1).reshape(len(delays), -1)


def _tops(values: FloatArray) -> FloatArray:
    """Raise values that are larger than both neighbours to the top of the parabola through the three."""
    before, at, after = values[:-2], values[1:-1], values[2:]
    tops, is_local = values.copy(), (at > before) & (at >= after)
    bend = np.where(is_local, before - 2 * at + after, -1.0)
    tops[1:-1] -= np.where(is_local, (before - after) ** 2 / (8 * bend), 0.0)
    return tops


def _best_delay(explained: _Explained, period: float, longest: float) -> tuple[float, float]:
    grid = np.linspace(EARLIEST, LATEST, STEPS) * period
    step = float(grid[1] - grid[0])
    values = explained.at(grid)
    while (best := int(np.argmax(values))) in {0, len(grid) - 1} and abs(grid[best]) < longest:
        beyond = grid[best] + (step if best else -step) * np.arange(1, STEPS)
        grid, values = np.append(grid, beyond), np.append(values, explained.at(beyond))
        order = np.argsort(grid)
        grid, values = grid[order], values[order]
    best = int(np.argmax(_tops(values)))
    for _ in range(REFINEMENTS - 1):
        grid = grid[best] + step * np.linspace(-1, 1, 11)
        values = explained.at(grid)
        best = int(np.argmax(values))
        step *= 2 * FINER
    before, at, after = values[[max(best - 1, 0), best, min(best + 1, len(grid) - 1)]].tolist()
    bend = before - 2 * at + after
    offset = (before - after) / (2 * bend) if bend < 0 else 0.0  # to the top of the parabola
    return float(grid[best]) + step * offset, at - offset * (before - after) / 4
