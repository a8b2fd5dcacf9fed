from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from frf_ipz.diagnosis import diagnose as whole
from frf_ipz.diagnosis.diagnose import diagnose
from frf_ipz.diagnosis.nonlinear.findings import is_told
from frf_ipz.diagnosis.nonlinear.law_in_time import show_law
from frf_ipz.diagnosis.nonlinear.linearity import assess_linearity
from frf_ipz.diagnosis.nonlinear.nonlinear_evidence import Agreement
from frf_ipz.diagnosis.nonlinear.search import search_laws
from frf_ipz.diagnosis.nonlinear.simulate import simulate, subtract_law
from frf_ipz.diagnosis.options import DiagnoseOptions
from frf_ipz.diagnosis.verdict import law_and_linear as law_beside
from frf_ipz.diagnosis.verdict.law_and_linear import STRAINED

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
    found = search_laws(chain.model, observations, DiagnoseOptions())
    return request.param, location, parameters, observations, found


def test_law_place_and_numbers_are_found(solved):
    name, location, parameters, _, found = solved
    assert found.is_nonlinear
    first = found.findings[0]
    assert (first.effect, dict(first.location)) == (name, location)
    for key, value in parameters.items():
        assert abs(first.parameters[key].value / value - 1) < PARAMETERS, key


def test_blows_disagree_as_the_law_makes_them(solved):
    found = solved[-1]
    assert found.nonlinear_evidence > 1e4  # nats


def test_blows_that_were_held_out_are_predicted(solved):
    found = solved[-1]
    assert found.after.held_out < HELD_OUT
    assert found.before.held_out > 5 * found.after.held_out


def test_whole_records_of_all_levels_are_simulated(solved):
    *_, observations, found = solved
    simulation = simulate(observations, found.nuisance_prior, found.fit)
    assert simulation.simulated.shape == simulation.measured.shape
    assert (simulation.misfit < 2 * HELD_OUT).all()


def test_a_law_is_shown_at_work_on_the_strongest_blow_that_was_held_out(solved):
    *_, observations, found = solved
    law = found.law_in_time
    assert (law.record, law.is_held_out, law.response, law.unit) == ("blow 55 N", True, "acceleration", "m/s^2")
    record = next(record for record in observations.records if record.name == law.record)
    row = [sensor.channel for sensor in record.sensors].index(law.channel)
    assert set(law.measured) <= set(record.responses[row])
    left, without = (np.linalg.norm(law.measured - model) for model in (law.simulated, law.without))
    assert left < 2 * HELD_OUT * np.linalg.norm(law.measured)
    assert without > 5 * left
    force = found.fit.strength * found.fit.law.unit_force(law.motion_m, law.velocity_m_s, found.fit.shape)
    np.testing.assert_array_equal(law.force_N, force)
    assert np.abs(law.motion_m).max() == np.abs(found.fit.motion).max()


def test_blows_that_start_in_motion_show_the_force_alone(solved):
    *_, observations, found = solved
    moving = replace(observations, records=tuple(replace(record, number=2) for record in observations.records))
    recordings = SimpleNamespace(training=moving, held_out=replace(moving, records=()))
    law = show_law(recordings, None, found.fit)
    assert (law.record, len(law.time_s)) == ("", 0)
    assert np.abs(law.force_N).max() > 0


def test_the_model_as_it_is_misses_no_less_than_within_its_tolerances(solved):
    """In what the fit counts; the chain's model is right but for the law."""
    found = solved[-1]
    assert found.after.training_noise < found.updated.training_noise < found.before.training_noise


def test_a_law_that_gains_no_more_than_something_linear_does_not_win(chain, strike, monkeypatch):
    law, where, *_ = CASES["cubic_stiffness"]
    monkeypatch.setattr("frf_ipz.diagnosis.nonlinear.search.agreement_with", lambda *_: Agreement(3.0, 1.0))
    found = diagnose(chain.model, strike(law, where), DiagnoseOptions())
    assert found.verdict == "unexplained"
    assert found.findings == ()
    assert found.alternatives[0].effect == "cubic_stiffness"
    assert "no more than a linear system" in found.statement


def test_a_law_whose_numbers_may_as_well_be_zero_is_no_explanation(chain, strike, monkeypatch):
    law, where, *_ = CASES["cubic_stiffness"]
    monkeypatch.setattr("frf_ipz.diagnosis.nonlinear.findings.WIDER", 1e6)
    found = search_laws(chain.model, strike(law, where), DiagnoseOptions())
    assert found.verdict == "unexplained"
    assert "do not tell from zero" in found.statement


