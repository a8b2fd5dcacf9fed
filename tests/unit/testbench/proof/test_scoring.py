"""Every bar counts what it says, passes at its limit and not beyond it."""

import math
from dataclasses import replace

import pytest
from numpy.testing import assert_allclose

from frf_testbench.proof.commands import Done
from frf_testbench.proof.judging import Judgement, ParameterScore
from frf_testbench.proof.points import PointErrors
from frf_testbench.proof.scoring import Scored, bars

EXACT = 1e-12  # relative: quotients of small numbers
RIGHT = Judgement(
    name="case_1",
    group="linear",
    structure="grid",
    true="added_mass",
    said="added_mass",
    verdict="explained",
    detected=True,
    right=True,
    first_right=True,
    place="exact",
    parameters=(ParameterScore(effect="added_mass", name="mass_kg", error=0.01, covered=True),),
    in_set=True,
    set_size=1,
    probability=1.0,
    detectable=True,
    decidable=True,
    n_right=1,
    n_findings=1,
    in_place_set=True,
    before=0.4,
    held_out=0.02,
    held_over_noise=1.2,
)
MISSED = replace(
    RIGHT, said="consistent", verdict="consistent", detected=False, right=False, first_right=False, place=None,
    parameters=(), in_set=False, set_size=0, probability=math.nan, n_right=0, n_findings=0, in_place_set=None,
)  # fmt: skip
WRONG = replace(
    RIGHT, said="local_damper", right=False, first_right=False, place=None, parameters=(), in_set=False, n_right=0,
    in_place_set=None,
)  # fmt: skip
NULL = replace(MISSED, group="null", true="nothing", detectable=None, decidable=None)
ALARM = replace(WRONG, group="null", true="nothing", detectable=None, decidable=None)
LAW = replace(RIGHT, group="nonlinear", true="gap_contact", said="gap_contact", detectable=None, decidable=None)
PAIR = replace(RIGHT, group="pair", true="two effects", n_right=2, n_findings=2, both_detectable=True, decidable=None)
FLAGGED = replace(
    MISSED, group="unknown", true="outside: skew", said="unexplained", verdict="unexplained", detected=True,
    detectable=None, decidable=None, substitute_nats=500.0,
)  # fmt: skip
NAMED = replace(FLAGGED, said="added_mass", verdict="explained", probability=0.95)
LAW_FLAGGED = replace(FLAGGED, true="outside: bouc_wen", substitute_nats=None, flagged_place="exact")
BESIDE = replace(LAW_FLAGGED, flagged_place="near")
NOISY = replace(RIGHT, held_over_noise=1.31)


def bar(group, name, *judgements):
    cases = [one if isinstance(one, Scored) else Scored(judgement=one) for one in judgements]
    (found,) = [one for one in bars(cases) if (one.group, one.name) == (group, name)]
    return found


@pytest.mark.parametrize(
    ("group", "name", "good", "bad", "least"),
    [
        ("linear", "effect named first, of those detected", RIGHT, WRONG, 19),
        ("linear", "effect named first, of those decidable", RIGHT, MISSED, 49),
        ("linear", "effect named first, of all", RIGHT, MISSED, 9),
        ("linear", "truth in the reported set, of those detected", RIGHT, WRONG, 99),
        ("linear", "detected, of those with over 100 nats", RIGHT, MISSED, 19),
        ("places", "exact, where the effect is right", RIGHT, replace(RIGHT, place="near"), 19),
        ("places", "exact, of those over 3 nats from any other place", RIGHT, replace(RIGHT, place="near"), 19),
        ("places", "within one node or element", replace(RIGHT, place="near"), replace(RIGHT, place="wrong"), 99),
        ("places", "true place among the possible ones said", RIGHT, replace(RIGHT, in_place_set=False), 49),
        ("outside the catalogue", "flagged, best substitute over 100 nats worse", FLAGGED, NAMED, 9),
        ("nonlinear", "law", LAW, replace(LAW, right=False), 19),
        ("nonlinear", "place", LAW, replace(LAW, place="near"), 19),
        ("nonlinear", "unknown law flagged with the right place", LAW_FLAGGED, BESIDE, 4),
        ("two effects", "both", PAIR, replace(PAIR, n_right=1), 3),
        ("two effects", "both, each with over 100 nats", PAIR, replace(PAIR, n_right=1), 3),
        ("two effects", "at least one", replace(PAIR, n_right=1), replace(PAIR, n_right=0), 49),
        ("held out", "misfit on held-out blows at most 1.3 times the noise", RIGHT, NOISY, 9),
    ],
)  # fmt: skip
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
        ("linear", "declared nonlinear", RIGHT, replace(WRONG, said="gap_contact"), 100),
        ("linear", "declared nonlinear", NULL, replace(ALARM, said="dry_friction"), 100),
        ("nulls", "false alarms", NULL, ALARM, 50),
        ("nulls", "false alarms", NULL, replace(ALARM, said="failed", verdict="failed", detected=False), 50),
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
    close = replace(FLAGGED, substitute_nats=99.0)
    assert bar("outside the catalogue", "flagged, best substitute over 100 nats worse", close).passes is None


