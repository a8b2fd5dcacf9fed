"""``test.toml`` to start from."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from frf_ipz.pipeline.init.columns import UNITS, read_columns
from frf_ipz.pipeline.init.text import HEAD, guessed, quoted, with_comment

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from frf_ipz.pipeline.init.columns import Column
    from frf_ipz.pipeline.init.folder_contents import FolderContents
    from frf_ipz.pipeline.init.places import Places

TRAILING_NUMBER = re.compile(r"\d*$")
NODE = re.compile(r"(\d+)")
QUANTITIES = "force | acceleration | velocity | displacement"
SENSITIVITY = "10.2 mV/g_0"


def draft_test(contents: FolderContents, places: Places) -> str:
    """Write a test for what a folder holds.

    Parameters
    ----------
    contents : FolderContents
        The folder.
    places : Places
        DOFs to start from.

    Returns
    -------
    str
        Text of ``test.toml``.
    """
    if contents.recordings:
        return _hammer_test(contents, places)
    return _frf_test(contents) if contents.frfs else _modes_test(contents)


def _head(contents: FolderContents) -> list[str]:
    return [
        HEAD,
        "[test]",
        f"name = {quoted(contents.folder.resolve().name)}",
        with_comment('# operator = "A. Meier"', "and date, equipment, customer, serial_number: shown on the page"),
        with_comment("# nominal_damping_ratio = 0.001", "where the model states none"),
    ]


def _hammer_test(contents: FolderContents, places: Places) -> str:
    columns = read_columns(contents.recordings)
    lines = [*_head(contents), guessed('kind = "hammer"', "hammer | random (shaker, long records)")]
    if not columns.has_time:
        lines.append(guessed("# sample_rate_hz = 2048.0", "needed: the files have no column of time"))
    lines += _channel(columns.force, "input")
    for number, column in enumerate(columns.responses, start=1):
        lines += _channel(column, "output")
        lines.append(guessed(f"dof = {quoted(places.of_sensor(number))}", "NODE:SIGN DIRECTION of the sensor"))
        lines.append(with_comment("# mass_kg = 0.004", "the sensor's own mass, where it is known"))
    lines += [f"\n# the column {quoted(column.name)} is a force too; a test has one" for column in columns.other_forces]
    for name, pattern in _groups(contents.folder, contents.recordings).items():
        numbers = NODE.findall(name)
        struck = int(numbers[-1]) if numbers else 1
        lines += ["", "[[hit]]", guessed(f"dof = {quoted(places.of_impact(struck))}", "where these impacts hit")]
        lines.append(f"files = [{quoted(pattern)}]")
    return "\n".join(lines) + "\n"


def _channel(column: Column, role: str) -> list[str]:
    quantity = f'quantity = "{column.quantity}"'
    lines = ["", "[[channel]]", f"column = {quoted(column.name)}", f'role = "{role}"']
    lines.append(quantity if column.is_known else guessed(quantity, QUANTITIES))
    if column.unit_tells:
        lines.append(with_comment("# unit", f"the files say {column.file_unit}"))
    elif column.file_unit:
        needed = f"needed: the files are in {column.file_unit}"
        lines.append(guessed(f"# sensitivity = {quoted(SENSITIVITY)}", needed))
    else:
        lines.append(guessed(f'unit = "{UNITS[column.quantity]}"', f"or sensitivity = {quoted(SENSITIVITY)}"))
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


def _frf_test(contents: FolderContents) -> str:
    lines = [*_head(contents), 'kind = "frf"']
    for path in contents.frfs:
        lines += ["", "[[frf]]", f"file = {quoted(contents.name(path))}"]
        lines.append(guessed('quantity = "accelerance"', "accelerance | mobility | receptance"))
    return "\n".join(lines) + "\n"


def _modes_test(contents: FolderContents) -> str:
    modes = "" if contents.modes is None else contents.name(contents.modes)
    lines = [*_head(contents), 'kind = "modes"', "", "[[modes]]", f"file = {quoted(modes)}"]
    lines.append(with_comment('# input_dofs = ["1:+z"]', "where forces act in what is predicted"))
    return "\n".join(lines) + "\n"
