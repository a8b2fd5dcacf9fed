"""Judge one diagnosis by the answer to its case."""

from __future__ import annotations

import math
from dataclasses import dataclass

from frf_testbench.proof.answers import NONLINEAR, UNKNOWN, Component, Diagnosis, Estimate, Truth
from frf_testbench.proof.locations import EXACT, RANKS, WRONG, Layout, compare_locations

# log Bayes factors
REPORTED_WITHIN = 5.0  # of the best explanation: what lies closer belongs to the reported set
DETECTABLE = 100.0
DECIDABLE, DECIDABLE_SEPARATION = 300.0, 15.0
LOCATION_SEPARATION = 3.0  # odds of 20 to 1 against the closest other location

CONFIDENT = 0.9  # probability


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterScore:
    """How good one number is.

    Parameters
    ----------
    effect, name : str
        Of which effect, and which parameter.
    error : float
        Relative; infinite where it is missing or a wrong word.
    is_covered : bool
        Whether the 95 % interval holds the truth.
    is_number : bool
        False for a word: it counts in no median and no interval.
    """

    effect: str
    name: str
    error: float
    is_covered: bool
    is_number: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Judgement:
    """All that is counted about one case.

    Parameters
    ----------
    name, group, structure : str
        Of the case.
    true_label, stated_label : str
        Rows and columns of the confusion matrix.
    verdict : str
        Or ``failed``.
    is_detected : bool
        Stated to lack something.
    is_right : bool
        Explained, and the effect named first is a true one or equivalent to it.
    first_is_right : bool
        The same whatever the verdict is.
    seed : int, optional
        Of the simulator.
    location_match : str, optional
        Of the effect named first, where that is right: ``exact``, ``near``, ``wrong``; None where it has no location.
    parameters : tuple of ParameterScore
        Where name and location are right.
    is_in_reported_set, n_reported
        Whether the true effect is in the reported set, and how many effects that holds.
    probability : float
        Of the effect named first; nan where none is named.
    is_detectable, is_decidable : bool or None
        By the evidence in the answer; None where it says nothing.
    n_right, n_findings : int
        True effects among the findings, and all findings.
    both_are_detectable : bool or None
        Of a pair: each effect has evidence of its own.
    n_right_exact : int
        Of a pair: effects that are named at exactly their location.
    alternative_separation : float or None
        Outside the catalogue: log Bayes factor over the closest known effect at its location.
    mismatch_location_match : str or None
        Outside the catalogue, a law at a node or spring: how close the location of the mismatch is.
    location_is_decidable : bool
        The recordings tell the true location from the closest other one, as far as the answer says.
    is_in_location_set : bool or None
        Whether the true location is among those that are stated as possible; None where none are stated.
    held_out_before, held_out_after, held_out_over_noise : float
        Errors on held-out records before and after, and after over that of noise alone; nan where not stated.
    """

    name: str
    group: str
    structure: str
    true_label: str
    stated_label: str
    verdict: str
    is_detected: bool
    is_right: bool
    first_is_right: bool
    seed: int | None = None
    location_match: str | None = None
    parameters: tuple[ParameterScore, ...] = ()
    is_in_reported_set: bool = False
    n_reported: int = 0
    probability: float = math.nan
    is_detectable: bool | None = None
    is_decidable: bool | None = None
    n_right: int = 0
    n_findings: int = 0
    both_are_detectable: bool | None = None
    n_right_exact: int = 0
    alternative_separation: float | None = None
    mismatch_location_match: str | None = None
    location_is_decidable: bool = True
    is_in_location_set: bool | None = None
    held_out_before: float = math.nan
    held_out_after: float = math.nan
    held_out_over_noise: float = math.nan


def judge(truth: Truth, diagnosis: Diagnosis, layout: Layout) -> Judgement:
    """Judge a diagnosis.

    Parameters
    ----------
    truth : Truth
        The answer.
    diagnosis : Diagnosis
        What was said.
    layout : Layout
        Of the model.

    Returns
    -------
    Judgement
        What is counted.
    """
    first = diagnosis.findings[0] if diagnosis.findings else None
    option, match = _match_answer(first, truth, layout) if first else (None, None)
    all_matches = [_match_findings(component, diagnosis, layout) for component in truth.components]
    named_matches = [matches for matches in all_matches if matches]
    reported = list_reported_effects(diagnosis)
    is_explained = diagnosis.verdict == "explained"
    return Judgement(
        name=truth.name,
        group=truth.group,
        structure=truth.structure,
        seed=truth.seed,
        true_label=_label_truth(truth),
        stated_label=first.effect if first and is_explained else diagnosis.verdict,
        verdict=diagnosis.verdict,
        is_detected=diagnosis.verdict in ("explained", "unexplained"),
        is_right=option is not None and is_explained,
        first_is_right=option is not None,
        location_match=match,
        parameters=_score_parameters(option, first, match),
        is_in_reported_set=bool({component.effect for component in _list_right_answers(truth)} & reported),
        n_reported=len(reported),
        probability=first.probability if first else math.nan,
        is_detectable=_is_detectable(truth),
        is_decidable=_is_decidable(truth),
        n_right=len(named_matches),
        n_findings=len(diagnosis.findings),
        both_are_detectable=min(truth.pair_evidence) > DETECTABLE if truth.pair_evidence else None,
        n_right_exact=sum(matches[0] in (EXACT, None) for matches in named_matches),
        alternative_separation=truth.effect_separation if truth.group == "unknown" else None,
        mismatch_location_match=_match_mismatch_location(truth, diagnosis, layout),
        location_is_decidable=truth.location_separation is None or truth.location_separation > LOCATION_SEPARATION,
        is_in_location_set=_is_in_location_set(option, first, layout),
        held_out_before=diagnosis.error_before.get("held_out", math.nan),
        held_out_after=diagnosis.error_after.get("held_out", math.nan),
        held_out_over_noise=math.nan if diagnosis.held_out_over_noise is None else diagnosis.held_out_over_noise,
    )


