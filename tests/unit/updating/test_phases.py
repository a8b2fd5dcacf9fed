"""The phases of a minimal change: their sensitivities against differences, whatever the model and the parameters."""

from dataclasses import replace

import numpy as np
import pytest

from frf_ipz.numerics.pencils import Roots
from frf_ipz.progress import silent
from frf_ipz.updating.methods import minimal_change
from frf_ipz.updating.minimal_change import damping
from frf_ipz.updating.minimal_change.gauss_newton import iterate
from frf_ipz.updating.minimal_change.modal_frame import frame_of, modal_frame
from frf_ipz.updating.options import UpdateOptions
from frf_ipz.updating.parameters import generic_basis, make_structural_basis
from frf_ipz.updating.problem import make_problem
from frf_ipz.updating.tracking import TrackedRoots
from frf_ipz.updating.updated_model import UpdateStatus
from frf_testbench.updating.study import make_update_case

STEP = 1e-6  # of a logarithm: central differences are then off by rounding over it
SLOPES = 1e-4  # of the largest: squared roots are good to 1e-11 of the largest one in the pencil, over the step
STRONG = 5e-3  # of what would stop the motion
DAMPING_RATIO = 0.7  # of the damping of the modes
AS_MEASURED = 2e-3  # relative, of a real part: the slack of damping is half of it
UNTOUCHED = 1e-6  # of the largest stiffness
SEEDS = (20, 12, 11)  # a plate and a frame with zeros off the axis, and a beam


@pytest.fixture(params=SEEDS, scope="module")
def case(request):
    return make_update_case(request.param)


@pytest.fixture(params=["parts", "parts and masses", "any stiffness"])
def problem(request, case):
    basis = {
        "parts": lambda: make_structural_basis(case.structure.nominal_model, case.reduced_model),
        "parts and masses": lambda: make_structural_basis(case.structure.nominal_model, case.reduced_model, mass=True),
        "any stiffness": lambda: generic_basis(case.reduced_model),
    }[request.param]()
    return make_problem(case.reduced_model, case.fit, case.pairs, basis)


def stiffness_phase(problem):
    return minimal_change._stiffness_phase(problem, frame_of(problem.model, problem.at_ports))


def differences(value, count):
    """Central differences of a vector by parameters of the order of 1."""
    columns = []
    for index in range(count):
        step = STEP * np.eye(count)[index]
        columns.append((value(step) - value(-step)) / (2 * STEP))
    return np.array(columns).T


def test_stiffness_slopes_against_differences(problem):
    phase = stiffness_phase(problem)
    start = phase.named_roots(np.zeros(len(phase.basis.names)), problem.computed)
    theta = 0.01 * np.random.default_rng(0).standard_normal(len(phase.basis.names))
    tracked = phase.roots(theta, start)
    slopes = phase.slopes(theta, tracked)
    expected = -differences(lambda step: phase.errors(phase.roots(theta + step, tracked)), len(theta))
    assert np.abs(slopes - expected).max() < SLOPES * np.abs(expected).max()


def damping_phase(case, *, has_damper=False):
    basis = make_structural_basis(case.structure.nominal_model, case.reduced_model)
    problem = make_problem(case.reduced_model, case.fit, case.pairs, basis)
    if has_damper:
        damper = damper_at(problem, STRONG / 10)
        damped = replace(problem.model, damping=problem.model.damping + damper, dashpots=damper)
        problem = replace(problem, model=damped)
    frame = frame_of(problem.model, problem.at_ports)
    phase = minimal_change._stiffness_phase(problem, frame)
    result = iterate(phase, phase.named_roots(np.zeros(len(phase.basis.names)), problem.computed))
    inner = modal_frame(*phase.matrices(result.theta))
    return minimal_change._damping_phase(problem, frame, inner, phase, result, np.zeros(len(problem.values)))


@pytest.mark.parametrize("has_damper", [False, True])
def test_damping_slopes_against_differences(case, has_damper):
    damping = damping_phase(case, has_damper=has_damper)
    count = damping.terms[0].root.shape[0]
    theta = 0.02 * np.random.default_rng(1).standard_normal(count)
    slopes = damping.slopes(theta, damping.roots(theta))
    expected = -differences(lambda step: damping.errors(damping.roots(theta + step)), count)
    assert np.abs(slopes - expected).max() < 10 * SLOPES * np.abs(expected).max()


def test_a_real_part_that_no_damping_makes_tells_as_little_as_it_lies_beyond():
    """Of the other sign, or of ten times what the rates of all modes make: of a zero beside another, by its shapes."""
    phase = damping_phase(make_update_case(11))
    zero = int(phase.target_roots.zeros[0])
    for factor, least in ((1.0, 0.0), (-3.0, 2.0), (10.0, 10.0 - np.e**2)):
        targets = phase.targets.copy()
        targets[zero] *= factor
        beyond = replace(phase, targets=targets).beyond_damping()
        assert np.delete(beyond, zero).max() == 0.0
        assert least <= beyond[zero] <= abs(factor)


