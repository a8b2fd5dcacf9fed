"""FRFs and poles of models against direct solves of the dynamic stiffness."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import linalg

from fe_models import beam, read_text_model, structural_model
from frf_ipz.dofs import Dof, parse_dof
from frf_ipz.errors import InputError
from frf_ipz.fe import response
from frf_ipz.fe.eigen import solve_basis
from frf_ipz.fe.response import compute_frfs, model_poles
from frf_ipz.frf import FrfLabel
from frf_ipz.quantities import FrfQuantity
from frf_ipz.structure import ReducedModel

DIRECT = 1e-7  # of each FRF's largest value: modal sums against solves with condition numbers up to 1e9
S = 12.0 + 2j * np.pi * np.array([3.0, 40.0, 106.0, 251.0, 500.0, 790.0])
CHAIN = """
[model]
kind = "lumped"
name = "chain"
[damping]
modal_ratio = 0.01
[lumped]
mass = [{ node = 1, mass_kg = 2.0 }, { node = 2, mass_kg = 3.0 }, { node = 3, mass_kg = 1.0 }]
spring = [
  { id = "a", nodes = [0, 1], stiffness_N_m = 4e5 },
  { id = "b", nodes = [1, 2], stiffness_N_m = 3e5, damping_Ns_m = 40.0 },
  { id = "c", nodes = [2, 3], stiffness_N_m = 2e5 },
]
"""


def label(output, excited, quantity=FrfQuantity.RECEPTANCE):
    return FrfLabel(parse_dof(output), parse_dof(excited), quantity)


def modal_damping_matrix(model):
    """M Phi diag(2 zeta omega) Phi^T M of all modes, by LAPACK's plain solver."""
    mass = model.mass.toarray()
    values, shapes = linalg.eigh(model.stiffness.toarray(), mass)
    omega = np.sqrt(np.maximum(values, 0))
    omega[values < 1e-9 * values[-1] / len(values)] = 0 if values[0] < 1e-9 * values[-1] / len(values) else omega[0]
    elastic = omega > 1e-6 * omega[-1]
    ratios = np.zeros(len(values))
    stated = model.modal_damping
    ratios[elastic] = stated[np.minimum(np.arange(elastic.sum()), len(stated) - 1)]
    return mass @ shapes @ np.diag(2 * ratios * omega) @ shapes.T @ mass


def direct(model, labels, s, damping=None):
    """FRFs by solving the dynamic stiffness at every line."""
    damping = model.damping.toarray() + (0 if damping is None else damping)
    values = np.zeros((len(s), len(labels)), complex)
    for line, value in enumerate(s):
        dynamic = value**2 * model.mass.toarray() + value * damping + model.stiffness.toarray()
        for column, frf_label in enumerate(labels):
            load = np.zeros(len(dynamic))
            load[model.index(frf_label.input_dof)] = 1.0
            receptance = np.linalg.solve(dynamic, load)[model.index(frf_label.output_dof)]
            values[line, column] = frf_label.sign * receptance * value**frf_label.quantity.power
    return values


def require_same(computed, expected, tolerance=DIRECT):
    assert_allclose(computed / np.abs(expected).max(0), expected / np.abs(expected).max(0), rtol=0, atol=tolerance)


LABELS = [label("21:z", "9:z"), label("4:-z", "9:z"), label("9:+z", "21:-z"), label("13:ry", "21:z")]


@pytest.mark.parametrize("left", ["clamped", "free"])
def test_modal_sums_agree_with_direct_solves(left):
    model = beam(left=left, elements=20, modal_ratio=0.01)
    require_same(compute_frfs(model, LABELS, S), direct(model, LABELS, S, modal_damping_matrix(model)))


def test_quantities_and_signs_are_those_of_the_labels():
    model = beam(left="clamped", modal_ratio=0.01)
    labels = [label("21:z", "9:z", quantity) for quantity in FrfQuantity]
    receptance, mobility, accelerance = compute_frfs(model, labels, S).T
    assert_allclose(mobility, S * receptance, rtol=1e-14)
    assert_allclose(accelerance, S**2 * receptance, rtol=1e-14)
    flipped = compute_frfs(model, [label("21:-z", "9:z"), label("21:-z", "9:-z")], S)
    assert_allclose(flipped, np.stack([-receptance, receptance], 1), rtol=1e-14)


