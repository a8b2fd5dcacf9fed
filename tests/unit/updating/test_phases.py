"""The phases of a minimal change: their sensitivities against differences, whatever the model and the parameters."""

from dataclasses import replace

import numpy as np
import pytest

from frf_ipz.progress import silent
from frf_ipz.updating.methods import minimal_change
from frf_ipz.updating.minimal_change.gauss_newton import iterate
from frf_ipz.updating.minimal_change.modal_frame import frame_of, modal_frame
from frf_ipz.updating.options import UpdateOptions
from frf_ipz.updating.parameters import generic_basis, structural_basis
from frf_ipz.updating.problem import make_problem
from frf_ipz.updating.updated_model import UpdateStatus
from frf_testbench.updating.study import make_update_case

STEP = 1e-6  # of a logarithm: central differences are then off by rounding over it
SLOPES = 1e-4  # of the largest: squared roots are good to 1e-11 of the largest one in the pencil, over the step
STRONG = 5e-3  # of what would stop the motion
LESS = 0.7  # of the damping of the modes
AS_MEASURED = 2e-3  # relative, of a real part: what is said not to be explained by damping is half of it
UNTOUCHED = 1e-6  # of the largest stiffness
SEEDS = (20, 12, 11)  # a plate and a frame with zeros off the axis, and a beam


@pytest.fixture(params=SEEDS, scope="module")
def case(request):
    return make_update_case(request.param)


@pytest.fixture(params=["parts", "parts and masses", "any stiffness"])
def problem(request, case):
    basis = {
        "parts": lambda: structural_basis(case.structure.nominal_model, case.reduced_model),
        "parts and masses": lambda: structural_basis(case.structure.nominal_model, case.reduced_model, mass=True),
        "any stiffness": lambda: generic_basis(case.reduced_model),
    }[request.param]()
    return make_problem(case.reduced_model, case.fit, case.pairs, basis)


def stiffness_phase(problem):
    return minimal_change._stiffness_phase(problem, frame_of(problem.model))


def differences(value, count):
    """Central differences of a vector by parameters of the order of 1."""
    columns = []
    for place in range(count):
        step = STEP * np.eye(count)[place]
        columns.append((value(step) - value(-step)) / (2 * STEP))
    return np.array(columns).T


def test_stiffness_slopes_against_differences(problem):
    phase = stiffness_phase(problem)
    start = phase.nominal_roots(problem.computed)
    theta = 0.01 * np.random.default_rng(0).standard_normal(len(phase.basis.names))
    there = phase.roots(theta, start)
    found = phase.slopes(theta, there)
    expected = -differences(lambda step: phase.errors(phase.roots(theta + step, there)), len(theta))
    assert np.abs(found - expected).max() < SLOPES * np.abs(expected).max()


@pytest.mark.parametrize("has_damper", [False, True])
def test_damping_slopes_against_differences(case, has_damper):
    basis = structural_basis(case.structure.nominal_model, case.reduced_model)
    problem = make_problem(case.reduced_model, case.fit, case.pairs, basis)
    if has_damper:
        damper = damper_at(problem, STRONG / 10)
        damped = replace(problem.model, damping=problem.model.damping + damper, dashpots=damper)
        problem = replace(problem, model=damped)
    frame = frame_of(problem.model)
    phase = minimal_change._stiffness_phase(problem, frame)
    result = iterate(phase, phase.nominal_roots(problem.computed))
    damping = minimal_change._damping(problem, frame, modal_frame(*phase.matrices(result.theta)), phase, result)
    count = damping.terms[0].root.shape[0]
    theta = 0.02 * np.random.default_rng(1).standard_normal(count)
    found = damping.slopes(theta, damping.roots(theta))
    expected = -differences(lambda step: damping.errors(damping.roots(theta + step)), count)
    assert np.abs(found - expected).max() < 10 * SLOPES * np.abs(expected).max()


def test_an_indefinite_stiffness_is_refused(problem):
    phase = stiffness_phase(problem)
    start = phase.nominal_roots(problem.computed)
    theta = np.where(phase.basis.logarithmic, 0.0, -5.0)
    if not phase.basis.logarithmic.any():
        assert phase.roots(theta, start) is None


def test_roots_are_followed_through_a_crossing(problem):
    """A large change keeps every target's root its own: the vectors tell, not the order."""
    phase = stiffness_phase(problem)
    near = phase.nominal_roots(problem.computed)
    direction = np.random.default_rng(2).standard_normal(len(phase.basis.names))
    direction /= np.abs(direction).max()
    small = 0.002
    for step in range(1, 20):
        before, near = near, phase.roots(small * step * direction, near)
        slope = phase.slopes(small * (step - 1) * direction, before) @ direction
        moved = phase.errors(before) - phase.errors(near)
        assert np.abs(moved - small * slope).max() < 0.2 * max(np.abs(small * slope).max(), small)


def damper_at(problem, part):
    row = problem.rows(problem.frfs[0])[0]
    rate = part * np.sqrt(np.trace(problem.model.stiffness) * np.trace(problem.model.mass)) / (row @ row)
    return rate * np.outer(row, row)


@pytest.mark.parametrize("seed", [3, 7])
def test_a_known_damper_stays_while_the_modes_are_damped_anew(seed):
    """Scaled with the modes that it couples, it would keep them from losing damping of their own."""
    case = make_update_case(seed)
    problem = make_problem(case.reduced_model, case.fit, case.pairs, None)
    modal, damper = problem.model.damping, damper_at(problem, STRONG / 10)
    there = problem.roots_near(replace(problem.model, damping=LESS * modal + damper), problem.computed)
    nominal = replace(problem.model, damping=modal + damper, dashpots=damper)
    found = minimal_change.update(replace(problem, model=nominal, values=there), UpdateOptions(ensemble=2), silent)
    assert found.status is UpdateStatus.CONVERGED
    off = np.abs(found.after.real / there.real - 1)
    assert off[problem.frf < 0].max() < AS_MEASURED
    assert np.median(off[problem.frf >= 0]) < AS_MEASURED


def test_a_model_that_is_right_stays_as_it_is_however_it_is_damped(case):
    """A damper bends shapes and moves moduli: that is no error of the stiffness."""
    problem = make_problem(case.reduced_model, case.fit, case.pairs, None)
    damped = replace(problem.model, damping=problem.model.damping + damper_at(problem, STRONG))
    there = problem.roots_near(damped, problem.computed)
    kept = problem.frf < 0
    known = replace(
        problem,
        model=damped,
        values=there[kept],
        computed=there[kept],
        frf=problem.frf[kept],
        covariance=problem.covariance[np.ix_(np.repeat(kept, 2), np.repeat(kept, 2))],
        names=tuple(name for name, is_kept in zip(problem.names, kept, strict=True) if is_kept),
    )
    undamped = np.sqrt(np.abs(minimal_change._stiffness_phase(known, frame_of(damped)).eigenvalues))
    assert np.abs(np.abs(there[kept]) / undamped[undamped > 0][: kept.sum()] - 1).max() > 0
    found = minimal_change.update(known, UpdateOptions(ensemble=2), silent).model
    assert np.abs(found.stiffness - damped.stiffness).max() < UNTOUCHED * np.abs(damped.stiffness).max()
