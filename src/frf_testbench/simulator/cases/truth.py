"""The sealed answer to a case."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from frf_testbench.simulator.cases.campaign import Drive
from frf_testbench.simulator.cases.detectability import Lines, change, four
from frf_testbench.simulator.cases.set_up import ORDERS, SetUp
from frf_testbench.simulator.cases.world import World, make_world
from frf_testbench.simulator.effects.effect import Effect
from frf_testbench.simulator.signals.channels import Noise
from frf_testbench.simulator.signals.receptance import solve_modes
from frf_testbench.simulator.structures.beams import BeamDrawing
from frf_testbench.simulator.structures.nominal import NominalModel

FloatArray = NDArray[np.float64]

GENERATOR = "frf_ipz simulator 3"


def visibility(lines: Lines, ideal: World, world: World) -> dict[str, Any]:
    """Say how the effects change the FRFs, all together and each one when the others are there.

    Parameters
    ----------
    lines : Lines
        FRFs without the effects, and their noise.
    ideal, world : World
        Without scatter and effects; with both.

    Returns
    -------
    dict
        Part of the truth. A nonlinear law counts as nothing here: see `level_change`.
    """
    noise = np.linalg.norm(lines.sigma) / np.linalg.norm(lines.base)
    scatter = np.linalg.norm(ideal.measured_frf(lines.frequencies_hz) - lines.base) / np.linalg.norm(lines.base)
    result: dict[str, Any] = {"frf_noise": four(noise), "scatter_change": four(scatter)}
    if not world.effects:
        return result | {"frf_change": 0.0, "ratio_max": 0.0, "ratio_rms": 0.0}
    measured = world.measured_frf(lines.frequencies_hz)
    result |= change(lines, measured)
    if len(world.effects) > 1:
        result["each"] = []
        for i in range(len(world.effects)):
            others = world.effects[:i] + world.effects[i + 1 :]
            without = make_world(world.specimen, world.set_up, world.scatter, others)
            result["each"].append(change(lines, measured, without.measured_frf(lines.frequencies_hz)))
    return result


def describe(
    ideal: World, world: World, nominal: NominalModel, drives: tuple[Drive, ...], noise: tuple[Noise, ...]
) -> dict[str, Any]:
    """Write down all that is true about a case.

    Parameters
    ----------
    ideal, world : World
        Without scatter and effects; with both.
    nominal : NominalModel
        What the owner of the specimen has.
    drives : tuple of Drive
        Blows or records.
    noise : tuple of Noise
        Of the channels.

    Returns
    -------
    dict
        Without detectability.
    """
    effects = [_effect(effect) for effect in world.effects]
    single = effects[0] if len(effects) == 1 else {"effect": "pair" if effects else "null", "unknown_kind": None}
    return {
        **single,
        "location": single.get("location", {}),
        "parameters": single.get("parameters", {}),
        "effects": effects,
        "structure": _structure(ideal, world, nominal),
        "test": _test(world, drives),
        "noise": {
            "sigma": [four(one.rms) for one in noise],
            "bits": world.set_up.bits,
            "pink_fraction": four(noise[0].pink_fraction),
        },
        "scatter": {
            "gains": {column: four(gain) for column, gain in world.scatter.gains.items()},
            "offsets_m": {place: [four(x) for x in offset] for place, offset in world.scatter.offsets.items()},
            "cords_hz": four(world.scatter.cords_hz),
        },
        "accept_parameters": {},
        "equivalents": [],
    }


def _effect(effect: Effect) -> dict[str, Any]:
    return {
        "effect": effect.name,
        "unknown_kind": effect.kind,
        "location": dict(effect.location),
        "parameters": dict(effect.parameters),
        "nonlinear": not effect.is_linear,
    }


def _in_band(world: World) -> NDArray[np.bool_]:
    low, high = world.set_up.band_hz
    frequencies = world.modes.frequencies_hz
    return (frequencies >= low) & (frequencies <= high)


def _structure(ideal: World, world: World, nominal: NominalModel) -> dict[str, Any]:
    specimen, drawing = world.specimen, world.specimen.drawing
    inside = _in_band(ideal)
    coarse = solve_modes(nominal.structure()).frequencies_hz[: inside.size]
    truth = ideal.modes.frequencies_hz
    flexible = np.flatnonzero(inside)
    return {
        "kind": specimen.kind,
        "family": specimen.family,
        "name": specimen.name,
        "formulation": drawing.formulation if isinstance(drawing, BeamDrawing) else None,
        "nodes": len(nominal.nodes),
        "dofs": len(nominal.dofs),
        "in_band_modes": int(inside.sum()),
        "rigid_modes": nominal.n_rigid,
        "in_band_frequencies_hz": [four(f) for f in truth[inside]],
        "true_frequencies_hz": [float(f"{f:.6g}") for f in world.modes.frequencies_hz[_in_band(world)]],
        "nominal_frequency_error": four(np.abs(coarse[flexible] / truth[flexible] - 1).max()),
    }


def _test(world: World, drives: tuple[Drive, ...]) -> dict[str, Any]:
    set_up = world.set_up
    ratios = world.receptance.damping_ratio
    inside = np.flatnonzero(_in_band(world))
    largest = max(drive.blow.peak_n if drive.blow else drive.rms_n for drive in drives)
    return {
        "kind": set_up.kind,
        "band_hz": list(set_up.band_hz),
        "rate_hz": set_up.rate_hz,
        "samples": set_up.n_samples,
        "struck": [node for node, _ in set_up.struck],
        "sensors": [sensor.node for sensor in set_up.sensors],
        "points": list(set_up.points),
        "blows_each": set_up.blows_each,
        "quantity": set_up.sensors[0].quantity,
        "unit": set_up.sensors[0].unit,
        "nominal_damping": set_up.damping_ratio,
        "true_damping": [four(ratios[i]) for i in inside],
        "largest_force_N": four(largest),
        "level_spread": four(set_up.spread),
        "lead_samples": round(set_up.start_s * set_up.rate_hz),
        "largest_offset": four(set_up.offset),
        "in_one_file": set_up.in_one_file,
        "double_hits": [_name(drive, set_up) for drive in drives if drive.blow and drive.blow.rebound],
    }


def _name(drive: Drive, set_up: SetUp) -> str:
    return f"p{set_up.struck[drive.struck][0]}_{drive.order + 1:02d}"


def point_frfs(
    world: World, drives: tuple[Drive, ...], signals: FloatArray, points: FloatArray
) -> dict[str, NDArray[np.generic]]:
    """Compute true FRFs at the points of interest, for the struck nodes as the test file calls them.

    Parameters
    ----------
    world : World
        With the effects.
    drives : tuple of Drive
        Blows or records.
    signals, points : (n_drives, ..., n_samples) array
        Channels and points of interest without noise.

    Returns
    -------
    dict of str to array
        ``frequency_hz, output_dof, input_dof, real, imag`` on the lines of the band, in the sensors' quantity, SI.
        With a nonlinear law they are the averages over all blows, with a light exponential window.
    """
    set_up, direction = world.set_up, world.specimen.direction
    lines = set_up.lines_hz
    order = ORDERS[set_up.sensors[0].quantity]
    nonlinear = any(effect.law for effect in world.effects)
    columns: dict[str, list[NDArray[np.generic]]] = {
        name: [] for name in ("frequency_hz", "output_dof", "input_dof", "real", "imag")
    }
    for p, node in enumerate(set_up.points):
        for struck, (source, sign) in enumerate(set_up.struck):
            if nonlinear:
                mine = [i for i, drive in enumerate(drives) if drive.struck == struck]
                frf = sign * average_frf(points[mine, p], signals[mine, 0], set_up)
            else:
                frf = world.node_frf(lines, node, source, order)
            columns["frequency_hz"].append(lines)
            columns["output_dof"].append(np.full(lines.size, f"{node}:+{direction}"))
            columns["input_dof"].append(np.full(lines.size, f"{source}:+{direction}"))
            columns["real"].append(frf.real)
            columns["imag"].append(frf.imag)
    return {name: np.concatenate(parts) for name, parts in columns.items()} if set_up.points else {}


def average_frf(outputs: FloatArray, forces: FloatArray, set_up: SetUp) -> NDArray[np.complex128]:
    """Estimate FRFs over blows (H1) on the lines of the band, with a light exponential window on both.

    Parameters
    ----------
    outputs, forces : (n_blows, ..., n_samples) array
        Recordings.
    set_up : SetUp
        Their sampling.

    Returns
    -------
    (n_lines, ...) complex array
        In the units of the recordings.
    """
    window = np.exp(-2.0 * np.arange(set_up.n_samples) / set_up.n_samples)
    index = np.round(set_up.lines_hz * set_up.n_samples / set_up.rate_hz).astype(int)
    X, F = (np.fft.rfft(signals * window, axis=-1)[..., index] for signals in (outputs, forces))
    return np.moveaxis((X * F.conj()).sum(axis=0) / (np.abs(F) ** 2).sum(axis=0), -1, 0)
