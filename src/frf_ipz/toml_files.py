"""TOML files into option dataclasses, with errors that a user can act on.

Every TOML file of the contract is described by plain frozen dataclasses that live in the stage they belong to; pydantic
checks them here and nowhere else. A dataclass refuses unknown keys by ``__pydantic_config__ = STRICT``.
"""

from __future__ import annotations

import re
import tomllib
from dataclasses import fields, is_dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, TypeVar, get_args, get_type_hints

import numpy as np
from pydantic import TypeAdapter, ValidationError

from frf_ipz.errors import FileFormatError, InputError, did_you_mean
from frf_ipz.input_files import read_text

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping
    from pathlib import Path

STRICT: dict[str, Any] = {"extra": "forbid", "arbitrary_types_allowed": True}

MOST_SHOWN = 10  # wrong keys; more are those of another kind of file
DEEPEST = 32  # levels of tables and lists; no file of the contract has more than six
TOO_DEEP = "is nested too deeply; no key of this program is"
CLASS_NAME = re.compile(r"(?:[A-Z][a-z]+){2,}")  # a dataclass that is a branch of a union
REPORTED_FIRST = ("unexpected_keyword_argument", "missing")

Options = TypeVar("Options")


class WrongKeysError(FileFormatError):
    """Several keys of a file do not fit.

    Parameters
    ----------
    path : Path
        The file.
    problems : mapping of str to str
        What is wrong, by its place.
    """

    def __init__(self, path: Path, problems: Mapping[str, str]) -> None:
        self._problems = dict(problems)
        shown = numbered(f"{where}: {problem}" for where, problem in problems.items())
        super().__init__(path, f"{len(problems)} keys do not fit: {shown}")

    @property
    def parts(self) -> tuple[FileFormatError, ...]:
        """One error a key."""
        return tuple(FileFormatError(self.path, text, where=where) for where, text in self._problems.items())


def numbered(texts: Iterable[str], most: int = MOST_SHOWN) -> str:
    """List what is wrong in several places, in one line.

    Parameters
    ----------
    texts : iterable of str
        One a place.
    most : int
        How many of them to show.

    Returns
    -------
    str
        The first of them, each behind its number, and how many more there are.

    Examples
    --------
    >>> numbered(["a: 1", "b: 2"])
    '(1) a: 1; (2) b: 2'
    """
    shown = [f"({number}) {text}" for number, text in enumerate(texts, start=1)]
    more = len(shown) - most
    return "; ".join([*shown[:most], *([f"and {more} more"] if more > 0 else [])])


def error_of_all(error: FileFormatError, checks: Iterable[Callable[[], object]]) -> InputError:
    """Say at once what is wrong with several files, so that they are corrected in one go.

    Parameters
    ----------
    error : FileFormatError
        What was met first.
    checks : iterable of functions
        Each reads the keys of one file, and raises what is wrong with it.

    Returns
    -------
    InputError
        The error itself, unless there is one of another file too.
    """
    errors = [error]
    for check in checks:
        try:
            check()
        except FileFormatError as another:
            errors.append(another)
    parts = {str(part): part.path for found in errors for part in found.parts}
    n_files = len(set(parts.values()))
    if n_files == 1:
        return error
    return InputError(f"{len(parts)} mistakes in {n_files} files: {numbered(parts, MOST_SHOWN * n_files)}")


def named_files(path: Path, section: str, keys: Iterable[str]) -> dict[str, Path]:
    """Find the files that keys of a section name, as far as the file can be read.

    Parameters
    ----------
    path : Path
        A TOML file.
    section : str
        One of its sections.
    keys : iterable of str
        Keys that may name a file.

    Returns
    -------
    dict of str to Path
        By their key; those that are no text, or not there, are left out.
    """
    try:
        table = parse_toml(read_text(path), path).get(section)
    except InputError:
        return {}
    named = table if isinstance(table, dict) else {}
    return {key: path.resolve().parent / named[key] for key in keys if isinstance(named.get(key), str)}


def read_toml(path: Path, options_type: type[Options], *, required: str = "") -> Options:
    """Read a TOML file into an options dataclass.

    Parameters
    ----------
    path : Path
        The file.
    options_type : type
        A dataclass that describes the whole file.
    required : str
        The section without which the file is not of this kind, for the message.

    Returns
    -------
    options_type
        The options, checked.

    Raises
    ------
    FileFormatError
        If the file is missing, is no TOML, or does not fit: names the key, what was expected and the closest known key.
    """
    table = parse_toml(read_text(path), path)
    if required and required not in table:
        raise FileFormatError(path, f"has no section [{required}]; is it the right file?")
    return to_options(table, options_type, path)


def parse_toml(text: str, path: Path) -> dict[str, Any]:
    """Parse the text of a TOML file.

    Parameters
    ----------
    text : str
        What the file says.
    path : Path
        The file, for the message.

    Returns
    -------
    dict
        Its tables and values.

    Raises
    ------
    FileFormatError
        If it is no TOML, or nested deeper than any key of this program.
    """
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise FileFormatError(path, f"is not valid TOML: {error}") from None
    except RecursionError:
        raise FileFormatError(path, TOO_DEEP) from None
    level: list[Any] = [table]
    for _ in range(DEEPEST):
        level = [item for value in level for item in _items(value)]
    if level:
        raise FileFormatError(path, TOO_DEEP)
    return table


