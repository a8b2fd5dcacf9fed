"""Times that count from a date: in which unit, where a file does not say it.

Whatever the date is, such times lie in this century in few units only: 1.7e9 are seconds since 1970 (or since 1904, as
LabVIEW counts), 45000.5 are days since 1900 (Excel), 738000.5 days since the year 0 (datenum of MATLAB). The ranges are
those of the years 2000 to 2100.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.errors import InputError

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray

DAY_S = 86400.0
FINEST_DECIMALS = 3  # below half a step: what is rounded finer still is even within a hundredth of a step
CENTURY_D = 36525.0
IN_SECONDS = {"s": 1.0, "ms": 1e3, "us": 1e6, "0.1 us": 1e7, "ns": 1e9}  # counts in a second
DAYS_TO_2000 = {  # from where it is counted
    "s": (10957.0, 35064.0),  # 1970; 1904, LabVIEW
    "ms": (10957.0, 35064.0),
    "us": (10957.0,),
    "0.1 us": (145731.0, 730119.0),  # 1601, Windows; the year 1, .NET
    "ns": (10957.0,),
    # days since 1970, 1904 and 1900 (Excel), of the modified Julian date, since the year 0 (MATLAB), Julian
    "d": (10957.0, 35064.0, 36526.0, 51544.0, 730486.0, 2451544.5),
}
SLOWEST_HZ, FASTEST_HZ = 1.0, 1e7  # of recorders of vibration; a step in s and in days is told apart by them


def unit_of_stamps(times: FloatArray, sample_rate_hz: float | None = None) -> str:
    """Find the unit of times that count from a date.

    Parameters
    ----------
    times : (n,) array
        As a file gives them, the first ones at least.
    sample_rate_hz : float, optional
        Samples a second, where the test states it.

    Returns
    -------
    str
        The unit; empty where no unit makes them dates of this century, so that they are seconds.

    Raises
    ------
    InputError
        If they may be days as well as seconds.

    Examples
    --------
    >>> import numpy as np
    >>> unit_of_stamps(1.7e12 + np.arange(9.0)), unit_of_stamps(45000.5 + np.arange(9.0) / 1024 / 86400)
    ('ms', 'd')
    >>> unit_of_stamps(0.001 * np.arange(9.0)), unit_of_stamps(45000.5 + np.arange(9.0) / 1024)
    ('', '')
    """
    first = float(times[0]) if len(times) else 0.0
    unit = next((unit for unit in DAYS_TO_2000 if _is_of_century(first, unit)), "")
    return unit if unit != "d" else _days_or_seconds(times, sample_rate_hz)


def _is_of_century(count: float, unit: str) -> bool:
    days = count if unit == "d" else count / IN_SECONDS[unit] / DAY_S
    return any(start <= days < start + CENTURY_D for start in DAYS_TO_2000[unit])


def _days_or_seconds(times: FloatArray, sample_rate_hz: float | None) -> str:
    """Tell days from seconds by the rate that follows, which is 86 400 times lower where they are days."""
    step = float(times[-1] - times[0]) / max(len(times) - 1, 1)
    if not step > 0.0:
        return ""
    as_seconds_hz, as_days_hz = 1.0 / step, 1.0 / step / DAY_S
    if sample_rate_hz is not None:
        return "d" if abs(np.log(as_days_hz / sample_rate_hz)) < abs(np.log(as_seconds_hz / sample_rate_hz)) else ""
    if as_days_hz < SLOWEST_HZ:
        return ""
    if as_seconds_hz > FASTEST_HZ:
        return "d"
    raise InputError(
        f"its times begin at {times[0]:.10g} and may be days since a date, of {as_days_hz:.4g} samples a second, or "
        f"seconds, of {as_seconds_hz:.4g}; name the unit, as in 'time [d]', or write sample_rate_hz = ... under [test]"
    )


def decimal_resolution(times: FloatArray, below: float) -> float:
    """Say to which decimal digit times are rounded: those with the most digits before the point.

    Parameters
    ----------
    times : (n,) array
        As a file gives them.
    below : float
        What is not finer than this is no rounding that can be told from the times themselves.

    Returns
    -------
    float
        A power of ten, of which the largest times are multiples; 0 where they are not rounded so.

    Examples
    --------
    >>> import numpy as np
    >>> decimal_resolution(np.array([0.99023, 1.0003, 1.0107]), below=0.005)
    0.0001
    >>> decimal_resolution(np.array([1.0, 1.0 + 1 / 3]), below=0.1)
    0.0
    """
    sizes = np.abs(times)
    largest = float(sizes.max(initial=0.0))
    if not (0.0 < below < np.inf and 0.0 < largest < np.inf):
        return 0.0
    longest = sizes[sizes >= 10.0 ** np.floor(np.log10(largest))]
    coarsest = int(np.ceil(np.log10(below))) - 1
    for power in range(coarsest, coarsest - FINEST_DECIMALS, -1):
        counts = longest / 10.0**power
        if (np.abs(counts - np.rint(counts)) <= 4.0 * np.spacing(counts)).all():
            return float(10.0**power)
    return 0.0


def resolution_of(times: FloatArray) -> float:
    """Say how finely times are given: doubles of today are some microseconds apart, in days or in seconds.

    Parameters
    ----------
    times : (n,) array
        As a file gives them.

    Returns
    -------
    float
        1 where all are whole numbers, else the distance of the largest to the next double; in the unit of the times.

    Examples
    --------
    >>> import numpy as np
    >>> resolution_of(np.array([0.0, 7.0, 13.0])), resolution_of(np.array([738000.5, 738001.0]))
    (1.0, 1.1641532182693481e-10)
    """
    is_whole = len(times) > 0 and bool((times == np.rint(times)).all())
    spacing = float(np.spacing(np.abs(times).max(initial=0.0)))
    return max(1.0, spacing) if is_whole else spacing
