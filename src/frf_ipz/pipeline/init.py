"""Starting files for a folder of recordings: what can be seen is filled in, what cannot is marked for the user."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from frf_ipz.errors import InputError
from frf_ipz.ingest.formats.recording import TableKeys
from frf_ipz.ingest.formats.text_columns import TIME, find_columns
from frf_ipz.ingest.formats.text_layout import is_number, name_and_unit, sniff
from frf_ipz.output_files import write_text

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

    from frf_ipz.ingest.formats.text_columns import TextColumns

# Quantity, unit where the file states none, and what a column of it is called.
QUANTITIES = (
    ("force", "N", re.compile(r"force|hammer|impact|load|(^|_)f\d*$", re.IGNORECASE)),
    ("velocity", "m/s", re.compile(r"vel|ldv|vibrometer|(^|_)v\d*$", re.IGNORECASE)),
    ("displacement", "m", re.compile(r"disp|gap|pos|(^|_)[xu]\d*$", re.IGNORECASE)),
    ("acceleration", "m/s^2", re.compile(r"", re.IGNORECASE)),
)
TRAILING_NUMBER = re.compile(r"\d*$")
NODE = re.compile(r"(\d+)")
FRF_COLUMNS = ("frequency_hz", "output_dof", "input_dof")


@dataclass(frozen=True, slots=True)
class _Column:
    name: str
    unit: str
    quantity: str


def write_starting_files(folder: Path) -> dict[Path, bool]:
    """Write ``test.toml`` and ``pipeline.toml`` for a folder of CSVs.

    Parameters
    ----------
    folder : Path
        Holds the recordings, in itself or in folders below it.

    Returns
    -------
    dict of Path to bool
        Each file, and whether it was written; what was there is left alone.

    Raises
    ------
    InputError
        If the folder holds no CSV, or their columns differ.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: there is no such folder; give the one that holds the recordings")
    files = sorted(path for path in folder.rglob("*") if path.suffix.lower() == ".csv" and not _is_hidden(path, folder))
    if not files:
        raise InputError(f"{folder}: holds no .csv; put the recordings there, one file an impact, then run init again")
    is_frf = set(FRF_COLUMNS) <= {name for fields in sniff(files[0]).header for name in fields}
    test = _frf_test(folder, files) if is_frf else _hammer_test(folder, files)
    pipeline = _pipeline(folder)
    return {
        path: _write(path, text) for path, text in ((folder / "test.toml", test), (folder / "pipeline.toml", pipeline))
    }


def _write(path: Path, text: str) -> bool:
    try:
        if path.exists() and path.stat().st_size:  # an empty one is what a full disk has left
            return False
        write_text(path, text)
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from None
    return True


def _is_hidden(path: Path, folder: Path) -> bool:
    return any(part.startswith(".") for part in path.relative_to(folder).parts)


def _find_columns(files: Sequence[Path]) -> TextColumns:
    first = find_columns(sniff(files[0]), TableKeys())
    for path in files[1:]:
        other = find_columns(sniff(path), TableKeys())
        if other.names != first.names:
            raise InputError(
                f"{path}: has the columns {', '.join(other.names)}, and {files[0]} has {', '.join(first.names)}; "
                "put files with different columns into folders of their own and run init on each"
            )
    return first


def _signals(path: Path, found: TextColumns) -> list[_Column]:
    """Give the columns of signals: those that hold numbers, and are neither a time nor a count."""
    rows = sniff(path).rows
    columns = []
    for index, (name, unit) in enumerate(zip(found.names, found.units, strict=True)):
        is_time = index == found.time or TIME.match(name) or (index == 0 and found.counts_samples)
        if is_time or not any(is_number(fields[index]) for fields in rows if index < len(fields)):
            continue
        quantity, default, _ = next(row for row in QUANTITIES if row[2].search(name_and_unit(name)[0]))
        written = name if name and found.names.count(name) == 1 else str(index + 1)
        columns.append(_Column(written, "" if unit else default, quantity))
    if len(columns) < 2:
        names = ", ".join(found.names)
        raise InputError(f"{path}: a force and a response are needed besides the time; its columns are {names}")
    if not any(column.quantity == "force" for column in columns):
        columns[0] = _Column(columns[0].name, "N" if columns[0].unit else "", "force")
    return columns


