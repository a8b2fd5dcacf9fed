"""``test.toml`` to start from."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from frf_ipz.errors import InputError
from frf_ipz.ingest.formats.frf_file import FrfContents, FrfSource
from frf_ipz.ingest.formats.registry import look_at_frfs
from frf_ipz.ingest.units import frf_factor
from frf_ipz.pipeline.init.columns import UNITS, quantity_of, read_columns
from frf_ipz.pipeline.init.excitation import excitation
from frf_ipz.pipeline.init.folder_contents import BARE_FRF, is_bare_frf
from frf_ipz.pipeline.init.text import HEAD, guessed, quoted, with_comment
from frf_ipz.quantities import FrfQuantity

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from frf_ipz.dofs import Dof
    from frf_ipz.pipeline.init.columns import Column, Columns
    from frf_ipz.pipeline.init.folder_contents import FolderContents
    from frf_ipz.pipeline.init.places import Places

TRAILING_NUMBER = re.compile(r"\d*$")
NODE = re.compile(r"(\d+)")
QUANTITIES = "force | acceleration | velocity | displacement"
SENSITIVITY = "10.2 mV/g_0"
ENTRIES = {"hammer": "hit", "random": "record"}


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
        return _test_of_recordings(contents, places)
    return _frf_test(contents, places) if contents.frfs else _modes_test(contents)


def _head(contents: FolderContents) -> list[str]:
    geometry = [] if contents.geometry is None else [f"geometry = {quoted(contents.name(contents.geometry))}"]
    return [
        HEAD,
        "[test]",
        f"name = {quoted(contents.folder.resolve().name)}",
        *geometry,
        with_comment('# operator = "A. Meier"', "and date, equipment, customer, serial_number: shown on the page"),
        with_comment("# nominal_damping_ratio = 0.001", "where the model states none"),
    ]


def _test_of_recordings(contents: FolderContents, places: Places) -> str:
    columns = read_columns(contents.recordings)
    kind = excitation(contents.recordings, columns)
    lines = [*_head(contents), guessed(f'kind = "{kind}"', "hammer | random (shaker, long records)")]
    if not columns.has_time:
        lines.append(guessed("# sample_rate_hz = 2048.0", "needed: the files have no column of time"))
    lines += _channel(columns.force, "input")
    known = {name: dofs for name in columns.names if len(dofs := _dofs_of(columns, name)) == 1}
    for number, column in enumerate(columns.responses, start=1):
        lines += _channel(column, "output")
        if column.name in known:
            lines.append(with_comment(f"dof = {quoted(str(*known[column.name]))}", "as the files say"))
        elif not _dofs_of(columns, column.name):
            lines.append(guessed(f"dof = {quoted(places.of_sensor(number))}", "NODE:SIGN DIRECTION of the sensor"))
        lines.append(with_comment("# mass_kg = 0.004", "the sensor's own mass, where it is known"))
    also = "is a force too; several at once are inputs with a 'dof' each, of kind \"random\""
    lines += [f"\n# the column {quoted(column.name)} {also}" for column in columns.other_forces]
    return "\n".join([*lines, *_setups(contents, places, columns, ENTRIES[kind])]) + "\n"


def _dofs_of(columns: Columns, name: str) -> set[Dof]:
    return {dofs[name] for dofs in columns.dofs.values() if name in dofs}


def _setups(contents: FolderContents, places: Places, columns: Columns, entry: str) -> list[str]:
    """Write an entry for each excited DOF and layout of sensors, as far as files say them, else as their names do."""
    by_dofs: dict[tuple[Dof, ...], list[Path]] = {}
    for path, dofs in columns.dofs.items():
        if columns.force.name in dofs:
            by_dofs.setdefault(tuple(dofs[name] for name in columns.names if name in dofs), []).append(path)
    if sum(map(len, by_dofs.values())) < len(contents.recordings):
        lines = []
        for name, pattern in _groups(contents.folder, contents.recordings).items():
            numbers = NODE.findall(name)
            struck = int(numbers[-1]) if numbers else 1
            lines += ["", f"[[{entry}]]", guessed(f"dof = {quoted(places.of_impact(struck))}", "where the force acts")]
            lines.append(f"files = [{quoted(pattern)}]")
        return lines
    lines = []
    for paths in by_dofs.values():
        dofs = columns.dofs[paths[0]]
        roving = [name for name in columns.names[1:] if name in dofs and len(_dofs_of(columns, name)) > 1]
        force = quoted(str(dofs[columns.force.name]))
        lines += ["", f"[[{entry}]]", with_comment(f"dof = {force}", "as the files say")]
        lines.append(f"files = [{', '.join(quoted(_escaped(contents.name(path))) for path in paths)}]")
        if roving:
            pairs = ", ".join(f"{quoted(name)} = {quoted(str(dofs[name]))}" for name in roving)
            lines.append(f"output_dofs = {{ {pairs} }}")
    return lines


def _escaped(name: str) -> str:
    """Write the name of a file as a pattern that fits it alone."""
    return re.sub(r"([*?\[])", r"[\1]", name)


def _channel(column: Column, role: str) -> list[str]:
    quantity = f'quantity = "{column.quantity}"'
    lines = ["", "[[channel]]", f"column = {quoted(column.name)}", f'role = "{role}"']
    lines.append(quantity if column.is_known else guessed(quantity, QUANTITIES))
    if column.unit_tells:
        lines.append(with_comment("# unit", f"the files say {column.file_unit}"))
    elif quantity_of(column.file_unit):
        lines.append(guessed(f'unit = "{UNITS[column.quantity]}"', f"the files say {column.file_unit}"))
        lines.append(f"wrong_file_unit = {quoted(column.file_unit)}")
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


def _frf_test(contents: FolderContents, places: Places) -> str:
    lines = [*_head(contents), 'kind = "frf"']
    taken: set[tuple[str, str]] = set()
    for path in contents.frfs:
        source = FrfSource(path=path, quantity=FrfQuantity.ACCELERANCE)
        found = look_at_frfs(source) or FrfContents(n_outputs=1, n_inputs=1)
        for name in found.arrays or ("",):
            lines += ["", "[[frf]]", f"file = {quoted(contents.name(path))}"]
            lines += [f"variables = {{ frf = {quoted(name)} }}"] if name else []
            lines += _frf_keys(path, found, places, taken, is_roving=len(contents.frfs) > 1)
            if is_bare_frf(path):
                lines.append(guessed(f"columns = {_listed(list(BARE_FRF))}", "the file names none"))
    return "\n".join(lines) + "\n"


def _modes_test(contents: FolderContents) -> str:
    modes = "" if contents.modes is None else contents.name(contents.modes)
    lines = [*_head(contents), 'kind = "modes"', "", "[[modes]]", f"file = {quoted(modes)}"]
    lines.append(with_comment('# input_dofs = ["1:+z"]', "where forces act in what is predicted"))
    return "\n".join(lines) + "\n"


def _frf_keys(
    path: Path, found: FrfContents, places: Places, taken: set[tuple[str, str]], *, is_roving: bool
) -> list[str]:
    """Say what FRFs are and connect; what the file does not say is guessed."""
    quantity = found.quantity or _quantity_of(found.unit)
    name = quantity.value if quantity is not None else FrfQuantity.ACCELERANCE.value
    key = f'quantity = "{name}"'
    lines = [key if quantity is not None else guessed(key, "accelerance | mobility | receptance")]
    if found.about:
        lines.append(f"# {found.about}")
    if found.lacks_directions:
        lines.append(guessed('direction = "z"', "of the nodes, which have none in the file"))
    elif not found.ends:
        outputs, inputs = _guess_ends(path, found, places, taken, is_roving=is_roving)
        taken |= {(output, input_) for output in outputs for input_ in inputs}
        lines.append(guessed(f"output_dof = {_listed(outputs)}", "of the sensors"))
        lines.append(guessed(f"input_dof = {_listed(inputs)}", "of the forces"))
    return lines


def _guess_ends(
    path: Path, found: FrfContents, places: Places, taken: set[tuple[str, str]], *, is_roving: bool
) -> tuple[list[str], list[str]]:
    """Guess what FRFs connect: as the file's name says where it is one FRF, and no pair twice.

    A single number in the names of several files is that of a hammer that roves, with one sensor.
    """
    nodes = [int(number) for number in NODE.findall(path.stem)]
    struck = places.of_impact(nodes[-1] if nodes else 1)
    if not found.n_outputs == found.n_inputs == 1:
        outputs = [places.of_sensor(number) for number in range(1, found.n_outputs + 1)]
        return outputs, [places.of_impact(number) for number in range(1, found.n_inputs + 1)]
    first = places.of_impact(nodes[0]) if len(nodes) > 1 else places.of_sensor(1) if is_roving else struck
    candidates = [first, *(places.of_sensor(number) for number in range(1, len(taken) + 2))]
    return [next((output for output in candidates if (output, struck) not in taken), first)], [struck]


def _quantity_of(unit: str) -> FrfQuantity | None:
    for quantity in FrfQuantity if unit else ():
        try:
            frf_factor(unit, quantity, "z", "z")
        except InputError:
            continue
        return quantity
    return None


def _listed(dofs: list[str]) -> str:
    return quoted(dofs[0]) if len(dofs) == 1 else f"[{', '.join(map(quoted, dofs))}]"
