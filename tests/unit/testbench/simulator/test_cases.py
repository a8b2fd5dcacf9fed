"""Whole cases: what is written is complete, deterministic, and does what the contract defines."""

import ast
import json
import tomllib
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from scipy.io import mmread
from typer.testing import CliRunner

import frf_testbench.simulator
from frf_testbench.cli import app
from frf_testbench.simulator.cases.case import make_case
from frf_testbench.simulator.cases.detectability import predict_frf_noise
from frf_testbench.simulator.cases.frf_distance import make_distance
from frf_testbench.simulator.cases.system import build_system
from frf_testbench.simulator.effects.catalogue import CATALOGUE, NONLINEAR, OUT_OF_CATALOGUE, select_effects
from frf_testbench.simulator.self_check import check_nominal, check_step
from frf_testbench.simulator.specimens import KINDS

ROOT = Path(frf_testbench.simulator.__file__).parent
ALGEBRA = 1e-9  # two ways to the same receptance, in double precision
SIMULATION = (
    5e-6  # FRFs estimated from noise-free records against the truth: what is cut off is exp(-12) = 6e-6 of a decay
)
CHANGED = 1e-3  # an effect that changes less than this would be no effect
STRUCTURES = {"cubic_stiffness": "frame", "gap_contact": "frame", "dry_friction": "frame"}
TABLE = {  # of the contract: what a location and the parameters of each effect may hold
    "boundary_compliance": ({"end", "nodes"}, {"rotational_stiffness_Nm_rad", "translational_stiffness_N_m"}),
    "added_mass": ({"nodes"}, {"mass_kg"}),
    "local_stiffness": ({"elements", "springs", "groups"}, {"stiffness_ratio"}),
    "global_stiffness": (set(), {"stiffness_ratio"}),
    "grounded_spring": ({"nodes"}, {"stiffness_N_m"}),
    "coupling_spring": ({"nodes"}, {"stiffness_N_m"}),
    "attached_resonator": ({"nodes"}, {"mass_kg", "frequency_hz", "damping_ratio"}),
    "axial_load": (set(), {"force_N"}),
    "shear_rotary_inertia": (set(), set()),
    "damping_level": (set(), {"modal_ratio"}),
    "local_damper": ({"nodes"}, {"damping_Ns_m"}),
    "structural_damping": (set(), {"loss_factor"}),
    "viscoelastic_joint": (
        {"nodes", "end", "springs"},
        {"stiffness_N_m", "rotational_stiffness_Nm_rad", "relaxation_time_s"},
    ),
    "time_delay": ({"channels"}, {"delay_s"}),
    "sensor_dynamics": ({"channels"}, {"kind", "corner_hz"}),
    "sensor_gain": ({"channels"}, {"gain_ratio"}),
    "sensor_misplaced": ({"channels", "nodes"}, set()),
    "cubic_stiffness": ({"nodes", "springs"}, {"cubic_N_m3"}),
    "gap_contact": ({"nodes", "springs"}, {"gap_m", "contact_stiffness_N_m"}),
    "dry_friction": ({"nodes", "springs"}, {"friction_N"}),
}
LINEAR = [name for name in CATALOGUE if name not in NONLINEAR]
# One of each kind: mass, stiffness, support, damping, added DOFs, a pole of a joint, and a channel.
QUICK = (
    *("added_mass", "local_stiffness", "boundary_compliance", "local_damper", "attached_resonator"),
    *("viscoelastic_joint", "sensor_dynamics"),
)
QUICKLY_DRAWN = 15  # the seed of a small frame on which each law shows at once: others take minutes to draw
RUNS_AWAY = 103000050  # the seed of a stiff stop