def _hammer_test(folder: Path, files: Sequence[Path]) -> str:
    found = _find_columns(files)
    columns = _signals(files[0], found)
    force = next(column for column in columns if column.quantity == "force")
    lines = [
        "# Written by 'frf-ipz init'. Look at every line that says CHECK.",
        "[test]",
        f"name = {_quoted(folder.resolve().name)}",
        _checked('kind = "hammer"', "hammer | random (shaker, long records)"),
        "# nominal_damping_ratio = 0.001 # where the model states none",
    ]
    if found.time is None:
        lines.append(_checked("# sample_rate_hz = 2048.0", "needed: the files have no column of time"))
    lines += _channel(force, node=None)
    for node, column in enumerate((column for column in columns if column is not force), start=1):
        lines += _channel(column, node=node)
    for name, pattern in _groups(folder, files).items():
        numbers = NODE.findall(name)
        struck = numbers[-1] if numbers else "1"
        lines += ["", "[[hit]]", _checked(f'dof = "{int(struck)}:+z"', "where these impacts hit")]
        lines.append(f"files = [{_quoted(pattern)}]")
    return "\n".join(lines) + "\n"


def _channel(column: _Column, *, node: int | None) -> list[str]:
    lines = ["", "[[channel]]", f"column = {_quoted(column.name)}", f'role = "{"output" if node else "input"}"']
    lines.append(_checked(f'quantity = "{column.quantity}"', "force | acceleration | velocity | displacement"))
    if column.unit:
        lines.append(_checked(f'unit = "{column.unit}"', 'or sensitivity = "10.2 mV/g_0"'))
    if node is not None:
        lines.append(_checked(f'dof = "{node}:+z"', "NODE:SIGN DIRECTION of the sensor, e.g. 18:+z"))
        lines.append("# mass_kg = 0.004               # the sensor's own mass, where it is known")
    return lines


def _groups(folder: Path, files: Iterable[Path]) -> dict[str, str]:
    """Files whose names differ in the last number only are impacts at one DOF: name of the group and its glob."""
    groups: dict[str, str] = {}
    for path in files:
        relative = path.relative_to(folder)
        stem = TRAILING_NUMBER.sub("", relative.stem)
        place = relative.parent / (f"{stem}*{relative.suffix}" if stem else f"*{relative.suffix}")
        groups[str(relative.parent / stem) if stem else str(relative.parent)] = place.as_posix()
    return groups


def _frf_test(folder: Path, files: Sequence[Path]) -> str:
    lines = [
        "# Written by 'frf-ipz init'. Look at every line that says CHECK.",
        "[test]",
        f"name = {_quoted(folder.resolve().name)}",
        'kind = "frf"',
        "# nominal_damping_ratio = 0.001 # where the model states none",
    ]
    for path in files:
        lines += ["", "[[frf]]", f"file = {_quoted(path.relative_to(folder).as_posix())}"]
        lines.append(_checked('quantity = "accelerance"', "accelerance | mobility | receptance"))
    return "\n".join(lines) + "\n"


def _pipeline(folder: Path) -> str:
    model = (
        'model = "model.toml"'
        if (folder / "model.toml").is_file()
        else '# model = "model.toml"          # the FE model'
    )
    return f"""# Written by 'frf-ipz init'. Everything that is left out is chosen by the program, and said.
[pipeline]
name = {_quoted(folder.resolve().name)}
test = "test.toml"
{model}

[fit]
# band_hz = [10.0, 700.0]       # the band that carries signal where it is left out
# exclude_hz = [[49.5, 50.5]]   # mains
# delay = true                  # channels may be late

# [diagnose]                    # say what the model left out
# apply = true                  # and let it flow on into updating and prediction

[predict]
points = []                     # points of interest, never measured, e.g. ["49:+z"]

# [export]
# ensemble = 50                 # members of the posterior, for robust design
"""


def _checked(key: str, comment: str) -> str:
    return f"{key:<31} # {comment}   CHECK"


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'
