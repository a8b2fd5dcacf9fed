from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from frf_ipz.diagnosis import diagnose as whole
from frf_ipz.diagnosis.diagnose import diagnose
from frf_ipz.diagnosis.nonlinear.findings import is_determined
from frf_ipz.diagnosis.nonlinear.law_in_time import simulate_law_in_time
from frf_ipz.diagnosis.nonlinear.linearity import assess_linearity
from frf_ipz.diagnosis.nonlinear.nonlinear_evidence import Agreement
from frf_ipz.diagnosis.nonlinear.search import search_laws
from frf_ipz.diagnosis.nonlinear.simulate import simulate, subtract_law
from frf_ipz.diagnosis.options import DiagnoseOptions
from frf_ipz.diagnosis.verdict import law_and_linear as law_beside
from frf_ipz.diagnosis.verdict.law_and_linear import MAX_NUISANCE_CHI2

pytestmark = pytest.mark.slow

CASES = {
    "cubic_stiffness": (lambda w, _: 2e10 * w**3, (0, 0, 1, 0), {"nodes": [3]}, {"cubic_N_m3": 2e10}),
    "gap_contact": (
        lambda w, _: 3e4 * max(w - 2e-4, 0.0),
        (0, 0, 0, 1),
        {"nodes": [4]},
        {"contact_stiffness_N_m": 3e4, "gap_m": 2e-4},
    ),
}
PARAMETERS = 0.05  # relative: what the issue asks of the median is 0.03
HELD_OUT = 0.05  # of the measured response; without the law at least five times as much


@pytest.fixture(scope="module", params=CASES)
def solved(request, chain, strike):
    law, where, location, parameters = CASES[request.param]
    observations = strike(law, where)
    result = search_laws(chain.model, observations, DiagnoseOptions())
    return request.param, location, parameters, observations, result


def test_law_location_and_parameters_are_found(solved):
    name, location, parameters, _, result = solved
    assert result.is_nonlinear
    first = result.findings[0]
    assert (first.effect, dict(first.location)) == (name, location)
    for key, value in parameters.items():
        assert abs(first.parameters[key].value / value - 1) < PARAMETERS, key


def test_the_law_explains_the_disagreement_of_impacts(solved):
    result = solved[-1]
    assert result.nonlinear_evidence > 1e4


def test_impacts_that_were_held_out_are_predicted(solved):
    result = solved[-1]
    assert result.after.held_out < HELD_OUT
    assert result.before.held_out > 5 * result.after.held_out


def test_whole_records_of_all_levels_are_simulated(solved):
    *_, observations, result = solved
    simulation = simulate(observations, result.nuisance_prior, result.fit)
    assert simulation.simulated.shape == simulation.measured.shape
    assert (simulation.misfit < 2 * HELD_OUT).all()


def test_a_law_is_simulated_for_the_strongest_impact_that_was_held_out(solved):
    *_, observations, result = solved
    law = result.law_in_time
    assert (law.record, law.is_held_out, law.response, law.unit) == ("impact 55 N", True, "acceleration", "m/s^2")
    record = next(record for record in observations.records if record.name == law.record)
    row = [sensor.channel for sensor in record.sensors].index(law.channel)
    assert set(law.measured) <= set(record.responses[row])
    misfit, without = (np.linalg.norm(law.measured - model) for model in (law.simulated, law.without))
    assert misfit < 2 * HELD_OUT * np.linalg.norm(law.measured)
    assert without > 5 * misfit
    force = result.fit.strength * result.fit.law.unit_force(law.motion_m, law.velocity_m_s, result.fit.shape)
    np.testing.assert_array_equal(law.force_N, force)
    assert np.abs(law.motion_m).max() == np.abs(result.fit.motion).max()


