"""Poles and stretches of lines: ``[fit]``."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import tomlkit
from tomlkit.items import AoT

from frf_ipz.errors import InputError
from frf_ipz.show.changes.change import append_entry, remove_entries, section_of
from frf_ipz.toml_files import STRICT

if TYPE_CHECKING:
    from tomlkit import TOMLDocument
    from tomlkit.items import InlineTable

SAME = 1e-5  # relative: frequencies closer than this are one and the same entry
NEAR = 0.02  # relative: a pin and a strike closer than this are about the same pole
DIGITS = 6  # of a frequency that is written


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
        near = NEAR if self.on else SAME
        remove_entries(fit, "pin_hz", lambda entry: math.isclose(_pinned_hz(entry), hz, rel_tol=near))
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
