"""What changed between two states of a beam whose model is wrong in mass, stiffness and damping."""

from dataclasses import replace

import numpy as np
import pytest

import frf_ipz
from diagnosed import BAND_HZ, beam, labels, measured, observed
from frf_ipz.diagnosis.compare.corrected_model import MIN_SQUARE, correct_model
from frf_ipz.diagnosis.compare.learnt_nuisance import learn, pose_state_problem, predict_unchanged_model
from frf_ipz.diagnosis.compare.mass_loss import MassLoss
from frf_ipz.diagnosis.measured.data_split import split_data
from frf_ipz.errors import InputError
from frf_ipz.fe.changes import with_point_masses, with_scaled_parts
from frf_ipz.fe.eigen import solve_modes
from frf_ipz.fe.response import compute_frfs

FEW = frf_ipz.CompareOptions(
    effects=("added_mass", "local_stiffness", "grounded_spring", "sensor_gain", "damping_level")
)
ADDED_KG, HUNG_KG = 0.004, 0.008
SCATTER = 0.004  # relative, of the stiffness from test to test
SIZE = 0.05  # relative: 5 % is what the model may be wrong by


@pytest.fixture(scope="module")
def nominal(tmp_path_factory):
    return beam(tmp_path_factory.mktemp("beam"))


@pytest.fixture(scope="module")
def real(nominal):
    """The machine: 3 % stiffer than its model, with 6 g (4 %) more and other damping."""
    return real_one(nominal)


def real_one(model):
    heavier = with_point_masses(model, {10: 0.006})
    damping = np.array([0.013, 0.008, 0.011, 0.009])
    return replace(heavier, stiffness_all=1.03 * heavier.stiffness_all, modal_damping=damping)


def state(model, machine, seed, **options):
    return frf_ipz.MachineState(fe_model=model, observed=observed(measured(machine, seed=seed, **options)))


def test_nothing_has_changed(nominal, real):
    comparison = frf_ipz.compare_states(state(nominal, real, 1), state(nominal, real, 2), options=FEW)
    assert not comparison.is_changed
    assert comparison.changes == ()
    assert comparison.statement.startswith("Nothing has changed")


@pytest.mark.slow
def test_an_added_mass_is_found_though_the_model_is_wrong(nominal, real):
    after = with_point_masses(real, {12: ADDED_KG})
    comparison = frf_ipz.compare_states(state(nominal, real, 1), state(nominal, after, 2), options=FEW)
    assert comparison.diagnosis.verdict == "explained"
    (change,) = comparison.changes
    assert (change.effect, dict(change.location)) == ("added_mass", {"nodes": [12]})
    size = change.parameters["mass_kg"]
    assert size.low < ADDED_KG < size.high
    assert size.value == pytest.approx(ADDED_KG, rel=SIZE)


@pytest.mark.slow
def test_a_mass_that_is_gone_is_found(nominal):
    with_piece = with_point_masses(nominal, {14: 1.2 * HUNG_KG})  # its mass is not known well either
    machine = real_one(with_point_masses(nominal, {14: HUNG_KG}))
    comparison = frf_ipz.compare_states(
        state(with_piece, machine, 1), state(with_piece, real_one(nominal), 2), options=FEW
    )
    (change,) = comparison.changes
    assert (change.effect, dict(change.location)) == ("mass_loss", {"nodes": [14]})
    assert change.parameters["mass_kg"].value == pytest.approx(HUNG_KG, rel=SIZE)
    assert "is gone from node 14" in comparison.statement


def test_softer_elements_are_located(nominal, real):
    after = with_scaled_parts(real, "element", ["7", "8"], stiffness_ratio=0.8)
    comparison = frf_ipz.compare_states(state(nominal, real, 1), state(nominal, after, 2), options=FEW)
    (change,) = comparison.changes
    assert (change.effect, dict(change.location)) == ("local_stiffness", {"elements": [7, 8]})
    assert change.parameters["stiffness_ratio"].value == pytest.approx(0.8, rel=SIZE)


