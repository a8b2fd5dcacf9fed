"""``fleet.toml``: which machines, which FE model, which pipeline, and what is different for single machines."""

from __future__ import annotations

import re
from collections import Counter
from contextlib import contextmanager
from dataclasses import dataclass, field, fields
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import tomlkit

from frf_ipz.errors import FileFormatError, InputError, did_you_mean
from frf_ipz.fe.model_file import model_files
from frf_ipz.fleet.machine_list import COLUMNS, read_machine_list
from frf_ipz.input_files import read_text, require_regular_file
from frf_ipz.option_types import Day
from frf_ipz.output_files import write_text
from frf_ipz.pipeline.config import PipelineFile, StageOptions
from frf_ipz.pipeline.pipeline_folder import find_pipeline
from frf_ipz.toml_files import STRICT, error_of_all, named_files, parse_toml, read_toml, to_options

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

STAGES = tuple(item.name for item in fields(StageOptions))
PARTICULARS = tuple(name for name in COLUMNS if name not in {"id", "test"})
MODEL = "model"  # whose a finding is that all machines share: no machine is called that
LONGEST_ID = 100  # with the folders above, some systems allow 260 characters in all
FORBIDDEN = re.compile(r'[<>:"/\\|?*\x00-\x1f]|^[. ]|[. ]$')
DEVICES = frozenset({"con", "prn", "aux", "nul", *(f"{name}{k}" for name in ("com", "lpt") for k in range(1, 10))})
WRITTEN = "Written by frf-ipz fleet and written again by it: what you want to be different for this machine goes into"


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetSection:
    """``[fleet]``: what all machines have in common.

    Parameters
    ----------
    name : str
        What the fleet is called; the file's name by default.
    model : str, optional
        Path of model.toml, relative to the fleet file; without it each run ends with the fit.
    pipeline : str
        Path of the pipeline.toml with the settings for all machines; its test and model are not looked at.
    machines : str
        Pattern of the tests, as ``machines/*/test.toml``: the folder's name is the machine's id. Or a CSV file with the
        columns ``id,test,serial_number,date,operator``, of which the last three may be left out.
    engine : str
        ``local``: processes on this machine. ``dask``: the workers of a Dask cluster.
    pages : str
        Machines that get a ``report.html``: ``none``, ``failed``, ``outliers`` (and those that failed) or ``all``.
    """

    __pydantic_config__ = STRICT

    name: str = ""
    model: str | None = None
    pipeline: str
    machines: str = ""
    engine: Literal["local", "dask"] = "local"
    pages: Literal["none", "failed", "outliers", "all"] = "outliers"


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineSection:
    """``[[machine]]``: one machine, or what is different for one that `[fleet] machines` has found.

    Parameters
    ----------
    id : str
        Its name, which is that of its folder of results too.
    test : str
        Path of its test.toml, relative to the fleet file; may be left out for a machine that has been found.
    serial_number, date, operator : str
        As in test.toml, in whose place they count.
    ingest, fit, diagnose, reduce, update, predict, export : table
        Keys of that section of pipeline.toml that have another value for this machine.
    """

    __pydantic_config__ = STRICT

    id: str
    test: str = ""
    serial_number: str = ""
    date: Day = ""
    operator: str = ""
    ingest: dict[str, Any] = field(default_factory=dict)
    fit: dict[str, Any] = field(default_factory=dict)
    diagnose: dict[str, Any] = field(default_factory=dict)
    reduce: dict[str, Any] = field(default_factory=dict)
    update: dict[str, Any] = field(default_factory=dict)
    predict: dict[str, Any] = field(default_factory=dict)
    export: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetFile:
    """All sections of ``fleet.toml``.

    Parameters
    ----------
    fleet : FleetSection
        What all machines have in common.
    machine : tuple of MachineSection
        Single machines.
    """

    __pydantic_config__ = STRICT

    fleet: FleetSection
    machine: tuple[MachineSection, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Machine:
    """One machine of a fleet.

    Parameters
    ----------
    id : str
        Its name.
    test_path : Path
        Its test.toml.
    particulars : mapping of str to str
        What the fleet file states of its test.
    overrides : mapping of str to mapping
        Keys that are different for it, by section of pipeline.toml.
    """

    id: str
    test_path: Path
    particulars: Mapping[str, str] = field(default_factory=dict)
    overrides: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Fleet:
    """A fleet file with its paths resolved.

    Parameters
    ----------
    path : Path
        The fleet file.
    name : str
        What the fleet is called.
    model_path : Path, optional
        None where runs end with the fit.
    pipeline_path : Path
        Settings for all machines.
    settings : mapping
        What that file says.
    machines : tuple of Machine
        In the order of the file; those that are found by a pattern by their ids.
    engine, pages : str
        As in `FleetSection`.
    """

    path: Path
    name: str
    model_path: Path | None
    pipeline_path: Path
    settings: Mapping[str, Any]
    machines: tuple[Machine, ...]
    engine: str
    pages: str

    def pipeline_of(self, machine: Machine) -> dict[str, Any]:
        """Give the whole pipeline of one machine, with absolute paths.

        Parameters
        ----------
        machine : Machine
            One of the fleet.

        Returns
        -------
        dict
            What its pipeline.toml would say.

        Raises
        ------
        FileFormatError
            If a key does not fit.
        """
        table = {name: dict(section) for name, section in self.settings.items()}
        _make_absolute(table, self.pipeline_path.parent)
        own = {name: dict(section) for name, section in machine.overrides.items() if section}
        _make_absolute(own, self.path.parent)
        table["pipeline"] = {"name": machine.id, "test": str(machine.test_path)}
        if self.model_path is not None:
            table["pipeline"]["model"] = str(self.model_path)
        for name, section in own.items():
            table[name] = {**table.get(name, {}), **section}
        try:
            to_options(table, PipelineFile, self.path)
        except FileFormatError as error:
            where = f"machine '{machine.id}'" + (f", {error.where}" if error.where else "")
            raise FileFormatError(self.path, str(error).partition(": ")[2], where=where) from None
        return table

    def write_pipeline(self, machine: Machine, path: Path) -> None:
        """Write the pipeline of one machine, unless that is what the file says.

        Parameters
        ----------
        machine : Machine
            One of the fleet.
        path : Path
            File to write.

        Raises
        ------
        OSError
            If it cannot be written.
        """
        text = f"# {WRITTEN}\n# {self.path}\n{tomlkit.dumps(self.pipeline_of(machine))}"
        if not (path.is_file() and read_text(path) == text):
            write_text(path, text)


def read_fleet(path: Path) -> Fleet:
    """Read a fleet file.

    Parameters
    ----------
    path : Path
        ``fleet.toml``.

    Returns
    -------
    Fleet
        Checked: every machine has an id and a test, and settings that fit.

    Raises
    ------
    FileFormatError
        If the file, or a key in it, is wrong; if no machine is found, or two have one id.
    InputError
        If keys of the pipeline or of the model are wrong too.
    """
    try:
        return _read_fleet(path)
    except FileFormatError as error:
        raise _wrong_keys_of_all(error, path) from None


def _wrong_keys_of_all(error: FileFormatError, path: Path) -> InputError:
    """Say what is wrong with the keys of the fleet, of its pipeline and of its model at once."""
    checks: list[Callable[[], object]] = [partial(read_toml, path, FleetFile, required="fleet")]
    readers = {"pipeline": _read_settings, "model": model_files}
    files = named_files(path, "fleet", readers)
    checks += [partial(readers[key], file) for key, file in files.items() if file.is_file()]
    return error_of_all(error, checks)


def _read_settings(pipeline: Path) -> dict[str, Any]:
    """Read what a pipeline says for all machines; what is wrong is said of the file in which it stands."""
    settings = parse_toml(read_text(pipeline), pipeline)
    to_options({**settings, "pipeline": {"test": "test.toml"}}, PipelineFile, pipeline)
    return settings


def _read_fleet(path: Path) -> Fleet:
    file = read_toml(path, FleetFile, required="fleet")
    path = path.resolve()
    section = file.fleet
    with _named_by(path, "fleet.pipeline"):
        pipeline = find_pipeline(path.parent / section.pipeline)
        require_regular_file(pipeline)
    settings = _read_settings(pipeline)
    model = None if section.model is None else (path.parent / section.model).resolve()
    if model is not None:
        with _named_by(path, "fleet.model"):
            require_regular_file(model)
    fleet = Fleet(
        path=path,
        name=section.name or path.stem,
        model_path=model,
        pipeline_path=pipeline.resolve(),
        settings={name: value for name, value in settings.items() if name != "pipeline"},
        machines=_machines(path, file),
        engine=section.engine,
        pages=section.pages,
    )
    for machine in fleet.machines:
        fleet.pipeline_of(machine)
    return fleet


@contextmanager
def _named_by(path: Path, key: str) -> Iterator[None]:
    """Say of a file that cannot be used where it is named."""
    try:
        yield
    except InputError as error:
        raise FileFormatError(path, str(error), where=f"key '{key}'") from None


def _machines(path: Path, file: FleetFile) -> tuple[Machine, ...]:
    found = _found(path, file.fleet.machines) if file.fleet.machines else []
    _require_ids(path, [machine.id for machine in found], where="key 'fleet.machines'")
    _require_ids(path, [entry.id for entry in file.machine], where="key 'machine'")
    machines = {machine.id: machine for machine in found}
    for entry in file.machine:
        known = machines.get(entry.id)
        if known is None and not entry.test:
            where = f"key 'machine', id '{entry.id}'"
            if not machines:
                raise FileFormatError(path, "the key 'test' is missing", where=where)
            advice = did_you_mean(entry.id, machines)
            raise FileFormatError(path, f"no such machine was found, and no 'test' is named; {advice}", where=where)
        stated = {name: getattr(entry, name) for name in PARTICULARS if getattr(entry, name)}
        machines[entry.id] = Machine(
            id=entry.id,
            test_path=(path.parent / entry.test).resolve() if entry.test or known is None else known.test_path,
            particulars={**({} if known is None else known.particulars), **stated},
            overrides={name: getattr(entry, name) for name in STAGES if getattr(entry, name)},
        )
    if not machines:
        raise FileFormatError(path, "names no machine: set [fleet] machines, or write [[machine]] with id and test")
    _require_ids(path, machines, where="ids")
    return tuple(machines.values())


def _found(path: Path, pattern: str) -> list[Machine]:
    """Machines of a table, or of a pattern."""
    if pattern.lower().endswith(".csv"):
        table = (path.parent / pattern).resolve()
        return [
            Machine(
                id=row["id"],
                test_path=(table.parent / row["test"]).resolve(),
                particulars={name: row[name] for name in PARTICULARS if row.get(name)},
            )
            for row in read_machine_list(table)
        ]
    where = "key 'fleet.machines'"
    if Path(pattern).is_absolute():
        raise FileFormatError(path, f"a pattern is relative to this file; given is '{pattern}'", where=where)
    try:
        tests = sorted(file for file in path.parent.glob(pattern) if file.is_file())
    except (ValueError, NotImplementedError) as error:
        raise FileFormatError(path, f"'{pattern}' is no pattern of files: {error}", where=where) from None
    if not tests:
        raise FileFormatError(
            path,
            f"no file fits '{pattern}' below {path.parent}; a pattern names the tests, as 'machines/*/test.toml'",
            where=where,
        )
    return [Machine(id=file.parent.name, test_path=file.resolve()) for file in tests]


def _require_ids(path: Path, ids: Iterable[str], *, where: str) -> None:
    """Refuse ids that no folder can have on every system, and such as would share one."""
    ids = list(ids)
    for name in ids:
        if not name or len(name) > LONGEST_ID or FORBIDDEN.search(name) or name.split(".")[0].lower() in DEVICES:
            raise FileFormatError(
                path,
                f"the id '{name}' is no name that a folder can have on every system; use up to {LONGEST_ID} letters, "
                "digits, '-', '_' and '.'",
                where=where,
            )
        if name == MODEL:
            raise FileFormatError(
                path, f"the id '{MODEL}' stands for what all machines share; use another", where=where
            )
    folded = Counter(name.casefold() for name in ids)
    twice = [name for name in ids if folded[name.casefold()] > 1]
    if twice:
        listed = ", ".join(f"'{name}'" for name in dict.fromkeys(twice))
        raise FileFormatError(
            path,
            f"the id {listed} is there more than once (upper and lower case are the same folder on some systems); "
            "give each machine its own",
            where=where,
        )


def _make_absolute(table: dict[str, dict[str, Any]], folder: Path) -> None:
    """Make the paths of settings good wherever the pipeline is written."""
    reference = table.get("predict", {}).get("reference")
    if isinstance(reference, str):
        table["predict"]["reference"] = str((folder / reference).resolve())
    own = table.get("diagnose", {}).get("extra_effects")
    if isinstance(own, list):
        table["diagnose"]["extra_effects"] = [_absolute_effect(entry, folder) for entry in own]


def _absolute_effect(reference: Any, folder: Path) -> Any:  # noqa: ANN401  whatever stands in the file is checked later
    if not isinstance(reference, str):
        return reference
    file, colon, name = reference.rpartition(":")
    return f"{(folder / file).resolve()}{colon}{name}" if colon else reference
