"""A mistake of a user's is named with the line to correct; where none was made, none is named."""

from dataclasses import replace

import numpy as np
import pytest

import frf_ipz
from clamped_beam import BEAM
from frf_ipz.assessment.assess import likely_cause
from frf_ipz.assessment.causes import places
from frf_ipz.assessment.causes.cause import Situation, log_evidence
from frf_ipz.assessment.causes.cost_bounds import CostBounds, bound_costs
from frf_ipz.assessment.causes.likely_cause import KINDS, find_likely_cause
from frf_ipz.assessment.causes.modal_comparison import computed_modes, log_likelihood, measured_modes

OUTPUTS, INPUTS = ("8:+z", "15:+z", "21:+z"), ("11:+z", "19:+z")
LINES = np.arange(5.0, 900.0, 0.5)
MOST_COMPUTED = 100  # causes; 277 of them are within 40 nats of none
NOISE = 1e-3  # of the root mean square of an FRF
COLUMNS = {output: f"acc_{place}" for place, output in enumerate(OUTPUTS)}
FRF = tuple(
    frf_ipz.FrfLabel(output, source, "accelerance", COLUMNS[output], "force") for output in OUTPUTS for source in INPUTS
)


def measure(*, seed=0, **changed):
    """FRFs of a machine that is 2 % stiffer than its model, and has 3 g more at a node."""
    machine = frf_ipz.make_beam(
        **{**BEAM, "youngs_modulus_Pa": 71.4e9, **changed, "point_mass": [EXTRA, *changed.get("point_mass", [])]}
    )
    values = frf_ipz.compute_frfs(machine, FRF, 2j * np.pi * LINES)
    rng = np.random.default_rng(seed)
    std = NOISE * np.sqrt(np.mean(np.abs(values) ** 2, axis=0))
    noise = rng.normal(size=(2, *values.shape)) * std / np.sqrt(2)
    return frf_ipz.FrfSet(
        frequency_hz=LINES,
        values=values + noise[0] + 1j * noise[1],
        labels=FRF,
        variance=np.tile(std**2, (len(LINES), 1)),
        coherence=np.full(values.shape, np.nan),
        averages=np.zeros(len(FRF), int),
    )


EXTRA = frf_ipz.BeamPointMass(node=14, mass_kg=0.003)


@pytest.fixture(scope="module")
def fit():
    """The measurement as it should have been written down."""
    return frf_ipz.fit_modes(measure())


@pytest.fixture(scope="module")
def heavier():
    """A machine with a lump of 20 g near its clamp, and what was measured on it."""
    machine = frf_ipz.make_beam(**BEAM, point_mass=[frf_ipz.BeamPointMass(node=6, mass_kg=0.02)])
    values = frf_ipz.compute_frfs(machine, FRF, 2j * np.pi * LINES)
    variance = np.tile(NOISE**2 * np.mean(np.abs(values) ** 2, axis=0), (len(LINES), 1))
    frfs = frf_ipz.FrfSet(
        frequency_hz=LINES,
        values=values,
        labels=FRF,
        variance=variance,
        coherence=np.full(values.shape, np.nan),
        averages=np.zeros(len(FRF), int),
    )
    return machine, frfs, frf_ipz.fit_modes(frfs)


@pytest.mark.slow
@pytest.mark.parametrize("changed", [{}, {"youngs_modulus_Pa": 210e9}])
def test_what_a_diagnosis_found_competes_with_mistakes(heavier, changed):
    """A lump looks like a sensor elsewhere until it is found; a wrong modulus stays one, whatever was found."""
    machine, frfs, fit = heavier
    model = frf_ipz.make_beam(**{**BEAM, **changed})
    files = {"is_recorded": True, "test_file": "test.toml", "model_file": "model.toml"}
    alone = likely_cause(frfs, fit, model, **files)
    assert alone is not None
    explained = machine if not changed else model
    weighed = likely_cause(frfs, fit, model, explained_model=explained, **files)
    assert weighed is None if not changed else weighed == alone


