"""`minimal-change`: what it reaches, what it keeps, what it says."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import linalg, sparse

from frf_ipz.dofs import Dof
from frf_ipz.fe.reduction.options import ReduceOptions
from frf_ipz.fe.reduction.reduce import reduce_model, reduce_to_dofs
from frf_ipz.frf import FrfLabel, FrfQuantity
from frf_ipz.numerics.pencils import damped_poles, undamped_poles
from frf_ipz.pairing.model_roots import model_zeros
from frf_ipz.pairing.pair import pair_roots
from frf_ipz.pairing.pairs import Pairs
from frf_ipz.progress import silent
from frf_ipz.structure import StructuralModel
from frf_ipz.updating.methods.minimal_change import update
from frf_ipz.updating.options import UpdateOptions
from frf_ipz.updating.parameters import ParameterBasis, PriorTerm, make_structural_basis
from frf_ipz.updating.problem import make_problem
from frf_ipz.updating.regions import reduced_regions
from frf_ipz.updating.tracking import _over, nearest_roots
from frf_ipz.updating.update import update_model
from frf_ipz.updating.updated_model import UpdateStatus
from frf_testbench.updating.random_structures import draw_structure, scale_stiffness
from frf_testbench.updating.study import make_update_case
from frf_testbench.updating.synthetic_fit import TrueModes, choose_band, list_labels, simulate_fit

SEEDS = (3, 7, 11, 21)  # structures with one to four FRFs, one of them free to fly
OF_NOTHING = 1e-4  # of the damping: of a real part of five times its size 2e-2 came through
FOLLOWED = 1e-6  # relative: of a zero that is the same
WITHIN_NOISE = 4.0  # standard deviations: hardly one of a hundred targets lies beyond


@pytest.fixture(params=SEEDS, scope="module")
def case(request):
    return make_update_case(request.param)


@pytest.fixture(scope="module")
def updated(case):
    basis = make_structural_basis(case.structure.nominal_model, case.reduced_model)
    return update_model(case.fit, case.reduced_model, pairs=case.pairs, basis=basis)


def deviations(case):
    """Standard deviations of the modulus of every target, relative."""
    indices = [pair.measured + (case.fit.n_modes if pair.kind == "zero" else 0) for pair in case.pairs.targets]
    values = np.array([pair.measured_value for pair in case.pairs.targets])
    blocks = np.array([case.fit.covariance[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] for k in indices])
    gradient = np.stack([values.real, values.imag], 1) / np.abs(values)[:, None] ** 2
    return np.sqrt(np.einsum("ki,kij,kj->k", gradient, blocks, gradient))


def test_targets_are_met_to_within_their_noise(case, updated):
    assert updated.status is UpdateStatus.CONVERGED
    values = np.array([pair.measured_value for pair in case.pairs.targets])
    off = np.abs(np.log(np.abs(updated.after) / np.abs(values)))
    assert np.all(off < WITHIN_NOISE * deviations(case) + 1e-4)
    before = np.abs(np.log(np.abs(updated.before) / np.abs(values)))
    assert off.max() < before.max() / 10


def test_matrices_stay_symmetric_and_positive(updated):
    for matrices in ([updated.model.mass, updated.model.damping, updated.model.stiffness], *updated.ensemble[:20]):
        for matrix in matrices:
            assert np.array_equal(matrix, matrix.T)
            assert np.linalg.eigvalsh(matrix)[0] > -1e-9 * np.linalg.norm(matrix)
        assert np.linalg.eigvalsh(matrices[0])[0] > 0


def test_the_mass_stays_as_it_was(case, updated):
    assert np.abs(updated.model.mass - case.reduced_model.mass).max() < 1e-9 * np.abs(case.reduced_model.mass).max()


def test_the_reported_roots_are_those_of_the_matrices(case, updated):
    poles = damped_poles(updated.model.mass, updated.model.damping, updated.model.stiffness).values
    for row, value in zip(case.pairs.targets, updated.after, strict=True):
        if row.kind == "pole":
            assert np.abs(poles - value).min() < 1e-7 * abs(value)


def test_the_ensemble_has_the_measured_poles_within_their_noise(case, updated):
    std = deviations(case)
    for index, row in enumerate(case.pairs.targets[:3]):
        near = []
        for mass, _, stiffness in updated.ensemble:
            omega = np.sqrt(np.maximum(undamped_poles(mass, stiffness).values.real, 0))
            near.append(omega[np.argmin(np.abs(omega - abs(row.measured_value)))])
        assert abs(np.mean(near) / abs(row.measured_value) - 1) < 6 * std[index] + 1e-4
        assert np.std(near) / abs(row.measured_value) < 3 * std[index] + 1e-4


def free_case():
    """A structure that hangs free, with the truth beside it."""
    for seed in range(100):
        structure = draw_structure(seed)
        values = np.linalg.eigvalsh(structure.nominal_model.stiffness.toarray())
        if values[0] < 1e-9 * values[-1] / len(values):
            return seed
    raise AssertionError


def test_rigid_body_modes_stay():
    case = make_update_case(free_case())
    basis = make_structural_basis(case.structure.nominal_model, case.reduced_model)
    updated = update_model(case.fit, case.reduced_model, pairs=case.pairs, basis=basis)
    for model in (case.reduced_model, updated.model):
        values = np.abs(undamped_poles(model.mass, model.stiffness).values.real)
        assert np.count_nonzero(values < 1e-6 * np.abs(case.fit.model.poles[0]) ** 2) >= 2


def test_the_same_seed_gives_the_same_ensemble_and_another_another():
    case = make_update_case(3)
    first, second = (update_model(case.fit, case.reduced_model, pairs=case.pairs) for _ in range(2))
    other_seed = update_model(case.fit, case.reduced_model, pairs=case.pairs, options=UpdateOptions(seed=1, ensemble=7))
    assert np.array_equal(first.ensemble, second.ensemble)
    assert len(other_seed.ensemble) == 7
    assert not np.array_equal(first.ensemble[:7], other_seed.ensemble)


def test_without_targets_the_model_is_unchanged():
    case = make_update_case(3)
    updated = update_model(case.fit, case.reduced_model, pairs=Pairs(rows=()))
    assert updated.status is UpdateStatus.NOTHING_TO_DO
    assert updated.model is case.reduced_model
    assert updated.warnings


def test_a_target_that_all_others_contradict_is_excluded_and_reported():
    case = make_update_case(11)
    rows = list(case.pairs.rows)
    index = next(k for k, row in enumerate(rows) if row in case.pairs.targets and row.kind == "pole" and k > 0)
    rows[index] = replace(rows[index], measured_value=1.25 * rows[index].measured_value)
    basis = make_structural_basis(case.structure.nominal_model, case.reduced_model)
    updated = update_model(case.fit, case.reduced_model, pairs=replace(case.pairs, rows=tuple(rows)), basis=basis)
    assert len(updated.unmet) == 1
    assert "contradict it" in updated.unmet[0]
    assert f"{abs(rows[index].measured_value) / 2 / np.pi:.6g} Hz" in updated.unmet[0]
    honest = update_model(case.fit, case.reduced_model, pairs=case.pairs, basis=basis)
    assert not honest.unmet


def test_a_zero_that_shapes_leave_off_tells_nothing_of_damping():
    """Its real part is as far off as its modulus is."""
    case = make_update_case(5)
    basis = make_structural_basis(case.structure.nominal_model, case.reduced_model)
    rows = list(case.pairs.rows)
    index = next(k for k, row in enumerate(rows) if row in case.pairs.targets and row.kind == "zero")
    value = 1.25 * rows[index].measured_value
    dampings = []
    for wrong in (value, complex(5 * value.real, value.imag)):
        rows[index] = replace(rows[index], measured_value=wrong)
        updated = update_model(case.fit, case.reduced_model, pairs=replace(case.pairs, rows=tuple(rows)), basis=basis)
        dampings.append(updated.model.damping)
    assert_allclose(dampings[1], dampings[0], rtol=0, atol=OF_NOTHING * np.abs(dampings[0]).max())


def test_values_are_followed_to_the_stiffness_that_was_found_last(monkeypatch):
    """After damping came another stiffness: zeros of hundreds of FRFs would all have to be searched for."""
    found = []

    def spy(targets, reference, *model):
        found.append((reference, nearest_roots(targets, reference, *model)))
        return found[-1][1]

    monkeypatch.setattr("frf_ipz.updating.problem.nearest_roots", spy)
    case = make_update_case(5)
    updated = update_model(case.fit, case.reduced_model, pairs=case.pairs)
    assert "stiffness with damping" in set(updated.history.phase)
    followed, values = found[-1]
    assert_allclose(followed, values, rtol=FOLLOWED)


def test_noisier_targets_are_met_less():
    case = make_update_case(11)
    loud = replace(case.fit, covariance=1e4 * case.fit.covariance)
    near = [update_model(fit, case.reduced_model, pairs=case.pairs) for fit in (case.fit, loud)]
    values = np.array([row.measured_value for row in case.pairs.targets])
    error = [np.abs(np.log(np.abs(each.after) / np.abs(values))).max() for each in near]
    assert error[1] > 3 * error[0]
    assert near[1].history.size_of_change.iloc[0] < near[0].history.size_of_change.iloc[0]


def test_the_mass_of_a_sensor_is_found():
    """What a test adds to every structure: without it the stiffness has to make up for it, and is wrong."""
    case = make_update_case(21)
    sensor, grams = case.structure.sensors[0], 3e-3
    index = case.structure.nominal_model.full_index(sensor)
    added = np.zeros(case.structure.nominal_model.mass_all.shape)
    added[index, index] = grams
    real = replace(
        case.structure.nominal_model, mass_all=case.structure.nominal_model.mass_all + sparse.csr_array(added)
    )
    fit = simulate_fit(
        TrueModes(real, case.structure.damping), case.labels, case.fit.band_hz, rng=np.random.default_rng(0)
    )
    basis = make_structural_basis(case.structure.nominal_model, case.reduced_model, sensors=case.structure.sensors[:1])
    updated = update_model(fit, case.reduced_model, pairs=pair_roots(fit, case.reduced_model), basis=basis)
    row = case.reduced_model.row(sensor)
    mass = row @ (updated.model.mass - case.reduced_model.mass) @ row / (row @ row) ** 2
    assert_allclose(mass, grams, rtol=0.2)


def chosen_parameters(case, elements):
    """One factor for a segment of elements and nothing else, as a diagnosis would name it."""
    regions = reduced_regions(case.structure.nominal_model, case.reduced_model)
    stiffness = sum(regions[k].stiffness for k in elements)[None]
    nothing = np.zeros_like(stiffness)
    return ParameterBasis(
        names=("stiffness of the segment",),
        mass=nothing,
        damping=nothing,
        stiffness=stiffness,
        logarithmic=np.array([True]),
        terms=(PriorTerm(name="the segment", root=np.eye(1), std=0.5),),
        regions=(replace(regions[elements[0]], stiffness=stiffness[0]),),
        is_from_diagnosis=True,
    )


@pytest.mark.parametrize("method", ["minimal-change", "ipz"])
def test_parameters_from_a_diagnosis_find_the_truth(method):
    structure = draw_structure(21)
    elements = range(3, 9)
    factors = np.ones(len(structure.nominal_model.parts))
    factors[list(elements)] = 0.8
    truth, labels = (
        TrueModes(scale_stiffness(structure.nominal_model, factors), structure.damping),
        list_labels(structure.input_dofs, structure.sensors),
    )
    band = choose_band(truth, structure.n_modes)
    ends = {"actuators": structure.input_dofs, "sensors": structure.sensors, "points": structure.points}
    reduced = reduce_to_dofs(structure.nominal_model, options=ReduceOptions(), band_hz=band, **ends)
    fit = simulate_fit(truth, labels, band, noise=1e-4, rng=np.random.default_rng(0))
    case = replace(make_update_case(21), reduced_model=reduced, fit=fit, pairs=pair_roots(fit, reduced))
    options = UpdateOptions(method=method, damping=method == "minimal-change", delta=1e-9, max_iterations=60)
    updated = update_model(
        case.fit, case.reduced_model, pairs=case.pairs, options=options, basis=chosen_parameters(case, elements)
    )
    parameter = updated.history[updated.history.phase != "damping"].iloc[-1]["stiffness of the segment"]
    factor = parameter if method == "minimal-change" else np.exp(parameter)
    assert_allclose(factor, 0.8, rtol=0.01)  # the reduction basis is that of the nominal model


def test_the_history_has_every_iteration(updated):
    assert set(updated.history.columns) >= {"phase", "iteration", "misfit", "step"}
    assert list(updated.history.phase.unique())[:2] == ["stiffness", "damping"]
    columns = [name for name in updated.history.columns if name.startswith("stiffness of element")]
    assert columns
    assert updated.history[updated.history.phase == "stiffness"][columns].notna().all().all()


@pytest.fixture(scope="module")
def chain():
    """Fit of a free chain of masses with a soft spring, struck at one end and measured at the other too."""

    def make(soft):
        stiffness = np.zeros((5, 5))
        for place, rate in enumerate((5.9e5, soft * 7.1e5, 7.9e5, 6.7e5)):
            stiffness[place : place + 2, place : place + 2] += rate * np.array([[1.0, -1.0], [-1.0, 1.0]])
        return StructuralModel.from_matrices(
            sparse.csr_array(np.diag([9.1, 12.3, 9.8, 11.3, 11.9])),
            sparse.csr_array(stiffness),
            dofs=[f"{node}:x" for node in range(1, 6)],
            modal_damping=0.008,
        )

    labels = tuple(FrfLabel(Dof(node, "x"), Dof(1, "x"), FrfQuantity.ACCELERANCE) for node in (1, 3, 4, 5))
    fit = simulate_fit(TrueModes(make(0.65), np.full(5, 0.007)), labels, (5.0, 145.0), rng=np.random.default_rng(1))
    return fit, make(1.0)


def test_a_zero_that_only_damping_makes_spoils_no_update(chain):
    """Between the ends of a chain there is none without damping: in the update it runs to infinity."""
    fit, nominal = chain
    reduced_model = reduce_model(fit, nominal)
    problem = make_problem(reduced_model, fit, pair_roots(fit, reduced_model), basis=None)
    zeros = model_zeros(reduced_model, fit.labels[-1:])[0].values
    (made,) = zeros[(zeros.real > 0) & (zeros.imag > 0)][:1]
    with_one_more = replace(
        problem,
        values=np.append(problem.values, 1.05 * made),
        computed=np.append(problem.computed, made),
        covariance=linalg.block_diag(np.asarray(problem.covariance), np.eye(2)),
        frf=np.append(problem.frf, len(fit.labels) - 1),
        names=(*problem.names, "a zero of damping"),
    )
    plain, spoilt = (update(given, UpdateOptions(), silent) for given in (problem, with_one_more))
    assert_allclose(spoilt.after[:-1], plain.after, rtol=1e-4)


def test_overlaps_with_a_root_at_infinity_are_none():
    assert np.array_equal(_over(np.array([2.0, 3.0]), np.array([4.0, 0.0])), [0.5, 0.0])
