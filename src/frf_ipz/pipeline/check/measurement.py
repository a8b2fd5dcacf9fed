"""What was recorded: every file is opened, and what it holds is stated for each excited DOF."""

from __future__ import annotations

import re
from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.errors import InputError
from frf_ipz.identification.fit import fit_modes
from frf_ipz.ingest.estimate import estimate_from
from frf_ipz.ingest.formats.frf_conventions import read_frf_source
from frf_ipz.ingest.recording_files import RecordingFiles
from frf_ipz.ingest.survey.selection import record_name
from frf_ipz.pipeline.check.look import Look
from frf_ipz.pipeline.check.text_table import text_table
from frf_ipz.plotting.wording import number
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pandas as pd

    from frf_ipz.arrays import FloatArray
    from frf_ipz.frf import FrfSet
    from frf_ipz.ingest.campaign import TestSetup, VibrationTest
    from frf_ipz.ingest.frf_estimate import FrfEstimate
    from frf_ipz.modes import ModalParameters
    from frf_ipz.pipeline.config import StageOptions

WHOLE_BYTES = 1 << 28  # of recordings, read within seconds; of more only the first block of each
HEARD = 0.5  # of the values: where fewer stand above their noise, most of them are noise
MOST_SETS = 12  # of excited DOFs that have a row of their own; of more, those with most remarks
HAMMER_HEADER = (
    "excited",
    "used",
    "peak force, N",
    "pulse, ms",
    "force up to, Hz",
    "signal over noise, dB",
    "remarks",
)
SHAKER_HEADER = ("excited", "used", "peak force, N", "length, s", "remarks")


def open_recordings(files: RecordingFiles) -> tuple[list[str], bool]:
    """Read what the run would read; large recordings to the first block.

    Parameters
    ----------
    files : RecordingFiles
        The recordings of the test.

    Returns
    -------
    lines : list of str
        How many recordings there are of each rate and length.
    is_whole : bool
        Everything was read.

    Raises
    ------
    InputError
        If a recording or a file of FRFs cannot be read as the test says.
    """
    test = files.test
    for source in test.frf_sources:
        read_frf_source(source)
    recordings = [(setup, path) for setup in test.setups for path in setup.files if path not in test.signals]
    is_large = sum(path.stat().st_size for _, path in recordings) > WHOLE_BYTES
    lengths: Counter[str] = Counter()
    faults = []
    for setup, path in recordings:
        try:
            lengths[_describe_recording(files.blocks(setup, path), is_large=is_large)] += 1
        except InputError as error:
            faults.append(error)
    if len(faults) > 1:
        raise InputError(f"{faults[0]} (so or otherwise, {len(faults)} of {len(recordings)} recordings cannot be read)")
    if faults:
        raise faults[0]
    return [f"  read      {count} x {what}" for what, count in lengths.items()], not is_large


def look_at_measurement(files: RecordingFiles, options: StageOptions) -> tuple[Look, FrfEstimate]:
    """Estimate FRFs, and say what the recordings behind them are like.

    Parameters
    ----------
    files : RecordingFiles
        The recordings of the test; they can be read.
    options : StageOptions
        The user's choice.

    Returns
    -------
    look : Look
        A table of the excited DOFs, what was left out, and what should be looked at.
    estimate : FrfEstimate
        The FRFs.

    Raises
    ------
    InputError
        If the recordings cannot be used.
    """
    test, estimate = files.test, estimate_from(files, options.ingest)
    notes = [f"  note      {text}" for text in estimate.warnings]
    if estimate.modes is not None:
        return _look_at_modes(estimate.modes, options), estimate
    if not len(estimate.records):
        return Look(lines=(_describe_frfs(estimate), *notes)), estimate
    rows: list[tuple[str, ...]] = []
    open_points: list[str] = []
    for setup, records in _sets(test, estimate.records):
        rows.append(_row(test, setup, records))
        open_points += _left_out(setup, records)
        open_points += _beyond_the_hammer(setup, records, estimate.frfs, options.fit.band_hz)
    header = HAMMER_HEADER if test.kind == "hammer" else SHAKER_HEADER
    shown = rows if len(rows) <= MOST_SETS else sorted(rows, key=lambda row: -len(row[-1]))[:MOST_SETS]
    more = [f"  and {len(rows) - MOST_SETS} more"] if len(rows) > MOST_SETS else []
    lines = (*text_table(header, shown), *more, *notes)
    return Look(lines=lines, open_points=tuple(dict.fromkeys(open_points))), estimate


