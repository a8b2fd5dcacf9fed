"""Signals that were cut at the end of an amplifier's or a converter's range."""

from __future__ import annotations

import numpy as np

from frf_ipz.arrays import FloatArray

EQUAL = 1e-6  # of the range: values that differ by less were the same reading
FEWEST_STEPS = 30  # digital steps: a signal of fewer has equal extreme values by nature
CORNER = 4.0  # digital steps: a smooth top falls off less than this beside two equal samples
SYMMETRIC = 1e-3  # of the height: a pulse without noise that is sampled symmetrically has equal samples in pairs
NEAR, MORE = 0.03, 3.0  # of the height: samples near the top; and times as many at the top as smooth tops have
STEEP = 0.01  # of the height: what the signal falls beside a plateau that was cut


def is_clipped(signal: FloatArray) -> bool:
    """Tell whether a signal was cut off at its highest or lowest value.

    A smooth top may hold a few equal samples where the digital steps are coarse, and leaves them gently; a top that was
    cut is left steeply, or is met again and again.

    Parameters
    ----------
    signal : (n,) array
        As recorded.

    Returns
    -------
    bool
        True if it was.
    """
    height = float(np.ptp(signal))
    if height == 0.0:
        return False
    step = digital_step(signal)
    if height < FEWEST_STEPS * step:
        return False
    centre = float(np.median(signal))
    # the sample beside a plateau may lie just past the corner: fine signals show the next
    sides = [(side, _plateaus(side, reach=1 if step else 2)) for side in (signal - centre, centre - signal)]
    meets_both = not step and abs(float(signal.max() + signal.min())) < EQUAL * height  # ends of the range
    if meets_both and any(_has_corners(*side) for side in sides):
        return True
    return any(_is_cut(*side, step, height) for side in sides)


def digital_step(signal: FloatArray) -> float:
    """Find the step between the values of a signal that was made digital coarsely.

    Parameters
    ----------
    signal : (n,) array
        As recorded.

    Returns
    -------
    float
        The step; 0 where the signal is finer than can be told.

    Examples
    --------
    >>> digital_step(np.array([0.0, 0.5, 1.5, 0.5]))
    0.5
    """
    values = np.unique(signal)
    steps = np.diff(values)
    step = float(steps[steps > EQUAL * (values[-1] - values[0])].min(initial=np.inf))
    if not np.isfinite(step):
        return 0.0
    multiples = (values - values[0]) / step
    return step if float(np.abs(multiples - np.round(multiples)).max()) < 0.05 else 0.0


def share_a_rail(peaks: FloatArray, widths: FloatArray) -> np.ndarray:
    """Tell which of several pulses have equal peaks to the last digit: they met the end of one range.

    Parameters
    ----------
    peaks : (n,) array
        Extreme values of different blows, with signs.
    widths : (n,) array
        Their lengths. Pulses that are alike in both are copies of one blow, which says nothing about a range.

    Returns
    -------
    (n,) bool array
        True for a peak that is the largest and equals another one.
    """
    if peaks.size < 2:
        return np.zeros(peaks.size, bool)
    top = peaks[np.argmax(np.abs(peaks))]
    same = np.abs(peaks - top) <= EQUAL * abs(top)
    differ = float(np.ptp(widths[same])) > EQUAL * float(widths[same].max())
    return np.asarray(same & differ)


def _plateaus(upward: FloatArray, reach: int) -> list[_Plateau]:
    top = float(upward.max())
    at_top = upward >= top - EQUAL * float(np.ptp(upward))
    edges = np.flatnonzero(np.diff(at_top.astype(np.int8), prepend=0, append=0))
    return [_Plateau(upward, start, stop, top, reach) for start, stop in edges.reshape(-1, 2)]


def _is_cut(upward: FloatArray, plateaus: list[_Plateau], step: float, height: float) -> bool:
    top = float(upward.max())
    if top < 0.25 * height:  # the far side of a pulse that goes one way: its noise
        return False
    floor = max(STEEP * top, CORNER * step)
    steep = [plateau for plateau in plateaus if plateau.drop > floor]
    longest = max((plateau.length for plateau in steep), default=0)
    if step:
        return longest >= 3 or sum(plateau.length == 2 for plateau in steep) >= 2 or _is_piled_up(upward, plateaus)
    lopsided = any(plateau.length == 2 and plateau.lopsided > SYMMETRIC * top for plateau in steep)
    return longest >= 3 or lopsided or (len(plateaus) >= 2 and _has_corners(upward, plateaus))


class _Plateau:
    """Equal samples at the top: how many, how far the signal falls beside them, and how unequally."""

    def __init__(self, upward: FloatArray, start: int, stop: int, top: float, reach: int) -> None:
        beside = [float(upward[place]) for place in (start - 1, stop) if 0 <= place < len(upward)]
        around = upward[max(start - reach, 0) : stop + reach]
        self.length = stop - start
        self.drop = top - float(around.min())
        self.lopsided = max(beside) - min(beside) if beside else 0.0


def _has_corners(upward: FloatArray, plateaus: list[_Plateau]) -> bool:
    """Tell whether more samples stand at the top of a fine signal than smooth tops have.

    Smooth tops fall off with the square of time: of the samples near them, a part that is a square root is at the top.
    A sweep has hundreds of tops of one height.
    """
    count, near = _at_and_near_top(upward, plateaus)
    return bool(count > MORE * near * np.sqrt(EQUAL * np.ptp(upward) / (NEAR * upward.max())))


def _is_piled_up(upward: FloatArray, plateaus: list[_Plateau]) -> bool:
    """Tell whether far more samples stand at the top than just below it."""
    count, near = _at_and_near_top(upward, plateaus)
    return count >= 3 and count > 2 * near


def _at_and_near_top(upward: FloatArray, plateaus: list[_Plateau]) -> tuple[int, int]:
    """Count samples at the top, and just below it."""
    count = sum(plateau.length for plateau in plateaus)
    return count, int((upward > (1 - NEAR) * upward.max()).sum()) - count
