"""The survey of a hammer test: its impacts, and the windows and the length of transform that suit them all."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.errors import FileFormatError, InputError
from frf_ipz.ingest.signals.windows import correlated_lines, taper_length
from frf_ipz.ingest.survey.checks import CUT_OFF, FEWEST_BEFORE, check_impact
from frf_ipz.ingest.survey.comparison import CONTRADICTS, compare_impacts
from frf_ipz.ingest.survey.file_index import index_file, split_impacts
from frf_ipz.ingest.survey.record_info import Survey
from frf_ipz.ingest.survey.selection import check_names, is_named, record_name, select_records

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.ingest.options import IngestOptions
    from frf_ipz.ingest.recording_files import RecordingFiles
    from frf_ipz.ingest.survey.file_index import FileIndex
    from frf_ipz.ingest.survey.record_info import RecordInfo
    from frf_ipz.progress import Progress

UNSEEN = 1 / 3  # of the noise: adds a twentieth to its deviation
REMAINDER = 3e-4  # share of the slowest mode that remains under an automatic window: below the noise of good records
SAME_LENGTH = 0.01  # relative difference up to which recordings are taken as equally long
LONGEST_PULSE_S = 0.3  # beyond hammers, and sand bags: pulses of 0.3 ms and more are longer where ms are taken for s
LONG_BEFORE = 0.12  # of a recording before its impact: more is cut off, for it holds nothing but noise
SHORT_BEFORE = 0.05  # of a recording: what stays before the impact then


def survey_hammer(files: RecordingFiles, options: IngestOptions, progress: Progress) -> Survey:
    """Check all impacts of a hammer test and decide how they are used.

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
        Impacts, windows and length of the transforms.

    Raises
    ------
    InputError
        If a file cannot be used and is not dropped, or the user's choice makes no sense.
    """
    indices = _index_files(files, options, progress)
    usual_length = int(np.median([index.longest for index in indices]))
    records: list[RecordInfo] = []
    for position, index in enumerate(indices):
        progress(0.5 + 0.5 * position / len(indices), f"checking {index.path.name}")
        records += _check_file(files, index, usual_length)
    file_names = [record_name(files.test, path, 1, 1) for _, path in files.test.recordings]
    check_names([*file_names, *(record.name for record in records if "#" in record.name)], options)
    survey = _plan(indices, records, options)
    compared_records, pairwise = compare_impacts(files, survey)
    if any(after.marks != before.marks for after, before in zip(compared_records, survey.records, strict=True)):
        compared = {record.name: record for record in compared_records}
        marked_records = [_with_contradictions(record, compared[record.name]) for record in records]
        survey = _plan(indices, marked_records, options)
        compared_records = tuple(_with_noise(record, compared[record.name]) for record in survey.records)
    return replace(survey, records=compared_records, warnings=(*survey.warnings, *pairwise))


def _with_contradictions(record: RecordInfo, compared: RecordInfo) -> RecordInfo:
    """Add what the comparison with the other impacts has found."""
    faults = tuple(text for text in compared.faults if text.startswith(CONTRADICTS))
    return replace(
        record,
        faults=(*record.faults, *faults),
        channel_faults=compared.channel_faults,
        is_unlike=compared.is_unlike,
    )


def _with_noise(record: RecordInfo, compared: RecordInfo) -> RecordInfo:
    """Add the noise that the comparison with the other impacts has found."""
    return replace(
        record,
        noise_weights=compared.noise_weights,
        noise_scales=compared.noise_scales,
        doubts=compared.doubts,
        remarks=tuple(dict.fromkeys((*record.remarks, *compared.remarks))),
    )


def _plan(indices: Sequence[FileIndex], records: Sequence[RecordInfo], options: IngestOptions) -> Survey:
    """Decide which impacts are used, and on which windows and length of transform."""
    selection = select_records(records, options)
    used = [record for record in selection.records if record.used]
    _check_lengths(indices, used, options)
    n_samples = _common_length(used)
    decay_1_s, about_decay = _choose_decay(used, options)
    windowed_records, about_force = _choose_force_window(selection.records, options)
    about_lines = _describe_correlation(decay_1_s * n_samples * selection.step_s)
    return Survey(
        records=tuple(replace(record, stop=min(record.stop, record.start + n_samples)) for record in windowed_records),
        step_s=selection.step_s,
        n_samples=n_samples,
        decay_1_s=decay_1_s,
        choices=(*about_decay, *about_force, *about_lines),
        warnings=(*selection.warnings, *_warn_of_slow_pulses(used), *_warn_of_truncation(used, decay_1_s)),
    )


def _index_files(files: RecordingFiles, options: IngestOptions, progress: Progress) -> list[FileIndex]:
    """Index all files; one that the user drops may be anything."""
    test, indices = files.test, []
    dropped_files = [text for text in options.drop if "#" not in text]
    for position, (setup, path) in enumerate(test.recordings):
        progress(0.5 * position / len(test.recordings), f"reading {path.name}")
        try:
            indices.append(index_file(files, setup, path, find_impacts=True))
        except InputError:
            if not is_named(record_name(test, path, 1, 1), dropped_files):
                raise
    if not indices:
        raise InputError("[ingest] drop leaves no file to read; keep at least one")
    return indices


def _check_file(files: RecordingFiles, index: FileIndex, usual_length: int) -> list[RecordInfo]:
    """Check the impacts of a file; its DC offsets are those before the first impact, where the structure is at rest."""
    bounds = split_impacts(index, usual_length)
    segments = files.segments(index.setup, index.path, bounds)
    records: list[RecordInfo] = []
    offsets = None
    for number, (rows, signals) in enumerate(zip(bounds, segments, strict=True), start=1):
        name = record_name(files.test, index.path, number, len(bounds))
        info = check_impact(files.test, index, name, rows, signals, offsets=offsets)
        records.append(_without_long_lead(replace(info, number=number)))
        if info.pulse_interval[0] >= FEWEST_BEFORE:
            offsets = offsets or info.offsets[1:]
    return records


def _without_long_lead(record: RecordInfo) -> RecordInfo:
    """Begin an impact shortly before its pulse where the recording begins long before."""
    if record.trigger <= LONG_BEFORE * record.n_samples:
        return record
    start, stop = record.pulse_interval
    lead = max(int(SHORT_BEFORE * record.n_samples), 2 * (record.trigger - start))
    cut = max(record.trigger - lead, 0)
    return replace(
        record,
        start=record.start + cut,
        trigger=record.trigger - cut,
        pulse_interval=(start - cut, stop - cut),
        spikes=tuple(replace(spike, start=spike.start - cut) for spike in record.spikes),
        force_interval=(0, record.n_samples - cut),
    )


def _check_lengths(indices: Sequence[FileIndex], used: Sequence[RecordInfo], options: IngestOptions) -> None:
    """Refuse recordings of one impact whose lengths differ: one that was cut short would pass as a decay."""
    names = {record.path: record.name for record in used if "#" not in record.name}
    single_impact_files = [index for index in indices if index.path in names]
    usual = int(np.median([index.n_rows for index in single_impact_files])) if single_impact_files else 0
    for index in single_impact_files:
        if abs(index.n_rows / usual - 1.0) > SAME_LENGTH and not is_named(names[index.path], options.keep):
            raise FileFormatError(
                index.path,
                f"holds {index.n_rows} samples where the others hold {usual}; export it whole, leave it out by "
                "[ingest] drop, or have it used as it is by [ingest] keep",
            )


def _common_length(used: Sequence[RecordInfo]) -> int:
    """Take the longest of equally long recordings; where several impacts share a file, the usual length."""
    lengths = [record.n_samples for record in used]
    longest, usual = max(lengths), int(np.median(lengths))
    return longest if longest <= (1.0 + SAME_LENGTH) * usual else usual - usual % 2


def _choose_decay(used: Sequence[RecordInfo], options: IngestOptions) -> tuple[float, tuple[str, ...]]:
    """Choose the rate of the exponential window: the user's, or just what the slowest mode needs."""
    if options.exponential_window_s is not None:
        if options.exponential_window_s < 0.0:
            raise InputError(f"[ingest] exponential_window_s is {options.exponential_window_s:g}; it is a time, or 0")
        if options.exponential_window_s == 0.0:
            return 0.0, ()
        rate = 1.0 / options.exponential_window_s
        return rate, (f"exponential window of {options.exponential_window_s:g} s on force and response, as asked for",)
    rates = [
        (np.log(record.remaining_amplitude / REMAINDER) / record.ringing_s, record)
        for record in used
        if record.remaining_amplitude > CUT_OFF
    ]
    if not rates:
        return _decay_by_noise(used)
    rate, slowest = max(rates, key=lambda pair: float(pair[0]))
    text = (
        f"exponential window of {1.0 / rate:.4g} s on force and response: without it "
        f"{100 * slowest.remaining_amplitude:.2g} % of the mode at {slowest.slowest_mode_hz:.4g} Hz would be cut off "
        f"at the end of {slowest.name}, with it {100 * REMAINDER:.2g} %; the FRFs are exact at s = sigma + i omega"
    )
    return float(rate), (text,)