def test_the_simulator_shares_no_code_with_the_package():
    imported = {
        name.split(".")[0]
        for path in ROOT.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        for name in (
            [alias.name for alias in node.names]
            if isinstance(node, ast.Import)
            else [node.module or ""]
            if isinstance(node, ast.ImportFrom)
            else []
        )
    }
    assert "frf_ipz" not in imported
    assert imported <= {"__future__", "collections", "dataclasses", "functools", "itertools", "json",
                        "numpy", "pathlib", "scipy", "frf_testbench", "tomllib", "typing"}  # fmt: skip


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "plate"])
def test_truth_without_scatter_is_the_nominal_model(kind):
    check = check_nominal(kind, 1)
    assert check.frequency < 1e-3  # the tolerance of a nominal model
    assert check.median < 2e-3  # of the FRFs
    assert check.exact < SIMULATION


@pytest.mark.slow
def test_a_plate_without_scatter_is_the_nominal_model():
    check = check_nominal("plate", 1)
    assert check.frequency < 1e-4
    assert check.median < 2e-3
    assert check.exact < SIMULATION


@cache
def concealed(effect):
    seed = QUICKLY_DRAWN if effect in NONLINEAR else 31
    return make_case(seed, effect, structure=STRUCTURES.get(effect, "clamped-pinned"), analyse=False)


@pytest.mark.parametrize(
    "effect", [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in LINEAR]
)
def test_each_linear_effect_changes_what_is_measured(effect):
    case = concealed(effect)
    truth = case.truth
    assert truth["effect"] == effect
    assert truth["detectability"]["frf_change"] > CHANGED
    assert truth["detectability"]["ratio_rms"] >= 3
    lines = case.system.set_up.lines_hz
    with_effect, without = case.system.measured_frf(lines), case.base_system.measured_frf(lines)
    assert np.linalg.norm(with_effect - without) / np.linalg.norm(without) > CHANGED


def test_signs_of_sensors_and_impacts_turn_the_frf_round():
    system = make_case(31, "null", structure="clamped-pinned", analyse=False).base_system
    set_up = system.set_up
    turned = replace(
        set_up,
        sensors=tuple(replace(sensor, sign=-sensor.sign) for sensor in set_up.sensors),
        excited_points=((set_up.excited_points[0][0], -set_up.excited_points[0][1]), *set_up.excited_points[1:]),
    )
    other = build_system(system.specimen, turned, system.scatter, ())
    lines = set_up.lines_hz
    expected = -system.measured_frf(lines)
    expected[:, :, 0] *= -1
    assert_allclose(other.measured_frf(lines), expected, rtol=ALGEBRA)


@pytest.mark.slow
def test_locations_and_parameters_are_those_of_the_contract():
    for effect, (places, names) in TABLE.items():
        truth = concealed(effect).truth
        assert set(truth["location"]) <= places, effect
        assert set(truth["parameters"]) <= names, effect
        assert bool(truth["location"]) == bool(places), effect
        assert bool(truth["parameters"]) == bool(names), effect


def test_a_resonator_is_two_masses_and_a_spring():
    case = make_case(4, "attached_resonator", structure="frame")
    system = case.system
    node, values = case.truth["location"]["nodes"][0], case.truth["parameters"]
    n = len(system.structure.mass)
    omega = 2 * np.pi * values["frequency_hz"]
    link = np.zeros(n + 1)
    link[node - 1], link[n] = -1, 1
    M = np.zeros((n + 1, n + 1))
    M[:n, :n] = system.structure.mass
    M[n, n] = values["mass_kg"]
    # modal damping and scattered frequencies of the frame, as matrices
    omegas = system.receptance.omega_rad_s
    inverse = system.structure.mass @ system.modes.shapes
    K, C = np.zeros((n + 1, n + 1)), np.zeros((n + 1, n + 1))
    K[:n, :n] = inverse @ np.diag(omegas**2) @ inverse.T
    C[:n, :n] = inverse @ np.diag(2 * system.receptance.damping_ratio * omegas) @ inverse.T
    K += values["mass_kg"] * omega**2 * np.outer(link, link)
    C += values["mass_kg"] * 2 * values["damping_ratio"] * omega * np.outer(link, link)
    s = 2j * np.pi * np.linspace(*system.set_up.band_hz, 50)
    direct = np.array([np.linalg.inv(one**2 * M + one * C + K)[:n, :n] for one in s])
    rows = [sensor.node - 1 for sensor in system.set_up.sensors]
    columns = [struck - 1 for struck, _ in system.set_up.excited_points]
    got = system.receptance(s, system.sensor_rows, system.excited_rows)
    assert_allclose(got, direct[:, rows][:, :, columns], rtol=1e-7)  # the inverse of the direct matrix


