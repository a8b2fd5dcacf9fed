"""Who belongs to whom: on structures whose truth is known, and in the cases that are easily mistaken."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import linear_sum_assignment

from chains import chain, label
from frf_ipz.dofs import Dof
from frf_ipz.fe.response import compute_frfs
from frf_ipz.frf import FrfLabel
from frf_ipz.pairing.model_roots import ModelPoles, ModelZeros, model_poles, model_zeros
from frf_ipz.pairing.pair import SURE, pair_roots
from frf_ipz.pairing.pairs import PairVerdict
from frf_ipz.pairing.poles import _shape_costs, pair_poles
from frf_ipz.pairing.zeros import measured_slope_sign, pair_zeros
from frf_ipz.quantities import FrfQuantity
from frf_ipz.rational import PoleResidueModel, ZeroSet
from frf_testbench.updating.study import make_update_case
from frf_testbench.updating.synthetic_fit import make_modal_fit

SEEDS = range(500, 512)  # none of them was looked at when the constants were chosen
LABELS = (label(2, 1), label(4, 1))
BAND = (5.0, 120.0)


def measured(model, labels=LABELS, *, poles=None, zeros=True, gain=1.0):
    """The fit of a model that a perfect measurement gives: its own poles, residues and zeros."""
    computed = model_poles(model, labels)
    chosen = range(len(computed.values)) if poles is None else poles
    values, amplitudes = computed.values[list(chosen)], computed.amplitudes[list(chosen)]
    powers = np.array([frf_label.quantity.power for frf_label in labels])
    residues = gain * amplitudes / (2j * np.abs(values))[:, None] * values[:, None] ** powers
    shown = [complex_zeros(model, frf_label) if zeros else ([], []) for frf_label in labels]
    roots = [values for values, _ in shown]
    all_zeros = np.concatenate(roots).astype(complex)
    fitted = PoleResidueModel(
        poles=values,
        residues=residues,
        powers=(0,),
        coefficients=np.zeros((1, len(labels))),
        scale_rad_s=1.0,
        delay_s=np.zeros(len(labels)),
    )
    where = np.repeat(np.arange(len(labels)), [len(zeros_of_frf) for zeros_of_frf in roots])
    kinds = [kind for _, kinds in shown for kind in kinds]
    std = np.repeat(1e-5 * np.abs(np.concatenate([values, all_zeros])), 2)
    nothing = np.zeros((len(values), len(labels), 2, 2))
    return make_modal_fit(fitted, labels, BAND, all_zeros, where, kinds, np.diag(std**2), nothing)


def complex_zeros(model, frf_label):
    """Those that show as antiresonances, and their kinds."""
    computed = model_zeros(model, [frf_label])[0]
    indices = [index for index, kind in enumerate(computed.kind) if kind == "complex"]
    return computed.values[indices], ["complex"] * len(indices)


def test_a_model_is_paired_with_itself_throughout():
    model = chain()
    pairs = pair_roots(measured(model), model)
    assert {row.verdict for row in pairs.rows} == {PairVerdict.PAIRED}
    assert pairs.warnings == ()
    for row in pairs.rows:
        assert_allclose(row.computed_value, row.measured_value, rtol=1e-12)
        assert "probability 1.000" in row.reason


def test_residues_of_the_model_rebuild_its_frf():
    model = chain(damping=0.02)
    fit = measured(model, zeros=False)
    s = 2j * np.pi * np.linspace(2.0, 150.0, 40)
    assert_allclose(fit.model(s), compute_frfs(model, LABELS, s), rtol=1e-9)


@pytest.mark.parametrize("quantity", list(FrfQuantity))
def test_pairing_does_not_depend_on_the_quantity(quantity):
    labels = tuple(replace(frf_label, quantity=quantity) for frf_label in LABELS)
    model = chain()
    stiffer = replace(model, stiffness=1.15 * model.stiffness)
    pairs = pair_roots(measured(stiffer, labels), model)
    assert [row.computed for row in pairs.targets if row.kind == "pole"] == list(range(5))


def test_a_common_factor_on_all_frequencies_is_no_obstacle():
    model = chain()
    for factor in (0.7, 0.85, 1.2, 1.4):
        stiffer = replace(model, stiffness=factor * model.stiffness, damping=np.sqrt(factor) * model.damping)
        pairs = pair_roots(measured(stiffer), model)
        assert all(row.verdict is PairVerdict.PAIRED for row in pairs.rows if row.kind == "pole")
        assert [row.computed for row in pairs.rows if row.kind == "pole"] == list(range(5))
        zeros = [row for row in pairs.rows if row.kind == "zero" and row.measured >= 0]
        assert all(row.verdict is PairVerdict.PAIRED for row in zeros)
        ratios = [abs(row.measured_value / row.computed_value) for row in zeros]
        assert_allclose(ratios, np.sqrt(factor), rtol=1e-4)


@pytest.mark.parametrize("quantity", list(FrfQuantity))
def test_shapes_separate_swapped_modes(quantity):
    """Two loops of one stiffness and another mass each: the heavier one has the lower frequency."""
    model = two_loops(1.00, 1.06)
    swapped = two_loops(1.06, 1.00)
    pairs = pair_roots(measured(swapped, (label(1, 1, quantity), label(2, 2, quantity)), zeros=False), model)
    assert [(row.measured, row.computed) for row in pairs.targets] == [(0, 1), (1, 0)]


def two_loops(first, second):
    model = chain(2, stiffness=[1e5, 0.0])
    return replace(model, mass=np.diag([first, second]), stiffness=1e5 * np.eye(2), damping=np.eye(2))


def test_a_reversed_polarity_is_found_and_reported():
    model = chain()
    turned = tuple(replace(frf_label, output_dof=replace(frf_label.output_dof, sign=-1)) for frf_label in LABELS)
    fit = measured(model, LABELS)
    pairs = pair_roots(replace(fit, labels=turned), model)
    assert f"polarity of {turned[0]}, {turned[1]} is opposite" in pairs.warnings[-1]
    assert all(row.verdict is PairVerdict.PAIRED for row in pairs.rows)


def test_a_mode_that_was_not_measured_is_missing_in_the_measurement():
    model = chain()
    pairs = pair_roots(measured(model, poles=[0, 1, 3, 4], zeros=False), model)
    missing = [row for row in pairs.rows if row.kind == "pole" and row.verdict is PairVerdict.MISSING_IN_MEASUREMENT]
    assert [row.computed for row in missing] == [2]
    assert [row.computed for row in pairs.targets] == [0, 1, 3, 4]


def test_a_mode_that_the_model_lacks_is_reported_and_is_no_target():
    richer, model = chain(5), chain(5)
    fit = measured(richer, zeros=False)
    extra = 2j * np.pi * 200.0 - 5.0
    poles = np.append(fit.model.poles, extra)
    residues = np.vstack([fit.model.residues, fit.model.residues[:1]])
    larger = replace(fit.model, poles=poles, residues=residues)
    more = make_modal_fit(
        larger, LABELS, (5.0, 250.0), np.zeros(0, complex), np.zeros(0, int), [], np.eye(12), np.zeros((6, 2, 2, 2))
    )
    pairs = pair_roots(more, model)
    lonely = [row for row in pairs.rows if row.verdict is PairVerdict.MISSING_IN_MODEL]
    assert [row.measured for row in lonely] == [5]
    assert "200 Hz" in pairs.warnings[0]
    assert len(pairs.targets) == 5


def test_modes_of_a_suspension_are_told_from_what_is_missing():
    free = chain(free=True)
    free = replace(free, rigid=np.full((5, 1), 1 / np.sqrt(free.mass.sum())))
    hung = replace(free, stiffness=free.stiffness + np.diag([2.0, 0.0, 0.0, 0.0, 2.0]) * 1e2, rigid=np.zeros((0, 0)))
    warnings = pair_roots(measured(hung, zeros=False), free).warnings
    assert len(warnings) == 1
    assert "suspension" in warnings[0]
    assert "missing" not in warnings[0]


def test_nothing_in_common_is_a_warning_with_what_to_check():
    model = chain()
    far = replace(model, stiffness=1e6 * model.stiffness)
    pairs = pair_roots(measured(far), model)
    assert not [row for row in pairs.targets if row.kind == "pole"]
    assert any("check units" in text for text in pairs.warnings)


def test_a_zero_that_is_not_identifiable_is_no_target():
    model = chain()
    fit = measured(model)
    known = fit.zeros.identifiable.copy()
    known[0] = False
    reasons = ("too far out", *[""] * (len(known) - 1))
    pairs = pair_roots(replace(fit, zeros=replace(fit.zeros, identifiable=known, reason=reasons)), model)
    row = next(row for row in pairs.rows if row.kind == "zero" and row.measured == 0)
    assert row.verdict is PairVerdict.AMBIGUOUS
    assert "too far out" in row.reason


def test_a_zero_that_cancels_a_pole_is_no_target():
    model = chain()
    fit = measured(model)
    values = fit.zeros.values.copy()
    values[0] = fit.model.poles[1] * (1 + 1e-6)
    pairs = pair_roots(replace(fit, zeros=replace(fit.zeros, values=values)), model)
    row = next(row for row in pairs.rows if row.kind == "zero" and row.measured == 0)
    assert "cancels the pole" in row.reason
    assert row.verdict is PairVerdict.AMBIGUOUS


def test_a_real_zero_is_no_target():
    values = np.array([-300.0 + 0j])
    fit = measured(chain(), zeros=False)
    zeros = ZeroSet(values=values, frf=np.array([0]), kind=("real",), identifiable=np.array([True]), reason=("",))
    with_zero = replace(fit, zeros=zeros, covariance=np.eye(12))
    row = next(row for row in pair_roots(with_zero, chain()).rows if row.kind == "zero" and row.measured == 0)
    assert row.verdict is PairVerdict.AMBIGUOUS


def test_quadruples_are_listed_once():
    """Far from the excitation a beam's zeros leave the axis; each stands for four."""
    seeds_with = 0
    for seed in SEEDS:
        case = make_update_case(seed)
        for frf_label in case.labels:
            zeros = model_zeros(case.reduced_model, [frf_label])[0]
            quadruples = zeros.values[np.array(zeros.kind) == "quadruple"]
            seeds_with += len(quadruples) > 0
            assert np.all(quadruples.real < 0)
            shown = zeros.values[np.abs(zeros.values.imag) > 1e-6 * np.abs(zeros.values)]
            for value in shown[shown.real > 1e-4 * np.abs(shown)]:
                mirrored = shown[shown.real < 0]
                assert np.abs(mirrored + value.conj()).min(initial=np.inf) > 0.5 * value.real
            gaps = np.abs(quadruples[:, None] + quadruples.conj()) + np.eye(len(quadruples)) * 1e9
            assert gaps.min(initial=1e9) > 1e-6
    assert seeds_with > 0