def test_gains_that_were_there_before_are_no_change(nominal, real):
    def channels(frequency_hz):
        return np.tile([1.05, 0.97], (len(frequency_hz), 1))

    before, after = (state(nominal, real, seed, factors=channels) for seed in (1, 2))
    options = frf_ipz.CompareOptions(effects=("added_mass", "sensor_gain"))
    assert not frf_ipz.compare_states(before, after, options=options).is_changed
    assert frf_ipz.compare_states(state(nominal, real, 1), after, options=options).is_changed


@pytest.mark.slow
def test_scatter_is_learnt_from_repeats(nominal, real):
    drawn = np.random.default_rng(0).standard_normal(7)
    machines = [replace(real, stiffness_all=(1 + SCATTER * deviation) * real.stiffness_all) for deviation in drawn]
    repeats = [state(nominal, machine, seed) for seed, machine in enumerate(machines)]
    comparison = frf_ipz.compare_states(repeats[:-1], repeats[-1], options=FEW)
    assert not comparison.is_changed
    std = SCATTER * drawn[:-1].std(ddof=1) / 2  # of frequencies; tolerances are half widths
    assert comparison.scatter.frequency_tolerance == pytest.approx(np.sqrt(3 * (1 + 1 / 6)) * std, rel=SIZE)
    assert frf_ipz.compare_states(repeats[4], repeats[6], options=FEW).is_changed


def test_the_corrected_model_has_the_measured_frfs(nominal, real):
    before = state(nominal, real, 1, noise=1e-6)
    source = split_data(before.observed)
    options = replace(FEW, model=replace(FEW.model, gain_tolerance=1e-5, position_tolerance_m_per_m=1e-6))
    corrected = predict_unchanged_model(before, learn([before], options), options, source)
    s = 2j * np.pi * np.linspace(*BAND_HZ, 300)
    required, predicted, plain = (compute_frfs(model, labels(), s) for model in (real, corrected, nominal))
    assert np.linalg.norm(predicted - required) < 0.02 * np.linalg.norm(plain - required)


def test_a_mode_whose_stiffness_a_fit_made_negative_stays_stable(nominal, real):
    """Modes below the band follow lines above them."""
    before = state(nominal, real, 1)
    problem = pose_state_problem(before, split_data(before.observed), FEW.model)
    nuisance = np.zeros(problem.nuisance_prior.size)
    nuisance[problem.nuisance_prior.frequency_indices[0]] = -1.1 / problem.nuisance_prior.kappa_std[0, 0]
    frequency_hz = solve_modes(correct_model(problem.make_hypothesis(()), nuisance)).natural_frequency_hz
    stated = solve_modes(nominal).natural_frequency_hz
    assert frequency_hz[0] == pytest.approx(np.sqrt(MIN_SQUARE) * stated[0], rel=1e-6)
    np.testing.assert_allclose(frequency_hz[1:4], stated[1:4], rtol=1e-6)


def test_a_node_cannot_lose_more_than_it_has(nominal):
    before = state(with_point_masses(nominal, {14: HUNG_KG}), nominal, 1)
    context = pose_state_problem(before, split_data(before.observed), FEW.model).context
    effect = MassLoss()
    (location,) = [location for location in effect.locations(context) if location == {"nodes": [14]}]
    (mass,) = effect.parameters(context, location)
    assert HUNG_KG < mass.high < HUNG_KG + context.mass_kg / 16  # and what an element has
    change = effect.build(context, location)(np.array([mass.high]))
    remaining = (context.model.mass_all + change.mass.tocsr()).toarray()[~nominal.fixed][:, ~nominal.fixed]
    assert np.linalg.eigvalsh(remaining).min() > 0


def test_no_state_before_is_refused(nominal, real):
    with pytest.raises(InputError, match="before holds no state"):
        frf_ipz.compare_states([], state(nominal, real, 1), options=FEW)


def test_states_of_other_channels_are_refused(nominal, real):
    single_channel = state(nominal, real, 2, names=labels(outputs=("17:+z",)))
    with pytest.raises(InputError, match="channels"):
        frf_ipz.compare_states([state(nominal, real, 1), single_channel], state(nominal, real, 3), options=FEW)
    with pytest.raises(InputError, match="channels"):
        frf_ipz.compare_states(state(nominal, real, 1), single_channel, options=FEW)
