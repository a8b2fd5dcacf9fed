"""A controller designed on the predicted point of interest does on the real beam what its model promised."""

from dataclasses import replace
from pathlib import Path
from runpy import run_path

import control
import numpy as np
import pytest
from make_cantilever import build_receptance

import frf_ipz

pytestmark = pytest.mark.slow  # the pipeline, and three designs of some fifty Riccati equations each
SCRIPT = Path(__file__).parents[2] / "pipelines" / "poi_controller.py"
BAND_HZ = 10.0, 700.0  # where the model was updated, and where vibration counts


@pytest.fixture(scope="module")
def script():
    return run_path(str(SCRIPT))


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    return frf_ipz.run_pipeline(SCRIPT.with_suffix(".toml"), tmp_path_factory.mktemp("run"))


@pytest.fixture(scope="module")
def designs(script, results):
    """Model and members of three designs: on the updated model, on the nominal one, and for the sensor itself."""
    updated = results.updated_model
    members = plants(script, results, updated, script["POINT"])
    return {
        "updated": members,
        "nominal": plants(script, results, replace(updated, model=updated.nominal), script["POINT"])[:1],
        "sensor only": [plants(script, results, updated, script["SENSOR"])[0], *members[1:]],
    }


def plants(script, results, updated, quiet):
    systems = []
    for kind in ("measured", "velocity"):
        ends = {"measured": results.fit, "updated_model": updated, "points": [script["POINT"]]}
        options = frf_ipz.ExportOptions(outputs=kind, ensemble=40)
        ensemble = frf_ipz.to_state_space_ensemble(**ends, options=options)
        systems.append([frf_ipz.to_state_space(**ends, options=options), *ensemble])
    return [script["make_plant"](*pair, quiet) for pair in zip(*systems, strict=True)]


@pytest.fixture(scope="module")
def beam(script):
    """The beam of the simulated campaign, all its modes up to 50 kHz."""
    model, rows = build_receptance()
    omega, shapes = model.omega_rad_s, model.shapes
    still = np.zeros_like(omega)
    A = np.block([[np.diag(still), np.diag(omega)], [-np.diag(omega), -np.diag(2 * model.damping_ratio * omega)]])
    forces = [shapes[rows[node]] for node in (89, 69)]
    B = np.array([np.append(still, force) for force in forces]).T
    inputs = [script["ACTUATOR"], script["DISTURBANCE"]]
    acceleration = np.append(still, shapes[0])[None] @ A, [[shapes[0] @ force for force in forces]]
    velocity = np.append(still, shapes[1])[None], [[0.0, 0.0]]
    return script["make_plant"](
        control.ss(A, B, *acceleration, inputs=inputs, outputs=[script["SENSOR"]]),
        control.ss(A, B, *velocity, inputs=inputs, outputs=[script["POINT"]]),
    )


@pytest.fixture(scope="module")
def outcomes(script, designs, beam):
    """What each controller promises on its own model, and what it does on the beam."""
    rows = {}
    for name, models in designs.items():
        controller = script["design_strongest"](models)
        loop = beam[0, 0](1j * script["OMEGA"]) * controller(1j * script["OMEGA"])
        rows[name] = {
            "promised": remaining_vibration(models[0], controller),
            "real": remaining_vibration(beam, controller),
            "sensitivity": np.abs(1 / (1 - loop)).max(),
        }
    return rows


def remaining_vibration(plant, controller):
    """RMS of the velocity in the band for a white disturbance, over that without control; infinite if unstable."""
    closed = plant.feedback(control.append(controller, control.ss([], [], [], [[0]])), 1)
    if closed.poles().real.max() >= 0:
        return np.inf
    omega = 2 * np.pi * np.linspace(*BAND_HZ, 5000)
    squares = [np.abs(system[1, 1](1j * omega)) ** 2 for system in (closed, plant)]
    return np.sqrt(np.trapezoid(squares[0], omega) / np.trapezoid(squares[1], omega))


def test_the_updated_model_promises_what_the_beam_does(outcomes, script):
    outcome = outcomes["updated"]
    assert outcome["real"] < 0.3
    assert abs(outcome["real"] / outcome["promised"] - 1) < 0.1
    assert outcome["sensitivity"] < 1.1 * script["MAX_SENSITIVITY"]


def test_the_nominal_model_promises_too_much(outcomes):
    assert outcomes["updated"]["real"] < outcomes["nominal"]["real"]
    assert outcomes["nominal"]["real"] > 2 * outcomes["nominal"]["promised"]


def test_to_quieten_the_sensor_quietens_the_point_less(outcomes):
    assert outcomes["updated"]["real"] < 0.9 * outcomes["sensor only"]["real"]


def test_the_exported_state_space_is_the_plant_of_the_design(script, results, designs):
    plant = script["make_plant"](
        results.state_space,
        frf_ipz.to_state_space(
            results.fit,
            results.updated_model,
            points=[script["POINT"]],
            options=frf_ipz.ExportOptions(outputs="velocity"),
        ),
    )
    lines = 1j * script["OMEGA"][::100]
    np.testing.assert_allclose(plant(lines), designs["updated"][0](lines), rtol=1e-9)


def test_the_script_prints_margins_and_saves_a_picture(tmp_path, capsys, script):
    script["main"](tmp_path)
    margins = capsys.readouterr().out.splitlines()[-1].split()
    assert float(margins[2].rstrip(",")) > script["MAX_SENSITIVITY"]
    assert float(margins[5]) > 29
    assert (tmp_path / "poi_controller.png").stat().st_size > 10_000
