"""The blows or records of a test, and what the converter stores of them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from frf_testbench.simulator.cases.set_up import ORDERS, SetUp
from frf_testbench.simulator.cases.world import World
from frf_testbench.simulator.effects.effect import Pair
from frf_testbench.simulator.signals.channels import Noise, quantise
from frf_testbench.simulator.signals.hammer import Blow, draw_blows, random_force
from frf_testbench.simulator.signals.integrate import law_force
from frf_testbench.simulator.signals.laplace import LaplaceGrid

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

STEPS_PER_PERIOD = 48  # of the band's upper edge, for nonlinear laws
SHAKER_BAND = 0.45, 1.25  # over the edges of the band that is fitted
SHAKER_RMS = 0.15  # over the force of a hammer on the same specimen


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """One blow or record.

    Parameters
    ----------
    struck : int
        Which of the struck points.
    order : int
        Which of the blows or records of that point.
    blow : Blow, optional
        Of a hammer.
    rms_n : float
        Of a shaker.
    seed : int
        Of a shaker's force.
    """

    struck: int
    order: int
    blow: Blow | None = None
    rms_n: float = 0.0
    seed: int = 0


def draw_drives(rng: np.random.Generator, set_up: SetUp, *, double_hit: bool = False) -> tuple[Drive, ...]:
    """Draw the blows or records of a test.

    Parameters
    ----------
    rng : Generator
        Of the case.
    set_up : SetUp
        The test.
    double_hit : bool
        One of the blows of the first point is one.

    Returns
    -------
    tuple of Drive
        Point by point.
    """
    drives = []
    for struck in range(len(set_up.struck)):
        if set_up.kind == "random":
            levels = rng.permutation(set_up.spread ** -np.linspace(0, 1, set_up.blows_each))
            rms = SHAKER_RMS * set_up.peak_n
            drives += [
                Drive(struck=struck, order=i, rms_n=float(rms * level), seed=int(rng.integers(2**31)))
                for i, level in enumerate(levels)
            ]
            continue
        blows = list(
            draw_blows(
                rng,
                set_up.blows_each,
                peak_n=set_up.peak_n * rng.uniform(0.7, 1.0),
                spread=set_up.spread,
                contact_s=set_up.contact_s,
                start_s=set_up.start_s,
            )
        )
        if double_hit and struck == 0:
            place = int(rng.integers(len(blows)))
            delay = rng.uniform(6, 25) * set_up.contact_s
            blows[place] = replace(blows[place], rebound=(float(delay), float(rng.uniform(0.15, 0.5))))
        drives += [Drive(struck=struck, order=i, blow=blow) for i, blow in enumerate(blows)]
    return tuple(drives)


def make_grid(world: World, *, refine: float = 1.0, n_blows: int = 1) -> LaplaceGrid:
    """Choose the sampling of the forces and the lines of the transforms.

    Parameters
    ----------
    world : World
        Nonlinear laws need small steps.
    refine : float
        Divides the step further.
    n_blows : int
        In a file.

    Returns
    -------
    LaplaceGrid
        With room before the record for a shaker that is running already.
    """
    set_up = world.set_up
    before = set_up.n_samples // 2 if set_up.running and set_up.kind == "random" else 0
    steps = 8
    if any(effect.law for effect in world.effects):
        steps = max(8, -int(-STEPS_PER_PERIOD * set_up.band_hz[1] // set_up.rate_hz))
    n_samples = n_blows * set_up.n_samples + before
    return LaplaceGrid(n_samples=n_samples, rate_hz=set_up.rate_hz, oversampling=round(refine * steps))


def files_of(drives: tuple[Drive, ...], set_up: SetUp) -> list[tuple[Drive, ...]]:
    """Group blows by the file that they are recorded in, in order."""
    if not set_up.in_one_file:
        return [(drive,) for drive in drives]
    return [tuple(group) for _, group in groupby(drives, key=lambda drive: drive.struck)]


def force_of(drives: tuple[Drive, ...], set_up: SetUp, grid: LaplaceGrid) -> FloatArray:
    """(n_fine,) true force of one file, N: a record, or blows with the length of a record between them."""
    drive, pause = drives[0], set_up.n_samples / set_up.rate_hz
    if drive.blow is not None:
        late = [grid.fine_time_s - i * pause for i in range(len(drives))]
        return np.sum([one.blow.force(time) for one, time in zip(drives, late, strict=True) if one.blow], axis=0)
    low, high = (factor * edge for factor, edge in zip(SHAKER_BAND, set_up.band_hz, strict=True))
    band = (low, min(high, set_up.filter.passband * set_up.rate_hz))
    time = grid.fine_time_s
    rng = np.random.default_rng(drive.seed)
    return drive.rms_n * random_force(rng, time, band, taper_s=0.01 * time[-1], burst=set_up.burst)


def swing(world: World, drives: tuple[Drive, ...], motion: Pair, *, drifting: bool = True) -> tuple[float, float]:
    """Largest motion and velocity of a place over all blows of a linear world.

    Parameters
    ----------
    world : World
        Without effects.
    drives : tuple of Drive
        Blows or records.
    motion : Pair
        The place.
    drifting : bool
        With the motion of a free structure as a whole, in its cords.

    Returns
    -------
    motion, velocity : float
        m and m/s.
    """
    grid = replace(make_grid(world), oversampling=4)
    row = world.structure.row(motion[0]) - (0 if motion[1] is None else world.structure.row(motion[1]))
    there = row @ world.modes.shapes[:, : world.receptance.omega_rad_s.size]
    if not drifting:
        there[: world.structure.n_rigid] = 0.0
    at_blows = world.receptance.shapes[world.struck_rows]
    omega, ratio = world.receptance.omega_rad_s, world.receptance.damping_ratio
    s = grid.s
    gains = 1 / (s[:, None] ** 2 + s[:, None] * (2 * ratio * omega) + omega**2)
    largest = np.zeros(2)
    for drive in drives:
        force = grid.spectrum(force_of((drive,), world.set_up, grid))
        w = (gains @ (there * at_blows[drive.struck])) * force
        signals = grid.signal(np.stack([w, s * w]))
        largest = np.maximum(largest, np.abs(signals).max(axis=1))
    return float(largest[0]), float(largest[1])


def true_records(world: World, drives: tuple[Drive, ...], *, refine: float = 1.0) -> tuple[FloatArray, FloatArray]:
    """Signals of all channels without noise.

    Parameters
    ----------
    world : World
        The test.
    drives : tuple of Drive
        Blows or records: all of a file, or only the first ones.
    refine : float
        Divides the step of `make_grid`.

    Returns
    -------
    signals : (n_drives, 1 + n_sensors, n_samples) array
        The force first; sensors in their own units. Blows of one file follow each other without a gap.
    points : (n_drives, n_points, n_samples) array
        True motions of the points of interest, SI, in the sensors' quantity, through the filter only.
    """
    files = files_of(drives, world.set_up)
    grid = make_grid(world, refine=refine, n_blows=max(map(len, files)))
    laws = _law_spectra(world, files, grid)
    filtered = world.set_up.filter.gain(grid)
    units = np.array([1.0, *(sensor.unit_si for sensor in world.set_up.sensors)])
    signals, points = [], []
    for i, file in enumerate(files):
        shown, there = _spectra(world, file, grid, i / max(len(files) - 1, 1), None if laws is None else laws[i])
        signals.append(_blow_by_blow(grid.signal((shown * filtered[:, None]).T) / units[:, None], world, len(file)))
        points.append(_blow_by_blow(grid.signal((there * filtered[:, None]).T), world, len(file)))
    return _saturate(world, np.concatenate(signals)), np.concatenate(points)


def _blow_by_blow(signals: FloatArray, world: World, n_blows: int) -> FloatArray:
    """(n_blows, n_channels, n_samples) parts of the signals of a file, without what a running shaker did before."""
    n = world.set_up.n_samples
    start = signals.shape[1] % n
    parts = signals[:, start : start + n_blows * n]
    return parts.reshape(len(signals), n_blows, n).swapaxes(0, 1)


def _spectra(
    world: World, drives: tuple[Drive, ...], grid: LaplaceGrid, when: float, law: ComplexArray | None
) -> tuple[ComplexArray, ComplexArray]:
    """Spectra of the channels and of the points of interest, for one file."""
    s, set_up, drive = grid.s, world.set_up, drives[0]
    force = grid.spectrum(force_of(drives, set_up, grid))
    sign = set_up.struck[drive.struck][1]
    model = world.receptance
    drift = sum(effect.drift for effect in world.effects)
    if drift:
        model = replace(model, omega_rad_s=model.omega_rad_s * (1 + drift * when))
    sources, loads = [world.struck_rows[drive.struck]], [sign * force]
    if law is not None:
        sources.append(world.law_row)
        loads.append(-law)
    point_rows = [world.node_row(node) for node in set_up.points]
    H = model(s, [*world.sensor_rows, *point_rows], sources)
    moved = np.einsum("fij,jf->fi", H, np.array(loads))
    n = len(set_up.sensors)
    orders = np.array([ORDERS[sensor.quantity] for sensor in set_up.sensors])
    signs = np.array([sensor.sign for sensor in set_up.sensors])
    shown = world.record_chain(moved[:, :n] * s[:, None] ** orders * signs, force, s)
    return shown, moved[:, n:] * s[:, None] ** orders[0]


def _law_spectra(world: World, files: list[tuple[Drive, ...]], grid: LaplaceGrid) -> ComplexArray | None:
    """(n_files, n_lines) spectra of the restoring force of a nonlinear law."""
    effect = next((effect for effect in world.effects if effect.law), None)
    if effect is None or effect.law is None:
        return None
    s = grid.fine_s
    responses = {
        struck: world.receptance(s, [world.law_row], [row])[:, 0, 0] for struck, row in enumerate(world.struck_rows)
    }
    motion, velocity = [], []
    for file in files:
        force = grid.spectrum(force_of(file, world.set_up, grid), all_lines=True)
        w = world.set_up.struck[file[0].struck][1] * responses[file[0].struck] * force
        motion.append(grid.fine_signal(w))
        velocity.append(grid.fine_signal(s * w))
    place = np.eye(len(world.receptance.shapes))[world.law_row]
    step = 1 / (grid.rate_hz * grid.oversampling)
    forces = law_force(world.receptance, place, effect.law, np.array(motion), np.array(velocity), step)
    late = step / 2 if effect.law.held else 0.0
    return grid.spectrum(forces) * np.exp(grid.s * late)


def _saturate(world: World, signals: FloatArray) -> FloatArray:
    """Bend channels whose amplifier saturates."""
    for effect in world.effects:
        for column, level in effect.saturation.items():
            channel = 1 + [sensor.column for sensor in world.set_up.sensors].index(column)
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


def store(
    rng: np.random.Generator, signals: FloatArray, noise: tuple[Noise, ...], set_up: SetUp
) -> tuple[FloatArray, FloatArray]:
    """Add noise and the converter's constants, and convert: one range of each channel for all blows.

    Parameters
    ----------
    rng : Generator
        Of the case.
    signals : (n_drives, n_channels, n_samples) array
        Without noise.
    noise : tuple of Noise
        Of each channel.
    set_up : SetUp
        The test.

    Returns
    -------
    stored : (n_drives, n_channels, n_samples) array
        Whole steps of the converter.
    full_scale : (n_channels,) array
        Its ranges.
    """
    peaks = np.abs(signals).max(axis=(0, 2))
    constants = set_up.offset * peaks * rng.spawn(1)[0].uniform(-1, 1, peaks.size)
    full_scale = peaks * rng.uniform(1.1, 2.0, signals.shape[1])
    stored = np.empty_like(signals)
    for i, j in np.ndindex(*signals.shape[:2]):
        noisy = signals[i, j] + noise[j].draw(rng, signals.shape[2]) + constants[j]
        stored[i, j] = quantise(noisy, float(full_scale[j]), set_up.bits)
    return stored, full_scale
