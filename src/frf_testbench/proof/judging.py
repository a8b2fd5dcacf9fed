"""Judge one diagnosis by the answer to its case."""

from __future__ import annotations

import math
from dataclasses import dataclass

from frf_testbench.proof.answers import NONLINEAR, UNKNOWN, Cause, Diagnosis, Truth, Value
from frf_testbench.proof.places import EXACT, RANKS, WRONG, Layout, compare_places

SET_NATS = 5.0  # what lies within this of the best explanation belongs to the reported set
DETECTABLE_NATS = 100.0
DECIDABLE_NATS, DECIDABLE_SEPARATION = 300.0, 15.0
PLACED_SEPARATION = 3.0  # odds of 20 to 1 against the closest other place
CONFIDENT = 0.9


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterScore:
    """How good one number is.

    Parameters
    ----------
    effect, name : str
        Of which effect, and which parameter.
    error : float
        Relative; infinite where it is missing or a wrong word.
    covered : bool
        Whether the 95 % interval holds the truth.
    is_number : bool
        False for a word: it counts in no median and no interval.
    """

    effect: str
    name: str
    error: float
    covered: bool
    is_number: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Judgement:
    """All that is counted about one case.

    Parameters
    ----------
    name, group, structure : str
        Of the case.
    true, said : str
        Rows and columns of the confusion matrix.
    verdict : str
        Or ``failed``.
    detected : bool
        Said to lack something.
    right : bool
        Explained, and the effect named first is a true one or equivalent to it.
    first_right : bool
        The same whatever the verdict is.
    place : str, optional
        Of the effect named first, where that is right: ``exact``, ``near``, ``wrong``; None where it has no place.
    parameters : tuple of ParameterScore
        Where name and place are right.
    in_set, set_size
        Whether the true effect is in the reported set, and how many effects that holds.
    probability : float
        Of the effect named first; nan where none is named.
    detectable, decidable : bool or None
        By the evidence in the answer; None where it says nothing.
    n_right, n_findings : int
        True effects among the findings, and all findings.
    both_detectable : bool or None
        Of a pair: each effect has evidence of its own.
    pair_places : int
        Of a pair: effects that are named and exactly placed.
    substitute_nats : float or None
        Outside the catalogue: how much worse the closest known effect at its place is.
    flagged_place : str or None
        Outside the catalogue, a law at a node or spring: how close the place of the mismatch is.
    place_told : bool
        The recordings tell the true place from the closest other one, as far as the answer says.
    in_place_set : bool or None
        Whether the true place is among those that are said to be possible; None where none are said.
    before, held_out, held_over_noise : float
        Errors on held-out blows before and after, and after over that of noise alone; nan where not given.
    """

    name: str
    group: str
    structure: str
    true: str
    said: str
    verdict: str
    detected: bool
    right: bool
    first_right: bool
    place: str | None = None
    parameters: tuple[ParameterScore, ...] = ()
    in_set: bool = False
    set_size: int = 0
    probability: float = math.nan
    detectable: bool | None = None
    decidable: bool | None = None
    n_right: int = 0
    n_findings: int = 0
    both_detectable: bool | None = None
    pair_places: int = 0
    substitute_nats: float | None = None
    flagged_place: str | None = None
    place_told: bool = True
    in_place_set: bool | None = None
    before: float = math.nan
    held_out: float = math.nan
    held_over_noise: float = math.nan


def judge(truth: Truth, said: Diagnosis, layout: Layout) -> Judgement:
    """Judge a diagnosis.

    Parameters
    ----------
    truth : Truth
        The answer.
    said : Diagnosis
        What was said.
    layout : Layout
        Of the model.

    Returns
    -------
    Judgement
        What is counted.
    """
    first = said.findings[0] if said.findings else None
    option, place = _best(first, truth, layout) if first else (None, None)
    first_right = option is not None
    found = [places for places in (_found(cause, said, layout) for cause in truth.causes) if places]
    reported = reported_set(said)
    return Judgement(
        name=truth.name,
        group=truth.group,
        structure=truth.structure,
        true=_true_label(truth),
        said=first.effect if first and said.verdict == "explained" else said.verdict,
        verdict=said.verdict,
        detected=said.verdict in ("explained", "unexplained"),
        right=first_right and said.verdict == "explained",
        first_right=first_right,
        place=place,
        parameters=_parameters(option, first, place),
        in_set=bool({cause.effect for cause in _accepted(truth)} & reported),
        set_size=len(reported),
        probability=first.probability if first else math.nan,
        detectable=_detectable(truth),
        decidable=_decidable(truth),
        n_right=len(found),
        n_findings=len(said.findings),
        both_detectable=min(truth.each_nats) > DETECTABLE_NATS if truth.each_nats else None,
        pair_places=sum(places[0] in (EXACT, None) for places in found),
        substitute_nats=truth.separation_nats if truth.group == "unknown" else None,
        flagged_place=_flagged_place(truth, said, layout),
        place_told=truth.place_separation_nats is None or truth.place_separation_nats > PLACED_SEPARATION,
        in_place_set=_in_place_set(option, first, layout),
        before=said.before.get("held_out", math.nan),
        held_out=said.after.get("held_out", math.nan),
        held_over_noise=math.nan if said.held_over_noise is None else said.held_over_noise,
    )


