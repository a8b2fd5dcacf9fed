"""A free structure is free to few printed digits: its rigid-body modes are exactly 0, elastic ones stay right."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import block_diag, eigh

import frf_ipz
from frf_ipz.errors import IllConditionedError
from frf_ipz.fe.eigen import solve_basis, solve_modes
from frf_ipz.pipeline.check.model import look_at_model
from printed_digits import cut

ELEMENTS, LENGTH_M = 6, 0.74


def rounded(matrix, digits):
    return np.array([float(f"{value:.{digits - 1}e}") for value in matrix.ravel()]).reshape(matrix.shape)


def truncated(matrix, digits):
    sizes = np.where(matrix == 0, 1.0, np.abs(matrix))
    return np.sign(matrix) * np.where(matrix == 0, 0.0, cut(sizes, digits))


def planar_beam(positions, second_moment, area=1.2e-4):
    """Stiffness and mass of an Euler-Bernoulli beam in its deflection and slope, for nodes at these positions."""
    size = 2 * len(positions)
    stiffness, mass = np.zeros((2, size, size))
    for place, l in enumerate(np.diff(positions)):  # noqa: E741 - as in the textbook
        rows = slice(2 * place, 2 * place + 4)
        bending = [[12, 6 * l, -12, 6 * l], [6 * l, 4 * l * l, -6 * l, 2 * l * l]]
        bending += [[-12, -6 * l, 12, -6 * l], [6 * l, 2 * l * l, -6 * l, 4 * l * l]]
        inertia = [[156, 22 * l, 54, -13 * l], [22 * l, 4 * l * l, 13 * l, -3 * l * l]]
        inertia += [[54, 13 * l, 156, -22 * l], [-13 * l, -3 * l * l, -22 * l, 4 * l * l]]
        stiffness[rows, rows] += 70e9 * second_moment / l**3 * np.array(bending)
        mass[rows, rows] += 2700 * area * l / 420 * np.array(inertia)
    return stiffness, mass


def rod(positions, rigidity, inertia):
    size = len(positions)
    stiffness, mass = np.zeros((2, size, size))
    for place, length in enumerate(np.diff(positions)):
        rows = slice(place, place + 2)
        stiffness[rows, rows] += rigidity / length * np.array([[1, -1], [-1, 1]])
        mass[rows, rows] += inertia * length / 6 * np.array([[2, 1], [1, 2]])
    return stiffness, mass


def free_beam(positions=None):
    """A free beam in space: bending in two planes, extension and torsion; 6 DOFs a node."""
    if positions is None:
        positions = np.linspace(0.0, LENGTH_M, ELEMENTS + 1)
    nodes = np.arange(1, len(positions) + 1)
    blocks = [
        (planar_beam(positions, 1.4e-9), ("z", "ry"), (1, -1)),
        (planar_beam(positions, 5.8e-9), ("y", "rz"), (1, 1)),
        (rod(positions, 70e9 * 1.2e-4, 2700 * 1.2e-4), ("x",), (1,)),
        (rod(positions, 26e9 * 4e-9, 2700 * 7.2e-9), ("rx",), (1,)),
    ]
    stiffness = block_diag(*(k for (k, _), _, _ in blocks))
    mass = block_diag(*(m for (_, m), _, _ in blocks))
    dofs = [frf_ipz.Dof(int(node), name) for _, names, _ in blocks for node in nodes for name in names]
    signs = np.concatenate([np.tile(sign, len(nodes)) for _, _, sign in blocks])
    coordinates = {int(node): (float(x), 0.0, 0.0) for node, x in zip(nodes, positions, strict=True)}
    return stiffness * np.outer(signs, signs), mass * np.outer(signs, signs), dofs, coordinates


def from_printed(structure, digits, form=rounded, **options):
    stiffness, mass, dofs, coordinates = structure
    half = form(np.tril(stiffness), digits)
    printed = half + np.tril(half, -1).T
    half = form(np.tril(mass), digits)
    return frf_ipz.StructuralModel.from_matrices(
        half + np.tril(half, -1).T, printed, dofs=dofs, coordinates=coordinates, **options
    )


def exact_hz(structure):
    return np.sqrt(np.abs(eigh(*structure[:2], eigvals_only=True))) / (2 * np.pi)


@pytest.mark.parametrize("form", [rounded, truncated])
@pytest.mark.parametrize("digits", [4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 17])
def test_six_rigid_body_modes_are_exactly_zero(digits, form):
    if form is truncated and digits > 12:
        pytest.skip("to cut off the last digits of a double is rounding itself")
    structure = free_beam()
    model = from_printed(structure, digits, form, modal_damping=[0.01, 0.02, 0.03])
    modes = solve_modes(model, n_modes=10)
    assert modes.natural_frequency_hz[:6].tolist() == [0.0] * 6
    assert modes.damping_ratio.tolist() == [0.0] * 6 + [0.01, 0.02, 0.03, 0.03]
    # a mesh of six elements feels a rounding of its entries some thousand times in its lowest bending mode
    assert_allclose(modes.natural_frequency_hz[6:], exact_hz(structure)[6:10], rtol=max(1e3 * 10.0**-digits, 1e-8))


@pytest.mark.parametrize("digits", [4, 6, 8, 11])
def test_nodes_may_lie_anywhere(digits):
    positions = np.round(np.cumsum([0.0, 0.1234, 0.0871, 0.1507, 0.0998, 0.1619]), 4)
    structure = free_beam(positions)
    modes = solve_modes(from_printed(structure, digits), n_modes=8)
    assert modes.natural_frequency_hz[:6].tolist() == [0.0] * 6
    assert_allclose(modes.natural_frequency_hz[6:], exact_hz(structure)[6:8], rtol=max(1e3 * 10.0**-digits, 1e-8))


def test_nodes_may_be_printed_with_four_digits():
    rng = np.random.default_rng(5)
    positions = np.cumsum(np.concatenate([[0.0], rng.uniform(0.08, 0.16, 6)]))
    structure = free_beam(positions)
    coarse = {node: (round(x, 4), y, z) for node, (x, y, z) in structure[3].items()}
    modes = solve_modes(from_printed((*structure[:3], coarse), 7), n_modes=8)
    assert modes.natural_frequency_hz[:6].tolist() == [0.0] * 6
    assert_allclose(modes.natural_frequency_hz[6:], exact_hz(structure)[6:8], rtol=1e-3)


def test_a_large_structure_has_them_too():
    structure = free_beam(np.linspace(0.0, LENGTH_M, 111))
    model = from_printed(structure, 13)
    assert len(model.dofs) > 600
    modes = solve_modes(model, n_modes=8)
    assert modes.natural_frequency_hz[:6].tolist() == [0.0] * 6
    assert_allclose(modes.natural_frequency_hz[6:], exact_hz(structure)[6:8], rtol=1e-3)


@pytest.mark.parametrize("digits", [6, 9, 12])
def test_a_soft_suspension_is_no_rounding(digits):
    """Springs that stand in the printed digits hold the structure: its modes are those of the springs."""
    stiffness, mass, dofs, coordinates = free_beam()
    stiffness = stiffness.copy()
    spring = 200.0 * 10.0**-digits * stiffness.diagonal().max()
    for node in (2, 6):
        for axis in "xyz":
            row = dofs.index(frf_ipz.Dof(node, axis))
            stiffness[row, row] += spring
    model = from_printed((stiffness, mass, dofs, coordinates), digits)
    lowest = solve_basis(model, n_modes=6)
    expected = exact_hz((stiffness, mass))[:6]
    assert lowest.n_rigid <= 1  # nothing holds it about x
    assert_allclose(lowest.natural_frequency_hz[1:], expected[1:], rtol=0.1)


def test_numbers_that_a_person_has_written_are_exact():
    """A chain of springs of 1e5 N/m, one of 10 N/m to the ground: five digits, and none of them rounded."""
    stiffness = 1e5 * (2 * np.eye(6) - np.eye(6, k=1) - np.eye(6, k=-1))
    stiffness[0, 0] = stiffness[5, 5] = 1e5
    stiffness[0, 0] += 10.0
    model = frf_ipz.StructuralModel.from_matrices(np.eye(6), stiffness, dofs=[f"{node}:x" for node in range(1, 7)])
    expected = np.sqrt(np.linalg.eigvalsh(stiffness)) / (2 * np.pi)
    assert_allclose(solve_modes(model).natural_frequency_hz, expected, rtol=1e-9)


@pytest.mark.parametrize("spring", [0.0, 1e4])
def test_round_numbers_are_not_rounded_ones(spring):
    """A beam of elements of 6 cm has no more than four digits in its stiffness, E I is 403.2: none is cut off."""
    n_elements, length, rigidity = 12, 0.06, 403.2
    element = np.array([[12, -6, -12, -6], [-6, 4, 6, 2], [-12, 6, 12, 6], [-6, 2, 6, 4]])
    powers = length ** -np.array([[3, 2, 3, 2], [2, 1, 2, 1], [3, 2, 3, 2], [2, 1, 2, 1]])
    stiffness = np.zeros((2 * n_elements + 2,) * 2)
    for first in range(0, 2 * n_elements, 2):
        stiffness[first : first + 4, first : first + 4] += rigidity * element * powers
    held = 0 if spring else 2
    stiffness = stiffness[held:, held:]
    for row in (4, 20):
        stiffness[row, row] += spring
    mass = np.tile([0.08, 1e-5], n_elements + 1)[held:]
    nodes = range(1 + held // 2, n_elements + 2)
    model = frf_ipz.StructuralModel.from_matrices(
        np.diag(mass),
        stiffness,
        dofs=[f"{node}:{name}" for node in nodes for name in ("z", "ry")],
        coordinates={node: ((node - 1) * length, 0.0, 0.0) for node in nodes},
    )
    assert model.rounding > 1e-6  # what their digits look like
    expected = np.sqrt(eigh(stiffness, np.diag(mass), eigvals_only=True)) / (2 * np.pi)
    assert_allclose(solve_modes(model, n_modes=4).natural_frequency_hz, expected[:4], rtol=1e-5)


@pytest.mark.parametrize("digits", [4, 8])
def test_an_elastic_mode_that_rounding_hides_is_refused(digits):
    """A clamped beam of twelve elements, E I no round number: four digits leave nothing of its first mode."""
    stiffness, mass = (matrix[2:, 2:] for matrix in planar_beam(np.linspace(0.0, 0.72, 13), 5.83e-9))
    dofs = [frf_ipz.Dof(node, name) for node in range(2, 14) for name in ("y", "rz")]
    structure = stiffness, mass, dofs, {node: (0.06 * (node - 1), 0.0, 0.0) for node in range(2, 14)}
    model = from_printed(structure, digits)
    if digits == 4:
        with pytest.raises(IllConditionedError, match=r"printed with about 4 digits, which do not tell . elastic mode"):
            solve_modes(model, n_modes=4)
        (point,) = look_at_model(model).open_points  # a check that finds nothing open says that everything fits
        assert point.startswith("modes of the model cannot be computed: the stiffness of the model")
    else:
        assert_allclose(solve_modes(model, n_modes=4).natural_frequency_hz, exact_hz(structure)[:4], rtol=1e-4)
