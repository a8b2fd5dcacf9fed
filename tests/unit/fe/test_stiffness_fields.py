"""Shares of an assembled stiffness: in balance, with a whole sum, and near what the elements say."""

import numpy as np
from numpy.testing import assert_allclose
from scipy import linalg, sparse

import wafer_stage
from frf_ipz.dofs import Dof
from frf_ipz.fe.global_motions import rigid_body_motions
from frf_ipz.fe.stiffness_fields import stiffness_shares
from frf_ipz.structure import Geometry

ROUNDING = 1e-12  # of the largest entry, over some 1e4 products


def plate():
    quarters, places = wafer_stage.parts()
    dofs = [Dof(node + 1, axis) for node in range(len(places)) for axis in "xyz"]
    nodes = np.arange(1, len(places) + 1)
    return quarters, dofs, Geometry(nodes=nodes, coordinates_m=places, lines=np.zeros((0, 2), int))


def halves(geometry):
    """Give weights that fade from one end of the stage to the other."""
    along = np.repeat(geometry.coordinates_m[:, 0] / wafer_stage.SIDES_M[0], 3)
    return np.stack([along, 1 - along], axis=1)


def test_shares_sum_to_the_stiffness_and_take_rigid_motion_without_force():
    quarters, dofs, geometry = plate()
    stiffness = sum(quarter[0] for quarter in quarters)
    shares = stiffness_shares(stiffness, dofs, geometry, halves(geometry))
    size = abs(stiffness).max()
    motions = rigid_body_motions(dofs, geometry)
    assert abs(sum(shares) - stiffness).max() < ROUNDING * size
    for share in shares:
        assert abs(share @ motions).max() < ROUNDING * size
        assert abs(share - share.T).max() == 0.0


def test_a_spring_to_the_ground_belongs_to_the_fields_of_its_node():
    quarters, dofs, geometry = plate()
    spring = sparse.coo_array(([1e6], ([2], [2])), shape=(len(dofs),) * 2)
    stiffness = sparse.csr_array(sum(quarter[0] for quarter in quarters) + spring)
    weights = halves(geometry)
    shares = stiffness_shares(stiffness, dofs, geometry, weights)
    motions = rigid_body_motions(dofs, geometry)
    for share, weight in zip(shares, weights.T, strict=True):
        forces = weight[:, None] * (spring @ motions)
        assert abs(share @ motions - forces).max() < ROUNDING * abs(stiffness).max()


def test_energies_of_modes_are_those_of_the_elements():
    """A step of the modulus halfway: what it does to frequencies, by the shares and by the elements on its side."""
    quarters, dofs, geometry = plate()
    nominal = [sum(quarter[place] for quarter in quarters) for place in range(2)]
    values, modes = linalg.eigh(nominal[0].toarray(), nominal[1].toarray(), subset_by_index=[6, 25])
    along = geometry.coordinates_m[:, 0] / wafer_stage.SIDES_M[0]
    side = np.repeat(np.where(np.isclose(along, 0.5), 0.5, along < 0.5), 3)
    share = stiffness_shares(nominal[0], dofs, geometry, np.stack([side, 1 - side], axis=1))[0]
    elements = quarters[0][0] + quarters[2][0]
    energies = [(modes.T @ (matrix @ modes)) / np.sqrt(np.outer(values, values)) for matrix in (elements, share)]
    assert np.std(energies[1] - energies[0]) < 0.15 * np.std(energies[0])
    assert_allclose(np.diagonal(energies[1]), np.diagonal(energies[0]), rtol=0, atol=0.05)