def _list_right_answers(truth: Truth) -> tuple[Component, ...]:
    """List what is right: what is outside the catalogue cannot be named, but what is equivalent to it can."""
    options = (*truth.components, *truth.equivalents)
    return tuple(option for option in options if option.effect != UNKNOWN)


def _rank(match: str | None) -> int:
    """Order matches; an effect without a location cannot be located wrong."""
    return RANKS[EXACT] + 1 if match is None else RANKS[match]


def _match_answer(finding: Component, truth: Truth, layout: Layout) -> tuple[Component | None, str | None]:
    """Find the right answer that a finding comes closest to; (None, None) where it names none.

    An equivalent is right at its own location only.
    """
    options: list[tuple[Component | None, str | None]] = []
    for option in _list_right_answers(truth):
        if option.effect == finding.effect:
            match = compare_locations(option.location, finding.location, layout)
            if option in truth.components or match != WRONG:
                options.append((option, match))
    return max(options, key=lambda pair: _rank(pair[1]), default=(None, None))


def _match_findings(component: Component, diagnosis: Diagnosis, layout: Layout) -> list[str | None]:
    """Compare the locations of all findings that name a true component, the closest first."""
    namesakes = [finding for finding in diagnosis.findings if finding.effect == component.effect]
    matches = [compare_locations(component.location, finding.location, layout) for finding in namesakes]
    return sorted(matches, key=_rank, reverse=True)


def list_reported_effects(diagnosis: Diagnosis) -> set[str]:
    """List effects that a diagnosis does not tell apart: those close to the one named first, or stated to be.

    Parameters
    ----------
    diagnosis : Diagnosis
        What was said.

    Returns
    -------
    set of str
        All findings among them; empty without findings.
    """
    if not diagnosis.findings:
        return set()
    first = diagnosis.findings[0]
    limit = first.log_evidence_gain - REPORTED_WITHIN
    close = {alternative.effect for alternative in diagnosis.alternatives if alternative.log_evidence_gain >= limit}
    ambiguous = {effect for effects in diagnosis.ambiguity_sets if first.effect in effects for effect in effects}
    return {finding.effect for finding in diagnosis.findings} | close | ambiguous


def _is_in_location_set(option: Component | None, finding: Component | None, layout: Layout) -> bool | None:
    """Whether the true location is among the possible ones; None for an effect without a location."""
    if option is None or finding is None or not finding.possible_locations:
        return None
    matches = [compare_locations(option.location, location, layout) for location in finding.possible_locations]
    return None if None in matches else EXACT in matches


def _score_parameters(
    option: Component | None, finding: Component | None, match: str | None
) -> tuple[ParameterScore, ...]:
    """Compare numbers, where name and location are right."""
    if option is None or finding is None or match not in (EXACT, None):
        return ()
    one_is_enough = option.effect == "boundary_compliance"  # the contract: one stiffness and/or the other
    stated_names = [name for name in option.parameters if name in finding.parameters]
    names = stated_names if one_is_enough and stated_names else list(option.parameters)
    return tuple(
        _score_parameter(option.effect, name, option.parameters[name], finding.parameters.get(name)) for name in names
    )


def _score_parameter(
    effect: str, name: str, truth: float | str | Estimate, stated: float | str | Estimate | None
) -> ParameterScore:
    if isinstance(truth, str):
        same = stated == truth
        error = 0.0 if same else math.inf
        return ParameterScore(effect=effect, name=name, error=error, is_covered=same, is_number=False)
    if isinstance(truth, Estimate) or not isinstance(stated, Estimate):
        return ParameterScore(effect=effect, name=name, error=math.inf, is_covered=False)
    error = abs(stated.value - truth) / abs(truth)
    return ParameterScore(effect=effect, name=name, error=error, is_covered=stated.low <= truth <= stated.high)


def _label_truth(truth: Truth) -> str:
    if truth.group == "unknown":
        return f"outside: {truth.kind or 'unnamed'}"
    if truth.group == "pair":
        return "two effects"
    return truth.components[0].effect if truth.components else "nothing"


def _is_detectable(truth: Truth) -> bool | None:
    if not truth.components or not truth.states_evidence or truth.evidence is None:
        return None
    return truth.evidence > DETECTABLE


def _is_decidable(truth: Truth) -> bool | None:
    """Whether there is evidence enough, for the effect and over the closest other effect where there is one."""
    if truth.group != "linear" or not truth.states_evidence or truth.evidence is None:
        return None
    is_apart = truth.effect_separation is None or truth.effect_separation > DECIDABLE_SEPARATION
    return truth.evidence > DECIDABLE and is_apart and not truth.equivalents


def _match_mismatch_location(truth: Truth, diagnosis: Diagnosis, layout: Layout) -> str | None:
    """Compare the location of an unexplained mismatch with that of an unknown law."""
    component = truth.components[0] if truth.components else None
    if truth.group != "unknown" or component is None or not component.is_nonlinear or "channels" in component.location:
        return None
    matches = [compare_locations(component.location, location, layout) or WRONG for location in diagnosis.locations]
    return max(matches, key=RANKS.__getitem__, default=WRONG)


def is_wrong_name(judgement: Judgement) -> bool:
    """Whether something outside the catalogue got a confident name that is not equivalent to it."""
    return judgement.verdict == "explained" and not judgement.is_right and judgement.probability > CONFIDENT


def names_a_law(judgement: Judgement) -> bool:
    """Whether a nonlinear effect was named."""
    return judgement.stated_label in NONLINEAR
