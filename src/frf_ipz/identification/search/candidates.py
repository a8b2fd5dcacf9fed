"""Where modes are missing: peaks of the misfit that noise does not make.

A missing mode shows as ``R / (i (omega - omega_0) + a)`` in the misfit of every FRF. In the time domain that is
a decaying exponential; so the best match to it, at every frequency at once, is the spectrum of the misfit's time signal
times ``exp(-a t)``. The energy of the match, summed over FRFs, is chi-square with two degrees of freedom an FRF where
there is only noise, and a candidate is what exceeds the largest value that so many lines would show by chance.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from scipy import special

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.late_imports import import_late

if TYPE_CHECKING:
    from scipy import fft
else:
    fft = import_late("scipy.fft")

FALSE_ALARMS = 1e-3  # candidates that pure noise would give, per search
NARROWEST, WIDENING = 0.4, 5.0  # half widths tried: the first in lines, and the factor to the next: 0.85 match at worst
WIDEST_RATIO = 0.15  # damping ratio of the widest
SHADOW = 3.0  # times the match that a stronger candidate itself would have there: a weaker one must exceed that
TAILS = 40  # half widths of a mode that are matched
PADDING = 4  # zeros behind the lines, one over: so that the two ends of the band are not neighbours


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Candidates:
    """Poles that may be missing.

    Parameters
    ----------
    poles : (n,) complex array
        rad/s, the strongest first.
    strength : (n,) array
        Energy of the match over what chance would give at most.
    half_width_rad_s : (n_widths,) array
        Half widths that were matched.
    level : (n_widths,) array
        Typical energy of a match over that of white noise: above 1 where errors of neighbouring lines are correlated.
    """

    poles: ComplexArray
    strength: FloatArray
    half_width_rad_s: FloatArray
    level: FloatArray

    def level_at(self, poles: ComplexArray) -> FloatArray:
        """Level for poles of some half width.

        Parameters
        ----------
        poles : (n_poles,) complex array
            rad/s.

        Returns
        -------
        (n_poles,) array
            At least 1.
        """
        widths = np.log(self.half_width_rad_s)
        return np.asarray(np.interp(np.log(np.maximum(-poles.real, np.exp(widths[0]))), widths, self.level))


def find_candidates(frequency_hz: FloatArray, misfit: ComplexArray, max_count: int) -> Candidates:
    """Find modes that are missing in a model.

    Parameters
    ----------
    frequency_hz : (n_lines,) array
        Lines, Hz; gaps count as lines without data.
    misfit : (n_lines, n_frfs) complex array
        Measured minus model, in units where each part of the noise has variance one.
    max_count : int
        Largest number of candidates.

    Returns
    -------
    Candidates
        The strongest first; none where nothing exceeds chance.
    """
    line = float(np.median(np.diff(frequency_hz)))
    grid_indices = _grid_indices(frequency_hz, line)
    n_grid = int(grid_indices[-1]) + 1
    size = fft.next_fast_len(n_grid + n_grid // PADDING)
    gridded = np.zeros((misfit.shape[1], n_grid), np.complex64)  # single precision: the misfit is of order one
    gridded[:, grid_indices] = misfit.T
    signal = np.asarray(fft.ifft(gridded, size, axis=1, norm="forward"), np.complex64)
    widths = _half_widths(frequency_hz, line)
    limit = _chance_limit(misfit.shape[1], len(frequency_hz) * len(widths))
    typical = float(2 * special.gammaincinv(misfit.shape[1], 0.5))
    levels = np.ones(len(widths))
    matches: list[tuple[float, complex]] = []
    templates = _template_energies(grid_indices.tobytes(), tuple(widths.tolist()))
    for number, width in enumerate(widths):
        energy = _match_energy(signal, width, n_grid)[grid_indices] / templates[number]
        levels[number] = max(1.0, float(np.median(energy)) / typical)
        ratio = energy / (limit * levels[number])
        matches += [
            (float(ratio[k]), 2 * np.pi * complex(-width * line, frequency_hz[k]))
            for k in _peaks(ratio)[: 2 * max_count]
        ]
    poles, strength = _separate(sorted(matches, key=lambda match: -match[0]), max_count)
    return Candidates(
        poles=poles, strength=strength, half_width_rad_s=2 * np.pi * line * np.asarray(widths), level=levels
    )


def _grid_indices(frequency_hz: FloatArray, line: float) -> IntArray:
    """Put the lines on a grid; a gap longer than the tails of the widest match is shortened."""
    steps = np.clip(np.round(np.diff(frequency_hz) / line), 1, 10 * TAILS)
    return np.concatenate([[0], np.cumsum(steps)]).astype(np.int64)


def _half_widths(frequency_hz: FloatArray, line: float) -> FloatArray:
    widest = WIDEST_RATIO * frequency_hz[-1] / line
    widest = max(min(widest, len(frequency_hz) / 8), 2 * NARROWEST)
    count = 1 + int(np.ceil(np.log(widest / NARROWEST) / np.log(WIDENING)))
    return np.geomspace(NARROWEST, widest, count)


def _match_energy(signal: npt.NDArray[np.complex64], width: float, n_grid: int) -> FloatArray:
    """Energy of the match at every point of the grid, summed over FRFs."""
    size = signal.shape[1]
    # a broad match varies slowly: a part of the time signal is enough, and gives fewer points
    length = min(size // 2, fft.next_fast_len(int(np.ceil(12 * size / (2 * np.pi * width)))))
    time = np.arange(length) * (2 * np.pi / size)
    points = size if length == size // 2 else length * 2
    matched = fft.fft(signal[:, :length] * np.exp(-width * time).astype(np.float32), points, axis=1)
    energy = np.sum(matched.real**2 + matched.imag**2, axis=0) * (2 * np.pi / size) ** 2
    if points == size:
        return np.asarray(energy[:n_grid])
    return np.asarray(np.interp(np.arange(n_grid) / size, np.arange(points) / points, energy))


@lru_cache(maxsize=2)  # a search asks for those of the same lines again and again
def _template_energies(grid_indices: bytes, widths: tuple[float, ...]) -> FloatArray:
    """Sum over the lines present of 1 / (k^2 + width^2), at each of them, (n_widths, n_lines)."""
    at = np.frombuffer(grid_indices, np.int64)
    n_grid = int(at[-1]) + 1
    reach = int(min(n_grid, max(TAILS * widths[-1], TAILS)))
    size = fft.next_fast_len(n_grid + 2 * reach)
    present = np.zeros(n_grid)
    present[at] = 1.0
    spectrum = fft.rfft(present, size)
    k = np.arange(-reach, reach + 1)
    energies = np.empty((len(widths), len(at)))
    for row, width in zip(energies, widths, strict=True):
        kernel = np.where(np.abs(k) <= max(TAILS * width, TAILS), 1.0 / (k**2 + width**2), 0.0)
        row[:] = fft.irfft(spectrum * fft.rfft(kernel, size), size)[reach + at]
    energies.flags.writeable = False
    return energies


def _chance_limit(n_frfs: int, n_points: int) -> float:
    return float(special.chdtri(2 * n_frfs, FALSE_ALARMS / n_points))


def _peaks(ratio: FloatArray) -> IntArray:
    indices = np.flatnonzero(ratio > 1)
    inner = indices[(indices > 0) & (indices < len(ratio) - 1)]
    tops = inner[(ratio[inner] >= ratio[inner - 1]) & (ratio[inner] >= ratio[inner + 1])]
    return np.asarray(tops[np.argsort(-ratio[tops])])


def _separate(matches: list[tuple[float, complex]], max_count: int) -> tuple[ComplexArray, FloatArray]:
    """Select matches, given strongest first, that are not the shadow of stronger ones."""
    selected: list[tuple[float, complex]] = []
    for strength, pole in matches:
        shadow = sum(stronger * _overlap(pole, stronger_pole) for stronger, stronger_pole in selected)
        if len(selected) < max_count and strength > SHADOW * shadow:
            selected.append((strength, pole))
    return np.array([pole for _, pole in selected], complex), np.array([strength for strength, _ in selected])


def _overlap(first: complex, second: complex) -> float:
    """Energy of one pole's match in the response of another, over that in its own response."""
    return 4 * first.real * second.real / ((first.real + second.real) ** 2 + (first.imag - second.imag) ** 2)
