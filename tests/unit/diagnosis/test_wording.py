"""What a diagnosis says agrees with its numbers: intervals, probabilities, and no facts where something remains."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from diagnosed import beam, measured, observed
from frf_ipz.diagnosis.diagnose import diagnose
from frf_ipz.diagnosis.options import DiagnoseOptions
from frf_ipz.diagnosis.result import APPEARANCE, Estimate, confidence
from frf_ipz.diagnosis.verdict.findings import probability_of_need
from frf_ipz.diagnosis.verdict.mismatch import _describe_table
from frf_ipz.dofs import Dof
from frf_ipz.fe.changes import with_point_masses, with_springs


def estimate(value, std):
    return Estimate(value=value, std=std, low=value - 1.96 * std, high=value + 1.96 * std)


@pytest.mark.parametrize(
    ("number", "arguments", "text"),
    [
        (estimate(6595.911, 391.6), ("N m/rad",), "6600 N m/rad (95 %: 5800 to 7400)"),
        (estimate(24962539.0, 5613541.0), ("N/m",), "2.5e7 N/m (95 %: 1.4e7 to 3.6e7)"),
        (estimate(0.00151534, 6.28e-05), ("g", 1e3), "1.52 g (95 %: 1.39 to 1.64)"),
        (estimate(-25.3, 0.2), ("N", -1.0), "25.3 N (95 %: 24.9 to 25.7)"),
        (estimate(0.97378, 0.0015), ("%", -100), "-97.4 % (95 %: -97.7 to -97.1)"),
        (estimate(1.0, 1e-12), (), "1.00000 (95 %: 1.00000 to 1.00000)"),
        (Estimate(value=0.0123456, std=0.0, low=0.0123456, high=0.0123456), ("s",), "0.01235 s"),
        (Estimate(value=0.5, std=np.nan, low=np.nan, high=np.nan), (), "0.5000"),
    ],
)
def test_numbers_are_rounded_to_their_deviation(number, arguments, text):
    assert number.in_words(*arguments) == text


@pytest.mark.parametrize(
    ("probability", "text"),
    [(1.0, "above 0.999"), (0.9995, "above 0.999"), (0.97, "0.97"), (0.0101, "0.01"), (0.0, "below 0.001")],
)
def test_probabilities_are_written_without_rows_of_nines_and_zeros(probability, text):
    assert confidence(probability) == f"probability {text}"


@pytest.mark.parametrize(("gain", "probability"), [(-1e6, 0.0), (-3.0, 0.047), (0.0, 0.5), (5.0, 0.993), (1e6, 1.0)])
def test_evidence_against_an_effect_makes_it_improbable(gain, probability):
    assert probability_of_need(gain, 1.0) == pytest.approx(probability, abs=5e-4)
    assert probability_of_need(10 * gain, 10.0) == pytest.approx(probability_of_need(gain, 1.0), rel=1e-12)


def test_the_model_never_agrees_with_every_frf_in_so_many_words():
    table = pd.DataFrame({"frf": ["1:z / 2:z"], "low_hz": [10.0], "high_hz": [20.0], "before": [1.4], "after": [1.0]})
    text = _describe_table(table, np.zeros(0))
    assert "agrees" not in text
    assert "1:z / 2:z from 10 to 20 Hz (1.4 times)" in text


@pytest.fixture(scope="module")
def nominal(tmp_path_factory):
    return beam(tmp_path_factory.mktemp("beam"))


def test_a_cause_is_stated_with_interval_and_probability(nominal):
    options = DiagnoseOptions(effects=("added_mass",))
    diagnosis = diagnose(observed(measured(with_point_masses(nominal, {12: 0.02}))), nominal, options=options)
    (finding,) = diagnosis.findings
    assert finding.parameters["mass_kg"].in_words("g", 1e3) in finding.statement
    assert finding.statement.endswith("that the model lacks (probability above 0.999).")
    assert diagnosis.statement.startswith(finding.statement)
    assert diagnosis.is_explained


def test_where_something_remains_a_part_only_looks_like_something(nominal):
    changed = with_springs(with_point_masses(nominal, {5: 0.03, 14: 0.04}), {Dof(9, "z"): 3e4})
    options = DiagnoseOptions(effects=("added_mass", "global_stiffness"))
    diagnosis = diagnose(observed(measured(changed)), nominal, options=options)
    assert not diagnosis.is_explained
    assert diagnosis.findings
    assert all(finding.statement.startswith(APPEARANCE) for finding in diagnosis.findings)
    assert all("among what was tried)" in finding.statement for finding in diagnosis.findings)
    assert diagnosis.statement.startswith("Something is missing that nothing in the catalogue explains: ")
    hasty = diagnose(observed(measured(changed)), nominal, options=replace(options, seconds=1e-3))
    assert hasty.statement.startswith("Something is missing that nothing of what was looked at explains: ")