def _decay_by_noise(used: Sequence[RecordInfo]) -> tuple[float, tuple[str, ...]]:
    """Choose the rate of the window where decays are cut off by little, but by more than the noise of their mean."""
    counts = Counter(record.setup for record in used)
    ratios = [record.cut_off_ratio * counts[record.setup] ** 0.5 for record in used]
    if max(ratios) <= 1.0:
        return 0.0, ()
    rates = [np.log(max(ratio / UNSEEN, 1.0)) / record.ringing_s for ratio, record in zip(ratios, used, strict=True)]
    worst = int(np.argmax(rates))
    text = (
        f"exponential window of {1.0 / rates[worst]:.4g} s on force and response: without it what is cut off of the "
        f"mode at {used[worst].cut_off_hz:.4g} Hz at the end of {used[worst].name} would be {ratios[worst]:.2g} times "
        "the noise of the mean; the FRFs are exact at s = sigma + i omega"
    )
    return float(rates[worst]), (text,)


def _choose_force_window(
    records: Sequence[RecordInfo], options: IngestOptions
) -> tuple[tuple[RecordInfo, ...], tuple[str, ...]]:
    """Choose which samples of the force are kept: the pulse with its ringing, the same interval for all impacts."""
    used = [record for record in records if record.used]
    lead = max(record.trigger - record.pulse_interval[0] for record in used)
    tail = max(record.pulse_interval[1] - record.trigger for record in used)
    step_s, length_s = used[0].step_s, options.force_window_s
    if length_s is not None and length_s < 0.0:
        raise InputError(f"[ingest] force_window_s is {length_s:g}; it is a time, or 0 for none")
    if length_s is not None:
        tail = max(int(np.ceil(length_s / step_s)), 1)
    is_silent = all(record.force_noise == 0.0 for record in used)
    is_short = 2 * (lead + tail + 2 * taper_length(0, lead + tail)) < min(record.n_samples for record in used)
    if length_s == 0.0 or (length_s is None and (is_silent or not is_short)):
        return tuple(records), ()
    windowed_records = tuple(replace(record, force_interval=_force_interval(record, lead, tail)) for record in records)
    reason = "as asked for" if length_s is not None else "the pulse and its ringing, as far as they exceed the noise"
    extent = f"from {1e3 * lead * step_s:.3g} ms before the impact to {1e3 * tail * step_s:.3g} ms after it"
    return windowed_records, (f"force window {extent}: {reason}",)


