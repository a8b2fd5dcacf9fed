"""Hand-made diagnoses against hand-made answers."""

import json
import math

import pytest
from numpy.testing import assert_allclose

from frf_testbench.proof.answers import FAILED, AnswerError, read_diagnosis, read_truth
from frf_testbench.proof.judging import is_wrong_name, judge, list_reported_effects
from frf_testbench.proof.locations import Layout

EXACT = 1e-12  # relative: quotients of decimal numbers
MASS = {"effect": "added_mass", "location": {"nodes": [12]}, "parameters": {"mass_kg": 0.02}}
DELAY = {"effect": "time_delay", "location": {"channels": ["acc_1"]}, "parameters": {"delay_s": 1e-4}}
LOW_PASS = {
    "effect": "sensor_dynamics",
    "location": {"channels": ["acc_1"]},
    "parameters": {"kind": "lowpass", "corner_hz": 1600.0},
}
SKEW = {"effect": "unknown", "unknown_kind": "skew", "location": {"nodes": [5, 49]}, "parameters": {"skew_Ns_m": 13.0}}
QUINTIC = {"effect": "unknown", "unknown_kind": "quintic_spring", "location": {"nodes": [7]}, "nonlinear": True}


@pytest.fixture
def truth(tmp_path):
    def write(*effects, **more):
        single = dict(effects[0]) if len(effects) == 1 else {"effect": "pair" if effects else "null"}
        path = tmp_path / "case_1.json"
        path.write_text(json.dumps(single | {"effects": effects} | more), encoding="utf-8")
        return read_truth(path)

    return write


@pytest.fixture
def diagnosis(tmp_path):
    def write(verdict, *findings, **more):
        path = tmp_path / "diagnosis.json"
        path.write_text(json.dumps({"verdict": verdict, "findings": findings} | more), encoding="utf-8")
        return read_diagnosis(path)

    return write


def finding(cause, *, probability=0.97, gain=800.0, std=0.05, **changes):
    said = {**cause, **changes}
    numbers = {
        name: value if isinstance(value, str) else {"value": value, "std": std * abs(value)}
        for name, value in said.get("parameters", {}).items()
    }
    return {
        "effect": said["effect"],
        "location": said["location"],
        "parameters": numbers,
        "probability": probability,
        "log_evidence_gain": gain,
    }


def test_the_right_effect_at_its_place(truth, diagnosis):
    said = diagnosis("explained", finding(MASS, parameters={"mass_kg": 0.0205}, std=0.02))
    one = judge(truth(MASS), said, Layout())
    assert (one.group, one.true_label, one.stated_label) == ("linear", "added_mass", "added_mass")
    assert one.is_detected
    assert one.is_right
    assert one.location_match == "exact"
    assert one.is_in_reported_set
    assert one.n_reported == 1
    assert one.n_right == one.n_findings == 1
    (score,) = one.parameters
    assert_allclose(score.error, 0.025, rtol=EXACT)
    assert score.is_covered  # 0.0205 - 1.96 * 0.00041 < 0.02


def test_an_interval_that_misses_does_not_cover(truth, diagnosis):
    said = diagnosis("explained", finding(MASS, parameters={"mass_kg": 0.0205}, std=0.01))
    assert not judge(truth(MASS), said, Layout()).parameters[0].is_covered


@pytest.mark.parametrize(
    ("interval", "covered"),
    [
        ([0.019, 0.021], True),
        ([0.0201, 0.021], False),
        ([0.019, None], True),
        ([None, 0.021], True),
        ([None, 0.019], False),
    ],
)
def test_an_interval_that_is_given_counts_and_may_be_open(truth, diagnosis, interval, covered):
    number = {"value": 0.0205, "std": 0.0, "ci95": interval}
    said = diagnosis("explained", finding(MASS) | {"parameters": {"mass_kg": number}})
    assert judge(truth(MASS), said, Layout()).parameters[0].is_covered is covered


def test_a_wrong_name_is_not_right(truth, diagnosis):
    one = judge(truth(MASS), diagnosis("explained", finding(DELAY)), Layout())
    assert one.is_detected
    assert not one.is_right
    assert not one.is_in_reported_set
    assert one.parameters == ()
    assert one.stated_label == "time_delay"


def test_a_right_name_under_another_verdict_is_not_right(truth, diagnosis):
    one = judge(truth(MASS), diagnosis("unexplained", finding(MASS)), Layout())
    assert one.is_detected
    assert not one.is_right
    assert one.first_is_right
    assert one.stated_label == "unexplained"


