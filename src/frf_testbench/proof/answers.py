"""Read answers and diagnoses into one form, so that they can be compared."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

NONLINEAR = ("cubic_stiffness", "gap_contact", "dry_friction")
UNKNOWN = "unknown"
COVERAGE_FACTOR = 1.959964  # standard deviations to each side of a 95 % interval

Location = Mapping[str, Any]


class AnswerError(Exception):
    """A file that is no answer, or no diagnosis."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
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
class Component:
    """An effect at its location: what is true, or what a diagnosis says.

    Parameters
    ----------
    effect : str
        Of the contract's table, or ``unknown``.
    location : mapping
        As in ``diagnosis.json``.
    parameters : mapping of str to float, str or Estimate
        Plain in an answer, with an interval in a diagnosis.
    probability, log_evidence_gain : float
        Of a diagnosis.
    possible_locations : tuple of mapping
        Of a diagnosis: all that it holds possible.
    is_nonlinear : bool
        Of an answer: whether it depends on level.
    """

    effect: str
    location: Location = field(default_factory=dict)
    parameters: Mapping[str, float | str | Estimate] = field(default_factory=dict)
    probability: float = 1.0
    log_evidence_gain: float = 0.0
    possible_locations: tuple[Location, ...] = ()
    is_nonlinear: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """The answer to a case. Evidence is a log Bayes factor; it is None where the answer does not say.

    Parameters
    ----------
    name : str
        Of the case.
    group : str
        ``linear``, ``null``, ``nonlinear``, ``pair`` or ``unknown``.
    components : tuple of Component
        None for a null, two for a pair.
    equivalents : tuple of Component
        Other answers that are right as well.
    kind : str
        Of an effect outside the table.
    structure : str
        Kind of the specimen.
    seed : int, optional
        Of the simulator.
    evidence, effect_separation, location_separation : float, optional
        Of the effect, and over the closest other effect and the closest other location.
    pair_evidence : tuple of float
        Of a pair: for each effect beside the other.
    states_evidence : bool
        Whether the answer says how much evidence there is.
    """

    name: str
    group: str
    components: tuple[Component, ...]
    equivalents: tuple[Component, ...] = ()
    kind: str = ""
    structure: str = ""
    seed: int | None = None
    evidence: float | None = None
    effect_separation: float | None = None
    location_separation: float | None = None
    pair_evidence: tuple[float, ...] = ()
    states_evidence: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Diagnosis:
    """What was said about a case.

    Parameters
    ----------
    verdict : str
        ``consistent``, ``explained``, ``unexplained``, or ``failed`` where there is none.
    findings, alternatives : tuple of Component
        The most probable first.
    locations : tuple of mapping
        Of the findings, and where an unexplained mismatch is traced to.
    error_before, error_after : mapping of str to float
        Normalised FRF errors: ``training`` and ``held_out``.
    ambiguity_sets : tuple of frozenset of str
        Effects that cannot be told apart.
    held_out_over_noise : float, optional
        Error on held-out records after, over that of noise alone.
    """

    verdict: str
    findings: tuple[Component, ...] = ()
    alternatives: tuple[Component, ...] = ()
    locations: tuple[Location, ...] = ()
    error_before: Mapping[str, float] = field(default_factory=dict)
    error_after: Mapping[str, float] = field(default_factory=dict)
    ambiguity_sets: tuple[frozenset[str], ...] = ()
    held_out_over_noise: float | None = None


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
    table = _read_table(path)
    if "effect" not in table:
        raise AnswerError(f"{path} is no answer: it has no 'effect'")
    detectability = table.get("detectability", {})
    if "effects" in table:
        components = tuple(_read_true_component(entry) for entry in table["effects"])
    elif table["effect"] == "null":
        components = ()
    else:
        components = (_read_true_component(table, depends_on_level="level_change" in detectability),)
    return Truth(
        name=path.stem,
        group=_name_group(components),
        components=components,
        equivalents=tuple(_read_true_component(entry) for entry in table.get("equivalents", [])),
        kind=next((entry["unknown_kind"] for entry in table.get("effects", [table]) if entry.get("unknown_kind")), ""),
        structure=table.get("structure", {}).get("kind", ""),
        seed=table.get("seed"),
        evidence=detectability.get("evidence_nats"),
        effect_separation=detectability.get("separation_nats"),
        location_separation=detectability.get("place_separation_nats"),
        pair_evidence=tuple(
            entry["evidence_nats"] for entry in detectability.get("each", []) if "evidence_nats" in entry
        ),
        states_evidence="evidence_nats" in detectability,
    )


