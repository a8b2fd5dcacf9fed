"""The pulse of a hammer's impact, and further pulses beside it.

Real force signals ring after the pulse: anti-alias filters at the edge of their band, the hammer at its own resonance,
amplifiers with an undershoot that takes long to recover; hum and drift lie under all of it. A second hit differs from
these in that it pushes the same way for about as long as the first one did. So the force is smoothed over the length of
the first pulse, which removes faster ringing, and a bump counts only where it stands out from both sides within a few
lengths, which removes slower motion.

[Halvorsen1977] W. G. Halvorsen, D. L. Brown, Impulse technique for structural frequency response testing, Sound and
Vibration 11, 1977, 8-21.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import BoolArray, FloatArray, IntArray
from frf_ipz.late_imports import import_late

if TYPE_CHECKING:
    from scipy.ndimage import gaussian_filter1d, maximum_filter1d, minimum_filter1d
else:
    gaussian_filter1d = import_late("scipy.ndimage", "gaussian_filter1d")
    maximum_filter1d = import_late("scipy.ndimage", "maximum_filter1d")
    minimum_filter1d = import_late("scipy.ndimage", "minimum_filter1d")

HALF, NINE_TENTHS = 0.6745, 1.6449  # of normal noise lies within so many standard deviations
NARROWEST = 1.5  # samples of smoothing: below this a filter's ringing comes through
WIDE = 5.0  # samples of a pulse that is wider than what a filter makes of the shortest one
REACH = 6  # widths within which a bump must stand out from both sides
SEPARATION = 2  # widths between the first pulse and a bump that is distinct from it
RINGING = 6  # samples in which a filter rings through zero
SIGNIFICANT = 8.0  # standard deviations of the smoothed noise
ONSET = 0.05  # of the peak
BAND_LEVEL = 0.1  # of the spectrum's largest modulus, 20 dB below it: the end of a hammer's band [Halvorsen1977]
PADDING = 8  # lengths of the pulse: its spectrum is then smooth enough to read the end of the band off


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
        Of a signal without a pulse, the height is not far above the noise.
    """
    base = float(np.median(force))
    rise = force - base
    peak = int(np.argmax(np.abs(rise)))
    height = float(rise[peak])
    upward = rise if height >= 0.0 else -rise
    width = _width_at_half(upward, peak)
    onset = peak - _run_length(upward[peak::-1] > ONSET * abs(height)) + 1
    outside = np.abs(np.arange(len(force)) - peak) > 8 * max(width, NARROWEST)
    noise = _noise_level(rise[outside])
    bumps, ratios = _find_bumps(upward, peak, max(width, NARROWEST), outside, threshold)
    if width > WIDE and not bumps.size:
        # no filter rings that slowly: with less smoothing, a bump close to the pulse shows
        bumps, ratios = _find_bumps(upward, peak, 0.5 * width, outside, 2.0 * threshold)
    return Pulse(peak=peak, onset=onset, height=height, width=width, base=base, noise=noise, bumps=bumps, ratios=ratios)


def pulse_extent(force: FloatArray, pulse: Pulse, *, significance: float = 4.0) -> tuple[int, int]:
    """Find the interval around a pulse, ringing included, that stands out from the noise.

    Parameters
    ----------
    force : (n,) array
        The force.
    pulse : Pulse
        Its pulse.
    significance : float
        Standard deviations of the noise that a sample must exceed.

    Returns
    -------
    start, stop : int
        First sample and the one after the last. The interval ends where nothing stands out for a while, so that slow
        drift far from the pulse does not count.
    """
    floor = max(significance * pulse.noise, 1e-5 * abs(pulse.height))
    loud = np.abs(force - pulse.base) > floor
    gap = quiet_length(pulse)
    samples_before = _last_before_gap(loud[pulse.peak :: -1], gap)
    samples_after = _last_before_gap(loud[pulse.peak :], gap)
    return pulse.peak - samples_before, pulse.peak + samples_after + 1


