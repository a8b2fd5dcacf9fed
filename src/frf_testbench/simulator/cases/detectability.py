"""How well data can show an effect: its change of the FRFs against noise, scatter and the level of the excitation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, SupportsFloat

import numpy as np
from numpy.typing import NDArray

from frf_testbench.simulator.cases.records import Excitation, group_by_file, make_grid, simulate_force, simulate_records
from frf_testbench.simulator.cases.system import TrueSystem, build_system
from frf_testbench.simulator.signals.channels import Noise

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

FORCE_WINDOW_S = 0.02  # part of the record in which force noise counts


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrfNoise:
    """Lines of the band, and what noise does to the FRFs there.

    Parameters
    ----------
    frequencies_hz : (n,) array
        Lines.
    frf : (n, n_sensors, n_excited) array
        FRFs with scatter, without the effect, SI.
    sigma : (n, n_sensors, n_excited) array
        Standard deviation of the modulus of the noise of an H1 estimate, SI.
    """

    frequencies_hz: FloatArray
    frf: ComplexArray
    sigma: FloatArray


def predict_frf_noise(
    base_system: TrueSystem, excitations: tuple[Excitation, ...], noise: tuple[Noise, ...]
) -> FrfNoise:
    """Predict the FRFs of the specimen without the effect, and their noise.

    Parameters
    ----------
    base_system : TrueSystem
        With scatter, without effects.
    excitations : tuple of Excitation
        Of all records.
    noise : tuple of Noise
        Of the channels.

    Returns
    -------
    FrfNoise
        On the lines of the records within the band.
    """
    set_up = base_system.set_up
    lines = set_up.lines_hz
    H = base_system.measured_frf(lines)
    index = np.round(lines * set_up.n_samples / set_up.rate_hz).astype(int)
    power = _compute_force_power(base_system, excitations)[index]
    density = np.stack([_noise_density(channel, set_up.n_samples)[index] for channel in noise])
    window = set_up.n_samples * (FORCE_WINDOW_S if set_up.kind == "hammer" else 1.0)
    units = np.array([sensor.unit_si for sensor in set_up.sensors])
    outputs = (units[:, None] ** 2 * density[1:]).T[:, :, None] * set_up.n_samples
    variance = outputs + np.abs(H) ** 2 * (density[0] * window)[:, None, None]
    return FrfNoise(frequencies_hz=lines, frf=H, sigma=np.sqrt(variance / power[:, None, :]))


def _compute_force_power(system: TrueSystem, excitations: tuple[Excitation, ...]) -> FloatArray:
    """Sum the squared spectrum of the force over the records of each point, (n_lines, n_excited)."""
    set_up, grid = system.set_up, make_grid(system)
    start = (grid.n_samples - set_up.n_samples) * grid.oversampling
    power = np.zeros((set_up.n_samples // 2 + 1, len(set_up.excited_points)))
    for excitation in excitations:
        force = simulate_force((excitation,), set_up, grid)[start:]
        spectrum = np.fft.rfft(force)[: power.shape[0]] / grid.oversampling
        power[:, excitation.point] += np.abs(spectrum) ** 2
    return power


def _noise_density(noise: Noise, n: int) -> FloatArray:
    """(n // 2 + 1,) expected squared spectrum of noise over the number of samples."""
    k = np.maximum(np.arange(n // 2 + 1), 1)
    pink = (n / 2) / (k * np.sum(1 / k))
    return np.asarray(noise.rms**2 * (1 - noise.pink_fraction + noise.pink_fraction * pink))


def compare_frfs(noise: FrfNoise, frf: ComplexArray, reference: ComplexArray | None = None) -> dict[str, float]:
    """Compare FRFs with those without the effect.

    Parameters
    ----------
    noise : FrfNoise
        With the FRFs without the effect.
    frf : (n, n_sensors, n_excited) array
        FRFs with it.
    reference : array, optional
        What to compare with instead.

    Returns
    -------
    dict
        ``frf_change`` (norm of the change over the norm), ``ratio_max`` and ``ratio_rms`` (over the noise).
    """
    base = noise.frf if reference is None else reference
    ratio = np.abs(frf - base) / noise.sigma
    return {
        "frf_change": round_to_four_digits(np.linalg.norm(frf - base) / np.linalg.norm(base)),
        "ratio_max": round_to_four_digits(ratio.max()),
        "ratio_rms": round_to_four_digits(np.sqrt(np.mean(ratio**2))),
    }


def measure_visibility(noise: FrfNoise, ideal_system: TrueSystem, system: TrueSystem) -> dict[str, Any]:
    """Measure how the effects change the FRFs, all together and each one beside the others.

    Parameters
    ----------
    noise : FrfNoise
        FRFs without the effects, and their noise.
    ideal_system, system : TrueSystem
        Without scatter and effects; with both.

    Returns
    -------
    dict
        Part of the truth. A nonlinear law counts as nothing here: see `compare_levels`.
    """
    ideal_frf = ideal_system.measured_frf(noise.frequencies_hz)
    result: dict[str, Any] = {
        "frf_noise": round_to_four_digits(np.linalg.norm(noise.sigma) / np.linalg.norm(noise.frf)),
        "scatter_change": round_to_four_digits(np.linalg.norm(ideal_frf - noise.frf) / np.linalg.norm(noise.frf)),
    }
    if not system.effects:
        return result | {"frf_change": 0.0, "ratio_max": 0.0, "ratio_rms": 0.0}
    measured = system.measured_frf(noise.frequencies_hz)
    result |= compare_frfs(noise, measured)
    if len(system.effects) > 1:
        result["each"] = []
        for i in range(len(system.effects)):
            other_effects = system.effects[:i] + system.effects[i + 1 :]
            without = build_system(system.specimen, system.set_up, system.scatter, other_effects)
            result["each"].append(compare_frfs(noise, measured, without.measured_frf(noise.frequencies_hz)))
    return result


def compare_levels(
    signals: FloatArray,
    linear: FloatArray,
    noise: tuple[Noise, ...],
    excitations: tuple[Excitation, ...],
    system: TrueSystem,
) -> dict[str, float]:
    """Say how much responses depend on level, or on when the record was taken: what no linear effect does.

    Parameters
    ----------
    signals, linear : (n_records, n_channels, n_samples) array
        Without noise: as they are, and as they would be without laws, saturation and drift.
    noise : tuple of Noise
        Of the channels.
    excitations : tuple of Excitation
        Of all records.
    system : TrueSystem
        The test.

    Returns
    -------
    dict
        ``level_change``: how much the relative change of the responses in band (norm over norm) differs between impacts
        of a point; ``level_ratio_rms``: the largest change of a impact over the noise, RMS over lines and channels.
    """
    set_up = system.set_up
    index = np.round(set_up.lines_hz * set_up.n_samples / set_up.rate_hz).astype(int)
    a, b = (np.fft.rfft(responses[:, 1:], axis=-1)[:, :, index] for responses in (signals, linear))
    densities = np.stack([_noise_density(channel, set_up.n_samples)[index] for channel in noise[1:]])
    sigma = np.sqrt(set_up.n_samples * densities)
    relative_change = np.linalg.norm(a - b, axis=(1, 2)) / np.linalg.norm(b, axis=(1, 2))
    ratio = np.sqrt(np.mean((np.abs(a - b) / sigma) ** 2, axis=(1, 2)))
    points = np.array([excitation.point for excitation in excitations])
    spread = max(np.ptp(relative_change[points == point]) for point in np.unique(points))
    return {"level_change": round_to_four_digits(spread), "level_ratio_rms": round_to_four_digits(ratio.max())}


def compare_steps(system: TrueSystem, excitations: tuple[Excitation, ...], signals: FloatArray) -> float:
    """Compare with twice the time step of a nonlinear law.

    Parameters
    ----------
    system : TrueSystem
        With a law.
    excitations : tuple of Excitation
        Of all records.
    signals : (n_records, n_channels, n_samples) array
        Without noise, with the step of `make_grid`.

    Returns
    -------
    float
        Change of the responses in the loudest record within the band, norm over norm; infinite where they run away.
    """
    set_up = system.set_up
    loudest = int(np.argmax(np.abs(signals[:, 0]).max(axis=1)))
    file = next(file for file in group_by_file(excitations, set_up) if excitations[loudest] in file)
    try:
        coarse, _ = simulate_records(system, file, refine=0.5)
    except FloatingPointError:
        return float("inf")
    index = np.round(set_up.lines_hz * set_up.n_samples / set_up.rate_hz).astype(int)
    coarse_record = coarse[file.index(excitations[loudest])]
    a, b = (np.fft.rfft(record[1:], axis=-1)[:, index] for record in (coarse_record, signals[loudest]))
    return float(np.linalg.norm(a - b) / np.linalg.norm(b))


def round_to_four_digits(value: SupportsFloat) -> float:
    """Round to four digits."""
    return float(f"{float(value):.4g}")