def cause_of(fit, *, labels=None, gain=1.0, frequency_factor=1.0, **model):
    """Look for the cause where labels, gains or the model are not what they should be."""
    measured = measured_modes(fit)
    measured = replace(
        measured,
        labels=labels or measured.labels,
        products=measured.products * gain,
        deviations=measured.deviations * np.abs(gain),
        frequency_hz=measured.frequency_hz * frequency_factor,
        band_hz=tuple(edge * frequency_factor for edge in measured.band_hz),
    )
    beam = frf_ipz.make_beam(**{**BEAM, **model})
    modes = computed_modes(frf_ipz.solve_modes(beam, n_modes=min(24, len(beam.dofs))))
    situation = Situation(measured=measured, computed=modes, model=beam, test_file="test.toml", model_file="model.toml")
    return find_likely_cause(situation)


def relabelled(outputs=None, inputs=None):
    """The labels with sensors and excited points where somebody wrote that they are."""
    outputs, inputs = outputs or {}, inputs or {}
    return tuple(
        frf_ipz.FrfLabel(
            outputs.get(str(label.output_dof), label.output_dof),
            inputs.get(str(label.input_dof), label.input_dof),
            label.quantity,
            label.output_channel,
            label.input_channel,
        )
        for label in FRF
    )


def column_gain(column, gain):
    return np.array([gain if label.output_channel == column else 1.0 for label in FRF])


def test_nothing_is_named_where_nothing_is_wrong(fit):
    assert cause_of(fit) is None


def test_causes_that_all_together_are_less_likely_than_none_are_not_computed(fit, monkeypatch):
    """Their bounds tell, from where they add up to less than what was computed leaves."""
    computed, evidence = [], CostBounds.log_evidence

    def counted(bounds, cause):
        computed.append(cause)
        return evidence(bounds, cause)

    monkeypatch.setattr(CostBounds, "log_evidence", counted)
    assert cause_of(fit) is None
    assert len(computed) < MOST_COMPUTED


@pytest.mark.parametrize("changed", [{"youngs_modulus_Pa": 66e9}, {"thickness_m": 0.0051}, {"length_m": 0.505}])
def test_nothing_is_named_where_the_model_is_nearly_right(fit, changed):
    assert cause_of(fit, **changed) is None


@pytest.mark.parametrize(
    ("gain", "words", "key"),
    [
        (1 / 9.80665, "in g", "unit"),
        (1e3, "thousandths", "unit"),
        (4.4482216152605, "lbf", "'force': unit"),
        (-1.0, "other sign", "dof"),
        (column_gain("acc_1", 1 / 9.80665), "'acc_1' is in g", "'acc_1': unit"),
        (column_gain("acc_2", -1.0), "'acc_2' measures the other way round", "'acc_2': dof"),
    ],
)
def test_a_factor_of_channels_is_named(fit, gain, words, key):
    cause = cause_of(fit, gain=gain)
    assert words in cause.says
    assert cause.file == "test.toml"
    assert key in cause.line_or_key
    assert cause.probability > 0.8  # 1000 is a unit of other things too


@pytest.mark.parametrize(
    ("labels", "words"),
    [
        (relabelled(outputs={"8:+z": "21:+z", "21:+z": "8:+z"}), "sensors at 21:z and 8:z are exchanged"),
        (relabelled(inputs={"11:+z": "19:+z", "19:+z": "11:+z"}), "points 19:z and 11:z are exchanged"),
    ],
)
def test_exchanged_places_are_named(fit, labels, words):
    assert words in cause_of(fit, labels=labels).says


def test_places_are_exchanged_with_their_signs(fit):
    """The sensor at node 21 looks down, and somebody has taken it for the one at node 8."""
    labels = relabelled(outputs={"8:+z": "21:-z", "21:+z": "8:+z"})
    signs = np.array([1.0 if label.output_dof.node == 15 else -1.0 for label in FRF])
    assert "sensors at 21:z and 8:z are exchanged" in cause_of(fit, labels=labels, gain=signs).says


