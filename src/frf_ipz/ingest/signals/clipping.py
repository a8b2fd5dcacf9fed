"""Signals that were cut at the end of an amplifier's or a converter's range."""

from __future__ import annotations

import numpy as np

from frf_ipz.arrays import BoolArray, FloatArray

EQUAL = 1e-6  # of the range, or of the extreme value: values that differ by less were the same reading
FEWEST_STEPS = 30  # digital steps: a signal of fewer has equal extreme values by nature
CORNER = 4.0  # digital steps: a smooth top falls off less than this beside two equal samples
SYMMETRIC = 1e-3  # of the height: a pulse without noise that is sampled symmetrically has equal samples in pairs
NEAR_TOP = 0.03  # of the height: samples just below the top
PILED_UP = 3.0  # times as many samples at the top as smooth tops have
STEEP = 0.01  # of the height: drop of the signal beside a plateau that was cut
FAR_SIDE = 0.25  # of the range: the other side of a pulse, or of a signal that was cut on one side, is less
FEWEST_CUTS = 2  # of the far side: a signal that rests there before it begins has one plateau


def is_clipped(signal: FloatArray, *, goes_one_way: bool = False) -> bool:
    """Tell whether a signal was cut off at its highest or lowest value.

    A smooth top may hold a few equal samples where the digital steps are coarse, and leaves them gently; a top that was
    cut is left steeply, or is met again and again. Each side is judged by its own extreme value, however far the other
    goes: an amplifier with an offset, or a stop, cuts one side.

    Parameters
    ----------
    signal : (n,) array
        As recorded.
    goes_one_way : bool
        A pulse, whose far side is noise.

    Returns
    -------
    bool
        True if it was.

    Examples
    --------
    >>> time = np.arange(1000.0)
    >>> decay = np.exp(-time / 200) * np.sin(0.2 * time)
    >>> is_clipped(decay), is_clipped(np.minimum(decay, 0.1))
    (False, True)
    """
    return any(_cut_sides(signal, goes_one_way=goes_one_way))


def find_clipped_part(signal: FloatArray) -> FloatArray:
    """Estimate what the end of a range cut off a signal: cubics that leave and meet it with its own slopes.

    Parameters
    ----------
    signal : (n,) array
        As recorded.

    Returns
    -------
    (n,) array
        What it lacks; 0 where nothing was cut.

    Examples
    --------
    >>> time = np.arange(1000.0)
    >>> decay = np.exp(-time / 200) * np.sin(0.2 * time)
    >>> part = find_clipped_part(np.minimum(decay, 0.5))
    >>> round(float(part.max()), 2), round(float((decay - 0.5).max()), 2)
    (0.44, 0.46)
    """
    part = np.zeros(len(signal))
    for sign, is_cut in zip((1.0, -1.0), _cut_sides(signal), strict=True):
        if is_cut:
            part += sign * _cut_off(sign * signal)
    return part


def _cut_off(upward: FloatArray) -> FloatArray:
    """Give what lies above the highest value, with the slopes beside each plateau."""
    top = float(upward.max())
    part = np.zeros(len(upward))
    for start, stop in _plateau_edges(upward, EQUAL * float(np.ptp(upward))):
        if start < 2 or stop > len(upward) - 2:
            continue
        rise, fall = (
            max(float(near - far), float(top - near))
            for near, far in (upward[[start - 1, start - 2]], upward[[stop, stop + 1]])
        )
        left = start - min(1.0, (top - upward[start - 1]) / rise) if rise else float(start)
        right = stop - 1 + (min(1.0, (top - upward[stop]) / fall) if fall else 0.0)
        length = right - left
        u = (np.arange(start, stop) - left) / length if length else np.zeros(stop - start)
        part[start:stop] = length * (rise * u * (1 - u) ** 2 + fall * u**2 * (1 - u))
    return part


def _cut_sides(signal: FloatArray, *, goes_one_way: bool = False) -> tuple[bool, bool]:
    """Tell whether a signal was cut at its highest, and at its lowest value."""
    height = float(np.ptp(signal))
    if height == 0.0:
        return False, False
    step = digital_step(signal)
    if height < FEWEST_STEPS * step:
        return False, False
    centre = float(np.median(signal))
    # the sample beside a plateau may lie just past the corner: fine signals show the next
    sides = [(side, _find_plateaus(side, reach=1 if step else 2)) for side in (signal - centre, centre - signal)]
    is_symmetric = not step and abs(float(signal.max() + signal.min())) < EQUAL * height  # both ends of the range
    if is_symmetric and any(_has_corners(*side) for side in sides):
        return True, True
    up, down = (
        _is_cut(*side, step)
        if side[0].max() >= FAR_SIDE * height
        else not goes_one_way and _is_far_side_cut(*side, step, height)
        for side in sides
    )
    return up, down