@pytest.mark.parametrize("seed", SEEDS)
def test_no_pole_is_paired_wrongly(seed):
    """The truth is which modes are alike: the real structure's shapes at all DOFs against the nominal ones."""
    case = make_update_case(seed)
    nominal = type(case.true_modes)(case.structure.nominal_model, case.structure.damping)
    mass = case.structure.nominal_model.mass.toarray()
    alike = np.abs(case.true_modes.shapes.T @ mass @ nominal.shapes)
    rows, columns = linear_sum_assignment(-alike)
    partner = dict(zip(rows.tolist(), columns.tolist(), strict=True))
    for row in case.pairs.targets:
        if row.kind == "pole":
            real = int(np.argmin(np.abs(case.true_modes.omega - abs(row.measured_value))))
            sure = alike[real, partner[real]] > 0.8  # below, two modes have mixed and neither answer is wrong
            assigned = int(np.argmin(np.abs(nominal.omega - abs(row.computed_value))))
            assert assigned == partner[real] or not sure


def test_the_slope_at_zeros_is_that_of_the_frf():
    model = chain(damping=0.001)
    frf_label = FrfLabel(Dof(2, "x"), Dof(2, "x"), FrfQuantity.RECEPTANCE)
    zeros = model_zeros(model, [frf_label])[0]
    step = 1e-5j * np.abs(zeros.values)
    nearby = [compute_frfs(model, [frf_label], zeros.values + sign * step)[:, 0].real for sign in (1, -1)]
    assert np.array_equal(np.sign(nearby[0] - nearby[1]), zeros.slope_sign)