def test_dampers_couple_the_modes(tmp_path):
    model = read_text_model(tmp_path, CHAIN)
    labels = [label("3:x", "1:x"), label("2:x", "2:x")]
    require_same(compute_frfs(model, labels, S), direct(model, labels, S, modal_damping_matrix(model)))


def test_rayleigh_damping_couples_none(tmp_path):
    model = read_text_model(
        tmp_path, CHAIN.replace("modal_ratio = 0.01", "rayleigh = { alpha_1_s = 3.0, beta_s = 1e-5 }")
    )
    undamped = read_text_model(tmp_path, CHAIN.replace("modal_ratio = 0.01", "rayleigh = { alpha_1_s = 3.0 }"))
    labels = [label("3:x", "1:x")]
    require_same(compute_frfs(model, labels, S), direct(model, labels, S))
    require_same(compute_frfs(undamped, labels, S), direct(undamped, labels, S))


def test_damping_that_couples_no_modes_adds_to_the_stated_ratios():
    plain = beam(left="clamped", modal_ratio=0.01)
    model = structural_model(
        plain.mass_all,
        plain.stiffness_all,
        plain.all_dofs,
        damping=8.0 * plain.mass_all,
        modal_damping=[0.01],
        fixed=plain.fixed,
    )
    require_same(compute_frfs(model, LABELS, S), direct(model, LABELS, S, modal_damping_matrix(model)))


def test_a_large_model_keeps_the_static_part_of_modes_left_out(monkeypatch):
    model = beam(left="clamped", elements=20, modal_ratio=1e-6)
    everything = compute_frfs(model, LABELS, S)
    monkeypatch.setattr(response, "DENSE_ORDER", 10)
    bases = []
    real = response.solve_basis
    monkeypatch.setattr(response, "solve_basis", lambda *args, **how: bases.append(real(*args, **how)) or bases[-1])
    require_same(compute_frfs(model, LABELS, S), everything, tolerance=1e-5)  # (1/3)^10 of the first mode beyond
    assert len(bases[0].eigenvalues) < 10


def test_the_series_loads_either_side(monkeypatch):
    model = beam(left="free", elements=20, modal_ratio=1e-6)
    labels = [label(f"{node}:z", "3:z") for node in (1, 5, 9)] + [label("7:z", "3:z")]
    mirrored = [label(str(pair.input_dof), str(pair.output_dof)) for pair in labels]
    everything = compute_frfs(model, labels, S)
    monkeypatch.setattr(response, "DENSE_ORDER", 10)
    require_same(compute_frfs(model, labels, S), everything, tolerance=1e-5)
    require_same(compute_frfs(model, mirrored, S), everything, tolerance=1e-5)


def test_coupled_damping_of_a_large_model(monkeypatch):
    model = beam(left="clamped", elements=20, modal_ratio=0.002)
    dashpot = np.zeros((len(model.all_dofs),) * 2)
    dashpot[24, 24] = 0.6
    plain = structural_model(
        model.mass_all, model.stiffness_all, model.all_dofs, damping=dashpot, modal_damping=[0.002], fixed=model.fixed
    )
    exact = direct(plain, LABELS, S, modal_damping_matrix(plain))
    require_same(compute_frfs(plain, LABELS, S), exact)
    monkeypatch.setattr(response, "COUPLED_ORDER", 10)
    require_same(compute_frfs(plain, LABELS, S), exact, tolerance=5e-3)  # the modes beyond are not coupled


@pytest.mark.parametrize("quantity", list(FrfQuantity))
def test_at_zero_frequency_the_frf_next_to_it_is_given(quantity):
    held, free = (beam(left=left, modal_ratio=0.01) for left in ("clamped", "free"))
    frequency = np.array([0.0, 5.0])
    still = compute_frfs(held, [label("21:z", "21:z", quantity)], 2j * np.pi * frequency)
    assert np.isfinite(still).all()
    loose = compute_frfs(free, [label("21:z", "21:z", quantity)], 2j * np.pi * frequency)
    assert np.isfinite(loose).all()
    if quantity is FrfQuantity.RECEPTANCE:
        beam_stiffness = 3 * 69e9 * 25.33e-3 * 5.1e-3**3 / 12 / 0.4995**3
        assert_allclose(still[0, 0].real, 1 / beam_stiffness, rtol=1e-3)  # shear adds 4e-4 of this slender beam
    if quantity is FrfQuantity.ACCELERANCE:
        mass = 2690 * 0.4995 * 25.33e-3 * 5.1e-3
        turning = mass * (0.4995**2 + 5.1e-3**2) / 12
        rigid = 1 / mass + (0.4995 / 2) ** 2 / turning  # a free bar struck at its end
        assert_allclose(loose[0, 0].real, rigid, rtol=1e-9)


