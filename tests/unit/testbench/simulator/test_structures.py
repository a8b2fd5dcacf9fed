"""Frames, grids, plates and nominal models against closed formulas and against each other."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from frf_testbench.simulator.signals.receptance import make_receptance, solve_modes
from frf_testbench.simulator.structures.frames import FrameDrawing, Spring, build_frame
from frf_testbench.simulator.structures.grids import GridDrawing, Member, build_grid
from frf_testbench.simulator.structures.nominal import build_nominal_grid, build_nominal_plate
from frf_testbench.simulator.structures.plates import PlateDrawing, build_plate
from frf_testbench.simulator.structures.reality import Extra, Reality, Variation
from frf_testbench.simulator.structures.structure import Point

EIGENSOLVER = 1e-9  # what a dense generalised eigenproblem leaves of exact matrices
SPLINES = 2e-6  # of a plate on 20 intervals, in its first six frequencies
CONVERGED = 1e-4  # what a user may expect of a nominal model within its band

PLATE = PlateDrawing(
    size_m=(0.6, 0.4), thickness_m=0.003, nodes_x=10, nodes_y=8, split=(4, 3), youngs_modulus_pa=2.1e11,
    density_kg_m3=7800.0, poisson_ratio=0.3, edges={},
)  # fmt: skip
GRID = GridDrawing(
    ties_x_m=(0.0, 0.3, 0.5), rails_y_m=(0.0, 0.4), divisions_x=(6, 6), divisions_y=(8,), rail=(0.03, 0.008),
    tie=(0.02, 0.01), youngs_modulus_pa=7e10, density_kg_m3=2700.0, poisson_ratio=0.33, supports={},
)  # fmt: skip
HELD_GRID = replace(GRID, supports={1: "clamped", 6: "pinned"})


@pytest.fixture(scope="module")
def nominal_plate():
    return build_nominal_plate(PLATE)


def chain(n, ends="one"):
    pairs = [(i, i + 1) for i in range(0 if ends == "one" else 1, n)]
    springs = tuple(Spring(id=f"k{i + 1}", nodes=pair, stiffness_n_m=1e5) for i, pair in enumerate(pairs))
    return FrameDrawing(masses_kg=(2.0,) * n, springs=springs)


def test_a_uniform_chain_has_the_frequencies_of_the_textbook():
    omega = solve_modes(build_frame(chain(9))).omega_rad_s
    k = np.arange(1, 10)
    assert_allclose(omega, 2 * np.sqrt(1e5 / 2) * np.sin((2 * k - 1) * np.pi / (2 * 19)), rtol=EIGENSOLVER)


def test_a_free_chain_has_a_suspension_as_soft_as_asked():
    drawing = chain(6, ends="none")
    bare, hung = (solve_modes(build_frame(drawing, Reality(suspension_hz=hz))) for hz in (0.0, 0.4))
    assert drawing.n_rigid == 1
    assert_allclose(hung.frequencies_hz[0], 0.4, rtol=1e-3)  # the flexible modes give a little
    assert_allclose(hung.frequencies_hz[1:], bare.frequencies_hz[1:], rtol=1e-3)  # and feel the suspension a little


def test_reality_changes_a_frame_as_it_says():
    drawing = chain(3)
    reality = Reality(
        softened=(("k2", 0.5),),
        stiffness_ratio=2.0,
        extras=(
            Extra(point=Point(3, "x"), mass=1.5),
            Extra(point=Point(1, "x"), stiffness=3e4, second_point=Point(3, "x")),
            Extra(point=Point(2, "x"), stiffness=1e4),
        ),
        density=Variation(parts=np.array([0.01, 0.0, 0.0])),
    )
    frame = build_frame(drawing, reality)
    assert_allclose(np.diag(frame.mass), [2.02, 2.0, 3.5], rtol=1e-12)
    expected = np.array([[3e5 + 3e4, -1e5, -3e4], [-1e5, 3e5 + 1e4, -2e5], [-3e4, -2e5, 2e5 + 3e4]])
    assert_allclose(frame.stiffness, expected, rtol=1e-12)


def test_a_simply_supported_plate_has_naviers_frequencies():
    edges = dict.fromkeys(("left", "right", "bottom", "top"), "pinned")
    omega = solve_modes(build_plate(replace(PLATE, edges=edges))).omega_rad_s[:6]
    m, n = np.meshgrid(np.arange(1, 8), np.arange(1, 8))
    squares = np.sort(((m * np.pi / 0.6) ** 2 + (n * np.pi / 0.4) ** 2).ravel())[:6]
    assert_allclose(omega, squares * np.sqrt(PLATE.rigidity / (7800.0 * 0.003)), rtol=SPLINES)


def test_a_plate_moves_as_a_rigid_body_without_strain():
    plate = build_plate(PLATE)
    modes = solve_modes(plate)
    assert plate.n_rigid == 3
    assert (modes.omega_rad_s[:3] < 1e-3 * modes.omega_rad_s[3]).all()


def test_softened_panels_of_truth_and_nominal_plate_agree(nominal_plate):
    softened = build_plate(PLATE, Reality(softened=(("panel_2", 0.7),)))
    stiffness, _ = nominal_plate.groups["panel_2"]
    changed = replace(nominal_plate, stiffness=nominal_plate.stiffness - 0.3 * stiffness)
    truth, model = (solve_modes(one).frequencies_hz[3:9] for one in (softened, changed.structure()))
    assert_allclose(model, truth, rtol=CONVERGED)


def assert_nominal_frequencies(truth, nominal):
    rigid = truth.n_rigid
    frequencies = [solve_modes(one).frequencies_hz[rigid : rigid + 6] for one in (truth, nominal.structure())]
    assert_allclose(frequencies[1], frequencies[0], rtol=CONVERGED)


@pytest.mark.parametrize("drawing", [GRID, HELD_GRID], ids=["free", "held"])
def test_nominal_matrices_have_the_frequencies_of_the_true_grid(drawing):
    assert_nominal_frequencies(build_grid(drawing), build_nominal_grid(drawing))


def test_nominal_matrices_have_the_frequencies_of_the_true_plate(nominal_plate):
    assert_nominal_frequencies(build_plate(PLATE), nominal_plate)


def test_groups_add_up_to_the_whole(nominal_plate):
    for model in (build_nominal_grid(GRID), nominal_plate):
        for i, whole in enumerate((model.stiffness, model.mass)):
            total = sum(parts[i] for parts in model.groups.values())
            assert_allclose(total, whole, rtol=0, atol=1e-12 * np.abs(whole).max())


def test_rows_of_a_grid_follow_an_offset_along_the_member():
    grid = build_grid(GRID)
    shape = solve_modes(grid).shapes[:, 3]
    middle = next(node for node, place in grid.nodes.items() if 0 < place[0] < 0.3 and place[1] == 0)
    here, turn = (grid.row(Point(middle, direction)) @ shape for direction in ("z", "ry"))
    there = grid.row(Point(middle, "z", (1e-4, 0.0))) @ shape
    assert_allclose(there - here, -1e-4 * turn, rtol=1e-2)  # dw/dx = -ry, to the curvature over 0.1 mm


def test_rows_of_a_plate_follow_an_offset_along_both_sides():
    plate = build_plate(PLATE)
    shape = solve_modes(plate).shapes[:, 5]
    here = plate.row(Point(34)) @ shape
    for direction, sign, offset in (("ry", -1, (1e-4, 0.0)), ("rx", 1, (0.0, 1e-4))):
        there = plate.row(Point(34, "z", offset)) @ shape
        assert_allclose(there - here, sign * 1e-4 * (plate.row(Point(34, direction)) @ shape), rtol=1e-2)


def test_a_crossing_turns_as_its_members_slope():
    grid = build_grid(GRID)
    shape = solve_modes(grid).shapes[:, 4]
    here = grid.row(Point(1)) @ shape
    there = grid.row(Point(1, "z", (1e-5, 0.0))) @ shape
    assert_allclose(there - here, -1e-5 * (grid.row(Point(1, "ry")) @ shape), rtol=1e-2)  # the curvature over 0.01 mm
    second, last = GRID.layout[1][3].nodes[1], GRID.layout[1][3].nodes[-1]  # of the first tie, along y
    for node, step in ((second, 1e-5), (last, -1e-5)):
        slope = (grid.row(Point(node, "z", (0.0, step))) - grid.row(Point(node))) @ shape / step
        assert_allclose(slope, grid.row(Point(node, "rx")) @ shape, rtol=1e-2)


def test_torsion_of_rectangles_is_that_of_saint_venant():
    square, flat = (Member(name="", nodes=(), along_x=True, width_m=w, thickness_m=0.01) for w in (0.01, 0.1))
    assert_allclose(square.torsion_constant, 0.1406 * 0.01**4, rtol=5e-3)  # what the closed approximation claims
    assert_allclose(flat.torsion_constant, 0.3123 * 0.1 * 0.01**3, rtol=5e-3)


def test_modes_above_the_sum_enter_by_their_static_compliance():
    frame = build_frame(chain(30))
    modes = solve_modes(frame)
    rows = np.array([frame.row(Point(node, "x")) for node in (4, 5)])
    ratio, s = np.full(30, 0.01), 2j * np.pi * np.linspace(0.1, modes.frequencies_hz[1], 20)
    whole = make_receptance(modes, rows, ratio, np.inf)(s, [0, 1], [0, 1])
    cut = make_receptance(modes, rows, ratio, float(modes.frequencies_hz[15]))(s, [0, 1], [0, 1])
    assert_allclose(cut, whole, rtol=1e-2)  # the square of the frequency ratio, of a small part
    bare = replace(make_receptance(modes, rows, ratio, float(modes.frequencies_hz[15])), static=np.zeros((2, 2)))
    assert np.abs(bare(s, [0], [0]) / whole[:, :1, :1] - 1).max() > 0.05