def test_false_modes_of_a_fit_hide_no_mistake(fit):
    """Two of them a mode, a thousand times smaller, as fits leave them in noisy bands."""
    measured = measured_modes(fit)
    false_hz = np.concatenate([measured.frequency_hz * 0.93, measured.frequency_hz * 1.08])
    count = 3 * len(measured.frequency_hz)
    beam = frf_ipz.make_beam(**{**BEAM, "youngs_modulus_Pa": 210e9})
    situation = Situation(
        measured=replace(
            measured,
            frequency_hz=np.concatenate([measured.frequency_hz, false_hz]),
            products=np.concatenate([measured.products, *(2 * [1e-3 * measured.products])]),
            deviations=np.resize(measured.deviations, (count, len(FRF))),
        ),
        computed=computed_modes(frf_ipz.solve_modes(beam, n_modes=20)),
        model=beam,
        test_file="test.toml",
        model_file="model.toml",
    )
    assert "youngs_modulus_Pa" in find_likely_cause(situation).line_or_key


def read_as_the_force(frfs, column):
    """FRFs where a response and the force are exchanged: its own is inverted, the others are transmissibilities."""
    own = {label.input_dof: place for place, label in enumerate(FRF) if label.output_channel == column}
    inverse = [own[label.input_dof] for label in FRF]
    is_own = np.array([label.output_channel == column for label in FRF])
    values = np.where(is_own, 1.0, frfs.values) / frfs.values[:, inverse]
    relative = frfs.variance / np.abs(frfs.values) ** 2
    return replace(frfs, values=values, variance=np.abs(values) ** 2 * (relative[:, inverse] + ~is_own * relative))


@pytest.mark.parametrize("column", ["acc_0", None])
def test_a_response_that_was_read_as_the_force_is_named(fit, column):
    frfs = measure() if column is None else read_as_the_force(measure(), column)
    wrong = frf_ipz.fit_modes(frfs, options=frf_ipz.FitOptions(band_hz=fit.band_hz))
    beam = frf_ipz.make_beam(**BEAM)
    files = {"test_file": "test.toml", "model_file": "model.toml"}
    cause = likely_cause(frfs, wrong, beam, is_recorded=True, **files)
    if column is None:
        assert cause is None
    else:
        assert cause.line_or_key == "[[channel]] column = 'force' and column = 'acc_0'"
    assert likely_cause(frfs, wrong, beam, is_recorded=False, **files) is None  # it has no columns


def test_a_sensor_at_another_node_is_found_to_a_node(fit):
    cause = cause_of(fit, labels=relabelled(outputs={"15:+z": "4:+z"}))
    assert "'acc_1'" in cause.line_or_key
    assert any(f"near {node}:z, not at 4:z" in cause.says for node in (14, 15, 16))


@pytest.mark.parametrize(
    ("changed", "key"),
    [
        ({"youngs_modulus_Pa": 70.0}, "youngs_modulus_Pa"),
        ({"youngs_modulus_Pa": 210e9}, "youngs_modulus_Pa"),
        ({"youngs_modulus_Pa": 7e9}, "youngs_modulus_Pa"),
        ({"density_kg_m3": 2.7}, "density_kg_m3"),
        ({"thickness_m": 5.0}, "thickness_m"),
    ],
)
def test_a_wrong_number_of_the_model_is_named(fit, changed, key):
    cause = cause_of(fit, **changed)
    assert cause.file == "model.toml"
    assert key in cause.line_or_key


