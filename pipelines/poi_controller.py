"""Quieten a point that has no sensor: design on the predicted model of the demo, judge on the real beam.

python pipelines/poi_controller.py [DIR]

A force at node 89 and the accelerometer at the tip (node 101) are all that a controller has; a disturbance acts at node
69, and the velocity of node 49 is to be small. An LQG controller is designed on three models: the updated one, the
nominal one, and the updated one without a point of interest, where the tip itself is made quiet. Each is made as strong
as its own model allows: the largest sensitivity at most MAX_SENSITIVITY, for the updated model in every member of its
ensemble too. What counts is what each does on the beam that was simulated for the demo, which no design has seen.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import control
import numpy as np
import pandas as pd
from scipy.linalg import block_diag, solve_continuous_are

import frf_ipz
from frf_ipz.export.state_space import make_state_space, make_state_space_ensemble
from frf_ipz.updating.parameters import make_structural_basis
from frf_ipz.updating.updated_model import UpdatedModel

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent / "data")]
from make_cantilever import receptance  # noqa: E402  the folder of the data is found two lines above

SENSOR, POINT, ACTUATOR, DISTURBANCE = "101:+z", "49:+z", "89:+z", "69:+z"
FILTER_HZ = 700.0  # low-pass of the actuator's command, of second order: the models end there
MEASUREMENT_NOISE = 1e-2  # (m/s^2)^2 s, for a disturbance of 1 N^2 s
COMMAND_NOISE = 1.0  # N^2 s on the command, as on the disturbance: the observer gives way, and the loop is robust
MAX_SENSITIVITY = 2.0  # 6 dB: gain margin 2, phase margin 29 degrees
EFFORTS = np.logspace(3, -7, 81)  # weight of the command against the velocity, (m/s)^2 / N^2
OMEGA = 2 * np.pi * np.unique(np.concatenate([np.geomspace(2, 5000, 4000), np.linspace(10, 700, 2800)]))
BAND_HZ = 10.0, 700.0  # where the model was updated, and where vibration counts
ENSEMBLE = 40


class Plant(NamedTuple):
    """Command and disturbance in; acceleration of the sensor and velocity of a point out; the filter is inside."""

    A: np.ndarray
    command: np.ndarray
    disturbance: np.ndarray
    sensor: np.ndarray
    sensor_direct: float  # of the disturbance
    velocity: np.ndarray


def main(out: Path) -> None:
    run = frf_ipz.run_pipeline(HERE / "poi_controller.toml", out, until="pair")
    fit, updated = run.fit, update(run)
    real, members = true_plant(), plants_of_ensemble(updated, fit)
    nominal = replace(updated, model=updated.nominal)
    designs = {
        "updated model": (plant_of(updated, fit, POINT), members),
        "nominal model": (plant_of(nominal, fit, POINT), []),
        "sensor only": (plant_of(updated, fit, SENSOR), members),
    }
    rows = {name: judge(strongest(*design), design[0], real) for name, design in designs.items()}
    print(pd.DataFrame(rows).T.to_string(float_format="{:.3g}".format))


def update(run: frf_ipz.Results) -> UpdatedModel:
    """Update with parts, masses and the sensor's own mass: the demo's accelerometer is not in its model."""
    fit, reduced, pairs = run.fit, run.reduced_model, run.pairs
    full = frf_ipz.read_model(HERE.parent / "data" / "raw" / "cantilever" / "model.toml")
    basis = make_structural_basis(full, reduced, mass=True, sensors=[frf_ipz.parse_dof(SENSOR)])
    return frf_ipz.update_model(fit, reduced, pairs=pairs, basis=basis)


def plant_of(updated: UpdatedModel, fit: frf_ipz.ModalFit, quiet: str) -> Plant:
    """Take the plant out of two exports of one model: sensors as they measure, and velocities."""
    points = (frf_ipz.parse_dof(POINT),)
    measured = make_state_space(fit, updated, points=points)
    velocities = make_state_space(fit, updated, points=points, options=frf_ipz.ExportOptions(outputs="velocity"))
    return with_filter(measured, velocities, quiet)


def plants_of_ensemble(updated: UpdatedModel, fit: frf_ipz.ModalFit) -> list[Plant]:
    """Do the same with members of the posterior."""
    both = (
        make_state_space_ensemble(
            fit,
            updated,
            points=(frf_ipz.parse_dof(POINT),),
            options=frf_ipz.ExportOptions(outputs=kind, ensemble=ENSEMBLE),
        )
        for kind in ("measured", "velocity")
    )
    return [with_filter(*pair, POINT) for pair in zip(*both, strict=True)]


def with_filter(measured: object, velocities: object, quiet: str) -> Plant:
    """Put the low-pass before the actuator."""
    force, disturbed = measured.input_names.index(ACTUATOR), measured.input_names.index(DISTURBANCE)
    row, point = measured.output_names.index(SENSOR), velocities.output_names.index(quiet)
    D = measured.D[row]
    return filtered(
        measured.A, measured.B[:, [force]], measured.B[:, [disturbed]], measured.C[[row]], D[[force, disturbed]],
        velocities.C[[point]],
    )  # fmt: skip


def filtered(
    A: np.ndarray, force: np.ndarray, disturbance: np.ndarray, sensor: np.ndarray, direct: np.ndarray, z: np.ndarray
) -> Plant:
    """Build the plant with the filter's two states after the structure's."""
    rate = 2 * np.pi * FILTER_HZ
    whole = block_diag(A, rate * np.array([[0.0, 1.0], [-1.0, -1.4]]))
    whole[: len(A), [-2]] = force
    pad = np.zeros((1, 2))
    return Plant(
        A=whole,
        command=np.append(np.zeros(len(A) + 1), rate)[:, None],
        disturbance=np.vstack([disturbance, pad.T]),
        sensor=np.hstack([sensor, [[direct[0], 0.0]]]),
        sensor_direct=float(direct[1]),
        velocity=np.hstack([z, pad]),
    )


def true_plant() -> Plant:
    """Return the beam of the simulated campaign, all its modes up to 50 kHz."""
    model, rows = receptance()
    omega, shapes = model.omega_rad_s, model.shapes
    zeros = np.zeros((len(omega), len(omega)))
    A = np.block([[zeros, np.diag(omega)], [-np.diag(omega), -np.diag(2 * model.damping_ratio * omega)]])
    force, disturbance = (np.append(np.zeros(len(omega)), shapes[rows[node]])[:, None] for node in (89, 69))
    sensor = np.append(np.zeros(len(omega)), shapes[0])[None]
    direct = np.array([float(shapes[0] @ shapes[rows[node]]) for node in (89, 69)])
    return filtered(A, force, disturbance, sensor @ A, direct, np.append(np.zeros(len(omega)), shapes[1])[None])


def lqg(plant: Plant, effort: float) -> control.StateSpace:
    """Design the controller from measured acceleration to command; the command is fed back with a plus."""
    scale = (plant.velocity @ plant.velocity.T).item()  # of the cost, so that the Riccati solver meets numbers near 1
    P = solve_continuous_are(plant.A, plant.command, plant.velocity.T @ plant.velocity / scale, [[effort / scale]])
    gain = plant.command.T @ P / (effort / scale)
    noise = np.array([[MEASUREMENT_NOISE + plant.sensor_direct**2]])
    spread = plant.disturbance @ plant.disturbance.T + COMMAND_NOISE * plant.command @ plant.command.T
    shared = plant.disturbance * plant.sensor_direct
    X = solve_continuous_are(plant.A.T, plant.sensor.T, spread, noise, s=shared)
    observer = (X @ plant.sensor.T + shared) / noise
    return control.ss(plant.A - plant.command @ gain - observer @ plant.sensor, observer, -gain, 0)


def strongest(plant: Plant, members: list[Plant]) -> control.StateSpace:
    """Lower the effort's weight as long as the design model and all members stay well inside their margins."""
    best = None
    for effort in EFFORTS:
        found = lqg(plant, float(effort))
        if any(not stable(each, found) or sensitivity(each, found) > MAX_SENSITIVITY for each in (plant, *members)):
            break
        best = found
    if best is None:
        raise SystemExit("no effort is small enough for the margins wanted")
    return best


