"""The test of a specimen: band, sampling, excited points, sensors, levels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from frf_testbench.simulator.signals.channels import AntiAlias
from frf_testbench.simulator.signals.receptance import Modes
from frf_testbench.simulator.specimens import Specimen
from frf_testbench.simulator.structures.structure import Point, Structure

FloatArray = NDArray[np.float64]

RATES_HZ = (
    64, 100, 128, 160, 200, 256, 320, 400, 500, 512, 640, 800, 1000, 1024, 1280, 1600, 2000, 2048, 2560, 3200, 4000,
    4096, 5000, 5120, 6400, 8000, 8192, 10000, 10240, 12500, 12800, 16000, 20000, 20480, 25600, 32000, 40960, 51200,
    65536, 102400,
)  # fmt: skip
RECORD_LENGTHS = (6000, 8192, 10000, 16384, 20000)
QUANTITIES = {  # unit, SI value of the unit, power of s that makes it from a displacement
    "acceleration": (("m/s^2", 1.0), ("g_0", 9.80665)),
    "velocity": (("m/s", 1.0), ("mm/s", 1e-3)),
    "displacement": (("mm", 1e-3), ("um", 1e-6)),
}
ORDERS = {"displacement": 0, "velocity": 1, "acceleration": 2}
LONGEST_CONTACT = 1.7  # of a hammer's tip, times the upper edge of the band
LEAST_REACH = 1e-6  # of a mode's largest receptance, between a force and a motion: less is the error of arithmetic
MARGIN = 0.3  # sensors and excited points sit where some mode moves at least this much of its largest motion


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensor:
    """One output channel."""

    column: str
    node: int
    sign: int
    quantity: str
    unit: str
    unit_si: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SetUp:
    """A test.

    Parameters
    ----------
    kind : str
        ``hammer`` or ``random``.
    band_hz : tuple of float
        Where the model is fitted.
    rate_hz, n_samples
        Of each record.
    excited_points : tuple of (node, sign)
        Where a hammer strikes or a shaker drives.
    sensors : tuple of Sensor
        Output channels.
    records_each : int
        Records at each excited point.
    points : tuple of int
        Nodes of interest that are not measured.
    damping_ratio : float
        What the model file says of all modes.
    peak_n, spread, contact_s, start_s
        Strongest impact, strongest over weakest, contact time, and when the tip touches; of a shaker, its largest RMS.
    burst : float
        Part of a random record that is driven.
    running : bool
        The shaker has been running before the record starts.
    bits : int
        Of the converter.
    dc_offset : float
        Largest dc offset of a channel, over its largest signal.
    filter : AntiAlias
        Of the converter.
    in_one_file : bool
        The recorder runs on from impact to impact at a point: what one leaves is still there when the next comes.
    """

    kind: str
    band_hz: tuple[float, float]
    rate_hz: float
    n_samples: int
    excited_points: tuple[tuple[int, int], ...]
    sensors: tuple[Sensor, ...]
    records_each: int
    points: tuple[int, ...]
    damping_ratio: float
    peak_n: float
    spread: float
    contact_s: float
    start_s: float
    burst: float
    running: bool
    bits: int
    dc_offset: float
    filter: AntiAlias
    in_one_file: bool

    @property
    def lines_hz(self) -> FloatArray:
        """Lines of a record within the band."""
        lines = np.arange(self.n_samples // 2 + 1) * self.rate_hz / self.n_samples
        return lines[(lines >= self.band_hz[0]) & (lines <= self.band_hz[1])]


def _draw_band(rng: np.random.Generator, frequencies_hz: FloatArray, n_modes: int) -> tuple[float, float]:
    """Draw a band from below the first mode to between two modes."""
    last = int(rng.integers(min(3, n_modes), n_modes + 1)) - 1
    if last + 1 < frequencies_hz.size:
        gaps = frequencies_hz[1:] / frequencies_hz[:-1]
        while last > 1 and gaps[last] < 1.08:  # no band that ends within a cluster
            last -= 1
        high = min(1.35 * frequencies_hz[last], np.sqrt(frequencies_hz[last] * frequencies_hz[last + 1]))
    else:
        high = 1.3 * frequencies_hz[last]
    return float(f"{0.45 * frequencies_hz[0]:.3g}"), float(f"{high:.3g}")


def _draw_timing(
    rng: np.random.Generator, band: tuple[float, float], first_hz: float, kind: str, longest: int
) -> tuple[float, int, float]:
    """Draw sampling rate, record length and a damping ratio that lets the record nearly decay."""
    fast = (rate for rate in RATES_HZ if rate >= rng.uniform(2.7, 4.3) * band[1])
    rate = float(next(fast, RATES_HZ[-1]))
    n_samples = int(rng.choice([n for n in RECORD_LENGTHS if n <= longest]))
    ratio = float(np.exp(rng.uniform(np.log(0.0008), np.log(0.01))))
    remaining_amplitude = float(np.exp(rng.uniform(np.log(1e-3), np.log(0.15))))
    least_ratio = np.log(1 / remaining_amplitude) / (2 * np.pi * first_hz * n_samples / rate)
    if kind == "random":
        least_ratio *= 0.5
    return rate, n_samples, float(f"{min(max(ratio, least_ratio), 0.03):.2g}")


def select_moving_nodes(structure: Structure, modes: Modes, band: tuple[float, float], margin: float) -> list[int]:
    """Select the nodes where some mode of the band moves well.

    Parameters
    ----------
    structure : Structure
        The specimen.
    modes : Modes
        Of it.
    band : tuple of float
        Hz.
    margin : float
        Least motion, over the largest one of that mode.

    Returns
    -------
    list of int
        Nodes, ascending.
    """
    nodes = sorted(structure.nodes)
    best = np.abs(_relative_motions(structure, modes, band)).max(axis=1)
    return [node for node, value in zip(nodes, best.tolist(), strict=True) if value > margin]


def _relative_motions(structure: Structure, modes: Modes, band: tuple[float, float]) -> FloatArray:
    """Motions of the nodes, ascending, over the largest one of each mode of the band, (n_nodes, n_modes)."""
    inside = (modes.frequencies_hz >= band[0]) & (modes.frequencies_hz <= band[1])
    points = [Point(node, structure.direction) for node in sorted(structure.nodes)]
    shapes = np.array([structure.row(point) for point in points]) @ modes.shapes[:, inside]
    return np.asarray(shapes / np.abs(shapes).max(axis=0))


def is_reached(structure: Structure, modes: Modes, set_up: SetUp) -> bool:
    """Whether some force moves each sensor and point of interest in some mode of the band, and each force some of them.

    Parameters
    ----------
    structure, modes
        The specimen without scatter.
    set_up : SetUp
        A test of it.

    Returns
    -------
    bool
        False where the forces excite nothing of a motion, as in the other plane of a symmetric frame.
    """
    nodes = sorted(structure.nodes)
    shapes = _relative_motions(structure, modes, set_up.band_hz)
    motions = shapes[[nodes.index(node) for node in (*(sensor.node for sensor in set_up.sensors), *set_up.points)]]
    forces = shapes[[nodes.index(node) for node, _ in set_up.excited_points]]
    reaches = np.abs(motions[:, None] * forces).max(axis=2) > LEAST_REACH
    return bool(reaches.any(axis=1).all() and reaches.any(axis=0).all())


def draw_set_up(
    rng: np.random.Generator, specimen: Specimen, structure: Structure, modes: Modes, *, levels: bool = False
) -> SetUp:
    """Draw a test of a specimen.

    Parameters
    ----------
    rng : Generator
        Of the case.
    specimen : Specimen
        What is tested.
    structure, modes
        The specimen without scatter.
    levels : bool
        At least three impacts of different levels, and not too long records: for what depends on level.

    Returns
    -------
    SetUp
        The test.
    """
    habits = rng.spawn(1)[0]  # of who tests; does not change what is drawn of the specimen
    flexible = modes.frequencies_hz[structure.n_rigid :]
    band = _draw_band(rng, flexible, specimen.n_modes)
    kind = "random" if rng.random() < 0.25 else "hammer"
    rate, n_samples, ratio = _draw_timing(rng, band, float(flexible[0]), kind, 10000 if levels else 20000)
    nodes = select_moving_nodes(structure, modes, band, MARGIN)
    n_excited = 1 if kind == "random" else int(rng.choice([1, 2, 3], p=[0.5, 0.25, 0.25]))
    excited_nodes = rng.permutation(nodes)[: min(n_excited, len(nodes))].tolist()
    n_sensors = min(int(rng.choice([1, 2, 3, 4, 5, 6], p=[0.12, 0.28, 0.24, 0.16, 0.1, 0.1])), len(nodes))
    sensor_nodes = rng.permutation(nodes)[:n_sensors].tolist()
    unmeasured_nodes = [node for node in nodes if node not in sensor_nodes]
    n_points = int(rng.choice([0, 1, 2], p=[0.1, 0.45, 0.45]))
    n_records = int(rng.integers(4 if levels else 3, 6 if n_excited == 1 else 5)) if kind == "hammer" else 3
    return SetUp(
        kind=kind,
        band_hz=band,
        rate_hz=rate,
        n_samples=n_samples,
        excited_points=tuple((node, int(rng.choice([1, 1, -1]))) for node in excited_nodes),
        sensors=_draw_sensors(rng, sensor_nodes, free=structure.n_rigid > 0),
        records_each=n_records,
        points=tuple(rng.permutation(unmeasured_nodes)[:n_points].tolist()),
        damping_ratio=ratio,
        peak_n=float(np.clip(specimen.mass_kg * 10 ** rng.uniform(1.5, 3.0), 3, 800)),
        spread=float(rng.uniform(5, 10)),
        contact_s=float(rng.uniform(0.9, LONGEST_CONTACT) / band[1]),
        start_s=_draw_lead(habits, rate, float(rng.integers(60, 130)), band[1]),
        burst=float(rng.choice([1.0, 1.0, 0.7])),
        running=bool(rng.random() < 0.3),
        bits=int(rng.choice([16, 24, 24])),
        dc_offset=float(10 ** habits.uniform(-5, -3)) if habits.random() < 0.3 else 0.0,
        filter=AntiAlias(symmetric=bool(rng.random() < 0.75)),
        in_one_file=kind == "hammer" and bool(habits.random() < 0.2),
    )


def _draw_lead(rng: np.random.Generator, rate_hz: float, usual_samples: float, highest_hz: float) -> float:
    """Draw when the tip touches: one recorder in five begins only just before, within the ringing of its filter."""
    samples = (
        rng.integers(3, 21) + 0.5 * LONGEST_CONTACT * rate_hz / highest_hz if rng.random() < 0.2 else usual_samples
    )
    return float(samples / rate_hz)


def _draw_sensors(rng: np.random.Generator, nodes: list[int], *, free: bool) -> tuple[Sensor, ...]:
    quantities = ["acceleration"] if free else ["acceleration", "velocity", "displacement"]
    quantity = str(rng.choice(quantities, p=[1.0] if free else [0.8, 0.14, 0.06]))
    unit, unit_si = QUANTITIES[quantity][int(rng.integers(len(QUANTITIES[quantity])))]
    prefix = {"acceleration": "acc", "velocity": "vel", "displacement": "disp"}[quantity]
    return tuple(
        Sensor(
            column=f"{prefix}_{i + 1}",
            node=node,
            sign=int(rng.choice([1, 1, -1])),
            quantity=quantity,
            unit=unit,
            unit_si=unit_si,
        )
        for i, node in enumerate(nodes)
    )
