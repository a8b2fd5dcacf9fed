"""The records of a test: their excitation, the signals of all channels, and what the converter stores of them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from frf_testbench.simulator.cases.system import TrueSystem
from frf_testbench.simulator.set_up import ORDERS, SetUp
from frf_testbench.simulator.signals.channels import Noise, quantise
from frf_testbench.simulator.signals.forces import Impact, draw_impacts, draw_random_force
from frf_testbench.simulator.signals.laplace import LaplaceGrid
from frf_testbench.simulator.signals.time_stepping import integrate_law_force
from frf_testbench.simulator.structures.structure import Motion

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

STEPS_PER_PERIOD = 48  # of the band's upper edge, for nonlinear laws
SHAKER_BAND = 0.45, 1.25  # over the edges of the band that is fitted
SHAKER_RMS = 0.15  # over the force of a hammer on the same specimen


@dataclass(frozen=True, slots=True, kw_only=True)
class Excitation:
    """What drives one record: the impact of a hammer, or the force of a shaker.

    Parameters
    ----------
    point : int
        Which of the excited points.
    order : int
        Which of the records of that point.
    impact : Impact, optional
        Of a hammer.
    rms_n : float
        Of a shaker.
    seed : int
        Of a shaker's force.
    """

    point: int
    order: int
    impact: Impact | None = None
    rms_n: float = 0.0
    seed: int = 0


def draw_excitations(rng: np.random.Generator, set_up: SetUp, *, double_hit: bool = False) -> tuple[Excitation, ...]:
    """Draw the excitation of all records of a test.

    Parameters
    ----------
    rng : Generator
        Of the case.
    set_up : SetUp
        The test.
    double_hit : bool
        One of the impacts at the first point is one.

    Returns
    -------
    tuple of Excitation
        Point by point.
    """
    excitations: list[Excitation] = []
    for point in range(len(set_up.excited_points)):
        if set_up.kind == "random":
            levels = rng.permutation(set_up.spread ** -np.linspace(0, 1, set_up.records_each))
            rms = SHAKER_RMS * set_up.peak_n
            excitations += [
                Excitation(point=point, order=i, rms_n=float(rms * level), seed=int(rng.integers(2**31)))
                for i, level in enumerate(levels)
            ]
            continue
        impacts = list(
            draw_impacts(
                rng,
                set_up.records_each,
                peak_n=set_up.peak_n * rng.uniform(0.7, 1.0),
                spread=set_up.spread,
                contact_s=set_up.contact_s,
                start_s=set_up.start_s,
            )
        )
        if double_hit and point == 0:
            doubled = int(rng.integers(len(impacts)))
            delay = rng.uniform(6, 25) * set_up.contact_s
            impacts[doubled] = replace(impacts[doubled], rebound=(float(delay), float(rng.uniform(0.15, 0.5))))
        excitations += [Excitation(point=point, order=i, impact=impact) for i, impact in enumerate(impacts)]
    return tuple(excitations)


def make_grid(system: TrueSystem, *, refine: float = 1.0, n_records: int = 1) -> LaplaceGrid:
    """Choose the sampling of the forces and the lines of the transforms.

    Parameters
    ----------
    system : TrueSystem
        Nonlinear laws need small steps.
    refine : float
        Divides the step further.
    n_records : int
        In a file.

    Returns
    -------
    LaplaceGrid
        With room before the record for a shaker that is running already.
    """
    set_up = system.set_up
    before = set_up.n_samples // 2 if set_up.running and set_up.kind == "random" else 0
    steps = 8
    if any(effect.law for effect in system.effects):
        steps = max(8, -int(-STEPS_PER_PERIOD * set_up.band_hz[1] // set_up.rate_hz))
    n_samples = n_records * set_up.n_samples + before
    return LaplaceGrid(n_samples=n_samples, rate_hz=set_up.rate_hz, oversampling=round(refine * steps))


def group_by_file(excitations: tuple[Excitation, ...], set_up: SetUp) -> list[tuple[Excitation, ...]]:
    """Group records by the file that holds them, in order."""
    if not set_up.in_one_file:
        return [(excitation,) for excitation in excitations]
    return [tuple(group) for _, group in groupby(excitations, key=lambda excitation: excitation.point)]


def simulate_force(excitations: tuple[Excitation, ...], set_up: SetUp, grid: LaplaceGrid) -> FloatArray:
    """Simulate the force of one file, (n_fine,), N: a record, or impacts with the length of a record between them."""
    excitation, pause = excitations[0], set_up.n_samples / set_up.rate_hz
    if excitation.impact is not None:
        impacts = [excitation.impact for excitation in excitations if excitation.impact]
        forces = [impact.force(grid.fine_time_s - i * pause) for i, impact in enumerate(impacts)]
        return np.asarray(np.sum(forces, axis=0))
    low, high = (factor * edge for factor, edge in zip(SHAKER_BAND, set_up.band_hz, strict=True))
    band = (low, min(high, set_up.filter.passband * set_up.rate_hz))
    time = grid.fine_time_s
    rng = np.random.default_rng(excitation.seed)
    return excitation.rms_n * draw_random_force(rng, time, band, taper_s=0.01 * time[-1], burst=set_up.burst)


def peak_motion(
    system: TrueSystem, excitations: tuple[Excitation, ...], motion: Motion, *, drifting: bool = True
) -> tuple[float, float]:
    """Find the largest motion and velocity at a location over all records of a linear system.

    Parameters
    ----------
    system : TrueSystem
        Without effects.
    excitations : tuple of Excitation
        Of the records.
    motion : Motion
        The location.
    drifting : bool
        With the motion of a free structure as a whole, in its suspension.

    Returns
    -------
    motion, velocity : float
        m and m/s.
    """
    grid = replace(make_grid(system), oversampling=4)
    row = system.structure.motion_row(motion)
    shape = row @ system.modes.shapes[:, : system.receptance.omega_rad_s.size]
    if not drifting:
        shape[: system.structure.n_rigid] = 0.0
    excited_shapes = system.receptance.shapes[system.excited_rows]
    omega, ratio = system.receptance.omega_rad_s, system.receptance.damping_ratio
    s = grid.s
    gains = 1 / (s[:, None] ** 2 + s[:, None] * (2 * ratio * omega) + omega**2)
    largest = np.zeros(2)
    for excitation in excitations:
        force = grid.spectrum(simulate_force((excitation,), system.set_up, grid))
        w = (gains @ (shape * excited_shapes[excitation.point])) * force
        signals = grid.signal(np.stack([w, s * w]))
        largest = np.maximum(largest, np.abs(signals).max(axis=1))
    return float(largest[0]), float(largest[1])


def simulate_records(
    system: TrueSystem, excitations: tuple[Excitation, ...], *, refine: float = 1.0
) -> tuple[FloatArray, FloatArray]:
    """Simulate the signals of all channels without noise.

    Parameters
    ----------
    system : TrueSystem
        The test.
    excitations : tuple of Excitation
        Of the records: of all that share a file, or of the first ones.
    refine : float
        Divides the step of `make_grid`.

    Returns
    -------
    signals : (n_records, 1 + n_sensors, n_samples) array
        The force first; sensors in their own units. Impacts of one file follow each other without a gap.
    points : (n_records, n_points, n_samples) array
        True motions of the points of interest, SI, in the sensors' quantity, through the filter only.
    """
    files = group_by_file(excitations, system.set_up)
    grid = make_grid(system, refine=refine, n_records=max(map(len, files)))
    laws = _simulate_law_spectra(system, files, grid)
    filter_gain = system.set_up.filter.gain(grid)
    units = np.array([1.0, *(sensor.unit_si for sensor in system.set_up.sensors)])
    signals, points = [], []
    for i, file in enumerate(files):
        law = None if laws is None else laws[i]
        at_channels, at_points = _simulate_spectra(system, file, grid, i / max(len(files) - 1, 1), law)
        recorded = grid.signal((at_channels * filter_gain[:, None]).T) / units[:, None]
        signals.append(_split_records(recorded, system, len(file)))
        points.append(_split_records(grid.signal((at_points * filter_gain[:, None]).T), system, len(file)))
    return _saturate(system, np.concatenate(signals)), np.concatenate(points)


def _split_records(signals: FloatArray, system: TrueSystem, n_records: int) -> FloatArray:
    """Split a file into (n_records, n_channels, n_samples), without what a running shaker did before."""
    n = system.set_up.n_samples
    start = signals.shape[1] % n
    parts = signals[:, start : start + n_records * n]
    return parts.reshape(len(signals), n_records, n).swapaxes(0, 1)


def _simulate_spectra(
    system: TrueSystem,
    excitations: tuple[Excitation, ...],
    grid: LaplaceGrid,
    progress: float,
    law: ComplexArray | None,
) -> tuple[ComplexArray, ComplexArray]:
    """Simulate spectra of the channels and of the points of interest, for one file.

    `progress` is how far the test has got, 0 to 1: it matters for what drifts.
    """
    s, set_up, excitation = grid.s, system.set_up, excitations[0]
    force = grid.spectrum(simulate_force(excitations, set_up, grid))
    sign = set_up.excited_points[excitation.point][1]
    model = system.receptance
    drift = sum(effect.drift for effect in system.effects)
    if drift:
        model = replace(model, omega_rad_s=model.omega_rad_s * (1 + drift * progress))
    sources, loads = [system.excited_rows[excitation.point]], [sign * force]
    if law is not None:
        sources.append(system.law_row)
        loads.append(-law)
    point_rows = [system.node_row(node) for node in set_up.points]
    H = model(s, [*system.sensor_rows, *point_rows], sources)
    motions = np.einsum("fij,jf->fi", H, np.array(loads))
    n = len(set_up.sensors)
    orders = np.array([ORDERS[sensor.quantity] for sensor in set_up.sensors])
    signs = np.array([sensor.sign for sensor in set_up.sensors])
    at_channels = system.record_chain(motions[:, :n] * s[:, None] ** orders * signs, force, s)
    return at_channels, motions[:, n:] * s[:, None] ** orders[0]


def _simulate_law_spectra(
    system: TrueSystem, files: list[tuple[Excitation, ...]], grid: LaplaceGrid
) -> ComplexArray | None:
    """Simulate the (n_files, n_lines) spectra of the restoring force of a nonlinear law."""
    effect = next((effect for effect in system.effects if effect.law), None)
    if effect is None or effect.law is None:
        return None
    s = grid.fine_s
    responses = {
        point: system.receptance(s, [system.law_row], [row])[:, 0, 0] for point, row in enumerate(system.excited_rows)
    }
    motion, velocity = [], []
    for file in files:
        force = grid.spectrum(simulate_force(file, system.set_up, grid), all_lines=True)
        w = system.set_up.excited_points[file[0].point][1] * responses[file[0].point] * force
        motion.append(grid.fine_signal(w))
        velocity.append(grid.fine_signal(s * w))
    location = np.eye(len(system.receptance.shapes))[system.law_row]
    step = 1 / (grid.rate_hz * grid.oversampling)
    forces = integrate_law_force(system.receptance, location, effect.law, np.array(motion), np.array(velocity), step)
    lead_s = step / 2 if effect.law.is_constant_within_step else 0.0
    return grid.spectrum(forces) * np.exp(grid.s * lead_s)


def _saturate(system: TrueSystem, signals: FloatArray) -> FloatArray:
    """Bend channels whose amplifier saturates."""
    for effect in system.effects:
        for column, level in effect.saturation.items():
            channel = 1 + [sensor.column for sensor in system.set_up.sensors].index(column)
            limit = level * np.abs(signals[:, channel]).max()
            signals[:, channel] = limit * np.tanh(signals[:, channel] / limit)
    return signals


def draw_noise(rng: np.random.Generator, signals: FloatArray) -> tuple[Noise, ...]:
    """Draw the noise of all channels from their largest signals."""
    peaks = np.abs(signals).max(axis=(0, 2))
    pink = float(rng.uniform(0.05, 0.55))
    level = rng.uniform(-4.6, -3.6)
    return tuple(
        Noise(rms=float(peak * 10 ** (level + rng.uniform(-0.4, 0.5))), pink_fraction=pink) for peak in peaks.tolist()
    )


def digitise(
    rng: np.random.Generator, signals: FloatArray, noise: tuple[Noise, ...], set_up: SetUp
) -> tuple[FloatArray, FloatArray]:
    """Add noise and the converter's dc offsets, and convert: one range of each channel for all records.

    Parameters
    ----------
    rng : Generator
        Of the case.
    signals : (n_records, n_channels, n_samples) array
        Without noise.
    noise : tuple of Noise
        Of each channel.
    set_up : SetUp
        The test.

    Returns
    -------
    stored : (n_records, n_channels, n_samples) array
        Whole steps of the converter.
    full_scale : (n_channels,) array
        Its ranges.
    """
    peaks = np.abs(signals).max(axis=(0, 2))
    dc_offsets = set_up.dc_offset * peaks * rng.spawn(1)[0].uniform(-1, 1, peaks.size)
    full_scale = peaks * rng.uniform(1.1, 2.0, signals.shape[1])
    stored = np.empty_like(signals)
    for i, j in np.ndindex(*signals.shape[:2]):
        noisy = signals[i, j] + noise[j].draw(rng, signals.shape[2]) + dc_offsets[j]
        stored[i, j] = quantise(noisy, float(full_scale[j]), set_up.bits)
    return stored, full_scale
