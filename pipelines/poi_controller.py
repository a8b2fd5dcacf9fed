"""Quieten a point that has no sensor: design a controller on the predicted model of the demo.

``python pipelines/poi_controller.py [DIR]``: a force at node 89 and the accelerometer at the tip are all there is; a
disturbance acts at node 69, and the velocity of node 49 is to be small. tests/end_to_end/test_poi_controller.py judges
the controller on the beam that was simulated for the demo.
"""

import sys
from pathlib import Path

import control
import numpy as np
from matplotlib import pyplot as plt

import frf_ipz

SENSOR, POINT, ACTUATOR, DISTURBANCE = "101:+z", "49:+z", "89:+z", "69:+z"
FILTER_RAD_S = 2 * np.pi * 700.0  # low-pass of the actuator's command, of second order: the models end there
MEASUREMENT_NOISE = 1e-2  # (m/s^2)^2 s, for a disturbance of 1 N^2 s
COMMAND_NOISE = 1.0  # N^2 s on the command, as on the disturbance: the observer gives way, and the loop is robust
MAX_SENSITIVITY = 2.0  # 6 dB: gain margin 2, phase margin 29 degrees; of the model and its ensemble
EFFORTS = np.logspace(3, -7, 81)  # weight of the command against the velocity, (m/s)^2 / N^2
OMEGA = 2 * np.pi * np.unique(np.concatenate([np.geomspace(2, 5000, 1000), np.linspace(10, 700, 1400)]))


def make_plant(measured: control.StateSpace, velocity: control.StateSpace, quiet: str = POINT) -> control.StateSpace:
    """Command and disturbance in, acceleration of the sensor and velocity of a point out; the low-pass is inside."""
    inputs = [measured.input_labels.index(name) for name in (ACTUATOR, DISTURBANCE)]
    row, point = measured.output_labels.index(SENSOR), velocity.output_labels.index(quiet)
    C, D = np.vstack([measured.C[row], velocity.C[point]]), np.vstack([measured.D[row, inputs], [0, 0]])
    lowpass = control.ss(FILTER_RAD_S * np.array([[0, 1], [-1, -1.4]]), [[0], [FILTER_RAD_S]], [[1, 0]], 0)
    return control.ss(measured.A, measured.B[:, inputs], C, D) * control.append(lowpass, control.ss([], [], [], [[1]]))


def design_lqg(plant: control.StateSpace, effort: float) -> control.StateSpace:
    """Design the controller from measured acceleration to command, which is fed back with a plus."""
    A, (command, disturbance), (sensor, velocity) = plant.A, np.hsplit(plant.B, 2), np.vsplit(plant.C, 2)
    scale, direct = (
        (velocity @ velocity.T).item(),
        plant.D[0, 1],
    )  # scaled so that the Riccati solver meets numbers near 1
    gain = control.care(A, command, velocity.T @ velocity / scale, [[effort / scale]])[2]
    spread = disturbance @ disturbance.T + COMMAND_NOISE * command @ command.T
    noise = [[MEASUREMENT_NOISE + direct**2]]
    observer = control.care(A.T, sensor.T, spread, noise, S=disturbance * direct, E=np.eye(len(A)))[2].T
    return control.ss(A - command @ gain - observer @ sensor, observer, -gain, 0)


def design_strongest(plants: list[control.StateSpace]) -> control.StateSpace:
    """Lower the effort's weight for the first plant as long as all of them stay well inside their margins."""
    responses, strongest = np.array([plant[0, 0](1j * OMEGA) for plant in plants]), None
    for effort in EFFORTS:
        controller = design_lqg(plants[0], effort)
        sensitivity = np.abs(1 / (1 - responses * controller(1j * OMEGA))).max()
        poles = np.concatenate([plant[0, 0].feedback(controller, 1).poles() for plant in plants])
        if poles.real.max() >= 0 or sensitivity > MAX_SENSITIVITY:
            return strongest
        strongest = controller
    return strongest


def main(out: Path) -> None:
    run = frf_ipz.run_pipeline(Path(__file__).with_suffix(".toml"), out)
    ends = {"measured": run.fit, "updated_model": run.updated_model, "points": [POINT]}
    measured, velocity = (frf_ipz.ExportOptions(outputs=kind, ensemble=40) for kind in ("measured", "velocity"))
    plant = make_plant(run.state_space, frf_ipz.to_state_space(**ends, options=velocity))
    ensembles = (frf_ipz.to_state_space_ensemble(**ends, options=options) for options in (measured, velocity))
    controller = design_strongest([plant, *map(make_plant, *ensembles)])
    gain, phase, *_ = control.margin(control.FRD(-(plant[0, 0] * controller)(1j * OMEGA), OMEGA))
    print(f"{run.summary()}\n\ngain margin {gain:.2f}, phase margin {abs(phase):.0f} degrees")
    closed = plant.feedback(control.append(controller, control.ss([], [], [], [[0]])), 1)
    for name, system in (("without control", plant[1, 1]), ("with control", closed[1, 1])):
        plt.loglog(OMEGA / (2 * np.pi), np.abs(system(1j * OMEGA)), label=name)
    plt.gca().set(xlabel="Frequency, Hz", ylabel=f"Velocity of {POINT} over force at {DISTURBANCE}, (m/s)/N")
    plt.legend()
    plt.savefig(out / "poi_controller.png")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "results/poi_controller"))
