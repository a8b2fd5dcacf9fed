"""How much a second effect must explain to be accepted."""

from types import SimpleNamespace

import numpy as np
import pytest

from frf_ipz.diagnosis.search.component_search import Ranking
from frf_ipz.diagnosis.verdict import decision
from frf_ipz.diagnosis.verdict.goodness import LIMITS, required_log_bayes_factor

ALONE = -577.0  # nats
N_KINDS = 18


def a_fit(log_evidence, name="local_stiffness"):
    component = SimpleNamespace(effect=SimpleNamespace(name=name))
    return SimpleNamespace(
        hypothesis=SimpleNamespace(components=(component,)), log_evidence=log_evidence, cost=-log_evidence, n_values=100
    )


def goodness_of(score, underrated=1.0, kind="hammer"):
    return SimpleNamespace(
        is_good=score <= 1,
        score=score,
        error_underestimation=underrated,
        limits=LIMITS[kind],
        misfit=0.5,
        good_cost=lambda n_values: 0.5 * n_values,
    )


def problem_of_kind(kind):
    return SimpleNamespace(kind=kind, effects=dict.fromkeys(range(N_KINDS)))


def found(score):
    first = a_fit(ALONE, "boundary_compliance")
    return decision.Decision(
        verdict="explained",
        null=a_fit(-1e6, ""),
        final=first,
        ranking=Ranking(base=first, fits=(first,), n_tried=1),
        further_rankings=(),
        goodness=goodness_of(score),
        null_goodness=goodness_of(9.0),
    )


@pytest.mark.parametrize("kind", LIMITS)
def test_what_a_component_needs_is_computed_from_odds_and_kinds(kind):
    """One of 18 kinds, twenty to one; where nothing is left, also twenty to one that there is no more."""
    problem, times = problem_of_kind(kind), LIMITS[kind].subband
    for base, odds in ((1.1, 20 * N_KINDS), (0.8, 20 * 20 * N_KINDS)):
        needed = required_log_bayes_factor(problem, goodness_of(base, kind=kind), goodness_of(0.5, kind=kind))
        assert needed == pytest.approx(times * np.log(odds))
    assert LIMITS[kind].decisive_log_bayes_factor == pytest.approx(times * np.log(20))
    partly = required_log_bayes_factor(problem, goodness_of(9.0, kind=kind), goodness_of(3.0, kind=kind))
    assert partly == pytest.approx(times * np.log(20 * N_KINDS))


@pytest.mark.parametrize(
    ("score", "gain", "n_locations", "verdict"),
    [
        (1.1, 21.0, 1, None),
        (1.1, 21.5, 1, "explained"),
        (1.1, 20.0, 4, "explained"),
        (0.8, 29.7, 1, None),
        (0.8, 33.0, 1, "explained"),
    ],
)
def test_a_second_component_needs_stated_odds_at_any_location(monkeypatch, score, gain, n_locations, verdict):
    """Errors may be 3.6 times as large over a subband: so many times ln(18 * 20), and ln 20 where nothing is left."""
    monkeypatch.setattr(decision, "assess_goodness", lambda *_: goodness_of(0.5))
    first = found(score)
    second = Ranking(base=first.final, fits=tuple(a_fit(ALONE + gain) for _ in range(n_locations)), n_tried=9)
    pair = decision._accept_further(problem_of_kind("hammer"), first, second)
    assert (pair and pair.verdict) == verdict


@pytest.mark.parametrize(
    ("kind", "gain", "verdict"),
    [
        ("hammer", 20.0, "unexplained"),
        ("hammer", 22.0, "explained"),
        ("frf", 37.0, "unexplained"),
        ("frf", 40.0, "explained"),
    ],
)
def test_what_explains_next_to_nothing_is_no_explanation(monkeypatch, kind, gain, verdict):
    """The nominal model leaves a little too much, and an effect a little less."""
    null, best = a_fit(ALONE, ""), a_fit(ALONE + gain, "attached_resonator")
    best.explains_nearly_all = True
    monkeypatch.setattr(decision, "fit_null_model", lambda _: null)
    monkeypatch.setattr(
        decision, "assess_goodness", lambda _, fit: goodness_of(1.01 if fit is null else 0.7, kind=kind)
    )
    monkeypatch.setattr(decision, "search_component", lambda *_, **__: Ranking(base=null, fits=(best,), n_tried=1))
    monkeypatch.setattr(decision, "rescore_ambiguity_set", lambda _, ranking: ranking)
    monkeypatch.setattr(decision, "search_small_component", lambda *_: Ranking(base=best, fits=(), n_tried=1))
    decided = decision.decide(problem_of_kind(kind), lambda *_: None)
    assert decided.verdict == verdict
    assert decided.final is (best if verdict == "explained" else null)