def test_channels_are_late_filtered_and_scaled_as_defined():
    for effect, factor in (
        ("time_delay", lambda p, s: np.exp(-s * p["delay_s"])),
        ("sensor_gain", lambda p, s: np.full(s.shape, p["gain_ratio"])),
        (
            "sensor_dynamics",
            lambda p, s: (
                (s if p["kind"] == "highpass" else 2 * np.pi * p["corner_hz"]) / (s + 2 * np.pi * p["corner_hz"])
            ),
        ),
    ):
        case = make_case(12, effect, structure="frame")
        lines = case.system.set_up.lines_hz
        ratio = case.system.measured_frf(lines) / case.base_system.measured_frf(lines)
        channel = case.truth["location"]["channels"][0]
        expected = factor(case.truth["parameters"], 2j * np.pi * lines)
        columns = [sensor.column for sensor in case.system.set_up.sensors]
        if channel == "force":
            assert_allclose(ratio, np.broadcast_to((1 / expected)[:, None, None], ratio.shape), rtol=ALGEBRA)
            continue
        for i, column in enumerate(columns):
            want = expected if column == channel else np.ones_like(expected)
            assert_allclose(ratio[:, i], np.broadcast_to(want[:, None], ratio[:, i].shape), rtol=ALGEBRA)


def test_a_moved_sensor_sees_what_its_new_node_does():
    case = make_case(3, "sensor_misplaced", structure="frame")
    set_up = case.system.set_up
    channel, node = case.truth["location"]["channels"][0], case.truth["location"]["nodes"][0]
    i = [sensor.column for sensor in set_up.sensors].index(channel)
    there = replace(set_up, sensors=tuple(replace(s, node=node) if s.column == channel else s for s in set_up.sensors))
    moved = build_system(case.system.specimen, there, case.system.scatter, ())
    lines = set_up.lines_hz
    assert_allclose(case.system.measured_frf(lines), moved.measured_frf(lines), rtol=ALGEBRA)
    assert set_up.sensors[i].node != node


def test_scatter_stays_within_the_tolerances_of_the_contract():
    for seed, kind in enumerate(("cantilever", "free-free", "frame", "grid")):
        case = make_case(seed, "null", structure=kind, analyse=False)
        low, high = case.system.set_up.band_hz
        ideal, real = case.ideal_system.modes.frequencies_hz, case.base_system.modes.frequencies_hz
        inside = (ideal >= low) & (ideal <= high)
        assert (
            1e-6 < np.abs(real[inside] / ideal[inside] - 1).max() < 1.2e-3
        )  # three sources of up to 0.05, 0.02, 0.04 %
        ratios = np.array(case.truth["test"]["true_damping"]) / case.system.set_up.damping_ratio
        assert ratios.min() > 0.69
        assert ratios.max() < 1.31
        assert all(abs(gain - 1) <= 0.005 for gain in case.system.scatter.gains.values())


def test_the_same_seed_gives_the_same_case():
    first, second = (make_case(5, "local_damper", analyse=False) for _ in range(2))
    assert first.truth == second.truth
    np.testing.assert_array_equal(first.stored, second.stored)
    assert make_case(6, "local_damper", analyse=False).truth["structure"] != first.truth["structure"]


