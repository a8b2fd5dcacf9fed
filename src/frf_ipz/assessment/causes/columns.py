"""Columns of recordings that are exchanged: a force that rings, and a response that is a pulse.

The effective duration of a signal is that of a rectangle with the same energy and the same integral of its fourth
power, ``(int x^2)^2 / int x^4``: a pulse is short however high it is, a lightly damped response is long however weak.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.assessment.assessment import LikelyCause

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.frf import FrfLabel
    from frf_ipz.ingest.frf_estimate import Trace


def find_exchanged_columns(
    impacts: Sequence[Trace], labels: Sequence[FrfLabel], *, test_file: str
) -> LikelyCause | None:
    """Find a response that looks like the hammer's force, and a force that looks like a response.

    Parameters
    ----------
    impacts : sequence of Trace
        Forces and responses of a hammer's impacts.
    labels : sequence of FrfLabel
        Name the channels.
    test_file : str
        Where the columns are named.

    Returns
    -------
    LikelyCause or None
        None where every response lasts longer than the force, or there are no recordings.
    """
    inputs = {label.input_channel for label in labels}
    records = dict.fromkeys(trace.name for trace in impacts)
    found: list[tuple[str, str]] = []
    looked_at = 0
    for record in records:
        durations = {trace.channel: _duration(trace) for trace in impacts if trace.name == record}
        forces = [channel for channel in durations if channel in inputs]
        responses = {channel: length for channel, length in durations.items() if channel not in inputs}
        if len(forces) != 1 or not responses:
            continue
        looked_at += 1
        shortest = min(responses, key=responses.__getitem__)
        if responses[shortest] < durations[forces[0]]:
            found.append((forces[0], shortest))
    if not found:
        return None
    force, response = max(dict.fromkeys(found), key=found.count)
    return LikelyCause(
        says=f"the columns '{force}' and '{response}' are exchanged: the one that is called force rings, and the other "
        "is a pulse",
        file=test_file,
        line_or_key=f"[[channel]] column = '{force}' and column = '{response}'",
        probability=found.count((force, response)) / looked_at,
    )


def _duration(trace: Trace) -> float:
    values = trace.values - np.median(trace.values)
    fourth = float(np.trapezoid(values**4, trace.time_s))
    return float(np.trapezoid(values**2, trace.time_s)) ** 2 / fourth if fourth > 0 else np.inf
