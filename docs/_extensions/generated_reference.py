"""The reference of files and of the command, written from the code: every key, every column, every option.

A Sphinx extension: before a build it writes ``reference/generated/*.md``, which the pages of ``reference/`` include.
`reference_pages` gives the same texts to the test that looks for every key and every column.
"""

from __future__ import annotations

import inspect
import re
import types
import typing
from dataclasses import MISSING, Field, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args, get_origin, get_type_hints

from numpydoc.docscrape import NumpyDocString
from pydantic import BeforeValidator
from typer.main import get_command

from frf_ipz.cli.commands import app
from frf_ipz.diagnosis import result as diagnosis_result
from frf_ipz.diagnosis.catalogue.finder import shipped_effects
from frf_ipz.diagnosis.nonlinear.laws.finder import shipped_laws
from frf_ipz.export.reduced_model_file import REDUCED_MODEL
from frf_ipz.export.run_tables import FILES
from frf_ipz.export.state_space import StateSpaceModel
from frf_ipz.export.state_space_files import ENSEMBLE
from frf_ipz.export.uncertainty import UncertaintyWeights
from frf_ipz.fe.model_file import model_kinds
from frf_ipz.fleet import population
from frf_ipz.fleet.fleet_file import FleetFile
from frf_ipz.fleet.tables import FILES as FLEET_FILES
from frf_ipz.ingest.campaign_file import CampaignFileKeys
from frf_ipz.pipeline.config import PipelineFile
from frf_ipz.runs import folder as run_folder

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from sphinx.application import Sphinx

    from frf_ipz.export.parquet import Column

# Longer endings first: a stiffness in N/m does not end in m.
UNITS = {
    "m_per_m": "m per m", "Nm_rad": "N m/rad", "Ns_m": "N s/m", "N_m3": "N/m³", "N_m": "N/m", "kg_m3": "kg/m³",
    "rad_s": "rad/s", "1_s": "1/s", "kgm2": "kg m²", "m3": "m³", "Pa": "Pa", "kg": "kg", "hz": "Hz", "deg": "°",
    "rad": "rad", "seconds": "s", "s": "s", "m": "m", "N": "N",
}  # fmt: skip
PLAIN_TYPES = {float: "number", int: "whole number", str: "text", bool: "`true` | `false`"}
SIGNS = {"gt": ">", "ge": "≥", "lt": "<", "le": "≤"}


def setup(sphinx: Sphinx) -> dict[str, bool]:
    """Write the reference before Sphinx looks for documents."""
    sphinx.connect("builder-inited", lambda builder: write_reference(Path(builder.srcdir) / "reference" / "generated"))
    return {"parallel_read_safe": True}


