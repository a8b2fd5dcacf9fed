"""The survey of a test with a shaker: its records, and whether they are used whole, in pieces or in segments.

The motion at both ends of a record, or of pieces of a long one, is fitted and taken off: the FRFs are free of leakage,
however narrow the modes are, and nothing of a record is lost. Segments under Hann windows (Welch) are there for who
asks for them: their peaks are too low by an amount that nothing in the data tells. So is an exponential window on force
and response of records that start from rest: exact at s = sigma + i omega, but it forgets most of a record.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.errors import InputError
from frf_ipz.ingest.signals.windows import correlated_lines
from frf_ipz.ingest.survey.checks import check_record
from frf_ipz.ingest.survey.file_index import index_file
from frf_ipz.ingest.survey.record_info import Survey
from frf_ipz.ingest.survey.selection import check_names, record_name, select_records

if TYPE_CHECKING:
    from collections.abc import Iterator

    from frf_ipz.arrays import FloatArray
    from frf_ipz.ingest.options import IngestOptions
    from frf_ipz.ingest.recording_files import RecordingFiles
    from frf_ipz.ingest.survey.file_index import FileIndex
    from frf_ipz.ingest.survey.record_info import RecordInfo
    from frf_ipz.progress import Progress

QUIET_SAMPLES = 2
QUIET = 0.1  # of the signal's spread: what its first samples stay below if it starts from rest
LONGEST = 2**15  # samples of a piece: finer lines cost time and tell no more
FEWEST = 3  # pieces of the records at one place: their scatter tells the noise
SHORTEST = 256  # samples of a segment
HANN_HALF_OVERLAP = 1.0 / 18.0  # twice the squared correlation of segments that overlap by half


def survey_random(files: RecordingFiles, options: IngestOptions, progress: Progress) -> Survey:
    """Look at all records of a test and decide how they are used.

    Parameters
    ----------
    files : RecordingFiles
        The recordings.
    options : IngestOptions
        The user's choice.
    progress : Progress
        Told about each file.

    Returns
    -------
    Survey
        Records, window or segments.

    Raises
    ------
    InputError
        If a file cannot be used, or the user's choice makes no sense.
    """
    check_names([record_name(files.test, path, 1, 1) for path in files.test.files], options)
    records = []
    wanted = [(setup, path) for setup in files.test.setups for path in setup.files]
    for done, (setup, path) in enumerate(wanted):
        progress(0.5 * done / len(files.test.files), f"reading {path.name}")
        records.append(_look(files, index_file(files, setup, path, for_records=False)))
    verdict = select_records(records, options)
    survey = Survey(
        records=verdict.records, step_s=verdict.step_s, n_samples=max(record.n_samples for record in verdict.records)
    )
    survey = replace(survey, n_samples=max(record.n_samples for record in survey.used), warnings=verdict.warnings)
    if options.segment_s is not None:
        return _in_segments(survey, _asked_segment(survey, options.segment_s))
    if options.exponential_window_s:
        return _whole(survey, 1.0 / options.exponential_window_s)
    return _in_pieces(survey)


def segments_of(signals: FloatArray, length: int) -> Iterator[FloatArray]:
    """Cut signals into segments that overlap by half, under Hann windows.

    Parameters
    ----------
    signals : (n_signals, n_samples) array
        Force and responses.
    length : int
        Samples of a segment.

    Yields
    ------
    (n_signals, length) array
        One segment after the other.
    """
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(length) / length)
    for start in range(0, signals.shape[1] - length + 1, max(length // 2, 1)):
        yield signals[:, start : start + length] * window


def independent_segments(count: int) -> float:
    """Return how many independent segments half-overlapping ones under Hann windows are worth.

    Parameters
    ----------
    count : int
        Segments.

    Returns
    -------
    float
        A little less.
    """
    return count / (1.0 + HANN_HALF_OVERLAP * (count - 1) / count) if count else 0.0


def _look(files: RecordingFiles, index: FileIndex) -> RecordInfo:
    (signals,) = files.stretches(index.setup, index.path, [(0, index.n_rows)])
    name = record_name(files.test, index.path, 1, 1)
    return check_record(files.test, index, name, signals, starts_at_rest=_is_rested(signals[1:]))


def _is_rested(signals: FloatArray) -> bool:
    """Tell whether force and responses all begin at their own zero, which a moving structure does not do."""
    first = np.abs(signals[:, :QUIET_SAMPLES]).max(axis=1)
    return bool(np.all(first < QUIET * signals.std(axis=1)))


def _asked_segment(survey: Survey, segment_s: float) -> int:
    length = round(segment_s / survey.step_s)
    longest = min(record.n_samples for record in survey.used)
    if not SHORTEST // 8 <= length <= longest:
        raise InputError(
            f"[ingest] segment_s = {segment_s:g} is {length} samples; possible are {SHORTEST // 8} to {longest} "
            f"({SHORTEST // 8 * survey.step_s:.3g} to {longest * survey.step_s:.3g} s)"
        )
    return length


def _in_pieces(survey: Survey) -> Survey:
    """Cut records into equal pieces, as few as their length and the need of some scatter allow."""
    shortest = min(record.n_samples for record in survey.used)
    fewest = min(Counter(record.setup for record in survey.used).values())
    count = max(-(-shortest // LONGEST), -(-FEWEST // fewest))
    length = max(shortest // count, min(SHORTEST, shortest))
    each = "records used whole" if length == shortest else f"pieces of {length * survey.step_s:.4g} s"
    text = f"{each}, the motion that goes on at both ends fitted and taken off (local rational method)"
    return replace(survey, piece=length, n_samples=length, choices=(text,))


def _whole(survey: Survey, decay_1_s: float) -> Survey:
    shortest = min(record.n_samples for record in survey.used) * survey.step_s
    left = float(np.exp(-decay_1_s * shortest))
    text = (
        f"records used whole, with an exponential window of {1.0 / decay_1_s:.4g} s on force and response "
        f"(as asked for): the FRFs are exact at s = sigma + i omega but for {100 * left:.2g} % of the motion at the end"
    )
    step = correlated_lines(decay_1_s * survey.n_samples * survey.step_s)
    lines = f"the window correlates the noise of neighbouring lines: one in {step} is independent"
    restless = [record.name for record in survey.used if not record.starts_at_rest]
    warnings = [f"{name} does not start from rest: its initial motion enters the FRFs" for name in restless]
    return replace(
        survey,
        decay_1_s=decay_1_s,
        choices=(text, lines) if step > 1 else (text,),
        warnings=(*survey.warnings, *warnings),
    )


def _in_segments(survey: Survey, length: int) -> Survey:
    text = f"segments of {length * survey.step_s:.4g} s under Hann windows, overlapping by half (as asked for)"
    return replace(survey, segment=length, n_samples=length, choices=(text,))
