"""Whether machines change with their date or their serial number."""

from __future__ import annotations

import datetime
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.late_imports import import_late

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from scipy import stats

    from frf_ipz.arrays import FloatArray
else:
    stats = import_late("scipy.stats")

FEWEST = 5  # machines with a date or a number
DIGITS = re.compile(r"[0-9]+")


@dataclass(frozen=True, slots=True, kw_only=True)
class Drift:
    """How a frequency changes along the machines.

    Parameters
    ----------
    along : str
        ``date`` or ``serial_number``.
    mode : int
        Number of the mode in the fleet.
    percent_in_all : float
        From the first machine to the last, by the median of all slopes, %.
    p_value : float
        Probability of an order as clear as this one, or clearer, where there is no drift.
    is_significant : bool
        It is below the level, shared out among all modes.
    """

    along: str
    mode: int
    percent_in_all: float
    p_value: float
    is_significant: bool


def position(along: str, particulars: Mapping[str, str]) -> float:
    """Give where a machine stands in time, or in the order of serial numbers.

    Parameters
    ----------
    along : str
        ``date`` or ``serial_number``.
    particulars : mapping of str to str
        What is stated of its test.

    Returns
    -------
    float
        Days since the year 1, or the last number in the serial number; NaN where there is none.

    Examples
    --------
    >>> position("serial_number", {"serial_number": "AX-2026-0012"}), position("date", {"date": "0001-01-02"})
    (12.0, 2.0)
    """
    text = particulars.get(along, "").strip()
    if along == "date":
        try:
            return float(datetime.date.fromisoformat(text[:10]).toordinal())
        except ValueError:
            return float("nan")
    numbers = DIGITS.findall(text)
    return float(numbers[-1]) if numbers else float("nan")


def find_drifts(
    modes: Mapping[int, tuple[Sequence[int], FloatArray]], positions: Mapping[str, FloatArray], *, level: float
) -> list[Drift]:
    """Look for an order of each mode's frequency, by the rank correlation of Kendall and the slope of Theil and Sen.

    Parameters
    ----------
    modes : mapping of int to pair
        By the number of the mode: which machines have it, and its frequency in each, Hz.
    positions : mapping of str to (n_machines,) array
        Where each machine stands along ``date`` and ``serial_number``; NaN where that is not known.
    level : float
        Probability of any finding where there is no drift at all.

    Returns
    -------
    list of Drift
        Of every mode of enough machines.
    """
    tested = []
    for along, all_positions in positions.items():
        for mode, (machines, frequency_hz) in modes.items():
            places = all_positions[list(machines)]
            known = np.isfinite(places)
            if known.sum() >= FEWEST and np.ptp(places[known]) > 0:
                tested.append((along, mode, places[known], np.log(frequency_hz[known])))
    return [_drift(*entry, level / len(tested)) for entry in tested]


def _drift(along: str, mode: int, places: FloatArray, logs: FloatArray, level: float) -> Drift:
    p_value = float(stats.kendalltau(places, logs).pvalue)
    slope = float(stats.theilslopes(logs, places).slope)
    return Drift(
        along=along,
        mode=mode,
        percent_in_all=float(100 * np.expm1(slope * np.ptp(places))),
        p_value=p_value,
        is_significant=p_value < level,
    )
