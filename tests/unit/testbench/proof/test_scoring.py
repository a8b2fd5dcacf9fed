"""Every bar counts what it says, passes at its limit and not beyond it."""

import math
from dataclasses import replace

import pytest
from numpy.testing import assert_allclose

from frf_testbench.proof.commands import CommandOutcome
from frf_testbench.proof.judging import Judgement, ParameterScore
from frf_testbench.proof.points import PointErrors
from frf_testbench.proof.scoring import ScoredCase, score_bars

EXACT = 1e-12  # relative: quotients of small numbers
RIGHT = Judgement(
    name="case_1",
    group="linear",
    structure="grid",
    true_label="added_mass",
    stated_label="added_mass",
    verdict="explained",
    is_detected=True,
    is_right=True,
    first_is_right=True,
    location_match="exact",
    parameters=(ParameterScore(effect="added_mass", name="mass_kg", error=0.01, is_covered=True),),
    is_in_reported_set=True,
    n_reported=1,
    probability=1.0,
    is_detectable=True,
    is_decidable=True,
    n_right=1,
    n_findings=1,
    is_in_location_set=True,
    held_out_before=0.4,
    held_out_after=0.02,
    held_out_over_noise=1.2,
)
MISSED = replace(
    RIGHT,
    stated_label="consistent",
    verdict="consistent",
    is_detected=False,
    is_right=False,
    first_is_right=False,
    location_match=None,
    parameters=(),
    is_in_reported_set=False,
    n_reported=0,
    probability=math.nan,
    n_right=0,
    n_findings=0,
    is_in_location_set=None,
)
WRONG = replace(
    RIGHT,
    stated_label="local_damper",
    is_right=False,
    first_is_right=False,
    location_match=None,
    parameters=(),
    is_in_reported_set=False,
    n_right=0,
    is_in_location_set=None,
)
NULL = replace(MISSED, group="null", true_label="nothing", is_detectable=None, is_decidable=None)
ALARM = replace(WRONG, group="null", true_label="nothing", is_detectable=None, is_decidable=None)
LAW = replace(
    RIGHT,
    group="nonlinear",
    true_label="gap_contact",
    stated_label="gap_contact",
    is_detectable=None,
    is_decidable=None,
)
PAIR = replace(
    RIGHT, group="pair", true_label="two effects", n_right=2, n_findings=2, both_are_detectable=True, is_decidable=None
)
FLAGGED = replace(
    MISSED,
    group="unknown",
    true_label="outside: skew",
    stated_label="unexplained",
    verdict="unexplained",
    is_detected=True,
    is_detectable=None,
    is_decidable=None,
    alternative_separation=500.0,
)
NAMED = replace(FLAGGED, stated_label="added_mass", verdict="explained", probability=0.95)
LAW_FLAGGED = replace(
    FLAGGED, true_label="outside: bouc_wen", alternative_separation=None, mismatch_location_match="exact"
)
BESIDE = replace(LAW_FLAGGED, mismatch_location_match="near")
NOISY = replace(RIGHT, held_out_over_noise=1.31)


def bar(group, name, *judgements):
    cases = [one if isinstance(one, ScoredCase) else ScoredCase(judgement=one) for one in judgements]
    (found,) = [one for one in score_bars(cases) if (one.group, one.name) == (group, name)]
    return found