def digital_step(signal: FloatArray) -> float:
    """Find the step between the values of a signal that was digitised coarsely.

    Parameters
    ----------
    signal : (n,) array
        As recorded.

    Returns
    -------
    float
        The step; 0 where the signal is too fine to show one.

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


def find_saturated_peaks(peaks: FloatArray, widths: FloatArray) -> BoolArray:
    """Find peaks of several pulses that are equal to the last digit: they reached the end of one range.

    Parameters
    ----------
    peaks : (n,) array
        Extreme values of different records, with signs.
    widths : (n,) array
        Their lengths. Pulses that agree in both are copies of one impact, which says nothing about a range.

    Returns
    -------
    (n,) bool array
        True for the largest peaks, where several are equal.
    """
    if peaks.size < 2:
        return np.zeros(peaks.size, bool)
    top = peaks[np.argmax(np.abs(peaks))]
    is_top = np.abs(peaks - top) <= EQUAL * abs(top)
    widths_differ = float(np.ptp(widths[is_top])) > EQUAL * float(widths[is_top].max())
    return np.asarray(is_top & widths_differ)


def _find_plateaus(upward: FloatArray, reach: int) -> list[_Plateau]:
    top = float(upward.max())
    return [_Plateau(upward, start, stop, top, reach) for start, stop in _plateau_edges(upward, EQUAL * top)]


def _plateau_edges(upward: FloatArray, tolerance: float) -> list[tuple[int, int]]:
    """Give the first sample of each run of highest values, and the one after its last."""
    at_top = upward >= float(upward.max()) - tolerance
    edges = np.flatnonzero(np.diff(at_top.astype(np.int8), prepend=0, append=0))
    return [(int(start), int(stop)) for start, stop in edges.reshape(-1, 2)]


def _is_far_side_cut(upward: FloatArray, plateaus: list[_Plateau], step: float, height: float) -> bool:
    top = float(upward.max())
    if top < FEWEST_STEPS * max(step, EQUAL * height):
        return False
    return sum(plateau.length >= 3 for plateau in _steep(plateaus, top, step)) >= FEWEST_CUTS


def _steep(plateaus: list[_Plateau], top: float, step: float) -> list[_Plateau]:
    floor = max(STEEP * top, CORNER * step)
    return [plateau for plateau in plateaus if plateau.drop > floor]


def _is_cut(upward: FloatArray, plateaus: list[_Plateau], step: float) -> bool:
    top = float(upward.max())
    steep = _steep(plateaus, top, step)
    longest = max((plateau.length for plateau in steep), default=0)
    if step:
        return longest >= 3 or sum(plateau.length == 2 for plateau in steep) >= 2 or _is_piled_up(upward, plateaus)
    is_lopsided = any(plateau.length == 2 and plateau.asymmetry > SYMMETRIC * top for plateau in steep)
    return longest >= 3 or is_lopsided or (len(plateaus) >= 2 and _has_corners(upward, plateaus))


class _Plateau:
    """Equal samples at the top: how many, how far the signal falls beside them, and how unequally."""

    def __init__(self, upward: FloatArray, start: int, stop: int, top: float, reach: int) -> None:
        neighbours = [float(upward[sample]) for sample in (start - 1, stop) if 0 <= sample < len(upward)]
        vicinity = upward[max(start - reach, 0) : stop + reach]
        self.length = stop - start
        self.drop = top - float(vicinity.min())
        self.asymmetry = max(neighbours) - min(neighbours) if neighbours else 0.0


def _has_corners(upward: FloatArray, plateaus: list[_Plateau]) -> bool:
    """Tell whether more samples stand at the top of a fine signal than smooth tops have.

    Smooth tops fall off with the square of time: of the samples near them, a part that is a square root is at the top.
    A sweep has hundreds of tops of one height.
    """
    n_at_top, n_near_top = _count_at_and_near_top(upward, plateaus)
    return bool(n_at_top > PILED_UP * n_near_top * np.sqrt(EQUAL / NEAR_TOP))


def _is_piled_up(upward: FloatArray, plateaus: list[_Plateau]) -> bool:
    """Tell whether far more samples stand at the top than just below it."""
    n_at_top, n_near_top = _count_at_and_near_top(upward, plateaus)
    return n_at_top >= 3 and n_at_top > 2 * n_near_top


def _count_at_and_near_top(upward: FloatArray, plateaus: list[_Plateau]) -> tuple[int, int]:
    """Count samples at the top, and just below it."""
    n_at_top = sum(plateau.length for plateau in plateaus)
    return n_at_top, int((upward > (1 - NEAR_TOP) * upward.max()).sum()) - n_at_top
