"""Three-dimensional machines: their matrices against formulas, and what their owners hand in."""

import json

import numpy as np
import pytest
from scipy.sparse.linalg import eigsh

import frf_ipz
from frf_testbench.machines.drawings import KINDS, draw_machine
from frf_testbench.machines.frames import DIRECTIONS, Drawing, Member, build_mesh, find_nominal_nodes
from frf_testbench.machines.machine import make_machine
from frf_testbench.machines.prove import plan_machines

LENGTH_M, SIDE_M, HEIGHT_M, YOUNGS_PA, DENSITY = 1.0, 0.02, 0.03, 2e11, 8000.0
ROOTS = 1.8751, 4.6941  # of a cantilever in bending
ELEMENTS = 1e-4  # relative: bending by 20 cubic elements
AT_REST = 1e-6  # of the stiffness: forces of a rigid motion


def bar(direction):
    return Drawing(
        kind="bar",
        points=np.array([[0.0, 0.0, 0.0], LENGTH_M * np.array(direction) / np.linalg.norm(direction)]),
        members=(Member(ends=(0, 1), size_m=(HEIGHT_M, SIDE_M), wall_m=0.0, up=(0.0, 0.3, 1.0), group="bar"),),
        elements=20,
        youngs_modulus_pa=YOUNGS_PA,
        density_kg_m3=DENSITY,
        mounts={},
        lumps={},
    )


@pytest.mark.parametrize("direction", [(1.0, 0.0, 0.0), (0.3, -0.5, 0.8)])
def test_a_bar_in_any_direction_bends_like_a_cantilever(direction):
    mesh = build_mesh(bar(direction))
    free = np.arange(6, 6 * len(mesh.nodes))
    stiffness, mass = mesh.total_stiffness()[free][:, free], mesh.mass[free][:, free]
    found = np.sqrt(np.sort(eigsh(stiffness, 4, mass, sigma=0.0)[0]))
    radius = np.array([SIDE_M, HEIGHT_M]) / np.sqrt(12)
    bending = np.outer(np.square(ROOTS) / LENGTH_M**2, radius) * np.sqrt(YOUNGS_PA / DENSITY)
    np.testing.assert_allclose(found, np.sort(bending.ravel()), rtol=ELEMENTS)


@pytest.mark.parametrize("kind", list(KINDS))
def test_a_machine_on_mounts_has_forces_against_rigid_motion_at_its_mounts_alone(kind):
    drawing = draw_machine(np.random.default_rng(4), kind)
    mesh = build_mesh(drawing)
    assert 500 <= 6 * len(mesh.nodes) <= 3000
    rigid = np.zeros(6 * len(mesh.nodes))
    turn = np.array([0.2, -0.5, 0.3])
    motion = np.array([1.0, 2.0, -1.0]) + np.cross(turn, mesh.nodes)
    rigid.reshape(-1, 6)[:, :3], rigid.reshape(-1, 6)[:, 3:] = motion, turn
    force = mesh.total_stiffness() @ rigid
    held = [6 * point + row for point in drawing.mounts for row in range(3)]
    assert np.abs(np.delete(force, held)).max() < AT_REST * mesh.total_stiffness().diagonal().max()
    np.testing.assert_allclose(build_mesh(drawing, refine=2).nodes[find_nominal_nodes(drawing, 2)], mesh.nodes)


def test_a_machine_is_what_its_owner_can_hand_in(tmp_path):
    machine = make_machine(12, "mount")
    machine.write(tmp_path / "case", tmp_path / "sealed" / "case.json")
    model = frf_ipz.read_model(tmp_path / "case" / "model.toml")
    test = frf_ipz.read_test(tmp_path / "case" / "test.toml")
    truth = json.loads((tmp_path / "sealed" / "case.json").read_text(encoding="utf-8"))
    assert len(model.all_dofs) == truth["structure"]["dofs"] == len(DIRECTIONS) * len(machine.nominal.nodes)
    assert {part.name for part in model.parts} >= set(truth["location"]["groups"])
    assert {label.output_dof.direction for label in test.labels} == {"x", "y", "z"}


def test_a_third_of_the_machines_are_sound_and_names_tell_nothing():
    orders = plan_machines(5, 30)
    assert sum(order.effect == "null" for order in orders) == 10
    assert len({order.effect for order in orders}) == 14
    assert not any(order.effect in order.name for order in orders)
