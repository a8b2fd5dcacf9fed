"""A law beside a linear effect, which goes into the model or out of the recordings before the law is searched."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from diagnosed import beam, measured, observed, problem_of
from frf_ipz.diagnosis import diagnose
from frf_ipz.diagnosis.catalogue.finder import shipped_effects
from frf_ipz.diagnosis.measured.preprocessing.chain_effects import undo_chain_effects
from frf_ipz.diagnosis.model.change import Change, with_change
from frf_ipz.diagnosis.nonlinear.fitting.simple_laws import SimpleLawsFit
from frf_ipz.diagnosis.observations import Observations, ObservedRecord, Sensor
from frf_ipz.diagnosis.search.component_search import search_component
from frf_ipz.diagnosis.verdict import law_and_linear as law_beside
from frf_ipz.diagnosis.verdict.decision import decide_without_search
from frf_ipz.diagnosis.verdict.law_and_linear import search_beside_law, search_beside_linear
from frf_ipz.dofs import Dof, parse_dof
from frf_ipz.fe.changes import with_point_masses
from frf_ipz.quantities import FrfQuantity

ATTACHED = shipped_effects()["attached_resonator"]
MASS_KG = 0.02
SEEN = 0.02  # relative: noise of 0.1 % of the FRFs
RATE_HZ, SAMPLES = 2000.0, 3000
LATE_S, GAIN = 1.3e-4, 0.8  # a quarter of a sample, and a gain
WRAPPED = 1e-6  # of the largest value: the end of a record that has died out


@pytest.fixture(scope="module")
def nominal(tmp_path_factory):
    return beam(tmp_path_factory.mktemp("beam"))


def a_law(verdict, nuisance_chi2=0.0, unknown_force=None):
    return SimpleNamespace(verdict=verdict, nuisance_chi2=nuisance_chi2, fit=object(), unknown_force=unknown_force)


class Laws:
    """Stands for the search for a law, and remembers what it was given."""

    def __init__(self, verdict, nuisance_chi2=0.0):
        self.law, self.given = a_law(verdict, nuisance_chi2), []

    def __call__(self, model, observations):
        self.given.append((model, observations))
        return self.law


def beside(model, frfs, names, laws, *, alone=0.0, linear=decide_without_search):
    """Search; without a linear effect the nuisance chi2 of a law is `alone`."""
    problem = problem_of(model, frfs, names)
    return search_beside_linear(problem, linear(problem), a_law("unexplained", alone), model, observed(frfs), laws)


def test_a_linear_effect_goes_into_the_model_before_the_law_is_searched(nominal):
    frfs = measured(with_point_masses(nominal, {12: MASS_KG}))
    laws = Laws("explained")
    pair = beside(nominal, frfs, ("added_mass",), laws)
    (changed_model, _), (law, component) = laws.given[0], pair
    location = nominal.full_index(Dof(12, "z"))
    added = changed_model.mass_all.toarray()[location, location] - nominal.mass_all.toarray()[location, location]
    assert added == pytest.approx(MASS_KG, rel=SEEN)
    assert law.verdict == "explained"
    assert (component.effect, dict(component.location)) == ("added_mass", {"nodes": [12]})


def test_without_a_law_nothing_is_named(nominal):
    frfs = measured(with_point_masses(nominal, {12: MASS_KG}))
    laws = Laws("unexplained")
    assert beside(nominal, frfs, ("added_mass",), laws) is None
    assert len(laws.given) == 1


@pytest.mark.parametrize(
    ("alone", "with_it", "is_named"), [(50.0, 5.0, True), (50.0, 12.0, False), (12.0, 7.0, False), (5.0, 1.0, False)]
)
def test_an_effect_that_relieves_a_strained_model_is_named_beside_a_law_that_does_not_explain(
    nominal, alone, with_it, is_named
):
    frfs = measured(with_point_masses(nominal, {12: MASS_KG}))
    pair = beside(nominal, frfs, ("added_mass",), Laws("unexplained", with_it), alone=alone)
    assert (pair is not None) == is_named
    if is_named:
        assert pair[0].verdict == "unexplained"
        assert pair[1].effect == "added_mass"


@pytest.mark.parametrize(
    ("misfit", "nuisance_chi2", "is_searched"), [(0.5, 2.0, False), (0.5, 30.0, True), (2.0, 2.0, True)]
)
def test_nothing_is_searched_beside_a_force_of_unknown_law_that_leaves_nothing(
    nominal, misfit, nuisance_chi2, is_searched
):
    frfs = measured(with_point_masses(nominal, {12: MASS_KG}))
    force = SimpleLawsFit(
        location=3, cost=misfit, mean_misfit=misfit, linear_mean_misfit=50.0, nuisance_chi2=nuisance_chi2
    )
    problem, laws = problem_of(nominal, frfs, ("added_mass",)), Laws("explained")
    decision, alone = decide_without_search(problem), a_law("unexplained", unknown_force=force)
    assert (search_beside_linear(problem, decision, alone, nominal, observed(frfs), laws) is not None) == is_searched
    assert bool(laws.given) == is_searched


def test_records_that_agree_beside_a_linear_effect_are_no_law(nominal):
    laws = Laws("consistent")
    laws.law.fit = None
    assert (
        beside(nominal, measured(with_point_masses(nominal, {12: MASS_KG})), ("added_mass",), laws, alone=50.0) is None
    )


@pytest.mark.parametrize(
    ("alone", "verdict", "with_it", "is_named"),
    [(50.0, "explained", 1.0, True), (50.0, "explained", 40.0, False), (50.0, "unexplained", 1.0, False)],
)
def test_an_effect_that_leaves_half_is_named_beside_a_law_that_explains_and_strains_nothing(
    nominal, alone, verdict, with_it, is_named
):
    def halved(problem):
        nothing = decide_without_search(problem)
        ranking = search_component(problem, nothing.null)
        null = replace(nothing.null, misfit=2 * ranking.best.cost, nuisance_chi2=0.0)
        return replace(nothing, null=null, ranking=ranking)

    frfs = measured(with_point_masses(nominal, {12: MASS_KG}))
    laws = Laws(verdict, with_it)
    assert (beside(nominal, frfs, ("added_mass",), laws, alone=alone, linear=halved) is not None) == is_named
    assert len(laws.given) == 1


def test_an_effect_that_leaves_half_is_not_tried_beside_a_law_that_strains_nothing(nominal):
    def halved(problem):
        nothing = decide_without_search(problem)
        best = search_component(problem, nothing.null).best
        return replace(nothing, null=replace(nothing.null, misfit=2 * best.cost, nuisance_chi2=0.0))

    laws = Laws("explained", 1.0)
    frfs = measured(with_point_masses(nominal, {12: MASS_KG}))
    assert beside(nominal, frfs, ("added_mass",), laws, alone=5.0, linear=halved) is None
    assert laws.given == []


@pytest.mark.parametrize(("nuisance_chi2", "good_cost"), [(5.0, 0.0), (50.0, np.inf)])
def test_beside_a_law_that_strains_nothing_only_what_explains_most_is_searched_for(
    monkeypatch, nuisance_chi2, good_cost
):
    asked, null = [], SimpleNamespace(cost=100.0)

    def search(_problem, base, **options):
        asked.append(options)
        return SimpleNamespace(best=base)

    monkeypatch.setattr(law_beside, "search_component", search)
    monkeypatch.setattr(law_beside, "is_significant", lambda *_: False)
    alone = SimpleNamespace(unknown_force=None, nuisance_chi2=nuisance_chi2)
    decision = SimpleNamespace(null=null, ranking=SimpleNamespace(fits=()))
    assert search_beside_linear(None, decision, alone, None, None, None) is None
    assert asked == [{"good_cost": good_cost}]


@pytest.mark.parametrize(
    ("verdict", "linear_first", "searches"),
    [("unexplained", False, ["linear", "law"]), ("unexplained", True, ["linear"]), ("explained", False, ["law"])],
)
def test_an_effect_is_searched_beside_the_law_where_the_opposite_order_led_to_nothing(
    monkeypatch, verdict, linear_first, searches
):
    called, nothing = [], SimpleNamespace(findings=(), statement="", is_explained=True)
    component = SimpleNamespace(log_evidence_gain=1.0, statement="")

    def first(*_):
        called.append("linear")
        return (nothing, component) if linear_first else None

    replaced = {
        "search_beside_linear": first,
        "search_beside_law": lambda *_: called.append("law"),
        "_add_law": lambda *_: nothing,
        "replace": lambda diagnosis, **_: diagnosis,
    }
    for name, stub in replaced.items():
        monkeypatch.setattr(diagnose, name, stub)
    problem = SimpleNamespace(effects={"added_mass": None})
    diagnose._diagnose_nonlinear(nothing, problem, None, None, None, None, SimpleNamespace(verdict=verdict), None)
    assert called == searches


def test_an_effect_may_explain_what_strains_the_nominal_model(nominal):
    """The misfit falls to a half only, but the nuisance chi2 from ten times as much to none."""

    def strained(problem):
        nothing = decide_without_search(problem)
        size = float(nothing.null.n_values)
        return replace(nothing, null=replace(nothing.null, misfit=2 * size, nuisance_chi2=10 * size))

    frfs = measured(with_point_masses(nominal, {12: MASS_KG}))
    assert beside(nominal, frfs, ("added_mass",), Laws("explained"), linear=strained) is not None


def test_what_follows_the_traces_of_laws_is_not_believed_beside_one(nominal):
    problem = problem_of(nominal, measured(nominal), ("attached_resonator",))
    location = next(location for location in ATTACHED.locations(problem.context) if location == {"nodes": [12]})
    true = with_change(nominal, ATTACHED.build(problem.context, location)(np.array([0.01, 250.0, 0.02])))
    frfs = measured(true)
    laws = Laws("explained")
    assert beside(nominal, frfs, ("attached_resonator",), laws) is None
    assert laws.given == []


def test_a_model_that_explains_all_leaves_nothing_to_take_out(nominal):
    frfs = measured(nominal)
    laws = Laws("explained")
    assert beside(nominal, frfs, ("added_mass",), laws) is None
    assert laws.given == []


def pulse(shift_s):
    """A smooth pulse far below half the rate."""
    time = np.arange(SAMPLES) / RATE_HZ - 0.2 - shift_s
    return np.exp(-((time / 0.01) ** 2)) * np.cos(2 * np.pi * 60 * time)


@pytest.mark.parametrize("remaining", [np.inf, np.nan, 1e30])
def test_a_law_that_runs_away_later_in_a_record_is_not_taken_out(nominal, monkeypatch, remaining):
    record = ObservedRecord(
        name="a",
        input_channel="force",
        input_dof=parse_dof("5:+z"),
        step_s=1 / RATE_HZ,
        force=np.ones(SAMPLES),
        responses=np.ones((1, SAMPLES)),
        sensors=(Sensor(channel="acc", dof=parse_dof("9:+z"), quantity=FrfQuantity.ACCELERANCE),),
    )
    observations = Observations(kind="hammer", records=(record,), band_hz=(10.0, 500.0))
    gone = replace(observations, records=(replace(record, responses=np.full((1, SAMPLES), remaining)),))
    monkeypatch.setattr(law_beside, "subtract_law", lambda *_: gone)
    law = SimpleNamespace(
        verdict="explained",
        nuisance_chi2=99.0,
        fit=object(),
        nuisance_prior=SimpleNamespace(moving=()),
        dispersion_rad=0.0,
        unknown_force=None,
    )
    assert search_beside_law(pytest.fail, law, nominal, observations, pytest.fail) is None


def test_recordings_are_restored():
    sensors = tuple(
        Sensor(channel=name, dof=parse_dof(dof), quantity=FrfQuantity.ACCELERANCE)
        for name, dof in (("acc_1", "9:+z"), ("acc_2", "5:-z"))
    )
    record = ObservedRecord(
        name="a",
        input_channel="force",
        input_dof=parse_dof("3:+z"),
        sensors=sensors,
        step_s=1 / RATE_HZ,
        force=GAIN * pulse(0.0),
        responses=np.stack([pulse(LATE_S), pulse(0.0)]),
    )
    change = Change(
        channels={
            "force": lambda s: np.full(len(s), GAIN, complex),
            "acc_1": lambda s: np.exp(-s * LATE_S),
        },
        moved={"acc_2": 6},
    )
    (restored,) = undo_chain_effects(
        Observations(kind="hammer", records=(record,), band_hz=(10.0, 200.0)), change
    ).records
    assert_allclose(restored.force, pulse(0.0), rtol=0, atol=WRAPPED)
    assert_allclose(restored.responses[0], pulse(0.0), rtol=0, atol=WRAPPED)
    assert np.array_equal(restored.responses[1], record.responses[1])
    assert [sensor.dof.name for sensor in restored.sensors] == ["9:z", "6:z"]
    assert restored.sensors[1].dof.sign == -1


def test_a_faultless_chain_is_left_alone():
    observations = Observations(kind="hammer", records=(), band_hz=(10.0, 200.0))
    assert undo_chain_effects(observations, Change()) is observations