def _force_interval(record: RecordInfo, lead: int, tail: int) -> tuple[int, int]:
    """Take the interval of all impacts, longer only for a double hit that is used nevertheless."""
    stop = record.trigger + tail
    return record.trigger - lead, max(stop, record.pulse_interval[1]) if record.second_pulse_ratio else stop


def _describe_correlation(decay: float) -> tuple[str, ...]:
    step = correlated_lines(decay)
    if step == 1:
        return ()
    return (f"the exponential window correlates the noise of neighbouring lines: one in {step} is independent",)


def _warn_of_slow_pulses(used: Sequence[RecordInfo]) -> tuple[str, ...]:
    """Warn of pulses that are longer than those of any hammer: their time is in another unit than seconds."""
    pulse_s = float(np.median([record.pulse_s for record in used]))
    if not pulse_s > LONGEST_PULSE_S:
        return ()
    text = f"impacts last {pulse_s:.3g} s, where those of hammers last milliseconds: the time of the recordings seems"
    return (f"{text} not to be in seconds; name its unit in the column's header, as in 'time [ms]', or scale it",)


def _warn_of_truncation(used: Sequence[RecordInfo], decay_1_s: float) -> tuple[str, ...]:
    """Warn where a window that the user chose, or ruled out, cuts off more than the automatic one would."""
    amplitudes = [
        (record.remaining_amplitude * float(np.exp(-decay_1_s * record.ringing_s)), record) for record in used
    ]
    largest, worst = max(amplitudes, key=lambda pair: pair[0])
    if largest <= CUT_OFF:
        return ()
    return (
        f"{100 * largest:.2g} % of the mode at {worst.slowest_mode_hz:.4g} Hz is cut off at the end of {worst.name}: "
        "FRFs are wrong by about as much near it; leave out [ingest] exponential_window_s for a window that is strong "
        "enough",
    )
