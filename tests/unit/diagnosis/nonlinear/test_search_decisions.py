"""When a law has the wrong shape, when first moments prove it, and where an unknown law acts."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.nonlinear import search
from frf_ipz.diagnosis.nonlinear.fitting.force_localisation import ForceLocalisation
from frf_ipz.diagnosis.nonlinear.nonlinear_evidence import Agreement
from frf_ipz.diagnosis.result import DiagnosisVerdict
from simple_forces import simple_laws_at

LOCATIONS = tuple(range(10))


def law_at(location, cost):
    law = SimpleNamespace(name="cubic")
    return SimpleNamespace(
        law=law, location=location, cost=cost, n_rows=100, strength=1.0, nuisance=np.ones(2), converged=True
    )


def search_state(fits, gain_of_others):
    long = SimpleNamespace(
        linear=SimpleNamespace(n_rows=100, cost=100 * 50.0, nuisance_prior=SimpleNamespace(n_structural=2)),
        mean_misfit=50.0,
        localisation=ForceLocalisation(possible=LOCATIONS, equivalent=LOCATIONS),
    )
    return SimpleNamespace(short=None, long=long, fits=fits, gain_of_others=gain_of_others)


@pytest.mark.parametrize(("gain", "least", "is_wrong"), [(150.0, 0.0, True), (150.0, 250.0, False), (90.0, 0.0, False)])
def test_a_small_gain_of_other_forces_is_too_much_only_where_noise_may_hide_a_larger_one(gain, least, is_wrong):
    """Errors of the model cause 100."""
    problem = SimpleNamespace(
        segments=SimpleNamespace(moving=SimpleNamespace(any=lambda: False)), linear=SimpleNamespace(cost=9e3)
    )
    fit = SimpleNamespace(cost=1e3, n_rows=5000)
    assert search._has_wrong_shape(problem, fit, gain, least=least) == is_wrong


@pytest.mark.parametrize(("gain", "is_wrong"), [(2500.0, False), (3900.0, True)])
def test_initial_states_cause_a_larger_gain_of_other_forces(gain, is_wrong):
    """Of 10000 that a law leaves: for a two-sided stop that was taken for a cubic spring the gain would be 3900."""
    problem = SimpleNamespace(
        segments=SimpleNamespace(moving=SimpleNamespace(any=lambda: True)), linear=SimpleNamespace(cost=3.5e4)
    )
    fit = SimpleNamespace(cost=1e4, n_rows=16848)
    assert search._has_wrong_shape(problem, fit, gain, least=250.0) == is_wrong


@pytest.mark.parametrize(("gain", "location"), [(300.0, 7), (950.0, 3)])
def test_only_a_small_force_beside_a_law_counts_without_being_fitted(monkeypatch, gain, location):
    """A law at location 7 leaves 1000; simple laws, fitted, leave 2000 at location 3."""
    monkeypatch.setattr(search, "locate_unknown_law", lambda *_: (simple_laws_at(3, 2000.0), simple_laws_at(5, 2000.0)))
    state = search_state([law_at(7, 1000.0)], lambda _: gain)
    assert search._locate_unknown_force(state).location == location


@pytest.mark.parametrize(
    ("cost", "first", "early", "location"),
    [(500.0, 20.0, 50.0, 5), (500.0, 20.0, 30.0, 3), (500.0, 150.0, 500.0, 3), (300.0, 20.0, 50.0, 3)],
)
def test_first_moments_locate_a_law_where_later_ones_are_not_explained(monkeypatch, cost, first, early, location):
    """Long segments say location 3, the first moments 5: they count where they leave nothing there alone."""
    monkeypatch.setattr(search, "locate_unknown_law", lambda *_: (simple_laws_at(3, cost), simple_laws_at(5, first)))
    monkeypatch.setattr(search, "fit_simple_laws", lambda _, best, __: simple_laws_at(best, early))
    state = search_state([law_at(7, 1000.0)], lambda _: 950.0)
    assert search._locate_unknown_force(state).location == location


@pytest.mark.parametrize(("cost", "location"), [(90.0, 3), (400.0, 5)])
def test_long_segments_count_where_the_free_force_is_localised(monkeypatch, cost, location):
    """Simple laws leave much of the long segments at location 3, and nothing of the first moments at location 5."""
    monkeypatch.setattr(search, "locate_unknown_law", lambda *_: (simple_laws_at(3, 5000.0), simple_laws_at(5, 50.0)))
    monkeypatch.setattr(search, "fit_simple_laws", lambda _, best, __: simple_laws_at(best, 500.0))
    state = search_state([law_at(7, 1000.0)], lambda _: 950.0)
    forces = (SimpleNamespace(location=3, cost=cost),)
    state.long.localisation = replace(state.long.localisation, forces=forces)
    assert search._locate_unknown_force(state).location == location


def at_nodes(*nodes):
    return SimpleNamespace(
        locations=[Location.at_node(node) for node in nodes], describe_location=lambda index: f"node {nodes[index]}"
    )


@pytest.mark.parametrize(
    ("misfit", "linear", "is_stated"), [(3.0, 50.0, True), (10.0, 50.0, False), (10.0, 260.0, True)]
)
def test_the_location_of_an_unknown_law_is_stated_where_a_force_there_explains_nearly_all(misfit, linear, is_stated):
    modal_model = at_nodes(1)
    unexplained = search.LawSearch(verdict=DiagnosisVerdict.UNEXPLAINED, linearity=None)
    located = simple_laws_at(0, 100 * misfit, linear_mean_misfit=linear)
    assert bool(search._with_location(unexplained, modal_model, located, search.MOSTLY).location) == is_stated


def test_the_ambiguity_set_is_stated_with_the_location_of_an_unknown_law():
    modal_model = at_nodes(*range(9))
    located = replace(simple_laws_at(5, 20.0), ambiguity_set=(5, 6, 4))
    unexplained = search.LawSearch(verdict=DiagnosisVerdict.UNEXPLAINED, linearity=None)
    result = search._with_location(unexplained, modal_model, located, 0.5)
    assert result.location == {"nodes": [5]}
    assert result.statement.endswith("no closer than nodes 4 to 6.")


@pytest.mark.parametrize(("costs", "linear", "explains"), [({3: 90.0}, 5e3, True), ({3: 90.0}, 150.0, False)])
def test_a_free_force_explains_at_its_location_alone(costs, linear, explains):
    """Of 100 data a force at location 3, free at every moment, leaves 90; one at location 5 leaves 4000."""
    forces = tuple(SimpleNamespace(location=location, cost=cost) for location, cost in {**costs, 5: 4e3}.items())
    problem = SimpleNamespace(
        linear=SimpleNamespace(n_rows=100, cost=linear), localisation=SimpleNamespace(forces=forces)
    )
    assert search._free_force_explains(problem, 3) == explains
    assert not search._free_force_explains(problem, 5)
    assert not search._free_force_explains(problem, 4)


def test_linearity_that_is_known_is_not_assessed_again(monkeypatch):
    monkeypatch.setattr(search, "assess_linearity", None)
    result = search.search_laws(None, None, None, linearity=SimpleNamespace(is_nonlinear=False))
    assert result.verdict is DiagnosisVerdict.CONSISTENT


def first_moments(cost, *, afresh, is_moving=False):
    """A problem of which a linear model leaves 10000."""

    def refit(left):
        return SimpleNamespace(cost=left, n_rows=3000, misfit=None, numbers={"cubic": (1.0, 1e-4)})

    return SimpleNamespace(
        segments=SimpleNamespace(moving=SimpleNamespace(any=lambda: is_moving)),
        linear=SimpleNamespace(cost=1e4, nuisance_prior=None),
        fit_output_error=lambda *_: refit(cost),
        fit_output_error_afresh=lambda *_: refit(afresh),
    )


@pytest.mark.parametrize(
    ("costs", "gain", "disagreement", "explains"),
    [
        ([(90.0, 90.0)], 50.0, 2.0, True),
        ([(900.0, 900.0)], 50.0, 2.0, False),
        ([(90.0, 90.0)], 150.0, 2.0, False),
        ([(90.0, 90.0)], 50.0, 50.0, False),
        ([(900.0, 900.0), (90.0, 90.0)], 50.0, 2.0, True),
        ([(90.0, 900.0)], 50.0, 2.0, True),
        ([(900.0, 90.0)], 50.0, 2.0, True),
    ],
)
def test_a_law_that_explains_all_but_little_of_the_first_moments_counts(
    monkeypatch, costs, gain, disagreement, explains
):
    """Of segments of any length, by the better of both starts; errors of the model cause a gain of 100.

    No more where segments start in motion: nothing later confirms the first moments.
    """
    monkeypatch.setattr(search, "assess_agreement", lambda *_: Agreement(1e4, disagreement))
    monkeypatch.setattr(search, "relative_misfit", lambda *_: 0.03)
    monkeypatch.setattr(search, "_gain_of_other_forces", lambda *_: gain)
    for is_moving in (False, True):
        problems = (first_moments(cost, afresh=afresh, is_moving=is_moving) for cost, afresh in costs)
        assert search._explains_first_moments(problems, SimpleNamespace()) == explains


@pytest.mark.parametrize(("misfit", "is_searched"), [(0.9, False), (1.1, True)])
def test_no_dispersion_is_searched_where_a_force_of_unknown_law_leaves_nothing(monkeypatch, misfit, is_searched):
    searched = []
    unexplained = search.LawSearch(
        verdict=DiagnosisVerdict.UNEXPLAINED, linearity=None, fit=law_at(3, 900.0), modal_model=at_nodes(*range(9))
    )
    state = search_state([law_at(3, 900.0)], lambda _: 0.0)
    state.result, state.data = unexplained, SimpleNamespace(held_out_segments=lambda _: None)
    state.long.linear.nuisance_prior = None
    stubs = {
        "LawFitData": lambda **_: None,
        "make_modal_model": lambda *_: unexplained.modal_model,
        "read_noise": lambda _: None,
        "_hold_out": lambda _: (None, None),
        "_search_catalogue": lambda *_: state,
        "_search_without_dispersion": lambda *_: searched.append("dispersion") or state,
        "_locate_unknown_force": lambda _: simple_laws_at(5, 100 * misfit),
        "_free_force_explains": lambda *_: True,
        "compare_misfits": lambda *_: (None, None, None),
        "simulate_law_in_time": lambda *_: None,
    }
    for name, stub in stubs.items():
        monkeypatch.setattr(search, name, stub)
    linearity = SimpleNamespace(is_nonlinear=True)
    result = search.search_laws(None, None, None, laws=[object()], linearity=linearity)
    assert result.location == {"nodes": [5]}
    assert result.unknown_force.explains_all != is_searched
    assert bool(searched) == is_searched


@pytest.mark.parametrize(
    ("objection", "always", "n_rescored"), [("", False, 2), ("wrong", False, 0), ("wrong", True, 2)]
)
def test_fits_are_rescored_where_one_of_them_may_explain(monkeypatch, objection, always, n_rescored):
    """Two laws explain equally well; another is far behind."""
    rescored = []

    def rescore(_, contenders):
        rescored.extend(contenders)
        return contenders, np.array([5.0, 0.0])

    monkeypatch.setattr(search, "rescore", rescore)
    monkeypatch.setattr(search, "assess_agreement", lambda *_: Agreement(np.nan, np.nan))
    monkeypatch.setattr(search, "_find_objection", lambda *_: objection)
    fits = [law_at(3, 90.0), law_at(4, 91.0), law_at(5, 200.0)]
    problem = SimpleNamespace(
        linear=SimpleNamespace(cost=1e5, nuisance_prior=None),
        segments=SimpleNamespace(moving=np.zeros(2, bool)),
    )
    ranked, _ = search._rank(problem, fits, lambda _: 0.0, always_rescores=always)
    assert len(rescored) == n_rescored
    assert [fit.location for fit in ranked] == ([4, 3, 5] if n_rescored else [3, 4, 5])


@pytest.mark.parametrize(("other_gain", "n_rescored"), [(50.0, 2), (5000.0, 0)])
def test_fits_are_not_rescored_where_all_of_them_have_the_wrong_shape(monkeypatch, other_gain, n_rescored):
    """Whatever the variance of the data, other forces at their locations explain what they leave."""
    rescored = []
    monkeypatch.setattr(search, "rescore", lambda _, fits: rescored.extend(fits) or (fits, np.zeros(len(fits))))
    monkeypatch.setattr(search, "assess_agreement", lambda *_: Agreement(1e4, 1.0))
    monkeypatch.setattr(search, "is_determined", lambda *_: True)
    monkeypatch.setattr(search, "relative_misfit", lambda *_: 0.003)
    problem = SimpleNamespace(
        linear=SimpleNamespace(cost=1e4, nuisance_prior=None), segments=SimpleNamespace(moving=np.zeros(2, bool))
    )
    fits = [law_at(3, 90.0), law_at(4, 91.0)]
    for fit in fits:
        fit.misfit = None
    search._rank(problem, fits, lambda _: other_gain, always_rescores=False)
    assert len(rescored) == n_rescored
