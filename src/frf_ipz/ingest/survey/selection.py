"""Which blows are used: what checks say, what the user says, and at least one of every run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import PurePath
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.errors import InputError, did_you_mean
from frf_ipz.ingest.signals.clipping import share_a_rail

if TYPE_CHECKING:
    from pathlib import Path

    from frf_ipz.ingest.campaign import TestSetup, VibrationTest
    from frf_ipz.ingest.options import IngestOptions
    from frf_ipz.ingest.survey.record_info import RecordInfo

SAME_STEP = 1e-3  # relative difference up to which two files have one time step


@dataclass(frozen=True, slots=True, kw_only=True)
class Selection:
    """Blows with what was decided about each.

    Parameters
    ----------
    records : tuple of RecordInfo
        All of them.
    step_s : float
        The step that those that are used have in common, s.
    warnings : tuple of str
        What was left out, and what is used although it is bad.
    """

    records: tuple[RecordInfo, ...]
    step_s: float
    warnings: tuple[str, ...]


def record_name(test: VibrationTest, path: Path, number: int, count: int) -> str:
    """Name a blow after its file.

    Parameters
    ----------
    test : VibrationTest
        The test; the name is relative to its folder.
    path : Path
        The file.
    number, count : int
        Which blow of how many in the file, from 1.

    Returns
    -------
    str
        Such as ``hits/p18_01.csv`` or ``hits/p18.csv#2``.
    """
    folder = test.path.parent
    name = path.relative_to(folder).as_posix() if path.is_relative_to(folder) else path.as_posix()
    return f"{name}#{number}" if count > 1 else name


def is_named(name: str, wanted: Sequence[str]) -> bool:
    """Tell whether a blow is among those that the user names.

    Parameters
    ----------
    name : str
        The blow.
    wanted : sequence of str
        Files, or ``file#2``; the last parts of a path are enough.

    Returns
    -------
    bool
        True if it is.
    """
    file, _, number = name.partition("#")
    for text in wanted:
        wanted_file, _, wanted_number = text.partition("#")
        parts = PurePath(wanted_file).parts
        if PurePath(file).parts[-len(parts) :] == parts and wanted_number in {"", number}:
            return True
    return False


def check_names(names: Sequence[str], options: IngestOptions) -> None:
    """Refuse names in ``keep`` and ``drop`` that are no blow, or in both.

    Parameters
    ----------
    names : sequence of str
        All blows.
    options : IngestOptions
        The user's choice.

    Raises
    ------
    InputError
        If a name fits none, or one is both kept and dropped.
    """
    for key in ("keep", "drop"):
        for text in getattr(options, key):
            if not any(is_named(name, [text]) for name in names):
                raise InputError(f"[ingest] {key}: there is no blow or file '{text}'; {did_you_mean(text, names)}")
    for name in names:
        if is_named(name, options.keep) and is_named(name, options.drop):
            raise InputError(f"[ingest]: '{name}' is named by both keep and drop; decide for one")


def select_records(records: Sequence[RecordInfo], options: IngestOptions) -> Selection:
    """Decide which blows are used.

    Parameters
    ----------
    records : sequence of RecordInfo
        As the checks left them.
    options : IngestOptions
        The user's choice, which overrules the checks.

    Returns
    -------
    Selection
        Blows with all marks and decisions.

    Raises
    ------
    InputError
        If the user drops all blows of a DOF, or all of them have another time step than the rest of the test.
    """
    candidates = [record for record in records if not is_named(record.name, options.drop)]
    step_s = _usual_step([record.step_s for record in candidates or records])
    marked = _mark_rails([_mark_step(record, step_s) for record in records])
    decided = [_decide(record, options) for record in marked]
    warnings = [
        f"{record.name} is left out: {'; '.join(record.faults)}"
        for record in decided
        if not record.used and record.faults
    ]
    for setup in dict.fromkeys(record.setup for record in records):
        if not any(record.used for record in decided if record.setup == setup):
            saved = _least_bad(setup, decided, options, step_s)
            decided = [replace(record, used=True) if record is saved else record for record in decided]
            warnings = [text for text in warnings if not text.startswith(f"{saved.name} is left out")]
            reason = "; ".join(saved.faults)
            warnings.append(f"{saved.name} is used although it is bad ({reason}): no better blow at {setup.input_dof}")
    return Selection(records=tuple(decided), step_s=step_s, warnings=tuple(warnings))


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


def _mark_rails(records: Sequence[RecordInfo]) -> list[RecordInfo]:
    """Mark blows whose peaks are equal to the last digit: they met the end of the force's range."""
    fine = [record for record in records if not record.digital_force]
    peaks = np.array([record.peak_force + record.offsets[0] for record in fine])
    equal = share_a_rail(peaks, np.array([record.pulse_s for record in fine]))
    cut = {record.name for record, is_equal in zip(fine, equal, strict=True) if is_equal}
    return [
        replace(
            record, faults=(*record.faults, "clipping of the force: its peak equals another blow's to the last digit")
        )
        if record.name in cut and not any(fault.startswith("clipping") for fault in record.faults)
        else record
        for record in records
    ]


def _decide(record: RecordInfo, options: IngestOptions) -> RecordInfo:
    if is_named(record.name, options.drop):
        return replace(record, used=False, remarks=(*record.remarks, "dropped by the user"))
    if is_named(record.name, options.keep):
        kept = ("kept by the user",) if record.faults else ()
        return replace(record, used=True, remarks=(*record.remarks, *kept))
    return replace(record, used=not record.faults)


def _least_bad(setup: TestSetup, records: Sequence[RecordInfo], options: IngestOptions, step_s: float) -> RecordInfo:
    mine = [record for record in records if record.setup == setup and not is_named(record.name, options.drop)]
    if not mine:
        raise InputError(
            f"[ingest] drop leaves no blow at {setup.input_dof}; keep one, or take its entry out of test.toml"
        )
    usable = [record for record in mine if abs(record.step_s / step_s - 1.0) <= SAME_STEP]
    if not usable:
        raise InputError(
            f"all blows at {setup.input_dof} have the time step {mine[0].step_s:.6g} s, but the others of the test "
            f"have {step_s:.6g} s; export them with one step, or make a test of their own"
        )
    return min(usable, key=lambda record: (len(record.faults), record.second_pulse_ratio, -abs(record.peak_force)))
