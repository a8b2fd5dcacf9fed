"""Effects outside the contract's table: what a diagnosis has to call unexplained."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from frf_testbench.simulator.effects import outside_laws
from frf_testbench.simulator.effects.effect import Bench, Effect, Mount, Pair, constant, log_uniform
from frf_testbench.simulator.structures.beams import BeamDrawing
from frf_testbench.simulator.structures.points import Point
from frf_testbench.simulator.structures.reality import Extra

Draw = Callable[[np.random.Generator, Bench], Effect | None]
ComplexArray = NDArray[np.complex128]


def _two_motions(rng: np.random.Generator, bench: Bench) -> tuple[list[int], tuple[Pair, Pair]] | None:
    if len(bench.nodes) < 4:
        return None
    nodes = sorted(int(node) for node in rng.choice(np.array(bench.nodes), 2, replace=False))
    return nodes, ((bench.point(nodes[0]), None), (bench.point(nodes[1]), None))


def skew(rng: np.random.Generator, bench: Bench) -> Effect | None:
    """Draw a gyroscopic coupling of two nodes: forces g v2 and -g v1."""
    places = _two_motions(rng, bench)
    if places is None:
        return None
    nodes, motions = places
    strength = log_uniform(rng, 3, 60) * np.sqrt(bench.damping(motions[0]) * bench.damping(motions[1]))
    return Effect(
        name="unknown",
        kind="skew",
        location={"nodes": nodes},
        parameters={"skew_Ns_m": strength},
        mounts=(Mount(motions=motions, stiffness=constant([[0, strength], [-strength, 0]], lambda s: s)),),
    )


def resonator_chain(rng: np.random.Generator, bench: Bench) -> Effect:
    """Draw two masses on springs in a row, hung on a node: two resonances in the band."""
    node = int(rng.choice(bench.nodes))
    low, high = bench.set_up.band_hz
    mass = log_uniform(rng, 4e-3, 0.04) * bench.mass_kg
    omega = 2 * np.pi * log_uniform(rng, 1.5 * low, 0.6 * high)
    ratio, share = log_uniform(rng, 0.005, 0.04), float(rng.uniform(0.4, 1.0))
    stiffness, damping = mass * omega**2, 2 * ratio * mass * omega

    def dynamic(s: ComplexArray) -> ComplexArray:
        link = stiffness + damping * s
        inner = link * share * mass * s**2 / (link + share * mass * s**2) + mass * s**2
        return link * inner / (link + inner)

    return Effect(
        name="unknown",
        kind="resonator_chain",
        location={"nodes": [node]},
        parameters={"mass_kg": mass, "frequency_hz": omega / (2 * np.pi), "second_over_first": share},
        mounts=(Mount(motions=((bench.point(node), None),), stiffness=constant([[1.0]], dynamic)),),
    )


def fractional_damper(rng: np.random.Generator, bench: Bench) -> Effect:
    """Draw a springpot between a node and the ground: force c s^a, a between spring and damper."""
    node = int(rng.choice(bench.nodes))
    motion = (bench.point(node), None)
    order = float(rng.uniform(0.3, 0.7))
    middle = 2 * np.pi * np.sqrt(np.prod(bench.set_up.band_hz))
    stiffness = log_uniform(rng, 0.05, 1) * bench.stiffness(motion)
    return Effect(
        name="unknown",
        kind="fractional_damper",
        location={"nodes": [node]},
        parameters={"stiffness_N_m": stiffness, "order": order},
        mounts=(Mount(motions=(motion,), stiffness=constant([[stiffness]], lambda s: (s / middle) ** order)),),
    )


def damped_patch(rng: np.random.Generator, bench: Bench) -> Effect | None:
    """Draw dampers between neighbours over a part of the structure: damping that is not proportional."""
    nodes = list(bench.nodes)
    count = min(8, len(nodes) // 2)
    if count < 3:
        return None
    start = int(rng.integers(0, len(nodes) - count))
    patch = nodes[start : start + count]
    motions = tuple((bench.point(b), bench.point(a)) for a, b in pairwise(patch))
    weakest = min(bench.damping(motion) for motion in motions)
    damping = log_uniform(rng, 0.5, 10) * weakest / len(motions)
    return Effect(
        name="unknown",
        kind="damped_patch",
        location={"nodes": patch},
        parameters={"damping_Ns_m": damping},
        mounts=(Mount(motions=motions, stiffness=constant(damping * np.eye(len(motions)), lambda s: s)),),
    )


def rotary_inertia(rng: np.random.Generator, bench: Bench) -> Effect | None:
    """Draw a body with rotary inertia, and hardly any mass, on a beam."""
    drawing = bench.specimen.drawing
    if not isinstance(drawing, BeamDrawing):
        return None
    node = int(rng.choice(bench.nodes))
    inertia = log_uniform(rng, 3e-5, 3e-3) * bench.mass_kg * drawing.length_m**2
    extra = Extra(point=Point(node, "ry"), mass=inertia)
    return Effect(
        name="unknown",
        kind="rotary_inertia",
        location={"nodes": [node]},
        parameters={"rotary_inertia_kgm2": inertia},
        change=lambda reality: replace(reality, extras=(*reality.extras, extra)),
    )


def delayed_feedback(rng: np.random.Generator, bench: Bench) -> Effect:
    """Draw an actuator that answers the motion of its node too late."""
    node = int(rng.choice(bench.nodes))
    motion = (bench.point(node), None)
    delay = float(rng.uniform(0.15, 0.5) / bench.set_up.band_hz[1])
    # a late spring takes damping away: the modes of the band must keep most of theirs
    shapes, omega = bench.shapes(motion)[bench.in_band], bench.modes.omega_rad_s[bench.in_band]
    steal = (shapes**2 * np.abs(np.sin(omega * delay)) / omega**2).max()
    stiffness = log_uniform(rng, 0.1, 0.7) * 2 * 0.7 * bench.set_up.damping_ratio / steal
    return Effect(
        name="unknown",
        kind="delayed_feedback",
        location={"nodes": [node]},
        parameters={"stiffness_N_m": -stiffness, "delay_s": delay},
        mounts=(Mount(motions=(motion,), stiffness=constant([[-stiffness]], lambda s: np.exp(-s * delay))),),
    )


def mounted_resonance(rng: np.random.Generator, bench: Bench) -> Effect:
    """Draw a sensor on a soft mount: a second-order resonance of its channel within or near the band."""
    sensor = bench.set_up.sensors[int(rng.integers(len(bench.set_up.sensors)))]
    frequency = log_uniform(rng, 0.5, 2.0) * bench.set_up.band_hz[1]
    omega, ratio = 2 * np.pi * frequency, log_uniform(rng, 0.01, 0.1)
    return Effect(
        name="unknown",
        kind="mounted_resonance",
        location={"channels": [sensor.column]},
        parameters={"frequency_hz": frequency, "damping_ratio": ratio},
        gains={sensor.column: lambda s: (omega**2 + 2 * ratio * omega * s) / (s**2 + 2 * ratio * omega * s + omega**2)},
    )


def crosstalk(rng: np.random.Generator, bench: Bench) -> Effect | None:
    """Draw a channel that leaks into another one."""
    sensors = bench.set_up.sensors
    if len(sensors) < 2:
        return None
    first, second = (sensors[i].column for i in rng.permutation(len(sensors))[:2])
    factor = float(rng.choice([-1, 1])) * log_uniform(rng, 0.03, 0.4)
    return Effect(
        name="unknown",
        kind="crosstalk",
        location={"channels": [first, second]},
        parameters={"factor": factor},
        crosstalk=((first, second, factor),),
    )


def drifting_stiffness(rng: np.random.Generator, bench: Bench) -> Effect:
    """Draw a structure that warms up: all frequencies drift from blow to blow."""
    del bench
    drift = float(rng.choice([-1, 1])) * log_uniform(rng, 0.003, 0.03)
    return Effect(name="unknown", kind="drifting_stiffness", parameters={"frequency_drift": drift}, drift=drift)


def saturating_amplifier(rng: np.random.Generator, bench: Bench) -> Effect:
    """Draw a channel whose amplifier bends softly at high levels."""
    sensor = bench.set_up.sensors[int(rng.integers(len(bench.set_up.sensors)))]
    level = log_uniform(rng, 0.3, 2.0)
    return Effect(
        name="unknown",
        kind="saturating_amplifier",
        location={"channels": [sensor.column]},
        parameters={"level_over_peak": level},
        saturation={sensor.column: level},
    )


DRAWS: dict[str, Draw] = {
    draw.__name__: draw
    for draw in (
        skew, resonator_chain, fractional_damper, damped_patch, rotary_inertia, delayed_feedback, mounted_resonance,
        crosstalk, drifting_stiffness, saturating_amplifier,
    )
} | outside_laws.DRAWS  # fmt: skip
NONLINEAR = (*outside_laws.DRAWS, "saturating_amplifier")
