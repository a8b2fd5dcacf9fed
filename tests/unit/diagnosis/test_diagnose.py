"""The whole diagnosis on FRFs that were made with and without something missing."""

import json
from dataclasses import replace

import numpy as np
import pytest

from diagnosed import BAND_HZ, beam, labels, measured, observed
from frf_ipz.diagnosis.apply import correct_frfs, correct_model
from frf_ipz.diagnosis.catalogue.finder import shipped_effects
from frf_ipz.diagnosis.diagnose import SEED_WARNING, diagnose
from frf_ipz.diagnosis.evidence.hypothesis import Component
from frf_ipz.diagnosis.evidence.inference_problem import pose_problem
from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.measured.data_split import split_data
from frf_ipz.diagnosis.options import DiagnoseOptions
from frf_ipz.diagnosis.result import Finding
from frf_ipz.diagnosis.verdict.proof import prove
from frf_ipz.dofs import Dof
from frf_ipz.errors import InputError
from frf_ipz.fe.changes import with_point_masses, with_springs
from frf_ipz.fe.response import compute_frfs
from frf_ipz.frf import FrfLabel
from frf_ipz.quantities import FrfQuantity
from frf_ipz.runs.codec import load_result, save_result

MASS_KG = 0.02
FEW = DiagnoseOptions(effects=("added_mass", "local_stiffness", "grounded_spring", "sensor_gain", "damping_level"))
MUCH_NOISE = 0.05  # of each FRF's median: errors in proportion to such FRFs would make all of them too small
GAIN = 0.006  # twice the prior's standard deviation of a gain: that of the force cannot be told from what is fitted
SEEN = 0.02  # relative: the noise is 0.1 % of the FRFs, tolerances 0.1 % of the stiffness


@pytest.fixture(scope="module")
def nominal(tmp_path_factory):
    return beam(tmp_path_factory.mktemp("beam"))


@pytest.fixture(scope="module")
def with_mass(nominal):
    frfs = measured(with_point_masses(nominal, {12: MASS_KG}))
    return diagnose(observed(frfs), nominal, options=FEW)


def test_a_seed_changes_nothing_and_a_warning_says_so(nominal, with_mass):
    frfs = measured(with_point_masses(nominal, {12: MASS_KG}))
    diagnosis = diagnose(observed(frfs), nominal, options=replace(FEW, seed=7))
    assert set(diagnosis.warnings) - set(with_mass.warnings) == {SEED_WARNING}
    assert diagnosis.findings[0].parameters == with_mass.findings[0].parameters


def test_nothing_missing_is_consistent(nominal):
    diagnosis = diagnose(observed(measured(nominal)), nominal, options=FEW)
    assert diagnosis.verdict == "consistent"
    assert diagnosis.findings == ()
    assert diagnosis.before.held_out < SEEN


def test_a_mass_is_found_at_its_node_with_its_size(with_mass):
    assert with_mass.verdict == "explained"
    (finding,) = with_mass.findings
    assert (finding.effect, dict(finding.location)) == ("added_mass", {"nodes": [12]})
    size = finding.parameters["mass_kg"]
    assert size.value == pytest.approx(MASS_KG, rel=SEEN)
    assert size.low < MASS_KG < size.high
    assert finding.log_evidence_gain > 100
    assert {"nodes": [12]} in [dict(location) for location in finding.location_set]


def test_the_finding_improves_what_was_not_fitted(with_mass):
    assert with_mass.after.held_out < 0.05 * with_mass.before.held_out
    assert with_mass.after.held_out_noise < 1.3


def test_the_json_is_as_in_the_contract(with_mass):
    content = json.loads(json.dumps(with_mass.to_json(), allow_nan=False))
    assert {"verdict", "findings", "alternatives", "mismatch", "fit"} <= set(content)
    (finding,) = content["findings"]
    assert {"effect", "location", "parameters", "probability", "log_evidence_gain", "statement"} <= set(finding)
    assert finding["location"] == {"nodes": [12]}
    assert {"value", "std"} <= set(finding["parameters"]["mass_kg"])
    assert "mass of" in finding["statement"]
    assert {"frequency_hz", "where"} <= set(content["mismatch"])
    for when in ("before", "after"):
        assert {"training", "held_out"} <= set(content["fit"][when])


