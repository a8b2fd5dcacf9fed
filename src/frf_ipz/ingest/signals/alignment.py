"""Two recorders of one record: when the second began, by what both recorded, and its channels on the first's time.

A common signal a(t) of the first is g b(t - d) in the second, which began d later; its clock may run at another rate.
The largest cross-correlation gives d to a sample. Parts of the record then give what is left, by least squares on b and
its derivative, each with the deviation that its remainder leaves where the signal changes (HC3 of [MacKinnon1985]: two
recorders do not sample a pulse alike, and noise beside it does not tell that); a straight line through them is d, and
the clock's rate.

.. [MacKinnon1985] J. G. MacKinnon, H. White, Some heteroskedasticity-consistent covariance matrix estimators with
   improved finite sample properties, Journal of Econometrics 29 (1985), doi:10.1016/0304-4076(85)90158-7.
.. [Oppenheim1999] A. V. Oppenheim, R. W. Schafer, Discrete-time signal processing, 2nd edition, 1999.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray

N_PARTS = 8  # of a record, for the clock's rate
N_ITERATIONS = 10  # of Gauss and Newton at most, from within half a sample
CONVERGED = 0.1  # deviations: a smaller step changes nothing that is known
SIDE = 0.05  # samples to each side, for the derivative
HALF_TAPS = 32  # samples on each side that interpolate
KAISER_BETA = 8.6  # of the window on them: 90 dB, [Oppenheim1999] eq. (7.62)
CLEAR = 3.0  # deviations from which a rate of the clock differs from that of the first
AGREES = 0.5  # of the power of a signal in both recorders: at less, more of it is something else
TINY = float(np.finfo(float).tiny)
BLOCK = 1 << 15  # samples that are interpolated at once


@dataclass(frozen=True, slots=True, kw_only=True)
class Alignment:
    """When a second recorder began, and how fast its clock runs.

    Parameters
    ----------
    delay_s : float
        From the first sample of the first recorder to that of the second, s.
    drift : float
        What the delay grows by in each second.
    std_s : float
        Standard deviation of the delay at the beginning, s.
    explained : float
        Share of the common signal's power that agrees; 1 where there is no common signal.
    """

    delay_s: float
    drift: float = 0.0
    std_s: float = 0.0
    explained: float = 1.0


def align(first: FloatArray, second: FloatArray, step_s: float, second_step_s: float) -> Alignment:
    """Find when a second recorder began, by a signal that both recorded.

    Parameters
    ----------
    first, second : (n,), (m,) array
        The signal in both; its scale may differ.
    step_s, second_step_s : float
        Time steps, s.

    Returns
    -------
    Alignment
        With its deviation.

    Examples
    --------
    >>> time = np.arange(2048) / 1024.0
    >>> pulse = lambda t: np.exp(-(((t - 0.5) / 0.004) ** 2))
    >>> found = align(pulse(time), 2.0 * pulse(time + 0.1003), 1 / 1024, 1 / 1024)
    >>> round(found.delay_s, 6), round(found.explained, 3)
    (0.1003, 1.0)
    """
    a, b = first - np.mean(first), second - np.mean(second)
    length = len(a) + len(b)
    correlation = np.fft.irfft(np.fft.rfft(a, length) * np.fft.rfft(b, length).conj(), length)
    lag = int(np.argmax(np.abs(correlation)))
    lag -= length if lag >= len(a) else 0
    delay_s, drift, std_s, explained = lag * step_s, 0.0, 0.0, 0.0
    for _ in range(N_ITERATIONS):
        rows, positions = _overlap(len(a), len(b), step_s, second_step_s, Alignment(delay_s=delay_s, drift=drift))
        if len(rows) < N_PARTS * HALF_TAPS:
            break
        shifted = resample(b[:, None], positions)[:, 0]
        sides = [resample(b[:, None], np.clip(positions + side, 0.0, len(b) - 1.0))[:, 0] for side in (-SIDE, SIDE)]
        slope = (sides[1] - sides[0]) / (2.0 * SIDE * second_step_s)
        delay, rate, std_s, explained = _refine(a[rows], shifted, slope, rows * step_s, has_drift=bool(drift))
        delay_s, drift = delay_s + delay, drift + rate
        if abs(delay) <= CONVERGED * std_s and not rate:
            break
    return Alignment(delay_s=delay_s, drift=drift, std_s=std_s, explained=explained)


def join(first: FloatArray, second: FloatArray, alignment: Alignment) -> FloatArray:
    """Put the signals of the second recorder beside those of the first, as far as both recorded.

    Parameters
    ----------
    first, second : (n, 1 + k), (m, 1 + l) array
        Times, s, and signals.
    alignment : Alignment
        When the second began.

    Returns
    -------
    (n_common, 1 + k + l) array
        Times of the first, its signals, and those of the second at these times.
    """
    steps = [float(table[-1, 0] - table[0, 0]) / (len(table) - 1) for table in (first, second)]
    rows, positions = _overlap(len(first), len(second), steps[0], steps[1], alignment)
    return np.column_stack([first[rows], resample(second[:, 1:], positions)])


def resample(values: FloatArray, positions: FloatArray) -> FloatArray:
    """Interpolate signals between their samples, up to close to half of the rate.

    Parameters
    ----------
    values : (n_samples, n_signals) array
        Signals.
    positions : (n_positions,) array
        Places in samples, from 0; not outside of the signals.

    Returns
    -------
    (n_positions, n_signals) array
        Values there; those of the samples themselves at whole positions.
    """
    whole = np.rint(positions).astype(np.int64)
    if np.abs(positions - whole).max(initial=0.0) < 1e-9:  # of a sample: rounding
        return np.asarray(values[whole])
    padded = np.pad(values, ((HALF_TAPS, HALF_TAPS), (0, 0)), mode="reflect", reflect_type="odd")
    taps = np.arange(1 - HALF_TAPS, 1 + HALF_TAPS)
    result = np.empty((len(positions), values.shape[1]))
    for start in range(0, len(positions), BLOCK):
        part = positions[start : start + BLOCK]
        floor = np.minimum(np.floor(part).astype(np.int64), len(values) - 1)
        distance = (part - floor)[:, None] - taps
        window = np.i0(KAISER_BETA * np.sqrt(np.maximum(1.0 - (distance / HALF_TAPS) ** 2, 0.0))) / np.i0(KAISER_BETA)
        gathered = padded[floor[:, None] + taps + HALF_TAPS]
        result[start : start + BLOCK] = np.einsum("pt,pts->ps", np.sinc(distance) * window, gathered)
    return result


def _overlap(
    n_first: int, n_second: int, step_s: float, second_step_s: float, alignment: Alignment
) -> tuple[np.ndarray, FloatArray]:
    """Give the rows of the first that the second has too, and where they lie among its samples."""
    time = np.arange(n_first) * step_s
    positions = (time - alignment.delay_s - alignment.drift * time) / second_step_s
    rows = np.flatnonzero((positions >= -1e-9) & (positions <= n_second - 1 + 1e-9))
    return rows, np.clip(positions[rows], 0.0, n_second - 1.0)


def _refine(
    a: FloatArray, shifted: FloatArray, slope: FloatArray, time: FloatArray, *, has_drift: bool
) -> tuple[float, float, float, float]:
    """Give what is left of delay and rate, the delay's deviation, and the share of the power that is explained."""
    scale = float(shifted @ a) / max(float(shifted @ shifted), TINY)
    left = a - scale * shifted
    explained = 1.0 - float(left @ left) / max(float(a @ a), TINY)
    delays, weights, centres = [], [], []
    for part in np.array_split(np.arange(len(a)), N_PARTS):
        columns = np.column_stack([shifted[part], -scale * slope[part], np.ones(len(part))])
        normal = columns.T @ columns
        power = float(shifted[part] @ shifted[part]) * float(a[part] @ a[part])
        agreed = float(shifted[part] @ a[part]) ** 2 / max(power, TINY)
        if agreed < AGREES or np.linalg.matrix_rank(normal) < len(normal):  # noise knows no delay
            continue
        inverse = np.linalg.inv(normal)
        found = inverse @ columns.T @ left[part]
        leverage = np.einsum("ni,ij,nj->n", columns, inverse, columns)
        remainder = (left[part] - columns @ found) / np.maximum(1.0 - leverage, np.finfo(float).eps)
        variance = float(np.sum((inverse[1] @ columns.T * remainder) ** 2))
        centre = float(np.average(time[part], weights=slope[part] ** 2))
        delays.append(float(found[1]))
        weights.append(1.0 / max(variance, TINY))
        centres.append(centre)
    if not delays:
        return 0.0, 0.0, 0.0, explained
    y, w, x = np.array(delays), np.array(weights), np.array(centres)
    mean, centre = float(np.average(y, weights=w)), float(np.average(x, weights=w))
    spread = float(np.sum(w * (x - centre) ** 2))
    rate = float(np.sum(w * (x - centre) * y) / spread) if spread > 0.0 and len(y) > 2 else 0.0
    rest = y - mean - rate * (x - centre)
    inflation = max(1.0, float(np.sum(w * rest**2)) / max(len(y) - 2, 1))
    if rate**2 * spread <= CLEAR**2 * inflation:
        rate = 0.0
    variance = inflation * (1.0 / float(w.sum()) + (centre**2 / spread if rate or has_drift else 0.0))
    return mean - rate * centre, rate, float(np.sqrt(variance)), explained
