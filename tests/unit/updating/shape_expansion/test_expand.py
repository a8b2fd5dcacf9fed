"""Measured shapes stand in for an update where what a model lacks is no change of its matrices."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse

import frf_ipz
from frf_ipz.export.state_space import make_state_space
from frf_ipz.updating.problem import make_problem
from frf_ipz.updating.shape_expansion import expand
from frf_ipz.updating.shape_expansion.attached_masses import attachment_places, find_attached_masses
from frf_ipz.updating.shape_expansion.expand import with_expanded_shapes
from frf_ipz.updating.shape_expansion.expanded_model import build_expanded_model, expand_modes
from frf_ipz.updating.shape_expansion.left_out_points import LeftOutPoints, ShapeErrors, calibrate, leave_points_out
from frf_ipz.updating.shape_expansion.measured_shapes import measured_shapes
from frf_ipz.updating.shape_expansion.random_forces import ModalModel, field_at_points
from frf_testbench.updating.synthetic_fit import TrueModes, simulate_fit

END_KG, TRANSDUCER_KG = 0.010, 0.006
SENSORS = [frf_ipz.Dof(node, "z") for node in (5, 13, 21, 29, 37)]
ACTUATORS = [SENSORS[0], SENSORS[2], SENSORS[4]]
BAND_HZ = (20.0, 500.0)


def make_nominal() -> frf_ipz.StructuralModel:
    return frf_ipz.make_beam(
        length_m=0.5,
        width_m=0.02,
        thickness_m=0.002,
        youngs_modulus_Pa=200e9,
        density_kg_m3=8000,
        elements=40,
        left="free",
        right="free",
        modal_ratio=0.005,
    )


def make_truth(*, resonator_hz: float) -> frf_ipz.StructuralModel:
    """Masses at ends and actuators, and a resonator beside the middle that no node of the model has."""
    beam = make_nominal()
    mass, stiffness = beam.mass.toarray(), beam.stiffness.toarray()
    for node, added in {1: END_KG, 41: END_KG, **{dof.node: TRANSDUCER_KG for dof in ACTUATORS}}.items():
        mass[(beam.index(frf_ipz.Dof(node, "z")),) * 2] += added
    place, hidden, rate = beam.index(frf_ipz.Dof(17, "z")), 0.003, (2 * np.pi * resonator_hz) ** 2
    mass = np.pad(mass, (0, 1))
    mass[-1, -1] = hidden
    stiffness = np.pad(stiffness, (0, 1))
    for row, column, sign in ((place, place, 1), (-1, -1, 1), (place, -1, -1), (-1, place, -1)):
        stiffness[row, column] += sign * hidden * rate
    return frf_ipz.StructuralModel.from_matrices(
        sparse.csr_array(mass), sparse.csr_array(stiffness), dofs=[*beam.dofs, "99:z"], modal_damping=0.005
    )


def labels_of(outputs: list[frf_ipz.Dof]) -> tuple[frf_ipz.FrfLabel, ...]:
    return tuple(
        frf_ipz.FrfLabel(output, force, frf_ipz.FrfQuantity.RECEPTANCE) for output in outputs for force in ACTUATORS
    )


@pytest.fixture(scope="module")
def left_out():
    """Fit of all sensors but the fourth, the model reduced, and the true FRFs at the fourth."""
    truth = TrueModes(make_truth(resonator_hz=180.0), np.full(60, 0.005))
    kept = [dof for dof in SENSORS if dof != SENSORS[3]]
    fit = simulate_fit(truth, labels_of(kept), BAND_HZ, rng=np.random.default_rng(5))
    lines = np.linspace(*BAND_HZ, 400)
    labels = labels_of([SENSORS[3]])
    values = np.stack([truth.receptance(2j * np.pi * lines, label) for label in labels], axis=1)
    reduced_model = frf_ipz.reduce_model(fit, make_nominal(), points=[SENSORS[3]])
    return fit, reduced_model, labels, lines, values


def error_db(updated, labels, lines, values):
    return float(np.median(np.abs(20 * np.log10(np.abs(updated.compute_frfs(labels, 2j * np.pi * lines) / values)))))


@pytest.fixture(scope="module")
def expanded(left_out):
    return frf_ipz.update_model(left_out[0], left_out[1], fe_model=make_nominal())


def test_a_sensor_is_predicted_where_no_change_of_matrices_meets_the_others(left_out, expanded):
    fit, _, labels, lines, values = left_out
    assert error_db(expanded, labels, lines, values) < 0.5
    low, high = frf_ipz.band_of_magnitudes(fit, expanded, labels=labels, s=2j * np.pi * lines)
    assert np.mean((np.abs(values) >= low) & (np.abs(values) <= high)) > 0.8
    assert np.median(20 * np.log10(high / low)) < 6.0


def test_bands_are_as_wide_as_what_is_due_between_and_beyond_measured_points(left_out, expanded):
    fit, *_ = left_out
    lines = 2j * np.pi * np.linspace(*BAND_HZ, 50)

    def widths(node, share):
        expansion = replace(expanded.expansion, inner_nodes=(29,), inner_spread=share)
        labels = labels_of([frf_ipz.Dof(node, "z")])
        low, high = frf_ipz.band_of_magnitudes(fit, replace(expanded, expansion=expansion), labels=labels, s=lines)
        return np.log(high / low)

    assert np.median(widths(29, 0.5) / widths(29, 1.0)) < 0.9
    np.testing.assert_allclose(widths(33, 0.5), widths(33, 1.0))


def test_the_band_where_the_test_only_excites_is_as_wide_as_reciprocity_holds(left_out, expanded):
    fit, *_ = left_out
    lines = 2j * np.pi * np.linspace(*BAND_HZ, 50)
    only_sensed = frf_ipz.FrfLabel(SENSORS[0], SENSORS[1], frf_ipz.FrfQuantity.RECEPTANCE)

    def widths(label, spread):
        expansion = replace(expanded.expansion, inner_spread=0.5, reciprocal_spread=spread)
        low, high = frf_ipz.band_of_magnitudes(fit, replace(expanded, expansion=expansion), labels=[label], s=lines)
        return np.log(high / low)

    assert np.median(widths(only_sensed, 3.0) / widths(only_sensed, 0.5)) > 1.1
    np.testing.assert_allclose(widths(fit.labels[0], 3.0), widths(fit.labels[0], 0.5))


def test_sensors_that_see_more_than_what_excites_them_are_told_by_points_on_both_sides(left_out):
    fit, reduced_model, *_ = left_out
    numbers = [SENSORS.index(label.output_dof) for label in fit.labels]
    seen_besides = 1 + 0.3 * np.random.default_rng(1).normal(size=(fit.n_modes, len(SENSORS)))[:, numbers]
    residues = fit.model.residues.copy()
    residues[: fit.n_modes] *= seen_besides
    besides = replace(fit, model=replace(fit.model, residues=residues))
    holds, fails = (leave_points_out(each, reduced_model, error=0.03, scatter=0.03) for each in (fit, besides))
    on_both = [point in ACTUATORS for point in holds.points]
    assert len(holds.reciprocal) == sum(on_both)
    assert not holds.is_told.any()  # with another actuator each can be left out on both sides
    assert calibrate(fails.reciprocal) > 2 * calibrate(holds.reciprocal)
    assert calibrate(fails.reciprocal) > calibrate(fails.errors)


def test_the_update_alone_is_far_off(left_out):
    fit, reduced_model, *frfs = left_out
    options = frf_ipz.UpdateOptions(expand=False, ensemble=0)
    plain = frf_ipz.update_model(fit, reduced_model, fe_model=make_nominal(), options=options)
    assert plain.expansion is None
    assert error_db(plain, *frfs) > 2.0


def test_masses_and_a_split_mode_are_named(expanded):
    found = {mass.place: mass for mass in expanded.expansion.masses}
    for place in ("1:z", "41:z"):
        assert found[place].low_kg < END_KG < found[place].high_kg
    for dof in ACTUATORS:
        assert found[dof.name].low_kg < TRANSDUCER_KG < found[dof.name].high_kg
    assert abs(expanded.expansion.stiffness_ratio - 1) < 0.02
    ((low, high),) = expanded.expansion.split
    assert low < 180.0 < high


def test_masses_do_not_hang_on_how_shapes_were_rounded(left_out):
    fit, reduced_model, *_ = left_out
    measured = measured_shapes(fit)
    places = attachment_places(reduced_model, measured, make_nominal().geometry)
    rounding = 1 + 1e-11 * np.random.default_rng(3).normal(size=measured.at_outputs.shape)
    rounded = replace(measured, at_outputs=measured.at_outputs * rounding)
    first, second = (find_attached_masses(reduced_model, shapes, places) for shapes in (measured, rounded))
    assert len(first.masses) == 5
    expected = [mass.mass_kg for mass in first.masses]
    np.testing.assert_allclose([mass.mass_kg for mass in second.masses], expected, rtol=1e-5, atol=1e-7)
    assert second.stiffness_ratio == pytest.approx(first.stiffness_ratio, abs=1e-6)


def test_an_expanded_model_holds_the_measured_modes(left_out, expanded):
    fit, reduced_model, *_ = left_out
    squares = np.linalg.eigvals(np.linalg.solve(expanded.model.mass, expanded.model.stiffness)).real
    hertz = np.sqrt(np.maximum(squares, 0.0)) / (2 * np.pi)
    measured_hz = np.abs(fit.model.poles[: fit.n_modes]) / (2 * np.pi)
    assert np.abs(hertz[:, None] - measured_hz).min(axis=0).max() < 1e-6 * measured_hz.max()
    hidden = [dof for dof in expanded.model.dofs if dof.direction == "q"]
    assert len(hidden) == len(expanded.model.dofs) - len(reduced_model.dofs) > 0
    assert frf_ipz.predict_frfs(fit, expanded, points=["29:+z"]).values.shape[1] == len(ACTUATORS)
    assert make_state_space(fit, expanded, points=[frf_ipz.parse_dof("29:+z")]).A.size


def test_an_update_that_meets_the_measurement_stays(left_out):
    """Only the stiffness is off, which an update finds."""
    stiffer = frf_ipz.make_beam(
        length_m=0.5,
        width_m=0.02,
        thickness_m=0.002,
        youngs_modulus_Pa=215e9,
        density_kg_m3=8000,
        elements=40,
        left="free",
        right="free",
        modal_ratio=0.005,
    )
    truth = TrueModes(stiffer, np.full(60, 0.005))
    fit = simulate_fit(truth, left_out[0].labels, BAND_HZ, rng=np.random.default_rng(6))
    updated = frf_ipz.update_model(fit, left_out[1], fe_model=make_nominal())
    assert updated.expansion is None
    assert len(updated.model.dofs) == len(left_out[1].dofs)


@pytest.mark.parametrize("is_near", [True, False])
def test_an_update_is_judged_by_points_that_it_was_not_given(left_out, expanded, is_near):
    fit, reduced_model, *_ = left_out
    plain = frf_ipz.update_model(fit, reduced_model, options=frf_ipz.UpdateOptions(expand=False, ensemble=0))
    chosen = with_expanded_shapes(
        plain,
        fit,
        make_problem(reduced_model, fit, frf_ipz.pair_roots(fit, reduced_model), None),
        update_without=lambda _: expanded if is_near else plain,
        geometry=make_nominal().geometry,
        options=frf_ipz.UpdateOptions(ensemble=2),
    )
    assert (chosen is plain) == is_near


def test_shapes_that_scatter_beyond_any_structure_do_not_take_the_place_of_an_update(left_out, monkeypatch):
    """As a mode that is none makes left-out points: members have no mass then, to rounding, and the run stopped."""
    fit, reduced_model, *_ = left_out
    plain = frf_ipz.update_model(fit, reduced_model, options=frf_ipz.UpdateOptions(expand=False, ensemble=0))
    monkeypatch.setattr(expand, "_calibrations", lambda *_: (1e3, 1e3))
    chosen = with_expanded_shapes(
        plain,
        fit,
        make_problem(reduced_model, fit, frf_ipz.pair_roots(fit, reduced_model), None),
        update_without=lambda _: plain,
        geometry=make_nominal().geometry,
        options=frf_ipz.UpdateOptions(ensemble=20),
    )
    assert chosen is plain


def test_a_model_frequency_at_a_measured_one_makes_no_shape_surer(left_out):
    """A model is known to within the scatter of its frequencies: which of them is met by chance is no knowledge."""
    fit, reduced_model, *_ = left_out
    measured = measured_shapes(fit)
    scatter, mode = 0.05, 2
    modal = ModalModel.of(reduced_model, measured, scatter)
    place = int(np.argmin(np.abs(modal.omega - measured.omega[mode])))
    omega = modal.omega * measured.omega[mode] / modal.omega[place]
    power = field_at_points(replace(modal, omega=omega), measured, mode).power
    gap = 1 - (omega[place + 1] / omega[place]) ** 2
    assert power[place] / power[place + 1] == pytest.approx((gap / (2 * scatter)) ** 2, rel=0.1)


def test_no_measured_mode_takes_the_place_of_a_rigid_body_mode(left_out):
    """The two of a free beam share their space up to rounding, which would decide what is predicted."""
    fit, reduced_model, *_ = left_out
    measured = measured_shapes(fit)
    at_outputs, at_inputs = measured.at_outputs.copy(), measured.at_inputs.copy()
    at_outputs[0], at_inputs[0] = 1 / np.sqrt(len(measured.outputs)), 1 / np.sqrt(len(measured.inputs))
    moved = replace(measured, at_outputs=at_outputs, at_inputs=at_inputs)
    modes = expand_modes(reduced_model, moved, error=0.05, scatter=0.03, is_scale_known=True)
    assert reduced_model.rigid.shape[1] == 2
    assert modes.amplitudes[:2, 0] @ modes.amplitudes[:2, 0] > 0.5 * (modes.amplitudes[:, 0] @ modes.amplitudes[:, 0])
    assert modes.remains[:2].all()


def test_a_point_whose_gain_is_off_is_named():
    expansion = frf_ipz.ShapeExpansion(
        points=("1:z", "2:z", "3:z", "4:z", "5:z", "6:z"),
        ratio=np.array([1.02, 0.99, 0.85, 1.01, 1.0, 0.98]),
        error_db=np.full(6, 0.3),
        updated_error_db=np.full(6, 1.7),
        stiffness_ratio=1.0,
        masses=(),
        split=(),
        is_level_known=True,
        wrong_gains=(("3:z", np.log(0.85), 0.02),),
    )
    (text,) = [text for text in expansion.statements if "gain" in text]
    assert text.startswith("what was measured at 3:z is 15 +- 2 % low in all its modes")


@pytest.mark.parametrize(("factor", "own"), [(3.0, 0.0), (3.0, 0.5), (1.0, 2.0)])
def test_stated_deviations_are_calibrated_beside_the_errors_of_what_was_left_out(factor, own):
    rng = np.random.default_rng(2)
    stated = rng.uniform(0.1, 1.0, (20, 50))
    difference = np.hypot(factor * stated, own) * rng.normal(size=stated.shape)
    errors = [
        ShapeErrors(difference=row, variance=std**2, own_variance=np.full(50, own**2))
        for row, std in zip(difference, stated, strict=True)
    ]
    assert calibrate(errors) == pytest.approx(factor, rel=0.15)


def test_a_point_at_rest_in_a_mode_is_off_by_its_place_as_others_are(left_out):
    """Where a mode has a node its amplitude is small and its slope is not."""
    holds = leave_points_out(*left_out[:2], error=0.03, scatter=0.03)
    own_std = np.sqrt([errors.own_variance for errors in holds.errors])
    assert own_std.min() > 0.3 * np.median(own_std)  # 0.07 where it is a part of that amplitude


def test_masses_are_taken_only_where_points_follow_better_by_more_than_chance():
    def cause(name, errors_db):
        points = tuple(SENSORS[: len(errors_db)])
        left_out = LeftOutPoints(
            points=points,
            error_db=np.array(errors_db),
            log_ratio=np.zeros(len(points)),
            errors=(),
            is_told=np.zeros(len(points), bool),
            reciprocal=(),
        )
        return expand._Cause(name, None, {}, left_out)

    none = cause("none", [0.28, 0.12, 0.20, 0.09])
    slightly, surely = cause("masses", [0.20, 0.15, 0.12, 0.10]), cause("masses", [0.12, 0.05, 0.08, 0.04])
    untold = expand._Cause("masses", None, {}, None)
    assert expand._least_cause([none, slightly]) is none
    assert expand._least_cause([none, surely]) is surely
    assert expand._least_cause([none, untold]) is none
    assert expand._least_cause([none]) is none


def test_stated_deviations_never_shrink():
    exact = ShapeErrors(difference=np.zeros(5), variance=np.ones(5), own_variance=np.zeros(5))
    assert calibrate([exact]) == 1.0


def test_few_points_tell_hardly_by_how_much_a_further_one_is_off():
    rng = np.random.default_rng(2)
    factors = np.exp(rng.normal(0.0, 0.5, 4000))
    errors = [
        ShapeErrors(difference=3 * factor * rng.normal(size=10), variance=np.ones(10), own_variance=np.zeros(10))
        for factor in factors
    ]
    held = [
        np.mean(np.abs(errors[place].difference) < 1.645 * calibrate(errors[place + 1 : place + 4]))
        for place in range(0, 4000, 4)
    ]
    assert 0.88 < np.mean(held) < 0.96  # 0.80 where three points are taken for as good as many


@pytest.fixture(scope="module")
def struck_far_from_the_sensor():
    """Five struck points and a lone sensor beyond them, expanded: the model, its members, and what was measured."""
    sensor, struck = frf_ipz.Dof(39, "z"), [frf_ipz.Dof(node, "z") for node in (3, 9, 15, 21, 27)]
    labels = tuple(frf_ipz.FrfLabel(sensor, force, frf_ipz.FrfQuantity.RECEPTANCE) for force in struck)
    truth = TrueModes(make_truth(resonator_hz=180.0), np.full(60, 0.005))
    fit = simulate_fit(truth, labels, BAND_HZ, rng=np.random.default_rng(5))
    reduced_model = frf_ipz.reduce_model(fit, make_nominal())
    measured = measured_shapes(fit)
    modes = expand_modes(reduced_model, measured, error=1e-3, scatter=0.03, is_scale_known=True)
    model, members = build_expanded_model(reduced_model, modes, count=60, calibration=1.0, seed=0)
    return modes, model, members, sensor, struck


def test_how_far_struck_points_move_over_a_sensor_beyond_them_is_known_as_well_as_the_model_says(
    struck_far_from_the_sensor,
):
    modes, model, members, sensor, struck = struck_far_from_the_sensor
    s = 1j * modes.measured.omega[-1:]

    def spread(output):
        label = frf_ipz.FrfLabel(output, struck[0], frf_ipz.FrfQuantity.RECEPTANCE)
        models = (replace(model, mass=mass, damping=loss, stiffness=stiffness) for mass, loss, stiffness in members)
        return np.std(np.log(np.abs([frf_ipz.compute_frfs(member, [label], s)[0, 0] for member in models])))

    assert spread(sensor) < 0.1 * spread(struck[1])  # which was measured
    assert spread(struck[1]) == pytest.approx(2 * modes.shapes[-1].split_std, rel=0.5)
    assert modes.shapes[-1].split_std > 0.01


def test_another_split_leaves_what_was_measured(struck_far_from_the_sensor):
    shape = struck_far_from_the_sensor[0].shapes[0]
    other = shape.with_split(0.3)
    np.testing.assert_allclose(np.outer(other.at_outputs, other.at_inputs), np.outer(shape.at_outputs, shape.at_inputs))
    np.testing.assert_allclose(other.at_inputs, shape.at_inputs * np.exp(0.3))


def test_a_point_with_a_wrong_gain_does_not_move_the_others(left_out):
    """One of seven sensors reads 30 % high: a point beside it is predicted as if it did not."""
    *_, labels, lines, values = left_out
    truth = TrueModes(make_truth(resonator_hz=180.0), np.full(60, 0.005))
    sensors = [frf_ipz.Dof(node, "z") for node in (5, 9, 13, 21, 25, 33, 37)]
    fit = simulate_fit(truth, labels_of(sensors), BAND_HZ, rng=np.random.default_rng(5))
    gains = [1.3 if label.output_dof == sensors[4] else 1.0 for label in fit.labels]
    scaled = {"residues": fit.model.residues * gains, "coefficients": fit.model.coefficients * gains}
    off = replace(fit, model=replace(fit.model, **scaled))
    reduced_model = frf_ipz.reduce_model(fit, make_nominal(), points=[SENSORS[3]])
    updated = frf_ipz.update_model(off, reduced_model, fe_model=make_nominal())
    assert error_db(updated, labels, lines, values) < 0.3
    low, high = frf_ipz.band_of_magnitudes(off, updated, labels=labels, s=2j * np.pi * lines)
    assert np.median(10 * np.log10(high / low)) < 0.3  # 0.17 without the wrong gain
    np.testing.assert_allclose(updated.expansion.wrong_gains_of(off.labels), gains, rtol=0.02, atol=0)