@pytest.mark.parametrize(
    ("group", "name", "good", "bad", "least"),
    [
        ("linear", "effect named first, of those detected", RIGHT, WRONG, 19),
        ("linear", "effect named first, of those decidable", RIGHT, MISSED, 49),
        ("linear", "effect named first, of all", RIGHT, MISSED, 9),
        ("linear", "truth in the reported set, of those detected", RIGHT, WRONG, 99),
        ("linear", "detected, of those with a log Bayes factor over 100", RIGHT, MISSED, 19),
        ("locations", "exact, where the effect is right", RIGHT, replace(RIGHT, location_match="near"), 19),
        (
            "locations",
            "exact, of those with a log Bayes factor over 3 over any other location",
            RIGHT,
            replace(RIGHT, location_match="near"),
            19,
        ),
        (
            "locations",
            "within one node or element",
            replace(RIGHT, location_match="near"),
            replace(RIGHT, location_match="wrong"),
            99,
        ),
        (
            "locations",
            "true location among those stated as possible",
            RIGHT,
            replace(RIGHT, is_in_location_set=False),
            49,
        ),
        (
            "outside the catalogue",
            "flagged, of those with a log Bayes factor over 100 over the best alternative",
            FLAGGED,
            NAMED,
            9,
        ),
        ("nonlinear", "law", LAW, replace(LAW, is_right=False), 19),
        ("nonlinear", "location", LAW, replace(LAW, location_match="near"), 19),
        ("nonlinear", "unknown law flagged with the right location", LAW_FLAGGED, BESIDE, 4),
        ("two effects", "both", PAIR, replace(PAIR, n_right=1), 3),
        ("two effects", "both, each with a log Bayes factor over 100", PAIR, replace(PAIR, n_right=1), 3),
        ("two effects", "at least one", replace(PAIR, n_right=1), replace(PAIR, n_right=0), 49),
        ("held out", "misfit on held-out records at most 1.3 times the noise", RIGHT, NOISY, 9),
    ],
)
def test_a_bar_passes_with_enough_good_cases_and_not_with_one_less(group, name, good, bad, least):
    reached = bar(group, name, *[good] * least, bad)
    assert (reached.rate.hits, reached.rate.count) == (least, least + 1)
    assert reached.passes is True
    missed = bar(group, name, *[good] * (least - 1), bad)
    assert missed.passes is False
    assert bar(group, name).passes is None


@pytest.mark.parametrize(
    ("group", "name", "good", "bad", "count"),
    [
        ("linear", "declared nonlinear", RIGHT, replace(WRONG, stated_label="gap_contact"), 100),
        ("linear", "declared nonlinear", NULL, replace(ALARM, stated_label="dry_friction"), 100),
        ("nulls", "false alarms", NULL, ALARM, 50),
        ("nulls", "false alarms", NULL, replace(ALARM, stated_label="failed", verdict="failed", is_detected=False), 50),
        ("outside the catalogue", "confident wrong names", FLAGGED, NAMED, 10),
        ("two effects", "false second effect", RIGHT, replace(RIGHT, n_findings=2), 20),
    ],
)
def test_a_bar_allows_a_few_bad_cases_and_not_one_more(group, name, good, bad, count):
    allowed = bar(group, name, *[good] * (count - 1), bad)
    assert (allowed.rate.hits, allowed.rate.count) == (1, count)
    assert allowed.passes is True
    assert bar(group, name, *[good] * (count - 2), bad).passes is False


def test_what_is_outside_is_flagged_in_seven_of_ten():
    assert bar("outside the catalogue", "flagged", *[FLAGGED] * 7, *[NAMED] * 3).passes is True
    assert bar("outside the catalogue", "flagged", *[FLAGGED] * 6, *[NAMED] * 3).passes is False
    close = replace(FLAGGED, alternative_separation=99.0)
    assert (
        bar(
            "outside the catalogue",
            "flagged, of those with a log Bayes factor over 100 over the best alternative",
            close,
        ).passes
        is None
    )


def test_groups_do_not_mix():
    name = "effect named first, of those detected"
    assert bar("linear", name, RIGHT, ALARM, PAIR, LAW, NAMED).rate.count == 1
    assert bar("nulls", "false alarms", RIGHT, WRONG, NAMED).rate.count == 0


def test_what_does_not_apply_does_not_count():
    assert bar("linear", "effect named first, of those detected", RIGHT, MISSED).rate.count == 1
    assert bar("linear", "truth in the reported set, of those detected", RIGHT, MISSED).rate.count == 1
    assert (
        bar("linear", "effect named first, of those decidable", RIGHT, replace(WRONG, is_decidable=False)).rate.count
        == 1
    )
    assert (
        bar(
            "linear", "detected, of those with a log Bayes factor over 100", RIGHT, replace(MISSED, is_detectable=None)
        ).rate.count
        == 1
    )
    assert (
        bar(
            "locations", "exact, where the effect is right", RIGHT, replace(RIGHT, location_match=None), MISSED
        ).rate.count
        == 1
    )
    assert (
        bar(
            "two effects", "both, each with a log Bayes factor over 100", replace(PAIR, both_are_detectable=False)
        ).rate.count
        == 0
    )


