"""Which records are used: what checks say, what the user says, and at least one of every set-up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import PurePath
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.errors import InputError, did_you_mean
from frf_ipz.ingest.signals.clipping import find_saturated_peaks
from frf_ipz.ingest.survey.record_info import STANDS_STILL
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from pathlib import Path

    from frf_ipz.ingest.campaign import TestSetup, VibrationTest
    from frf_ipz.ingest.options import IngestOptions
    from frf_ipz.ingest.survey.record_info import RecordInfo

MOST_NAMES = 3  # records that a message names
RESTORED = "what was cut off is estimated from the slopes beside it, and half of that counts as its error"
SAME_STEP = 1e-3  # relative difference up to which two files have one time step


@dataclass(frozen=True, slots=True, kw_only=True)
class Selection:
    """Records with what was decided about each.

    Parameters
    ----------
    records : tuple of RecordInfo
        All of the test.
    step_s : float
        The step that those that are used have in common, s.
    warnings : tuple of str
        What was left out, and what is used although it is bad.
    """

    records: tuple[RecordInfo, ...]
    step_s: float
    warnings: tuple[str, ...]


def record_name(test: VibrationTest, path: Path, number: int, count: int) -> str:
    """Name a record after its file.

    Parameters
    ----------
    test : VibrationTest
        The test; the name is relative to its folder.
    path : Path
        The file.
    number, count : int
        Which record of how many in the file, from 1.

    Returns
    -------
    str
        Such as ``hits/p18_01.csv`` or ``hits/p18.csv#2``.
    """
    folder = test.path.parent
    name = path.relative_to(folder).as_posix() if path.is_relative_to(folder) else path.as_posix()
    return f"{name}#{number}" if count > 1 else name


def is_named(name: str, patterns: Sequence[str]) -> bool:
    """Tell whether a record is among those that the user names.

    Parameters
    ----------
    name : str
        The record.
    patterns : sequence of str
        Files, or ``file#2``; the last parts of a path are enough.

    Returns
    -------
    bool
        True if it is.
    """
    file, _, number = name.partition("#")
    for pattern in patterns:
        pattern_file, _, pattern_number = pattern.partition("#")
        parts = PurePath(pattern_file).parts
        if PurePath(file).parts[-len(parts) :] == parts and pattern_number in {"", number}:
            return True
    return False


def check_names(names: Sequence[str], options: IngestOptions) -> None:
    """Refuse names in ``keep`` and ``drop`` that are no record, or in both.

    Parameters
    ----------
    names : sequence of str
        All records.
    options : IngestOptions
        The user's choice.

    Raises
    ------
    InputError
        If a name fits no record, or a record is both kept and dropped.
    """
    for key in ("keep", "drop"):
        for text in getattr(options, key):
            if not any(is_named(name, [text]) for name in names):
                raise InputError(f"[ingest] {key}: there is no record or file '{text}'; {did_you_mean(text, names)}")
    for name in names:
        if is_named(name, options.keep) and is_named(name, options.drop):
            raise InputError(f"[ingest]: '{name}' is named by both keep and drop; decide for one")


def select_records(records: Sequence[RecordInfo], options: IngestOptions) -> Selection:
    """Decide which records are used.

    Parameters
    ----------
    records : sequence of RecordInfo
        As the checks gave them.
    options : IngestOptions
        The user's choice, which overrules the checks.

    Returns
    -------
    Selection
        Records with all marks and decisions.

    Raises
    ------
    InputError
        If the user drops all records of a DOF, or all of them differ in time step from the rest of the test or lack
        the force.
    """
    not_dropped = [record for record in records if not is_named(record.name, options.drop)]
    step_s = _usual_step([record.step_s for record in not_dropped or records])
    marked_records = _mark_saturated([_mark_step(record, step_s) for record in records])
    decided_records = [_decide(record, options) for record in marked_records]
    fallbacks: list[RecordInfo] = []
    for setup in dict.fromkeys(record.setup for record in records):
        if not any(record.used for record in decided_records if record.setup == setup):
            fallbacks += _least_bad(setup, decided_records, options, step_s)
    warnings = [
        f"{record.name} is left out: {'; '.join(record.faults or dict(record.channel_faults).values())}"
        for record in decided_records
        if not record.used and (record.faults or record.channel_faults) and record not in fallbacks
    ]
    for record in fallbacks:
        reasons = record.faults or tuple(dict(record.channel_faults).values())
        reason = f"although it is bad ({'; '.join(reasons)}): no better record at {record.setup.input_dof}"
        restored = f"; {RESTORED}" if any("overload" in text for _, text in record.channel_faults) else ""
        warnings.append(f"{record.name} is used {reason}{restored}")
    decided_records = [
        replace(record, used=True, keeps_channels=record.keeps_channels or not record.used_outputs)
        if record in fallbacks
        else record
        for record in decided_records
    ]
    warnings += [*_warn_of_channels(decided_records), *_warn_of_jumps(decided_records)]
    return Selection(records=tuple(decided_records), step_s=step_s, warnings=tuple(warnings))


def _warn_of_channels(records: Sequence[RecordInfo]) -> list[str]:
    """Say which channels are left out of records that are used; of those that all records lack there is no FRF."""
    warnings = []
    for setup in dict.fromkeys(record.setup for record in records):
        used_records = [record for record in records if record.used and record.setup == setup]
        for output, dof in enumerate(setup.output_dofs):
            without = [record for record in used_records if output not in record.used_outputs]
            reasons = dict.fromkeys(text for record in without for at, text in record.channel_faults if at == output)
            if without and len(without) == len(used_records):
                names = "all impacts" if len(without) > 1 else without[0].name
                warnings.append(f"there is no FRF {dof} / {setup.input_dof}: in {names}, {'; '.join(reasons)}")
            else:
                warnings += [
                    f"{dof} is left out of {record.name}: {text}"
                    for record in without
                    for at, text in record.channel_faults
                    if at == output
                ]
    return warnings


def _warn_of_jumps(records: Sequence[RecordInfo]) -> list[str]:
    """Say which channels jump as no structure moves, in how many of the impacts at a point."""
    warnings = []
    for setup in dict.fromkeys(record.setup for record in records):
        used_records = [record for record in records if record.used and record.setup == setup]
        for output, dof in enumerate(setup.output_dofs):
            counts = [
                sum(spike.output == output for spike in record.spikes)
                for record in used_records
                if output in record.used_outputs
            ]
            jumping = [count for count in counts if count]
            if jumping:
                times = "once" if sum(jumping) == 1 else f"{sum(jumping)} times"
                records_at = f"{len(jumping)} of {counted(len(counts), 'record')} at {setup.input_dof}"
                warnings.append(
                    f"{dof} jumps {times}, in {records_at}, as no structure moves (a loose cable?): the jumps are "
                    "taken off, and what is not known of them counts as noise"
                )
    return warnings


def _usual_step(steps: Sequence[float]) -> float:
    """Find the step that most files have; their mean, since each is known to its last digits only."""
    values = np.array(steps)
    groups = [values[np.abs(values / step - 1.0) <= SAME_STEP] for step in steps]
    return float(np.mean(max(groups, key=len)))


def _mark_step(record: RecordInfo, step_s: float) -> RecordInfo:
    if abs(record.step_s / step_s - 1.0) <= SAME_STEP:
        return record
    fault = f"wrong sampling step: {record.step_s:.6g} s where the others have {step_s:.6g} s"
    return replace(record, faults=(*record.faults, fault))


def _mark_saturated(records: Sequence[RecordInfo]) -> list[RecordInfo]:
    """Mark records whose peaks are equal to the last digit: they reached the end of the force's range."""
    fine_records = [record for record in records if not record.has_coarse_force]
    peaks = np.array([record.peak_force + record.offsets[0] for record in fine_records])
    is_saturated = find_saturated_peaks(peaks, np.array([record.pulse_s for record in fine_records]))
    clipped_names = {record.name for record, saturated in zip(fine_records, is_saturated, strict=True) if saturated}
    fault = "clipping of the force: its peak equals another record's to the last digit"
    return [
        replace(record, faults=(*record.faults, fault))
        if record.name in clipped_names and not any(text.startswith("clipping") for text in record.faults)
        else record
        for record in records
    ]


