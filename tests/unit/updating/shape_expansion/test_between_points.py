"""Points beyond the measured ones have the band of left-out ends, those between the band of left-out inner points."""

import numpy as np
import pytest

import frf_ipz
from frf_ipz.updating.shape_expansion.between_points import inner_points, lies_between

SENSORS = tuple(frf_ipz.Dof(node, "z") for node in (3, 5, 7, 9))


@pytest.fixture(scope="module")
def beam():
    return frf_ipz.make_beam(
        length_m=0.5, width_m=0.02, thickness_m=0.002, youngs_modulus_Pa=200e9, density_kg_m3=8000, elements=10
    )


def test_a_corner_of_a_plate_lies_beyond_and_its_middle_between():
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], float)
    assert lies_between(np.array([0.5, 0.5, 0.0]), corners)
    assert not lies_between(corners[3], corners[:3])
    assert not lies_between(np.array([0.5, 0.5, 0.1]), corners)


def test_inner_nodes_and_points_lie_between_measured_ones(beam):
    nodes, is_inner = inner_points(SENSORS, SENSORS, beam.dofs, beam.geometry)
    assert nodes == tuple(range(3, 10))
    assert list(is_inner) == [False, True, True, False]


def test_without_places_no_point_is_known_to_lie_between_others(beam):
    nodes, is_inner = inner_points(SENSORS, SENSORS, beam.dofs, None)
    assert nodes == ()
    assert not is_inner.any()


def test_the_spread_is_whole_beyond_the_measured_points():
    expansion = frf_ipz.ShapeExpansion(
        points=("3:z",),
        ratio=np.ones(1),
        error_db=np.ones(1),
        updated_error_db=np.full(1, 4.0),
        stiffness_ratio=1.0,
        masses=(),
        split=(),
        is_level_known=True,
        inner_nodes=(3, 4, 5),
        inner_spread=0.5,
    )
    spreads = [expansion.spread_at(dof) for dof in (frf_ipz.Dof(4, "z"), frf_ipz.Dof(6, "z"), frf_ipz.PortDof("tip"))]
    assert spreads == [0.5, 1.0, 1.0]
