"""What a user changes on the page, as changes of ``pipeline.toml``; comments and order in the file stay.

Each kind of change is a class whose `apply` edits the parsed file in place; `KINDS` names them all; `to_change` reads
one from what the page sends.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Protocol, TypeAlias

import tomlkit
from tomlkit.items import AoT

from frf_ipz.dofs import parse_label
from frf_ipz.errors import InputError, did_you_mean
from frf_ipz.ingest.survey.selection import is_named
from frf_ipz.toml_files import STRICT, to_options

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from tomlkit import TOMLDocument
    from tomlkit.items import InlineTable

Section: TypeAlias = "Any"  # tomlkit's containers share no type that tells what they can do

SAME = 1e-5  # relative: frequencies closer than this are one and the same entry
NEAR = 0.02  # relative: a pin and a rejection closer than this are about the same pole
DIGITS = 6  # of a frequency that is written
LONGEST_KIND = 40  # characters of one that is quoted in a message


class Change(Protocol):
    """One wish of the user's."""

    def apply(self, document: TOMLDocument) -> None:
        """Write it into a pipeline file.

        Parameters
        ----------
        document : TOMLDocument
            The file; changed in place.
        """


@dataclass(frozen=True, slots=True, kw_only=True)
class Pin:
    """A mode has to be at this frequency.

    Parameters
    ----------
    hz : float
        Hz.
    why : str
        The reason, kept with the results; a plain number is written where it is empty.
    on : bool
        False to take the wish back.
    """

    __pydantic_config__ = STRICT

    hz: float
    why: str = ""
    on: bool = True

    def apply(self, document: TOMLDocument) -> None:
        """Write it into ``[fit] pin_hz``.

        Parameters
        ----------
        document : TOMLDocument
            The file; changed in place.
        """
        hz, why = _frequency("hz", self.hz), " ".join(self.why.split())
        fit = section_of(document, "fit")
        tolerance = NEAR if self.on else SAME
        remove_entries(fit, "pin_hz", lambda entry: math.isclose(_pinned_hz(entry), hz, rel_tol=tolerance))
        if self.on:
            remove_entries(fit, "strike", lambda entry: math.isclose(entry["hz"], hz, rel_tol=NEAR))
            append_entry(fit, "pin_hz", _with_reason(hz, why) if why or isinstance(fit.get("pin_hz"), AoT) else hz)


@dataclass(frozen=True, slots=True, kw_only=True)
class Reject:
    """There is no mode at this frequency.

    Parameters
    ----------
    hz : float
        Hz.
    why : str
        The reason; it is kept with the results.
    on : bool
        False to take the wish back.
    """

    __pydantic_config__ = STRICT

    hz: float
    why: str = ""
    on: bool = True

    def apply(self, document: TOMLDocument) -> None:
        """Write it into ``[fit] strike``.

        Parameters
        ----------
        document : TOMLDocument
            The file; changed in place.

        Raises
        ------
        InputError
            If no reason is given.
        """
        hz, why = _frequency("hz", self.hz), " ".join(self.why.split())
        if self.on and not why:
            raise InputError("say why this pole is no mode: the reason is kept with the results")
        fit = section_of(document, "fit")
        remove_entries(fit, "strike", lambda entry: math.isclose(entry["hz"], hz, rel_tol=SAME))
        if self.on:
            remove_entries(fit, "pin_hz", lambda entry: math.isclose(_pinned_hz(entry), hz, rel_tol=NEAR))
            append_entry(fit, "strike", _with_reason(hz, why))


@dataclass(frozen=True, slots=True, kw_only=True)
class Exclude:
    """Lines between two frequencies are left out.

    Parameters
    ----------
    low_hz, high_hz : float
        Hz.
    on : bool
        False to take the wish back.
    """

    __pydantic_config__ = STRICT

    low_hz: float
    high_hz: float
    on: bool = True

    def apply(self, document: TOMLDocument) -> None:
        """Write it into ``[fit] exclude_hz``.

        Parameters
        ----------
        document : TOMLDocument
            The file; changed in place.
        """
        ends = [_frequency("low_hz", self.low_hz, least=0.0), _frequency("high_hz", self.high_hz)]
        fit = section_of(document, "fit")
        remove_entries(
            fit,
            "exclude_hz",
            lambda entry: all(math.isclose(a, b, rel_tol=SAME) for a, b in zip(entry, ends, strict=True)),
        )
        if self.on:
            append_entry(fit, "exclude_hz", ends)