def _decide(record: RecordInfo, options: IngestOptions) -> RecordInfo:
    if is_named(record.name, options.drop):
        return replace(record, used=False, remarks=(*record.remarks, "dropped by the user"))
    if is_named(record.name, options.keep):
        remark = ("kept by the user",) if record.faults or record.channel_faults else ()
        return replace(record, used=True, keeps_channels=True, remarks=(*record.remarks, *remark))
    return replace(record, used=not record.faults and bool(record.used_outputs))


def _least_bad(
    setup: TestSetup, records: Sequence[RecordInfo], options: IngestOptions, step_s: float
) -> list[RecordInfo]:
    """Choose what is used where all records are bad: all of which only the beginning is missing, or else one."""
    candidates = [record for record in records if record.setup == setup and not is_named(record.name, options.drop)]
    if not candidates:
        raise InputError(
            f"[ingest] drop leaves no record at {setup.input_dof}; keep one, or take its entry out of test.toml"
        )
    usable_records = [record for record in candidates if abs(record.step_s / step_s - 1.0) <= SAME_STEP]
    if not usable_records:
        raise InputError(
            f"all records at {setup.input_dof} have the time step {candidates[0].step_s:.6g} s, but the others of the "
            f"test have {step_s:.6g} s; export them with one step, or make a test of their own"
        )
    if all(record.lacks_most for record in usable_records):
        raise InputError(
            f"all records at {setup.input_dof} begin within the impact, or after its peak, and lack more of its force "
            f"than half of what they hold ({', '.join(record.name for record in usable_records[:MOST_NAMES])}"
            f"{' ...' if len(usable_records) > MOST_NAMES else ''}): FRFs of them would be wrong by as much; record "
            "again with a pre-trigger, which begins some milliseconds before the impact"
        )
    usable_records = [record for record in usable_records if not record.lacks_most]
    still = [[text for _, text in record.channel_faults if STANDS_STILL in text] for record in usable_records]
    if all(len(texts) >= len(setup.output_dofs) for texts in still):
        problem = f"no response of {usable_records[0].name} moves ({'; '.join(still[0][:MOST_NAMES])})"
        raise InputError(
            f"{problem}, nor of any other record at {setup.input_dof}: nothing was measured there; look at "
            "sensors, cables and columns, or take its entry out of test.toml"
        )
    late_records = [record for record in usable_records if any(record.missing_force) and len(record.faults) == 1]
    if late_records:  # how wrong they are is known
        return [record for record in late_records if record.used_outputs] or late_records
    return [
        min(
            usable_records,
            key=lambda record: (
                len(record.faults) + len(record.channel_faults),
                record.second_pulse_ratio,
                -abs(record.peak_force),
            ),
        )
    ]