def one_zero(model):
    """A fit of which one zero is left, and the sign of the slope there."""
    fit = measured(model)
    index = int(np.flatnonzero(fit.zeros.frf == 0)[0])
    alone = replace(
        fit.zeros,
        values=fit.zeros.values[[index]],
        frf=np.array([0]),
        kind=("complex",),
        identifiable=np.array([True]),
        reason=("",),
    )
    sign = measured_slope_sign(fit.model, 0, 0, alone.values)[0]
    return replace(fit, zeros=alone, covariance=1e-6 * np.eye(2 * fit.n_modes + 2)), alone.values[0], sign


def test_the_slope_separates_two_zeros():
    """The nearer zero has the opposite slope of the measured one, so the farther one is its partner."""
    fit_of_one, value, sign = one_zero(chain(damping=0.001))
    choice = ModelZeros(
        values=np.array([0.985 * value, 1.01 * value]), kind=("complex",) * 2, slope_sign=np.array([sign, -sign])
    )
    nothing = np.zeros(0), np.zeros(0)
    assert pair_zeros(fit_of_one, 0, choice, nothing, 1.0).matching.partner.tolist() == [0]
    assert pair_zeros(fit_of_one, 0, choice, nothing, -1.0).matching.partner.tolist() == [1]


def test_a_zero_near_the_axis_is_none_that_has_left_it():
    """Of the same modulus, but with 80 % of critical damping: shapes make it, and no change of stiffness joins them."""
    fit_of_one, value, sign = one_zero(chain(damping=0.001))
    nothing = np.zeros(0), np.zeros(0)
    for angle, partner in ((0.01, 0), (np.arcsin(0.8), -1)):
        choice = ModelZeros(
            values=np.array([value * np.exp(1j * angle)]), kind=("complex",), slope_sign=np.array([sign])
        )
        assert pair_zeros(fit_of_one, 0, choice, nothing, 1.0).matching.partner.tolist() == [partner]


