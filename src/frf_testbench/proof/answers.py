"""Read answers and diagnoses into one form, so that they can be compared."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

NONLINEAR = ("cubic_stiffness", "gap_contact", "dry_friction")
UNKNOWN = "unknown"
COVER = 1.959964  # standard deviations to each side of a 95 % interval


class AnswerError(Exception):
    """A file that is no answer, or no diagnosis."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Value:
    """A number that a diagnosis gives.

    Parameters
    ----------
    value : float
        Most probable.
    low, high : float
        Ends of the 95 % interval.
    """

    value: float
    low: float
    high: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Cause:
    """An effect at its place: what is true, or what a diagnosis says.

    Parameters
    ----------
    effect : str
        Of the contract's table, or ``unknown``.
    location : mapping
        As in ``diagnosis.json``.
    parameters : mapping of str to float, str or Value
        Plain in an answer, with an interval in a diagnosis.
    probability, gain : float
        Of a diagnosis: probability, and evidence in nats.
    places : tuple of mapping
        Of a diagnosis: all places that are possible.
    nonlinear : bool
        Of an answer: whether it depends on level.
    """

    effect: str
    location: Mapping[str, Any] = field(default_factory=dict)
    parameters: Mapping[str, float | str | Value] = field(default_factory=dict)
    probability: float = 1.0
    gain: float = 0.0
    places: tuple[Mapping[str, Any], ...] = ()
    nonlinear: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """The answer to a case.

    Parameters
    ----------
    name : str
        Of the case.
    group : str
        ``linear``, ``null``, ``nonlinear``, ``pair`` or ``unknown``.
    causes : tuple of Cause
        None for a null, two for a pair.
    equivalents : tuple of Cause
        Other answers that are right as well.
    kind : str
        Of an effect outside the table.
    structure : str
        Kind of the specimen.
    evidence_nats, separation_nats, place_separation_nats : float, optional
        Of the effect, and from the closest other effect and place; None where the answers do not say.
    each_nats : tuple of float
        Of a pair: evidence for each effect when the other is there.
    has_evidence : bool
        Whether the answers say how much evidence there is.
    """

    name: str
    group: str
    causes: tuple[Cause, ...]
    equivalents: tuple[Cause, ...] = ()
    kind: str = ""
    structure: str = ""
    evidence_nats: float | None = None
    separation_nats: float | None = None
    place_separation_nats: float | None = None
    each_nats: tuple[float, ...] = ()
    has_evidence: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Diagnosis:
    """What was said about a case.

    Parameters
    ----------
    verdict : str
        ``consistent``, ``explained``, ``unexplained``, or ``failed`` where there is none.
    findings, alternatives : tuple of Cause
        The most probable first.
    places : tuple of mapping
        Locations that an unexplained mismatch is traced to.
    before, after : mapping of str to float
        Normalised FRF errors: ``training`` and ``held_out``.
    ambiguous : tuple of frozenset of str
        Effects that cannot be told apart.
    held_over_noise : float, optional
        Error on held-out blows after, over that of noise alone.
    """

    verdict: str
    findings: tuple[Cause, ...] = ()
    alternatives: tuple[Cause, ...] = ()
    places: tuple[Mapping[str, Any], ...] = ()
    before: Mapping[str, float] = field(default_factory=dict)
    after: Mapping[str, float] = field(default_factory=dict)
    ambiguous: tuple[frozenset[str], ...] = ()
    held_over_noise: float | None = None


FAILED = Diagnosis(verdict="failed")


def read_truth(path: Path) -> Truth:
    """Read an answer.

    Parameters
    ----------
    path : Path
        ``NAME.json`` of the sealed folder, or of a folder of answers of the same form.

    Returns
    -------
    Truth
        Its content.

    Raises
    ------
    AnswerError
        If it is no answer.
    """
    table = _read(path)
    if "effect" not in table:
        raise AnswerError(f"{path} is no answer: it has no 'effect'")
    shown = table.get("detectability", {})
    if "effects" in table:
        causes = tuple(_true_cause(one) for one in table["effects"])
    else:
        causes = () if table["effect"] == "null" else (_true_cause(table, level="level_change" in shown),)
    return Truth(
        name=path.stem,
        group=_group(causes),
        causes=causes,
        equivalents=tuple(_true_cause(one) for one in table.get("equivalents", [])),
        kind=next((one["unknown_kind"] for one in table.get("effects", [table]) if one.get("unknown_kind")), ""),
        structure=table.get("structure", {}).get("kind", ""),
        evidence_nats=shown.get("evidence_nats"),
        separation_nats=shown.get("separation_nats"),
        place_separation_nats=shown.get("place_separation_nats"),
        each_nats=tuple(one["evidence_nats"] for one in shown.get("each", []) if "evidence_nats" in one),
        has_evidence="evidence_nats" in shown,
    )