def write_reference(folder: Path) -> None:
    """Write all pages; a page that has not changed is left alone, so that it is not built again."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in reference_pages().items():
        path = folder / name
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def reference_pages() -> dict[str, str]:
    """Give the text of every page by the name of its file."""
    return {
        "test_toml.md": _sections(sections(CampaignFileKeys), level=2),
        "model_toml.md": _models(),
        "pipeline_toml.md": _sections(sections(PipelineFile), level=2),
        "tables.md": "\n".join(_columns(name, columns) for name, columns in FILES.items()),
        "results.md": "\n".join(_entries(name, entries) for name, entries in file_entries().items()),
        "fleet_toml.md": _sections(sections(FleetFile), level=2),
        "fleet_tables.md": "\n".join(
            [
                *(_columns(name, columns) for name, columns in FLEET_FILES.items()),
                _entries("population.json", population.JSON_KEYS),
            ]
        ),
        "effects.md": _effects(),
        "command.md": _command(),
    }


def file_entries() -> dict[str, Mapping[str, str]]:
    """Give the meaning of every key or array in the files that are no tables, by file."""
    state_space = parameter_meanings(StateSpaceModel)
    return {
        "diagnosis.json": diagnosis_result.JSON_KEYS,
        "run.json": run_folder.JSON_KEYS,
        "statespace.json": state_space,
        "statespace_ensemble.mat": {**state_space, **ENSEMBLE},
        "uncertainty.json": parameter_meanings(UncertaintyWeights),
        "updated_model.npz": REDUCED_MODEL,
    }


def sections(file: type) -> Iterator[tuple[str, type]]:
    """Give the sections of a TOML file, and the tables that stand in their keys, with the dataclass of each."""
    hints = get_type_hints(file, include_extras=True)
    for item in sorted(fields(file), key=_is_optional):
        section, is_repeated = _dataclass_in(hints[item.name])
        if section is not None:
            yield f"[[{item.name}]]" if is_repeated else f"[{item.name}]", section
            yield from _inner_sections(item.name, section)


def _inner_sections(path: str, section: type) -> Iterator[tuple[str, type]]:
    hints = get_type_hints(section, include_extras=True)
    for item in fields(section):
        inner, is_repeated = _dataclass_in(hints[item.name])
        if inner is not None:
            place = f"{path}.{item.name}"
            yield f"[[{place}]]" if is_repeated else f"[{place}]", inner
            yield from _inner_sections(place, inner)


def keys_of(section: type) -> Iterator[tuple[str, str, str, str, str]]:
    """Give name, values, unit, default and meaning of every key of a section."""
    meanings = parameter_meanings(section)
    hints = get_type_hints(section, include_extras=True)
    for item in fields(section):
        yield item.name, _values(hints[item.name]), unit_of(item.name), _default(item), meanings[item.name]


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
    return next((unit for ending, unit in UNITS.items() if name == ending or name.endswith(f"_{ending}")), "")


def _sections(content: Iterable[tuple[str, type]], *, level: int) -> str:
    """Write a table of keys for each section."""
    text = []
    for title, section in content:
        summary = (inspect.getdoc(section) or "").partition("\n\n")[0]
        rows = ((f"`{key}`", *columns) for key, *columns in keys_of(section))
        text += [f"{'#' * level} `{title}`\n", f"{_plain(_without_title(summary, title))}\n"]
        text += [_table(("key", "values", "unit", "default", "meaning"), rows)]
    return "\n".join(text)


def _without_title(summary: str, title: str) -> str:
    """Leave out the title that a docstring begins with: the heading says it."""
    text = summary.removeprefix(f"``{title}``: ").removeprefix(f"``{title}``.")
    return text[:1].upper() + text[1:]


def _models() -> str:
    """Write the sections that all kinds of models have once, then those of each kind."""
    kinds = {name: list(sections(kind.FILE)) for name, kind in model_kinds().items()}
    common = [entry for entry in next(iter(kinds.values())) if all(entry in content for content in kinds.values())]
    text = ["## In every kind of model\n", _sections(common, level=3)]
    for name, content in kinds.items():
        text += [f'## `kind = "{name}"`\n', _sections((entry for entry in content if entry not in common), level=3)]
    return "\n".join(text)


def _dataclass_in(hint: object) -> tuple[type | None, bool]:
    """Give the dataclass in a type hint, and whether it stands in a list."""
    if isinstance(hint, type) and is_dataclass(hint):  # what pydantic keeps beside a type is an instance of one
        return hint, False
    for argument in get_args(hint):
        inner, is_repeated = _dataclass_in(argument)
        if inner is not None:
            return inner, is_repeated or get_origin(hint) is tuple
    return None, False


def _values(hint: object) -> str:
    """Say what a key takes, with its range."""
    if isinstance(hint, type) and is_dataclass(hint):
        return "table, see below"
    if isinstance(hint, type) and hint in PLAIN_TYPES:
        return PLAIN_TYPES[hint]
    if hint is Any:
        return "value"
    arguments = get_args(hint)
    writers = {
        Annotated: _annotated_values,
        Literal: _literal_values,
        typing.Union: _union_values,
        types.UnionType: _union_values,
        tuple: _tuple_values,
        dict: lambda parts: f"table of {_values(parts[0])} = {_values(parts[1])}",
    }
    return writers[get_origin(hint)](arguments)


def _annotated_values(arguments: Sequence[Any]) -> str:
    limits = [text for part in arguments[1:] for text in _limits(part)]
    text = ", ".join([_values(arguments[0]), *limits])
    # What pydantic calls before it checks makes a list of a single value, and nothing else, in these files.
    is_single_too = any(isinstance(part, BeforeValidator) for part in arguments[1:])
    return f"{_values(get_args(arguments[0])[0])}, or {text}" if is_single_too else text


def _literal_values(arguments: Sequence[object]) -> str:
    return " | ".join(f'`"{value}"`' if isinstance(value, str) else f"`{value}`" for value in arguments)


def _union_values(arguments: Sequence[object]) -> str:
    return " or ".join(dict.fromkeys(_values(part) for part in arguments if part is not type(None)))


def _tuple_values(arguments: Sequence[object]) -> str:
    parts = [part for part in arguments if part is not Ellipsis]
    if Ellipsis not in arguments:
        return f"{len(parts)} of: {_values(parts[0])}"
    text = _values(parts[0])
    return "tables, see below" if text == "table, see below" else f"list of: {text}"


def _limits(part: object) -> Iterator[str]:
    """Read limits out of what pydantic keeps beside a type."""
    for piece in getattr(part, "metadata", [part]):
        for name, sign in SIGNS.items():
            limit = getattr(piece, name, None)
            if limit is not None:
                yield f"{sign} {limit:g}"
        if getattr(piece, "min_length", 0):
            yield "not empty"


def _default(item: Field[Any]) -> str:
    if not _is_optional(item):
        return "required"
    value = item.default if item.default_factory is MISSING else item.default_factory()
    if value is None:
        return "left out"
    if isinstance(value, tuple | dict | str) and not value:
        return "empty"
    return f"`{_written(value)}`"


def _written(value: Any) -> str:
    """Write a value as a TOML file has it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, tuple):
        return str(list(value))
    if is_dataclass(value):
        return "{ " + ", ".join(f"{item.name} = {_written(getattr(value, item.name))}" for item in fields(value)) + " }"
    return f"{value:g}"