def closed(plant: Plant, controller: control.StateSpace) -> np.ndarray:
    """Return the matrix of the closed loop."""
    return np.block(
        [
            [plant.A, plant.command @ np.asarray(controller.C)],
            [np.asarray(controller.B) @ plant.sensor, np.asarray(controller.A)],
        ]
    )


def stable(plant: Plant, controller: control.StateSpace) -> bool:
    """Tell whether the closed loop is stable."""
    return bool(np.linalg.eigvals(closed(plant, controller)).real.max() < 0)


def loop(plant: Plant, controller: control.StateSpace) -> control.StateSpace:
    """Return the loop, cut at the command; fed back with a minus, as margins are defined."""
    return -control.ss(plant.A, plant.command, plant.sensor, 0) * controller


def sensitivity(plant: Plant, controller: control.StateSpace) -> float:
    """Return the largest |1 / (1 + L)|."""
    return float(np.abs(1 / (1 + loop_values(plant, controller))).max())


def loop_values(plant: Plant, controller: control.StateSpace) -> np.ndarray:
    """Evaluate the loop on all lines, by the modes of both systems."""
    return -transfer(plant.A, plant.command, plant.sensor) * transfer(controller.A, controller.B, controller.C)


def transfer(A: np.ndarray, B: np.ndarray, C: np.ndarray) -> np.ndarray:
    """C (i omega - A)^-1 B on all lines."""
    poles, vectors = np.linalg.eig(np.asarray(A))
    residues = (np.asarray(C) @ vectors)[0] * np.linalg.solve(vectors, np.asarray(B))[:, 0]
    return (residues / (1j * OMEGA[:, None] - poles)).sum(axis=1)


def judge(controller: control.StateSpace, design: Plant, real: Plant) -> dict[str, float]:
    """Say what a controller promised on its own model's point and what it does on the real beam."""
    values = loop_values(real, controller)
    promised, kept = (vibration(plant, controller) / vibration(plant, None) for plant in (design, real))
    gain, phase, *_ = control.margin(control.FRD(values, OMEGA)) if stable(real, controller) else (0.0, 0.0)
    return {
        "stable on the beam": float(stable(real, controller)),
        "vibration left, promised %": 100 * promised,
        "vibration left at node 49 %": 100 * kept,
        "largest sensitivity": float(np.abs(1 / (1 + values)).max()),
        "gain margin": gain,
        "phase margin deg": phase,
    }


def vibration(plant: Plant, controller: control.StateSpace | None) -> float:
    """Root mean square of the velocity in the band for a white disturbance; infinite for an unstable loop."""
    A, B, C = plant.A, plant.disturbance, plant.velocity
    if controller is not None:
        if not stable(plant, controller):
            return float("inf")
        A = closed(plant, controller)
        B = np.vstack([B, np.asarray(controller.B) * plant.sensor_direct])
        C = np.hstack([C, np.zeros((1, len(controller.A)))])
    hertz = OMEGA / (2 * np.pi)
    inside = (hertz >= BAND_HZ[0]) & (hertz <= BAND_HZ[1])
    return float(np.sqrt(np.trapezoid(np.abs(transfer(A, B, C)[inside]) ** 2, OMEGA[inside]) / np.pi))


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "results/poi_controller"))