def test_a_case_knows_its_evidence_and_what_imitates_it():
    cases = (make_case(seed, "local_damper", structure="frame") for seed in range(20))
    case = next(c for c in cases if any(one["effect"] == "viscoelastic_joint" for one in c.truth["equivalents"]))
    joint = next(one for one in case.truth["equivalents"] if one["effect"] == "viscoelastic_joint")
    damping = joint["parameters"]["stiffness_N_m"] * joint["parameters"]["relaxation_time_s"]
    assert_allclose(damping, case.truth["parameters"]["damping_Ns_m"], rtol=0.05)  # far above the band it is a damper
    found = case.truth["detectability"]
    assert found["evidence_nats"] > found["place_separation_nats"] > 3


def test_one_sensor_cannot_tell_its_gain_from_that_of_the_force():
    case = next(
        c
        for c in (make_case(seed, "sensor_gain", structure="frame") for seed in range(90, 130))
        if len(c.system.set_up.sensors) == 1
    )
    twin = case.truth["equivalents"][0]
    assert twin["effect"] == "sensor_gain"
    assert twin["location"] != case.truth["location"]
    assert_allclose(
        twin["parameters"]["gain_ratio"] * case.truth["parameters"]["gain_ratio"], 1.0, rtol=0.02
    )  # priors pull


def test_what_nobody_knows_costs_its_prior_and_no_more():
    case = make_case(33, "null", structure="stepped", analyse=False)
    system = case.base_system
    distance = make_distance(system, predict_frf_noise(system, case.excitations, case.noise))
    model = system.receptance
    faster, damped = model.omega_rad_s.copy(), model.damping_ratio.copy()
    faster[0] *= 1 + 2e-5
    damped[1] *= 1 + 0.01
    others = [
        replace(system, receptance=replace(model, omega_rad_s=faster)),
        replace(system, receptance=replace(model, damping_ratio=damped)),
        replace(
            system,
            scatter=replace(
                system.scatter, gains={**system.scatter.gains, "force": system.scatter.gains["force"] * 1.001}
            ),
        ),
    ]
    for other in others:
        frf = other.measured_frf(distance.frequencies_hz)
        assert 0 < distance.measure(frf) < 1
        assert 0.5 * distance.scale * np.sum(distance.whiten(frf) ** 2) > 30 * distance.measure(frf)
    assert distance.measure(distance.truth) == 0


def test_a_frequency_that_moves_far_for_a_resonance_but_within_its_tolerance_costs_its_prior():
    """By a part of a resonance's width: to the first order that would be ten times as much."""
    case = make_case(33, "null", structure="stepped", analyse=False)
    ringing = replace(case.base_system.receptance, damping_ratio=0.2 * case.base_system.receptance.damping_ratio)
    system = replace(case.base_system, receptance=ringing)
    distance = make_distance(system, predict_frf_noise(system, case.excitations, case.noise))
    faster = system.receptance.omega_rad_s.copy()
    faster[0] *= 1 + 1e-3  # two standard deviations
    frf = replace(system, receptance=replace(system.receptance, omega_rad_s=faster)).measured_frf(
        distance.frequencies_hz
    )
    assert 0.5 < distance.measure(frf) < 2.1
    assert 0.5 * distance.scale * np.sum(distance.misfit(frf) ** 2) > 5 * distance.measure(frf)


def test_two_effects_are_both_there():
    case = make_case(8, "pair:added_mass+time_delay")
    assert [effect["effect"] for effect in case.truth["effects"]] == ["added_mass", "time_delay"]
    assert all(one["ratio_rms"] >= 3 for one in case.truth["detectability"]["each"])


@pytest.mark.slow
def test_a_law_shows_in_impacts_of_different_levels():
    case = concealed("cubic_stiffness")
    assert case.truth["nonlinear"]
    assert case.truth["detectability"]["level_change"] > 0.01
    assert {"cubic_N_m3"} == set(case.truth["parameters"])


def test_the_catalogue_is_that_of_the_contract():
    assert set(TABLE) == set(CATALOGUE)
    assert len(OUT_OF_CATALOGUE) >= 10