def test_impacts_that_start_in_motion_show_the_force_alone(solved):
    *_, observations, result = solved
    moving = replace(observations, records=tuple(replace(record, number=2) for record in observations.records))
    data = SimpleNamespace(training=moving, held_out=replace(moving, records=()))
    law = simulate_law_in_time(data, None, result.fit)
    assert (law.record, len(law.time_s)) == ("", 0)
    assert np.abs(law.force_N).max() > 0


def test_the_nominal_model_has_a_larger_misfit_than_within_its_tolerances(solved):
    """In what the fit counts; the chain's model is right but for the law."""
    result = solved[-1]
    assert result.after.training_noise < result.updated.training_noise < result.before.training_noise


def test_a_law_that_explains_no_more_than_a_linear_system_does_not_win(chain, strike, monkeypatch):
    law, where, *_ = CASES["cubic_stiffness"]
    monkeypatch.setattr("frf_ipz.diagnosis.nonlinear.search.assess_agreement", lambda *_: Agreement(3.0, 1.0))
    result = diagnose(strike(law, where), chain.model, options=DiagnoseOptions())
    assert result.verdict == "unexplained"
    assert result.findings == ()
    assert result.alternatives[0].effect == "cubic_stiffness"
    assert "no more than a linear system" in result.statement


def test_a_law_whose_parameters_may_as_well_be_zero_is_no_explanation(chain, strike, monkeypatch):
    law, where, *_ = CASES["cubic_stiffness"]
    monkeypatch.setattr("frf_ipz.diagnosis.nonlinear.findings.STD_INFLATION", 1e6)
    result = search_laws(chain.model, strike(law, where), DiagnoseOptions())
    assert result.verdict == "unexplained"
    assert "do not distinguish from zero" in result.statement


@pytest.mark.parametrize(("gap_variance", "expected"), [(1e-10, True), (1e-8, False)])
def test_one_parameter_that_is_determined_is_enough(gap_variance, expected):
    """Records hardly determine how stiff a hard stop is, but its gap."""
    fit = SimpleNamespace(numbers={"contact_stiffness_N_m": (1e4, 9e8), "gap_m": (1e-4, gap_variance)})
    assert is_determined(fit, 1.0) == expected


@pytest.mark.parametrize(
    ("verdict", "nonlinear_evidence", "expected"),
    [
        ("explained", 200.0, "law"),
        ("explained", 30.0, "spring"),
        ("explained", float("nan"), "spring"),
        ("unexplained", 200.0, "spring"),
    ],
)
def test_a_linear_cause_that_leaves_nothing_gives_way_to_a_proven_law_only(
    monkeypatch, verdict, nonlinear_evidence, expected
):
    monkeypatch.setattr(whole, "_add_law", lambda *_: "law")
    laws = SimpleNamespace(verdict=verdict, nonlinear_evidence=nonlinear_evidence)
    assert whole._prefer_proven_law("spring", laws) == expected


def test_nothing_is_found_in_a_linear_chain(chain, strike):
    result = search_laws(chain.model, strike(), DiagnoseOptions())
    assert result.verdict == "consistent"
    assert result.findings == ()


OUTSIDE = {
    "square": (lambda w, _: 3e7 * w * abs(w), "disagree"),
    "quintic": (lambda w, _: 2e14 * w**5, "wrong shape"),  # a cubic spring leaves less than the errors of the model
}


@pytest.mark.slow
@pytest.mark.parametrize(("law", "words"), OUTSIDE.values(), ids=OUTSIDE)
def test_a_law_outside_the_catalogue_is_not_explained(chain, strike, law, words):
    result = search_laws(chain.model, strike(law, (0, 0, 1, 0)), DiagnoseOptions())
    assert result.verdict == "unexplained"
    assert words in result.statement
    assert dict(result.location) == {"nodes": [3]}


def test_records_without_the_law_are_those_of_a_linear_chain(solved):
    *_, observations, result = solved
    without_law = subtract_law(observations, result.nuisance_prior, result.fit)
    assert assess_linearity(without_law).score < 0.1 * result.linearity.score


