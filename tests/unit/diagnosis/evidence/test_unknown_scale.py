"""FRFs of unknown scale still show what is missing."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosed import BAND_HZ, beam, measured, observed
from frf_ipz.diagnosis.diagnose import diagnose
from frf_ipz.diagnosis.evidence.inference_problem import pose_problem
from frf_ipz.diagnosis.measured.data_split import split_data
from frf_ipz.diagnosis.options import DiagnoseOptions
from frf_ipz.diagnosis.search.component_search import fit_null_model
from frf_ipz.fe.changes import with_point_masses

FEW = DiagnoseOptions(effects=("added_mass", "local_stiffness"))
MASS_KG, SMALL_KG = 0.02, 0.004


@pytest.fixture(scope="module")
def nominal(tmp_path_factory):
    return beam(tmp_path_factory.mktemp("beam"))


def of_unknown_scale(machine, kind="per_channel"):
    gains = [5.0, -0.2] if kind == "per_channel" else [5.0, 5.0]
    frfs = measured(machine, factors=lambda frequency_hz: np.tile(gains, (len(frequency_hz), 1)))
    return observed(replace(frfs, unknown_scale=kind))


def fit_of(nominal, kind):
    """The fit of the model without a mass to FRFs with one."""
    observations = of_unknown_scale(with_point_masses(nominal, {12: MASS_KG}), kind)
    problem = pose_problem(nominal, split_data(observations), BAND_HZ, FEW, {}, free_gains=kind)
    return problem, fit_null_model(problem)


@pytest.mark.parametrize("kind", ["per_channel", "common"])
def test_no_gain_hides_what_is_missing(nominal, kind):
    problem, fit = fit_of(nominal, kind)
    assert fit.misfit > 10 * 2 * problem.data.measured.values.size


@pytest.mark.parametrize("kind", ["per_channel", "common"])
def test_slopes_are_those_of_the_misfit_with_the_best_gains(nominal, kind):
    problem, _ = fit_of(nominal, kind)
    data, nothing = problem.data, problem.make_hypothesis(())
    step, start = 1e-4, np.zeros(problem.nuisance_prior.size)
    moved = start.copy()
    moved[0] = step
    here, there = (nothing.respond(np.zeros(0), nuisance, data.measured.s) for nuisance in (start, moved))
    exact = replace(data, measured=replace(data.measured, values=here.values))  # where the misfit vanishes
    change = ((there.values - here.values) / step)[:, :, None]
    slope = exact.slopes(here, change)[:, 0]
    assert -exact.misfit(there) / step == pytest.approx(
        slope, abs=1e-2 * np.abs(slope).max()
    )  # of second order in step


def test_a_mass_is_found_without_scales(nominal):
    diagnosis = diagnose(of_unknown_scale(with_point_masses(nominal, {12: SMALL_KG})), nominal, options=FEW)
    assert diagnosis.verdict == "explained"
    (finding,) = diagnosis.findings
    assert (finding.effect, dict(finding.location)) == ("added_mass", {"nodes": [12]})
    assert finding.parameters["mass_kg"].value == pytest.approx(SMALL_KG, rel=0.05)
    assert diagnosis.after.held_out < 0.05 * diagnosis.before.held_out


def test_nothing_missing_is_consistent_without_scales(nominal):
    assert diagnose(of_unknown_scale(nominal), nominal, options=FEW).verdict == "consistent"
