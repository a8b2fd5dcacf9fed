"""The change mapped back along the structure: where it is, with a band that can be believed."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from frf_ipz.runs.codec import load_result, save_result
from frf_ipz.updating.along_structure import change_along_structure, notable_changes
from frf_ipz.updating.parameters import make_structural_basis
from frf_ipz.updating.update import update_model
from frf_testbench.updating.study import make_update_case

LOCAL, GLOBAL = 11, 7  # a beam that is wrong in segments, and a plate whose stiffness is 20 % lower throughout
SEEDS = range(800, 810)


def updated(case, *, parts=True):
    basis = make_structural_basis(case.structure.nominal_model, case.reduced_model) if parts else None
    return update_model(case.fit, case.reduced_model, pairs=case.pairs, basis=basis)


def true_ratios(case):
    pairs = zip(case.structure.true_model.parts, case.structure.nominal_model.parts, strict=True)
    return np.array([np.trace(real.stiffness) / np.trace(drawn.stiffness) for real, drawn in pairs])


@pytest.fixture(scope="module")
def local():
    case = make_update_case(LOCAL)
    return case, updated(case)


def test_a_local_change_is_found_at_its_location(local):
    case, updated_model = local
    table = change_along_structure(updated_model, case.structure.nominal_model)
    truth = true_ratios(case)
    assert len(table) == len(truth)
    assert np.corrcoef(table.stiffness_ratio, truth)[0, 1] > 0.9
    assert np.abs(table.stiffness_ratio - truth).mean() < np.abs(1 - truth).mean() / 2


def test_the_sentences_name_the_segments(local):
    case, updated_model = local
    truth = true_ratios(case)
    texts = notable_changes(change_along_structure(updated_model, case.structure.nominal_model))
    assert texts
    for text in texts:
        element = int(text.split("most at element ")[1].split(":")[0])
        assert ("softer" in text) == (truth[element - 1] < 1)


def test_a_common_factor_is_found_everywhere():
    case = make_update_case(GLOBAL)
    table = change_along_structure(updated(case), case.structure.nominal_model)
    assert_allclose(table.stiffness_ratio, true_ratios(case), rtol=0.01)
    assert len(notable_changes(table)) == 1


def test_bands_cover_the_true_ratios_on_held_back_structures():
    covered = []
    for seed in SEEDS:
        case = make_update_case(seed)
        table = change_along_structure(updated(case), case.structure.nominal_model)
        truth = true_ratios(case)
        covered.append(np.mean((truth >= table.stiffness_ratio_low) & (truth <= table.stiffness_ratio_high)))
    assert 0.8 < np.mean(covered) <= 1  # 0.9 of all elements; those of one structure are right or wrong together


def test_a_change_of_the_matrices_is_read_back(local):
    case, _ = local
    updated_model = updated(case, parts=False)
    assert updated_model.parts.empty
    table = change_along_structure(updated_model, case.structure.nominal_model)
    assert np.corrcoef(table.stiffness_ratio, true_ratios(case))[0, 1] > 0.6
    assert table.stiffness_ratio_low.isna().all()
    assert notable_changes(table) == ()


def test_a_change_of_parts_alone_is_read_back_exactly(local):
    """A change that the parts can express: all of them softer by a tenth."""
    case, updated_model = local
    softer = replace(updated_model.nominal, stiffness=0.9 * updated_model.nominal.stiffness)
    table = change_along_structure(
        replace(updated_model, model=softer, parts=pd.DataFrame()), case.structure.nominal_model
    )
    assert_allclose(table.stiffness_ratio, 0.9, rtol=5e-3)  # READ_BACK: the free end hardly bends


def test_a_model_without_parts_has_no_table(local):
    case, updated_model = local
    without_parts = replace(updated_model, parts=pd.DataFrame())
    assert change_along_structure(without_parts, replace(case.structure.nominal_model, parts=())).empty


def test_the_table_survives_a_run_folder(local, tmp_path):
    _, updated_model = local
    for number, result in enumerate((updated_model, replace(updated_model, parts=pd.DataFrame()))):
        save_result(result, tmp_path / f"{number}.result")
        back = load_result(tmp_path / f"{number}.result")
        pd.testing.assert_frame_equal(back.parts, result.parts, check_column_type=False, check_index_type=False)


def test_one_part_alone_is_not_said_to_be_the_most(local):
    case, updated_model = local
    table = change_along_structure(updated_model, case.structure.nominal_model).head(3).copy()
    table["stiffness_ratio"] = [1.0, 0.95, 1.0]
    table["stiffness_ratio_low"], table["stiffness_ratio_high"] = [0.9, 0.9, 0.9], [1.1, 0.99996, 1.1]
    (text,) = notable_changes(table)
    assert "most at" not in text
    assert text.endswith("softer than modelled, -5 % (90 %: -10 to -0.004 %)")
