"""Make the demo campaign: a hammer test of the cantilever of section 5 of Dorosti et al. (2018).

Run ``python data/make_cantilever.py`` to write ``raw/cantilever/hits/*.csv`` and the FRFs that were kept aside,
``reference/cantilever_poi_frf.csv``. The same numbers come out each time. README.md says what is simulated.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from frf_testbench.simulator.cases.files import read_beam, write_recording
from frf_testbench.simulator.signals.channels import AntiAlias, Noise, quantise
from frf_testbench.simulator.signals.forces import Impact
from frf_testbench.simulator.signals.laplace import LaplaceGrid
from frf_testbench.simulator.signals.receptance import ModalReceptance, make_receptance, solve_modes
from frf_testbench.simulator.structures.beams import build_beam
from frf_testbench.simulator.structures.reality import Reality
from frf_testbench.simulator.structures.structure import Point

FloatArray = NDArray[np.float64]

DATA = Path(__file__).parent
RATE_HZ, N_SAMPLES = 2560.0, 10240  # 4 s: the second mode falls to 0.02 %, the first to 0.2 %
SENSOR, POI = 101, 49

# What the FE model knows nothing of.
CLAMP_NM_RAD, CLAMP_N_M = 6.5e3, 2.5e7
ACCELEROMETER_KG = 0.0015
DAMPING_RATIOS = np.array([0.015, 0.0036, 0.0024, 0.0021, 0.0027, 0.003])
SENSOR_GAIN, HAMMER_GAIN = 1.003, 0.998  # calibration certificates say 0.5 %
STRUCK_OFFSET_M = {89: 0.3e-3, 69: -0.2e-3}  # how far from the mark

FORCE_NOISE = Noise(rms=0.006, pink_fraction=0.2)
ACCELERATION_NOISE = Noise(rms=0.025, pink_fraction=0.3)
FORCE_RANGE_N, ACCELERATION_RANGE = 50.0, 2000.0  # 16 bit over plus and minus this
BITS = 16
# peak force N, contact ms, when the hammer touches s, rebound (delay s, fraction of the first contact)
IMPACTS: dict[str, tuple[float, float, float, tuple[float, ...]]] = {
    "p89_01": (21.4, 1.31, 0.02, ()),
    "p89_02": (10.7, 1.38, 0.02, ()),
    "p89_03": (29.6, 1.27, 0.02, ()),
    "p89_04": (16.2, 1.33, 0.02, (0.0183, 0.34)),  # a double hit
    "p89_05": (6.4, 1.44, 0.02, ()),
    "p89_06": (25.1, 1.29, 0.02, ()),
    "p69_01": (18.9, 1.32, 0.02, ()),
    "p69_02": (32.4, 1.26, 0.02, ()),
    "p69_03": (0.055, 1.75, 0.02, ()),  # hardly touched: a weak impact
    "p69_04": (12.6, 1.36, 2.3, ()),  # struck too late: the decay is cut off
    "p69_05": (7.9, 1.41, 0.02, ()),
    "p69_06": (26.8, 1.28, 0.02, ()),
}


def build_receptance() -> tuple[ModalReceptance, dict[int, int]]:
    """Build the real beam between all points, and the rows of the struck nodes (0: sensor, 1: POI)."""
    drawing = read_beam(DATA / "raw" / "cantilever" / "model.toml")
    reality = Reality(released={"left": (CLAMP_NM_RAD, CLAMP_N_M)}, stations=(POI, *STRUCK_OFFSET_M))
    beam = build_beam(drawing, reality).with_mass(Point(SENSOR), ACCELEROMETER_KG)
    points = [Point(SENSOR), Point(POI), *(Point(node, "z", (x, 0)) for node, x in STRUCK_OFFSET_M.items())]
    rows = np.array([beam.row(point) for point in points])
    receptance = make_receptance(solve_modes(beam), rows, DAMPING_RATIOS, 20 * RATE_HZ)
    return receptance, {node: 2 + row for row, node in enumerate(STRUCK_OFFSET_M)}


def simulate_record(name: str) -> dict[str, FloatArray]:
    """Simulate force and acceleration of one impact, as the analyser stores them."""
    peak, contact_ms, touch_s, rebound = IMPACTS[name]
    rng = np.random.default_rng([2018, *name.encode()])
    model, rows = build_receptance()
    grid = LaplaceGrid(n_samples=N_SAMPLES, rate_hz=RATE_HZ)
    start = touch_s + rng.uniform(-0.5, 0.5) / RATE_HZ  # the trigger falls between samples
    impact = Impact(peak_n=peak, start_s=start, contact_s=contact_ms * 1e-3, rebound=rebound)
    force = grid.spectrum(impact.force(grid.fine_time_s)) * AntiAlias().gain(grid)
    accelerance = grid.s**2 * model(grid.s, [0], [rows[int(name[1:3])]])[:, 0, 0]
    measured_force = HAMMER_GAIN * grid.signal(force) + FORCE_NOISE.draw(rng, N_SAMPLES)
    acceleration = SENSOR_GAIN * grid.signal(accelerance * force) + ACCELERATION_NOISE.draw(rng, N_SAMPLES)
    return {
        "force": quantise(measured_force, FORCE_RANGE_N, BITS),
        "acc_tip": quantise(acceleration, ACCELERATION_RANGE, BITS),
    }


def compute_reference_frf() -> list[str]:
    """Return the FRFs that were kept aside, as lines of a table."""
    model, rows = build_receptance()
    frequencies = np.arange(10, 700.01, 0.25)
    s = 2j * np.pi * frequencies
    lines = ["frequency_hz,output_dof,input_dof,real,imag"]
    for node, row in {**rows, SENSOR: 0}.items():
        accelerance = s**2 * model(s, [1], [row])[:, 0, 0]
        lines += [
            f"{f:.2f},{POI}:+z,{node}:+z,{value.real:.7g},{value.imag:.7g}"
            for f, value in zip(frequencies.tolist(), accelerance.tolist(), strict=True)
        ]
    return lines


def main() -> None:
    for name in IMPACTS:
        write_recording(DATA / "raw" / "cantilever" / "hits" / f"{name}.csv", simulate_record(name), RATE_HZ)
    table = DATA / "reference" / "cantilever_poi_frf.csv"
    table.parent.mkdir(exist_ok=True)
    table.write_text("\n".join(compute_reference_frf()) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
