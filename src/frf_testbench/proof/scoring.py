"""Open the answers, judge all cases, and hold the rates against the bars."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from frf_testbench.proof.answers import FAILED, AnswerError, read_diagnosis, read_truth
from frf_testbench.proof.commands import CommandOutcome, read_outcome
from frf_testbench.proof.judging import Judgement, is_wrong_name, judge, names_a_law
from frf_testbench.proof.locations import EXACT, NEAR, read_layout
from frf_testbench.proof.plan import Folders
from frf_testbench.proof.points import PointErrors, compute_point_errors
from frf_testbench.proof.rates import Rate, calibration, calibration_error


@dataclass(frozen=True, slots=True, kw_only=True)
class ScoredCase:
    """One case after it was opened.

    Parameters
    ----------
    judgement : Judgement
        What is counted.
    outcome : CommandOutcome, optional
        What it cost; None for a diagnosis that was made elsewhere.
    stage_s : float
        Time of the stage `diagnose` alone, from FRFs; nan where unknown.
    points : PointErrors, optional
        At points of interest.
    fault : str
        Why there is no diagnosis.
    """

    judgement: Judgement
    outcome: CommandOutcome | None = None
    stage_s: float = math.nan
    points: PointErrors | None = None
    fault: str = ""


Cases = Sequence[ScoredCase]


@dataclass(frozen=True, slots=True, kw_only=True)
class Bar:
    """One line of the table of bars.

    Parameters
    ----------
    group, name, requirement : str
        What is required, in words.
    rate : Rate, optional
        Of a bar that counts cases.
    value : float
        What was reached; nan where no case counts.
    passes : bool or None
        None where no case counts.
    """

    group: str
    name: str
    requirement: str
    value: float
    passes: bool | None
    rate: Rate | None = None


def open_cases(names: Sequence[str], folders: Folders) -> list[ScoredCase]:
    """Open the answers and judge.

    Parameters
    ----------
    names : sequence of str
        Cases.
    folders : Folders
        Where they are.

    Returns
    -------
    list of ScoredCase
        In the order of the names.
    """
    return [_open_case(name, folders) for name in names]


def _open_case(name: str, folders: Folders) -> ScoredCase:
    case, run = folders.cases / name, folders.diagnosed / name
    outcome, fault, diagnosis = read_outcome(folders.diagnosed, name), "", FAILED
    if outcome is not None and outcome.status:
        fault = outcome.message or f"exit status {outcome.status}"
    else:
        try:
            diagnosis = read_diagnosis(run / "diagnosis.json")
        except AnswerError as error:
            fault = str(error)
    return ScoredCase(
        judgement=judge(read_truth(folders.sealed / f"{name}.json"), diagnosis, read_layout(case)),
        outcome=outcome,
        stage_s=_read_stage_seconds(run / "run.json"),
        points=compute_point_errors(case, folders.sealed / f"{name}_points.csv", folders.predicted / name),
        fault=fault,
    )


def _read_stage_seconds(path: Path) -> float:
    if not path.is_file():
        return math.nan
    stage = json.loads(path.read_text(encoding="utf-8")).get("stages", {}).get("diagnose", {})
    return float(stage.get("seconds", math.nan))


def score_bars(cases: Cases) -> list[Bar]:
    """Hold all that was scored against the bars.

    Parameters
    ----------
    cases : sequence of ScoredCase
        All cases.

    Returns
    -------
    list of Bar
        In the order of the page.
    """
    return [
        *_score_naming(cases), *_score_locations(cases), *_score_parameters(cases), *_score_nulls(cases),
        *_score_out_of_catalogue(cases), *_score_laws(cases), *_score_pairs(cases), *_score_held_out(cases),
        *_score_points(cases), *_score_times(cases),
    ]  # fmt: skip


def _select(cases: Cases, *groups: str) -> list[Judgement]:
    return [case.judgement for case in cases if case.judgement.group in groups]


def _at_least(group: str, name: str, fraction: float, claims: Sequence[bool]) -> Bar:
    requirement = f"at least {fraction * 100:.0f} %"
    return _count(group, name, requirement, Rate.of(claims), lambda value: value >= fraction)


def _at_most(group: str, name: str, fraction: float, claims: Sequence[bool]) -> Bar:
    requirement = f"at most {fraction * 100:.0f} %"
    return _count(group, name, requirement, Rate.of(claims), lambda value: value <= fraction)


def _count(group: str, name: str, requirement: str, rate: Rate, is_met: Callable[[float], bool]) -> Bar:
    passes = is_met(rate.value) if rate.count else None
    return Bar(group=group, name=name, requirement=requirement, value=rate.value, passes=passes, rate=rate)


def _take_median(
    group: str, name: str, requirement: str, values: Sequence[float], is_met: Callable[[float], bool]
) -> Bar:
    """Hold the median of finite or infinite values against a bar."""
    numbers = [value for value in values if not math.isnan(value)]
    value = float(np.median(numbers)) if numbers else math.nan
    return Bar(group=group, name=name, requirement=requirement, value=value, passes=is_met(value) if numbers else None)


def _is_at_least(limit: float, value: float) -> bool:
    return value >= limit


def _is_at_most(limit: float, value: float) -> bool:
    return value <= limit


def _score_naming(cases: Cases) -> list[Bar]:
    linear = _select(cases, "linear")
    detected = [case for case in linear if case.is_detected]
    decidable = [case for case in linear if case.is_decidable]
    detectable = [case for case in linear if case.is_detectable]
    without_law = _select(cases, "linear", "null")
    return [
        _at_least("linear", "effect named first, of those detected", 0.95, [case.is_right for case in detected]),
        _at_least("linear", "effect named first, of those decidable", 0.98, [case.is_right for case in decidable]),
        _at_least("linear", "effect named first, of all", 0.90, [case.is_right for case in linear]),
        _at_least(
            "linear", "truth in the reported set, of those detected", 0.99,
            [case.is_in_reported_set for case in detected],
        ),
        _at_least(
            "linear", "detected, of those with a log Bayes factor over 100", 0.95,
            [case.is_detected for case in detectable],
        ),
        _at_most("linear", "declared nonlinear", 0.01, [names_a_law(case) for case in without_law]),
        _score_calibration(cases),
    ]  # fmt: skip


def _score_calibration(cases: Cases) -> Bar:
    value = calibration_error(calibration(*list_probabilities(cases)))
    passes = None if math.isnan(value) else value <= 0.05
    name = "probability of the effect named first: expected calibration error"
    return Bar(group="linear", name=name, requirement="at most 0.05", value=value, passes=passes)


def list_probabilities(cases: Cases) -> tuple[list[float], list[bool]]:
    """List the probabilities of the effects named first, of cases with one effect of the table, and which are right.

    Parameters
    ----------
    cases : sequence of ScoredCase
        All cases.

    Returns
    -------
    probabilities : list of float
        As stated.
    right : list of bool
        As many.
    """
    named = [case for case in _select(cases, "linear", "nonlinear") if not math.isnan(case.probability)]
    return [min(max(case.probability, 0.0), 1.0) for case in named], [case.first_is_right for case in named]


def _score_locations(cases: Cases) -> list[Bar]:
    located = [case for case in _select(cases, "linear") if case.is_right and case.location_match]
    matches = [case.location_match for case in located]
    decidable = [case.location_match for case in located if case.location_is_decidable]
    in_sets = [
        case.is_in_location_set
        for case in _select(cases, "linear")
        if case.is_right and case.is_in_location_set is not None
    ]
    return [
        _at_least("locations", "exact, where the effect is right", 0.95, [match == EXACT for match in matches]),
        _at_least(
            "locations", "exact, of those with a log Bayes factor over 3 over any other location", 0.95,
            [match == EXACT for match in decidable],
        ),
        _at_least("locations", "within one node or element", 0.99, [match in (EXACT, NEAR) for match in matches]),
        _at_least("locations", "true location among those stated as possible", 0.98, in_sets),
    ]  # fmt: skip


def _score_parameters(cases: Cases) -> list[Bar]:
    right = [case for case in _select(cases, "linear", "nonlinear") if case.is_right]
    scores = [score for case in right for score in case.parameters]
    numbers = [score for score in scores if score.is_number]
    errors = [score.error for score in numbers]
    covered = Rate.of(score.is_covered for score in numbers)
    words = [score.is_covered for score in scores if not score.is_number]
    return [
        _take_median("parameters", "median error", "at most 3 %", errors, partial(_is_at_most, 0.03)),
        _at_least("parameters", "error at most 10 %", 0.9, [error <= 0.1 for error in errors]),
        _at_least("parameters", "words (high-pass or low-pass)", 1.0, words),
        _count("parameters", "95 % intervals cover", "90 to 98 %", covered, lambda value: 0.9 <= value <= 0.98),
    ]


def _score_nulls(cases: Cases) -> list[Bar]:
    rate = Rate.of(case.verdict != "consistent" for case in _select(cases, "null"))
    upper = rate.interval[1] if rate.count else math.nan
    return [
        _count("nulls", "false alarms", "at most 2 %", rate, partial(_is_at_most, 0.02)),
        Bar(
            group="nulls", name="upper end of its 95 % interval", requirement="at most 6 %", value=upper,
            passes=upper <= 0.06 if rate.count else None,
        ),
    ]  # fmt: skip


def _score_out_of_catalogue(cases: Cases) -> list[Bar]:
    unknown = _select(cases, "unknown")
    distinct = [
        case for case in unknown if case.alternative_separation is not None and case.alternative_separation > 100
    ]

    def flagged(judgements: Sequence[Judgement]) -> list[bool]:
        return [judgement.verdict == "unexplained" for judgement in judgements]

    group = "outside the catalogue"
    return [
        _at_least(group, "flagged", 0.7, flagged(unknown)),
        _at_least(group, "flagged, of those with a log Bayes factor over 100 over the best alternative", 0.9,
                  flagged(distinct)),
        _at_most(group, "confident wrong names", 0.1, [is_wrong_name(case) for case in unknown]),
    ]  # fmt: skip


def _score_laws(cases: Cases) -> list[Bar]:
    laws = _select(cases, "nonlinear")
    unknown = [case for case in _select(cases, "unknown") if case.mismatch_location_match]
    located = [case.verdict == "unexplained" and case.mismatch_location_match == EXACT for case in unknown]
    return [
        _at_least("nonlinear", "law", 0.95, [case.is_right for case in laws]),
        _at_least("nonlinear", "location", 0.95, [case.is_right and case.location_match == EXACT for case in laws]),
        _at_least("nonlinear", "unknown law flagged with the right location", 0.8, located),
    ]


def _score_pairs(cases: Cases) -> list[Bar]:
    pairs = _select(cases, "pair")
    single = _select(cases, "linear", "nonlinear")

    def both(judgements: Sequence[Judgement]) -> list[bool]:
        return [judgement.n_right == 2 and judgement.verdict == "explained" for judgement in judgements]

    detectable = [case for case in pairs if case.both_are_detectable]
    return [
        _at_least("two effects", "both", 0.75, both(pairs)),
        _at_least("two effects", "both, each with a log Bayes factor over 100", 0.75, both(detectable)),
        _at_least("two effects", "at least one", 0.98, [case.n_right > 0 for case in pairs]),
        _at_most("two effects", "false second effect", 0.05, [case.n_findings > 1 for case in single]),
    ]


def _score_held_out(cases: Cases) -> list[Bar]:
    detected = [case for case in _select(cases, "linear", "nonlinear", "pair") if case.is_detected]
    ratios = [case.held_out_over_noise for case in detected if not math.isnan(case.held_out_over_noise)]
    name = "misfit on held-out records at most 1.3 times the noise"
    return [_at_least("held out", name, 0.9, [ratio <= 1.3 for ratio in ratios])]


def _score_points(cases: Cases) -> list[Bar]:
    points = [case.points for case in cases if case.points]
    diagnosed = [errors.diagnosed for errors in points]
    worse = [errors.diagnosed > 1.1 * errors.without for errors in points]
    group = "unmeasured points"
    return [
        *_compare_errors(group, "of the nominal model", 12.0, [errors.nominal for errors in points], diagnosed),
        *_compare_errors(group, "without a diagnosis", 3.0, [errors.without for errors in points], diagnosed),
        _at_most(group, "more than 10 % worse than without a diagnosis", 0.05, worse),
    ]


def _compare_errors(
    group: str, label: str, least: float, errors: Sequence[float], diagnosed: Sequence[float]
) -> list[Bar]:
    """Say how far errors with the diagnosis are below others: by medians, and by the median of the ratios."""
    requirement, is_met = f"at least {least:.0f}", partial(_is_at_least, least)
    ratio_of_medians = [float(np.median(errors) / np.median(diagnosed))] if errors else []
    ratios = [error / error_diagnosed for error, error_diagnosed in zip(errors, diagnosed, strict=True)]
    return [
        _take_median(
            group, f"median error {label} over that with the diagnosis", requirement, ratio_of_medians, is_met
        ),
        _take_median(group, f"error {label} over that with the diagnosis, median", requirement, ratios, is_met),
    ]


def _score_times(cases: Cases) -> list[Bar]:
    bars = []
    for group, longest in (("linear", 10.0), ("nonlinear", 15.0)):
        times = [case.stage_s for case in cases if case.judgement.group == group]
        name, requirement = f"{group} case, from FRFs, median", f"at most {longest:.0f} s"
        bars.append(_take_median("time", name, requirement, times, partial(_is_at_most, longest)))
    return bars