def test_an_effect_that_is_not_detected(truth, diagnosis):
    one = judge(truth(MASS), diagnosis("consistent"), Layout())
    assert not one.is_detected
    assert not one.is_right
    assert one.stated_label == "consistent"


def test_no_diagnosis_no_detection_and_no_consistency(truth):
    for one in (judge(truth(MASS), FAILED, Layout()), judge(truth(), FAILED, Layout())):
        assert not one.is_detected
        assert not one.is_right
        assert one.verdict == one.stated_label == "failed"


def test_a_wrong_place_has_no_parameters(truth, diagnosis):
    one = judge(truth(MASS), diagnosis("explained", finding(MASS, location={"nodes": [13]})), Layout())
    assert one.is_right
    assert one.location_match == "near"
    assert one.parameters == ()


def test_places_that_are_said_to_be_possible(truth, diagnosis):
    said = finding(MASS, location={"nodes": [13]}) | {"location_set": [{"nodes": [13]}, {"nodes": [12]}]}
    assert judge(truth(MASS), diagnosis("explained", said), Layout()).is_in_location_set is True
    said["location_set"] = [{"nodes": [13]}]
    assert judge(truth(MASS), diagnosis("explained", said), Layout()).is_in_location_set is False
    assert judge(truth(MASS), diagnosis("explained", finding(MASS)), Layout()).is_in_location_set is None


def test_equivalent_answers_are_right_at_their_place(truth, diagnosis):
    answer = truth(DELAY, equivalents=[LOW_PASS])
    one = judge(answer, diagnosis("explained", finding(LOW_PASS)), Layout())
    assert one.is_right
    assert one.is_in_reported_set
    assert one.location_match == "exact"
    assert {score.name: score.error for score in one.parameters} == {"kind": 0.0, "corner_hz": 0.0}
    elsewhere = finding(LOW_PASS, location={"channels": ["acc_2"]})
    assert not judge(answer, diagnosis("explained", elsewhere), Layout()).is_right


def test_a_wrong_word_and_a_missing_number_count_as_infinitely_wrong(truth, diagnosis):
    said = diagnosis("explained", finding(LOW_PASS, parameters={"kind": "highpass"}))
    scores = {score.name: score for score in judge(truth(LOW_PASS), said, Layout()).parameters}
    assert scores["kind"].error == scores["corner_hz"].error == math.inf
    assert not scores["kind"].is_number
    assert scores["corner_hz"].is_number
    assert not scores["corner_hz"].is_covered


def test_one_stiffness_of_a_support_is_enough(truth, diagnosis):
    both = {"rotational_stiffness_Nm_rad": 4e4, "translational_stiffness_N_m": 4e7}
    clamp = {"effect": "boundary_compliance", "location": {"end": "right", "nodes": [9]}, "parameters": both}
    said = finding(clamp, parameters={"rotational_stiffness_Nm_rad": 4e4})
    scores = judge(truth(clamp), diagnosis("explained", said), Layout()).parameters
    assert [score.name for score in scores] == ["rotational_stiffness_Nm_rad"]
    scores = judge(truth(clamp), diagnosis("explained", finding(clamp, parameters={})), Layout()).parameters
    assert [score.error for score in scores] == [math.inf, math.inf]


def test_the_reported_set_is_what_lies_within_five_nats(truth, diagnosis):
    near, far = finding(DELAY, gain=796.0), finding(LOW_PASS, gain=794.0)
    said = diagnosis("explained", finding(MASS), alternatives=[near, far])
    assert list_reported_effects(said) == {"added_mass", "time_delay"}
    assert judge(truth(DELAY), said, Layout()).is_in_reported_set
    assert not judge(truth(LOW_PASS), said, Layout()).is_in_reported_set
    told = diagnosis("explained", finding(MASS), ambiguity=[{"effects": ["added_mass", "sensor_dynamics"]}])
    assert list_reported_effects(told) == {"added_mass", "sensor_dynamics"}
    told = diagnosis("explained", finding(MASS), ambiguity=[{"effects": ["time_delay", "sensor_dynamics"]}])
    assert list_reported_effects(told) == {"added_mass"}


def test_what_is_insignificant_is_no_finding(truth, diagnosis):
    one = judge(truth(MASS), diagnosis("explained", finding(MASS), finding(DELAY) | {"significant": False}), Layout())
    assert one.n_findings == 1


