"""What each effect changes, against formulas and models that were changed by other means."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from diagnosed import beam, labels, lumped
from frf_ipz.diagnosis.catalogue.finder import shipped_effects
from frf_ipz.diagnosis.catalogue.model_context import ModelContext
from frf_ipz.diagnosis.evidence.hypothesis import Component, make_hypothesis
from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.model.basis import make_basis
from frf_ipz.diagnosis.model.change import with_change
from frf_ipz.diagnosis.model.layout import make_layout
from frf_ipz.diagnosis.model.nuisance import make_nuisance_prior
from frf_ipz.diagnosis.model.response import nuisance_jacobian
from frf_ipz.diagnosis.options import DiagnoseOptions
from frf_ipz.dofs import Dof, parse_dof
from frf_ipz.fe.beam_models import with_axial_force, with_formulation
from frf_ipz.fe.changes import with_point_masses, with_released_supports, with_scaled_parts, with_springs
from frf_ipz.fe.eigen import solve_modes
from frf_ipz.fe.response import compute_frfs
from frf_ipz.frf import FrfLabel
from frf_ipz.quantities import FrfQuantity
from frf_ipz.structure import StructuralModel

BAND_HZ = (10.0, 700.0)
MIDDLE = 2 * np.pi * np.sqrt(BAND_HZ[0] * BAND_HZ[1])
FIRST_CHANNEL = Location.on_channel("acc_1")
ONE_TO_THREE = Location(nodes=(1, 3), directions=("x",))
LEFT_ROTATION = Location(end="left", nodes=(1,), directions=("ry",))
S = 3.0 + 2j * np.pi * np.geomspace(*BAND_HZ, 60)
REDUCED = 2e-4  # of the largest FRF: the basis has modes and static shapes, not all DOFs
EXACT = 1e-9  # of the same numbers along two ways
LOSSES = 0.03  # modal damping acts on what is attached as well, once it is in the matrices
STEP = 1e-6  # standard deviations, of a finite difference
DIFFERENCE = 0.03  # relative: that damping follows frequency is left out of the derivatives, and the ratio is 0.01


def context_of(model, names):
    layout = make_layout(names)
    options = DiagnoseOptions()
    return ModelContext(
        basis=make_basis(model, 2 * np.pi * BAND_HZ[1], layout.dofs),
        layout=layout,
        band_hz=BAND_HZ,
        contour=S,
        options=options,
    )


def changed_frfs(model, name, location, values, names=None):
    """FRFs with an effect as the diagnosis evaluates them."""
    context = context_of(model, names or labels())
    effect = shipped_effects()[name]
    nuisance_prior = make_nuisance_prior(context.basis, context.layout, DiagnoseOptions())
    hypothesis = make_hypothesis(context, nuisance_prior, (Component(effect=effect, location=location, n_locations=1),))
    return hypothesis.respond(np.array(values, float), np.zeros(nuisance_prior.size), S).values


def assert_same(actual, expected, tolerance):
    assert np.abs(actual - expected).max() < tolerance * np.abs(expected).max()
    assert_allclose(np.abs(actual - expected) / np.abs(expected).mean(0), 0, atol=30 * tolerance, rtol=0)


def test_the_nominal_model_is_that_of_the_fe_stage(tmp_path):
    model = beam(tmp_path)
    assert_same(
        changed_frfs(model, "sensor_gain", FIRST_CHANNEL, [1.0]),
        compute_frfs(model, labels(), S),
        REDUCED,
    )


def test_added_mass(tmp_path):
    model = beam(tmp_path)
    expected = compute_frfs(with_point_masses(model, {12: 0.03}), labels(), S)
    assert_same(changed_frfs(model, "added_mass", Location.at_node(12, "z"), [0.03]), expected, REDUCED)


def test_grounded_spring(tmp_path):
    model = beam(tmp_path)
    expected = compute_frfs(with_springs(model, {Dof(12, "z"): 5e3}), labels(), S)
    assert_same(changed_frfs(model, "grounded_spring", Location.at_node(12, "z"), [5e3]), expected, REDUCED)


def test_coupling_spring_on_a_frame(tmp_path):
    model = lumped(tmp_path)
    names = labels(("3:+x", "1:-x"), ("2:+x",))
    stiffness = 3e5
    wide = model.stiffness_all.toarray()
    ends = [model.full_index(Dof(node, "x")) for node in (1, 3)]
    wide[np.ix_(ends, ends)] += stiffness * np.array([[1, -1], [-1, 1]])
    expected = damped_frfs(model, wide, model.mass_all.toarray(), names)
    assert_same(
        changed_frfs(model, "coupling_spring", ONE_TO_THREE, [stiffness], names),
        expected,
        REDUCED,
    )


def damped_frfs(model, stiffness, mass, names, ratio=0.01):
    """Accelerances by the modes of full matrices: no reduction, no inversion lemma."""
    free = np.flatnonzero(~model.fixed)
    k, m = stiffness[np.ix_(free, free)], mass[np.ix_(free, free)]
    root = np.diag(1 / np.sqrt(np.diag(m))) if np.count_nonzero(m - np.diag(np.diag(m))) == 0 else None
    values, vectors = np.linalg.eigh(root @ k @ root)
    shapes = root @ vectors
    rows = {dof.unsigned: index for index, dof in enumerate(np.array(model.all_dofs, object)[free])}
    columns = []
    for label in names:
        out, struck = shapes[rows[label.output_dof.unsigned]], shapes[rows[label.input_dof.unsigned]]
        modal = S[:, None] ** 2 + 2 * ratio * np.sqrt(values) * S[:, None] + values
        columns.append(label.sign * S**2 * ((out * struck) / modal).sum(1))
    return np.stack(columns, 1)


def test_local_stiffness_of_a_segment_and_of_a_spring(tmp_path):
    model = beam(tmp_path)
    expected = compute_frfs(with_scaled_parts(model, "element", ["5", "6"], stiffness_ratio=0.6), labels(), S)
    assert_same(changed_frfs(model, "local_stiffness", Location(elements=(5, 6)), [0.6]), expected, REDUCED)
    frame = lumped(tmp_path)
    names = labels(("3:+x", "1:-x"), ("2:+x",))
    expected = compute_frfs(with_scaled_parts(frame, "spring", ["k2"], stiffness_ratio=1.4), names, S)
    assert_same(changed_frfs(frame, "local_stiffness", Location(springs=("k2",)), [1.4], names), expected, REDUCED)


def test_global_stiffness_moves_all_frequencies_alike(tmp_path):
    frame = lumped(tmp_path)
    names = labels(("3:+x", "1:-x"), ("2:+x",))
    expected = damped_frfs(frame, 1.21 * frame.stiffness_all.toarray(), frame.mass_all.toarray(), names)
    assert_same(changed_frfs(frame, "global_stiffness", Location(), [1.21], names), expected, REDUCED)


def test_boundary_compliance(tmp_path):
    model = beam(tmp_path)
    expected = compute_frfs(with_released_supports(model, {Dof(1, "ry"): 200.0}), labels(), S)
    assert_same(
        changed_frfs(model, "boundary_compliance", LEFT_ROTATION, [200.0]),
        expected,
        REDUCED,
    )


def test_axial_load(tmp_path):
    model = beam(tmp_path, right="pinned")
    names = labels(("9:+z",), ("6:+z",))
    expected = compute_frfs(with_axial_force(model, 300.0), names, S)
    assert_same(changed_frfs(model, "axial_load", Location(), [300.0], names), expected, REDUCED)


def test_shear_and_rotary_inertia(tmp_path):
    model = beam(tmp_path, thickness_m=0.03)
    expected = compute_frfs(with_formulation(model, "timoshenko"), labels(), S)
    assert_same(changed_frfs(model, "shear_rotary_inertia", Location(), []), expected, REDUCED)


def test_damping_level(tmp_path):
    frame = lumped(tmp_path)
    names = labels(("3:+x",), ("2:+x",))
    expected = damped_frfs(frame, frame.stiffness_all.toarray(), frame.mass_all.toarray(), names, ratio=0.03)
    assert_same(changed_frfs(frame, "damping_level", Location(), [0.03], names), expected, REDUCED)


@pytest.mark.parametrize(
    ("name", "location", "values", "dynamic"),
    [
        ("local_damper", Location.at_node(1, "x"), [40.0], lambda s: 40.0 * s),
        (
            "attached_resonator",
            Location.at_node(1, "x"),
            [0.2, 60.0, 0.05],
            lambda s: 0.2 * s**2 * resonator(s) / (0.2 * s**2 + resonator(s)),
        ),
        ("viscoelastic_joint", Location.at_node(3, "x"), [4e4, 2e-3], lambda s: 4e4 * s * 2e-3 / (1 + s * 2e-3)),
    ],
)
def test_what_is_attached(tmp_path, name, location, values, dynamic):
    frame = lumped(tmp_path)
    node = location.node
    names = labels(("3:+x", "1:+x"), ("2:+x",), FrfQuantity.RECEPTANCE)
    around = tuple(FrfLabel(parse_dof(f"{a}:+x"), parse_dof(f"{b}:+x"), FrfQuantity.RECEPTANCE) for a, b in (
        (3, node), (1, node), (node, 2), (node, node)))  # fmt: skip
    bare, cross = compute_frfs(frame, names, S), compute_frfs(frame, around, S)
    stiff = dynamic(S)
    effective = stiff / (1 + stiff * cross[:, 3])
    expected = bare - np.stack([cross[:, 0], cross[:, 1]], 1) * (effective * cross[:, 2])[:, None]
    assert_same(changed_frfs(frame, name, location, values, names), expected, REDUCED)


def resonator(s):
    omega = 2 * np.pi * 60.0
    return 0.2 * (omega**2 + 2 * 0.05 * omega * s)


def rising(ratio):
    """Modulus of a loss factor of 0.04 over that where the ratio is i."""
    return (1 + 0.04j) * (ratio / 1j) ** (2 / np.pi * np.arctan(0.04))


@pytest.mark.parametrize(
    ("form", "modulus", "ratio"),
    [
        ("", lambda _, __: 1 + 0.04j, 0.01),
        ("causal", lambda s, _: rising(s / MIDDLE), 0.01),
        ("causal, mode by mode", lambda s, omega: rising(s / omega), 0.01),
        ("of modes", lambda _, __: 1, 0.03),
    ],
)
def test_structural_damping(tmp_path, form, modulus, ratio):
    frame = lumped(tmp_path)
    names = labels(("3:+x",), ("2:+x",), FrfQuantity.RECEPTANCE)
    free = ~frame.fixed
    k, m = frame.stiffness_all.toarray()[np.ix_(free, free)], frame.mass_all.toarray()[np.ix_(free, free)]
    squares, vectors = np.linalg.eigh(k / np.sqrt(np.outer(np.diag(m), np.diag(m))))
    shapes = vectors / np.sqrt(np.diag(m))[:, None]
    stiffness = squares * modulus(S[:, None], np.sqrt(squares))
    modal = S[:, None] ** 2 + 2 * ratio * np.sqrt(squares) * S[:, None] + stiffness
    expected = ((shapes[2] * shapes[1]) / modal).sum(1)[:, None]
    assert_same(changed_frfs(frame, "structural_damping", Location(form=form), [0.04], names), expected, REDUCED)


@pytest.mark.parametrize(
    "stated",
    [
        {"damping": "rayleigh = { alpha_1_s = 3.0, beta_s = 2e-5 }"},
        {"dashpot_Ns_m": 20.0},
        {"damping": "rayleigh = { alpha_1_s = 0.0, beta_s = 2e-5 }", "dashpot_Ns_m": 20.0},
    ],
    ids=["rayleigh", "ratio and dashpot", "rayleigh and dashpot"],
)
def test_a_damping_matrix_is_that_of_the_fe_stage_and_its_modal_part_scatters(tmp_path, stated):
    frame = lumped(tmp_path, **stated)
    names = labels(("3:+x",), ("2:+x",))
    context = context_of(frame, names)
    nuisance_prior = make_nuisance_prior(context.basis, context.layout, DiagnoseOptions())
    nothing = make_hypothesis(context, nuisance_prior, ())
    none = np.zeros(nuisance_prior.size)
    assert_same(nothing.respond(np.zeros(0), none, S).values, compute_frfs(frame, names, S), REDUCED)
    modes = nothing.modes(np.zeros(0), none)
    assert (modes.viscous is not None) == ("dashpot_Ns_m" in stated)
    jacobian = nuisance_jacobian(nothing.respond(np.zeros(0), none, S), nuisance_prior, context.layout)
    for location in nuisance_prior.damping_indices[:3]:
        step = np.where(np.arange(nuisance_prior.size) == location, STEP, 0.0)
        up, down = (nothing.respond(np.zeros(0), sign * step, S).values for sign in (1, -1))
        slope = (up - down) / (2 * STEP)
        assert np.linalg.norm(slope) > 0
        assert np.linalg.norm(jacobian[:, :, location] - slope) < DIFFERENCE * np.linalg.norm(slope)


def test_a_damping_level_replaces_a_damping_matrix(tmp_path):
    frame = lumped(tmp_path, damping="rayleigh = { alpha_1_s = 3.0, beta_s = 2e-5 }")
    names = labels(("3:+x",), ("2:+x",))
    undamped = replace(frame, damping_all=0 * frame.damping_all, modal_damping=np.array([0.03]))
    frfs_changed = changed_frfs(frame, "damping_level", Location(), [0.03], names)
    assert_same(frfs_changed, compute_frfs(undamped, names, S), REDUCED)
    context = context_of(frame, names)
    effect = shipped_effects()["damping_level"]
    (location,) = effect.locations(context)
    corrected = with_change(frame, effect.build(context, location)(np.array([0.03])))
    assert_same(compute_frfs(corrected, names, S), compute_frfs(undamped, names, S), EXACT)
    (parameter,) = effect.parameters(context, location)
    assert_allclose(parameter.neutral, np.median(solve_modes(frame).damping_ratio), rtol=1e-3)


def test_another_level_of_damping_goes_before_half_a_loss_factor_for_each_mode(tmp_path):
    context = context_of(lumped(tmp_path), labels(("3:+x",), ("2:+x",)))
    effect = shipped_effects()["structural_damping"]
    priors = {
        location.form: effect.log_prior(context, location, np.array([0.01])) for location in effect.locations(context)
    }
    assert priors["of modes"] < priors[""] == priors["causal"] == priors["causal, mode by mode"] == 0
    assert priors["of modes"] > -5.0  # nats: it stays among what is reported


@pytest.mark.parametrize("form", ["", "causal", "causal, mode by mode", "of modes"])
def test_half_a_loss_factor_goes_into_the_damping_of_a_corrected_model(tmp_path, form):
    context = context_of(lumped(tmp_path), labels(("3:+x",), ("2:+x",)))
    builder = shipped_effects()["structural_damping"].build(context, Location(form=form))
    corrected = with_change(context.model, builder(np.array([0.04])))
    assert_allclose(corrected.modal_damping, context.model.modal_damping + 0.02, rtol=EXACT)


@pytest.mark.parametrize(
    ("name", "location", "values", "factor"),
    [
        ("sensor_gain", Location.on_channel("acc_2", sign=-1), [1.3], lambda s: -1.3 + 0 * s),
        ("time_delay", Location.on_channel("acc_2"), [1e-4], lambda s: np.exp(-1e-4 * s)),
        ("sensor_dynamics", Location.on_channel("acc_2", form="highpass"), [20.0], lambda s: s / (s + 40 * np.pi)),
        (
            "sensor_dynamics",
            Location.on_channel("acc_2", form="lowpass"),
            [900.0],
            lambda s: 1 / (1 + s / (1800 * np.pi)),
        ),
    ],
)
def test_channels(tmp_path, name, location, values, factor):
    model = beam(tmp_path)
    plain = changed_frfs(model, "sensor_gain", FIRST_CHANNEL, [1.0])
    frfs_changed = changed_frfs(model, name, location, values)
    assert_allclose(frfs_changed[:, 0], plain[:, 0], rtol=EXACT)
    assert_allclose(frfs_changed[:, 1], plain[:, 1] * factor(S), rtol=EXACT)
    force = changed_frfs(model, name, replace(location, channels=("force",)), values)
    assert_allclose(force * np.broadcast_to(factor(S), S.shape)[:, None], plain, rtol=EXACT)


def test_a_misplaced_sensor_shows_the_other_node(tmp_path):
    model = beam(tmp_path)
    expected = compute_frfs(model, labels(("17:+z", "13:-z")), S)
    location = Location(channels=("acc_2",), nodes=(13,), directions=("z",))
    assert_same(
        changed_frfs(model, "sensor_misplaced", location, []),
        expected,
        REDUCED,
    )


@pytest.mark.parametrize(
    ("name", "location", "values"),
    [
        ("local_damper", Location.at_node(12, "z"), [3.0]),
        ("attached_resonator", Location.at_node(12, "z"), [0.02, 120.0, 0.05]),
        ("viscoelastic_joint", Location.at_node(12, "z"), [2e3, 2e-3]),
        ("boundary_compliance", LEFT_ROTATION, [200.0]),
    ],
)
def test_the_change_as_matrices_is_the_change(tmp_path, name, location, values):
    model = beam(tmp_path)
    context = context_of(model, labels())
    change = shipped_effects()[name].build(context, location)(np.array(values))
    s = 1j * S.imag
    changed = compute_frfs(with_change(model, change), labels(), S)
    assert_same(changed, changed_frfs(model, name, location, values), LOSSES)
    assert np.isfinite(compute_frfs(with_change(model, change), labels(), s)).all()


def test_two_attachments_that_move_by_themselves_are_both_in_the_matrices(tmp_path):
    model = beam(tmp_path)
    context = context_of(model, labels())
    effects = shipped_effects()
    resonator_, joint = (
        effects[name].build(context, location)(np.array(values))
        for name, location, values in (
            ("attached_resonator", Location.at_node(12, "z"), [0.02, 120.0, 0.05]),
            ("viscoelastic_joint", Location.at_node(16, "z"), [2e3, 2e-3]),
        )
    )
    one_by_one = with_change(with_change(model, resonator_), joint)
    together = with_change(model, resonator_ + joint)
    assert len(together.all_dofs) == len(model.all_dofs) + 2 == len(set(together.all_dofs))
    changed, expected = compute_frfs(together, labels(), S), compute_frfs(one_by_one, labels(), S)
    assert_allclose(changed, expected, rtol=EXACT)
    assert not np.allclose(changed, compute_frfs(with_change(model, resonator_), labels(), S), rtol=LOSSES)


def test_derivatives_by_nuisance_parameters(tmp_path):
    model = beam(tmp_path, right="pinned")
    context = context_of(model, labels(("9:+z",)))
    nuisance_prior = make_nuisance_prior(context.basis, context.layout, DiagnoseOptions())
    hypothesis = make_hypothesis(context, nuisance_prior, ())
    start = 0.3 * np.random.default_rng(1).standard_normal(nuisance_prior.size)
    here = hypothesis.respond(np.zeros(0), start, S)
    jacobian = nuisance_jacobian(here, nuisance_prior, context.layout)
    for index in range(0, nuisance_prior.size, 3):
        moved = start.copy()
        moved[index] += STEP
        difference = (hypothesis.respond(np.zeros(0), moved, S).values - here.values) / STEP
        scale = np.abs(jacobian[:, :, index]).max() + 1e-6 * np.abs(here.values).max()  # rounding of the difference
        assert np.abs(difference - jacobian[:, :, index]).max() < DIFFERENCE * scale


def spatial_model():
    """A mass on three springs that are not alike, beside another one: each node moves in two directions."""
    rows = [[3.0, 0.5, -1.0, 0.0], [0.5, 2.0, 0.0, -0.5], [-1.0, 0.0, 4.0, 0.3], [0.0, -0.5, 0.3, 2.5]]
    stiffness = 1e5 * np.array(rows)
    dofs = ["1:x", "1:z", "2:x", "2:z"]
    places = {1: (0.0, 0.0, 0.0), 2: (1.0, 0.0, 0.5)}
    masses = np.diag([2.0, 2.0, 1.0, 1.0])
    return StructuralModel.from_matrices(masses, stiffness, dofs=dofs, coordinates=places, modal_damping=0.01)


def test_a_sensor_may_show_another_axis_of_its_node():
    names = [FrfLabel(parse_dof(dof), Dof(2, "x"), FrfQuantity.ACCELERANCE, dof[-1]) for dof in ("1:-x", "1:+z")]
    turned = [replace(names[0], output_dof=parse_dof("1:-z")), names[1]]
    model = spatial_model()
    expected = compute_frfs(model, turned, S)
    location = Location(channels=("x",), nodes=(1,), directions=("z",))
    assert_same(changed_frfs(model, "sensor_misplaced", location, [], names), expected, REDUCED)


def test_a_direction_that_is_not_exact_shows_some_of_the_other_axes():
    """The derivative by the angle of a sensor is the motion across it."""
    names = [FrfLabel(Dof(1, "x"), Dof(2, "x"), FrfQuantity.ACCELERANCE, "a")]
    model = spatial_model()
    context = context_of(model, names)
    nuisance_prior = make_nuisance_prior(context.basis, context.layout, DiagnoseOptions(angle_tolerance_deg=3.0))
    hypothesis = make_hypothesis(context, nuisance_prior, ())
    values = np.zeros(nuisance_prior.size)
    towards_z = nuisance_prior.blocks.output_shifts.start + nuisance_prior.axes.index("turned to z")
    values[towards_z] = 1.0
    changed = hypothesis.respond(np.zeros(0), values, S).values - hypothesis.respond(np.zeros(0), 0 * values, S).values
    across = compute_frfs(model, [replace(names[0], output_dof=Dof(1, "z"))], S)
    assert_same(changed, np.deg2rad(3.0) / np.sqrt(3) * across, REDUCED)