def test_a_diagnosis_survives_being_stored(with_mass, tmp_path):
    save_result(with_mass, tmp_path / "diagnosis.result")
    assert load_result(tmp_path / "diagnosis.result").to_json() == with_mass.to_json()


def test_the_corrected_model_has_the_mass(nominal, with_mass):
    corrected = correct_model(with_mass, nominal)
    unmeasured = (FrfLabel(Dof(4, "z"), Dof(6, "z"), FrfQuantity.ACCELERANCE),)
    s = 2j * np.pi * np.linspace(10.0, 700.0, 300)
    truth = compute_frfs(with_point_masses(nominal, {12: MASS_KG}), unmeasured, s)
    wrong = [np.linalg.norm(compute_frfs(model, unmeasured, s) - truth) for model in (corrected, nominal)]
    assert wrong[0] < 0.05 * wrong[1]


def test_what_no_effect_explains_is_unexplained(nominal):
    changed = with_springs(with_point_masses(nominal, {5: 0.03, 14: 0.04}), {Dof(9, "z"): 3e4})
    diagnosis = diagnose(
        observed(measured(changed)), nominal, options=DiagnoseOptions(effects=("damping_level", "global_stiffness"))
    )
    assert diagnosis.verdict == "unexplained"
    assert diagnosis.mismatch_hz.size
    assert "Something is missing" in diagnosis.statement
    assert diagnosis.after.held_out <= diagnosis.before.held_out


@pytest.mark.parametrize("updating_helps", [True, False])
def test_a_part_that_makes_worse_what_was_not_fitted_is_left_out(nominal, monkeypatch, updating_helps):
    def with_worse_parts(problem, held_out, null, final):
        proof = prove(problem, held_out, null, final)
        worse = replace(proof.after, held_out=2 * proof.before.held_out)
        return proof if final is null and updating_helps else replace(proof, after=worse)

    monkeypatch.setattr("frf_ipz.diagnosis.diagnose.prove", with_worse_parts)
    changed = with_springs(nominal, {Dof(9, "z"): 3e5})
    diagnosis = diagnose(
        observed(measured(changed)), nominal, options=DiagnoseOptions(effects=("sensor_misplaced", "time_delay"))
    )
    assert diagnosis.verdict == "unexplained"
    assert diagnosis.findings == ()
    assert diagnosis.alternatives
    assert diagnosis.after == (diagnosis.updated if updating_helps else diagnosis.before)


def test_excluded_parts_of_the_band_are_not_analysed(nominal):
    def hum(frequency_hz):
        return 1 + 3.0 * (np.abs(frequency_hz - 100.0) < 2.0)[:, None]

    observations = observed(measured(nominal, factors=hum))
    options = DiagnoseOptions(effects=("damping_level", "global_stiffness"))  # what none explains takes long with many
    assert diagnose(observations, nominal, options=options).verdict != "consistent"
    diagnosis = diagnose(replace(observations, exclude_hz=((97.0, 103.0),)), nominal, options=options)
    assert diagnosis.verdict == "consistent"
    assert not ((diagnosis.mismatch_hz > 97.0) & (diagnosis.mismatch_hz < 103.0)).any()
    with pytest.raises(InputError, match="exclude_hz"):
        diagnose(replace(observations, exclude_hz=((1.0, 1000.0),)), nominal, options=options)


def test_a_channel_of_the_wrong_sign_is_found_and_put_right(nominal):
    frfs = measured(nominal, factors=lambda f: np.array([1.0, -1.2]) + 0 * f[:, None])
    diagnosis = diagnose(observed(frfs), nominal, options=FEW)
    (finding,) = diagnosis.findings
    assert (finding.effect, dict(finding.location)) == ("sensor_gain", {"channels": ["acc_2"]})
    assert finding.parameters["gain_ratio"].value == pytest.approx(-1.2, rel=SEEN)
    assert correct_model(diagnosis, nominal) is nominal
    right = correct_frfs(frfs, diagnosis)
    assert np.allclose(right.values[:, 0], frfs.values[:, 0], rtol=0, atol=0)
    assert np.allclose(right.values[:, 1] * -1.2, frfs.values[:, 1], rtol=SEEN, atol=0)
    assert np.allclose(right.variance[:, 1] * 1.44, frfs.variance[:, 1], rtol=2 * SEEN, atol=0)