@pytest.mark.parametrize(
    ("evidence", "separation", "equivalents", "detectable", "decidable"),
    [
        (301.0, 15.1, [], True, True),
        (301.0, None, [], True, True),
        (299.0, 15.1, [], True, False),
        (301.0, 14.9, [], True, False),
        (99.0, 15.1, [], False, False),
        (301.0, 15.1, [LOW_PASS], True, False),
    ],
)
def test_what_can_be_detected_and_decided(truth, evidence, separation, equivalents, detectable, decidable):
    shown = {"evidence_nats": evidence, "separation_nats": separation}
    one = judge(truth(DELAY, detectability=shown, equivalents=equivalents), FAILED, Layout())
    assert (one.is_detectable, one.is_decidable) == (detectable, decidable)


@pytest.mark.parametrize(("nats", "told"), [(2.9, False), (3.1, True), (None, True)])
def test_which_places_are_told_apart(truth, nats, told):
    assert (
        judge(truth(DELAY, detectability={"place_separation_nats": nats}), FAILED, Layout()).location_is_decidable
        is told
    )


def test_answers_that_say_nothing_of_evidence_decide_nothing(truth):
    one = judge(truth(DELAY, detectability={"frf_change": 0.3}), FAILED, Layout())
    assert (one.is_detectable, one.is_decidable) == (None, None)


def test_two_effects_in_any_order(truth, diagnosis):
    answer = truth(MASS, DELAY, detectability={"each": [{"evidence_nats": 5e3}, {"evidence_nats": 99.0}]})
    one = judge(answer, diagnosis("explained", finding(DELAY), finding(MASS)), Layout())
    assert one.group == "pair"
    assert one.is_right
    assert (one.n_right, one.n_right_exact, one.n_findings) == (2, 2, 2)
    assert one.both_are_detectable is False
    one = judge(answer, diagnosis("explained", finding(MASS, location={"nodes": [1]}), finding(LOW_PASS)), Layout())
    assert (one.n_right, one.n_right_exact) == (1, 0)


def test_the_same_effect_twice_counts_once(truth, diagnosis):
    one = judge(truth(MASS, DELAY), diagnosis("explained", finding(MASS), finding(MASS)), Layout())
    assert one.n_right == 1


def test_what_is_outside_the_catalogue(truth, diagnosis):
    answer = truth(SKEW, detectability={"evidence_nats": 1e4, "separation_nats": 2e3})
    flagged = judge(answer, diagnosis("unexplained", finding(DELAY)), Layout())
    assert flagged.group == "unknown"
    assert flagged.true_label == "outside: skew"
    assert flagged.alternative_separation == 2e3
    assert flagged.mismatch_location_match is None  # it is linear
    assert not is_wrong_name(flagged)
    assert not judge(answer, diagnosis("explained", finding(SKEW)), Layout()).is_right  # "unknown" names nothing
    assert is_wrong_name(judge(answer, diagnosis("explained", finding(MASS, probability=0.95)), Layout()))
    assert not is_wrong_name(judge(answer, diagnosis("explained", finding(MASS, probability=0.6)), Layout()))


def test_an_unknown_law_and_its_place(truth, diagnosis):
    place = {"mismatch": {"location": {"nodes": [8]}}}
    assert judge(truth(QUINTIC), diagnosis("unexplained"), Layout()).mismatch_location_match == "wrong"
    assert judge(truth(QUINTIC), diagnosis("unexplained", **place), Layout()).mismatch_location_match == "near"
    said = diagnosis("unexplained", finding(MASS, location={"nodes": [7]}), **place)
    assert judge(truth(QUINTIC), said, Layout()).mismatch_location_match == "exact"


def test_answers_of_practice_cases(tmp_path):
    path = tmp_path / "case_03.json"
    friction = {"effect": "dry_friction", "unknown_kind": None, "location": {"nodes": [3]}, "equivalents": []}
    path.write_text(json.dumps(friction | {"parameters": {"friction_N": 0.184}}), encoding="utf-8")
    assert read_truth(path).group == "nonlinear"
    path.write_text(json.dumps({"effect": "null", "location": {}, "parameters": {}}), encoding="utf-8")
    assert read_truth(path).group == "null"
    path.write_text(json.dumps({"effect": "unknown", "unknown_kind": "skew", "location": {}}), encoding="utf-8")
    assert read_truth(path).kind == "skew"


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '{"verdict": "maybe"}', '{"verdict": "explained", "findings": [{"location": {}}]}']
)
def test_what_is_no_diagnosis_refused(tmp_path, text):
    path = tmp_path / "diagnosis.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(AnswerError, match=r"diagnosis\.json"):
        read_diagnosis(path)
