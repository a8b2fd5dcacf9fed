"""The table of records: one row each, with what was measured and what is wrong."""

from __future__ import annotations

from typing import TYPE_CHECKING

from frf_ipz.late_imports import import_late
from frf_ipz.visible_text import written_out

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd

    from frf_ipz.ingest.survey.record_info import RecordInfo, Survey
else:
    pd = import_late("pandas")

COLUMNS = (
    "record",
    "input_dof",
    "peak_force_N",
    "pulse_s",
    "used",
    "weight",
    "marks",
    "second_pulse_ratio",
    "remaining_amplitude",
    "slowest_mode_hz",
    "snr_db",
    "force_noise_N",
    "force_band_hz",
    "step_s",
    "samples",
    "trigger_s",
    "unlike_others",
)


def record_table(survey: Survey, energies: Sequence[float]) -> pd.DataFrame:
    """Make the table of records.

    Parameters
    ----------
    survey : Survey
        All records.
    energies : sequence of float
        Energy of each record's force under its window, 0 for those that are left out; its share among the records of
        its set-up is its weight in H1.

    Returns
    -------
    DataFrame
        Columns as `FrfEstimate` documents them.
    """
    totals: dict[object, float] = {}
    for record, energy in zip(survey.records, energies, strict=True):
        totals[record.setup] = totals.get(record.setup, 0.0) + energy
    rows = [
        _make_row(record, energy / totals[record.setup] if totals[record.setup] else 0.0)
        for record, energy in zip(survey.records, energies, strict=True)
    ]
    return pd.DataFrame(rows, columns=list(COLUMNS))


def empty_record_table() -> pd.DataFrame:
    """Make the table of a test without recordings.

    Returns
    -------
    DataFrame
        The columns, no rows.
    """
    return pd.DataFrame([], columns=list(COLUMNS))


def _make_row(record: RecordInfo, weight: float) -> tuple[object, ...]:
    return (
        record.name,
        str(record.setup.input_dof),
        record.peak_force,
        record.pulse_s,
        record.used,
        weight,
        written_out("; ".join(record.marks)),
        record.second_pulse_ratio,
        record.remaining_amplitude,
        record.slowest_mode_hz,
        record.snr_db,
        record.force_noise,
        record.force_band_hz,
        record.step_s,
        record.n_samples,
        record.trigger * record.step_s,
        record.is_unlike,
    )
