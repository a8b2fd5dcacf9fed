"""Shapes: measured and model are the same motion where the measurement is the model's own."""

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from chains import chain, label
from frf_ipz.dofs import Dof, PortDof
from frf_ipz.errors import InputError
from frf_ipz.fe.response import compute_frfs
from frf_ipz.numerics.pencils import damped_poles
from frf_ipz.pairing.pairs import PairVerdict
from frf_ipz.quantities import FrfQuantity
from frf_ipz.runs.shapes import (
    MOST_NODES,
    REACH,
    STEPS,
    Motion,
    Shape,
    Structure,
    draw_shape,
    mode_shape,
    operating_shape,
)
from frf_ipz.structure import Geometry, Mesh

ROUNDING = 1e-9  # of the largest value: a 5 by 5 solve, and eigenvectors of a lightly damped pencil
LABELS = (
    label(-2, 4, FrfQuantity.ACCELERANCE),
    label(3, 4, FrfQuantity.ACCELERANCE),
    label(5, 4, FrfQuantity.MOBILITY),
    label(5, -1, FrfQuantity.RECEPTANCE),
)


def poles_of(model):
    roots = damped_poles(model.mass, model.damping, model.stiffness)
    upper = roots.take(np.flatnonzero(roots.values.imag > 0))
    return upper.take(np.argsort(np.abs(upper.values)))


def measured_run(model, nominal):
    """FRFs and a fit that are the model's own, paired with a nominal model."""
    frequency = np.linspace(1.0, 80.0, 80)
    s = 2j * np.pi * frequency
    frfs = SimpleNamespace(frequency_hz=frequency, s=s, values=compute_frfs(model, LABELS, s), labels=LABELS)
    roots, nominal_roots = poles_of(model), poles_of(nominal)
    shapes = np.stack(
        [
            roots.right_vectors[[abs(label.output_dof.node) - 1 for label in LABELS]],
            roots.right_vectors[[label.input_dof.node - 1 for label in LABELS]],
        ]
    ).prod(axis=0)
    signs = np.array([label.sign for label in LABELS])
    powers = np.array([label.quantity.power for label in LABELS])
    residues = (shapes * signs[:, None]).T * roots.values[:, None] ** powers
    fit = SimpleNamespace(
        n_modes=5, labels=LABELS, modes_given=None, model=SimpleNamespace(poles=roots.values, residues=residues)
    )
    targets = [
        SimpleNamespace(kind="pole", measured=k, computed_value=value, verdict=PairVerdict.PAIRED)
        for k, value in enumerate(nominal_roots.values)
    ]
    updated = SimpleNamespace(model=model, nominal=nominal, after=roots.values)
    return SimpleNamespace(fit=fit, frfs=frfs, updated_model=updated, pairs=SimpleNamespace(targets=targets))


@pytest.fixture
def run():
    return measured_run(chain(seed=1), chain(seed=2))


def at(motion, dofs):
    values = dict(zip(motion.dofs, motion.values, strict=True))
    return np.array([values[dof] for dof in dofs])


def test_the_operating_shape_of_a_model_is_that_of_its_own_frfs(run):
    updated, nominal, measured = operating_shape(run, 33.2, "4:+x").motions
    assert [motion.name for motion in (updated, nominal, measured)] == ["updated", "nominal", "measured"]
    assert measured.dofs == (Dof(2, "x"), Dof(3, "x"), Dof(5, "x"))
    assert_allclose(at(updated, measured.dofs), measured.values, rtol=ROUNDING)
    assert np.abs(at(nominal, measured.dofs) / measured.values - 1).max() > 0.1


def test_an_input_in_the_negative_direction_turns_the_shape(run):
    updated, _, measured = operating_shape(run, 33.2, "1:-x").motions
    assert_allclose(at(updated, measured.dofs), measured.values, rtol=ROUNDING)


