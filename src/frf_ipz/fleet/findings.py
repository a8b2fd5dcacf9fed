"""Findings over machines: what all have is the model's fault, what one has alone is that machine's.

Machines are tested one by one, so the evidence for the same hypothesis adds up. Two explanations compete for an effect
at a location that ``k`` of ``n`` machines show. It is the model's: then every machine has it, and a search that has not
found it, though it explained the machine or found it consistent, speaks against it by as much as one that has found it
speaks for it (the log Bayes factor of a size over none is as large below zero without the effect as above with it). Or
these machines have it each for itself: with one faulty machine in a fleet expected, that is a factor ``1/n`` each.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import expit

from frf_ipz.diagnosis.result import Estimate, Finding
from frf_ipz.fleet.fleet_file import MODEL
from frf_ipz.fleet.outliers import find_outliers

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from frf_ipz.diagnosis.location import Location
    from frf_ipz.fleet.machine_record import MachineRecord

OWN_SIZE = 0.05  # probability that the size of a common fault is said to be one machine's own where it is not
EXPLAINED = ("consistent", "explained")


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetFinding:
    """An effect at a location, and whose it is.

    Parameters
    ----------
    effect : str
        Name in the catalogue.
    location : str
        As in `diagnosis.json`, as JSON.
    of : str
        ``model``, or the id of a machine.
    parameter : str
        Which of its parameters `value` is, with its unit.
    value, std : float
        Of the model's: mean over machines and its deviation. Of a machine's: its own.
    log_evidence : float
        Natural logarithm of the Bayes factor over a fleet without it.
    probability : float
        That it is there, and whose it is said to be.
    machines : tuple of str
        In which it was found.
    """

    effect: str
    location: str
    of: str
    parameter: str
    value: float
    std: float
    log_evidence: float
    probability: float
    machines: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Found:
    """A finding of one machine."""

    machine: str
    finding: Finding

    @property
    def locations(self) -> list[str]:
        """All that it may be, the most probable first."""
        return list(dict.fromkeys(map(_text, (self.finding.location, *self.finding.location_set))))


def add_up_findings(records: Sequence[MachineRecord]) -> list[FleetFinding]:
    """Say of every finding whether it is the model's or a machine's.

    Parameters
    ----------
    records : sequence of MachineRecord
        All machines.

    Returns
    -------
    list of FleetFinding
        The model's first, then by machine.
    """
    searched = {record.machine: record for record in records if record.verdict}
    found = [_Found(machine=record.machine, finding=each) for record in searched.values() for each in record.findings]
    added: list[FleetFinding] = []
    for effect in dict.fromkeys(each.finding.effect for each in found):
        rest = [each for each in found if each.finding.effect == effect]
        while rest:
            location = _commonest(rest)
            same = _one_a_machine([each for each in rest if location in each.locations])
            rest = [each for each in rest if each not in same]
            added += _whose(same, location, searched)
    return sorted(added, key=lambda each: (each.of != MODEL, each.of, -each.log_evidence))


def _commonest(found: Sequence[_Found]) -> str:
    """Choose the location that most machines allow; of several the one that most hold for the most probable."""
    votes: dict[str, tuple[set[str], float]] = {}
    for each in found:
        for rank, location in enumerate(each.locations):
            machines, weight = votes.get(location, (set(), 0.0))
            votes[location] = machines | {each.machine}, weight + 1 / (1 + rank)
    return max(votes, key=lambda location: (len(votes[location][0]), votes[location][1]))


def _one_a_machine(found: Sequence[_Found]) -> list[_Found]:
    best: dict[str, _Found] = {}
    for each in found:
        if each.machine not in best or each.finding.log_evidence_gain > best[each.machine].finding.log_evidence_gain:
            best[each.machine] = each
    return list(best.values())


def _whose(found: list[_Found], location: str, searched: Mapping[str, MachineRecord]) -> list[FleetFinding]:
    gains = np.array([each.finding.log_evidence_gain for each in found])
    with_it = {each.machine for each in found}
    without = sum(
        record.is_searched and record.verdict in EXPLAINED
        for record in searched.values()
        if record.machine not in with_it
    )
    against = without * float(np.median(gains))
    log_odds = len(found) * np.log(max(len(searched), 2)) - against
    is_common = len(found) > 1 and log_odds > 0
    if not is_common:
        certainty = float(expit(-log_odds)) if len(found) > 1 else 1.0
        return [_own(each, location, certainty) for each in found]
    return _common(found, location, float(gains.sum() - against), float(expit(log_odds)))


def _common(found: list[_Found], location: str, log_evidence: float, probability: float) -> list[FleetFinding]:
    """Give the model's fault; and the machines in which it is of another size, each as its own."""
    sizes = [_size(each.finding) for each in found]
    values, std = (np.array([size[place] for size in sizes], float) for place in (1, 2))
    off = find_outliers(values, np.nan_to_num(std), level=OWN_SIZE).is_outlier
    usual, usual_std = values[~off], np.nan_to_num(std[~off])
    scatter = max(float(usual.var(ddof=1)) if len(usual) > 1 else 0.0, float(np.mean(usual_std**2)))
    common = FleetFinding(
        effect=found[0].finding.effect,
        location=location,
        of=MODEL,
        parameter=sizes[0][0],
        value=float(usual.mean()),
        std=float(np.sqrt(scatter / len(usual))),
        log_evidence=log_evidence,
        probability=probability,
        machines=tuple(each.machine for each in found),
    )
    return [common, *(_own(each, location, 1.0) for each, is_off in zip(found, off, strict=True) if is_off)]


def _own(each: _Found, location: str, certainty: float) -> FleetFinding:
    finding = each.finding
    parameter, value, std = _size(finding)
    return FleetFinding(
        effect=finding.effect,
        location=location if certainty < 1 else _text(finding.location),
        of=each.machine,
        parameter=parameter,
        value=value,
        std=std,
        log_evidence=finding.log_evidence_gain,
        probability=finding.probability * certainty,
        machines=(each.machine,),
    )


def _size(finding: Finding) -> tuple[str, float, float]:
    """Its first parameter that is a number."""
    for name, value in finding.parameters.items():
        if isinstance(value, Estimate):
            return name, value.value, value.std
    return "", float("nan"), float("nan")


def _text(location: Location) -> str:
    return json.dumps(dict(location))