@dataclass(frozen=True, slots=True, kw_only=True)
class Band:
    """Only lines between two frequencies are fitted.

    Parameters
    ----------
    low_hz, high_hz : float
        Hz.
    on : bool
        False to let the program choose.
    """

    __pydantic_config__ = STRICT

    low_hz: float = 0.0
    high_hz: float = 0.0
    on: bool = True

    def apply(self, document: TOMLDocument) -> None:
        """Write it into ``[fit] band_hz``.

        Parameters
        ----------
        document : TOMLDocument
            The file; changed in place.
        """
        fit = section_of(document, "fit")
        if self.on:
            fit["band_hz"] = [_frequency("low_hz", self.low_hz, least=0.0), _frequency("high_hz", self.high_hz)]
        else:
            fit.pop("band_hz", None)


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordChoice:
    """A record is used, or left out, whatever the checks say.

    Parameters
    ----------
    name : str
        As in the table of records.
    use : str
        ``keep``, ``drop``, or ``checks`` to leave it to the checks.
    """

    __pydantic_config__ = STRICT

    name: str
    use: Literal["keep", "drop", "checks"]

    def apply(self, document: TOMLDocument) -> None:
        """Write it into ``[ingest] keep`` or ``drop``.

        Parameters
        ----------
        document : TOMLDocument
            The file; changed in place.
        """
        ingest = section_of(document, "ingest")
        for key in ("keep", "drop"):
            remove_entries(ingest, key, lambda entry: is_named(self.name, [entry]))
        if self.use != "checks":
            append_entry(ingest, self.use, self.name)


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensor:
    """What a sensor measured is left out.

    Parameters
    ----------
    dof : str
        Label of its DOF.
    on : bool
        False to take the wish back.
    """

    __pydantic_config__ = STRICT

    dof: str
    on: bool = True

    def apply(self, document: TOMLDocument) -> None:
        """Write it into ``[ingest] hide``.

        Parameters
        ----------
        document : TOMLDocument
            The file; changed in place.

        Raises
        ------
        InputError
            If it is no label of a DOF.
        """
        sensor = parse_label(self.dof)
        ingest = section_of(document, "ingest")
        remove_entries(ingest, "hide", lambda entry: parse_label(entry).unsigned == sensor.unsigned)
        if self.on:
            append_entry(ingest, "hide", str(sensor))


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """The FRFs at a DOF are predicted.

    Parameters
    ----------
    dof : str
        Its label.
    on : bool
        False to take the wish back.
    """

    __pydantic_config__ = STRICT

    dof: str
    on: bool = True

    def apply(self, document: TOMLDocument) -> None:
        """Write it into ``[predict] points``.

        Parameters
        ----------
        document : TOMLDocument
            The file; changed in place.

        Raises
        ------
        InputError
            If it is no label of a DOF.
        """
        point = parse_label(self.dof)
        predict = section_of(document, "predict")
        remove_entries(predict, "points", lambda entry: parse_label(entry) == point)
        if self.on:
            append_entry(predict, "points", str(point))


@dataclass(frozen=True, slots=True, kw_only=True)
class Retain:
    """The model is reduced to these DOFs.

    Parameters
    ----------
    dofs : tuple of str
        Their labels; signs do not matter.
    on : bool
        False to let the program choose.
    """

    __pydantic_config__ = STRICT

    dofs: tuple[str, ...] = ()
    on: bool = True

    def apply(self, document: TOMLDocument) -> None:
        """Write it into ``[reduce] dofs``.

        Parameters
        ----------
        document : TOMLDocument
            The file; changed in place.

        Raises
        ------
        InputError
            If none is named, or one is no label of a DOF.
        """
        names = list(dict.fromkeys(parse_label(text).name for text in self.dofs))
        reduce = section_of(document, "reduce")
        if self.on and not names:
            raise InputError("name the DOFs to reduce to, or take the choice back to leave it to the program")
        if self.on:
            reduce["dofs"] = names
        else:
            reduce.pop("dofs", None)


KINDS: Mapping[str, type[Change]] = {
    "pin": Pin,
    "reject": Reject,
    "exclude": Exclude,
    "band": Band,
    "record": RecordChoice,
    "sensor": Sensor,
    "point": Point,
    "retain": Retain,
}


def to_change(wish: object, path: Path) -> Change:
    """Read what the page sends.

    Parameters
    ----------
    wish : object
        A table with its ``kind`` and what that kind takes.
    path : Path
        The pipeline file, for messages.

    Returns
    -------
    Change
        Checked.

    Raises
    ------
    InputError
        If it is no change.
    """
    kind = str(wish.get("kind"))[:LONGEST_KIND] if isinstance(wish, dict) else "without a kind"
    if not isinstance(wish, dict) or kind not in KINDS:
        raise InputError(f"there is no change '{kind}'; {did_you_mean(kind, KINDS)}")
    table = {str(key): value for key, value in wish.items() if key != "kind"}
    return to_options(table, KINDS[kind], path)


def section_of(document: TOMLDocument, name: str) -> Section:
    """Give a section of a pipeline file; it is made where there is none.

    Parameters
    ----------
    document : TOMLDocument
        The file.
    name : str
        The section.

    Returns
    -------
    Section
        To change in place.
    """
    if name not in document:
        document.add(tomlkit.nl())
        document.add(name, tomlkit.table())
    return document[name]


def append_entry(section: Section, key: str, entry: Any) -> None:  # noqa: ANN401  a number, a text, a pair or a table
    """Add an entry to a list.

    Parameters
    ----------
    section : Section
        Where the list is, or will be.
    key : str
        Its name.
    entry : number, text, pair or table
        What is added.
    """
    if key not in section:
        section.add(key, tomlkit.array())
    entries = section[key]
    if isinstance(entries, AoT):
        entries.append(tomlkit.item(dict(entry)))
    else:
        entries.append(entry)


def remove_entries(section: Section, key: str, fits: Callable[[Any], bool]) -> None:
    """Take entries out of a list, and the key with the last one of them.

    Parameters
    ----------
    section : Section
        Where the list is.
    key : str
        Its name.
    fits : callable
        Tells which entries go.
    """
    entries = section.get(key, [])
    rows = [row for row, entry in enumerate(entries) if fits(entry)]
    for row in reversed(rows):
        del entries[row]
    if rows and not len(entries):
        section.pop(key)


def _with_reason(hz: float, why: str) -> InlineTable:
    entry = tomlkit.inline_table()
    entry.update({"hz": hz, "why": why})
    return entry


def _pinned_hz(entry: float | Mapping[str, float]) -> float:
    return entry["hz"] if isinstance(entry, Mapping) else entry


def _frequency(name: str, value: float, *, least: float | None = None) -> float:
    if not math.isfinite(value) or value < 0 or (value == 0 and least is None):
        raise InputError(f"{name} = {value:g} is no frequency; give a positive number of Hz")
    return float(f"{value:.{DIGITS}g}")
