"""Two effects together, small ones beside large ones, and imitators."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from diagnosed import beam, labels, measured, observed, problem_of
from frf_ipz.diagnosis import diagnose as diagnosing
from frf_ipz.diagnosis.apply import correct_frfs, correct_model
from frf_ipz.diagnosis.catalogue.finder import shipped_effects
from frf_ipz.diagnosis.catalogue.joint_change import build_together
from frf_ipz.diagnosis.diagnose import diagnose
from frf_ipz.diagnosis.evidence.hypothesis import Component
from frf_ipz.diagnosis.evidence.inference_problem import InferenceProblem
from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.model.change import with_change
from frf_ipz.diagnosis.options import DiagnoseOptions
from frf_ipz.diagnosis.search import pair_search as pairs
from frf_ipz.diagnosis.search.component_search import (
    LOCATIONS_PER_EFFECT,
    N_SCORED,
    Ranking,
    _most_promising,
    fit_null_model,
    search_component,
    search_small_component,
)
from frf_ipz.diagnosis.search.pair_search import search_pair
from frf_ipz.diagnosis.search.robust_refinement import Start
from frf_ipz.diagnosis.search.score_tests import run_score_test
from frf_ipz.diagnosis.verdict.decision import decide
from frf_ipz.diagnosis.verdict.goodness import LIMITS, ODDS, assess_goodness, required_log_bayes_factor
from frf_ipz.diagnosis.verdict.out_of_catalogue import describe_implausibility
from frf_ipz.dofs import Dof
from frf_ipz.fe.beam_models import with_formulation
from frf_ipz.fe.changes import with_point_masses, with_springs
from frf_ipz.progress import silent

pytestmark = pytest.mark.slow

THICK_M, HIGH_HZ = 0.03, (60.0, 5000.0)  # shear and rotary inertia lower the highest mode there by some per cent
SOFTER = 0.9
SEEN = 0.02  # relative: noise of 0.1 % of the FRFs, tolerances of 0.1 % of the stiffness
WEAK_N_M = 45.0  # so little that the mass alone leaves nothing to explain
ROUNDING = 1e-9  # of the largest entry
ATTACHED = shipped_effects()["attached_resonator"]
LITTLE_KG = 2e-4
KNOWN_NOISE = 1.5  # times the expected squares of the misfit over a subband
LATE_S = 2e-5
SMALL_GAIN = 0.96  # tolerances of gains are half a per cent
GUESSED = np.array([0.04, 0.004, 0.03, 0.002])  # of modes that the model gives 1 %


@pytest.fixture(scope="module")
def nominal(tmp_path_factory):
    return beam(tmp_path_factory.mktemp("beam"))


@pytest.fixture(scope="module")
def thick(tmp_path_factory):
    return beam(tmp_path_factory.mktemp("thick"), thickness_m=THICK_M)


def test_a_delay_beside_a_soft_element_is_promised(nominal):
    """Static shapes of the element are in its fit: what a delay changes is not hidden behind what they change."""
    soft = problem_of(nominal, measured(nominal), ("local_stiffness",))
    effect = soft.effects["local_stiffness"]
    location = next(location for location in effect.locations(soft.context) if location.elements == (3, 3))
    true = with_change(nominal, effect.build(soft.context, location)(np.array([0.3])))
    frfs = measured(true, factors=lambda hz: np.stack([np.exp(-2j * np.pi * hz * LATE_S), np.ones_like(hz)], 1))
    problem = problem_of(nominal, frfs, ("local_stiffness", "time_delay"))
    base = problem.fit((Component(effect=effect, location=location, n_locations=16),), np.array([0.3]))
    promised = run_score_test(problem, base)[0]
    assert promised.component.effect.name == "time_delay"
    both = problem.fit((*base.hypothesis.components, promised.component), np.array([0.3, promised.values[0]]))
    assert both.values[1] == pytest.approx(LATE_S, rel=SEEN)


@pytest.mark.parametrize("order", [1, -1])
def test_what_changes_stiffness_changes_that_of_an_exchanged_model(thick, order):
    problem = problem_of(thick, measured(thick), ("shear_rotary_inertia", "global_stiffness"))
    acting = [(effect, effect.locations(problem.context)[0]) for effect in problem.effects.values()][::order]
    built = dict(zip([effect.name for effect, _ in acting], build_together(problem.context, acting), strict=True))
    change = built["global_stiffness"](np.array([SOFTER])).stiffness.toarray()
    exchanged = with_formulation(thick, "timoshenko").stiffness_all.toarray()
    assert_allclose(change, (SOFTER - 1) * exchanged, rtol=0, atol=ROUNDING * exchanged.max())
    assert built["shear_rotary_inertia"](np.zeros(0)).model is not None


def test_a_thick_beam_of_a_softer_material_is_found_and_put_right(thick):
    exchanged = with_formulation(thick, "timoshenko")
    true = replace(exchanged, stiffness_all=SOFTER * exchanged.stiffness_all)
    options = DiagnoseOptions(effects=("shear_rotary_inertia", "global_stiffness", "added_mass", "axial_load"))
    diagnosis = diagnose(observed(measured(true, band_hz=HIGH_HZ), HIGH_HZ), thick, options=options)
    assert diagnosis.verdict == "explained"
    assert {finding.effect for finding in diagnosis.findings} == {"shear_rotary_inertia", "global_stiffness"}
    (ratio,) = (finding.parameters["stiffness_ratio"].value for finding in diagnosis.findings if finding.parameters)
    assert ratio == pytest.approx(SOFTER, rel=SEEN)
    right = correct_model(diagnosis, thick).stiffness_all.diagonal()
    assert_allclose(right, true.stiffness_all.diagonal(), rtol=SEEN)


def test_a_wrong_sign_and_a_support_that_gives_way_are_found_together(tmp_path):
    held, released = beam(tmp_path, right="clamped"), beam(tmp_path, right="free")
    true = with_springs(released, {Dof(17, "z"): 3e4, Dof(17, "ry"): 1e9})
    names = labels(outputs=("12:+z", "9:-z"))
    frfs = measured(true, names, factors=lambda f: -np.ones((len(f), 2)))
    options = DiagnoseOptions(effects=("sensor_gain", "boundary_compliance", "added_mass", "global_stiffness"))
    diagnosis = diagnose(observed(frfs), held, options=options)
    assert diagnosis.verdict == "explained"
    assert {finding.effect for finding in diagnosis.findings} == {"sensor_gain", "boundary_compliance"}


def test_a_small_delay_is_found_though_the_misfit_is_large(nominal):
    def late(frequency_hz):
        return np.exp(-2j * np.pi * frequency_hz[:, None] * np.array([0.0, 3e-5]))

    problem = problem_of(nominal, measured(nominal, factors=late), ("time_delay", "added_mass", "local_damper"))
    null = fit_null_model(problem)
    assert null.misfit > 20 * null.n_values
    best = search_component(problem, null).best
    assert best.hypothesis.components[-1].key == ("time_delay", Location.on_channel("acc_2"))
    assert best.values[0] == pytest.approx(3e-5, rel=SEEN)


def test_a_small_effect_beside_one_that_explains_nearly_all_is_named(nominal, monkeypatch):
    true = with_springs(with_point_masses(nominal, {12: 0.02}), {Dof(8, "z"): WEAK_N_M})
    problem = problem_of(nominal, measured(true), ("added_mass", "grounded_spring", "sensor_gain"))
    assert [component.effect.name for component in decide(problem, silent).final.hypothesis.components] == [
        "added_mass"
    ]
    monkeypatch.setitem(LIMITS, "frf", replace(LIMITS["frf"], subband=KNOWN_NOISE))
    decision = decide(problem, silent)
    assert [component.effect.name for component in decision.final.hypothesis.components] == [
        "added_mass",
        "grounded_spring",
    ]
    assert decision.further_rankings[0].base.hypothesis.components[0].location == {"nodes": [12]}


@pytest.mark.parametrize(("part", "verdict"), [(0.95, "consistent"), (0.8, "explained")])
def test_what_a_good_model_leaves_in_its_worst_subband_raises_the_required_evidence(
    nominal, monkeypatch, part, verdict
):
    """Underestimated errors make something out of nothing: the subband is 1.13 times the expected misfit."""
    problem = problem_of(nominal, measured(with_point_masses(nominal, {12: 1.5 * LITTLE_KG})), ("added_mass",))
    null = fit_null_model(problem)
    gain = search_component(problem, null).best.log_evidence - null.log_evidence
    monkeypatch.setitem(LIMITS, "frf", replace(LIMITS["frf"], subband=part * gain / np.log(ODDS**2)))
    assert 1 / 0.95 < assess_goodness(problem, null).worst_subband < 1 / 0.8
    assert decide(problem, silent).verdict == verdict


def test_the_detectable_size_has_the_required_evidence(nominal, monkeypatch):
    frfs = measured(nominal)
    problem = problem_of(nominal, frfs, ("added_mass",))
    needed = required_log_bayes_factor(problem, assess_goodness(problem, fit_null_model(problem)))
    assert needed > LIMITS["frf"].subband * np.log(ODDS**2)
    monkeypatch.setattr(diagnosing, "find_detectable_sizes", lambda _bench, _null, nats: {"added_mass": {"nats": nats}})
    diagnosis = diagnose(observed(frfs), nominal, options=DiagnoseOptions(effects=("added_mass",)))
    assert diagnosis.detectability["added_mass"]["nats"] == pytest.approx(needed)


def test_neighbourhoods_are_searched_only_where_an_effect_explains_something(nominal):
    names = ("added_mass", "grounded_spring")
    nothing = problem_of(nominal, measured(nominal), names)
    assert len(search_component(nothing, fit_null_model(nothing)).fits) <= len(names) * LOCATIONS_PER_EFFECT
    heavier = problem_of(nominal, measured(with_point_masses(nominal, {12: 0.02})), names)
    keys = {fit.hypothesis.components[0].key for fit in search_component(heavier, fit_null_model(heavier)).fits}
    assert {("added_mass", Location.at_node(node, "z")) for node in (11, 12, 13)} <= keys


def test_no_second_effect_is_fitted_exactly_where_none_may_explain_the_rest(nominal, monkeypatch):
    """A spring that no effect of the list describes; with inflated errors, all leave nearly as much as one does."""
    true = with_springs(nominal, {Dof(8, "z"): 30 * WEAK_N_M})
    problem = problem_of(nominal, measured(true), ("sensor_gain", "time_delay", "damping_level"))
    first = search_component(problem, fit_null_model(problem)).best
    good_cost = assess_goodness(problem, first).good_cost(first.n_values)
    fitted, fit_exactly = [], InferenceProblem.fit_exactly

    def count(*given, **options):
        fitted.append(1)
        return fit_exactly(*given, **options)

    monkeypatch.setattr(InferenceProblem, "fit_exactly", count)
    beside = search_component(problem, first, good_cost=good_cost)
    n_fitted = len(fitted)
    every = search_component(problem, first)
    assert n_fitted < len(fitted) - n_fitted
    assert not assess_goodness(problem, every.best).is_good
    assert not assess_goodness(problem, beside.best).is_good


def test_nothing_is_added_to_an_effect_that_explains_all(nominal):
    problem = problem_of(nominal, measured(with_point_masses(nominal, {12: 0.02})), ("added_mass", "grounded_spring"))
    best = search_component(problem, fit_null_model(problem)).best
    beside = search_small_component(problem, best, np.log(ODDS * len(problem.effects)))
    assert beside.fits == ()
    assert beside.n_tried > 5


def test_damping_that_nothing_explains_does_not_hide_a_mass(nominal):
    true = replace(with_point_masses(nominal, {12: 0.02}), modal_damping=GUESSED)
    diagnosis = diagnose(
        observed(measured(true)), nominal, options=DiagnoseOptions(effects=("added_mass", "damping_level"))
    )
    assert diagnosis.verdict == "unexplained"
    assert "Damping ratios are as measured, and nothing missing" in diagnosis.statement
    assert "0.4 % at 99.88 Hz (model: 1 %)" in diagnosis.statement
    (finding,) = diagnosis.findings
    assert dict(finding.location) == {"nodes": [12]}
    assert finding.parameters["mass_kg"].value == pytest.approx(0.02, rel=SEEN)


def test_a_segment_of_usual_length_is_preferred_to_a_short_one_that_does_the_same(nominal):
    problem = problem_of(nominal, measured(nominal), ("local_stiffness",))
    effect = problem.effects["local_stiffness"]
    locations = {location.elements: location for location in effect.locations(problem.context)}
    likely = {length: effect.log_prior(problem.context, locations[1, length], np.array([0.9])) for length in (1, 2, 4)}
    assert likely[1] > likely[2] > likely[4]  # 4 % of 16 elements are less than one
    smaller = effect.log_prior(problem.context, locations[1, 1], np.array([0.95]))
    assert smaller == pytest.approx(likely[1] + np.log(2))


def with_components(problem, *named):
    components = []
    for name, node in named:
        effect = problem.effects[name]
        location = next(location for location in effect.locations(problem.context) if location.nodes == (node,))
        components.append(Component(effect=effect, location=location, n_locations=1))
    hypothesis = problem.make_hypothesis(tuple(components))
    return SimpleNamespace(hypothesis=hypothesis, values=hypothesis.to_physical((hypothesis.low + hypothesis.high) / 2))


@pytest.mark.parametrize(
    ("named", "expected"),
    [
        ((("attached_resonator", 9), ("attached_resonator", 9)), True),
        ((("local_damper", 3), ("local_damper", 14)), True),
        ((("attached_resonator", 9), ("local_damper", 3)), False),
        ((("attached_resonator", 9), ("added_mass", 9)), False),
        ((("added_mass", 9), ("local_damper", 4), ("viscoelastic_joint", 4)), True),
    ],
)
def test_two_dynamic_effects_of_one_kind_or_at_one_location_are_implausible(nominal, named, expected):
    names = ("attached_resonator", "local_damper", "added_mass", "viscoelastic_joint")
    assert (
        bool(describe_implausibility(with_components(problem_of(nominal, measured(nominal), names), *named)))
        is expected
    )


@pytest.mark.parametrize(("ratio", "reason"), [(0.05, ""), (0.3, "damping ratio of 30 %")])
def test_a_resonator_of_large_damping_is_implausible(nominal, ratio, reason):
    names = ("attached_resonator", "added_mass")
    fit = with_components(problem_of(nominal, measured(nominal), names), ("added_mass", 3), ("attached_resonator", 9))
    fit.values[-1] = ratio
    assert (reason in describe_implausibility(fit)) is True
    assert bool(describe_implausibility(fit)) is bool(reason)


def test_two_resonators_at_one_node_are_not_named(nominal):
    first, second = (Component(effect=ATTACHED, location=Location.at_node(17, "z"), n_locations=1),) * 2
    problem = problem_of(nominal, measured(nominal), ("attached_resonator",))
    hypothesis = problem.make_hypothesis((first, second))
    values, nuisance = np.array([0.02, 40.0, 0.03, 0.02, 250.0, 0.03]), np.zeros(problem.nuisance_prior.size)

    def chain(frequency_hz):
        s = 2j * np.pi * frequency_hz
        alone = problem.make_hypothesis(()).respond(np.zeros(0), nuisance, s).values
        return hypothesis.respond(values, nuisance, s).values / alone

    diagnosis = diagnose(
        observed(measured(nominal, factors=chain)), nominal, options=DiagnoseOptions(effects=(ATTACHED.name,))
    )
    assert diagnosis.verdict == "unexplained"
    assert "one thing of another kind" in diagnosis.statement
    assert [dict(finding.location) for finding in diagnosis.findings] == [{"nodes": [17]}] * 2


def test_all_sensors_may_be_late_together(nominal):
    frfs = measured(nominal, factors=lambda f: np.exp(-2j * np.pi * f[:, None] * np.full(2, 1.2e-3)))
    diagnosis = diagnose(observed(frfs), nominal, options=DiagnoseOptions(effects=("time_delay", "sensor_gain")))
    (finding,) = diagnosis.findings
    assert dict(finding.location) == {"channels": ["acc_1", "acc_2"]}
    assert finding.parameters["delay_s"].value == pytest.approx(1.2e-3, rel=SEEN)
    assert "All sensors together" in finding.statement
    early, true = correct_frfs(frfs, diagnosis).values, measured(nominal).values
    assert np.linalg.norm(early - true) < SEEN * np.linalg.norm(true)


def test_a_joint_at_a_pinned_end_is_tried_and_is_likelier_than_one_beside_it(tmp_path):
    model = beam(tmp_path, left="pinned", right="pinned")
    problem = problem_of(model, measured(model, labels(outputs=("12:+z", "9:-z"))), ("viscoelastic_joint",))
    effect, values = problem.effects["viscoelastic_joint"], np.array([100.0, 1e-3])
    locations = {location.end or location.node: location for location in effect.locations(problem.context)}
    beside = effect.neighbours(problem.context, locations[16])
    assert {location.end or location.node for location in beside} >= {15, "left", "right"}
    prior = {key: effect.log_prior(problem.context, location, values) for key, location in locations.items()}
    assert prior["right"] == pytest.approx(np.log(15 / 2))  # 15 nodes that move, two ends
    assert prior[16] == 0.0


def test_one_damping_ratio_far_beyond_its_tolerance_is_not_consistent(nominal):
    true = replace(nominal, modal_damping=np.array([0.01, 0.01, 0.0035, 0.01]))
    diagnosis = diagnose(
        observed(measured(true)), nominal, options=DiagnoseOptions(effects=("added_mass", "damping_level"))
    )
    assert diagnosis.verdict == "unexplained"
    assert "0.35 % at 287.1 Hz (model: 1 %)" in diagnosis.statement
    allowed = DiagnoseOptions(effects=("added_mass", "damping_level"), damping_tolerance=0.7)
    assert diagnose(observed(measured(true)), nominal, options=allowed).verdict == "consistent"


def test_a_level_that_alone_explains_is_significant_though_not_far_beyond_its_tolerance(nominal):
    true = replace(nominal, modal_damping=np.full(4, 0.0042))
    diagnosis = diagnose(
        observed(measured(true)), nominal, options=DiagnoseOptions(effects=("added_mass", "damping_level"))
    )
    assert diagnosis.verdict == "explained"
    assert [(finding.effect, finding.is_significant) for finding in diagnosis.findings] == [("damping_level", True)]


@pytest.mark.parametrize("ratio", [0.002, 0.03])
def test_a_level_far_from_the_stated_one_is_found_where_only_damping_is_wrong(nominal, ratio):
    problem = problem_of(nominal, measured(replace(nominal, modal_damping=np.full(4, ratio))), ("damping_level",))
    null = fit_null_model(problem)
    assert null.is_nearly_right
    assert search_component(problem, null).best.values[0] == pytest.approx(ratio, rel=SEEN)


def test_a_small_gain_is_not_taken_for_a_wrong_sign(nominal):
    frfs = measured(nominal, factors=lambda _: np.array([[SMALL_GAIN, 1.0]]))
    problem = problem_of(nominal, frfs, ("sensor_gain",))
    starts = run_score_test(problem, fit_null_model(problem))
    best = min(starts, key=lambda start: start.cost)
    assert best.component.location == Location.on_channel("acc_1")
    assert SMALL_GAIN < best.values[0] < 1  # tolerances take their part
    assert all(start.cost > 0 for start in starts if start.component.location.sign == -1)


@pytest.mark.slow
def test_a_pair_that_explains_all_is_compared_with_pairs_of_other_firsts(nominal):
    """A resonator stands for a mass and a spring as long as nothing stands beside it."""
    true = with_springs(with_point_masses(nominal, {12: 0.005}), {Dof(8, "z"): 3 * WEAK_N_M})
    problem = problem_of(nominal, measured(true), ("added_mass", "grounded_spring", "attached_resonator"))
    first = search_component(problem, fit_null_model(problem))
    assert first.best.hypothesis.components[0].effect.name == "attached_resonator"
    ranking = search_pair(problem, first, lambda _: True)
    assert [component.effect.name for component in ranking.best.hypothesis.components] == [
        "added_mass",
        "grounded_spring",
    ]


def test_a_resonator_of_much_damping_is_less_likely_than_a_damper_that_explains_as_much(nominal):
    values = [np.array([0.01, 100.0, ratio]) for ratio in (0.005, 0.05, 0.15, 0.4)]
    problem = problem_of(nominal, measured(nominal), ("attached_resonator",))
    location = ATTACHED.locations(problem.context)[0]
    little, usual, much, overdamped = (ATTACHED.log_prior(problem.context, location, start) for start in values)
    assert little == usual == 0
    assert -3 < much < -1  # nats: still easily named
    assert overdamped < -6


@pytest.mark.parametrize(("is_good", "count"), [(True, pairs.N_OTHERS), (False, pairs.N_OTHERS_INCOMPLETE)])
def test_more_firsts_are_tried_where_no_pair_explains_all(monkeypatch, is_good, count):
    tried = []
    monkeypatch.setattr(pairs, "search_component", lambda _, base, **__: Ranking(base=base, fits=(), n_tried=0))
    monkeypatch.setattr(
        pairs,
        "search_small_component",
        lambda _, base, __: tried.append(base) or Ranking(base=base, fits=(), n_tried=0),
    )
    monkeypatch.setattr(pairs, "_reposition", lambda _, ranking, __: ranking)
    fits = [one_of(f"effect_{number}", -number) for number in range(10)]
    search_pair(None, Ranking(base=fits[-1], fits=tuple(fits), n_tried=0), lambda _: is_good)
    assert tried == fits[1 : 1 + count]


@pytest.mark.parametrize(
    ("companion", "is_far_off", "is_located_anew"),
    [("a mass", False, True), ("a resonator", False, False), ("a resonator", True, True)],
)
def test_pairs_with_the_best_single_one_are_not_located_anew(monkeypatch, companion, is_far_off, is_located_anew):
    """What explains most beside that was searched already, unless it was far off."""

    def component(name, node):
        return SimpleNamespace(effect=SimpleNamespace(name=name), location=Location.at_node(node, "z"))

    def fit(*components, far=False):
        hypothesis = SimpleNamespace(components=components, key=tuple(one.effect.name for one in components))
        return SimpleNamespace(hypothesis=hypothesis, log_evidence=0.0, is_nearly_right=True, is_far_off=far)

    best = fit(component("a resonator", 7), far=is_far_off)
    other = fit(component("a spring", 3))
    pair = fit(other.hypothesis.components[0], component(companion, 8))
    located = []
    monkeypatch.setattr(pairs, "search_small_component", lambda *_: Ranking(base=other, fits=(pair,), n_tried=0))
    monkeypatch.setattr(pairs, "_reposition", lambda _, ranking, __: located.append(ranking) or ranking)
    pairs._search_other_firsts(None, Ranking(base=best, fits=(best, other), n_tried=0), best, 1, {})
    assert bool(located) == is_located_anew


def test_pairs_that_are_known_are_not_fitted_again(monkeypatch):
    """Of those beside the same component; what is found is known from there on."""

    def pair(first, second, log_evidence):
        components = SimpleNamespace(key=first), SimpleNamespace(key=second)
        hypothesis = SimpleNamespace(components=components, key=(first, second), counts=(1, 1))
        return SimpleNamespace(hypothesis=hypothesis, values=np.ones(2), log_evidence=log_evidence)

    best, beside, elsewhere, found = (
        pair("mass 3", "spring 7", -10.0),
        pair("mass 3", "spring 8", -30.0),
        pair("mass 4", "spring 9", -20.0),
        pair("mass 3", "spring 6", -25.0),
    )
    known = {fit.hypothesis.key: fit for fit in (beside, elsewhere)}

    def search(_problem, _base, fits):
        assert fits == {"spring 7": best, "spring 8": beside}
        fits["spring 6"] = found

    monkeypatch.setattr(pairs, "_evaluate_unfitted", lambda *_: None)
    monkeypatch.setattr(pairs, "search_neighbourhoods", search)
    assert sorted(fit.log_evidence for fit in pairs._step_last(None, best, known)) == [-30.0, -25.0, -10.0]
    assert sorted(fit.log_evidence for fit in known.values()) == [-30.0, -25.0, -20.0, -10.0]


def test_the_best_location_of_each_effect_is_fitted_before_second_ones():
    """A linear step promises a small part of what some effects explain."""
    promised = [
        (number, location, 100.0 - 12 * number - location / 10) for number in range(6) for location in (0, 10, 20)
    ]
    starts = [
        Start(component=a_component(number, location), values=np.ones(1), cost=-nats)
        for number, location, nats in promised
    ]
    chosen = [(start.component.effect.name, start.component.location.node) for start in _most_promising(starts, 45.0)]
    assert chosen[:5] == [(number, 0) for number in range(5)]  # the sixth promises less
    assert len(chosen) == N_SCORED - 1
    assert (4, 10) not in chosen


def a_component(name, location):
    return SimpleNamespace(effect=SimpleNamespace(name=name), location=Location.at_node(location, "z"))


def one_of(name, log_evidence):
    component = SimpleNamespace(effect=SimpleNamespace(name=name))
    flags = {"is_nearly_right": True, "explains_nearly_all": True, "is_far_off": False, "mean_misfit": 1.0}
    return SimpleNamespace(hypothesis=SimpleNamespace(components=(component,)), log_evidence=log_evidence, **flags)


def test_the_first_of_two_components_is_located_anew_beside_the_second(nominal):
    true = with_springs(with_point_masses(nominal, {12: 0.002}), {Dof(8, "z"): 3e3})
    problem, mass = problem_of(nominal, measured(true), ("grounded_spring",)), shipped_effects()["added_mass"]
    beside = next(location for location in mass.locations(problem.context) if location == {"nodes": [13]})
    wrong = problem.fit((Component(effect=mass, location=beside, n_locations=16),), np.array([0.002]))
    ranking = search_pair(problem, Ranking(base=fit_null_model(problem), fits=(wrong,), n_tried=1), lambda _: True)
    assert {(component.effect.name, component.location.node) for component in ranking.best.hypothesis.components} == {
        ("added_mass", 12),
        ("grounded_spring", 8),
    }