def _accepted(truth: Truth) -> tuple[Cause, ...]:
    """Causes that are right answers: what is outside the catalogue cannot be named, but what is equivalent can."""
    return tuple(one for one in (*truth.causes, *truth.equivalents) if one.effect != UNKNOWN)


def _best(said: Cause, truth: Truth, layout: Layout) -> tuple[Cause | None, str | None]:
    """Find the right answer that a finding comes closest to; (None, None) where it names none.

    An equivalent is right at its own place only.
    """
    compared = []
    for option in _accepted(truth):
        if option.effect == said.effect:
            place = compare_places(option.location, said.location, layout)
            if option in truth.causes or place != WRONG:
                compared.append((option, place))
    return max(compared, key=lambda pair: RANKS.get(pair[1], 3), default=(None, None))


def _found(cause: Cause, said: Diagnosis, layout: Layout) -> list[str | None]:
    """Places of the findings that name a true cause, the closest first."""
    places = [
        compare_places(cause.location, one.location, layout) for one in said.findings if one.effect == cause.effect
    ]
    return sorted(places, key=lambda place: -RANKS.get(place, 3))


def reported_set(said: Diagnosis) -> set[str]:
    """Effects that a diagnosis does not tell apart: those within 5 nats of the one named first, or said to be."""
    if not said.findings:
        return set()
    first = said.findings[0]
    close = {one.effect for one in said.alternatives if one.gain >= first.gain - SET_NATS}
    named = {effect for effects in said.ambiguous if first.effect in effects for effect in effects}
    return {one.effect for one in said.findings} | close | named


def _in_place_set(option: Cause | None, said: Cause | None, layout: Layout) -> bool | None:
    """Whether the true place of a right effect is among the possible ones; None for an effect without a place."""
    if option is None or said is None or not said.places:
        return None
    compared = [compare_places(option.location, place, layout) for place in said.places]
    return None if None in compared else EXACT in compared


def _parameters(option: Cause | None, said: Cause | None, place: str | None) -> tuple[ParameterScore, ...]:
    """Compare numbers, where name and place are right."""
    if option is None or said is None or place not in (EXACT, None):
        return ()
    either = option.effect == "boundary_compliance"  # the contract: one stiffness and/or the other
    given = [name for name in option.parameters if name in said.parameters]
    names = given if either and given else list(option.parameters)
    return tuple(_parameter(option.effect, name, option.parameters[name], said.parameters.get(name)) for name in names)


def _parameter(effect: str, name: str, truth: float | str | Value, said: float | str | Value | None) -> ParameterScore:
    if isinstance(truth, str):
        same = said == truth
        return ParameterScore(effect=effect, name=name, error=0.0 if same else math.inf, covered=same, is_number=False)
    if isinstance(truth, Value) or not isinstance(said, Value):
        return ParameterScore(effect=effect, name=name, error=math.inf, covered=False)
    error = abs(said.value - truth) / abs(truth)
    return ParameterScore(effect=effect, name=name, error=error, covered=said.low <= truth <= said.high)


def _true_label(truth: Truth) -> str:
    if truth.group == "unknown":
        return f"outside: {truth.kind or 'unnamed'}"
    if truth.group == "pair":
        return "two effects"
    return truth.causes[0].effect if truth.causes else "nothing"


def _detectable(truth: Truth) -> bool | None:
    if not truth.causes or not truth.has_evidence or truth.evidence_nats is None:
        return None
    return truth.evidence_nats > DETECTABLE_NATS


def _decidable(truth: Truth) -> bool | None:
    """Evidence over 300 nats, and over 15 nats from the closest other effect where there is one."""
    if truth.group != "linear" or not truth.has_evidence or truth.evidence_nats is None:
        return None
    apart = truth.separation_nats is None or truth.separation_nats > DECIDABLE_SEPARATION
    return truth.evidence_nats > DECIDABLE_NATS and apart and not truth.equivalents


def _flagged_place(truth: Truth, said: Diagnosis, layout: Layout) -> str | None:
    """Say how close the place of an unexplained mismatch is to that of an unknown law."""
    cause = truth.causes[0] if truth.causes else None
    if truth.group != "unknown" or cause is None or not cause.nonlinear or "channels" in cause.location:
        return None
    found = [compare_places(cause.location, place, layout) or "wrong" for place in said.places]
    return max(found, key=RANKS.__getitem__, default="wrong")


def is_wrong_name(judgement: Judgement) -> bool:
    """Whether something outside the catalogue got a confident name that is not equivalent to it."""
    return judgement.verdict == "explained" and not judgement.right and judgement.probability > CONFIDENT


def names_a_law(judgement: Judgement) -> bool:
    """Whether a nonlinear effect was named."""
    return judgement.said in NONLINEAR
