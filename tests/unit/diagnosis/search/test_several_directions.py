"""A mass acts in all directions of its node: in a scan, in a score test, and where damping couples modes."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from diagnosed import measured as measure
from diagnosed import problem_of
from frf_ipz import StructuralModel
from frf_ipz.diagnosis.catalogue.effects.added_mass import AddedMass
from frf_ipz.diagnosis.catalogue.effects.local_damper import LocalDamper
from frf_ipz.diagnosis.evidence.hypothesis import Component
from frf_ipz.diagnosis.evidence.inference_problem import compute_weights
from frf_ipz.diagnosis.evidence.map_fit import fit_map
from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.model.change import Attachment, Change
from frf_ipz.diagnosis.model.nuisance import make_nuisance_prior
from frf_ipz.diagnosis.options import DiagnoseOptions
from frf_ipz.diagnosis.search.component_search import fit_null_model
from frf_ipz.diagnosis.search.global_scan import SCAN_ERROR, scan_globally
from frf_ipz.diagnosis.search.robust_refinement import compute_robust_misfit
from frf_ipz.diagnosis.search.score_tests import prepare_score_test, run_score_test
from frf_ipz.dofs import Dof
from frf_ipz.fe.changes import with_point_masses
from frf_ipz.frf import FrfLabel
from frf_ipz.quantities import FrfQuantity

N_NODES, NODE = 5, 4
SAME = 1e-6  # relative, of costs whose basis lacks a few static shapes
LITTLE = 1e-5  # of the mass: so little acts linearly
LINEAR = 1e-3  # relative: what a small mass changes beyond the linear
NAMES = tuple(
    FrfLabel(Dof(node, axis), force, FrfQuantity.ACCELERANCE, f"{node}{axis}", f"f{number}")
    for number, force in enumerate((Dof(2, "z"), Dof(5, "x")))
    for node in (1, 3)
    for axis in "xyz"
)


@pytest.fixture(scope="module")
def nominal():
    """Five masses in a row, held at both ends by springs that are skew to the axes."""
    skew = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0]
    spring = skew @ np.diag([4e6, 2.5e6, 1.2e6]) @ skew.T
    chain = 2 * np.eye(N_NODES) - np.eye(N_NODES, k=1) - np.eye(N_NODES, k=-1)
    dofs = [f"{node}:{axis}" for node in range(1, N_NODES + 1) for axis in "xyz"]
    masses = np.kron(np.diag([2.0, 1.5, 2.5, 1.8, 2.2]), np.eye(3))
    return StructuralModel.from_matrices(masses, np.kron(chain, spring), dofs=dofs, modal_damping=0.01)


class HangingMass(AddedMass):
    """A mass that leaves the damping of the structure as it is, as a scan has it."""

    def build(self, context, location):
        rows = [context.model.full_index(Dof(location.node, axis)) for axis in "xyz"]
        motions = np.eye(len(context.model.all_dofs))[:, rows]
        none = (np.zeros((1, 1)),) * 3
        return lambda values: Change(
            attachments=(Attachment(motions=motions, stiffness=lambda s: values[0] * s**2, matrices=none),)
        )


def hang(component):
    return replace(component, effect=HangingMass())


def problem_with(nominal, mass_kg, names=("added_mass",)):
    return problem_of(nominal, measure(with_point_masses(nominal, {NODE: mass_kg}), NAMES, noise=1e-4), names)


def test_a_scan_costs_a_mass_what_its_own_frfs_cost(nominal):
    problem = problem_with(nominal, 0.8)
    base = fit_map(problem.make_hypothesis(()), problem.rough_data, np.zeros(0), iterations=0)
    starts = scan_globally(problem, base)
    assert starts[0].component.location.node == NODE
    weights, nuisance = compute_weights(problem.coarse, SCAN_ERROR), np.zeros(problem.nuisance_prior.size)
    for start in starts:
        frfs = (
            problem.make_hypothesis((hang(start.component),)).respond(start.values, nuisance, problem.coarse.s).values
        )
        assert start.cost == pytest.approx(compute_robust_misfit(problem.coarse.values - frfs, weights), rel=SAME)


def test_a_scan_beside_a_damper_costs_a_mass_what_its_own_frfs_cost(nominal):
    problem = problem_with(nominal, 0.8)
    damper = Component(effect=LocalDamper(), location=Location.at_node(3, "y"), n_locations=1)
    base = fit_map(problem.make_hypothesis((damper,)), problem.rough_data, np.array([40.0]), iterations=0)
    start = scan_globally(problem, base)[0]
    hypothesis = problem.make_hypothesis((damper, hang(start.component)))
    values = np.concatenate([base.values, start.values])
    frfs = hypothesis.respond(values, np.zeros(problem.nuisance_prior.size), problem.coarse.s).values
    expected = compute_robust_misfit(problem.coarse.values - frfs, compute_weights(problem.coarse, SCAN_ERROR))
    assert start.cost == pytest.approx(expected, rel=SAME)


def test_a_score_test_promises_what_a_small_mass_in_all_directions_gains(nominal):
    names = "stiffness_tolerance", "frequency_tolerance", "damping_tolerance", "gain_tolerance"
    exact = dict.fromkeys(names, 1e-5)
    source = problem_with(nominal, 2e-3)
    prior = make_nuisance_prior(source.context.basis, source.context.layout, DiagnoseOptions(**exact))
    problem = replace(source, nuisance_prior=prior)
    base = fit_null_model(problem)
    best = run_score_test(problem, base)[0]
    assert best.component.location.node == NODE
    test = prepare_score_test(problem, base, problem.sparse_data)
    hypothesis = problem.make_hypothesis((hang(best.component),), exact=False)
    size = LITTLE * problem.context.mass_kg
    sizes, gains = test.score_changes(test.change(hypothesis, np.array([size]))[:, :, None])
    assert_allclose([best.values[0], -best.cost], [size * sizes[0], gains[0]], rtol=LINEAR)