def _true_cause(table: Mapping[str, Any], *, level: bool = False) -> Cause:
    effect = table["effect"]
    return Cause(
        effect=effect,
        location=table.get("location", {}),
        parameters=table.get("parameters", {}),
        nonlinear=bool(table.get("nonlinear", effect in NONLINEAR or level)),
    )


def _group(causes: tuple[Cause, ...]) -> str:
    if not causes:
        return "null"
    if any(cause.effect == UNKNOWN for cause in causes):
        return "unknown"
    if len(causes) > 1:
        return "pair"
    return "nonlinear" if causes[0].effect in NONLINEAR else "linear"


def read_diagnosis(path: Path) -> Diagnosis:
    """Read a diagnosis.

    Parameters
    ----------
    path : Path
        ``diagnosis.json``.

    Returns
    -------
    Diagnosis
        Its content.

    Raises
    ------
    AnswerError
        If it is not what the contract says.
    """
    table = _read(path)
    if table.get("verdict") not in ("consistent", "explained", "unexplained"):
        raise AnswerError(f"{path}: the verdict is {table.get('verdict')!r}, not consistent, explained or unexplained")
    try:
        findings = tuple(_said_cause(one) for one in table.get("findings", []) if one.get("significant", True))
        alternatives = tuple(_said_cause(one) for one in table.get("alternatives", []))
    except (KeyError, TypeError, ValueError) as error:
        raise AnswerError(f"{path}: a finding or an alternative is not what the contract says ({error!r})") from None
    fit = table.get("fit", {})
    mismatch = table.get("mismatch", {})
    places = [mismatch["location"]] if mismatch.get("location") else []
    return Diagnosis(
        verdict=table["verdict"],
        findings=findings,
        alternatives=alternatives,
        places=(*(one.location for one in findings), *places),
        before=_numbers(fit.get("before", {})),
        after=_numbers(fit.get("after", {})),
        ambiguous=tuple(frozenset(one["effects"]) for one in table.get("ambiguity", [])),
        held_over_noise=fit.get("after", {}).get("held_out_over_noise"),
    )


def _said_cause(table: Mapping[str, Any]) -> Cause:
    return Cause(
        effect=table["effect"],
        location=table.get("location", {}),
        parameters={name: _value(value) for name, value in table.get("parameters", {}).items() if value is not None},
        probability=float(table.get("probability", 1.0)),
        gain=float(table.get("log_evidence_gain", 0.0)),
        places=tuple(table.get("location_set", ())),
        nonlinear=table["effect"] in NONLINEAR,
    )


def _value(entry: Mapping[str, Any] | float | str) -> Value | str:
    """Read a number with its interval: as given, or from the standard deviation; an open end is infinite."""
    if isinstance(entry, str):
        return entry
    if not isinstance(entry, Mapping):
        return Value(value=float(entry), low=float(entry), high=float(entry))
    value, std = float(entry["value"]), float(entry.get("std") or 0.0)
    low, high = entry.get("ci95") or (value - COVER * std, value + COVER * std)
    return Value(value=value, low=-math.inf if low is None else low, high=math.inf if high is None else high)


def _numbers(table: Mapping[str, Any]) -> dict[str, float]:
    return {name: float(value) for name, value in table.items() if isinstance(value, int | float)}


def _read(path: Path) -> dict[str, Any]:
    try:
        table = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise AnswerError(f"{path} cannot be read: {error}") from None
    if not isinstance(table, dict):
        raise AnswerError(f"{path} holds no table")
    return table
