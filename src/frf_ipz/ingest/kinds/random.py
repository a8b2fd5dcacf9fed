"""FRFs of a test with a shaker: records whole under an exponential window, or in segments under Hann windows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.ingest.blows import read_blows, survey_blows
from frf_ipz.ingest.kinds.averages import RunAverage, about_variance, assemble_frfs
from frf_ipz.ingest.kinds.table import blow_table
from frf_ipz.ingest.kinds.traces import blow_traces
from frf_ipz.ingest.recording_files import RecordingFiles
from frf_ipz.ingest.recordings import Recordings, Trace
from frf_ipz.ingest.spectra import empty_sums
from frf_ipz.ingest.survey.random import independent_segments, segments_of

if TYPE_CHECKING:
    from collections.abc import Iterable

    from frf_ipz.arrays import FloatArray
    from frf_ipz.ingest.blows import Blow
    from frf_ipz.ingest.options import IngestOptions
    from frf_ipz.ingest.survey.facts import Survey
    from frf_ipz.ingest.test_file import Test
    from frf_ipz.progress import Progress

SURVEYED = 0.6  # share of the work that the first look takes


def estimate_random(test: Test, options: IngestOptions, progress: Progress) -> Recordings:
    """Estimate the FRFs of a test with a shaker.

    Parameters
    ----------
    test : Test
        The test.
    options : IngestOptions
        The user's choice.
    progress : Progress
        Told how far it is.

    Returns
    -------
    Recordings
        FRFs, table of records, traces.

    Raises
    ------
    InputError
        If a recording cannot be used.
    """
    files = RecordingFiles(test=test)
    survey = survey_blows(files, options, lambda fraction, text: progress(SURVEYED * fraction, text))
    n_lines, n_outputs = survey.n_samples // 2 + 1, len(test.output_channels)
    averages = {run: RunAverage(empty_sums(n_lines, n_outputs)) for run in test.runs}
    energies: list[float] = []
    traces: tuple[Trace, ...] = ()
    records = read_blows(test, options, survey=survey, files=files, used_only=False)
    for done, (facts, record) in enumerate(zip(survey.blows, records, strict=True)):
        progress(SURVEYED + (1.0 - SURVEYED) * done / len(survey.blows), f"averaging {record.name}")
        traces = blow_traces(facts, record, traces)
        energies.append(_add(averages[facts.run], record, survey) if record.used else 0.0)
    return Recordings(
        frfs=assemble_frfs(test, survey, averages, options),
        blows=blow_table(survey, energies),
        traces=traces,
        choices=survey.choices,
        warnings=(*survey.warnings, *about_variance(averages)),
    )


def _add(average: RunAverage, record: Blow, survey: Survey) -> float:
    """Add a record to its run's sums, and return the energy of its force."""
    before = average.sums.count
    energy = 0.0
    for signals in _pieces(record, survey):
        average.sums.add(signals[0], signals[1:])
        energy += float(np.sum(signals[0] ** 2))
    count = average.sums.count - before
    average.independent += independent_segments(count) if survey.segment else count
    return energy


def _pieces(record: Blow, survey: Survey) -> Iterable[FloatArray]:
    if survey.segment:
        return segments_of(np.vstack([record.force, record.responses]), survey.segment)
    return [record.windowed(survey.decay_1_s, survey.n_samples)]
