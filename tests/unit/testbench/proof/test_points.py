"""Errors at points of interest: labels with signs, lines that both have, and the model as handed in."""

import math

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from frf_testbench.proof.points import compute_frf_error, compute_point_errors, evaluate_nominal_model

EXACT = 1e-12  # relative: the same numbers in another order
FORMULA = 1e-9  # relative: one mass on one spring against its formula, in double precision
LINES = np.array([10.0, 10.5, 11.0, 11.5])
FRF = np.array([1.0, 2.0 - 1.0j, -1.0 - 2.0j, 0.5j])


def table(frf=FRF, lines=LINES, output="27:+z", source="28:+z"):
    rows = {"frequency_hz": lines, "output_dof": output, "input_dof": source, "real": frf.real, "imag": frf.imag}
    return pd.DataFrame(rows | {"quantity": "accelerance"})


def test_the_error_is_the_norm_of_the_difference_over_the_norm_of_the_truth():
    assert_allclose(compute_frf_error(table(), table(1.5 * FRF)), 0.5, rtol=EXACT)
    one_off = FRF + np.array([0, 0, 3.0, 0])
    assert_allclose(compute_frf_error(table(), table(one_off)), 3 / np.linalg.norm(FRF), rtol=EXACT)


def test_signs_of_labels_turn_frfs_round():
    assert compute_frf_error(table(), table(-FRF, source="28:-z")) == 0
    assert compute_frf_error(table(), table(FRF, source="28:-z", output="27:-z")) == 0
    assert_allclose(compute_frf_error(table(), table(FRF, source="28:-z")), 2.0, rtol=EXACT)


def test_only_lines_and_paths_that_both_have_count():
    assert compute_frf_error(table(), table(FRF[1:3], lines=LINES[1:3] * (1 + 3e-7))) == 0
    both = pd.concat([table(1.1 * FRF), table(9 * FRF, output="5:+z")])
    assert_allclose(compute_frf_error(table(), both), 0.1, rtol=EXACT)
    mixed = table(np.array([1.0, 7.0]), lines=np.array([10.0, 10.7]))
    assert compute_frf_error(table(), mixed) == 0
    assert math.isnan(compute_frf_error(table(), table(output="5:+z")))


@pytest.fixture
def oscillator(tmp_path):
    text = '[model]\nkind = "lumped"\nname = "one"\n[damping]\nmodal_ratio = 0.01\n[lumped]\ndirection = "x"\n'
    text += "[[lumped.mass]]\nnode = 1\nmass_kg = 2.0\n"
    text += '[[lumped.spring]]\nid = "k1"\nnodes = [0, 1]\nstiffness_N_m = 8000.0\n'
    (tmp_path / "model.toml").write_text(text, encoding="utf-8")
    return tmp_path


def accelerance(stiffness=8000.0):
    s = 2j * np.pi * LINES
    return s**2 / (2.0 * s**2 + 2 * 0.01 * np.sqrt(8000.0 * 2.0) * s + stiffness)


def test_the_nominal_model_is_evaluated_as_it_was_handed_in(oscillator):
    said = evaluate_nominal_model(oscillator, table(output="1:-x", source="1:+x"))
    assert_allclose(said["real"] + 1j * said["imag"], -accelerance(), rtol=FORMULA)


def test_errors_of_all_three_models(oscillator):
    truth = accelerance(stiffness=8400.0)
    there = {"output": "1:+x", "source": "1:+x"}
    table(truth, **there).to_csv(oscillator / "answer.csv", index=False)
    assert compute_point_errors(oscillator, oscillator / "answer.csv", oscillator) is None
    for label, factor in (("with", 1.02), ("without", 1.2)):
        (oscillator / label).mkdir()
        table(factor * truth, **there).to_parquet(oscillator / label / "poi_frf.parquet")
    errors = compute_point_errors(oscillator, oscillator / "answer.csv", oscillator)
    assert_allclose([errors.diagnosed, errors.without], [0.02, 0.2], rtol=FORMULA)
    nominal = np.linalg.norm(accelerance() - truth) / np.linalg.norm(truth)
    assert_allclose(errors.nominal, nominal, rtol=FORMULA)
    assert compute_point_errors(oscillator, oscillator / "nothing.csv", oscillator) is None
