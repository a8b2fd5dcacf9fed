"""FRFs that were estimated elsewhere: read, brought to SI and to common lines."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arguments import require_file
from frf_ipz.dofs import Dof, PortDof, as_direction, as_dof
from frf_ipz.errors import FileFormatError, QuantityError
from frf_ipz.frf import FrfSet
from frf_ipz.ingest.estimation.record_table import empty_record_table
from frf_ipz.ingest.formats.frf_conventions import read_frf_source
from frf_ipz.ingest.formats.frf_file import FrfSource
from frf_ipz.ingest.frf_estimate import FrfEstimate
from frf_ipz.ingest.signals.windows import correlated_lines
from frf_ipz.ingest.units import frf_factor
from frf_ipz.progress import silent
from frf_ipz.quantities import RECIPROCALS, FrfQuantity, as_quantity

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from frf_ipz.arrays import FloatArray, IntArray
    from frf_ipz.dofs import AnyDof
    from frf_ipz.frf import FrfLabel
    from frf_ipz.ingest.campaign import VibrationTest
    from frf_ipz.ingest.formats.frf_file import MeasuredFrf
    from frf_ipz.ingest.options import IngestOptions
    from frf_ipz.progress import Progress

SAME_LINE = 0.01  # of the spacing: frequencies that differ by less are one line
SIX_DIGITS = 1e-5  # relative: universal files state the step with six digits
FARTHEST = 0.1  # of the spacing: frequencies that differ by more are never one line
FEWEST_COMMON = (
    0.5  # of the lines of the coarsest file in the band that all cover: with fewer, the files have two grids
)


def estimate_frf_files(test: VibrationTest, options: IngestOptions, progress: Progress) -> FrfEstimate:
    """Read FRFs that were estimated elsewhere.

    Parameters
    ----------
    test : VibrationTest
        The test.
    options : IngestOptions
        Not used: nothing remains to be chosen.
    progress : Progress
        Called at each file.

    Returns
    -------
    FrfEstimate
        FRFs in SI on the lines that all files share; an empty table of records.

    Raises
    ------
    InputError
        If a file cannot be read, two FRFs are the same, or the files share too few lines.
    """
    del options
    if test.frfs is not None:
        places = [test.frfs.labels.index(label) for label in test.labels]
        return FrfEstimate(frfs=test.frfs.select_frfs(places), records=empty_record_table())
    at_levels = _read_by_level(test, progress)
    weakest: dict[FrfLabel, MeasuredFrf] = {}
    for frfs in at_levels.values():
        for frf in frfs:
            weakest.setdefault(frf.label, frf)
    joined, warnings = _as_measured(test, list(weakest.values()))
    return FrfEstimate(
        frfs=joined, records=empty_record_table(), warnings=(*warnings, *_say_levels(sorted(at_levels.keys() - {0.0})))
    )


def read_frf_levels(test: VibrationTest) -> dict[float, FrfSet]:
    """Read the FRFs of each level of excitation that ``level`` of ``[[frf]]`` states.

    Parameters
    ----------
    test : VibrationTest
        A test of kind ``frf``.

    Returns
    -------
    dict of float to FrfSet
        Amplitude of the excitation, N, in ascending order, and its FRFs in SI. Empty where fewer than two are stated.
    """
    at_levels = {level: frfs for level, frfs in _read_by_level(test).items() if level}
    return {level: _as_measured(test, frfs)[0] for level, frfs in at_levels.items()} if len(at_levels) > 1 else {}


def _read_by_level(test: VibrationTest, progress: Progress = silent) -> dict[float, list[MeasuredFrf]]:
    """Read all FRFs by ascending level; 0 for those that state none."""
    known = {label: label for label in test.labels}  # with the units of ports
    frfs: dict[float, list[MeasuredFrf]] = {}
    for position, source in enumerate(test.frf_sources):
        progress(position / len(test.frf_sources), f"reading {source.path.name}")
        of_level = frfs.setdefault(source.level_N or 0.0, [])
        read = ((frf, known.get(frf.label)) for frf in read_frf_source(source))
        of_level += [
            _to_si(replace(frf, output_dof=label.output_dof, input_dof=label.input_dof))
            for frf, label in read
            if label is not None
        ]
    for level, of_level in frfs.items():
        _check_frfs(of_level, others=frfs.get(0.0, ()) if level else ())
    return dict(sorted(frfs.items()))


def _as_measured(test: VibrationTest, frfs: Sequence[MeasuredFrf]) -> tuple[FrfSet, tuple[str, ...]]:
    joined, warnings = _join(frfs)
    joined = replace(joined, unknown_scale=test.unknown_scale)
    if test.applied_window_s is not None:
        joined = _with_applied_window(joined, 1.0 / test.applied_window_s)
    return joined, warnings


def _say_levels(levels_N: Sequence[float]) -> tuple[str, ...]:
    if len(levels_N) < 2:
        return ()
    return (
        f"FRFs at {len(levels_N)} levels, {levels_N[0]:g} to {levels_N[-1]:g} N: each FRF of the fit is the one at its "
        "lowest level; picture 'levels' shows how modes move with it",
    )


def _with_applied_window(frfs: FrfSet, decay_1_s: float) -> FrfSet:
    """Say that the FRFs hold at sigma + i omega: the analyser has windowed the responses, and pulses are short."""
    duration_s = 1.0 / np.median(np.diff(frfs.frequency_hz)) if len(frfs.frequency_hz) > 1 else 0.0
    return replace(frfs, window_decay_1_s=decay_1_s, correlated_lines=correlated_lines(decay_1_s * duration_s))


def read_frfs(
    path: str | Path,
    *,
    quantity: FrfQuantity | str = FrfQuantity.ACCELERANCE,
    unit: str = "",
    output: AnyDof | str | Sequence[AnyDof | str] | None = None,
    input: AnyDof | str | Sequence[AnyDof | str] | None = None,
    columns: Sequence[str] = (),
    skip_rows: int = 0,
    direction: str = "",
    conjugated: bool = False,
    variables: Mapping[str, str] | None = None,
) -> FrfSet:
    """Read the FRFs of one file: CSV, text with named columns, UFF 58, MATLAB, HDF5, NumPy or XLSX.

    Parameters
    ----------
    path : str or Path
        The file.
    quantity : FrfQuantity or str
        What its FRFs are: ``accelerance``, ``mobility`` or ``receptance``; or force over response, whose reciprocals
        are taken: ``apparent_mass``, ``impedance`` or ``dynamic_stiffness``.
    unit : str
        Unit of the values, such as ``"g/N"``; what the file states where it is left out, and else SI.
    output, input : Dof or str, or a sequence of them, optional
        What the FRF connects, for a file that does not say so; several for a file of arrays.
    columns : sequence of str
        What the columns of a text file are, as `columns` of ``[[frf]]`` in ``test.toml``.
    skip_rows : int
        Lines before the numbers of a text file.
    direction : str
        Direction of the ends that have none in a universal file, such as ``"z"``.
    conjugated : bool
        The file has the time convention exp(-i omega t).
    variables : mapping of str to str, optional
        What stands where in a file of arrays, as `variables` of ``[[frf]]`` in ``test.toml``.

    Returns
    -------
    FrfSet
        In SI, on the lines that all FRFs of the file share.

    Raises
    ------
    FileFormatError
        If the file cannot be read, or its FRFs share too few lines.
    QuantityError
        If the unit is none of the quantity.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import frf_ipz
    >>> table = '''frequency_hz,output_dof,input_dof,real,imag
    ... 10,11:+z,6:+z,0.1,0.01
    ... 20,11:+z,6:+z,0.3,0.02
    ... '''
    >>> with TemporaryDirectory() as folder:
    ...     _ = (Path(folder) / "tip.csv").write_text(table)
    ...     frf_ipz.read_frfs(f"{folder}/tip.csv", quantity="accelerance")
    FrfSet: 1 FRF (accelerance) on 2 lines from 10 to 20 Hz, 11:+z / 6:+z
    """
    source = FrfSource(
        path=require_file(path),
        quantity=RECIPROCALS.get(str(quantity)) or as_quantity(quantity),
        is_reciprocal=str(quantity) in RECIPROCALS,
        unit=unit,
        output_dofs=_as_dofs(output),
        input_dofs=_as_dofs(input),
        variables=tuple((variables or {}).items()),
        columns=tuple(columns),
        skip_rows=skip_rows,
        direction=as_direction(direction),
        is_conjugated=conjugated,
    )
    frfs = [_to_si(frf) for frf in read_frf_source(source)]
    _check_frfs(frfs)
    return _join(frfs)[0]


def _as_dofs(dofs: AnyDof | str | Sequence[AnyDof | str] | None) -> tuple[AnyDof, ...]:
    if dofs is None:
        return ()
    return (as_dof(dofs),) if isinstance(dofs, Dof | PortDof | str) else tuple(map(as_dof, dofs))


def _join(frfs: Sequence[MeasuredFrf]) -> tuple[FrfSet, tuple[str, ...]]:
    """Bring FRFs to the lines that all of them have; with what is to be said about it."""
    labels = tuple(frf.label for frf in frfs)
    lines, warnings = _common_lines(frfs)
    pairs = [(frf, _nearest(frf.frequency_hz, lines)) for frf in frfs]
    joined = FrfSet(
        frequency_hz=lines,
        values=np.column_stack([frf.values[row] for frf, row in pairs]),
        labels=labels,
        variance=np.column_stack([_values_or_nan(frf, frf.variance)[row] for frf, row in pairs]),
        coherence=np.column_stack([_values_or_nan(frf, frf.coherence)[row] for frf, row in pairs]),
        averages=np.zeros(len(frfs), np.int64),
    )
    return joined, warnings


def _values_or_nan(frf: MeasuredFrf, values: FloatArray | None) -> FloatArray:
    return np.full(len(frf.frequency_hz), np.nan) if values is None else values


def _to_si(frf: MeasuredFrf) -> MeasuredFrf:
    unit = frf.source.unit or frf.unit
    if not unit:
        return frf
    directions = frf.output_dof.direction, frf.input_dof.direction
    try:
        factor = frf_factor(unit, frf.source.quantity, *directions)
    except QuantityError as error:
        key = "the 'unit' of its [[frf]]: " if frf.source.unit else ""
        raise QuantityError(f"{frf.source.path}: {key}{error}") from None
    variance = None if frf.variance is None else frf.variance * factor**2
    return replace(frf, values=frf.values * factor, variance=variance)


def _check_frfs(frfs: Sequence[MeasuredFrf], others: Sequence[MeasuredFrf] = ()) -> None:
    """Check FRFs of one level; `others` state none."""
    first = {frf.label: frf for frf in others}
    for frf in frfs:
        path, frequency, label = frf.source.path, frf.frequency_hz, frf.label
        if label in first:
            problem = f"holds the FRF {label} that {first[label].source.path.name} holds already"
            raise FileFormatError(path, f"{problem}; FRFs at several levels of excitation need 'level' in each [[frf]]")
        first[label] = frf
        if len(frequency) < 2 or (np.diff(frequency) <= 0.0).any() or frequency[0] < 0.0:
            problem = f"the frequencies of the FRF {label} do not ascend from 0 or above, each once"
            raise FileFormatError(path, problem, where="frequency_hz")
        for name in ("coherence", "variance"):
            values = getattr(frf, name)
            if values is not None and (values < 0.0).any():
                worst = int(np.nanargmin(values))
                problem = f"the FRF {label} has the {name} {values[worst]:g} at {frequency[worst]:g} Hz, below zero"
                raise FileFormatError(path, f"{problem}; correct it, or leave it empty", where=f"column '{name}'")


def _common_lines(frfs: Sequence[MeasuredFrf]) -> tuple[FloatArray, tuple[str, ...]]:
    """Find the lines that all FRFs have; the coarsest file says how many they should be."""
    notes = dict.fromkeys(note for frf in frfs for note in frf.notes)
    low = max(frf.frequency_hz[0] for frf in frfs)
    high = min(frf.frequency_hz[-1] for frf in frfs)
    coarsest = min(frfs, key=lambda frf: _count_between(frf.frequency_hz, low, high))
    lines = coarsest.frequency_hz
    for frf in frfs:
        lines = lines[_contains(frf.frequency_hz, lines)]
    if len(lines) < max(2, int(FEWEST_COMMON * _count_between(coarsest.frequency_hz, low, high))):
        raise _no_common_lines(frfs)
    largest = max(len(frf.frequency_hz) for frf in frfs)
    if len(lines) < largest:
        notes[_say_lines_left_out(frfs, len(lines), largest)] = None
    return lines, tuple(notes)


def _say_lines_left_out(frfs: Sequence[MeasuredFrf], n_used: int, largest: int) -> str:
    """Say which files have lines that others lack, and where a file begins or ends before others."""
    finest = max(frfs, key=lambda frf: len(frf.frequency_hz))
    last = max(frfs, key=lambda frf: frf.frequency_hz[0])
    first = min(frfs, key=lambda frf: frf.frequency_hz[-1])
    bounds = [
        (last, last.frequency_hz[0], min(frf.frequency_hz[0] for frf in frfs), "below", "begins"),
        (first, first.frequency_hz[-1], max(frf.frequency_hz[-1] for frf in frfs), "above", "ends"),
    ]
    spans = [
        f"; none {side} {bound:g} Hz, where {_named_among(frf, frfs)} {verb}"
        for frf, bound, widest, side, verb in bounds
        if abs(bound - widest) > SIX_DIGITS * abs(bound)
    ]
    coarsest = min(frfs, key=lambda frf: _count_between(frf.frequency_hz, last.frequency_hz[0], first.frequency_hz[-1]))
    if not spans:
        spans = [f"; {_named_among(coarsest, frfs)} has the fewest"]
    used = f"{n_used} of up to {largest} lines are used: those that all FRFs share"
    return f"{used}; {_named_among(finest, frfs)} has more{''.join(spans)}"


def _named_among(frf: MeasuredFrf, frfs: Sequence[MeasuredFrf]) -> str:
    """Name an FRF by its file where no other is in it, else by what it connects too."""
    name = frf.source.path.name
    return name if sum(other.source.path == frf.source.path for other in frfs) == 1 else f"{frf.label} in {name}"


def _count_between(frequency_hz: FloatArray, low: float, high: float) -> int:
    return int(np.count_nonzero((frequency_hz >= low * (1 - SIX_DIGITS)) & (frequency_hz <= high * (1 + SIX_DIGITS))))


def _no_common_lines(frfs: Sequence[MeasuredFrf]) -> FileFormatError:
    """Make the error that names the two FRFs that share the fewest lines."""
    pairs = [(frf, frfs[place]) for place in range(len(frfs)) for frf in frfs[place + 1 :]]
    outlier, other = min(pairs, key=lambda pair: _share(*pair))
    texts = [
        f"{len(frf.frequency_hz)} from {frf.frequency_hz[0]:g} to {frf.frequency_hz[-1]:g} Hz"
        for frf in (outlier, other)
    ]
    problem = f"the lines of {outlier.label} ({texts[0]}) are not those of {other.label} in {other.source.path.name}"
    shared = f"they share {int(_shared_lines(outlier, other).sum())}"
    way_out = f" ({texts[1]}): {shared}; all FRFs of a test need common lines, so export them alike"
    return FileFormatError(outlier.source.path, problem + way_out)


def _share(frf: MeasuredFrf, other: MeasuredFrf) -> float:
    """Give the share of the lines of the coarser one that the other has too."""
    return float(_shared_lines(frf, other).mean())


def _shared_lines(frf: MeasuredFrf, other: MeasuredFrf) -> np.ndarray:
    """Tell which lines of the coarser one the other has too."""
    coarse, fine = sorted((frf.frequency_hz, other.frequency_hz), key=len)
    return _contains(fine, coarse)


def _contains(frequency_hz: FloatArray, lines: FloatArray) -> np.ndarray:
    """Tell which of some lines an FRF has, to within a small part of its spacing there: lines may be uneven."""
    above = np.clip(np.searchsorted(frequency_hz, lines), 1, len(frequency_hz) - 1)
    spacing = frequency_hz[above] - frequency_hz[above - 1]
    tolerance = np.clip(SIX_DIGITS * lines, SAME_LINE * spacing, FARTHEST * spacing)
    return np.asarray(np.abs(frequency_hz[_nearest(frequency_hz, lines)] - lines) <= tolerance)


def _nearest(frequency_hz: FloatArray, lines: FloatArray) -> IntArray:
    above = np.clip(np.searchsorted(frequency_hz, lines), 1, len(frequency_hz) - 1)
    is_below = lines - frequency_hz[above - 1] < frequency_hz[above] - lines
    return np.asarray(above - is_below)