def test_a_zero_on_a_pole_is_no_obstacle():
    """The second mass hangs on nothing: a double zero at 0 lies on its double pole, and P(0) is singular."""
    model = replace(two_loops(1.0, 1.0), stiffness=np.diag([1e5, 0.0]), damping=np.diag([1.0, 0.0]))
    assert model_zeros(model, [label(1, 1)])[0].slope_sign.tolist() == [0.0, 0.0]


def test_a_zero_at_0_pairs_with_none():
    """That of a loose mass beside the structure; without a warning of NumPy."""
    model = replace(two_loops(1.0, 1.0), stiffness=np.diag([1e5, 0.0]), damping=np.diag([1.0, 0.0]))
    pairs = pair_roots(measured(model, (label(1, 1),), poles=[1], zeros=False), model)
    assert [(row.measured, row.computed) for row in pairs.targets] == [(0, 1)]


def test_a_rigid_body_is_no_mode_that_could_be_measured():
    model = chain(free=True)
    assert np.abs(model_poles(model, LABELS).values[0]) < 1e-3
    pairs = pair_roots(measured(model, poles=[1, 2, 3, 4], zeros=False), model)
    assert [(row.measured, row.computed) for row in pairs.rows if row.kind == "pole"] == [
        (0, 1),
        (1, 2),
        (2, 3),
        (3, 4),
    ]


def many_frfs(n_frfs, seed, *, frequencies, measured_frequencies, order, sizes, error=0.17):
    """Modes at random amplitudes in many FRFs; as measured in another order, of other sizes, with errors of shape."""
    rng = np.random.default_rng(seed)
    labels = tuple(label(place + 1, 1) for place in range(n_frfs))
    amplitudes = rng.standard_normal((len(frequencies), n_frfs))
    seen = (amplitudes[order] + error * rng.standard_normal((len(order), n_frfs))) * np.array(sizes)[:, None]
    return pairing_of(labels, frequencies, measured_frequencies, amplitudes, seen)


def pairing_of(labels, frequencies, measured_frequencies, amplitudes, seen):
    """Pair modes of given amplitudes in all FRFs, the model's and those that are seen."""
    n_frfs = len(labels)
    values = 2 * np.pi * np.array(frequencies) * (1j - 0.005)
    model = ModelPoles(values=values, amplitudes=amplitudes.astype(complex))
    poles = 2 * np.pi * np.array(measured_frequencies) * (1j - 0.005)
    powers = np.array([frf_label.quantity.power for frf_label in labels])
    fitted = PoleResidueModel(
        poles=poles,
        residues=seen / (2j * np.abs(poles))[:, None] * poles[:, None] ** powers,
        powers=(0,),
        coefficients=np.zeros((1, n_frfs)),
        scale_rad_s=1.0,
        delay_s=np.zeros(n_frfs),
    )
    nothing = np.zeros((len(poles), n_frfs, 2, 2))
    std = np.diag(np.repeat((1e-5 * np.abs(poles)) ** 2, 2))
    fit = make_modal_fit(fitted, labels, (50.0, 300.0), np.zeros(0, complex), np.zeros(0, int), [], std, nothing)
    return pair_poles(fit, model)


