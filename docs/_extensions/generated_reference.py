"""The reference of files, written from the code: every key of every TOML file, every column of every table.

A Sphinx extension: before a build it writes ``reference/generated/*.md``. `files_reference` gives the same texts to the
test that looks for every key and every column.
"""

from __future__ import annotations

import inspect
import types
import typing
from dataclasses import MISSING, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args, get_origin, get_type_hints

from numpydoc.docscrape import NumpyDocString
from typer.main import get_command

from frf_ipz.cli.main import app
from frf_ipz.diagnosis.catalogue.finder import shipped_effects
from frf_ipz.diagnosis.nonlinear.laws.finder import shipped_laws
from frf_ipz.export.run_tables import FILES
from frf_ipz.fe.model_file import FILE_TYPES
from frf_ipz.ingest.campaign_file import CampaignFileKeys
from frf_ipz.pipeline.config import PipelineFile

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from sphinx.application import Sphinx

UNITS = {
    "hz": "Hz", "s": "s", "m": "m", "kg": "kg", "N": "N", "Pa": "Pa", "deg": "degrees", "seconds": "s",
    "m3": "m³", "kgm2": "kg m²", "rad": "rad", "ratio": "–",
}  # fmt: skip
COMPOUND_UNITS = {
    "kg_m3": "kg/m³", "N_m": "N/m", "Nm_rad": "N m/rad", "Ns_m": "N s/m", "m_per_m": "m per m", "1_s": "1/s",
    "rad_s": "rad/s", "N_m3": "N/m³",
}  # fmt: skip


def setup(app: Sphinx) -> dict[str, bool]:
    """Write the reference before Sphinx looks for documents."""
    app.connect("builder-inited", lambda sphinx: write_reference(Path(sphinx.srcdir) / "reference" / "generated"))
    return {"parallel_read_safe": True}


def write_reference(folder: Path) -> None:
    """Write all pages; a page that has not changed is left alone, so that it is not built again."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in files_reference().items():
        path = folder / name
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def files_reference() -> dict[str, str]:
    """Give the text of every page by the name of its file."""
    models = "\n".join(_file("model.toml", kind, f'kind = "{name}"') for name, kind in FILE_TYPES.items())
    return {
        "test_toml.md": _file("test.toml", CampaignFileKeys),
        "model_toml.md": models,
        "pipeline_toml.md": _file("pipeline.toml", PipelineFile),
        "tables.md": "\n".join(_table(name, columns) for name, columns in FILES.items()),
        "effects.md": _effects(),
        "command.md": _command(),
    }


def _file(name: str, kind: type, heading: str = "") -> str:
    """One TOML file: a table of keys a section."""
    text = [f"## `{heading}`\n" if heading else ""]
    for title, section in sections(kind):
        text.append(f"### `{title}`\n" if heading else f"## `{title}`\n")
        summary = (inspect.getdoc(section) or "").partition("\n\n")[0].replace("\n", " ")
        text.append(f"{summary}\n")
        text.append("| key | values | unit | default | meaning |\n| --- | --- | --- | --- | --- |")
        text += [
            f"| `{key}` | {values} | {unit} | {default} | {meaning} |"
            for key, values, unit, default, meaning in keys_of(section)
        ]
        text.append("")
    return "\n".join(text) + "\n"


def sections(kind: type) -> Iterator[tuple[str, type]]:
    """Give the sections of a TOML file, and the tables that stand in their keys, with the dataclass of each."""
    hints = get_type_hints(kind, include_extras=True)
    for item in fields(kind):
        section, repeated = _dataclass_in(hints[item.name])
        if section is None:
            continue
        title = f"[[{item.name}]]" if repeated else f"[{item.name}]"
        yield title, section
        yield from _inner(item.name, section)


def _inner(path: str, section: type) -> Iterator[tuple[str, type]]:
    hints = get_type_hints(section, include_extras=True)
    for item in fields(section):
        inner, repeated = _dataclass_in(hints[item.name])
        if inner is not None:
            place = f"{path}.{item.name}"
            yield (f"[[{place}]]" if repeated else f"{place} = {{ … }}"), inner
            yield from _inner(place, inner)


def keys_of(section: type) -> Iterator[tuple[str, str, str, str, str]]:
    """Give name, values, unit, default and meaning of every key of a section."""
    meanings = parameter_meanings(section)
    hints = get_type_hints(section, include_extras=True)
    for item in fields(section):
        if _dataclass_in(hints[item.name])[0] is not None and not _has_plain_branch(hints[item.name]):
            continue
        yield (
            item.name,
            _cell(_values(hints[item.name])),
            unit_of(item.name),
            _cell(_default(item)),
            _cell(meanings[item.name]),
        )


def parameter_meanings(section: type) -> dict[str, str]:
    """Read what each parameter means out of the numpydoc docstring of a class."""
    parsed = NumpyDocString(inspect.getdoc(section) or "")
    return {
        name.strip(): " ".join(parameter.desc)
        for parameter in parsed["Parameters"]
        for name in parameter.name.split(",")
    }


def unit_of(name: str) -> str:
    """Read the unit out of a key's name."""
    for ending, unit in COMPOUND_UNITS.items():
        if name.endswith(f"_{ending}"):
            return unit
    return UNITS.get(name.rpartition("_")[2], "") if "_" in name or name in UNITS else ""


