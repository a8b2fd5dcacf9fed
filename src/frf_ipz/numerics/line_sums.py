"""Products of partial fractions with weighted lines, at a cost that hardly grows with the number of lines.

Far from a pole its partial fraction varies little over many lines. So the lines are divided into intervals, these into
halves, and so on; what an interval's lines weigh is carried to a few Chebyshev nodes, with which a pole far from the
interval makes the same sums to rounding [Fong2009]. A pole sees large intervals far away, small ones nearby, and single
lines next to it.

[Fong2009] W. Fong, E. Darve, The black-box fast multipole method, J. Computational Physics 228, 2009, 8712-8725,
doi:10.1016/j.jcp.2009.08.031.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TypedDict

import numpy as np
from scipy import sparse

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.numerics.chebyshev import chebyshev_nodes, interpolation
from frf_ipz.numerics.partial_fractions import pair_rows

# seen from this many half lengths, m nodes leave (3 + sqrt(8))^-m: rounding
FAR = 3.0
NODES = 18
LINES_OF_SMALLEST = 128  # of the smallest intervals: fewer would cost more in calls than they save
LINES_OF_TILE = 128  # at most
PLACES = chebyshev_nodes(NODES)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LineSums:
    """Weighted rows, by intervals of lines.

    Parameters
    ----------
    ends : (2,) complex array
        First and last line, rad/s.
    levels : tuple of (2^k, 2, n_nodes, n_rows) arrays
        From the whole band to the smallest intervals, what stands for the lines at the nodes of each interval: real and
        imaginary part of what the fractions are multiplied with.
    first_tile : (n_intervals + 1,) int array
        Where the lines of each of the smallest intervals begin among the tiles.
    tile_s : (n_tiles, n) complex array
        Lines of each tile, rad/s; the last is repeated where there are fewer.
    tile_rows : (n_tiles, 2, n, n_rows) array
        Their rows, real and imaginary part; zero for what is repeated.
    """

    ends: ComplexArray
    levels: tuple[FloatArray, ...]
    first_tile: IntArray
    tile_s: ComplexArray
    tile_rows: FloatArray

    @staticmethod
    def of_lines(s: ComplexArray, rows: ComplexArray) -> LineSums:
        """Divide lines into intervals.

        Parameters
        ----------
        s : (n_lines,) complex array
            Lines by ascending frequency, all with the same real part, rad/s.
        rows : (n_lines, n_rows) complex array
            What the fractions are multiplied with, weights included.

        Returns
        -------
        LineSums
            Of these lines.
        """
        depth = int(np.log2(max(1.0, len(s) / LINES_OF_SMALLEST)))
        count = 2**depth
        low, length = s.imag[0], (s.imag[-1] - s.imag[0]) / count
        edges = low + length * np.arange(1, count)
        first = np.concatenate([[0], np.searchsorted(s.imag, edges), [len(s)]])
        levels: list[FloatArray] = []
        if depth:
            number = np.repeat(np.arange(count), np.diff(first))
            weights = interpolation(2 * ((s.imag - low) / length - number) - 1, NODES)
            at = (NODES * number[:, None] + np.arange(NODES)).ravel()
            to_nodes = sparse.csc_array(
                (weights.ravel(), at, NODES * np.arange(len(s) + 1)), shape=(NODES * count, len(s))
            )
            nodes = [np.asarray(to_nodes @ part).reshape(count, NODES, -1) for part in (rows.real, rows.imag)]
            levels = [np.stack(nodes, axis=1)]
            halves = [interpolation((PLACES + side) / 2, NODES).T for side in (-1, 1)]
            while len(levels[-1]) > 1:
                fine = levels[-1]
                levels.append(halves[0] @ fine[::2] + halves[1] @ fine[1::2])
        return LineSums(ends=s[[0, -1]], levels=tuple(levels[::-1]), **_tiles(s, rows, first))

    def products(self, poles: ComplexArray) -> FloatArray:
        """Multiply the columns of poles, as `pair_columns` gives them, with the rows.

        Parameters
        ----------
        poles : (n_poles,) complex array
            One of each pair, imaginary part >= 0, rad/s.

        Returns
        -------
        (4, n_poles, n_rows) array
            For the real and the imaginary parts of residues, and for those of the slopes.
        """
        total = np.zeros((len(poles), 4, self.tile_rows.shape[3]))
        pole, interval = np.arange(len(poles)), np.zeros(len(poles), np.int64)
        low, high = self.ends
        for level in self.levels:
            half = (high.imag - low.imag) / len(level) / 2
            middle = low + 1j * half * (2 * interval + 1)
            is_far = np.abs(poles[pole] - middle) > FAR * half
            nodes = middle[is_far, None] + 1j * half * PLACES
            _add(total, pole[is_far], _columns(nodes, poles[pole[is_far]]), level[interval[is_far]])
            pole, interval = np.repeat(pole[~is_far], 2), np.repeat(2 * interval[~is_far], 2)
            interval[1::2] += 1
        if self.levels:
            pole, interval = pole[::2], interval[::2] // 2  # the smallest have no halves
        self._add_lines(total, poles, pole, interval)
        return total.transpose(1, 0, 2)

    def _add_lines(self, total: FloatArray, poles: ComplexArray, pole: IntArray, interval: IntArray) -> None:
        """Add the lines of intervals next to poles one by one."""
        count = np.diff(self.first_tile)[interval]
        pole, tile = np.repeat(pole, count), _ranges(self.first_tile[interval], count)
        order = np.argsort(tile, kind="stable")
        pole, tile = pole[order], tile[order]
        columns = _columns(self.tile_s[tile], poles[pole])
        starts = np.flatnonzero(np.diff(tile, prepend=-1, append=-1)).tolist()
        for first, end in itertools.pairwise(starts):
            rows = self.tile_rows[tile[first]].reshape(-1, total.shape[2])
            products = columns[first:end].reshape(-1, len(rows)) @ rows
            total[pole[first:end]] += products.reshape(end - first, 4, -1)

    def seen_from(self, poles: ComplexArray) -> tuple[ComplexArray, FloatArray]:
        """Give lines next to poles, and nodes that stand for all others.

        Parameters
        ----------
        poles : (n_poles,) complex array
            rad/s.

        Returns
        -------
        s : (n,) complex array
            Lines and nodes, rad/s.
        rows : (n, 2, n_rows) array
            Their rows: for sums of whatever varies no faster than products of the poles' columns.
        """
        interval, low, band = np.zeros(1, np.int64), self.ends[0], self.ends[1].imag - self.ends[0].imag
        places, rows = [], []
        for level in self.levels:
            half = band / len(level) / 2
            middle = low + 1j * half * (2 * interval + 1)
            is_far = (np.abs(poles - middle[:, None]) > FAR * half).all(axis=1)
            places.append((middle[is_far, None] + 1j * half * PLACES).ravel())
            rows.append(level[interval[is_far]].transpose(0, 2, 1, 3).reshape(len(places[-1]), 2, level.shape[-1]))
            interval = (2 * interval[~is_far, None] + np.arange(2)).ravel()
        if self.levels:
            interval = interval[::2] // 2
        tile = _ranges(self.first_tile[interval], np.diff(self.first_tile)[interval])
        places.append(self.tile_s[tile].ravel())
        n_rows = self.tile_rows.shape[3]
        rows.append(self.tile_rows[tile].transpose(0, 2, 1, 3).reshape(len(places[-1]), 2, n_rows))
        return np.concatenate(places), np.concatenate(rows)


class _Tiles(TypedDict):
    first_tile: IntArray
    tile_s: ComplexArray
    tile_rows: FloatArray


def _tiles(s: ComplexArray, rows: ComplexArray, first: IntArray) -> _Tiles:
    """Cut the lines of intervals into tiles that are equally long."""
    count = np.diff(first)
    length = -(-count.max() // -(-count.max() // LINES_OF_TILE))
    of_interval = -(-count // length)
    first_tile = np.concatenate([[0], np.cumsum(of_interval)])
    tile = np.arange(first_tile[-1]) - np.repeat(first_tile[:-1], of_interval)
    line = np.repeat(first[:-1], of_interval)[:, None] + length * tile[:, None] + np.arange(length)
    end = np.repeat(first[1:], of_interval)[:, None]
    is_line, line = line < end, np.minimum(line, end - 1)
    parts = np.stack([rows.real, rows.imag])[:, line] * is_line[..., None]
    return _Tiles(first_tile=first_tile, tile_s=s[line], tile_rows=np.ascontiguousarray(parts.transpose(1, 0, 2, 3)))


def _ranges(first: IntArray, count: IntArray) -> IntArray:
    """Count up from several numbers, so many each."""
    return np.arange(count.sum()) + np.repeat(first - np.cumsum(count) + count, count)


def _columns(s: ComplexArray, poles: ComplexArray) -> FloatArray:
    """Columns of each pole on lines of its own, (n_poles, 4, 2 n_lines)."""
    return pair_rows(s, poles, (1, 2)).reshape(len(poles), 4, 2 * s.shape[1])


def _add(total: FloatArray, pole: IntArray, columns: FloatArray, charges: FloatArray) -> None:
    if len(pole):
        products = columns @ charges.reshape(len(charges), -1, total.shape[2])
        starts = np.flatnonzero(np.diff(pole, prepend=-1))
        total[pole[starts]] += np.add.reduceat(products, starts)
