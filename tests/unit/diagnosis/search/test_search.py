"""What the search rests on: bounds of tolerances, exact modes, steps to locations, several effects."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from diagnosed import BAND_HZ, beam, labels, measured, observed
from frf_ipz.diagnosis.catalogue.finder import shipped_effects
from frf_ipz.diagnosis.diagnose import diagnose
from frf_ipz.diagnosis.evidence.hypothesis import Component
from frf_ipz.diagnosis.evidence.inference_problem import compute_weights, pose_problem
from frf_ipz.diagnosis.evidence.map_fit import fit_map
from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.measured.data_split import split_data
from frf_ipz.diagnosis.measured.transfer_functions import FAINT, find_faint_frfs, raise_faint_sizes
from frf_ipz.diagnosis.model.basis import solve_modes
from frf_ipz.diagnosis.model.change import Change, with_change
from frf_ipz.diagnosis.model.modes import modify_structure, scatter_modes
from frf_ipz.diagnosis.options import DiagnoseOptions
from frf_ipz.diagnosis.search import component_search as search
from frf_ipz.diagnosis.search import neighbourhood_search as climb
from frf_ipz.diagnosis.search.component_search import fit_null_model, group_by_effect
from frf_ipz.diagnosis.search.global_scan import SCAN_ERROR, find_best_start, scan_globally
from frf_ipz.diagnosis.search.robust_refinement import Start
from frf_ipz.diagnosis.verdict.findings import RankedEffect, make_finding, rank_effects
from frf_ipz.diagnosis.verdict.goodness import assess_goodness
from frf_ipz.diagnosis.verdict.mismatch import localise_mismatch
from frf_ipz.dofs import parse_dof
from frf_ipz.fe.changes import with_point_masses, with_springs

FEW = ("added_mass", "grounded_spring", "sensor_gain")
STEP = 1e-6
DIGITS = 1e-12  # relative, of a square far below the largest: solved directly, it has fewer digits
SAME = 1e-6  # relative, of a slope by differences
INSIDE = np.array([-1.9, 0.0, 1.5])


@pytest.fixture(scope="module")
def nominal(tmp_path_factory):
    return beam(tmp_path_factory.mktemp("beam"))


def problem_of(model, frfs, names=FEW):
    effects = {name: effect for name, effect in shipped_effects().items() if name in names}
    return pose_problem(model, split_data(observed(frfs)), BAND_HZ, DiagnoseOptions(), effects)


@pytest.fixture(scope="module")
def problem(nominal):
    return problem_of(nominal, measured(nominal))


def test_inside_a_tolerance_the_prior_is_normal(problem):
    values = np.resize(INSIDE, problem.nuisance_prior.size)
    whitened_nuisance, slopes = problem.nuisance_prior.whiten(values)
    assert_allclose(whitened_nuisance, values, rtol=0)
    assert_allclose(slopes, 1.0, rtol=0)


def test_far_outside_a_tolerance_the_prior_rises_faster_but_not_for_shapes(problem):
    nuisance_prior, far = problem.nuisance_prior, np.full(problem.nuisance_prior.size, -5.0)
    whitened_nuisance, slopes = nuisance_prior.whiten(far)
    bounded = np.zeros(nuisance_prior.size, bool)
    bounded[
        [nuisance_prior.frequency_indices[0], nuisance_prior.damping_indices[0], nuisance_prior.gain_indices[0]]
    ] = True
    assert (whitened_nuisance[bounded] < 2 * far[bounded]).all()
    across = np.flatnonzero(nuisance_prior.pairs[0] != nuisance_prior.pairs[1])
    assert_allclose(whitened_nuisance[across], far[across], rtol=0)
    beyond, _ = nuisance_prior.whiten(far + STEP)
    assert_allclose((beyond - whitened_nuisance) / STEP, slopes, rtol=SAME)
    assert_allclose(nuisance_prior.whiten(far, is_bounded=False)[0], far, rtol=0)


def test_a_frequency_far_outside_its_tolerance_is_not_consistent(nominal):
    diagnosis = diagnose(
        observed(measured(with_point_masses(nominal, {17: 4e-4}))), nominal, options=DiagnoseOptions(effects=FEW)
    )
    assert diagnosis.verdict == "explained"
    assert diagnosis.numbers["log_bayes_factor"] > 100
    assert diagnosis.findings[0].effect == "added_mass"


def test_low_modes_keep_their_digits_beside_static_shapes_of_high_frequency():
    sizes = np.array([1.0, 1e4, 1e6, 1e8])
    stiffness = (0.5 * np.eye(4) + 0.5) * np.outer(sizes, sizes)
    flexibility = (2 * np.eye(4) - 0.4) / np.outer(sizes, sizes)
    squares, vectors = solve_modes(stiffness, np.eye(4), shift=0.1)
    assert squares[0] == pytest.approx(1 / np.linalg.eigvalsh(flexibility)[-1], rel=DIGITS)
    assert_allclose(np.linalg.norm(vectors, axis=0), 1.0, rtol=DIGITS)


def test_an_unstable_structure_has_modes_too(problem):
    basis, nuisance_prior = problem.context.basis, problem.nuisance_prior
    hypothesis = problem.make_hypothesis(())
    softer = Change(stiffness=-1.5 * basis.model.stiffness_all)
    modes = scatter_modes(
        basis, modify_structure(basis, softer), hypothesis.rows, nuisance_prior.unpack(np.zeros(nuisance_prior.size))
    )
    assert modes.squares.min() < 0
    assert np.isfinite(modes.vectors).all()


def test_a_misfit_is_localised_at_its_node(nominal):
    problem = problem_of(nominal, measured(with_springs(nominal, {parse_dof("8:z"): 8e3})))
    assert localise_mismatch(problem, fit_null_model(problem)) == {"nodes": [8]}


def test_one_frf_tells_no_node_from_another(nominal):
    problem = problem_of(nominal, measured(with_point_masses(nominal, {12: 0.02}), labels(outputs=("17:+z",))))
    assert localise_mismatch(problem, fit_null_model(problem)) == {}


def test_where_nothing_is_wrong_nothing_is_localised(nominal):
    diagnosis = diagnose(observed(measured(nominal)), nominal, options=DiagnoseOptions(effects=FEW))
    assert diagnosis.to_json()["mismatch"]["location"] == {}


def test_what_was_found_says_where_the_mismatch_is(nominal):
    diagnosis = diagnose(
        observed(measured(with_point_masses(nominal, {12: 0.02}))), nominal, options=DiagnoseOptions(effects=FEW)
    )
    assert diagnosis.to_json()["mismatch"]["location"] == {"nodes": [12]}


def test_a_frequency_beyond_the_tolerances_is_not_explained(nominal):
    inside, beyond = (fit_null_model(problem_of(nominal, measured(nominal))) for _ in range(2))
    problem = problem_of(nominal, measured(nominal))
    first = problem.nuisance_prior.frequency_indices[problem.nuisance_prior.is_stated][0]
    beyond.nuisance[first] = 2.6
    assert assess_goodness(problem, inside).is_good
    assert not assess_goodness(problem, beyond).is_good
    assert assess_goodness(problem, beyond).frequency_deviation == pytest.approx(2.6)


def test_all_wrong_places_of_a_sensor_in_one_product_are_those_that_are_evaluated_one_by_one(nominal):
    """What a scan costs a sensor elsewhere is what that hypothesis's own FRFs cost."""
    problem = problem_of(nominal, measured(with_point_masses(nominal, {12: 0.02})), ("sensor_misplaced",))
    null = problem.make_hypothesis(())
    base = fit_map(null, problem.rough_data, np.zeros(0), iterations=0)
    starts = scan_globally(problem, base)
    assert {start.component.location.channel for start in starts} == {
        channel for channel, _ in problem.context.layout.outputs
    }
    weights, nuisance = compute_weights(problem.coarse, SCAN_ERROR), np.zeros(problem.nuisance_prior.size)
    for start in starts[::5]:
        alone = find_best_start(problem, base, start.component, problem.coarse, weights, nuisance)
        assert start.cost == pytest.approx(alone.cost, rel=DIGITS)