@pytest.mark.parametrize("number", range(5))
def test_a_mode_of_the_updated_model_is_the_measured_one(run, number):
    updated, nominal, measured = mode_shape(run, number).motions
    assert set(measured.dofs) == {Dof(2, "x"), Dof(3, "x"), Dof(5, "x")}
    assert_allclose(at(updated, measured.dofs), measured.values, atol=1e-7 * np.abs(measured.values).max(), rtol=0)
    assert "MAC 1.000 at 3 DOFs" in updated.title
    assert np.abs(measured.values.real).max() == pytest.approx(1.0, rel=1e-3)
    assert f"{abs(poles_of(run.updated_model.nominal).values[number]) / 2 / np.pi:.5g} Hz" in nominal.title


def test_a_run_without_a_model_has_the_measured_shape_alone(run):
    run.updated_model = run.pairs = None
    assert [motion.name for motion in mode_shape(run, 0).motions] == ["measured"]
    assert [motion.name for motion in operating_shape(run, 20.0, "4:+x").motions] == ["measured"]


def test_a_mode_that_the_model_lacks_is_said_to_be_without_counterpart(run):
    del run.pairs.targets[2]
    (measured,) = mode_shape(run, 2).motions
    assert "no counterpart" in measured.title
    assert len(mode_shape(run, 3).motions) == 3


def test_what_was_not_measured_is_refused(run):
    for wrong in (-1, 5):
        with pytest.raises(InputError, match="has no mode"):
            mode_shape(run, wrong)
    with pytest.raises(InputError, match="no FRF was measured"):
        operating_shape(run, 20.0, "7:+x")
    with pytest.raises(InputError, match="no FRF was measured"):
        operating_shape(run, np.nan, "4:+x")


def shape_of(values, nodes, direction, name="measured"):
    dofs = tuple(Dof(node, direction) for node in nodes)
    return Motion(name=name, title=name, dofs=dofs, values=np.asarray(values, complex))


def drawn_on(geometry, motions, kinds=None):
    structure = Structure.of(geometry, [dof for motion in motions for dof in motion.dofs], kinds)
    return structure.to_json(), draw_shape(Shape(title="t", motions=motions), structure)["motions"]


def test_a_row_of_nodes_moves_upwards_by_a_fixed_part_of_its_length():
    geometry = Geometry(
        nodes=np.array([1, 2, 3]),
        coordinates_m=np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]),
        lines=np.array([[1, 2], [2, 3]]),
    )
    structure, (updated, measured) = drawn_on(
        geometry, (shape_of([1, 2j], [2, 3], "y", "updated"), shape_of([-2], [3], "y"))
    )
    assert structure["at"] == [[-STEPS / 2, 0, 0], [0, 0, 0], [STEPS / 2, 0, 0]]
    assert structure["lines"] == [[0, 1], [1, 2]]
    assert structure["isRow"]
    full = round(REACH * STEPS)
    assert (measured["rows"], measured["real"]) == ([2], [[0, 0, -full]])
    assert updated["isWhole"]  # node 1 is held: no DOF of it moves
    assert updated["real"] == [[0, 0, 0], [0, 0, full // 2], [0, 0, 0]]
    assert updated["imag"] == [[0, 0, 0], [0, 0, 0], [0, 0, full]]


def test_a_model_that_is_far_off_leaves_the_measurement_visible():
    motions = (shape_of([1e3], [2], "z", "updated"), shape_of([1.0], [2], "z"))
    geometry = Geometry(
        nodes=np.array([1, 2]), coordinates_m=np.array([[0.0, 0, 0], [3, 0, 0]]), lines=np.array([[1, 2]])
    )
    for known in (None, geometry):
        _, (_, measured) = drawn_on(known, motions)
        assert measured["real"][0][2] == round(REACH * STEPS / 3)


PLATE = Geometry(
    nodes=np.array([1, 2, 3, 4]),
    coordinates_m=np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]),
    lines=np.array([[1, 2], [2, 3], [3, 4], [4, 1]]),
    ports={"tilt": (1, 3)},
)