def _is_optional(item: Field[Any]) -> bool:
    return item.default is not MISSING or item.default_factory is not MISSING


def _columns(name: str, columns: Sequence[Column]) -> str:
    rows = ((f"`{column.name}`", column.kind, column.unit, column.meaning) for column in columns)
    return f"### `{name}`\n\n" + _table(("column", "type", "unit", "meaning"), rows)


def _entries(name: str, entries: Mapping[str, str]) -> str:
    return f"### `{name}`\n\n" + _table(("key", "meaning"), ((f"`{key}`", text) for key, text in entries.items()))


def _effects() -> str:
    catalogue: dict[str, object] = {**shipped_effects(), **shipped_laws()}
    summaries = {name: (inspect.getdoc(type(effect)) or "").partition("\n")[0] for name, effect in catalogue.items()}
    return _table(("effect", "what it is"), ((f"`{name}`", summary) for name, summary in summaries.items()))


def _command() -> str:
    """Write every verb of the command with its arguments and options."""
    text = []
    for name, verb in typing.cast("Any", get_command(app)).commands.items():
        rows = []
        for parameter in verb.params:
            is_argument = parameter.param_type_name == "argument"
            names = [*parameter.opts, *parameter.secondary_opts]
            label = parameter.metavar if is_argument else " ".join([", ".join(names), parameter.metavar or ""]).strip()
            default = "required" if parameter.required else parameter.default
            shown = "" if default in {None, False} else default if parameter.required else f"`{default}`"
            rows.append((f"`{label}`", getattr(parameter, "help", "") or "", str(shown)))
        text += [f"## `frf-ipz {name}`\n", f"{(verb.help or '').strip()}\n"]
        text += [_table(("argument or option", "meaning", "default"), rows)]
    return "\n".join(text)


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *([_plain(cell).replace("|", "\\|") for cell in row] for row in rows)]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def _plain(text: str) -> str:
    """Turn what docstrings are written in into what the pages are written in."""
    return re.sub(r"``(.+?)``", r"`\1`", " ".join(text.split()))
