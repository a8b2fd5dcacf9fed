"""The published step by step: its sensitivities, and what the method refuses."""

from dataclasses import replace

import numpy as np
import pytest

from frf_ipz.dofs import Dof
from frf_ipz.errors import InputError, NumericalError
from frf_ipz.pairing.pairs import Pairs
from frf_ipz.updating.ipz.step import PublishedStep, StepSettings
from frf_ipz.updating.options import UpdateOptions
from frf_ipz.updating.update import method_names, update_model
from frf_ipz.updating.updated_model import UpdateStatus
from frf_testbench.updating.paper_cases import build_section_4, build_section_5
from frf_testbench.updating.study import make_update_case

STEP = 1e-4  # relative change of the root that moves most
SLOPES = 1e-4  # of the largest entry of a row: roots are good to 1e-9 without balancing, and bend by the step
RATIO = 20.0  # times the damping of the paper, so that vectors are complex in earnest
IPZ = UpdateOptions(method="ipz", damping=False, max_iterations=5)


def step_of(case, *, damping=False, cross=True, ratio=1.0):
    """The published step of a paper's case; `ratio` multiplies the damping, so that vectors are complex in earnest."""
    model, targets = case.reduced_model, case.pairs.targets
    label = case.fit.labels[0]
    return PublishedStep(
        model.mass,
        ratio * model.damping,
        model.stiffness,
        sensor=model.dofs.index(label.output_dof.unsigned),
        actuator=model.dofs.index(label.input_dof.unsigned),
        targets=case.targets,
        computed=np.array([pair.computed_value for pair in targets]),
        n_poles=4,
        settings=StepSettings(alpha=0.1, beta=1.0, cross_sensitivities=cross, damping=damping),
    )


def roots_with(step, matrix):
    step.evaluate(matrix)
    return step.roots[0] + 1j * step.roots[1]


def sensitivity_by_differences(case, step, index, size_of_step, *, damping):
    """Change of all targets with one chosen eigenvalue of the matrix, or of its substructure, eqs. (22) and (24)."""
    matrix = (step.damping if damping else step.stiffness).take(step.back)
    size = step.order - 1
    if index < step.n_poles:
        change = np.outer(step.vectors[:, index], step.duals[index])
    else:
        change = np.zeros((step.order, step.order))
        change[:size, :size] = np.outer(step.vectors[:size, index], step.duals[index, :size])
    whole = np.zeros_like(change)
    whole[np.ix_(step.rows, step.columns)] = size_of_step * change
    reference = step_of(case, damping=damping, ratio=RATIO)
    return (roots_with(reference, matrix + whole) - roots_with(reference, matrix - whole)) / (2 * size_of_step)


@pytest.mark.parametrize("damping", [False, True], ids=["stiffness", "damping"])
@pytest.mark.parametrize("make", [build_section_4, build_section_5], ids=["section 4", "section 5"])
def test_all_sensitivities_against_differences(make, damping):
    case = make()
    step = step_of(case, damping=damping, ratio=RATIO)
    step.evaluate((step.damping if damping else step.stiffness).take(step.back))
    step._eigenvectors()
    sensitivity = step._sensitivity().copy() / step.weights
    for index in range(7):
        size = STEP / np.max(np.abs(sensitivity[index]) / np.abs(case.targets))
        expected = sensitivity_by_differences(case, step, index, size, damping=damping)
        assert np.abs(sensitivity[index] - expected).max() < SLOPES * np.abs(expected).max()


def test_cross_sensitivities_are_omitted_on_request():
    step = step_of(build_section_4(), cross=False)
    step.evaluate(step.stiffness.take(step.back))
    step._eigenvectors()
    sensitivity = step._sensitivity()
    assert not sensitivity[4:, :4].any()
    assert not sensitivity[:4, 4:].any()
    assert sensitivity[:4, :4].any()


def test_a_step_goes_towards_the_targets():
    step = step_of(build_section_4())
    matrix = step.stiffness.take(step.back)
    before = step.evaluate(matrix)
    step.settings = replace(step.settings, beta=0.01)
    after = step.evaluate(step.step())
    assert after < before


def test_a_pencil_without_the_roots_of_the_targets_is_refused():
    case = build_section_4()
    with pytest.raises(NumericalError, match="fewer dominant poles or zeros"):
        step_of(replace(case, fit=case.fit), ratio=1e4)


def test_the_sensor_must_be_retained():
    case = build_section_4()
    model = replace(case.reduced_model, dofs=tuple(Dof(dof.node + 100, "z") for dof in case.reduced_model.dofs))
    with pytest.raises(InputError, match="among \\[reduce\\] dofs"):
        update_model(case.fit, model, pairs=case.pairs, options=IPZ)


def test_several_frfs_take_turns():
    case = make_update_case(0)
    assert len(case.labels) == 1
    case = make_update_case(4)
    assert len(case.labels) > 1
    updated = update_model(
        case.fit, case.reduced_model, pairs=case.pairs, options=replace(IPZ, beta=0.05, max_iterations=200)
    )
    assert updated.history.misfit.iloc[-1] < updated.history.misfit.iloc[0]
    assert any("(FRF 2)" in name for name in updated.history.columns)
    alone = Pairs(rows=tuple(row for row in case.pairs.rows if row.frf <= 0))
    reference = update_model(
        case.fit, case.reduced_model, pairs=alone, options=replace(IPZ, beta=0.05, max_iterations=200)
    )
    assert (
        np.abs(updated.model.stiffness - reference.model.stiffness).max()
        > 1e-6 * np.abs(reference.model.stiffness).max()
    )


def test_without_targets_there_is_nothing_to_do():
    case = build_section_4()
    updated = update_model(case.fit, case.reduced_model, pairs=Pairs(rows=()), options=IPZ)
    assert updated.status is UpdateStatus.NOTHING_TO_DO


def test_the_limit_of_iterations_is_reported():
    case = build_section_4()
    updated = update_model(case.fit, case.reduced_model, pairs=case.pairs, options=IPZ)
    assert updated.status is UpdateStatus.MAX_ITERATIONS
    assert updated.history.iteration.tolist() == [1, 2, 3, 4, 5]
    assert updated.ensemble.shape == (0, 3, 6, 6)


def test_a_step_that_is_too_large_diverges_and_returns_the_best():
    case = build_section_4()
    updated = update_model(
        case.fit, case.reduced_model, pairs=case.pairs, options=replace(IPZ, beta=30.0, alpha=0.0, max_iterations=500)
    )
    assert updated.status is UpdateStatus.DIVERGED
    assert np.isfinite(updated.model.stiffness).all()


def test_methods_are_found_by_their_modules():
    assert method_names() == ("ipz", "minimal-change")
    case = build_section_4()
    with pytest.raises(InputError, match="did you mean 'minimal-change'"):
        update_model(case.fit, case.reduced_model, pairs=case.pairs, options=UpdateOptions(method="minimal"))
