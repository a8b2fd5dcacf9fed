"""FRFs of a test of recordings: one blow or record in memory at a time, each added to the sums of its run.

What the kinds differ in is how one of them is added.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from frf_ipz.ingest.frf_estimate import FrfEstimate, Trace
from frf_ipz.ingest.kinds.averages import SetupAverage, about_variance, assemble_frfs
from frf_ipz.ingest.kinds.record_table import record_table
from frf_ipz.ingest.kinds.traces import record_traces
from frf_ipz.ingest.recording_files import RecordingFiles
from frf_ipz.ingest.records import read_records, survey_records
from frf_ipz.ingest.spectra import empty_sums

if TYPE_CHECKING:
    from collections.abc import Callable

    from frf_ipz.ingest.campaign import VibrationTest
    from frf_ipz.ingest.options import IngestOptions
    from frf_ipz.ingest.records import Record
    from frf_ipz.ingest.survey.record_info import Survey
    from frf_ipz.progress import Progress

SURVEYED = 0.6  # share of the work that the first look takes


def average_recordings(
    test: VibrationTest,
    options: IngestOptions,
    progress: Progress,
    add: Callable[[SetupAverage, Record, Survey], float],
) -> FrfEstimate:
    """Average all blows or records of a test.

    Parameters
    ----------
    test : VibrationTest
        The test.
    options : IngestOptions
        The user's choice.
    progress : Progress
        Told how far it is.
    add : callable
        Adds one blow or record to its run's sums, and returns the energy of its force.

    Returns
    -------
    FrfEstimate
        FRFs, table of blows, traces.

    Raises
    ------
    InputError
        If a recording cannot be used.
    """
    files = RecordingFiles(test=test)
    survey = survey_records(files, options, lambda fraction, text: progress(SURVEYED * fraction, text))
    n_lines, n_outputs = survey.n_samples // 2 + 1, len(test.output_channels)
    averages = {setup: SetupAverage(empty_sums(n_lines, n_outputs)) for setup in test.setups}
    energies: list[float] = []
    traces: tuple[Trace, ...] = ()
    records = read_records(test, options, survey=survey, files=files, used_only=False)
    for done, (info, record) in enumerate(zip(survey.records, records, strict=True)):
        progress(SURVEYED + (1.0 - SURVEYED) * done / len(survey.records), f"averaging {record.name}")
        traces = record_traces(info, record, traces)
        energies.append(add(averages[info.setup], record, survey) if record.used else 0.0)
    return FrfEstimate(
        frfs=assemble_frfs(test, survey, averages, options),
        records=record_table(survey, energies),
        traces=traces,
        choices=survey.choices,
        warnings=(*survey.warnings, *about_variance(averages)),
    )
