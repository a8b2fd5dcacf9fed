"""What the search rests on: bounds of tolerances, exact modes, steps to places, several causes."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from diagnosed import BAND_HZ, beam, labels, measured, observed
from frf_ipz.diagnosis.catalogue.finder import shipped_effects
from frf_ipz.diagnosis.diagnose import diagnose
from frf_ipz.diagnosis.evidence.hypothesis import Cause
from frf_ipz.diagnosis.evidence.inference_problem import set_up
from frf_ipz.diagnosis.measured.data_split import split_data
from frf_ipz.diagnosis.measured.transfer_functions import FAINT, find_faint_frfs, raise_faint_sizes
from frf_ipz.diagnosis.model.basis import solved
from frf_ipz.diagnosis.model.change import Change, with_change
from frf_ipz.diagnosis.model.modes import modify, scatter
from frf_ipz.diagnosis.options import DiagnoseOptions
from frf_ipz.diagnosis.search import component_search as search
from frf_ipz.diagnosis.search import neighbourhood_search as climb
from frf_ipz.diagnosis.search.component_search import by_effect, fit_nothing
from frf_ipz.diagnosis.search.robust_refinement import Start
from frf_ipz.diagnosis.verdict.findings import Weighed, finding_of, weigh
from frf_ipz.diagnosis.verdict.goodness import goodness
from frf_ipz.diagnosis.verdict.mismatch import trace
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


def bench_of(model, frfs, names=FEW):
    effects = {name: effect for name, effect in shipped_effects().items() if name in names}
    return set_up(model, split_data(observed(frfs)), BAND_HZ, DiagnoseOptions(), effects)


@pytest.fixture(scope="module")
def bench(nominal):
    return bench_of(nominal, measured(nominal))


def test_inside_a_tolerance_the_prior_is_normal(bench):
    values = np.resize(INSIDE, bench.nuisance.size)
    pulls, slopes = bench.nuisance.pulls(values)
    assert_allclose(pulls, values, rtol=0)
    assert_allclose(slopes, 1.0, rtol=0)


def test_far_outside_a_tolerance_the_prior_rises_faster_but_not_for_shapes(bench):
    nuisance, far = bench.nuisance, np.full(bench.nuisance.size, -5.0)
    pulls, slopes = nuisance.pulls(far)
    bounded = np.zeros(nuisance.size, bool)
    bounded[[nuisance.frequency_places[0], nuisance.damping_places[0], nuisance.gain_places[0]]] = True
    assert (pulls[bounded] < 2 * far[bounded]).all()
    across = np.flatnonzero(nuisance.pairs[0] != nuisance.pairs[1])
    assert_allclose(pulls[across], far[across], rtol=0)
    beyond, _ = nuisance.pulls(far + STEP)
    assert_allclose((beyond - pulls) / STEP, slopes, rtol=SAME)
    assert_allclose(nuisance.pulls(far, is_bounded=False)[0], far, rtol=0)


def test_a_frequency_far_outside_its_tolerance_is_no_tolerance(nominal):
    found = diagnose(nominal, observed(measured(with_point_masses(nominal, {17: 4e-4}))), DiagnoseOptions(effects=FEW))
    assert found.verdict == "explained"
    assert found.numbers["evidence_gain_nats"] > 100
    assert found.findings[0].effect == "added_mass"


def test_low_modes_keep_their_digits_beside_static_shapes_of_high_frequency():
    sizes = np.array([1.0, 1e4, 1e6, 1e8])
    stiffness = (0.5 * np.eye(4) + 0.5) * np.outer(sizes, sizes)
    flexibility = (2 * np.eye(4) - 0.4) / np.outer(sizes, sizes)
    basis = SimpleNamespace(stiffness=stiffness, modes=SimpleNamespace(shift=0.1))
    squares, vectors = solved(basis, Change())
    assert squares[0] == pytest.approx(1 / np.linalg.eigvalsh(flexibility)[-1], rel=DIGITS)
    assert_allclose(np.linalg.norm(vectors, axis=0), 1.0, rtol=DIGITS)


def test_an_unstable_structure_has_modes_too(bench):
    basis, nuisance = bench.specimen.basis, bench.nuisance
    hypothesis = bench.suppose(())
    softer = Change(stiffness=-1.5 * basis.model.stiffness_all)
    modes = scatter(basis, modify(basis, softer), hypothesis.rows, nuisance.unpack(np.zeros(nuisance.size)))
    assert modes.squares.min() < 0
    assert np.isfinite(modes.vectors).all()


def test_a_misfit_is_traced_to_its_node(nominal):
    bench = bench_of(nominal, measured(with_springs(nominal, {parse_dof("8:z"): 8e3})))
    assert trace(bench, fit_nothing(bench)) == {"nodes": [8]}


def test_one_frf_tells_no_node_from_another(nominal):
    bench = bench_of(nominal, measured(with_point_masses(nominal, {12: 0.02}), labels(outputs=("17:+z",))))
    assert trace(bench, fit_nothing(bench)) == {}


def test_where_nothing_is_wrong_nothing_is_traced(nominal):
    found = diagnose(nominal, observed(measured(nominal)), DiagnoseOptions(effects=FEW))
    assert found.to_json()["mismatch"]["location"] == {}


def test_what_was_found_says_where_the_mismatch_is(nominal):
    found = diagnose(nominal, observed(measured(with_point_masses(nominal, {12: 0.02}))), DiagnoseOptions(effects=FEW))
    assert found.to_json()["mismatch"]["location"] == {"nodes": [12]}


def test_a_frequency_beyond_the_tolerances_is_not_explained(nominal):
    inside, beyond = (fit_nothing(bench_of(nominal, measured(nominal))) for _ in range(2))
    bench = bench_of(nominal, measured(nominal))
    first = bench.nuisance.frequency_places[bench.nuisance.is_stated][0]
    beyond.unknown[first] = 2.6
    assert goodness(bench, inside).is_good
    assert not goodness(bench, beyond).is_good
    assert goodness(bench, beyond).detuned == pytest.approx(2.6)


def test_three_causes_are_found_at_once(nominal):
    changed = with_springs(with_point_masses(nominal, {12: 0.02}), {parse_dof("6:z"): 6e3})
    gain = np.array([1.0, 1.06])
    frfs = measured(changed, factors=lambda frequency: np.ones((len(frequency), 1)) * gain)
    found = diagnose(nominal, observed(frfs), DiagnoseOptions(effects=FEW))
    assert found.verdict == "explained"
    assert {finding.effect for finding in found.findings} == set(FEW)
    assert all(finding.log_evidence_gain > 50 for finding in found.findings)


def test_both_ends_of_a_spring_move_at_once(nominal):
    bench = bench_of(nominal, measured(nominal), ("coupling_spring",))
    effect = bench.effects["coupling_spring"]
    place = next(place for place in effect.places(bench.specimen) if place.key == (5, 12, "z"))
    beside = {other.key[:2] for other in effect.neighbours(bench.specimen, place)}
    assert {(4, 13), (6, 11), (4, 11), (6, 13)} <= beside
    at_the_end = next(place for place in effect.places(bench.specimen) if place.key == (5, 17, "z"))
    assert all(max(other.key[:2]) <= 17 for other in effect.neighbours(bench.specimen, at_the_end))


def with_coupling(model, pair, stiffness):
    specimen = bench_of(model, measured(model), ("coupling_spring",)).specimen
    effect = shipped_effects()["coupling_spring"]
    place = next(place for place in effect.places(specimen) if place.key[:2] == pair)
    return with_change(model, effect.build(specimen, place)(np.array([stiffness])))


def test_the_ends_of_a_spring_are_looked_for_further_around(nominal):
    effect = shipped_effects()["coupling_spring"]
    bench = bench_of(nominal, measured(with_coupling(nominal, (6, 13), 2e4)), (effect.name,))
    places = {place.key[:2]: place for place in effect.places(bench.specimen)}
    assert places[6, 13].key in {other.key for other in effect.around(bench.specimen, places[3, 14])}
    cause = Cause(effect=effect, place=places[3, 14], n_places=100)
    found = climb.further_around(bench, (cause,), np.array([2e4]))
    assert found[0][0][-1].place.location == {"nodes": [6, 13]}
    assert found[0][1] == pytest.approx(2e4, rel=0.05)


def test_where_nothing_far_off_fits_places_around_are_tried(nominal, monkeypatch):
    effect = shipped_effects()["coupling_spring"]
    bench = bench_of(nominal, measured(with_coupling(nominal, (6, 13), 2e4)), (effect.name,))
    wrong = next(place for place in effect.places(bench.specimen) if place.key[:2] == (3, 14))
    start = Start(cause=Cause(effect=effect, place=wrong, n_places=100), values=np.array([2e4]), cost=1.0)
    monkeypatch.setattr(search, "bring_closer", lambda _bench, starts: starts)
    fits = search._fitted(bench, fit_nothing(bench), [start])
    best = max(fits.values(), key=lambda fit: fit.log_evidence)
    assert best.hypothesis.causes[-1].place.location == {"nodes": [6, 13]}


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


def fit_of(name, evidence, value, std, place):
    effect = SimpleNamespace(
        name=name, reported=lambda _place, _name, value: value, statement=lambda *_: "", imitators=()
    )
    cause = SimpleNamespace(effect=effect, place=SimpleNamespace(location={"nodes": [place]}, text={}, key=(place,)))
    parameter = SimpleNamespace(name="mass_kg", is_log=True, low=1e-4, high=1.0, tolerance=0.0)
    hypothesis = SimpleNamespace(
        causes=(cause,), counts=(1,), parameters=(parameter,), specimen=None,
        low=np.log([1e-4]), high=np.log([1.0]), start_at=np.log,
    )  # fmt: skip
    return SimpleNamespace(
        hypothesis=hypothesis, values=np.array([value]), covariance=np.array([[std**2]]), log_evidence=evidence
    )


def test_an_effect_is_as_probable_as_all_its_places():
    one = fit_of("grounded_spring", 10.0, 0.1, 0.01, 1)
    others = [fit_of("added_mass", 9.5, 0.1, 0.01, place) for place in (3, 4, 5)]
    groups = by_effect([one, *others])
    assert [group[0].hypothesis.causes[-1].effect.name for group in groups] == ["added_mass", "grounded_spring"]
    first, second = weigh([one, *others], 1.0)
    assert first.name == "added_mass"
    assert first.probability == pytest.approx(3 * np.exp(-0.5) / (1 + 3 * np.exp(-0.5)))
    assert first.probability + second.probability == pytest.approx(1.0)


def test_an_interval_spans_the_places_that_are_possible():
    fits = tuple(fit_of("added_mass", 9.5, value, 0.01, place) for place, value in ((3, 0.1), (4, 0.2)))
    known = Weighed(fits=fits, probability=1.0, shares=(1.0, 0.0))
    unknown = Weighed(fits=fits, probability=1.0, shares=(0.6, 0.4))
    narrow, wide = (finding_of(one, 100.0, 1.0).parameters["mass_kg"] for one in (known, unknown))
    assert narrow.high < 0.11
    assert wide.low < 0.1
    assert wide.high > 0.2