def test_a_plate_is_a_surface_and_moves_in_space():
    structure, (measured,) = drawn_on(PLATE, (shape_of([0, 0, 1], [1, 2, 3], "z"),))
    assert structure["faces"] == [(0, 1, 2, 3)]
    assert not structure["isRow"]
    assert measured["real"][2] == [0, 0, round(REACH * STEPS)]


def test_a_port_is_marked_at_the_nodes_that_it_joins():
    kinds = {"sensor": [Dof(2, "z", -1)], "point": [PortDof("tilt"), PortDof("unknown")]}
    structure, _ = drawn_on(PLATE, (shape_of([1.0], [3], "z"),), kinds)
    assert structure["marks"] == [
        {"kind": "sensor", "text": "2:-z", "rows": [1]},
        {"kind": "point", "text": "tilt", "rows": [0, 2]},
    ]


def test_of_many_nodes_those_that_were_measured_are_drawn():
    count = 3 * MOST_NODES
    geometry = Geometry(
        nodes=np.arange(1, count + 1),
        coordinates_m=np.random.default_rng(1).normal(size=(count, 3)),
        lines=np.zeros((0, 2), np.int64),
    )
    structure, (measured,) = drawn_on(geometry, (shape_of([1.0, 2.0], [2, 8999], "z"),))
    assert len(structure["nodes"]) <= MOST_NODES + 3
    assert [structure["nodes"][row] for row in measured["rows"]] == [2, 8999]


def plate_of_quadrilaterals(count):
    """A square of count by count faces whose nodes are those of a model, but for the first row, which is held."""
    across = np.arange(count + 1)
    grid = 1 + across + (count + 1) * across[:, None]
    corners = [grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]]
    faces = np.stack([part.ravel() for part in corners], 1)
    places = np.stack([*(part.ravel() / count for part in np.meshgrid(across, across)), np.zeros(grid.size)], 1)
    lines = np.unique(np.sort(np.stack([faces, np.roll(faces, 1, axis=1)], 2).reshape(-1, 2), axis=1), axis=0)
    mesh = Mesh(nodes=grid.ravel(), coordinates_m=places, lines=lines, faces=faces)
    moving = grid[1:].ravel()
    return Geometry(nodes=moving, coordinates_m=places[count + 1 :], lines=np.zeros((0, 2), int), mesh=mesh)


def test_faces_of_a_mesh_are_drawn_and_held_nodes_stay():
    geometry = plate_of_quadrilaterals(3)
    structure = Structure.of(geometry, [Dof(16, "z")])
    assert len(structure.faces) == 9
    assert len(structure.nodes) == 16
    dofs = tuple(Dof(int(node), "z") for node in geometry.nodes)
    shape = Shape(title="", motions=(Motion(name="measured", title="", dofs=dofs, values=np.ones(12, complex)),))
    motion = draw_shape(shape, structure)["motions"][0]
    assert motion["isWhole"]
    assert [row[2] > 0 for row in motion["real"]] == [False] * 4 + [True] * 12


def test_of_many_nodes_the_surface_stays_closed():
    geometry = plate_of_quadrilaterals(99)
    structure = Structure.of(geometry, [Dof(777, "z")])
    assert len(structure.nodes) <= MOST_NODES
    assert 777 in structure.nodes
    corners = structure.positions_m[:, :2]
    area = 0.0
    for face in structure.faces:
        x, y = corners[list(face)].T
        area += abs(np.dot(x, np.roll(y, 1)) - np.dot(y, np.roll(x, 1))) / 2
    assert 0.9 < area < 1.1


def test_a_sensor_inside_of_a_mesh_is_drawn_beside_it():
    geometry = plate_of_quadrilaterals(2)
    inside = Geometry(
        nodes=np.append(geometry.nodes, 50), coordinates_m=np.vstack([geometry.coordinates_m, [[0.5, 0.5, -0.1]]]),
        lines=geometry.lines, mesh=geometry.mesh,
    )  # fmt: skip
    assert 50 not in Structure.of(inside, []).nodes
    assert 50 in Structure.of(inside, [Dof(50, "z")]).nodes
