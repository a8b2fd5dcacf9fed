"""Records as arrays: checked, calibrated, one at a time in constant memory.

The estimation of FRFs reads them, and the diagnosis, which transforms force and responses at any complex frequency.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray, read_only
from frf_ipz.errors import InputError
from frf_ipz.frf import FrfLabel
from frf_ipz.ingest.campaign import setup_labels
from frf_ipz.ingest.signals.clipping import find_clipped_part
from frf_ipz.ingest.signals.windows import window_impact
from frf_ipz.ingest.survey.hammer import survey_hammer
from frf_ipz.ingest.survey.random import survey_random
from frf_ipz.progress import Progress, silent

if TYPE_CHECKING:
    from collections.abc import Iterator

    from frf_ipz.ingest.campaign import VibrationTest
    from frf_ipz.ingest.options import IngestOptions
    from frf_ipz.ingest.recording_files import RecordingFiles
    from frf_ipz.ingest.survey.record_info import RecordInfo, Survey

SURVEYS = {"hammer": survey_hammer, "random": survey_random}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Record:
    """One impact of a hammer, or one record of a shaker, with its responses.

    Parameters
    ----------
    name : str
        As in the table of records.
    labels : tuple of FrfLabel
        The FRFs that it contributes to, one a row of `responses`: DOFs with their signs, quantities, columns. Of a
        record that is used, channels that are bad are missing.
    outputs : tuple of int
        Which responses of its set-up these are.
    step_s : float
        Time step, s; the first sample is at time 0.
    force : (n_samples,) array
        N, its DC offset subtracted, no window applied; the sign is that of the recording.
    responses : (n_outputs, n_samples) array
        SI, DC offsets subtracted where they are significant; the signs are those of the recording.
    trigger : int
        Sample at which the force sets in; 0 for a shaker's record.
    force_interval : pair of int
        First sample of the force that is more than noise, and the one after the last.
    starts_at_rest : bool
        The structure was at rest at the first sample.
    recording : str
        The file that it was cut from.
    number : int
        1 for the first impact in its recording.
    start_s : float
        Time of its first sample in its recording, s.
    marks : tuple of str
        What is wrong with it.
    used : bool
        It enters the FRFs.
    restored : (n_outputs, n_samples) array
        What of `responses` is an estimate of what an overload cut off; 0 for all others.
    """

    name: str
    labels: tuple[FrfLabel, ...]
    outputs: tuple[int, ...]
    step_s: float
    force: FloatArray
    responses: FloatArray
    trigger: int
    force_interval: tuple[int, int]
    starts_at_rest: bool
    recording: str
    number: int
    start_s: float
    marks: tuple[str, ...]
    used: bool
    restored: FloatArray

    def __post_init__(self) -> None:
        for name in ("force", "responses", "restored"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    @property
    def n_samples(self) -> int:
        """Number of samples."""
        return len(self.force)

    def apply_windows(self, decay_1_s: float, n_samples: int) -> FloatArray:
        """Give the force within its pulse and the responses, under a window, filled up with zeros to a common length.

        Parameters
        ----------
        decay_1_s : float
            Rate of the exponential window that force and responses share.
        n_samples : int
            The common length; at least that of the record.

        Returns
        -------
        (1 + n_outputs, n_samples) array
            The force first.
        """
        signals = np.vstack([self.force, self.responses])
        return window_impact(signals, n_samples, self.force_interval, decay_1_s * self.step_s, self.trigger)


def survey_records(files: RecordingFiles, options: IngestOptions, progress: Progress = silent) -> Survey:
    """Check all records of a test and decide how they are used; once, however often it is asked for.

    Parameters
    ----------
    files : RecordingFiles
        The test's recordings.
    options : IngestOptions
        The user's choice.
    progress : Progress
        Called with the share of the work that is done.

    Returns
    -------
    Survey
        What is wrong with each, which are used, windows and lengths.

    Raises
    ------
    InputError
        If a recording cannot be used.
    """
    kind = files.test.kind
    if kind not in SURVEYS:
        raise InputError(f"{files.test.path}: a test of kind '{kind}' has no recordings; there are no records to read")

    def survey() -> Survey:
        found = SURVEYS[kind](files, options, progress)
        return replace(found, choices=(*files.notes, *found.choices))

    return files.once(options, survey)


def read_records(files: RecordingFiles, options: IngestOptions, *, used_only: bool = True) -> Iterator[Record]:
    """Read the records of a test, one at a time.

    Parameters
    ----------
    files : RecordingFiles
        The recordings of a test of kind ``hammer`` or ``random``.
    options : IngestOptions
        The user's choice.
    used_only : bool
        Leave out records that do not enter the FRFs.

    Yields
    ------
    Record
        In the order of the test.

    Raises
    ------
    InputError
        If a recording cannot be used.
    """
    survey = survey_records(files, options)
    selected_infos = survey.used if used_only else survey.records
    for path, group in groupby(selected_infos, key=lambda info: info.path):
        infos = list(group)
        segments = files.segments(infos[0].setup, path, [(info.start, info.stop) for info in infos])
        for info, signals in zip(infos, segments, strict=True):
            yield _make_record(files.test, info, signals)


def _make_record(test: VibrationTest, info: RecordInfo, signals: FloatArray) -> Record:
    signals = info.correct(signals[1:])
    labels = setup_labels(test.channels, info.setup)
    outputs = info.used_outputs if info.used else tuple(range(len(labels)))
    responses = signals[1:][list(outputs)]
    restored = np.zeros_like(responses)
    if info.used:
        for row, output in enumerate(outputs):
            if any(at == output for at, _ in info.channel_faults):
                restored[row] = find_clipped_part(responses[row])
    return Record(
        name=info.name,
        labels=tuple(labels[output] for output in outputs),
        outputs=outputs,
        step_s=info.step_s,
        force=signals[0],
        responses=responses + restored,
        trigger=info.trigger,
        force_interval=info.force_interval,
        starts_at_rest=info.starts_at_rest,
        recording=str(info.path),
        number=info.number,
        start_s=info.start * info.step_s,
        marks=info.marks,
        used=info.used,
        restored=restored,
    )
