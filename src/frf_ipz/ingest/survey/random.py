"""The survey of a test with a shaker: its records, and whether they are used whole, in sub-records or in segments.

The transients at both ends of a record, or of sub-records of a long one, are fitted and removed: the FRFs are free of
leakage, however narrow the modes are, and no part of a record is lost. Segments under Hann windows (Welch) are an
option: their peaks are too low by an amount that the data do not show. So is an exponential window on force and
response of records that start from rest: exact at s = sigma + i omega, but it forgets most of a record.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.errors import InputError
from frf_ipz.ingest.signals.periods import first_steady_part
from frf_ipz.ingest.signals.windows import correlated_lines
from frf_ipz.ingest.survey.checks import check_record
from frf_ipz.ingest.survey.file_index import index_file
from frf_ipz.ingest.survey.record_info import Survey
from frf_ipz.ingest.survey.selection import check_names, record_name, select_records
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray
    from frf_ipz.ingest.options import IngestOptions
    from frf_ipz.ingest.recording_files import RecordingFiles
    from frf_ipz.ingest.survey.file_index import FileIndex
    from frf_ipz.ingest.survey.record_info import RecordInfo
    from frf_ipz.progress import Progress

QUIET_SAMPLES = 2
QUIET = 0.1  # of the signal's spread: what its first samples stay below if it starts from rest
LONGEST = 2**15  # samples of a sub-record: finer lines cost time and show no more
FEWEST = 3  # sub-records of a set-up: their scatter is the noise
SHORTEST = 256  # samples of a sub-record
SHORTEST_SEGMENT = 32  # samples


def survey_random(files: RecordingFiles, options: IngestOptions, progress: Progress) -> Survey:
    """Check all records of a test and decide how they are used.

    Parameters
    ----------
    files : RecordingFiles
        The recordings.
    options : IngestOptions
        The user's choice.
    progress : Progress
        Called at each file.

    Returns
    -------
    Survey
        Records, window or segments.

    Raises
    ------
    InputError
        If a file cannot be used, or the user's choice makes no sense.
    """
    check_names([record_name(files.test, path, 1, 1) for _, path in files.test.recordings], options)
    records: list[RecordInfo] = []
    for position, (setup, path) in enumerate(files.test.recordings):
        progress(0.5 * position / len(files.test.recordings), f"reading {path.name}")
        records.append(_check_file(files, index_file(files, setup, path, find_impacts=False)))
    selection = select_records(records, options)
    survey = Survey(
        records=selection.records,
        step_s=selection.step_s,
        n_samples=max(record.n_samples for record in selection.records if record.used),
        warnings=selection.warnings,
    )
    if options.segment_s is not None:
        return _use_segments(survey, _segment_length(survey, options.segment_s))
    if options.exponential_window_s:
        return _use_exponential_window(survey, 1.0 / options.exponential_window_s)
    return _use_subrecords(survey)


def _check_file(files: RecordingFiles, index: FileIndex) -> RecordInfo:
    (signals,) = files.segments(index.setup, index.path, [(0, index.n_rows)])
    name = record_name(files.test, index.path, 1, 1)
    record = check_record(files.test, index, name, signals, starts_at_rest=_starts_at_rest(signals[1:]))
    if not record.period:
        return record
    return replace(record, steady_part=first_steady_part(signals[1], signals[2:], _whole_periods(record.period)))


def _whole_periods(period: int) -> int:
    """Count the samples of the shortest part of whole periods that is long enough."""
    return -(-SHORTEST // period) * period


def _starts_at_rest(signals: FloatArray) -> bool:
    """Tell whether force and responses all begin at their own zero, which a moving structure does not do."""
    first = np.abs(signals[:, :QUIET_SAMPLES]).max(axis=1)
    return bool(np.all(first < QUIET * signals.std(axis=1)))


def _segment_length(survey: Survey, segment_s: float) -> int:
    """Return the samples of a segment of the length that the user asks for."""
    length = round(segment_s / survey.step_s)
    longest = min(record.n_samples for record in survey.used)
    if not SHORTEST_SEGMENT <= length <= longest:
        raise InputError(
            f"[ingest] segment_s = {segment_s:g} is {length} samples; possible are {SHORTEST_SEGMENT} to {longest} "
            f"({SHORTEST_SEGMENT * survey.step_s:.3g} to {longest * survey.step_s:.3g} s)"
        )
    return length


def _use_subrecords(survey: Survey) -> Survey:
    """Cut records into whole periods, or into as few equal sub-records as their length and some scatter allow."""
    periods = {record.period for record in survey.used}
    if len(periods) == 1 and (period := periods.pop()) > 0:
        length = _whole_periods(period)
        text = f"the force comes again every {period * survey.step_s:.4g} s: parts of {length * survey.step_s:.4g} s"
        about_start = tuple(
            f"{record.name}: the first {counted(record.steady_part, 'part')} of {record.n_samples // length}, in which "
            "motion from before or from the start dies out, left out"
            for record in survey.used
            if record.steady_part > 0
        )
        about_transients = tuple(
            f"{record.name}: transients at both ends of its parts removed (local rational method)"
            for record in survey.used
            if record.steady_part < 0
        )
        choices = (f"{text}, whole periods", *about_start, *about_transients)
        return replace(survey, subrecord_length=length, n_samples=length, choices=choices)
    shortest = min(record.n_samples for record in survey.used)
    fewest = min(Counter(record.setup for record in survey.used).values())
    count = max(-(-shortest // LONGEST), -(-FEWEST // fewest))
    length = max(shortest // count, min(SHORTEST, shortest))
    parts = "records used whole" if length == shortest else f"sub-records of {length * survey.step_s:.4g} s"
    text = f"{parts}, transients at both ends removed (local rational method)"
    return replace(survey, subrecord_length=length, n_samples=length, choices=(text,))


def _use_exponential_window(survey: Survey, decay_1_s: float) -> Survey:
    shortest_s = min(record.n_samples for record in survey.used) * survey.step_s
    remainder = float(np.exp(-decay_1_s * shortest_s))
    text = (
        f"records used whole, with an exponential window of {1.0 / decay_1_s:.4g} s on force and response (as asked "
        f"for): the FRFs are exact at s = sigma + i omega but for {100 * remainder:.2g} % of the motion at the end"
    )
    step = correlated_lines(decay_1_s * survey.n_samples * survey.step_s)
    lines = f"the window correlates the noise of neighbouring lines: one in {step} is independent"
    moving_records = [record.name for record in survey.used if not record.starts_at_rest]
    warnings = [f"{name} does not start from rest: its initial motion enters the FRFs" for name in moving_records]
    return replace(
        survey,
        decay_1_s=decay_1_s,
        choices=(text, lines) if step > 1 else (text,),
        warnings=(*survey.warnings, *warnings),
    )


def _use_segments(survey: Survey, length: int) -> Survey:
    text = f"segments of {length * survey.step_s:.4g} s under Hann windows, overlapping by half (as asked for)"
    return replace(survey, segment_length=length, n_samples=length, choices=(text,))