MANY = [4, 25, 100, 225, 1000]


@pytest.mark.parametrize("n_frfs", MANY)
@pytest.mark.parametrize("seed", range(3))
def test_shapes_separate_swapped_modes_in_any_number_of_frfs(n_frfs, seed):
    """MAC of 0.97, and modal masses off: with many FRFs both costs used to be cut to the same."""
    pairing = many_frfs(
        n_frfs,
        seed,
        frequencies=[100.0, 102.0, 140.0, 180.0, 205.0, 250.0],
        measured_frequencies=[101.0, 102.6, 138.2, 182.5, 203.1, 253.0],
        order=[1, 0, 2, 3, 4, 5],
        sizes=[0.6, 1.7, 1.0, 1.3, 0.8, 1.0],
    )
    expected = [1, 0, 2, 3, 4, 5]
    assert pairing.matching.partner.tolist() == expected
    assert (pairing.probabilities[range(6), expected] > SURE).all()


@pytest.mark.parametrize("n_frfs", MANY)
def test_close_modes_of_mixed_shapes_are_told_apart_by_mac(n_frfs):
    rng = np.random.default_rng(n_frfs)
    shapes = rng.standard_normal((3, n_frfs))
    mixed = np.array([0.9 * shapes[0] + 0.3 * shapes[1], 0.9 * shapes[1] - 0.3 * shapes[0]])
    labels = tuple(label(place + 1, 1) for place in range(n_frfs))
    costs = _shape_costs(mixed.astype(complex), shapes.astype(complex), np.zeros((2, n_frfs)), np.ones(n_frfs), labels)
    assert costs[0].argmin() == 0
    assert costs[1].argmin() == 1


@pytest.mark.parametrize("n_frfs", MANY[1:])
def test_every_step_of_mac_counts(n_frfs):
    rng = np.random.default_rng(n_frfs)
    first = rng.standard_normal(n_frfs)
    other = rng.standard_normal(n_frfs)
    other -= first * (first @ other) / (first @ first)
    other *= np.linalg.norm(first) / np.linalg.norm(other)
    assurances = np.array([0.0, 0.5, 0.9, 0.97, 1.0])
    measured_shapes = np.sqrt(assurances)[:, None] * first + np.sqrt(1 - assurances)[:, None] * other
    labels = tuple(label(place + 1, 1) for place in range(n_frfs))
    costs = _shape_costs(
        1.6 * measured_shapes.astype(complex),
        first[None].astype(complex),
        np.zeros((5, n_frfs)),
        np.ones(n_frfs),
        labels,
    )[:, 0]
    assert (np.diff(costs) < 0).all()
    assert costs[0] - costs[3] > 4.0  # odds of e^2


@pytest.mark.parametrize("seed", range(4))
def test_frfs_that_vanish_by_symmetry_say_nothing(seed):
    """Ports of two axes: each mode moves one of them, and what is left of the other is an accident of both models."""
    rng = np.random.default_rng(seed)
    frequencies = [100.0, 103.0, 140.0, 143.0, 205.0, 208.0]
    labels = tuple(label(output + 1, excited + 1) for output in range(6) for excited in range(6))
    axis = np.arange(6) // 3
    moves = np.where(axis == np.arange(6)[:, None] % 2, 1.0, 1e-3)
    sensors, forces = rng.standard_normal((2, 6, 6))

    def amplitudes():
        """Shapes 20 % off along their axis, and new ones across it."""
        accident = np.where(moves < 1, rng.standard_normal((2, 6, 6)) / np.stack([sensors, forces]), 1.0)
        wrong = 1 + 0.2 * rng.standard_normal((2, 6, 6))
        outputs, inputs = np.stack([sensors, forces]) * moves * accident * wrong
        return np.einsum("mo,mi->moi", outputs, inputs).reshape(6, 36)

    swapped = [102.6, 100.4, 143.2, 140.6, 207.4, 205.6]  # two modes of different axes have changed places
    pairing = pairing_of(labels, frequencies, swapped, amplitudes(), amplitudes())
    assert pairing.matching.partner.tolist() == list(range(6))
    assert (pairing.probabilities[range(6), range(6)] > SURE).all()
    assert (pairing.gains > 0).all()