def test_a_pole_is_as_damped_as_it_is_measured():
    """And so are the zeros beside it."""
    phase = damping_phase(make_update_case(11))
    pole = int(phase.target_roots.poles[1])
    targets = np.where(np.arange(len(phase.targets)) == pole, 10.0, 1.0) * phase.targets
    assert replace(phase, targets=targets).beyond_damping()[pole] == 0.0


def test_an_indefinite_stiffness_is_refused(problem):
    phase = stiffness_phase(problem)
    start = phase.named_roots(np.zeros(len(phase.basis.names)), problem.computed)
    theta = np.where(phase.basis.logarithmic, 0.0, -5.0)
    if not phase.basis.logarithmic.any():
        assert phase.roots(theta, start) is None


def test_roots_are_tracked_through_a_crossing(problem):
    """Every target keeps its root through a large change: by the vectors, not by the order."""
    phase = stiffness_phase(problem)
    tracked = phase.named_roots(np.zeros(len(phase.basis.names)), problem.computed)
    direction = np.random.default_rng(2).standard_normal(len(phase.basis.names))
    direction /= np.abs(direction).max()
    direction[list(problem.basis.at_nodes)] /= 10  # parts of the whole mass, at many nodes
    small = 0.002
    for step in range(1, 20):
        before, tracked = tracked, phase.roots(small * step * direction, tracked)
        slope = phase.slopes(small * (step - 1) * direction, before) @ direction
        moved = phase.errors(before) - phase.errors(tracked)
        assert np.abs(moved - small * slope).max() < 0.2 * max(np.abs(small * slope).max(), small)


def damper_at(problem, part):
    row = problem.rows(problem.frfs[0])[0]
    rate = part * np.sqrt(np.trace(problem.model.stiffness) * np.trace(problem.model.mass)) / (row @ row)
    return rate * np.outer(row, row)


@pytest.mark.parametrize("seed", [3, 7])
def test_a_known_damper_stays_while_modal_damping_is_updated(seed):
    """Scaled with the modes that it couples, it would keep them from losing their own damping."""
    case = make_update_case(seed)
    problem = make_problem(case.reduced_model, case.fit, case.pairs, None)
    modal, damper = problem.model.damping, damper_at(problem, STRONG / 10)
    measured = problem.nearest_roots(replace(problem.model, damping=DAMPING_RATIO * modal + damper), problem.computed)
    nominal = replace(problem.model, damping=modal + damper, dashpots=damper)
    updated = minimal_change.update(replace(problem, model=nominal, values=measured), UpdateOptions(ensemble=2), silent)
    assert updated.status is UpdateStatus.CONVERGED
    error = np.abs(updated.after.real / measured.real - 1)
    assert error[problem.frf < 0].max() < AS_MEASURED
    assert np.median(error[problem.frf >= 0]) < AS_MEASURED


def test_a_correct_stiffness_does_not_change_with_damping(case):
    """A damper bends shapes and changes moduli: that is no error of the stiffness."""
    problem = make_problem(case.reduced_model, case.fit, case.pairs, None)
    damped = replace(problem.model, damping=problem.model.damping + damper_at(problem, STRONG))
    damped_roots = problem.nearest_roots(damped, problem.computed)
    is_pole = problem.frf < 0
    known = replace(
        problem,
        model=damped,
        values=damped_roots[is_pole],
        computed=damped_roots[is_pole],
        frf=problem.frf[is_pole],
        covariance=problem.covariance[np.ix_(np.repeat(is_pole, 2), np.repeat(is_pole, 2))],
        names=tuple(name for name, selected in zip(problem.names, is_pole, strict=True) if selected),
    )
    undamped = np.sqrt(np.abs(minimal_change._stiffness_phase(known, frame_of(damped, known.at_ports)).eigenvalues))
    assert np.abs(np.abs(damped_roots[is_pole]) / undamped[undamped > 0][: is_pole.sum()] - 1).max() > 0
    updated = minimal_change.update(known, UpdateOptions(ensemble=2), silent).model
    assert np.abs(updated.stiffness - damped.stiffness).max() < UNTOUCHED * np.abs(damped.stiffness).max()


def test_the_real_part_of_a_zero_that_has_left_the_axis_is_no_damping():
    """Squared roots of one on the axis, one of a quadruple, and a real one: +-2i, -+2+-1i, +-3."""
    squared = np.array([4.0, -3.0 + 4.0j, -9.0], complex)
    none = np.zeros((0, 3), complex)
    roots = Roots(values=squared, right_vectors=none, left_vectors=none, slope=np.ones(3, complex))
    undamped = TrackedRoots(groups=((np.array([0, 2, 1]), roots),))
    assert damping._real_parts(undamped, 3) == pytest.approx([0.0, 3.0, 2.0])