@pytest.mark.parametrize("changed", [{"density_kg_m3": 2.7}, {"youngs_modulus_Pa": 70.0}])
def test_a_wrong_unit_is_named_where_a_point_mass_stays_as_it_is(changed):
    """The frequencies are not off by one factor then."""
    heavy = [frf_ipz.BeamPointMass(node=6, mass_kg=0.05)]
    machine = frf_ipz.fit_modes(measure(point_mass=heavy))
    cause = cause_of(machine, **changed, point_mass=heavy)
    assert next(iter(changed)) in cause.line_or_key
    assert ("common factor" in cause.says) == ("youngs_modulus_Pa" in changed)


def test_what_a_nearly_right_model_is_off_is_no_cause_beside_modes_that_it_lacks(fit):
    """A suspension adds modes below the first; the update corrects a stiffness that is some percent off."""
    beam = frf_ipz.make_beam(**BEAM)
    computed = computed_modes(frf_ipz.solve_modes(beam, n_modes=24))
    count = 18
    products = computed.products(FRF, {}, {})[:count]
    hung_hz = np.array([4.0, 6.3, 7.0])
    measured = replace(
        measured_modes(fit),
        frequency_hz=np.concatenate([hung_hz, 1.028 * computed.frequency_hz[:count]]),
        products=np.concatenate([products[:3], products]).astype(complex),
        deviations=1e-6 * np.abs(np.concatenate([products[:3], products])),
        band_hz=(1.0, float(1.1 * computed.frequency_hz[count - 1])),
    )
    files = {"test_file": "test.toml", "model_file": "model.toml"}
    assert find_likely_cause(Situation(measured=measured, computed=computed, model=beam, **files)) is None
    stiffer = replace(computed, frequency_hz=computed.frequency_hz / 1.2)
    cause = find_likely_cause(Situation(measured=measured, computed=stiffer, model=beam, **files))
    assert "youngs_modulus_Pa" in cause.line_or_key


def test_a_mode_just_inside_the_band_may_have_been_measured_just_outside(fit):
    """An edge of the band that passes a computed mode costs what its frequency is off, and not all that it shows."""
    computed = computed_modes(frf_ipz.solve_modes(frf_ipz.make_beam(**BEAM), n_modes=24))
    edge_hz = computed.frequency_hz[len(measured_modes(fit).frequency_hz)]
    products = computed.products(FRF, {}, {}).astype(complex)
    below, above, far_above = (
        log_likelihood(replace(measured_modes(fit), band_hz=(5.0, top * edge_hz)), computed.frequency_hz, products)
        for top in (0.999, 1.001, 1.3)
    )
    assert 0 <= below - above < 0.01
    assert below - far_above > 4


@pytest.mark.parametrize(
    ("system", "factor"), [("mm-t-s", 1e3), ("cm-g-s", 1e-3), ("in-lbf-s", 4.4482216152605 / 0.0254)]
)  # stiffness of translations in N/m, mass in kg
def test_the_system_of_units_of_matrices_is_named_and_each_file(fit, system, factor):
    """Responses in a unit as much too small would look the same: both files are named with their keys."""
    beam = frf_ipz.make_beam(**BEAM)
    model = frf_ipz.StructuralModel.from_matrices(
        beam.mass / factor, beam.stiffness / factor, dofs=beam.dofs, modal_damping=BEAM["modal_ratio"]
    )
    files = {"test_file": "test.toml", "model_file": "model.toml"}
    cause = likely_cause(measure(), fit, model, is_recorded=False, **files)
    assert f'the matrices seem to be written in {system}: set units = "{system}" under [model]' in cause.says
    places = f"{cause.file}, {cause.line_or_key}".split("; or ")
    number = places.index("model.toml, [model] units")
    assert all(place.startswith("test.toml, ") for place in places[number + 1 : number + 2])


def test_the_time_in_ms_is_named(fit):
    cause = cause_of(fit, frequency_factor=1e-3)
    assert "time is in ms" in cause.says


