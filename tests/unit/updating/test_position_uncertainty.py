"""Position errors of sensors and excitation: their effect on zeros, against a model with other positions."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh

from frf_ipz.diagnosis.position_uncertainty import propagate_position_tolerance
from frf_ipz.updating.position_uncertainty import PositionUncertainty, with_position_uncertainty
from frf_ipz.updating.problem import make_problem
from frf_ipz.updating.update import update_model
from frf_testbench.updating.study import make_update_case

SEEDS = (20, 12)  # a plate and a frame
SMALL = 1e-5  # of a row: the terms of second order are as small
SECOND_ORDER = 1e-3  # of the largest move
TOLERANCE = 1e-3  # m/m, as stated by default
DRAWS = 100


@pytest.fixture(params=SEEDS, scope="module")
def case(request):
    return make_update_case(request.param)


def test_zeros_move_as_those_of_a_model_with_other_rows(case):
    problem = make_problem(case.reduced_model, case.fit, case.pairs, None)
    label = problem.labels[problem.frfs[0]]
    row = SMALL * np.random.default_rng(0).standard_normal(len(problem.model.dofs))
    for dof, is_output in ((label.output_dof, True), (label.input_dof, False)):
        only = replace(problem, covariance=np.zeros_like(problem.covariance))
        covariance = with_position_uncertainty(only, (PositionUncertainty(dof=dof, is_output=is_output, row=row),))
        moved = _zeros_with(problem, dof, is_output, row) - problem.computed
        parts = np.stack([moved.real, moved.imag], axis=1).ravel()
        expected = np.outer(parts, parts)
        assert np.abs(expected).max() > 0
        assert np.abs(covariance - expected).max() < SECOND_ORDER * np.abs(expected).max()
    poles = 2 * np.count_nonzero(problem.frf < 0)
    assert not covariance[:poles].any()


def _zeros_with(problem, dof, is_output, row):
    """Zeros of the same model with a sensor or an excitation at another position; poles are the same."""
    values = problem.computed.copy()
    for target in np.flatnonzero(problem.frf >= 0):
        frf = int(problem.frf[target])
        output, force = problem.rows(frf)
        label = problem.labels[frf]
        if is_output and label.output_dof == dof:
            output = output + row
        if not is_output and label.input_dof == dof:
            force = force + row
        values[target] = _newton(problem.model, output, force, values[target])
    return values


def _newton(model, output, force, zero):
    for _ in range(6):
        dynamic = zero**2 * model.mass + zero * model.damping + model.stiffness
        motion, across = np.linalg.solve(dynamic, force), np.linalg.solve(dynamic.T, output)
        zero -= (output @ motion) / -(across @ (2 * zero * model.mass + model.damping) @ motion)
    return zero


def test_what_zeros_miss_of_the_first_order_is_their_own_noise(case):
    off = propagate_position_tolerance(
        case.fit, case.reduced_model, fe_model=case.structure.nominal_model, tolerance_m_per_m=TOLERANCE
    )
    problem = make_problem(case.reduced_model, case.fit, case.pairs, None)
    problem = replace(problem, covariance=np.zeros_like(problem.covariance))
    small = tuple(replace(position, row=SMALL * position.row) for position in off)
    first_order = with_position_uncertainty(problem, small) / SMALL**2
    stated = np.diagonal(with_position_uncertainty(problem, off) - first_order)
    missed = np.empty((DRAWS, len(problem.values)), complex)
    for draw, white in enumerate(np.random.default_rng(3).standard_normal((DRAWS, len(off)))):
        moves = [_with_all(problem, off, size * white) - problem.computed for size in (1.0, SMALL)]
        missed[draw] = moves[0] - moves[1] / SMALL
    expected = np.stack([np.mean(missed.real**2, axis=0), np.mean(missed.imag**2, axis=0)], axis=1).ravel()
    is_seen = expected > 1e-9 * np.diagonal(first_order).max()
    assert is_seen.any()
    ratio = np.sqrt(stated[is_seen] / expected[is_seen])
    assert np.all((ratio > 0.5) & (ratio < 2)), ratio


def test_a_zero_that_meets_a_pole_has_a_finite_noise():
    case = make_update_case(SEEDS[0])
    problem = make_problem(case.reduced_model, case.fit, case.pairs, None)
    off = propagate_position_tolerance(
        case.fit, case.reduced_model, fe_model=case.structure.nominal_model, tolerance_m_per_m=TOLERANCE
    )
    model = replace(problem.model, damping=np.zeros_like(problem.model.damping))
    pole = 1j * np.sqrt(eigh(model.stiffness, model.mass)[0][0])  # to the last bit, as it is computed there
    zeros = np.flatnonzero(problem.frf >= 0)
    still = tuple(replace(position, row=0 * position.row) for position in off)
    computed = problem.computed.copy()
    computed[zeros[0]] = pole
    met = replace(problem, model=model, computed=computed)
    assert np.isfinite(with_position_uncertainty(met, still)).all()


def _with_all(problem, off, white):
    """Zeros with all positions off at once."""
    rows = {True: {}, False: {}}
    for position, size in zip(off, white, strict=True):
        at = rows[position.is_output]
        at[position.dof] = at.get(position.dof, 0.0) + size * position.row
    values = problem.computed.copy()
    for target in np.flatnonzero(problem.frf >= 0):
        output, force = problem.rows(int(problem.frf[target]))
        label = problem.labels[int(problem.frf[target])]
        output, force = output + rows[True].get(label.output_dof, 0.0), force + rows[False].get(label.input_dof, 0.0)
        values[target] = _newton(problem.model, output, force, values[target])
    return values


def test_a_position_tolerance_makes_zeros_less_certain_and_not_poles():
    case = make_update_case(SEEDS[0])
    off = propagate_position_tolerance(
        case.fit, case.reduced_model, fe_model=case.structure.nominal_model, tolerance_m_per_m=TOLERANCE
    )
    ends = {(label.output_dof, True) for label in case.fit.labels} | {(x.input_dof, False) for x in case.fit.labels}
    assert {(position.dof, position.is_output) for position in off} == ends
    problem = make_problem(case.reduced_model, case.fit, case.pairs, None)
    wider = with_position_uncertainty(problem, off) - problem.covariance
    zeros = np.repeat(problem.frf >= 0, 2)
    assert np.all(np.diagonal(wider)[zeros] >= 0)
    assert np.diagonal(wider)[zeros].max() > np.diagonal(problem.covariance)[zeros].min()
    assert not wider[~zeros].any()


def test_a_misplaced_sensor_is_not_mistaken_for_a_stiffness():
    """A zero that lies elsewhere because of its sensor changes the model less where that is allowed for."""
    case = make_update_case(SEEDS[0])
    off = propagate_position_tolerance(
        case.fit, case.reduced_model, fe_model=case.structure.nominal_model, tolerance_m_per_m=TOLERANCE
    )
    changes = [
        np.abs(np.diagonal(covariance.model.stiffness) / np.diagonal(case.reduced_model.stiffness) - 1).max()
        for covariance in (
            update_model(case.fit, case.reduced_model, pairs=case.pairs, position_uncertainty=positions)
            for positions in ((), off)
        )
    ]
    assert changes[1] < changes[0]