@pytest.mark.slow
def test_three_effects_are_found_at_once(nominal):
    changed = with_springs(with_point_masses(nominal, {12: 0.02}), {parse_dof("6:z"): 6e3})
    gain = np.array([1.0, 1.06])
    frfs = measured(changed, factors=lambda frequency: np.ones((len(frequency), 1)) * gain)
    diagnosis = diagnose(observed(frfs), nominal, options=DiagnoseOptions(effects=FEW))
    assert diagnosis.verdict == "explained"
    assert {finding.effect for finding in diagnosis.findings} == set(FEW)
    assert all(finding.log_evidence_gain > 50 for finding in diagnosis.findings)


def test_both_ends_of_a_spring_move_at_once(nominal):
    problem = problem_of(nominal, measured(nominal), ("coupling_spring",))
    effect = problem.effects["coupling_spring"]
    location = next(location for location in effect.locations(problem.context) if location.nodes == (5, 12))
    beside = {neighbour.nodes for neighbour in effect.neighbours(problem.context, location)}
    assert {(4, 13), (6, 11), (4, 11), (6, 13)} <= beside
    at_the_end = next(location for location in effect.locations(problem.context) if location.nodes == (5, 17))
    assert all(max(neighbour.nodes) <= 17 for neighbour in effect.neighbours(problem.context, at_the_end))