def _items(value: Any) -> Iterable[Any]:
    return value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()


def to_options(table: Mapping[str, Any], options_type: type[Options], path: Path) -> Options:
    """Check a table against an options dataclass.

    Parameters
    ----------
    table : mapping
        Content of the file.
    options_type : type
        The dataclass.
    path : Path
        The file, for the message.

    Returns
    -------
    options_type
        The options.

    Raises
    ------
    FileFormatError
        If keys or values do not fit: names every one of them.
    """
    kind: Any = options_type
    try:
        return _adapter(kind).validate_python(dict(table))  # type: ignore[no-any-return]
    except ValidationError as error:
        problems = _problems(error, options_type)
    if len(problems) == 1:
        ((where, problem),) = problems.items()
        raise FileFormatError(path, problem, where=where)
    raise WrongKeysError(path, problems)


def check_values(options: object) -> None:
    """Check options that are made in Python, as those of a file are: called when they are made.

    Parameters
    ----------
    options : dataclass
        Its values are brought to their types, lists to tuples for one.

    Raises
    ------
    InputError
        On the first value that does not fit.
    """
    kind: Any = type(options)
    for name, adapter in _adapters(kind).items():
        value = getattr(options, name)
        value = value.item() if isinstance(value, np.generic) else value  # a number of numpy is a number
        try:
            object.__setattr__(options, name, adapter.validate_python(value))
        except ValidationError as error:
            raise InputError(f"{kind.__name__}.{name}: {_explain(error.errors()[0], kind)}") from None


@lru_cache
def _adapter(kind: type) -> TypeAdapter[Any]:
    return TypeAdapter(kind)


@lru_cache
def _adapters(kind: type) -> dict[str, TypeAdapter[Any]]:
    hints = get_type_hints(kind, include_extras=True)
    return {field.name: TypeAdapter(hints[field.name]) for field in fields(kind)}


def _problems(error: ValidationError, options_type: type) -> dict[str, str]:
    """Say what is wrong with each key, in the order of the file; a branch of a union is one complaint of several."""
    found: dict[str, Any] = {}
    for problem in error.errors():
        where = _place(problem["loc"])
        if where not in found or _rank(problem) < _rank(found[where]):
            found[where] = problem
    misspelt = {_place(problem["loc"][:-1]) for problem in found.values() if problem["type"] == REPORTED_FIRST[0]}
    return {
        where: _explain(problem, options_type)
        for where, problem in found.items()
        if problem["type"] != REPORTED_FIRST[1] or _place(problem["loc"][:-1]) not in misspelt
    }


def _place(location: tuple[int | str, ...]) -> str:
    where = ".".join(_key_text(part) for part in location if not _is_type_tag(part))
    return f"key '{where}'" if where else "the file"


def _rank(error: Any) -> int:
    """Name an unknown key first: the key that is missing is most often the one that was meant."""
    return REPORTED_FIRST.index(error["type"]) if error["type"] in REPORTED_FIRST else len(REPORTED_FIRST)


def _key_text(part: int | str) -> str:
    return f"[{part + 1}]" if isinstance(part, int) else part


def _is_type_tag(part: int | str) -> bool:
    """Pydantic names the branch of a union in the location, which is no key of the user's."""
    plain = {"str", "float", "int", "bool"}
    if not isinstance(part, str):
        return False
    return "[" in part or part in plain or part.startswith("constrained-") or bool(CLASS_NAME.fullmatch(part))


def _explain(error: Any, options_type: type) -> str:
    if error["type"] == "unexpected_keyword_argument":
        key = str(error["loc"][-1])
        known = [field.name for field in fields(_dataclass_at(options_type, error["loc"][:-1]))]
        return f"unknown key '{key}'; {did_you_mean(key, known)}"
    if error["type"] in {"missing", "missing_argument", "missing_keyword_only_argument"}:
        last = error["loc"][-1]
        return f"value {last + 1} is missing" if isinstance(last, int) else f"the key '{last}' is missing"
    if error["type"] == "dataclass_type":
        keys = ", ".join(field.name for field in fields(_dataclass_at(options_type, error["loc"])))
        return f"must be a table {{ ... }} with keys of {keys}; given is {error['input']!r}"
    message = str(error["msg"]).removeprefix("Value error, ").replace("Input should", "must")
    value = error.get("input")
    return f"{message[:1].lower()}{message[1:]}; given is {value!r}"


def _dataclass_at(options_type: Any, location: tuple[int | str, ...]) -> Any:
    """Follow the keys of a location down to the dataclass that has them."""
    for part in location:
        if isinstance(part, str) and is_dataclass(options_type):
            hints = get_type_hints(options_type)
            if part in hints:
                options_type = _inner_dataclass(hints[part]) or options_type
    return options_type


def _inner_dataclass(hint: Any) -> Any:
    if is_dataclass(hint):
        return hint
    return next((inner for argument in get_args(hint) if (inner := _inner_dataclass(argument))), None)
