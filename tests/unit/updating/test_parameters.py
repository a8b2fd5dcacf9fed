"""What an update may change: matrices that add up, and a prior with the stated covariance."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from chains import chain
from fe_models import beam
from frf_ipz.dofs import Dof
from frf_ipz.errors import ShapeError
from frf_ipz.fe.reduction.options import ReduceOptions
from frf_ipz.fe.reduction.reduce import reduce_to_dofs
from frf_ipz.numerics.pencils import undamped_poles
from frf_ipz.updating.parameters import (
    GENERIC_STD_ALONE,
    GLOBAL_STD,
    SEGMENT_STD,
    generic_basis,
    join_bases,
    make_structural_basis,
    unwhiten,
)
from frf_ipz.updating.regions import MAX_REGIONS, reduced_regions

EXACT = 1e-9  # relative: sums of a few hundred products


@pytest.fixture(scope="module")
def fe_model():
    return beam(modal_ratio=0.001, left="clamped")


def reduced(fe_model):
    ends = {"actuators": [Dof(5, "z")], "sensors": [Dof(21, "z")], "points": [Dof(12, "z")]}
    return reduce_to_dofs(fe_model, options=ReduceOptions(modes=4), band_hz=(10.0, 500.0), **ends)


def covariance(terms, stds):
    return sum(std**2 * term.root @ term.root.T for term, std in zip(terms, stds, strict=True))


def test_the_parts_together_are_the_whole_stiffness_and_mass(fe_model):
    model = reduced(fe_model)
    regions = reduced_regions(fe_model, model)
    assert len(regions) == 20
    assert_allclose(sum(region.stiffness for region in regions), model.stiffness, rtol=EXACT, atol=1e-9 * 1e6)
    total = sum(region.mass for region in regions)
    assert np.abs(total - model.mass).max() < EXACT * np.abs(model.mass).max()


def test_a_region_sits_where_its_element_is(fe_model):
    region = reduced_regions(fe_model, reduced(fe_model))[3]
    assert region.nodes == (4, 5)
    assert_allclose(region.coordinates_m[0], 3.5 * 0.4995 / 20, rtol=1e-12)
    assert region.name == "element 4"


def test_many_parts_are_merged_without_losing_any():
    fe_model = beam(elements=400, left="clamped")
    model = reduced(fe_model)
    regions = reduced_regions(fe_model, model)
    assert len(regions) == MAX_REGIONS
    assert_allclose(np.trace(sum(region.stiffness for region in regions)), np.trace(model.stiffness), rtol=1e-6)
    assert max(len(region.nodes) for region in regions) <= 5


def test_the_same_logarithm_everywhere_is_a_factor_on_the_stiffness(fe_model):
    model = reduced(fe_model)
    basis = make_structural_basis(fe_model, model)
    theta = np.where(basis.logarithmic, np.log(1.2), 0.0)
    changed = np.tensordot(basis.amounts(theta), basis.stiffness, 1)
    assert np.abs(changed - 0.2 * model.stiffness).max() < EXACT * np.abs(model.stiffness).max()


def test_masses_of_parts_change_only_on_request(fe_model):
    model = reduced(fe_model)
    without = make_structural_basis(fe_model, model)
    assert set(np.flatnonzero(without.mass.any(axis=(1, 2)))) == set(without.at_nodes)
    basis = make_structural_basis(fe_model, model, mass=True)
    of_mass = np.array([name.startswith("mass of") for name in basis.names])
    assert of_mass.sum() == 20
    assert not basis.stiffness[of_mass].any()
    assert np.abs(basis.mass[of_mass].sum(0) - model.mass).max() < EXACT * np.abs(model.mass).max()


def test_every_node_that_moves_may_have_a_mass(fe_model):
    model = reduced(fe_model)
    basis = make_structural_basis(fe_model, model)
    assert sorted(basis.at_nodes.values()) == list(range(2, 22))
    place = next(place for place, node in basis.at_nodes.items() if node == 7)
    row = model.row(Dof(7, "z"))
    assert_allclose(basis.mass[place], basis.moving_kg * np.outer(row, row), rtol=1e-12)
    one = np.array([dof.direction == "z" for dof in fe_model.all_dofs], float)
    assert_allclose(basis.moving_kg, one @ fe_model.mass_all @ one, rtol=0.5)


def test_what_is_at_a_heavy_sensor_is_the_sensors(fe_model):
    basis = make_structural_basis(fe_model, reduced(fe_model), sensors=(Dof(21, "z"),))
    assert 21 not in basis.at_nodes.values()
    assert 20 in basis.at_nodes.values()


def test_the_mass_of_a_sensor_may_be_a_parameter(fe_model):
    model = reduced(fe_model)
    basis = make_structural_basis(fe_model, model, sensors=(Dof(21, "z"), Dof(21, "z", -1), Dof(5, "ry")))
    of_sensors = np.flatnonzero([name.startswith("mass of the sensor") for name in basis.names])
    assert [basis.names[index] for index in of_sensors] == ["mass of the sensor at 21:z"]
    row = model.row(Dof(21, "z"))
    assert_allclose(basis.mass[of_sensors[0]], np.outer(row, row), rtol=1e-12)
    assert not basis.stiffness[of_sensors].any()


def test_without_parts_the_generic_parameters_are_used(fe_model):
    model = reduced(fe_model)
    basis = make_structural_basis(replace(fe_model, parts=()), model)
    assert basis.names == generic_basis(model).names


def test_generic_parameters_span_every_symmetric_change():
    model = chain(4)
    basis = generic_basis(model)
    assert len(basis.names) == 10
    flat = basis.stiffness.reshape(10, -1)
    assert np.linalg.matrix_rank(flat) == 10
    assert np.array_equal(basis.stiffness, basis.stiffness.transpose(0, 2, 1))


def test_a_generic_change_is_relative_to_the_two_frequencies():
    model = chain(4)
    roots = undamped_poles(model.mass, model.stiffness)
    shapes, omega = roots.right_vectors.real, np.sqrt(roots.values.real)
    basis = generic_basis(model)
    inside = shapes.T @ basis.stiffness[basis.names.index("stiffness 1-3")] @ shapes
    expected = np.zeros((4, 4))
    expected[0, 2] = expected[2, 0] = omega[0] * omega[2]
    assert np.abs(inside - expected).max() < EXACT * expected.max()


def test_rigid_body_modes_stay_where_they_are():
    model = chain(4, free=True)
    basis = generic_basis(model)
    rigid = np.ones(4)
    assert np.abs(basis.stiffness @ rigid).max() < 1e-6 * np.abs(model.stiffness).max()


def test_the_prior_has_the_stated_covariance(fe_model):
    basis = make_structural_basis(fe_model, reduced(fe_model))
    names = [term.name for term in basis.terms]
    assert names[0] == "a factor on the stiffness"
    stds = np.array([term.std for term in basis.terms])
    prior = covariance(basis.terms, stds)[:20, :20]
    assert_allclose(np.diag(prior), GLOBAL_STD**2 + 2 * SEGMENT_STD**2, rtol=1e-6)
    assert prior[0, 1] > prior[0, 5] > prior[0, 19] > GLOBAL_STD**2


def test_the_generic_prior_is_the_same_in_rotated_coordinates():
    """Two modes of one frequency may be mixed at will: the prior of the change must not notice."""
    rng = np.random.default_rng(0)
    root = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    basis = generic_basis(replace(chain(3), mass=np.eye(3), stiffness=1e4 * np.eye(3)), common=False)
    stds = np.array([GENERIC_STD_ALONE])
    whitened = rng.standard_normal((20000, 6))
    members = np.tensordot(unwhiten(basis.terms, stds, whitened), basis.stiffness, 1)
    turned = root.T @ members @ root
    spread = [np.einsum("kab,kcd->abcd", each, each) / len(each) for each in (members, turned)]
    assert np.abs(spread[0] - spread[1]).max() < 0.05 * np.abs(spread[0]).max()


def test_slopes_are_the_derivatives_of_the_amounts(fe_model):
    basis = make_structural_basis(fe_model, reduced(fe_model))
    theta = np.random.default_rng(0).normal(0, 0.1, len(basis.names))
    step = 1e-6
    expected = (basis.amounts(theta + step) - basis.amounts(theta - step)) / (2 * step)
    assert_allclose(basis.slopes(theta), expected, rtol=1e-8)


def test_joined_parameters_have_independent_priors():
    first, second = generic_basis(chain(3)), generic_basis(chain(3), std=0.2, common=False)
    joined = join_bases(first, second)
    stds = np.array([term.std for term in joined.terms])
    prior = covariance(joined.terms, stds)
    assert not prior[:6, 6:].any()
    assert_allclose(prior[:6, :6], covariance(first.terms, stds[:2]), rtol=1e-12)
    assert_allclose(prior[6:, 6:], covariance(second.terms, stds[2:]), rtol=1e-12)


def test_shapes_that_disagree_are_refused():
    with pytest.raises(ShapeError, match="marks of logarithmic"):
        replace(generic_basis(chain(3)), logarithmic=np.zeros(2, bool))