def quiet_length(pulse: Pulse) -> int:
    """Give how many samples must be quiet for a pulse and its ringing to have ended.

    Parameters
    ----------
    pulse : Pulse
        The pulse.

    Returns
    -------
    int
        A filter rings through zero faster than that.
    """
    return max(RINGING, int(3 * pulse.width))


def force_band(pulse: FloatArray) -> float:
    """Find up to which frequency a pulse excites.

    Parameters
    ----------
    pulse : (n,) array
        The force from the beginning of a pulse to its end, without its base.

    Returns
    -------
    float
        Where its spectrum first falls 20 dB below its largest value, cycles a sample; 0.5 where it does not.
    """
    n_samples = PADDING * max(len(pulse), PADDING)
    size = np.abs(np.fft.rfft(pulse, n_samples))
    largest = int(np.argmax(size))
    below = np.flatnonzero(size[largest:] < BAND_LEVEL * size[largest])
    return float((largest + below[0]) / n_samples) if below.size else 0.5


def _find_bumps(
    upward: FloatArray, peak: int, scale: float, outside: BoolArray, threshold: float
) -> tuple[IntArray, FloatArray]:
    """Find bumps that stand out from both sides of a force smoothed over `scale`: samples, heights over the pulse."""
    smooth = gaussian_filter1d(upward, scale, mode="nearest")
    reach = max(int(REACH * scale), 3)
    lowest_before = minimum_filter1d(smooth, reach, origin=(reach - 1) // 2, mode="nearest")
    lowest_after = minimum_filter1d(smooth, reach, origin=-(reach // 2), mode="nearest")
    prominence = smooth - np.maximum(lowest_before, lowest_after)
    is_peak = smooth == maximum_filter1d(smooth, 2 * int(1.5 * scale) + 1, mode="nearest")
    first = float(smooth[max(peak - int(scale), 0) : peak + int(scale) + 1].max())
    high_pass = smooth - gaussian_filter1d(smooth, 3.0 * scale, mode="nearest")  # without hum and drift
    floor = max(threshold * first, SIGNIFICANT * _noise_level(high_pass[outside]))
    counts = is_peak & (prominence > floor) & (np.abs(np.arange(len(upward)) - peak) > SEPARATION * scale)
    bumps = np.flatnonzero(counts)
    # Ringing swings below its surroundings as far as above: heights count from their middle, not from the trough.
    levels = [np.median(smooth[max(bump - 2 * reach, 0) : bump + 2 * reach]) for bump in bumps]
    heights = np.minimum(prominence[bumps], smooth[bumps] - np.array(levels)) if bumps.size else np.empty(0)
    is_high = heights > floor
    return bumps[is_high], heights[is_high] / first


def _noise_level(values: FloatArray) -> float:
    """Estimate the standard deviation of noise among outliers, also where most samples are the same digital step."""
    if values.size == 0:
        return 0.0
    magnitude = np.abs(values)
    return float(max(np.median(magnitude) / HALF, np.quantile(magnitude, 0.9) / NINE_TENTHS))


def _width_at_half(upward: FloatArray, peak: int) -> float:
    half = 0.5 * upward[peak]
    return _half_width(upward[peak::-1], half) + _half_width(upward[peak:], half)


def _half_width(falling: FloatArray, half: float) -> float:
    """Find where a flank falls through half of the height, between samples."""
    count = _run_length(falling > half)
    if count == len(falling):
        return float(count)
    high, low = falling[count - 1], falling[count]
    return count - 1 + float((high - half) / (high - low))


def _run_length(flags: BoolArray) -> int:
    """Count how many flags are set before the first one that is not."""
    return int(np.argmin(flags)) if not flags.all() else len(flags)


def _last_before_gap(loud: BoolArray, gap: int) -> int:
    """Find the last loud sample before the first gap of a given length; 0 where none is loud."""
    samples = np.flatnonzero(loud)
    if samples.size == 0:
        return 0
    gaps = np.flatnonzero(np.diff(samples) > gap)
    return int(samples[gaps[0]] if gaps.size else samples[-1])