def _look_at_modes(modes: ModalParameters, options: StageOptions) -> Look:
    fit = fit_modes(modes, options=options.fit)
    count, dofs = counted(len(modes.damping_ratio), "mode"), counted(len(modes.dofs), "DOF")
    lines = [f"  read      {count} at {dofs}, {fit.n_modes} in the band; no FRF"]
    return Look(lines=(*lines, *(f"  note      {text}" for text in fit.warnings)))


def _describe_recording(blocks: Iterator[FloatArray], *, is_large: bool) -> str:
    first = next(blocks)
    last, n_rows = first, len(first)
    for block in () if is_large else blocks:
        last, n_rows = block, n_rows + len(block)
    rate_hz = (n_rows - 1) / (last[-1, 0] - first[0, 0])
    duration = "" if is_large else f", {number(n_rows / rate_hz, 3)} s"
    return f"{'more than ' if is_large else ''}{n_rows} samples at {rate_hz:.6g} Hz{duration}"


def _describe_frfs(estimate: FrfEstimate) -> str:
    frfs = estimate.frfs
    low, high = frfs.frequency_hz[0], frfs.frequency_hz[-1]
    step = float(np.median(np.diff(frfs.frequency_hz)))
    return (
        f"  read      {counted(frfs.n_frfs, 'FRF')} on {counted(frfs.n_lines, 'line')}, {number(low)} to "
        f"{number(high)} Hz, {number(step, 3)} Hz apart"
    )


def _sets(test: VibrationTest, records: pd.DataFrame) -> Iterator[tuple[TestSetup, pd.DataFrame]]:
    """Give the records of each set-up."""
    files = records["record"].str.replace(r"#\d+$", "", regex=True)
    for setup in test.setups:
        names = {record_name(test, path, 1, 1) for path in setup.files}
        of_setup = records[files.isin(names)]
        if len(of_setup):
            yield setup, of_setup


def _row(test: VibrationTest, setup: TestSetup, records: pd.DataFrame) -> tuple[str, ...]:
    used = f"{int(records['used'].sum())} of {len(records)}"
    force, remarks = _range(np.abs(records["peak_force_N"])), _describe_marks(records)
    if test.kind != "hammer":
        return str(setup.input_dof), used, force, _range(records["samples"] * records["step_s"]), remarks
    return (
        str(setup.input_dof),
        used,
        force,
        _range(1e3 * records["pulse_s"]),
        number(_force_band_hz(records), 3),
        _range(records["snr_db"]),
        remarks,
    )


def _range(values: pd.Series) -> str:
    low, high = number(float(values.min()), 3), number(float(values.max()), 3)
    return low if low == high else f"{low} to {high}"


def _describe_marks(records: pd.DataFrame) -> str:
    """Count what is wrong, by its name: what stands before the colon."""
    marks = (mark for text in records["marks"] for mark in text.split("; ") if mark)
    counts = Counter(re.split("[:,]", mark)[0] for mark in marks)
    return ", ".join(f"{count} x {name}" for name, count in counts.most_common())


def _force_band_hz(records: pd.DataFrame) -> float:
    """Take the band of the usual impact; a weak one shows less of it than it has."""
    return float(records["force_band_hz"].median())


def _left_out(setup: TestSetup, records: pd.DataFrame) -> Iterator[str]:
    n_left_out = int((~records["used"]).sum())
    if 2 * n_left_out > len(records):
        marks = _describe_marks(records)
        yield f"{n_left_out} of the {counted(len(records), 'record')} at {setup.input_dof} are left out: {marks}"


def _beyond_the_hammer(
    setup: TestSetup, records: pd.DataFrame, frfs: FrfSet, band_hz: tuple[float, float] | None
) -> Iterator[str]:
    """Say where the band goes on beyond what the hammer excites, and the FRFs are noise there."""
    reach_hz = _force_band_hz(records)
    if band_hz is None or not band_hz[0] < reach_hz < band_hz[1]:
        return
    lines = (frfs.frequency_hz > reach_hz) & (frfs.frequency_hz <= band_hz[1])
    block = np.ix_(lines, np.array([label.input_dof == setup.input_dof for label in frfs.labels]))
    power, noise = np.abs(frfs.values[block]) ** 2, frfs.variance[block]
    known = np.isfinite(noise)
    if known.any() and np.mean(power[known] > noise[known]) < HEARD:
        yield (
            f"[fit] band_hz ends at {number(band_hz[1])} Hz, and the force at {setup.input_dof} reaches up to "
            f"{number(reach_hz, 3)} Hz only: above, the FRFs are noise; end the band there, or use a harder tip"
        )