def test_a_line_that_a_highpass_does_not_show_stays_as_it_is(nominal, with_mass):
    frfs = measured(nominal)
    from_zero = replace(frfs, frequency_hz=frfs.frequency_hz - frfs.frequency_hz[0])
    highpass = Finding(effect="sensor_dynamics", location=Location.on_channel("acc_2", form="highpass"), values=(20.0,))
    right = correct_frfs(from_zero, replace(with_mass, findings=(highpass,)))
    s = from_zero.s[1:]
    assert np.array_equal(right.values[0], from_zero.values[0])
    assert np.allclose(right.values[1:, 1], from_zero.values[1:, 1] * (s + 40 * np.pi) / s, rtol=1e-9, atol=0)


def test_gains_that_nobody_knows_are_not_diagnosed(nominal):
    frfs = measured(nominal, factors=lambda f: np.array([3.0, 0.2]) + 0 * f[:, None])
    free = replace(frfs, unknown_scale="per_channel")
    assert diagnose(observed(free), nominal, options=FEW).verdict == "consistent"


def test_noise_is_not_taken_for_a_gain(nominal):
    names = labels(("17:+z", "14:+z", "11:+z", "9:-z", "7:+z", "4:+z"), ("6:+z", "15:+z"))
    source = split_data(observed(measured(nominal, names, noise=MUCH_NOISE)))
    problem = pose_problem(nominal, source, BAND_HZ, FEW, shipped_effects())
    effect = problem.effects["sensor_gain"]
    locations = effect.locations(problem.context)
    force = Component(effect=effect, location=locations[locations.index(Location.on_channel("force"))], n_locations=1)
    fit = problem.fit((force,), np.array([1.01]))
    assert fit.values[0] == pytest.approx(1.0, abs=GAIN)
    assert fit.log_evidence < problem.fit((), np.zeros(0)).log_evidence


def test_an_unknown_effect_is_refused(nominal):
    with pytest.raises(InputError, match="added_mass"):
        diagnose(observed(measured(nominal)), nominal, options=DiagnoseOptions(effects=("aded_mass",)))


def test_a_sensor_that_the_model_lacks_is_refused(nominal):
    frfs = measured(nominal)
    elsewhere = tuple(FrfLabel(Dof(99, "z"), label.input_dof, label.quantity) for label in frfs.labels[:1])
    bad = replace(frfs.select_frfs([0]), labels=elsewhere)
    with pytest.raises(InputError, match="99"):
        diagnose(observed(bad), nominal, options=FEW)


def test_too_few_lines_are_refused(nominal):
    with pytest.raises(InputError, match="lines"):
        diagnose(observed(measured(nominal, n_lines=10)), nominal, options=FEW)


def test_a_users_own_effect_is_found(nominal, tmp_path):
    (tmp_path / "mine.py").write_text(OWN, encoding="utf-8")
    frfs = measured(with_springs(nominal, {Dof(14, "z"): 2e4}), labels())
    options = DiagnoseOptions(effects=("added_mass",), extra_effects=("mine.py:Cord",))
    diagnosis = diagnose(observed(frfs), nominal, options=options, folder=tmp_path)
    assert (diagnosis.verdict, diagnosis.findings[0].effect) == ("explained", "cord")
    assert diagnosis.findings[0].parameters["pull_N_m"].value == pytest.approx(2e4, rel=SEEN)


OWN = """
import numpy as np
from scipy import sparse
from frf_ipz.diagnosis.catalogue.effect import Effect, Parameter
from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.model.change import Change

class Cord(Effect):
    name = "cord"
    def locations(self, context):
        return [Location.at_node(14)]
    def parameters(self, context, location):
        return (Parameter(name="pull_N_m", low=10.0, high=1e6),)
    def build(self, context, location):
        dof = next(dof for dof in context.moving_dofs if dof.node == 14)
        unit = sparse.csr_array(sparse.diags_array(context.unit_motion(dof)))
        return lambda values: Change(stiffness=values[0] * unit)
    def statement(self, context, location, values):
        return "A cord."
"""