def test_unknown_names_are_refused():
    with pytest.raises(ValueError, match="no effect 'ghost'"):
        select_effects(np.random.default_rng(0), "ghost", KINDS)


def test_what_is_written_is_what_a_user_hands_in(tmp_path):
    options = ["--seed", "3", "--effect", "grounded_spring", "--structure", "grid", "--out", str(tmp_path / "c")]
    outcome = CliRunner().invoke(app, ["simulate", *options])
    assert outcome.exit_code == 0
    assert "records; answers in" in outcome.output
    folder = tmp_path / "c"
    test, model, run = (tomllib.loads((folder / f"{n}.toml").read_text()) for n in ("test", "model", "pipeline"))
    truth = json.loads((tmp_path / "truth" / "c.json").read_text())
    assert model["model"]["kind"] == "matrices"
    K, M = (mmread(folder / model["matrices"][name]).toarray() for name in ("stiffness", "mass"))
    groups = [mmread(folder / group["stiffness"]).toarray() for group in model["matrices"]["group"]]
    assert_allclose(sum(groups), K, rtol=0, atol=1e-12 * np.abs(K).max())
    dofs = pd.read_csv(folder / "dofs.csv")
    assert len(dofs) == len(K) == len(M) == truth["structure"]["dofs"]
    columns = [channel["column"] for channel in test["channel"]]
    key = "hit" if test["test"]["kind"] == "hammer" else "record"
    nodes = set(dofs["node"])
    for hit in test[key]:
        assert int(hit["dof"].split(":")[0]) in nodes
        for path in (path for pattern in hit["files"] for path in folder.glob(pattern)):
            table = pd.read_csv(path)
            assert list(table.columns) == ["time", *columns]
            assert table.to_numpy().shape == (truth["test"]["samples"], 1 + len(columns))
            assert_allclose(np.diff(table["time"]), 1 / truth["test"]["rate_hz"], rtol=1e-3)  # nine digits of time
    points = pd.read_csv(tmp_path / "truth" / "c_points.csv") if run["predict"]["points"] else None
    assert points is None or set(points["output_dof"]) == set(run["predict"]["points"])
    assert not [path for path in folder.rglob("*") if "truth" in path.name or "points" in path.name]


@pytest.mark.slow
@pytest.mark.parametrize("kind", OUT_OF_CATALOGUE)
def test_each_effect_outside_the_contract_can_be_drawn(kind):
    on_beams_only = kind == "rotary_inertia"
    drawn = (17, None) if on_beams_only else (QUICKLY_DRAWN, "frame")
    case = make_case(drawn[0], f"unknown:{kind}", structure=drawn[1])
    assert case.truth["unknown_kind"] == kind
    assert case.truth["detectability"]["frf_change"] > CHANGED


@pytest.mark.slow
@pytest.mark.parametrize("effect", ["cubic_stiffness", "gap_contact", "dry_friction"])
def test_halving_the_step_changes_responses_little(effect):
    _, in_band = check_step(effect, QUICKLY_DRAWN, structure="frame")
    assert in_band < 5e-3  # a quarter of what the truth allows for a doubled step


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_many_truths_without_scatter_are_their_nominal_models(kind):
    for seed in range(2, 5):
        check = check_nominal(kind, seed)
        assert check.frequency < 1e-3
        assert check.median < 4e-3
        assert check.exact < SIMULATION


@pytest.mark.slow
def test_a_law_that_runs_away_at_twice_the_step_is_drawn_again():
    assert make_case(RUNS_AWAY, "gap_contact", analyse=False).truth["attempt"] > 0


def test_no_sensor_sits_where_the_forces_move_nothing() -> None:
    case = make_case(940009, analyse=False)  # the first test drawn has both sensors on the still rail of a grid
    frequencies_hz = np.linspace(*case.system.set_up.band_hz, 200)
    largest = np.abs(case.base_system.measured_frf(frequencies_hz)).max(axis=(0, 2))
    assert case.truth["attempt"] > 0
    assert largest.min() > 1e-5 * largest.max()
