"""The pulse of a hammer blow, and further pulses after it.

Real force signals ring after the pulse: anti-alias filters at the edge of their band, the hammer at its own resonance,
amplifiers with an undershoot that takes long to recover; hum and drift lie under all of it. A second blow differs from
these in that it pushes the same way for about as long as the first one did. So the force is smoothed over the length of
the first pulse, which takes out what rings faster, and a bump counts only where it stands out from both sides within a
few lengths, which takes out what is slower.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d, maximum_filter1d, minimum_filter1d

from frf_ipz.arrays import FloatArray, IntArray

HALF, NINE_TENTHS = 0.6745, 1.6449  # of normal noise stays below so many standard deviations
NARROWEST = 1.5  # samples of smoothing: below this a filter's ringing comes through
WIDE = 5.0  # samples of a pulse that is wider than what a filter makes of the shortest one
REACH = 6  # widths within which a bump must stand out from both sides
APART = 2  # widths between the first pulse and what can be told from it
SURE = 8.0  # standard deviations of the smoothed noise
ONSET = 0.05  # of the peak


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pulse:
    """The strongest pulse of a force signal.

    Parameters
    ----------
    peak : int
        Sample of its extreme value.
    onset : int
        Sample where the force first passes 5 % of it.
    height : float
        Extreme value above the base, with its sign, in the units of the force.
    width : float
        Length at half of the height, samples.
    base : float
        Level outside the pulse.
    noise : float
        Standard deviation outside the pulse.
    bumps : (n,) int array
        Samples of further pulses in the same direction.
    ratios : (n,) array
        Their heights over that of the strongest pulse, both smoothed.
    """

    peak: int
    onset: int
    height: float
    width: float
    base: float
    noise: float
    bumps: IntArray
    ratios: FloatArray


def find_pulse(force: FloatArray, *, threshold: float) -> Pulse:
    """Find the strongest pulse of a force signal, and further ones.

    Parameters
    ----------
    force : (n,) array
        The force, any unit.
    threshold : float
        Height of a further pulse that counts, over that of the strongest.

    Returns
    -------
    Pulse
        What was found; for a signal without a pulse its height is not far above its noise.
    """
    base = float(np.median(force))
    rise = force - base
    peak = int(np.argmax(np.abs(rise)))
    height = float(rise[peak])
    upward = rise if height >= 0.0 else -rise
    width = _width(upward, peak)
    onset = peak - _run_length(upward[peak::-1] > ONSET * abs(height)) + 1
    outside = np.abs(np.arange(len(force)) - peak) > 8 * max(width, NARROWEST)
    noise = _spread(rise[outside])
    bumps, ratios = _bumps(upward, peak, max(width, NARROWEST), outside, threshold)
    if (
        width > WIDE and not bumps.size
    ):  # no filter rings that slowly: look again with less smoothing for a bump near by
        bumps, ratios = _bumps(upward, peak, 0.5 * width, outside, 2.0 * threshold)
    return Pulse(peak=peak, onset=onset, height=height, width=width, base=base, noise=noise, bumps=bumps, ratios=ratios)


def pulse_extent(force: FloatArray, pulse: Pulse, *, sure: float = 4.0) -> tuple[int, int]:
    """Find the stretch around a pulse, ringing included, that stands out from the noise.

    Parameters
    ----------
    force : (n,) array
        The force.
    pulse : Pulse
        Its pulse.
    sure : float
        Standard deviations of the noise that a sample must exceed.

    Returns
    -------
    start, stop : int
        First sample and the one after the last. The stretch ends where nothing stands out for a while, so that slow
        drift far from the pulse does not count.
    """
    floor = max(sure * pulse.noise, 1e-5 * abs(pulse.height))
    loud = np.abs(force - pulse.base) > floor
    gap = max(6, int(3 * pulse.width))
    before = _reach(loud[pulse.peak :: -1], gap)
    after = _reach(loud[pulse.peak :], gap)
    return pulse.peak - before, pulse.peak + after + 1


def _bumps(
    upward: FloatArray, peak: int, scale: float, outside: np.ndarray, threshold: float
) -> tuple[IntArray, FloatArray]:
    smooth = gaussian_filter1d(upward, scale, mode="nearest")
    reach = max(int(REACH * scale), 3)
    left = minimum_filter1d(smooth, reach, origin=(reach - 1) // 2, mode="nearest")
    right = minimum_filter1d(smooth, reach, origin=-(reach // 2), mode="nearest")
    standing_out = smooth - np.maximum(left, right)
    top = smooth == maximum_filter1d(smooth, 2 * int(1.5 * scale) + 1, mode="nearest")
    first = float(smooth[max(peak - int(scale), 0) : peak + int(scale) + 1].max())
    rough = smooth - gaussian_filter1d(smooth, 3.0 * scale, mode="nearest")  # without hum and drift
    floor = max(threshold * first, SURE * _spread(rough[outside]))
    counts = top & (standing_out > floor) & (np.abs(np.arange(len(upward)) - peak) > APART * scale)
    bumps = np.flatnonzero(counts)
    # What rings swings below its surroundings as far as above: count from their middle, not from the trough.
    around = [np.median(smooth[max(bump - 2 * reach, 0) : bump + 2 * reach]) for bump in bumps]
    heights = np.minimum(standing_out[bumps], smooth[bumps] - np.array(around)) if bumps.size else np.empty(0)
    kept = heights > floor
    return bumps[kept], heights[kept] / first


def _spread(values: FloatArray) -> float:
    """Estimate the standard deviation of noise among outliers, also where most samples are the same digital step."""
    if values.size == 0:
        return 0.0
    size = np.abs(values)
    return float(max(np.median(size) / HALF, np.quantile(size, 0.9) / NINE_TENTHS))


def _width(upward: FloatArray, peak: int) -> float:
    half = 0.5 * upward[peak]
    return _half_width(upward[peak::-1], half) + _half_width(upward[peak:], half)


def _half_width(falling: FloatArray, half: float) -> float:
    """Find where a flank falls through half of the height, between samples."""
    count = _run_length(falling > half)
    if count == len(falling):
        return float(count)
    high, low = falling[count - 1], falling[count]
    return count - 1 + float((high - half) / (high - low))


def _run_length(flags: np.ndarray) -> int:
    """Count how many flags are set before the first one that is not."""
    return int(np.argmin(flags)) if not flags.all() else len(flags)


def _reach(loud: np.ndarray, gap: int) -> int:
    """Find the last loud sample before the first quiet stretch of a given length."""
    places = np.flatnonzero(loud)
    if places.size == 0:
        return 0
    breaks = np.flatnonzero(np.diff(places) > gap)
    return int(places[breaks[0]] if breaks.size else places[-1])