@pytest.mark.parametrize(("underestimation", "verdict"), [(1.0, "explained"), (1.7, "consistent")])
def test_what_an_effect_leaves_in_a_subband_shows_whether_errors_are_underestimated(
    monkeypatch, underestimation, verdict
):
    """A resonance that the nominal model lacks is a subband of one FRF; errors of the data stay beside any effect."""
    null, best = a_fit(ALONE, ""), a_fit(ALONE + 36.0, "attached_resonator")
    best.explains_nearly_all = True
    monkeypatch.setattr(decision, "fit_null_model", lambda _: null)
    monkeypatch.setattr(
        decision, "assess_goodness", lambda _, fit: goodness_of(0.5, 1.7 if fit is null else underestimation)
    )
    monkeypatch.setattr(decision, "search_component", lambda *_, **__: Ranking(base=null, fits=(best,), n_tried=1))
    monkeypatch.setattr(decision, "rescore_ambiguity_set", lambda _, ranking: ranking)
    monkeypatch.setattr(decision, "is_significant", lambda *_: True)
    monkeypatch.setattr(decision, "search_small_component", lambda *_: Ranking(base=best, fits=(), n_tried=1))
    assert decision.decide(problem_of_kind("hammer"), lambda *_: None).verdict == verdict


@pytest.mark.parametrize(("cost", "required"), [(150.0, 200.0), (9000.0, 8950.0)])
def test_a_third_component_is_searched_for_only_as_far_as_it_may_leave_nothing(monkeypatch, cost, required):
    """It is refused otherwise: what it has to promise is what the two lack."""
    first, asked = found(9.0), []
    pair = a_fit(ALONE + 1000.0)
    pair.cost, pair.is_nearly_right = cost, True
    second = Ranking(base=first.final, fits=(pair,), n_tried=9)
    monkeypatch.setattr(decision, "assess_goodness", lambda _, fit: goodness_of(2.0 if fit is pair else 9.0))
    monkeypatch.setattr(decision, "search_component", lambda *_, **__: first.ranking)
    monkeypatch.setattr(decision, "_judge_first", lambda *_: first)
    monkeypatch.setattr(decision, "_search_pair", lambda *_: second)
    monkeypatch.setattr(decision, "_drop_needless", lambda *_: None)
    first.final.explains_nearly_all = False

    def search(_, base, nats):
        asked.append(nats)
        return Ranking(base=base, fits=(), n_tried=1)

    monkeypatch.setattr(decision, "search_small_component", search)
    list(decision._decide_in_steps(problem_of_kind("hammer"), found(9.0), lambda *_: None))
    assert asked == [pytest.approx(required)]


@pytest.mark.parametrize(("score", "n_components"), [(0.7, 1), (0.8, 2)])
def test_an_effect_that_needs_much_nuisance_gives_way_to_two(monkeypatch, score, n_components):
    """A joint may stand for a resonator and a damper, with a large nuisance chi2."""
    first = found(score)
    pair = a_fit(ALONE + 33.0)
    pair.hypothesis.components *= 2
    monkeypatch.setattr(decision, "assess_goodness", lambda *_: goodness_of(0.5))
    nothing, tied = (Ranking(base=first.final, fits=fits, n_tried=9) for fits in ((), (a_fit(ALONE - 1.0),)))
    settled = Ranking(base=first.final, fits=(pair,), n_tried=9)
    monkeypatch.setattr(decision, "rescore_ambiguity_set", lambda _, ranking: settled if ranking is tied else ranking)
    monkeypatch.setattr(decision, "search_small_component", lambda *_: nothing)
    monkeypatch.setattr(decision, "search_pair", lambda *_: tied)
    assert len(decision._accept_first(problem_of_kind("hammer"), first).final.hypothesis.components) == n_components
