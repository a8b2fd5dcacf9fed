"""How well data can show an effect: its change of the FRFs against noise and against scatter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from frf_testbench.simulator.cases.campaign import Drive, files_of, force_of, make_grid, true_records
from frf_testbench.simulator.cases.world import World
from frf_testbench.simulator.signals.channels import Noise

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

FORCE_WINDOW_S = 0.02  # part of the record in which force noise counts


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lines:
    """Lines of the band, and what noise does to the FRFs there.

    Parameters
    ----------
    frequencies_hz : (n,) array
        Lines.
    base : (n, n_sensors, n_struck) array
        FRFs with scatter, without the effect, SI.
    sigma : (n, n_sensors, n_struck) array
        Standard deviation of the modulus of the noise of an H1 estimate, SI.
    """

    frequencies_hz: FloatArray
    base: ComplexArray
    sigma: FloatArray


def make_lines(base: World, drives: tuple[Drive, ...], noise: tuple[Noise, ...]) -> Lines:
    """FRFs of the specimen without the effect, and their noise.

    Parameters
    ----------
    base : World
        With scatter, without effects.
    drives : tuple of Drive
        Blows or records.
    noise : tuple of Noise
        Of the channels.

    Returns
    -------
    Lines
        On the lines of the records within the band.
    """
    set_up = base.set_up
    lines = set_up.lines_hz
    H = base.measured_frf(lines)
    index = np.round(lines * set_up.n_samples / set_up.rate_hz).astype(int)
    power = _force_power(base, drives)[index]
    density = np.stack([_density(one, set_up.n_samples)[index] for one in noise])
    window = set_up.n_samples * (FORCE_WINDOW_S if set_up.kind == "hammer" else 1.0)
    units = np.array([sensor.unit_si for sensor in set_up.sensors])
    outputs = (units[:, None] ** 2 * density[1:]).T[:, :, None] * set_up.n_samples
    variance = outputs + np.abs(H) ** 2 * (density[0] * window)[:, None, None]
    return Lines(frequencies_hz=lines, base=H, sigma=np.sqrt(variance / power[:, None, :]))


def _force_power(base: World, drives: tuple[Drive, ...]) -> FloatArray:
    """(n_lines, n_struck) sum over the blows of the squared spectrum of the force."""
    set_up, grid = base.set_up, make_grid(base)
    start = (grid.n_samples - set_up.n_samples) * grid.oversampling
    power = np.zeros((set_up.n_samples // 2 + 1, len(set_up.struck)))
    for drive in drives:
        force = force_of((drive,), set_up, grid)[start:]
        spectrum = np.fft.rfft(force)[: power.shape[0]] / grid.oversampling
        power[:, drive.struck] += np.abs(spectrum) ** 2
    return power


def _density(noise: Noise, n: int) -> FloatArray:
    """(n // 2 + 1,) expected squared spectrum of noise over the number of samples."""
    k = np.maximum(np.arange(n // 2 + 1), 1)
    pink = (n / 2) / (k * np.sum(1 / k))
    return np.asarray(noise.rms**2 * (1 - noise.pink_fraction + noise.pink_fraction * pink))


def change(lines: Lines, other: ComplexArray, reference: ComplexArray | None = None) -> dict[str, float]:
    """Compare FRFs with those without the effect.

    Parameters
    ----------
    lines : Lines
        With the FRFs without the effect.
    other : (n, n_sensors, n_struck) array
        FRFs with it.
    reference : array, optional
        What to compare with instead.

    Returns
    -------
    dict
        ``frf_change`` (norm of the change over the norm), ``ratio_max`` and ``ratio_rms`` (over the noise).
    """
    base = lines.base if reference is None else reference
    ratio = np.abs(other - base) / lines.sigma
    return {
        "frf_change": four(np.linalg.norm(other - base) / np.linalg.norm(base)),
        "ratio_max": four(ratio.max()),
        "ratio_rms": four(np.sqrt(np.mean(ratio**2))),
    }


def level_change(
    signals: FloatArray, linear: FloatArray, noise: tuple[Noise, ...], drives: tuple[Drive, ...], world: World
) -> dict[str, float]:
    """Say how much responses depend on level, or on when the blow was: what no linear effect does.

    Parameters
    ----------
    signals, linear : (n_drives, n_channels, n_samples) array
        Without noise: as they are, and as they would be without laws, saturation and drift.
    noise : tuple of Noise
        Of the channels.
    drives : tuple of Drive
        Blows or records.
    world : World
        The test.

    Returns
    -------
    dict
        ``level_change``: how much the relative change of the responses in band (norm over norm) differs between blows
        of a point; ``level_ratio_rms``: the largest change of a blow over the noise, RMS over lines and channels.
    """
    set_up = world.set_up
    index = np.round(set_up.lines_hz * set_up.n_samples / set_up.rate_hz).astype(int)
    a, b = (np.fft.rfft(one[:, 1:], axis=-1)[:, :, index] for one in (signals, linear))
    sigma = np.sqrt(set_up.n_samples * np.stack([_density(one, set_up.n_samples)[index] for one in noise[1:]]))
    part = np.linalg.norm(a - b, axis=(1, 2)) / np.linalg.norm(b, axis=(1, 2))
    ratio = np.sqrt(np.mean((np.abs(a - b) / sigma) ** 2, axis=(1, 2)))
    struck = np.array([drive.struck for drive in drives])
    spread = max(np.ptp(part[struck == one]) for one in np.unique(struck))
    return {"level_change": four(spread), "level_ratio_rms": four(ratio.max())}


def step_change(world: World, drives: tuple[Drive, ...], signals: FloatArray) -> float:
    """Double the time step of a nonlinear law.

    Parameters
    ----------
    world : World
        With a law.
    drives : tuple of Drive
        Blows or records.
    signals : (n_drives, n_channels, n_samples) array
        Without noise, with the step of `make_grid`.

    Returns
    -------
    float
        Change of the responses to the loudest blow within the band, norm over norm; infinite where they run away.
    """
    set_up = world.set_up
    loudest = int(np.argmax(np.abs(signals[:, 0]).max(axis=1)))
    file = next(file for file in files_of(drives, set_up) if drives[loudest] in file)
    try:
        coarse, _ = true_records(world, file, refine=0.5)
    except FloatingPointError:
        return float("inf")
    index = np.round(set_up.lines_hz * set_up.n_samples / set_up.rate_hz).astype(int)
    a, b = (np.fft.rfft(one[1:], axis=-1)[:, index] for one in (coarse[file.index(drives[loudest])], signals[loudest]))
    return float(np.linalg.norm(a - b) / np.linalg.norm(b))


def four(value: float) -> float:
    """Round to four digits."""
    return float(f"{float(value):.4g}")