def _read_true_component(table: Mapping[str, Any], *, depends_on_level: bool = False) -> Component:
    effect = table["effect"]
    return Component(
        effect=effect,
        location=table.get("location", {}),
        parameters=table.get("parameters", {}),
        is_nonlinear=bool(table.get("nonlinear", effect in NONLINEAR or depends_on_level)),
    )


def _name_group(components: Sequence[Component]) -> str:
    if not components:
        return "null"
    if any(component.effect == UNKNOWN for component in components):
        return "unknown"
    if len(components) > 1:
        return "pair"
    return "nonlinear" if components[0].effect in NONLINEAR else "linear"


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
    table = _read_table(path)
    if table.get("verdict") not in ("consistent", "explained", "unexplained"):
        raise AnswerError(f"{path}: the verdict is {table.get('verdict')!r}, not consistent, explained or unexplained")
    try:
        findings = tuple(_read_finding(entry) for entry in table.get("findings", []) if entry.get("significant", True))
        alternatives = tuple(_read_finding(entry) for entry in table.get("alternatives", []))
    except (KeyError, TypeError, ValueError) as error:
        raise AnswerError(f"{path}: a finding or an alternative is not what the contract says ({error!r})") from None
    fit = table.get("fit", {})
    mismatch = table.get("mismatch", {})
    mismatch_locations = [mismatch["location"]] if mismatch.get("location") else []
    return Diagnosis(
        verdict=table["verdict"],
        findings=findings,
        alternatives=alternatives,
        locations=(*(finding.location for finding in findings), *mismatch_locations),
        error_before=_select_numbers(fit.get("before", {})),
        error_after=_select_numbers(fit.get("after", {})),
        ambiguity_sets=tuple(frozenset(entry["effects"]) for entry in table.get("ambiguity", [])),
        held_out_over_noise=fit.get("after", {}).get("held_out_over_noise"),
    )


def _read_finding(table: Mapping[str, Any]) -> Component:
    parameters = table.get("parameters", {})
    return Component(
        effect=table["effect"],
        location=table.get("location", {}),
        parameters={name: _read_parameter(entry) for name, entry in parameters.items() if entry is not None},
        probability=float(table.get("probability", 1.0)),
        log_evidence_gain=float(table.get("log_evidence_gain", 0.0)),
        possible_locations=tuple(table.get("location_set", ())),
        is_nonlinear=table["effect"] in NONLINEAR,
    )


def _read_parameter(entry: Mapping[str, Any] | float | str) -> Estimate | str:
    """Read a number with its interval: as stated, or from the standard deviation; an open end is infinite."""
    if isinstance(entry, str):
        return entry
    if not isinstance(entry, Mapping):
        return Estimate(value=float(entry), low=float(entry), high=float(entry))
    value, std = float(entry["value"]), float(entry.get("std") or 0.0)
    low, high = entry.get("ci95") or (value - COVERAGE_FACTOR * std, value + COVERAGE_FACTOR * std)
    return Estimate(value=value, low=-math.inf if low is None else low, high=math.inf if high is None else high)


def _select_numbers(table: Mapping[str, Any]) -> dict[str, float]:
    return {name: float(value) for name, value in table.items() if isinstance(value, int | float)}


def _read_table(path: Path) -> dict[str, Any]:
    try:
        table = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise AnswerError(f"{path} cannot be read: {error}") from None
    if not isinstance(table, dict):
        raise AnswerError(f"{path} holds no table")
    return table