@pytest.mark.parametrize(("gap_variance", "told"), [(1e-10, True), (1e-8, False)])
def test_one_number_that_is_told_is_enough(gap_variance, told):
    """How stiff a hard stop is, recordings hardly say: its gap they do."""
    fit = SimpleNamespace(numbers={"contact_stiffness_N_m": (1e4, 9e8), "gap_m": (1e-4, gap_variance)})
    assert is_told(fit, 1.0) == told


@pytest.mark.parametrize(
    ("verdict", "nonlinear_evidence", "said"),
    [
        ("explained", 200.0, "law"),
        ("explained", 30.0, "spring"),
        ("explained", float("nan"), "spring"),
        ("unexplained", 200.0, "spring"),
    ],
)
def test_a_linear_cause_that_leaves_nothing_gives_way_to_a_proven_law_only(
    monkeypatch, verdict, nonlinear_evidence, said
):
    monkeypatch.setattr(whole, "_with_law", lambda *_: "law")
    found = SimpleNamespace(verdict=verdict, nonlinear_evidence=nonlinear_evidence)
    assert whole._unless_a_law("spring", found) == said


def test_nothing_is_found_in_a_linear_chain(chain, strike):
    found = search_laws(chain.model, strike(), DiagnoseOptions())
    assert found.verdict == "linear"
    assert found.findings == ()


OUTSIDE = {
    "square": (lambda w, _: 3e7 * w * abs(w), "disagree"),
    "quintic": (lambda w, _: 2e14 * w**5, "is bent"),  # a cubic spring leaves less than the errors of the model
}


@pytest.mark.slow
@pytest.mark.parametrize(("law", "words"), OUTSIDE.values(), ids=OUTSIDE)
def test_a_law_outside_the_catalogue_is_not_explained(chain, strike, law, words):
    found = search_laws(chain.model, strike(law, (0, 0, 1, 0)), DiagnoseOptions())
    assert found.verdict == "unexplained"
    assert words in found.statement
    assert dict(found.location) == {"nodes": [3]}


def test_recordings_without_the_law_are_those_of_a_linear_chain(solved):
    *_, observations, found = solved
    rest = subtract_law(observations, found.nuisance_prior, found.fit)
    assert assess_linearity(rest).score < 0.1 * found.linearity.score


def test_a_law_is_taken_out_of_whole_records_from_rest_that_are_loudest_late(solved, random_records):
    *_, observations, found = solved
    records = random_records(observations, 2.0)
    rest = subtract_law(records, found.nuisance_prior, found.fit)
    changed = [
        np.abs(one.responses - was.responses).max() for one, was in zip(rest.records, records.records, strict=True)
    ]
    assert min(changed) > 0


def test_a_law_alone_does_not_strain_the_model(solved):
    assert solved[-1].nuisance_chi2 < 0.1 * STRAINED


@pytest.mark.parametrize(
    ("nuisance_chi2", "alone", "again", "doubt", "has_dynamics", "early", "both"),
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
        (50.0, ("explained", 2.0), 2.0, "hardly swings", False, (False, False), False),
    ],
)
def test_a_linear_cause_beside_a_law_has_to_relieve_the_model(
    monkeypatch, nuisance_chi2, alone, again, doubt, has_dynamics, early, both
):
    """A cause that is what it looks like gains 1000 nats on the recordings without the law, which it leaves `alone`."""
    seen = SimpleNamespace(records=())
    cause = SimpleNamespace(effect=SimpleNamespace(has_dynamics=has_dynamics))
    hypothesis = SimpleNamespace(change=lambda _: "change", doubts=lambda _: (doubt,), causes=(cause,))
    spring = SimpleNamespace(log_evidence=1e3, mean_misfit=1.0, values=(), hypothesis=hypothesis)
    replaced = {
        "subtract_law": lambda *_: seen,
        "fit_nothing": lambda _: SimpleNamespace(log_evidence=0.0),
        "search": lambda *_: SimpleNamespace(best=spring, fits=(spring,)),
        "is_significant": lambda *_: True,
        "with_change": lambda *_: "changed model",
        "undo_chain_effects": lambda *_: "restored",
        "weigh": lambda *_: ["spring"],
        "finding_of": lambda cause, *_: cause,
    }
    for name, stub in replaced.items():
        monkeypatch.setattr(law_beside, name, stub)
    verdict, left = alone
    after = SimpleNamespace(training_noise=left)
    at_rest = SimpleNamespace(moving=())
    laws = SimpleNamespace(
        nuisance_chi2=nuisance_chi2,
        verdict=verdict,
        after=after,
        fit="fit",
        nuisance_prior=at_rest,
        is_early=early[0],
        dispersion_rad=0.0,
    )
    eased = SimpleNamespace(verdict="explained", nuisance_chi2=again, is_early=early[1])
    problem = SimpleNamespace(kind="hammer")
    found = law_beside.search_beside_law(lambda _: problem, laws, "model", seen, lambda *_: eased)
    assert found == ((eased, "spring") if both else None)
