"""The survey of a hammer test: its blows, and the windows and the length of transform that fit them all."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.errors import FileFormatError, InputError
from frf_ipz.ingest.signals.windows import correlated_lines, taper_length
from frf_ipz.ingest.survey.checks import CUT_OFF, FEWEST_BEFORE, check_impact
from frf_ipz.ingest.survey.file_index import index_file, split_records
from frf_ipz.ingest.survey.record_info import Survey
from frf_ipz.ingest.survey.selection import check_names, is_named, record_name, select_records

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.ingest.options import IngestOptions
    from frf_ipz.ingest.recording_files import RecordingFiles
    from frf_ipz.ingest.survey.file_index import FileIndex
    from frf_ipz.ingest.survey.record_info import RecordInfo
    from frf_ipz.progress import Progress

LEFT = 3e-4  # share of the slowest mode that an automatic window leaves at the end: below the noise of good recordings
ALIKE = 0.01  # relative difference in length up to which recordings are taken as equally long
LONG_BEFORE = 0.12  # of a recording before its blow: more is cut off, for it holds nothing but noise
SHORT_BEFORE = 0.05  # of a recording: what is left of it


def survey_hammer(files: RecordingFiles, options: IngestOptions, progress: Progress) -> Survey:
    """Look at all blows of a hammer test and decide how they are used.

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
        Blows, windows and length of the transforms.

    Raises
    ------
    InputError
        If a file cannot be used and is not dropped, or the user's choice makes no sense.
    """
    scans = _scan(files, options, progress)
    usual = int(np.median([index.longest for index in scans]))
    records: list[RecordInfo] = []
    for done, index in enumerate(scans):
        progress(0.5 + 0.5 * done / len(scans), f"checking {index.path.name}")
        records += _check_file(files, index, usual)
    files_named = [record_name(files.test, path, 1, 1) for path in files.test.files]
    check_names([*files_named, *(record.name for record in records if "#" in record.name)], options)
    verdict = select_records(records, options)
    used = [record for record in verdict.records if record.used]
    _check_lengths(scans, used, options)
    n_samples = _common_length(used)
    decay_1_s, about_decay = _decay(used, options)
    decided, about_force = _keep_force(verdict.records, options)
    choices = (*about_decay, *about_force, *_about_lines(decay_1_s * n_samples * verdict.step_s))
    return Survey(
        records=tuple(replace(record, stop=min(record.stop, record.start + n_samples)) for record in decided),
        step_s=verdict.step_s,
        n_samples=n_samples,
        decay_1_s=decay_1_s,
        force_window=bool(about_force),
        choices=choices,
        warnings=(*verdict.warnings, *_about_rest(used, decay_1_s)),
    )


def _scan(files: RecordingFiles, options: IngestOptions, progress: Progress) -> list[FileIndex]:
    """Scan all files; one that the user drops may be anything."""
    test, scans = files.test, []
    wanted = [(setup, path) for setup in test.setups for path in setup.files]
    for done, (setup, path) in enumerate(wanted):
        progress(0.5 * done / len(test.files), f"reading {path.name}")
        try:
            scans.append(index_file(files, setup, path, for_records=True))
        except InputError:
            if not is_named(record_name(test, path, 1, 1), [text for text in options.drop if "#" not in text]):
                raise
    if not scans:
        raise InputError("[ingest] drop leaves no file to read; keep at least one")
    return scans


def _check_file(files: RecordingFiles, index: FileIndex, usual: int) -> list[RecordInfo]:
    """Check the blows of a file: its channels are as far from zero as before the first one, at rest."""
    bounds = split_records(index, usual)
    stretches = files.stretches(index.setup, index.path, bounds)
    records: list[RecordInfo] = []
    offsets = None
    for number, (rows, signals) in enumerate(zip(bounds, stretches, strict=True), start=1):
        name = record_name(files.test, index.path, number, len(bounds))
        info = check_impact(files.test, index, name, rows, signals, offsets=offsets)
        records.append(_without_long_lead(replace(info, number=number)))
        if info.pulse[0] >= FEWEST_BEFORE:
            offsets = offsets or info.offsets[1:]
    return records


def _without_long_lead(record: RecordInfo) -> RecordInfo:
    """Begin a blow shortly before its pulse where the recording begins long before."""
    if record.trigger <= LONG_BEFORE * record.n_samples:
        return record
    start, stop = record.pulse
    lead = max(int(SHORT_BEFORE * record.n_samples), 2 * (record.trigger - start))
    cut = max(record.trigger - lead, 0)
    return replace(
        record,
        start=record.start + cut,
        trigger=record.trigger - cut,
        pulse=(start - cut, stop - cut),
        force_interval=(0, record.n_samples - cut),
    )


def _check_lengths(scans: Sequence[FileIndex], used: Sequence[RecordInfo], options: IngestOptions) -> None:
    """Refuse recordings of one blow whose lengths differ: one that was cut short would pass as a decay."""
    names = {record.path: record.name for record in used if "#" not in record.name}
    whole = [index for index in scans if index.path in names]
    usual = int(np.median([index.n_rows for index in whole])) if whole else 0
    for index in whole:
        if abs(index.n_rows / usual - 1.0) > ALIKE and not is_named(names[index.path], options.keep):
            raise FileFormatError(
                index.path,
                f"holds {index.n_rows} samples where the others hold {usual}; export it whole, leave it out by "
                "[ingest] drop, or have it used as it is by [ingest] keep",
            )


def _common_length(used: Sequence[RecordInfo]) -> int:
    """Take the longest of equally long recordings; of pieces of a longer one, what is usual."""
    lengths = [record.n_samples for record in used]
    longest, usual = max(lengths), int(np.median(lengths))
    return longest if longest <= (1.0 + ALIKE) * usual else usual - usual % 2


def _decay(used: Sequence[RecordInfo], options: IngestOptions) -> tuple[float, tuple[str, ...]]:
    """Choose the exponential window: as asked for, or just what the slowest mode needs."""
    if options.exponential_window_s is not None:
        if options.exponential_window_s < 0.0:
            raise InputError(f"[ingest] exponential_window_s is {options.exponential_window_s:g}; it is a time, or 0")
        if options.exponential_window_s == 0.0:
            return 0.0, ()
        rate = 1.0 / options.exponential_window_s
        return rate, (f"exponential window of {options.exponential_window_s:g} s on force and response, as asked for",)
    rates = [
        (np.log(record.remaining_amplitude / LEFT) / record.ringing_s, record)
        for record in used
        if record.remaining_amplitude > CUT_OFF
    ]
    if not rates:
        return 0.0, ()
    rate, worst = max(rates, key=lambda pair: float(pair[0]))
    text = (
        f"exponential window of {1.0 / rate:.4g} s on force and response: without it "
        f"{100 * worst.remaining_amplitude:.2g} % of the mode at {worst.slowest_mode_hz:.4g} Hz would be cut off at "
        f"the end of {worst.name}, with it {100 * LEFT:.2g} %; "
        "the FRFs are exact at s = sigma + i omega"
    )
    return float(rate), (text,)


def _keep_force(
    records: Sequence[RecordInfo], options: IngestOptions
) -> tuple[tuple[RecordInfo, ...], tuple[str, ...]]:
    """Choose what is kept of the force: the pulse with its ringing, the same stretch for all blows."""
    used = [record for record in records if record.used]
    lead = max(record.trigger - record.pulse[0] for record in used)
    tail = max(record.pulse[1] - record.trigger for record in used)
    step_s, asked = used[0].step_s, options.force_window_s
    if asked is not None and asked < 0.0:
        raise InputError(f"[ingest] force_window_s is {asked:g}; it is a time, or 0 for none")
    if asked is not None:
        tail = max(int(np.ceil(asked / step_s)), 1)
    silent = all(record.force_noise == 0.0 for record in used)
    gains = 2 * (lead + tail + 2 * taper_length(0, lead + tail)) < min(record.n_samples for record in used)
    if asked == 0.0 or (asked is None and (silent or not gains)):
        return tuple(records), ()
    kept = tuple(replace(record, force_interval=_stretch(record, lead, tail)) for record in records)
    why = "as asked for" if asked is not None else "the pulse and its ringing, as far as they stand out from the noise"
    text = f"force window from {1e3 * lead * step_s:.3g} ms before the blow to {1e3 * tail * step_s:.3g} ms after it: "
    return kept, (text + why,)


def _stretch(record: RecordInfo, lead: int, tail: int) -> tuple[int, int]:
    """Take the stretch of all blows, longer only for one that hit twice and is used nevertheless."""
    stop = record.trigger + tail
    return record.trigger - lead, max(stop, record.pulse[1]) if record.second_pulse_ratio else stop


def _about_lines(decay: float) -> tuple[str, ...]:
    step = correlated_lines(decay)
    if step == 1:
        return ()
    return (f"the exponential window correlates the noise of neighbouring lines: one in {step} is independent",)


def _about_rest(used: Sequence[RecordInfo], decay_1_s: float) -> tuple[str, ...]:
    """Warn where a window that the user chose, or ruled out, leaves more than the automatic one would."""
    left = [(record.remaining_amplitude * float(np.exp(-decay_1_s * record.ringing_s)), record) for record in used]
    most, worst = max(left, key=lambda pair: pair[0])
    if most <= CUT_OFF:
        return ()
    return (
        f"{100 * most:.2g} % of the mode at {worst.slowest_mode_hz:.4g} Hz is cut off at the end of {worst.name}: FRFs "
        "are wrong by about as much near it; leave out [ingest] exponential_window_s for a window that is strong "
        "enough",
    )
