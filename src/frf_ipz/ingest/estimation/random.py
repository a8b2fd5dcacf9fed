"""FRFs of a test with a shaker: whole records or sub-records without transients, or segments under Hann windows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.ingest.estimation.averaging import average_recordings
from frf_ipz.ingest.estimation.several_inputs import estimate_random_several
from frf_ipz.ingest.signals.periods import PeriodicForce, transform_parts
from frf_ipz.ingest.signals.transients import transform_subrecords
from frf_ipz.ingest.signals.windows import count_independent_segments, cut_segments

if TYPE_CHECKING:
    from collections.abc import Iterable

    from frf_ipz.arrays import FloatArray
    from frf_ipz.ingest.estimation.averaging import SetupAverage
    from frf_ipz.ingest.frf_estimate import FrfEstimate
    from frf_ipz.ingest.options import IngestOptions
    from frf_ipz.ingest.recording_files import RecordingFiles
    from frf_ipz.ingest.records import Record
    from frf_ipz.ingest.survey.record_info import RecordInfo, Survey
    from frf_ipz.progress import Progress


def estimate_random(files: RecordingFiles, options: IngestOptions, progress: Progress) -> FrfEstimate:
    """Estimate the FRFs of a test with a shaker.

    Parameters
    ----------
    files : RecordingFiles
        The recordings of the test.
    options : IngestOptions
        The user's choice.
    progress : Progress
        Called with the share of the work that is done.

    Returns
    -------
    FrfEstimate
        FRFs, table of records, traces.

    Raises
    ------
    InputError
        If a recording cannot be used.
    """
    if len(files.test.input_channels) > 1:
        return estimate_random_several(files, options, progress)
    return average_recordings(files, options, progress, _add_record)


def _add_record(average: SetupAverage, info: RecordInfo, record: Record, survey: Survey) -> float:
    """Add a record to the average of its set-up, and return the energy of its force."""
    rows = list(record.outputs)
    before = int(average.sums.counts[rows[0]])
    if survey.subrecord_length:
        energy = _add_subrecords(average, info, record, survey.subrecord_length)
    else:
        energy = 0.0
        for signals in _window_record(record, survey):
            average.sums.add(signals[0], signals[1:], rows)
            energy += float(np.sum(signals[0] ** 2))
    count = int(average.sums.counts[rows[0]]) - before
    average.independent[rows] += count_independent_segments(count) if survey.segment_length else count
    return energy


def _add_subrecords(average: SetupAverage, info: RecordInfo, record: Record, length: int) -> float:
    rows = list(record.outputs)
    if info.steady_part >= 0 and length % info.period == 0:
        forces = []
        for force, responses in transform_parts(record.force, record.responses, length, info.steady_part):
            average.sums.add_spectra(force, responses, rows)
            forces.append(force)
        of_record = PeriodicForce.of_parts(np.array(forces))
        average.periodic = of_record if average.periodic is None else average.periodic + of_record
    else:
        for force, responses in transform_subrecords(record.force, record.responses, length):
            average.sums.add_spectra(force, responses, rows)
    return float(np.sum(record.force[: len(record.force) // length * length] ** 2))


def _window_record(record: Record, survey: Survey) -> Iterable[FloatArray]:
    if survey.segment_length:
        return cut_segments(np.vstack([record.force, record.responses]), survey.segment_length)
    return [record.apply_windows(survey.decay_1_s, survey.n_samples)]