@pytest.mark.parametrize("is_recorded", [True, False])
def test_the_key_is_one_of_the_kind_of_test(fit, is_recorded):
    """A test of estimated FRFs has no channels in its file."""
    reversed_fit = replace(fit, model=replace(fit.model, residues=fit.model.residues * column_gain("acc_2", -1.0)))
    files = {"test_file": "test.toml", "model_file": "model.toml"}
    cause = likely_cause(measure(), reversed_fit, frf_ipz.make_beam(**BEAM), is_recorded=is_recorded, **files)
    assert cause.line_or_key.startswith(
        "[[channel]] column = 'acc_2': dof" if is_recorded else "[[frf]] of acc_2: output"
    )


def test_a_gain_that_no_unit_explains_is_no_cause(fit):
    assert cause_of(fit, gain=1.13) is None


def test_a_wrong_end_is_named():
    pinned = frf_ipz.fit_modes(measure(left="free"))
    assert "[beam] left" in cause_of(pinned).line_or_key


def test_a_beam_held_at_the_wrong_end_is_named_where_a_point_mass_stays_at_its_node():
    """Points that are counted from the other end would count the mass so too."""
    heavy, ends = [frf_ipz.BeamPointMass(node=6, mass_kg=0.05)], {"left": "sliding", "right": "free"}
    fit = frf_ipz.fit_modes(measure(**ends, point_mass=heavy))
    cause = cause_of(fit, left="free", right="sliding", point_mass=heavy)
    assert "exchange left and right" in cause.says


@pytest.mark.parametrize("length_m", [BEAM["length_m"], 1.05 * BEAM["length_m"]])
def test_what_a_moved_sensor_is_worth_at_most_is_never_less_than_what_it_is_worth(fit, length_m):
    beam = frf_ipz.make_beam(**{**BEAM, "length_m": length_m})
    modes = computed_modes(frf_ipz.solve_modes(beam, n_modes=24))
    situation = Situation(
        measured=measured_modes(fit), computed=modes, model=beam, test_file="test.toml", model_file="model.toml"
    )
    bounds = bound_costs(situation)
    for causes in (places.misplaced_sensor(situation), places.exchanged_sensors(situation)):
        largest = bounds.largest_logs(causes)
        exact = np.array([log_evidence(causes[number], situation) for number in range(len(causes))])
        assert np.isfinite(largest).all()
        assert np.all(largest >= exact - 1e-9 * np.abs(exact))


def test_what_another_mistake_is_worth_at_most_is_never_less_than_what_it_is_worth(fit):
    beam = frf_ipz.make_beam(**{**BEAM, "length_m": 1.05 * BEAM["length_m"]})
    modes = computed_modes(frf_ipz.solve_modes(beam, n_modes=24))
    situation = Situation(
        measured=measured_modes(fit), computed=modes, model=beam, test_file="test.toml", model_file="model.toml"
    )
    for kind in KINDS:
        causes = list(kind(situation))
        exact = np.array([log_evidence(cause, situation) for cause in causes])
        assert np.all(bound_costs(situation).largest_logs(causes) >= exact - 1e-9 * np.abs(exact))


@pytest.mark.parametrize("length_m", [BEAM["length_m"], 1.05 * BEAM["length_m"]])
def test_what_a_mistake_is_worth_follows_from_the_costs_of_the_model_as_it_stands(fit, length_m):
    """What a mistake does not change is not computed again, so each costs the same however many sensors there are."""
    beam = frf_ipz.make_beam(**{**BEAM, "length_m": length_m})
    modes = computed_modes(frf_ipz.solve_modes(beam, n_modes=24))
    situation = Situation(
        measured=measured_modes(fit), computed=modes, model=beam, test_file="test.toml", model_file="model.toml"
    )
    bounds = bound_costs(situation)
    for kind in KINDS:
        found = kind(situation)
        causes = [found[number] for number in range(len(found))] if hasattr(found, "__getitem__") else list(found)
        exact = [log_evidence(cause, situation) for cause in causes]
        assert [bounds.log_evidence(cause) for cause in causes] == pytest.approx(exact, rel=1e-10)