def test_groups_do_not_mix():
    name = "effect named first, of those detected"
    assert bar("linear", name, RIGHT, ALARM, PAIR, LAW, NAMED).rate.count == 1
    assert bar("nulls", "false alarms", RIGHT, WRONG, NAMED).rate.count == 0


def test_what_does_not_apply_does_not_count():
    assert bar("linear", "effect named first, of those detected", RIGHT, MISSED).rate.count == 1
    assert bar("linear", "truth in the reported set, of those detected", RIGHT, MISSED).rate.count == 1
    assert (
        bar("linear", "effect named first, of those decidable", RIGHT, replace(WRONG, decidable=False)).rate.count == 1
    )
    assert (
        bar("linear", "detected, of those with over 100 nats", RIGHT, replace(MISSED, detectable=None)).rate.count == 1
    )
    assert bar("places", "exact, where the effect is right", RIGHT, replace(RIGHT, place=None), MISSED).rate.count == 1
    assert bar("two effects", "both, each with over 100 nats", replace(PAIR, both_detectable=False)).rate.count == 0


def test_the_upper_end_of_the_interval_of_false_alarms():
    assert bar("nulls", "upper end of its 95 % interval", *[NULL] * 60).passes is True  # 5.96 %
    assert bar("nulls", "upper end of its 95 % interval", *[NULL] * 59).passes is False  # 6.06 %


def test_errors_and_intervals_of_parameters():
    def case(error, *, covered=True, is_number=True):
        score = ParameterScore(effect="added_mass", name="x", error=error, covered=covered, is_number=is_number)
        return replace(RIGHT, parameters=(score,))

    cases = [case(0.01), case(0.02), case(0.04, covered=False), case(math.inf, covered=False, is_number=False)]
    assert bar("parameters", "median error", *cases).value == 0.02
    assert bar("parameters", "median error", *cases).passes is True
    assert bar("parameters", "median error", case(0.04), case(math.inf)).passes is False
    assert_allclose(bar("parameters", "95 % intervals cover", *cases).value, 2 / 3, rtol=EXACT)
    cover = [case(0.01)] * 18 + [case(0.01, covered=False)]
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
        return Scored(judgement=RIGHT, points=PointErrors(nominal=nominal, without=without, diagnosed=diagnosed))

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
    done = Done(status=0, message="", wall_s=99.0, cpu_s=99.0, code="x")
    cases = [Scored(judgement=RIGHT, done=done, stage_s=seconds) for seconds in (2.0, 9.0, 11.0, math.nan)]
    assert bar("time", "linear case, from FRFs, median", *cases).value == 9.0
    slow = [Scored(judgement=LAW, stage_s=16.0)]
    assert bar("time", "nonlinear case, from FRFs, median", *slow).passes is False


def test_a_place_that_nothing_tells_from_another_counts_among_all_places_only():
    cases = [Scored(judgement=one) for one in [RIGHT] * 19 + [replace(RIGHT, place="near", place_told=False)] * 2]
    values = {bar.name: bar.rate for bar in bars(cases) if bar.group == "places"}
    assert (values["exact, where the effect is right"].hits, values["exact, where the effect is right"].count) == (
        19,
        21,
    )
    assert values["exact, of those over 3 nats from any other place"].count == 19