def test_the_upper_end_of_the_interval_of_false_alarms():
    assert bar("nulls", "upper end of its 95 % interval", *[NULL] * 60).passes is True  # 5.96 %
    assert bar("nulls", "upper end of its 95 % interval", *[NULL] * 59).passes is False  # 6.06 %


def test_errors_and_intervals_of_parameters():
    def case(error, *, is_covered=True, is_number=True):
        score = ParameterScore(effect="added_mass", name="x", error=error, is_covered=is_covered, is_number=is_number)
        return replace(RIGHT, parameters=(score,))

    cases = [case(0.01), case(0.02), case(0.04, is_covered=False), case(math.inf, is_covered=False, is_number=False)]
    assert bar("parameters", "median error", *cases).value == 0.02
    assert bar("parameters", "median error", *cases).passes is True
    assert bar("parameters", "median error", case(0.04), case(math.inf)).passes is False
    assert_allclose(bar("parameters", "95 % intervals cover", *cases).value, 2 / 3, rtol=EXACT)
    cover = [case(0.01)] * 18 + [case(0.01, is_covered=False)]
    assert bar("parameters", "95 % intervals cover", *cover).passes is True
    assert bar("parameters", "95 % intervals cover", *[case(0.01)] * 60).passes is False  # too wide is wrong as well
    assert bar("parameters", "words (high-pass or low-pass)", *cases).rate.count == 1
    assert bar("parameters", "median error", replace(WRONG, parameters=cases[0].parameters)).passes is None


def test_probabilities_are_held_against_what_is_right():
    name = "probability of the effect named first: expected calibration error"
    honest = [replace(RIGHT, probability=0.95)] * 19 + [replace(WRONG, probability=0.95)]
    assert bar("linear", name, *honest).passes is True
    boasting = [replace(RIGHT, probability=1.0)] * 18 + [replace(WRONG, probability=1.0)] * 2
    assert_allclose(bar("linear", name, *boasting).value, 0.1, rtol=EXACT)
    assert bar("linear", name, *boasting).passes is False
    assert bar("linear", name, MISSED).passes is None


def test_points_of_interest():
    def case(nominal, without, diagnosed):
        return ScoredCase(judgement=RIGHT, points=PointErrors(nominal=nominal, without=without, diagnosed=diagnosed))

    cases = [case(0.6, 0.16, 0.05), case(0.66, 0.14, 0.02), case(1.0, 0.09, 0.1)]
    group = "unmeasured points"
    for other, medians, ratios in (("of the nominal model", 13.2, 12.0), ("without a diagnosis", 2.8, 3.2)):
        found = bar(group, f"median error {other} over that with the diagnosis", *cases)
        assert_allclose(found.value, medians, rtol=EXACT)
        found = bar(group, f"error {other} over that with the diagnosis, median", *cases)
        assert_allclose(found.value, ratios, rtol=EXACT)
    worse = bar(group, "more than 10 % worse than without a diagnosis", *cases)
    assert (worse.rate.hits, worse.rate.count) == (1, 3)


def test_times_are_those_of_the_stage():
    done = CommandOutcome(status=0, message="", wall_s=99.0, cpu_s=99.0, code="x")
    cases = [ScoredCase(judgement=RIGHT, outcome=done, stage_s=seconds) for seconds in (2.0, 9.0, 11.0, math.nan)]
    assert bar("time", "linear case, from FRFs, median", *cases).value == 9.0
    slow = [ScoredCase(judgement=LAW, stage_s=16.0)]
    assert bar("time", "nonlinear case, from FRFs, median", *slow).passes is False


def test_a_place_that_nothing_tells_from_another_counts_among_all_places_only():
    cases = [
        ScoredCase(judgement=one)
        for one in [RIGHT] * 19 + [replace(RIGHT, location_match="near", location_is_decidable=False)] * 2
    ]
    values = {bar.name: bar.rate for bar in score_bars(cases) if bar.group == "locations"}
    assert (values["exact, where the effect is right"].hits, values["exact, where the effect is right"].count) == (
        19,
        21,
    )
    assert values["exact, of those with a log Bayes factor over 3 over any other location"].count == 19
