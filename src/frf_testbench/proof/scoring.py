"""Open the answers, judge all cases, and hold the rates against the bars."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from frf_testbench.proof.answers import FAILED, AnswerError, read_diagnosis, read_truth
from frf_testbench.proof.commands import Done, read_done
from frf_testbench.proof.judging import Judgement, is_wrong_name, judge, names_a_law
from frf_testbench.proof.places import EXACT, NEAR, read_layout
from frf_testbench.proof.plan import Folders
from frf_testbench.proof.points import PointErrors, point_errors
from frf_testbench.proof.rates import Rate, calibration, calibration_error

Judgements = Sequence["Scored"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Scored:
    """One case after it was opened.

    Parameters
    ----------
    judgement : Judgement
        What is counted.
    done : Done, optional
        What it cost; None for a diagnosis that was made elsewhere.
    stage_s : float
        Time of the stage `diagnose` alone, from FRFs; nan where unknown.
    points : PointErrors, optional
        At points of interest.
    fault : str
        Why there is no diagnosis.
    """

    judgement: Judgement
    done: Done | None = None
    stage_s: float = math.nan
    points: PointErrors | None = None
    fault: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bar:
    """One line of the table of bars.

    Parameters
    ----------
    group, name, wanted : str
        What is asked, in words.
    rate : Rate, optional
        Of a bar that counts cases.
    value : float
        What was reached; nan where no case counts.
    passes : bool or None
        None where no case counts.
    """

    group: str
    name: str
    wanted: str
    value: float
    passes: bool | None
    rate: Rate | None = None


def open_cases(names: Sequence[str], folders: Folders) -> list[Scored]:
    """Open the answers and judge.

    Parameters
    ----------
    names : sequence of str
        Cases.
    folders : Folders
        Where they are.

    Returns
    -------
    list of Scored
        In the order of the names.
    """
    return [_open(name, folders) for name in names]


def _open(name: str, folders: Folders) -> Scored:
    case, run = folders.cases / name, folders.diagnosed / name
    done, fault, said = read_done(folders.diagnosed, name), "", FAILED
    if done is not None and done.status:
        fault = done.message or f"exit status {done.status}"
    else:
        try:
            said = read_diagnosis(run / "diagnosis.json")
        except AnswerError as error:
            fault = str(error)
    return Scored(
        judgement=judge(read_truth(folders.sealed / f"{name}.json"), said, read_layout(case)),
        done=done,
        stage_s=_stage_seconds(run / "run.json"),
        points=point_errors(case, folders.sealed / f"{name}_points.csv", folders.predicted / name),
        fault=fault,
    )


def _stage_seconds(path: Path) -> float:
    if not path.is_file():
        return math.nan
    stage = json.loads(path.read_text(encoding="utf-8")).get("stages", {}).get("diagnose", {})
    return float(stage.get("seconds", math.nan))


def bars(cases: Judgements) -> list[Bar]:
    """Hold all that was scored against the bars.

    Parameters
    ----------
    cases : sequence of Scored
        All cases.

    Returns
    -------
    list of Bar
        In the order of the page.
    """
    return [
        *_naming(cases), *_places(cases), *_parameters(cases), *_nulls(cases), *_open_set(cases), *_laws(cases),
        *_pairs(cases), *_fit(cases), *_points(cases), *_times(cases),
    ]  # fmt: skip


def _group(cases: Judgements, *groups: str) -> list[Judgement]:
    return [case.judgement for case in cases if case.judgement.group in groups]


def _at_least(group: str, name: str, part: float, claims: Sequence[bool]) -> Bar:
    return _counted(group, name, f"at least {part * 100:.0f} %", Rate.of(claims), lambda value: value >= part)


def _at_most(group: str, name: str, part: float, claims: Sequence[bool]) -> Bar:
    return _counted(group, name, f"at most {part * 100:.0f} %", Rate.of(claims), lambda value: value <= part)


def _counted(group: str, name: str, wanted: str, rate: Rate, good: Callable[[float], bool]) -> Bar:
    passes = good(rate.value) if rate.count else None
    return Bar(group=group, name=name, wanted=wanted, value=rate.value, passes=passes, rate=rate)


def _measured(group: str, name: str, wanted: str, values: Sequence[float], good: Callable[[float], bool]) -> Bar:
    """Hold the median of finite or infinite values against a bar."""
    known = [value for value in values if not math.isnan(value)]
    value = float(np.median(known)) if known else math.nan
    return Bar(group=group, name=name, wanted=wanted, value=value, passes=good(value) if known else None)


def _naming(cases: Judgements) -> list[Bar]:
    linear = _group(cases, "linear")
    seen = [one for one in linear if one.detected]
    decidable = [one for one in linear if one.decidable]
    return [
        _at_least("linear", "effect named first, of those detected", 0.95, [one.right for one in seen]),
        _at_least("linear", "effect named first, of those decidable", 0.98, [one.right for one in decidable]),
        _at_least("linear", "effect named first, of all", 0.90, [one.right for one in linear]),
        _at_least("linear", "truth in the reported set, of those detected", 0.99, [one.in_set for one in seen]),
        _at_least(
            "linear", "detected, of those with over 100 nats", 0.95, [x.detected for x in linear if x.detectable]
        ),
        _at_most("linear", "declared nonlinear", 0.01, [names_a_law(one) for one in _group(cases, "linear", "null")]),
        _calibration(cases),
    ]


def _calibration(cases: Judgements) -> Bar:
    claims = calibrated(cases)
    value = calibration_error(calibration(*claims))
    passes = None if math.isnan(value) else value <= 0.05
    name = "probability of the effect named first: expected calibration error"
    return Bar(group="linear", name=name, wanted="at most 0.05", value=value, passes=passes)


def calibrated(cases: Judgements) -> tuple[list[float], list[bool]]:
    """Give the probabilities of the effects named first, of cases with one effect of the table, and which are right.

    Parameters
    ----------
    cases : sequence of Scored
        All cases.

    Returns
    -------
    probabilities : list of float
        As said.
    right : list of bool
        As many.
    """
    named = [one for one in _group(cases, "linear", "nonlinear") if not math.isnan(one.probability)]
    return [min(max(one.probability, 0.0), 1.0) for one in named], [one.first_right for one in named]


def _places(cases: Judgements) -> list[Bar]:
    right = [one for one in _group(cases, "linear") if one.right]
    placed = [one.place for one in right if one.place]
    told = [one.place == EXACT for one in right if one.place and one.place_told]
    in_sets = [one.in_place_set for one in right if one.in_place_set is not None]
    return [
        _at_least("places", "exact, where the effect is right", 0.95, [place == EXACT for place in placed]),
        _at_least("places", "exact, of those over 3 nats from any other place", 0.95, told),
        _at_least("places", "within one node or element", 0.99, [place in (EXACT, NEAR) for place in placed]),
        _at_least("places", "true place among the possible ones said", 0.98, in_sets),
    ]


def _parameters(cases: Judgements) -> list[Bar]:
    scores = [score for one in _group(cases, "linear", "nonlinear") if one.right for score in one.parameters]
    covered = Rate.of(score.covered for score in scores if score.is_number)
    errors = [score.error for score in scores if score.is_number]
    words = [score.covered for score in scores if not score.is_number]
    return [
        _measured("parameters", "median error", "at most 3 %", errors, lambda value: value <= 0.03),
        _at_least("parameters", "error at most 10 %", 0.9, [error <= 0.1 for error in errors]),
        _at_least("parameters", "words (high-pass or low-pass)", 1.0, words),
        _counted("parameters", "95 % intervals cover", "90 to 98 %", covered, lambda value: 0.9 <= value <= 0.98),
    ]


def _nulls(cases: Judgements) -> list[Bar]:
    rate = Rate.of(one.verdict != "consistent" for one in _group(cases, "null"))
    upper = rate.interval[1] if rate.count else math.nan
    return [
        _counted("nulls", "false alarms", "at most 2 %", rate, lambda value: value <= 0.02),
        Bar(
            group="nulls", name="upper end of its 95 % interval", wanted="at most 6 %", value=upper,
            passes=upper <= 0.06 if rate.count else None,
        ),
    ]  # fmt: skip


def _open_set(cases: Judgements) -> list[Bar]:
    outside = _group(cases, "unknown")
    far = [one for one in outside if one.substitute_nats is not None and one.substitute_nats > 100]

    def flagged(ones: Sequence[Judgement]) -> list[bool]:
        return [one.verdict == "unexplained" for one in ones]

    return [
        _at_least("outside the catalogue", "flagged", 0.7, flagged(outside)),
        _at_least("outside the catalogue", "flagged, best substitute over 100 nats worse", 0.9, flagged(far)),
        _at_most("outside the catalogue", "confident wrong names", 0.1, [is_wrong_name(one) for one in outside]),
    ]


def _laws(cases: Judgements) -> list[Bar]:
    laws = _group(cases, "nonlinear")
    unknown = [one for one in _group(cases, "unknown") if one.flagged_place]
    right = [one.verdict == "unexplained" and one.flagged_place == EXACT for one in unknown]
    return [
        _at_least("nonlinear", "law", 0.95, [one.right for one in laws]),
        _at_least("nonlinear", "place", 0.95, [one.right and one.place == EXACT for one in laws]),
        _at_least("nonlinear", "unknown law flagged with the right place", 0.8, right),
    ]


def _pairs(cases: Judgements) -> list[Bar]:
    pairs = _group(cases, "pair")
    single = _group(cases, "linear", "nonlinear")
    plain = [one for one in pairs if one.both_detectable]
    both = [one.n_right == 2 and one.verdict == "explained" for one in pairs]
    return [
        _at_least("two effects", "both", 0.75, both),
        _at_least("two effects", "both, each with over 100 nats", 0.75, [
            one.n_right == 2 and one.verdict == "explained" for one in plain
        ]),
        _at_least("two effects", "at least one", 0.98, [one.n_right > 0 for one in pairs]),
        _at_most("two effects", "false second effect", 0.05, [one.n_findings > 1 for one in single]),
    ]  # fmt: skip


def _fit(cases: Judgements) -> list[Bar]:
    known = [
        one
        for one in _group(cases, "linear", "nonlinear", "pair")
        if one.detected and not math.isnan(one.held_over_noise)
    ]
    claims = [one.held_over_noise <= 1.3 for one in known]
    return [_at_least("held out", "misfit on held-out blows at most 1.3 times the noise", 0.9, claims)]


def _points(cases: Judgements) -> list[Bar]:
    known = [case.points for case in cases if case.points]
    nominal, without, diagnosed = (
        [getattr(one, name) for one in known] for name in ("nominal", "without", "diagnosed")
    )
    worse = [one.diagnosed > 1.1 * one.without for one in known]
    group = "unmeasured points"
    return [
        *_times_below(group, "of the nominal model", 12.0, nominal, diagnosed),
        *_times_below(group, "without a diagnosis", 3.0, without, diagnosed),
        _at_most(group, "more than 10 % worse than without a diagnosis", 0.05, worse),
    ]


def _times_below(
    group: str, other: str, least: float, errors: Sequence[float], diagnosed: Sequence[float]
) -> list[Bar]:
    """How far errors with the diagnosis are below others: by their medians, and by the median of the ratios."""
    wanted = f"at least {least:.0f}"
    medians = [float(np.median(errors) / np.median(diagnosed))] if errors else []
    ratios = [error / mine for error, mine in zip(errors, diagnosed, strict=True)]
    return [
        _measured(group, f"median error {other} over that with the diagnosis", wanted, medians, lambda x: x >= least),
        _measured(group, f"error {other} over that with the diagnosis, median", wanted, ratios, lambda x: x >= least),
    ]


def _times(cases: Judgements) -> list[Bar]:
    result = []
    for group, most in (("linear", 10.0), ("nonlinear", 15.0)):
        times = [case.stage_s for case in cases if case.judgement.group == group]
        name, wanted = f"{group} case, from FRFs, median", f"at most {most:.0f} s"
        result.append(_measured("time", name, wanted, times, lambda value, most=most: value <= most))
    return result