def _dataclass_in(hint: Any) -> tuple[type | None, bool]:
    """Give the dataclass in a type hint, and whether it stands in a list."""
    if is_dataclass(hint):
        return typing.cast("type", hint), False
    for argument in get_args(hint):
        found, repeated = _dataclass_in(argument)
        if found is not None:
            return found, repeated or get_origin(hint) is tuple
    return None, False


def _has_plain_branch(hint: Any) -> bool:
    """A key that takes plain values or tables stands among the keys too."""
    origin = get_origin(hint)
    if origin in {typing.Union, types.UnionType}:
        plain = [branch for branch in get_args(hint) if branch is not type(None)]
        return any(_dataclass_in(branch)[0] is None for branch in plain)
    return any(_has_plain_branch(argument) for argument in get_args(hint))


def _values(hint: Any) -> str:
    """Say what a key takes, with its range."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is Annotated:
        limits = [text for part in arguments[1:] for text in _limits(part)]
        return f"{_values(arguments[0])}{', ' if limits else ''}{', '.join(limits)}"
    if origin is Literal:
        return " \\| ".join(f'`"{value}"`' if isinstance(value, str) else f"`{value}`" for value in arguments)
    if origin in {typing.Union, types.UnionType}:
        return " or ".join(dict.fromkeys(_values(part) for part in arguments if part is not type(None)))
    if origin is tuple:
        inner = [part for part in arguments if part is not Ellipsis]
        if Ellipsis in arguments:
            return f"list of {_values(inner[0])}"
        return f"{len(inner)} of {_values(inner[0])}"
    if origin is dict:
        return f"table: {_values(arguments[0])} = {_values(arguments[1])}"
    names = {float: "number", int: "whole number", str: "text", bool: "`true` \\| `false`"}
    return names.get(hint, "table" if is_dataclass(hint) else getattr(hint, "__name__", str(hint)))


def _limits(part: Any) -> Iterator[str]:
    """Read limits out of what pydantic keeps beside a type."""
    signs = {"gt": ">", "ge": "≥", "lt": "<", "le": "≤"}
    for piece in getattr(part, "metadata", [part]):
        for name, sign in signs.items():
            limit = getattr(piece, name, None)
            if limit is not None:
                yield f"{sign} {limit:g}"


def _default(item: Any) -> str:
    if item.default is not MISSING:
        value = item.default
    elif item.default_factory is not MISSING:
        value = item.default_factory()
    else:
        return "required"
    if value is None:
        return "chosen by the program" if item.type != "str" else "none"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, tuple | dict):
        return "empty" if not value else f"`{list(value)}`"
    return "empty" if value == "" else f'`"{value}"`' if isinstance(value, str) else f"`{value:g}`"


def _cell(text: str) -> str:
    return text.replace("\n", " ").replace("``", "`")


def _table(name: str, columns: Any) -> str:
    rows = [f"| `{column.name}` | {column.kind} | {column.unit} | {column.meaning} |" for column in columns]
    return "\n".join([f"## `{name}`\n", "| column | type | unit | meaning |\n| --- | --- | --- | --- |", *rows, ""])


def _effects() -> str:
    rows = []
    for name, effect in {**shipped_effects(), **shipped_laws()}.items():
        summary = (inspect.getdoc(type(effect)) or "").partition("\n")[0]
        rows.append(f"| `{name}` | {summary} |")
    return "\n".join(["| effect | what it is |\n| --- | --- |", *rows, ""])


def _command() -> str:
    """Every verb of the command with its arguments and options."""
    command = get_command(app)
    text = []
    for name, verb in typing.cast("Mapping[str, Any]", command.commands).items():  # type: ignore[attr-defined]
        text.append(f"## `frf-ipz {name}`\n\n{(verb.help or '').strip()}\n")
        text.append("| argument or option | meaning | default |\n| --- | --- | --- |")
        for parameter in verb.params:
            label = parameter.metavar if parameter.param_type_name == "argument" else ", ".join(parameter.opts)
            default = parameter.default
            shown = "" if callable(default) or default in {None, False} else f"`{default}`"
            text.append(f"| `{label}` | {getattr(parameter, 'help', '') or ''} | {shown} |")
        text.append("")
    return "\n".join(text)