def reduced(mass, damping, stiffness):
    dofs = tuple(Dof(node, "x") for node in range(1, len(mass) + 1))
    return ReducedModel(
        mass=mass,
        damping=damping,
        stiffness=stiffness,
        dofs=dofs,
        expansion=np.vstack([np.eye(len(mass)), np.full(len(mass), 0.5)]),
        expanded_dofs=(*dofs, Dof(9, "x")),
        n_modes=len(mass),
    )


def test_a_reduced_model_is_solved_directly_also_where_it_is_not_symmetric():
    mass, damping = np.array([[2.0, 0.3], [0.3, 1.0]]), np.array([[3.0, 1.0], [0.5, 2.0]])
    stiffness = np.array([[5e5, -1e5], [-1.01e5, 2e5]])
    computed = compute_frfs(reduced(mass, damping, stiffness), [label("9:-x", "2:x"), label("1:x", "9:x")], S)
    for line, s in enumerate(S):
        inverse = np.linalg.inv(s**2 * mass + s * damping + stiffness)
        assert_allclose(computed[line], [-0.5 * inverse[:, 1].sum(), 0.5 * inverse[0].sum()], rtol=1e-12)


def test_many_lines_are_solved_in_blocks():
    model = reduced(np.eye(2), 0.1 * np.eye(2), np.array([[2.0, -1.0], [-1.0, 2.0]]))
    s = 1j * np.linspace(0.1, 3.0, 3 * response.LINES_AT_ONCE + 7)
    computed = compute_frfs(model, [label("1:x", "1:x")], s)[:, 0]
    expected = 0.5 / (s**2 + 0.1 * s + 1) + 0.5 / (s**2 + 0.1 * s + 3)
    assert_allclose(computed, expected, rtol=1e-12)


def test_an_unknown_or_held_dof_is_refused():
    model = beam(left="clamped")
    with pytest.raises(InputError, match="no node 99"):
        compute_frfs(model, [label("99:z", "4:z")], S)
    with pytest.raises(InputError, match="held"):
        compute_frfs(model, [label("4:z", "1:z")], S)


def test_poles_of_modes_with_damping_ratios():
    model = beam(left="clamped", elements=20, modal_ratio=0.02)
    omega = np.sqrt(solve_basis(model, n_modes=3).eigenvalues)
    poles = model_poles(model)[:3]
    assert_allclose(poles, omega * (-0.02 + 1j * np.sqrt(1 - 0.02**2)), rtol=1e-9)
    assert len(model_poles(model, up_to_hz=omega[2] / (2 * np.pi) * 1.01)) == 3


def test_poles_of_rigid_body_modes_are_zero_and_listed_one_by_one():
    assert model_poles(beam(elements=6))[:5].tolist()[:4] == [0, 0, 0, 0]
    assert model_poles(beam(elements=6))[4].imag > 0
    free = reduced(np.eye(2), np.zeros((2, 2)), np.array([[1.0, -1.0], [-1.0, 1.0]]))
    assert_allclose(model_poles(free), [0, 0, 1j * np.sqrt(2)], rtol=0, atol=1e-12)


def test_poles_of_a_damper_that_is_too_strong_are_real():
    model = structural_model([[1.0]], [[1.0]], [Dof(1, "x")], damping=[[2.5]])
    assert_allclose(model_poles(model), [-0.5, -2.0], rtol=1e-12)
    assert_allclose(model_poles(reduced(np.eye(1), 2.5 * np.eye(1), np.eye(1))), [-0.5, -2.0], rtol=1e-9)


def test_poles_of_coupled_damping(tmp_path):
    model = read_text_model(tmp_path, CHAIN)
    damping = model.damping.toarray() + modal_damping_matrix(model)
    for pole in model_poles(model):
        dynamic = pole**2 * model.mass.toarray() + pole * damping + model.stiffness.toarray()
        singular = np.linalg.svd(dynamic, compute_uv=False)
        assert singular[-1] < 1e-10 * singular[0]
    assert len(model_poles(model)) == 3
