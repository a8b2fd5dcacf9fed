"""FRFs of a frequency range with all their lines: the page itself holds only what a screen can show of the whole."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from frf_ipz.errors import InputError
from frf_ipz.plotting.frfs import describe_frfs
from frf_ipz.report.plotly_drawing import draw_picture

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.runs.results import Results

DIGITS = 8  # of a number: neighbouring lines of a long record differ in the sixth


def zoomed_traces(run: Results, range_hz: tuple[float, float], selected: Sequence[int]) -> list[dict[str, Any]]:
    """Draw some FRFs over a frequency range, as the report draws all of them over everything.

    Parameters
    ----------
    run : Results
        What the run holds.
    range_hz : pair of float
        From, to, Hz; a line on each side of it is drawn too.
    selected : sequence of int
        Which FRFs.

    Returns
    -------
    list of dict
        ``x`` and ``y`` of each trace, FRF by FRF; null where a value is not known.

    Raises
    ------
    InputError
        If there are no such FRFs or lines.
    """
    estimate = run.estimate
    if estimate is None or not selected or not all(0 <= number < estimate.frfs.n_frfs for number in selected):
        raise InputError("this run has no such FRFs")
    frequency = estimate.frfs.frequency_hz
    first, last = np.searchsorted(frequency, range_hz)
    inside = np.zeros(len(frequency), bool)
    inside[max(int(first) - 1, 0) : int(last) + 1] = True
    if np.count_nonzero(inside) < 2:
        raise InputError(f"no lines were measured from {range_hz[0]:g} to {range_hz[1]:g} Hz")
    part = estimate.frfs.select_frfs(selected).select_lines(inside)
    traces = draw_picture(describe_frfs(part, band_hz=range_hz))["data"]
    return [{axis: _numbers(trace[axis]) for axis in ("x", "y")} for trace in traces]


def _numbers(values: Any) -> list[float | None]:  # noqa: ANN401  arrays or lists, as traces hold them
    return [float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None for value in np.asarray(values, float)]
