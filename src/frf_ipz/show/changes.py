"""What a user changes on the page, as changes of ``pipeline.toml`` that leave the user's comments and order alone."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Protocol, TypeAlias

import tomlkit
from tomlkit.items import AoT

from frf_ipz.dofs import parse_dof
from frf_ipz.errors import InputError, did_you_mean
from frf_ipz.ingest.survey.choice import is_named
from frf_ipz.toml_files import STRICT, to_options

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from tomlkit import TOMLDocument

Section: TypeAlias = "Any"  # tomlkit's containers share no type that tells what they can do

SAME = 1e-5  # relative: frequencies closer than this are one and the same entry
NEAR = 0.02  # relative: a pin and a strike closer than this are about the same pole
DIGITS = 6  # of a frequency that is written


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
    on : bool
        False to take the wish back.
    """

    __pydantic_config__ = STRICT

    hz: float
    on: bool = True

    def apply(self, document: TOMLDocument) -> None:
        """Write it into ``[fit] pin_hz``.

        Parameters
        ----------
        document : TOMLDocument
            The file; changed in place.
        """
        hz = _frequency("hz", self.hz)
        fit = _section(document, "fit")
        _remove(fit, "pin_hz", lambda entry: math.isclose(entry, hz, rel_tol=NEAR if self.on else SAME))
        if self.on:
            _remove(fit, "strike", lambda entry: math.isclose(entry["hz"], hz, rel_tol=NEAR))
            _append(fit, "pin_hz", hz)


@dataclass(frozen=True, slots=True, kw_only=True)
class Strike:
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
        fit = _section(document, "fit")
        _remove(fit, "strike", lambda entry: math.isclose(entry["hz"], hz, rel_tol=SAME))
        if self.on:
            _remove(fit, "pin_hz", lambda entry: math.isclose(entry, hz, rel_tol=NEAR))
            entry = tomlkit.inline_table()
            entry.update({"hz": hz, "why": why})
            _append(fit, "strike", entry)


@dataclass(frozen=True, slots=True, kw_only=True)
class Leave:
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
        fit = _section(document, "fit")
        _remove(
            fit,
            "exclude_hz",
            lambda entry: all(math.isclose(a, b, rel_tol=SAME) for a, b in zip(entry, ends, strict=True)),
        )
        if self.on:
            _append(fit, "exclude_hz", ends)


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
        fit = _section(document, "fit")
        if self.on:
            fit["band_hz"] = [_frequency("low_hz", self.low_hz, least=0.0), _frequency("high_hz", self.high_hz)]
        else:
            fit.pop("band_hz", None)


@dataclass(frozen=True, slots=True, kw_only=True)
class Blow:
    """A blow is used, or left out, whatever the checks say.

    Parameters
    ----------
    name : str
        As in the table of blows.
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
        ingest = _section(document, "ingest")
        for key in ("keep", "drop"):
            _remove(ingest, key, lambda entry: is_named(self.name, [entry]))
        if self.use != "checks":
            _append(ingest, self.use, self.name)


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """The FRFs at a DOF are wanted.

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
        wanted = parse_dof(self.dof)
        predict = _section(document, "predict")
        _remove(predict, "points", lambda entry: parse_dof(entry) == wanted)
        if self.on:
            _append(predict, "points", str(wanted))


KINDS: Mapping[str, type[Change]] = {
    "pin": Pin,
    "strike": Strike,
    "leave": Leave,
    "band": Band,
    "blow": Blow,
    "point": Point,
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
    if not isinstance(wish, dict) or wish.get("kind") not in KINDS:
        kind = str(wish.get("kind")) if isinstance(wish, dict) else str(wish)
        raise InputError(f"there is no change '{kind}'; {did_you_mean(kind, KINDS)}")
    table = {str(key): value for key, value in wish.items() if key != "kind"}
    return to_options(table, KINDS[wish["kind"]], path)


def _frequency(name: str, value: float, *, least: float | None = None) -> float:
    if not math.isfinite(value) or value < 0 or (value == 0 and least is None):
        raise InputError(f"{name} = {value:g} is no frequency; give a positive number of Hz")
    return float(f"{value:.{DIGITS}g}")


def _section(document: TOMLDocument, name: str) -> Section:
    if name not in document:
        document.add(tomlkit.nl())
        document.add(name, tomlkit.table())
    return document[name]


def _append(section: Section, key: str, entry: Any) -> None:  # noqa: ANN401  a number, a text, a pair or a table
    if key not in section:
        section.add(key, tomlkit.array())
    entries = section[key]
    if isinstance(entries, AoT):
        entries.append(tomlkit.item(dict(entry)))
    else:
        entries.append(entry)


def _remove(section: Section, key: str, fits: Callable[[Any], bool]) -> None:
    """Take entries out of a list, and the key with the last one of them."""
    entries = section.get(key, [])
    found = [place for place, entry in enumerate(entries) if fits(entry)]
    for place in reversed(found):
        del entries[place]
    if found and not len(entries):
        section.pop(key)
