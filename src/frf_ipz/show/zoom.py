"""FRFs of a frequency range with all their lines: the page itself holds only what a screen can show of the whole."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from frf_ipz.errors import InputError
from frf_ipz.report.section import pictures_of
from frf_ipz.report.sections import frfs as frf_section

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.report.contents import RunContents

DIGITS = 8  # of a number: neighbouring lines of a long record differ in the sixth


def zoomed_traces(run: RunContents, range_hz: tuple[float, float], selected: Sequence[int]) -> list[dict[str, Any]]:
    """Draw some FRFs over a frequency range, as the report draws all of them over everything.

    Parameters
    ----------
    run : RunContents
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
    part = replace(estimate, frfs=estimate.frfs.select_frfs(selected).select_lines(inside))
    section = frf_section.build(replace(run, estimate=part, fit=None))
    (picture,) = pictures_of([] if section is None else [section])
    return [{axis: _numbers(trace[axis]) for axis in ("x", "y")} for trace in picture.traces]


def _numbers(values: Any) -> list[float | None]:  # noqa: ANN401  arrays or lists, as traces hold them
    return [float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None for value in np.asarray(values, float)]
