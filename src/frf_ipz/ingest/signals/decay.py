"""How much of its amplitude a decaying response still has at the end of its record, and the noise under it.

The second half of the response is compared with the first, frequency by frequency: from the first to the second, the
power of a mode of decay rate a falls to exp(-a T), and so does its amplitude over the whole record of length T. The
median of neighbouring lines is the noise, since modes are narrow peaks. What does not become less, by more than noise
makes, is no mode: hum of any frequency.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import BoolArray, FloatArray
from frf_ipz.late_imports import import_late

if TYPE_CHECKING:
    from scipy.ndimage import maximum_filter1d, median_filter
else:
    maximum_filter1d = import_late("scipy.ndimage", "maximum_filter1d")
    median_filter = import_late("scipy.ndimage", "median_filter")

FEWEST_LINES = 32
NEIGHBOURS = 51  # lines whose median is the noise
MEDIAN = np.log(2.0)  # of the power of noise, over its mean
RINGING = 20.0  # times the noise: power of a mode that still rings
NOTABLE = 0.01  # of the strongest peak, in the response or in its velocity: weaker modes do not decide on a window
MAINS_HZ = (50.0, 60.0)
LEAST = 1e-6  # of a mode's amplitude: what is less is no more than rounding of a recording
CERTAIN = 3.0  # deviations by which a power has become less: chance says so of one hum in 700
STEADY = 0.8  # of its power: what remains of hum, which does not decay


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Decay:
    """What a response does towards the end of its record.

    Parameters
    ----------
    remaining_amplitude : float
        Share of its amplitude that the slowest mode still has at the end; 0 where nothing rings above the noise.
    frequency_hz : float
        Of that mode, Hz; 0 where there is none.
    noise : float
        Standard deviation of the noise.
    cut_off_ratio : float
        What is cut off at the end, of the mode of which most is, over the deviation of the noise on the line of its
        peak.
    cut_off_amplitude : float
        Share of its amplitude that this mode still has at the end.
    cut_off_hz : float
        Its frequency, Hz.
    """

    remaining_amplitude: float
    frequency_hz: float
    noise: float
    cut_off_ratio: float = 0.0
    cut_off_amplitude: float = 0.0
    cut_off_hz: float = 0.0


def measure_decay(response: FloatArray, step_s: float, power: int) -> Decay:
    """Measure how much of a response remains at the end of its record.

    Parameters
    ----------
    response : (n,) array
        From the impact on, SI.
    step_s : float
        Time step, s.
    power : int
        0 for a displacement, 1 for a velocity, 2 for an acceleration.

    Returns
    -------
    Decay
        What remains of the slowest mode, and the noise.
    """
    half = len(response) // 2
    if half < 2 * FEWEST_LINES:
        return Decay(remaining_amplitude=0.0, frequency_hz=0.0, noise=0.0)
    frequency, first, last = _power_of_halves(response, half, step_s)
    floor = _noise_floor(last)
    noise = float(np.sqrt(np.mean(floor) / np.sum(np.hanning(half) ** 2)))
    early_power = maximum_filter1d(first, 5)
    is_ringing = (last == maximum_filter1d(last, 7)) & (last > RINGING * floor) & (frequency > 2.5 / (half * step_s))
    is_ringing &= _is_notable(early_power, frequency, power)
    is_ringing &= _has_decayed(early_power, last, maximum_filter1d(_noise_floor(first), 5), floor)
    ratio = np.where(is_ringing, last / np.maximum(early_power, np.finfo(float).tiny), 0.0)
    ratio[_is_hum(frequency, ratio)] = 0.0
    slowest = int(np.argmax(ratio))
    cut_off = _cut_off_ratio(last / np.maximum(floor, np.finfo(float).tiny), np.where(ratio > LEAST, ratio, 0.0))
    largest = int(np.argmax(cut_off))
    return Decay(
        remaining_amplitude=float(ratio[slowest]),
        frequency_hz=float(frequency[slowest] * (ratio[slowest] > 0)),
        noise=noise,
        cut_off_ratio=float(cut_off[largest]),
        cut_off_amplitude=float(ratio[largest] * (cut_off[largest] > 0)),
        cut_off_hz=float(frequency[largest] * (cut_off[largest] > 0)),
    )


def _cut_off_ratio(last: FloatArray, amplitude: FloatArray) -> FloatArray:
    """Give what the record cuts off of modes, over the deviation of the noise of its transform.

    A mode exp(-a t), r = exp(-a T) at the end, has the transform ``r / a`` beyond it. Under the Hann window of the
    second half, the middle of which it passes at r^(3/4), it has ``r^(3/4) T / 4``. Noise has 16 / 3 times the power in
    the transform of the record that it has there.

    Parameters
    ----------
    last : (n_lines,) array
        Power of the second half, over that of its noise.
    amplitude : (n_lines,) array
        r; 0 where there is no mode.
    """
    inside = (amplitude > 0.0) & (amplitude < 1.0)
    r = np.where(inside, amplitude, 0.5)
    return np.asarray(np.where(inside, np.sqrt(3.0 / 16.0 * last) * 4.0 * r**0.25 / np.log(1.0 / r), 0.0))


def noise_power(signal: FloatArray, step_s: float, frequency_hz: FloatArray) -> FloatArray:
    """Estimate the power of the noise under a signal from its second half.

    Parameters
    ----------
    signal : (n,) array
        A decaying response, or a force whose pulse lies in the first half.
    step_s : float
        Time step, s.
    frequency_hz : (n_lines,) array
        Where to estimate it.

    Returns
    -------
    (n_lines,) array
        Expected squared modulus of the noise's discrete transform, per sample that goes into it; NaN for a signal that
        is too short.
    """
    half = len(signal) // 2
    if half < 2 * FEWEST_LINES:
        return np.full(len(frequency_hz), np.nan)
    frequency, _, last = _power_of_halves(signal, half, step_s)
    return np.interp(frequency_hz, frequency, _noise_floor(last) / np.sum(np.hanning(half) ** 2))


def _power_of_halves(signal: FloatArray, half: int, step_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    window = np.hanning(half)
    parts = np.stack([signal[:half], signal[-half:]]) * window
    spectra = np.fft.rfft(parts)
    first, last = spectra.real**2 + spectra.imag**2
    return np.asarray(np.fft.rfftfreq(half, step_s)), first, last


def _noise_floor(power: FloatArray) -> FloatArray:
    return np.asarray(median_filter(power, NEIGHBOURS, mode="reflect") / MEDIAN)


def _has_decayed(first: FloatArray, last: FloatArray, first_floor: FloatArray, last_floor: FloatArray) -> BoolArray:
    """Tell which lines have less power in the last half than in the first, by more than what lies under them makes.

    Something of the mean power F under a peak of power P changes it by sqrt(2 F / P), relative: noise, and the flanks
    of other modes. Hum of any frequency, and a noise that goes on, stay as they are.
    """
    least = np.finfo(float).eps ** 2 * max(first.max(), last.max()) + np.finfo(float).tiny  # what rounding makes of 0
    first, last = np.maximum(first, least), np.maximum(last, least)
    variance = 2.0 * (first_floor / first + last_floor / last)
    drop = np.log(first / last)
    return np.asarray((drop > 0.0) & (drop**2 > CERTAIN**2 * variance))


def _is_notable(power: FloatArray, frequency_hz: FloatArray, derivative: int) -> BoolArray:
    """Tell which peaks are large, in the signal as it is or as a velocity, in which all modes weigh alike."""
    velocity = power * np.maximum(frequency_hz, frequency_hz[3]) ** (2 * (1 - derivative))
    return np.asarray((power > NOTABLE**2 * power[3:].max()) | (velocity > NOTABLE**2 * velocity[3:].max()))


def _is_hum(frequency_hz: FloatArray, ratio: FloatArray) -> BoolArray:
    """Tell which lines are multiples of the mains' frequency and do not decay."""
    spacing = frequency_hz[1]
    is_multiple = np.zeros(len(frequency_hz), bool)
    for mains in MAINS_HZ:
        is_multiple |= np.abs(frequency_hz - mains * np.round(frequency_hz / mains)) < 1.5 * spacing
    # where lines are so wide that every one is close to a multiple, hum cannot be recognised
    return np.asarray(is_multiple & (ratio > STEADY) & (12.0 * spacing < MAINS_HZ[0]))