def test_a_law_is_subtracted_from_whole_records_from_rest_that_are_loudest_late(solved, random_records):
    *_, observations, result = solved
    records = random_records(observations, 2.0)
    without_law = subtract_law(records, result.nuisance_prior, result.fit)
    changed = [
        np.abs(without.responses - record.responses).max()
        for without, record in zip(without_law.records, records.records, strict=True)
    ]
    assert min(changed) > 0


def test_a_law_alone_needs_no_nuisance(solved):
    assert solved[-1].nuisance_chi2 < 0.1 * MAX_NUISANCE_CHI2


@pytest.mark.parametrize(
    ("nuisance_chi2", "alone", "relieved", "doubt", "has_dynamics", "early", "is_found"),
    [
        (50.0, ("explained", 2.0), 2.0, "", False, (False, False), True),
        (50.0, ("explained", 2.0), 20.0, "", True, (False, False), True),
        (50.0, ("unexplained", 0.5), 2.0, "", False, (False, False), True),
        (50.0, ("unexplained", 0.5), 20.0, "", False, (False, False), False),
        (50.0, ("unexplained", 0.5), 2.0, "", True, (False, False), False),
        (50.0, ("unexplained", 2.0), 2.0, "", False, (False, False), False),
        (50.0, ("explained", 2.0), 40.0, "", False, (False, False), False),
        (5.0, ("explained", 2.0), 0.1, "", False, (False, False), False),
        (50.0, ("explained", 2.0), 2.0, "", False, (True, False), True),
        (50.0, ("explained", 2.0), 2.0, "", False, (True, True), False),
        (50.0, ("explained", 2.0), 2.0, "implausible", False, (False, False), False),
    ],
)
def test_a_linear_cause_beside_a_law_has_to_relieve_the_model(
    monkeypatch, nuisance_chi2, alone, relieved, doubt, has_dynamics, early, is_found
):
    """The cause has a log Bayes factor of 1000 on the records without the law, which alone leaves `alone`."""
    observations = SimpleNamespace(records=())
    component = SimpleNamespace(effect=SimpleNamespace(has_dynamics=has_dynamics))
    hypothesis = SimpleNamespace(
        change=lambda _: "change", implausibilities=lambda _: (doubt,), components=(component,)
    )
    spring = SimpleNamespace(log_evidence=1e3, mean_misfit=1.0, values=(), hypothesis=hypothesis)
    replaced = {
        "subtract_law": lambda *_: observations,
        "fit_null_model": lambda _: SimpleNamespace(log_evidence=0.0),
        "search_component": lambda *_: SimpleNamespace(best=spring, fits=(spring,)),
        "is_significant": lambda *_: True,
        "assess_goodness": lambda *_: None,
        "required_log_bayes_factor": lambda *_: 30.0,
        "with_change": lambda *_: "changed model",
        "undo_chain_effects": lambda *_: "restored",
        "rank_effects": lambda *_: ["spring"],
        "make_finding": lambda component, *_: component,
    }
    for name, stub in replaced.items():
        monkeypatch.setattr(law_beside, name, stub)
    verdict, misfit = alone
    after = SimpleNamespace(training_noise=misfit)
    at_rest = SimpleNamespace(moving=())
    laws = SimpleNamespace(
        nuisance_chi2=nuisance_chi2,
        verdict=verdict,
        after=after,
        fit="fit",
        nuisance_prior=at_rest,
        is_early=early[0],
        unknown_force=None,
        dispersion_rad=0.0,
    )
    beside_cause = SimpleNamespace(verdict="explained", nuisance_chi2=relieved, is_early=early[1])
    problem = SimpleNamespace(kind="hammer")
    result = law_beside.search_beside_law(lambda _: problem, laws, "model", observations, lambda *_: beside_cause)
    assert result == ((beside_cause, "spring") if is_found else None)
