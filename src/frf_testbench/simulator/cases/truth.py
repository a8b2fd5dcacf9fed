"""The sealed answer to a case."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from frf_testbench.simulator.cases.detectability import round_to_four_digits
from frf_testbench.simulator.cases.records import Excitation
from frf_testbench.simulator.cases.system import TrueSystem
from frf_testbench.simulator.effects.effect import Effect
from frf_testbench.simulator.set_up import ORDERS, SetUp
from frf_testbench.simulator.signals.channels import Noise
from frf_testbench.simulator.signals.receptance import solve_modes
from frf_testbench.simulator.structures.beams import BeamDrawing
from frf_testbench.simulator.structures.nominal import NominalModel

FloatArray = NDArray[np.float64]

GENERATOR = "frf_ipz simulator 3"


def describe_case(
    ideal_system: TrueSystem,
    system: TrueSystem,
    nominal_model: NominalModel,
    excitations: tuple[Excitation, ...],
    noise: tuple[Noise, ...],
) -> dict[str, Any]:
    """Write down all that is true about a case.

    Parameters
    ----------
    ideal_system, system : TrueSystem
        Without scatter and effects; with both.
    nominal_model : NominalModel
        What the owner of the specimen has.
    excitations : tuple of Excitation
        Of all records.
    noise : tuple of Noise
        Of the channels.

    Returns
    -------
    dict
        Without detectability.
    """
    effects = [_describe_effect(effect) for effect in system.effects]
    single = effects[0] if len(effects) == 1 else {"effect": "pair" if effects else "null", "unknown_kind": None}
    return {
        **single,
        "location": single.get("location", {}),
        "parameters": single.get("parameters", {}),
        "effects": effects,
        "structure": _describe_structure(ideal_system, system, nominal_model),
        "test": _describe_test(system, excitations),
        "noise": {
            "sigma": [round_to_four_digits(channel.rms) for channel in noise],
            "bits": system.set_up.bits,
            "pink_fraction": round_to_four_digits(noise[0].pink_fraction),
        },
        "scatter": {
            "gains": {column: round_to_four_digits(gain) for column, gain in system.scatter.gains.items()},
            "offsets_m": {
                point: [round_to_four_digits(x) for x in offset] for point, offset in system.scatter.offsets.items()
            },
            "suspension_hz": round_to_four_digits(system.scatter.suspension_hz),
        },
        "accept_parameters": {},
        "equivalents": [],
    }


def _describe_effect(effect: Effect) -> dict[str, Any]:
    return {
        "effect": effect.name,
        "unknown_kind": effect.kind,
        "location": dict(effect.location),
        "parameters": dict(effect.parameters),
        "nonlinear": not effect.is_linear,
    }


def _in_band(system: TrueSystem) -> NDArray[np.bool_]:
    low, high = system.set_up.band_hz
    frequencies = system.modes.frequencies_hz
    return (frequencies >= low) & (frequencies <= high)


def _describe_structure(ideal_system: TrueSystem, system: TrueSystem, nominal_model: NominalModel) -> dict[str, Any]:
    specimen, drawing = system.specimen, system.specimen.drawing
    inside = _in_band(ideal_system)
    nominal_hz = solve_modes(nominal_model.structure()).frequencies_hz[: inside.size]
    true_hz = ideal_system.modes.frequencies_hz
    flexible = np.flatnonzero(inside)
    return {
        "kind": specimen.kind,
        "family": specimen.family,
        "name": specimen.name,
        "formulation": drawing.formulation if isinstance(drawing, BeamDrawing) else None,
        "nodes": len(nominal_model.nodes),
        "dofs": len(nominal_model.dofs),
        "in_band_modes": int(inside.sum()),
        "rigid_modes": nominal_model.n_rigid,
        "in_band_frequencies_hz": [round_to_four_digits(f) for f in true_hz[inside]],
        "true_frequencies_hz": [float(f"{f:.6g}") for f in system.modes.frequencies_hz[_in_band(system)]],
        "nominal_frequency_error": round_to_four_digits(np.abs(nominal_hz[flexible] / true_hz[flexible] - 1).max()),
    }


def _describe_test(system: TrueSystem, excitations: tuple[Excitation, ...]) -> dict[str, Any]:
    set_up = system.set_up
    ratios = system.receptance.damping_ratio
    inside = np.flatnonzero(_in_band(system))
    largest = max(excitation.impact.peak_n if excitation.impact else excitation.rms_n for excitation in excitations)
    return {
        "kind": set_up.kind,
        "band_hz": list(set_up.band_hz),
        "rate_hz": set_up.rate_hz,
        "samples": set_up.n_samples,
        "struck": [node for node, _ in set_up.excited_points],
        "sensors": [sensor.node for sensor in set_up.sensors],
        "points": list(set_up.points),
        "records_each": set_up.records_each,
        "quantity": set_up.sensors[0].quantity,
        "unit": set_up.sensors[0].unit,
        "nominal_damping": set_up.damping_ratio,
        "true_damping": [round_to_four_digits(ratios[i]) for i in inside],
        "largest_force_N": round_to_four_digits(largest),
        "level_spread": round_to_four_digits(set_up.spread),
        "lead_samples": round(set_up.start_s * set_up.rate_hz),
        "largest_offset": round_to_four_digits(set_up.dc_offset),
        "in_one_file": set_up.in_one_file,
        "double_hits": [
            _name_record(excitation, set_up)
            for excitation in excitations
            if excitation.impact and excitation.impact.rebound
        ],
    }


def _name_record(excitation: Excitation, set_up: SetUp) -> str:
    return f"p{set_up.excited_points[excitation.point][0]}_{excitation.order + 1:02d}"


def compute_point_frfs(
    system: TrueSystem, excitations: tuple[Excitation, ...], signals: FloatArray, points: FloatArray
) -> dict[str, NDArray[np.generic]]:
    """Compute true FRFs at the points of interest, for the excited nodes as the test file calls them.

    Parameters
    ----------
    system : TrueSystem
        With the effects.
    excitations : tuple of Excitation
        Of all records.
    signals, points : (n_records, ..., n_samples) array
        Channels and points of interest without noise.

    Returns
    -------
    dict of str to array
        ``frequency_hz, output_dof, input_dof, real, imag`` on the lines of the band, in the sensors' quantity, SI.
        With a nonlinear law they are the averages over all records, with a light exponential window.
    """
    set_up, direction = system.set_up, system.specimen.direction
    lines = set_up.lines_hz
    order = ORDERS[set_up.sensors[0].quantity]
    nonlinear = any(effect.law for effect in system.effects)
    columns: dict[str, list[NDArray[np.generic]]] = {
        name: [] for name in ("frequency_hz", "output_dof", "input_dof", "real", "imag")
    }
    for p, node in enumerate(set_up.points):
        for point, (source, sign) in enumerate(set_up.excited_points):
            if nonlinear:
                records = [i for i, excitation in enumerate(excitations) if excitation.point == point]
                frf = sign * estimate_frf(points[records, p], signals[records, 0], set_up)
            else:
                frf = system.node_frf(lines, node, source, order)
            columns["frequency_hz"].append(lines)
            columns["output_dof"].append(np.full(lines.size, f"{node}:+{direction}"))
            columns["input_dof"].append(np.full(lines.size, f"{source}:+{direction}"))
            columns["real"].append(frf.real)
            columns["imag"].append(frf.imag)
    return {name: np.concatenate(parts) for name, parts in columns.items()} if set_up.points else {}


def estimate_frf(outputs: FloatArray, forces: FloatArray, set_up: SetUp) -> NDArray[np.complex128]:
    """Estimate FRFs over records (H1) on the lines of the band, with a light exponential window on both.

    Parameters
    ----------
    outputs, forces : (n_records, ..., n_samples) array
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