def with_coupling(model, pair, stiffness):
    context = problem_of(model, measured(model), ("coupling_spring",)).context
    effect = shipped_effects()["coupling_spring"]
    location = next(location for location in effect.locations(context) if location.nodes == pair)
    return with_change(model, effect.build(context, location)(np.array([stiffness])))


def test_the_ends_of_a_spring_are_searched_further_around(nominal):
    effect = shipped_effects()["coupling_spring"]
    problem = problem_of(nominal, measured(with_coupling(nominal, (6, 13), 2e4)), (effect.name,))
    locations = {location.nodes: location for location in effect.locations(problem.context)}
    assert locations[6, 13] in effect.surroundings(problem.context, locations[3, 14])
    component = Component(effect=effect, location=locations[3, 14], n_locations=100)
    refined = climb.refine_surroundings(problem, (component,), np.array([2e4]))
    assert refined[0][0][-1].location.nodes == (6, 13)
    assert refined[0][1] == pytest.approx(2e4, rel=0.05)


def test_where_no_start_fits_its_surroundings_are_tried(nominal, monkeypatch):
    effect = shipped_effects()["coupling_spring"]
    problem = problem_of(nominal, measured(with_coupling(nominal, (6, 13), 2e4)), (effect.name,))
    wrong = next(location for location in effect.locations(problem.context) if location.nodes == (3, 14))
    start = Start(component=Component(effect=effect, location=wrong, n_locations=100), values=np.array([2e4]), cost=1.0)
    monkeypatch.setattr(search, "refine_halfway", lambda _bench, starts: starts)
    fits = {}
    search._fit_starts(problem, fit_null_model(problem), [start], np.inf, fits)
    best = max(fits.values(), key=lambda fit: fit.log_evidence)
    assert best.hypothesis.components[-1].location.nodes == (6, 13)


def test_faint_frfs_are_known_no_better_than_the_large_ones(nominal):
    data = split_data(observed(measured(nominal))).training
    faint = raise_faint_sizes(replace(data, size=data.size * np.array([1.0, 1e-9])))
    assert_allclose(faint.size[:, 0], data.size[:, 0], rtol=0)
    assert_allclose(faint.size[:, 1], FAINT * data.size[:, 0], rtol=SAME)
    assert_allclose(raise_faint_sizes(data).size, data.size, rtol=0)


def test_faint_frfs_are_named(nominal):
    data = split_data(observed(measured(nominal))).training
    assert not find_faint_frfs(data)
    faint = replace(data, values=data.values * np.array([1.0, 1e-3]))
    assert find_faint_frfs(faint) == data.labels[1:2] == find_faint_frfs(raise_faint_sizes(faint))


def fit_of(name, evidence, value, std, location):
    effect = SimpleNamespace(
        name=name,
        report_value=lambda _make_location, _name, value: value,
        statement=lambda *_: "",
        texts=lambda _location: {},
    )
    component = SimpleNamespace(effect=effect, location=Location.at_node(location))
    parameter = SimpleNamespace(name="mass_kg", is_log=True, low=1e-4, high=1.0, tolerance=0.0)
    hypothesis = SimpleNamespace(
        components=(component,), counts=(1,), parameters=(parameter,), context=None,
        low=np.log([1e-4]), high=np.log([1.0]), clip_to_searched=np.log,
    )  # fmt: skip
    return SimpleNamespace(
        hypothesis=hypothesis, values=np.array([value]), covariance=np.array([[std**2]]), log_evidence=evidence
    )


def test_an_effect_is_as_probable_as_all_its_locations():
    spring = fit_of("grounded_spring", 10.0, 0.1, 0.01, 1)
    masses = [fit_of("added_mass", 9.5, 0.1, 0.01, location) for location in (3, 4, 5)]
    groups = group_by_effect([spring, *masses])
    assert [group[0].hypothesis.components[-1].effect.name for group in groups] == ["added_mass", "grounded_spring"]
    first, second = rank_effects([spring, *masses], 1.0)
    assert first.name == "added_mass"
    assert first.probability == pytest.approx(3 * np.exp(-0.5) / (1 + 3 * np.exp(-0.5)))
    assert first.probability + second.probability == pytest.approx(1.0)


def test_an_interval_spans_the_possible_locations():
    fits = tuple(fit_of("added_mass", 9.5, value, 0.01, location) for location, value in ((3, 0.1), (4, 0.2)))
    known = RankedEffect(fits=fits, probability=1.0, shares=(1.0, 0.0))
    nuisance = RankedEffect(fits=fits, probability=1.0, shares=(0.6, 0.4))
    narrow, wide = (make_finding(effect, 100.0, 1.0).parameters["mass_kg"] for effect in (known, nuisance))
    assert narrow.high < 0.11
    assert wide.low < 0.1
    assert wide.high > 0.2
