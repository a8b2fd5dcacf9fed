"""Reduction to physical DOFs: exact modes, exact statics, good choices, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import linalg, sparse

from fe_models import LUMPED_TEXT, beam, read_text_model, structural_model
from frf_ipz.dofs import Dof, parse_dof
from frf_ipz.errors import IllConditionedError, InputError
from frf_ipz.fe.eigen import solve_basis
from frf_ipz.fe.reduction import reduce as reduction
from frf_ipz.fe.reduction.options import ReduceOptions
from frf_ipz.fe.reduction.reduce import reduce_to_dofs
from frf_ipz.fe.reduction.retained_dofs import MAX_CONDITION, choose_retained_rows, condition_number
from frf_ipz.fe.response import compute_frfs, model_poles
from frf_ipz.frf import FrfLabel
from frf_ipz.quantities import FrfQuantity

BAND = (10.0, 700.0)
EXACT = 1e-8  # relative: what a condition number of a few hundred leaves of double precision
STRONG_NS_M, BENT = 2000.0, 1e-3  # nearly a support; relative, of the poles of the band
STATIC = 1e-6  # relative, of FRFs at 1 % of the first frequency


def dofs(*labels):
    return [parse_dof(label) for label in labels]


def reduce(
    model,
    options=None,
    *,
    actuators=("9:z",),
    sensors=("21:z",),
    points=("13:z",),
    band_hz=BAND,
    **options_of_reduction,
):
    return reduce_to_dofs(
        model,
        options=options or ReduceOptions(),
        actuators=dofs(*actuators),
        sensors=dofs(*sensors),
        points=dofs(*points),
        band_hz=band_hz,
        **options_of_reduction,
    )


def frfs(model, pairs, s):
    labels = [FrfLabel(parse_dof(out), parse_dof(excited), FrfQuantity.RECEPTANCE) for out, excited in pairs]
    return compute_frfs(model, labels, s)


@pytest.fixture(scope="module", params=["clamped", "free"])
def model(request):
    return beam(left=request.param, elements=20, modal_ratio=0.005)


def test_matrices_are_symmetric_and_not_negative(model):
    reduced = reduce(model)
    for name in ("mass", "damping", "stiffness"):
        matrix = getattr(reduced, name)
        assert (matrix == matrix.T).all()
        assert np.linalg.eigvalsh(matrix)[0] > -1e-12 * np.linalg.norm(matrix)
    assert np.linalg.eigvalsh(reduced.mass)[0] > 0


def test_retained_modes_are_modes_of_the_model(model):
    reduced = reduce(model, ReduceOptions(modes=6))
    values, shapes = linalg.eigh(reduced.stiffness, reduced.mass)
    basis = solve_basis(model, n_modes=6)
    first = basis.n_rigid
    assert_allclose(values[first:6], basis.eigenvalues[first:], rtol=EXACT)
    assert np.abs(values[:first]).max(initial=0) < 1e-9 * values[first]
    expanded = reduced.expansion @ shapes[:, first:6]
    signs = np.sign(np.sum(expanded * basis.shapes[:, first:], 0))
    assert_allclose(expanded * signs, basis.shapes[:, first:], rtol=0, atol=1e-6 * np.abs(basis.shapes).max())


def test_poles_have_the_damping_of_the_model(model):
    reduced, whole = model_poles(reduce(model)), model_poles(model)
    assert_allclose(reduced[:6], whole[:6], rtol=1e-7, atol=1e-6)


def test_static_part_is_exact_from_and_to_a_residual_vector():
    held = beam(left="clamped", elements=20, modal_ratio=0.005)
    reduced = reduce(held, ReduceOptions(modes=2, residual_flexibility=("9:z",)))
    s = np.array([2j * np.pi * 0.167])
    pairs = [("9:z", "9:z"), ("21:z", "9:z"), ("13:z", "9:z"), ("9:z", "21:z")]
    assert_allclose(frfs(reduced, pairs, s), frfs(held, pairs, s), rtol=STATIC)
    without = reduce(held, ReduceOptions(modes=3, residual_flexibility=()))
    assert np.abs(frfs(without, pairs, s) / frfs(held, pairs, s) - 1).max() > 10 * STATIC


def test_frfs_of_the_band_agree(model):
    s = 2j * np.pi * np.linspace(*BAND, 400)
    pairs = [("21:z", "9:z"), ("13:z", "9:z")]
    reduced, whole = frfs(reduce(model), pairs, s), frfs(model, pairs, s)
    assert (np.linalg.norm(reduced - whole, axis=0) < 2e-3 * np.linalg.norm(whole, axis=0)).all()


def test_retained_dofs_are_their_own_rows_of_the_expansion(model):
    reduced = reduce(model)
    for index, dof in enumerate(reduced.dofs):
        expected = np.zeros(len(reduced.dofs))
        expected[index] = 1.0
        assert_allclose(reduced.row(dof), expected, rtol=0, atol=1e-9)
    assert reduced.expanded_dofs == model.dofs


def test_actuators_sensors_and_points_are_retained(model):
    reduced = reduce(model, actuators=("9:z", "3:-z"), sensors=("21:z",), points=("13:+z", "17:z"))
    assert reduced.dofs[:5] == tuple(dofs("9:z", "3:z", "21:z", "13:z", "17:z"))
    assert len(reduced.dofs) == reduced.n_modes + len(reduced.residual_dofs)
    assert reduced.residual_dofs == tuple(dofs("9:z", "3:z"))


def test_residual_vectors_stand_at_the_side_with_fewer_dofs(model):
    hammer = reduce(model, actuators=("3:z", "7:z", "9:z", "19:z"), sensors=("21:z",), points=("13:z",))
    assert hammer.residual_dofs == tuple(dofs("21:z", "13:z"))
    s = np.array([2j * np.pi * 0.167])
    pairs = [("21:z", "3:z"), ("21:z", "19:z"), ("13:z", "7:z")]
    assert_allclose(frfs(hammer, pairs, s), frfs(model, pairs, s), rtol=STATIC)
    assert any("residual flexibility: 21:z, 13:z" in note for note in hammer.choices)


def test_more_modes_make_room_for_many_sensors():
    model = beam(left="clamped", elements=20, modal_ratio=0.005)
    with_one_sensor = reduce(model, band_hz=(5.0, 60.0))
    sensors = tuple(f"{node}:z" for node in range(4, 22, 2))
    with_many = reduce(model, sensors=sensors, band_hz=(5.0, 60.0))
    assert with_many.n_modes > with_one_sensor.n_modes
    assert set(dofs(*sensors)) <= set(with_many.dofs)
    assert any("more, so that" in note for note in with_many.choices)


def test_modes_are_added_up_to_a_limit(monkeypatch):
    monkeypatch.setattr(reduction, "FEW_DOFS", 0)
    model = beam(left="clamped", elements=20, modal_ratio=0.005)
    with_one_sensor = reduce(model, band_hz=(5.0, 60.0))
    with_many = reduce(model, sensors=tuple(f"{node}:z" for node in range(2, 22)), band_hz=(5.0, 60.0))
    assert len(with_one_sensor.dofs) < len(with_many.dofs) == reduction.MAX_GROWTH * len(with_one_sensor.dofs)
    assert any("are not retained" in note for note in with_many.choices)


def test_a_copy_of_a_dof_is_reached_through_the_others():
    model = beam(left="clamped", elements=200, modal_ratio=0.005)
    reduced = reduce(model, actuators=("100:z",), sensors=("101:z",), points=("150:z",), band_hz=(5.0, 60.0))
    assert Dof(100, "z") in reduced.dofs
    assert Dof(101, "z") not in reduced.dofs
    assert any("101:z are not retained" in note for note in reduced.choices)
    s = 2j * np.pi * np.linspace(5.0, 60.0, 200)
    whole, approximate = (frfs(source, [("101:z", "100:z")], s) for source in (model, reduced))
    assert np.linalg.norm(whole - approximate) < 1e-3 * np.linalg.norm(whole)


def test_the_choice_is_well_conditioned(model):
    reduced = reduce(model)
    assert np.linalg.cond(reduced.mass) < 1e3  # square of that of the mode matrix


def test_numbers_of_modes_follow_the_band():
    model = beam(left="clamped", elements=60, modal_ratio=0.005)
    frequency = solve_basis(model, n_modes=12).natural_frequency_hz
    reduced = reduce(model, band_hz=(10.0, 700.0))
    assert reduced.n_modes == np.count_nonzero(frequency <= reduction.BAND_MARGIN * 700.0)


def test_a_model_of_few_dofs_is_retained_whole(tmp_path):
    model = read_text_model(tmp_path, LUMPED_TEXT)
    reduced = reduce(model, actuators=("1:x",), sensors=("2:x",), points=(), band_hz=(1.0, 500.0))
    assert reduced.n_modes == 2
    assert reduced.residual_dofs == ()
    assert any("none, as the modes hold all flexibility" in note for note in reduced.choices)
    assert_allclose(reduced.mass, model.mass.toarray(), rtol=1e-10, atol=1e-10)
    assert_allclose(reduced.stiffness, model.stiffness.toarray(), rtol=1e-10)
    assert_allclose(reduced.damping, model.damping.toarray(), rtol=1e-9, atol=1e-9)


def test_viscous_damping_goes_through_the_same_basis(tmp_path):
    text = LUMPED_TEXT.replace("[lumped]", "[damping]\nrayleigh = { beta_s = 2e-5 }\n[lumped]", 1)
    model = read_text_model(tmp_path, text)
    options = ReduceOptions(modes=1, residual_flexibility=("1:x",))
    reduced = reduce(model, options, actuators=("1:x",), sensors=("2:x",), points=())
    assert_allclose(reduced.damping, model.damping.toarray(), rtol=1e-9, atol=1e-9)


def test_a_strong_damper_bends_the_shapes():
    held = beam(left="clamped", elements=20, modal_ratio=0.005)
    index = held.full_index(Dof(13, "z"))
    damper = sparse.csr_array(([STRONG_NS_M], ([index], [index])), shape=held.damping_all.shape)
    damped = replace(held, damping_all=sparse.csr_array(held.damping_all + damper))
    reduced, whole = model_poles(reduce(damped)), model_poles(damped)
    in_band = (whole.imag > 0) & (np.abs(whole) < 2 * np.pi * BAND[1])
    nearest = reduced[np.abs(reduced[:, None] - whole[in_band]).argmin(0)]
    assert_allclose(nearest, whole[in_band], rtol=BENT)


def test_dampers_are_separated_from_the_damping_of_modes(tmp_path):
    """What remains without them is damping of modes: it couples none."""
    model = read_text_model(tmp_path, LUMPED_TEXT)
    options = {"actuators": ("1:x",), "sensors": ("2:x",), "points": ()}
    assert reduce(model, **options).dashpots.shape == (0, 0)  # a matrix alone is all the damping there is
    assert reduce(replace(model, damping_all=0 * model.damping_all), **options).dashpots.shape == (0, 0)
    reduced = reduce(replace(model, modal_damping=np.array([0.01])), **options)
    assert_allclose(reduced.dashpots, model.damping.toarray(), rtol=1e-9, atol=1e-9)
    shapes = linalg.eigh(reduced.stiffness, reduced.mass)[1]
    of_modes = shapes.T @ (reduced.damping - reduced.dashpots) @ shapes
    assert_allclose(of_modes, np.diag(np.diagonal(of_modes)), rtol=0, atol=1e-9 * of_modes.max())


def test_default_damping_is_noted():
    plain = beam(left="clamped")
    for ratio, expected, words in ((None, 0.005, "by default"), (0.02, 0.02, "from the test")):
        reduced = reduce(plain, default_damping_ratio=ratio)
        poles = model_poles(reduced)[:3]
        assert_allclose(-poles.real / np.abs(poles), expected, rtol=1e-6)
        assert words in reduced.choices[0]
    assert not any("damping" in note for note in reduce(beam(modal_ratio=0.01)).choices)


def test_options_are_obeyed():
    model = beam(left="clamped", modal_ratio=0.005)
    options = ReduceOptions(modes=4, dofs=("21:z", "9:z", "13:z", "17:z", "5:z"), residual_flexibility=("21:z",))
    reduced = reduce(model, options)
    assert reduced.dofs == tuple(dofs("21:z", "9:z", "13:z", "17:z", "5:z"))
    assert (reduced.n_modes, reduced.residual_dofs) == (4, (Dof(21, "z"),))
    assert reduced.choices == ()
    by_dofs = reduce(model, ReduceOptions(dofs=("21:z", "9:z", "13:z", "17:z", "5:z")))
    assert by_dofs.n_modes == 4


def test_close_dofs_are_refused_and_better_ones_proposed():
    model = beam(left="clamped", elements=100, modal_ratio=0.005)
    close = ReduceOptions(modes=4, dofs=tuple(f"{node}:z" for node in (9, 10, 11, 12, 13)))
    ends = {"actuators": ("9:z",), "sensors": ("11:z",), "points": ("60:z",)}
    with pytest.raises(IllConditionedError) as caught:
        reduce(model, close, **ends)
    message = str(caught.value)
    assert "condition number" in message
    proposed = message[message.index("dofs = [") + 8 : message.index("]", message.index("dofs = ["))]
    better = tuple(name.strip().strip('"') for name in proposed.split(","))
    assert {"9:z", "60:z"} <= set(better)
    reduced = reduce(model, ReduceOptions(modes=4, dofs=better), **ends)
    assert reduced.dofs == tuple(dofs(*better))


def test_rounding_in_the_matrices_is_noticed(monkeypatch):
    monkeypatch.setattr(reduction, "MAX_CONDITION", 1e30)
    model = beam(left="clamped", elements=100, modal_ratio=0.005)
    with pytest.raises(IllConditionedError, match="farther apart"):
        reduce(model, ReduceOptions(modes=4, dofs=tuple(f"{node}:z" for node in (2, 5, 8, 11, 14))))


def test_rounding_that_makes_the_mass_matrix_indefinite_is_noticed():
    # which of the two it is depends on LAPACK
    with pytest.raises(IllConditionedError, match="not positive definite; use fewer modes"):
        reduction._require_modes(np.diag([1.0, -1e-9]), np.eye(2), ritz=None)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (ReduceOptions(modes=41), "modes is 41; the model 'beam' has 40 free DOFs"),
        (ReduceOptions(modes=4, dofs=("3:z", "4:z"), residual_flexibility=("9:z",)), "names 2 DOFs, but 4 modes and 1"),
        (ReduceOptions(modes=4, dofs=("3:z", "9:z", "15:z")), "names 3 DOFs, but there are 4 modes and 1"),
        (ReduceOptions(dofs=("9:z",), residual_flexibility=("9:z",)), "no mode remains"),
        (ReduceOptions(dofs=("3:z", "9:z", "3:-z")), "dofs names the DOF 3:z twice"),
        (ReduceOptions(residual_flexibility=("3:z", "3:z")), "residual_flexibility names the DOF 3:z twice"),
        (ReduceOptions(dofs=("3:z", "99:z")), "no node 99"),
        (ReduceOptions(residual_flexibility=("1:z",)), "1:z is held"),
        (ReduceOptions(dofs=("3:z", "nine")), "'nine' is no DOF label"),
        (ReduceOptions(modes=40, residual_flexibility=("9:z",)), "hold all the flexibility already"),
    ],
)
def test_options_that_do_not_fit_are_refused(options, message):
    with pytest.raises(InputError, match=message):
        reduce(beam(left="clamped", modal_ratio=0.005), options)


@pytest.mark.parametrize(
    ("place", "label", "message"),
    [("actuators", "99:z", "no node 99"), ("sensors", "3:x", "no DOF 'x'"), ("points", "1:z", "1:z is held")],
)
def test_dofs_that_the_model_lacks_are_refused(place, label, message):
    with pytest.raises(InputError, match=message):
        reduce(beam(left="clamped"), **{place: (label,)})


def test_without_test_or_points_the_modes_alone_are_reduced():
    reduced = reduce(beam(left="clamped", modal_ratio=0.01), actuators=(), sensors=(), points=())
    assert reduced.residual_dofs == ()
    assert len(reduced.dofs) == reduced.n_modes


def test_only_required_dofs_are_expanded_in_a_huge_model(monkeypatch):
    monkeypatch.setattr(reduction, "MAX_EXPANDED", 10)
    reduced = reduce(beam(left="clamped", modal_ratio=0.01))
    assert set(reduced.dofs) | {Dof(13, "z")} <= set(reduced.expanded_dofs)
    assert len(reduced.expanded_dofs) < 15


def test_a_structure_that_only_turns_is_reduced_in_rotations():
    pair = np.array([[2.0, -1.0, 0], [-1.0, 2.0, -1.0], [0, -1.0, 1.0]])
    shaft = structural_model(np.eye(3), 1e4 * pair, [Dof(n, "rx") for n in (1, 2, 3)], modal_damping=[0.01])
    reduced = reduce(shaft, actuators=("1:rx",), sensors=("3:rx",), points=(), band_hz=(1.0, 5.0))
    assert all(dof.direction == "rx" for dof in reduced.dofs)


def test_rotations_are_retained_where_translations_cannot_separate_modes():
    # eight translations of a stocky free beam, and nine modes and vectors
    stocky = beam(elements=7, length_m=0.1, thickness_m=0.012, modal_ratio=0.03)
    reduced = reduce(stocky, actuators=("4:z",), sensors=("4:z",), points=("4:z",), band_hz=(1e3, 3.2e4))
    assert len(reduced.dofs) == 9
    assert 1 <= sum(dof.direction == "ry" for dof in reduced.dofs) <= 2


def test_chosen_rows_are_as_independent_as_can_be():
    rng = np.random.default_rng(2)
    shapes = rng.standard_normal((40, 5))
    shapes[7] = 1.001 * shapes[3]
    rows = choose_retained_rows(shapes, [3, 7, 11], np.arange(40), 5)
    assert rows[:2].tolist() == [3, 11]
    assert len(set(rows.tolist())) == 5
    assert condition_number(shapes[rows]) < 20 < MAX_CONDITION


def test_condition_number_knows_no_units():
    shapes = np.random.default_rng(3).standard_normal((4, 4))
    assert_allclose(condition_number(np.diag([1e6, 1.0, 1e-6, 3.0]) @ shapes), condition_number(shapes), rtol=10)
    assert condition_number(np.diag([1.0, 0.0])) == np.inf
