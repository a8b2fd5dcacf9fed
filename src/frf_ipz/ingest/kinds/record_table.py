"""The table of blows: one row each, with what was measured and what is wrong."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pandas as pd

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.ingest.survey.record_info import BlowFacts, Survey

COLUMNS = (
    "blow",
    "input_dof",
    "peak_force_N",
    "pulse_s",
    "used",
    "weight",
    "marks",
    "second_pulse",
    "left_at_end",
    "left_at_hz",
    "snr_db",
    "force_noise_N",
    "step_s",
    "samples",
    "trigger_s",
)


def blow_table(survey: Survey, energies: Sequence[float]) -> pd.DataFrame:
    """Make the table of blows.

    Parameters
    ----------
    survey : Survey
        All blows.
    energies : sequence of float
        Energy of each one's force under its window, 0 for those that are left out; its share among the blows of its
        run is its weight in H1.

    Returns
    -------
    DataFrame
        Columns as `Recordings` documents them.
    """
    totals: dict[object, float] = {}
    for blow, energy in zip(survey.blows, energies, strict=True):
        totals[blow.run] = totals.get(blow.run, 0.0) + energy
    rows = [
        _row(blow, energy / totals[blow.run] if totals[blow.run] else 0.0)
        for blow, energy in zip(survey.blows, energies, strict=True)
    ]
    return pd.DataFrame(rows, columns=list(COLUMNS))


def empty_blow_table() -> pd.DataFrame:
    """Make the table of a test without recordings.

    Returns
    -------
    DataFrame
        The columns, no rows.
    """
    return pd.DataFrame([], columns=list(COLUMNS))


def _row(blow: BlowFacts, weight: float) -> tuple[object, ...]:
    return (
        blow.name,
        str(blow.run.input_dof),
        blow.peak_force,
        blow.pulse_s,
        blow.used,
        weight,
        "; ".join(blow.marks),
        blow.second_pulse,
        blow.left,
        blow.left_hz,
        blow.snr_db,
        blow.force_noise,
        blow.step_s,
        blow.n_samples,
        blow.trigger * blow.step_s,
    )
