"""Effects outside the contract's table, linear and not: what a diagnosis has to call unexplained."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from frf_testbench.simulator.effects.effect import (
    Draw,
    Effect,
    EffectTarget,
    Mount,
    draw_log_uniform,
    make_dynamic_stiffness,
)
from frf_testbench.simulator.effects.nonlinear import draw_law_location
from frf_testbench.simulator.signals.laws import BoucWen, Law, PowerSpring, SquareDrag, TwoSided
from frf_testbench.simulator.structures.beams import BeamDrawing
from frf_testbench.simulator.structures.reality import Extra
from frf_testbench.simulator.structures.structure import Motion, Point

ComplexArray = NDArray[np.complex128]


def _draw_two_motions(rng: np.random.Generator, target: EffectTarget) -> tuple[list[int], tuple[Motion, Motion]] | None:
    if len(target.nodes) < 4:
        return None
    nodes = sorted(int(node) for node in rng.choice(np.array(target.nodes), 2, replace=False))
    return nodes, ((target.point(nodes[0]), None), (target.point(nodes[1]), None))


def draw_skew(rng: np.random.Generator, target: EffectTarget) -> Effect | None:
    """Draw a gyroscopic coupling of two nodes: forces g v2 and -g v1."""
    locations = _draw_two_motions(rng, target)
    if locations is None:
        return None
    nodes, motions = locations
    strength = draw_log_uniform(rng, 3, 60) * np.sqrt(target.damping(motions[0]) * target.damping(motions[1]))
    return Effect(
        name="unknown",
        kind="skew",
        location={"nodes": nodes},
        parameters={"skew_Ns_m": strength},
        mounts=(
            Mount(motions=motions, stiffness=make_dynamic_stiffness([[0, strength], [-strength, 0]], lambda s: s)),
        ),
    )


def draw_resonator_chain(rng: np.random.Generator, target: EffectTarget) -> Effect:
    """Draw two masses on springs in a row, hung on a node: two resonances in the band."""
    node = int(rng.choice(target.nodes))
    low, high = target.set_up.band_hz
    mass = draw_log_uniform(rng, 4e-3, 0.04) * target.mass_kg
    omega = 2 * np.pi * draw_log_uniform(rng, 1.5 * low, 0.6 * high)
    ratio, share = draw_log_uniform(rng, 0.005, 0.04), float(rng.uniform(0.4, 1.0))
    stiffness, damping = mass * omega**2, 2 * ratio * mass * omega

    def dynamic(s: ComplexArray) -> ComplexArray:
        link = stiffness + damping * s
        inner = link * share * mass * s**2 / (link + share * mass * s**2) + mass * s**2
        return np.asarray(link * inner / (link + inner))

    return Effect(
        name="unknown",
        kind="resonator_chain",
        location={"nodes": [node]},
        parameters={"mass_kg": mass, "frequency_hz": omega / (2 * np.pi), "second_over_first": share},
        mounts=(Mount(motions=((target.point(node), None),), stiffness=make_dynamic_stiffness([[1.0]], dynamic)),),
    )


def draw_fractional_damper(rng: np.random.Generator, target: EffectTarget) -> Effect:
    """Draw a springpot between a node and the ground: force c s^a, a between spring and damper."""
    node = int(rng.choice(target.nodes))
    motion = (target.point(node), None)
    order = float(rng.uniform(0.3, 0.7))
    middle = 2 * np.pi * np.sqrt(np.prod(target.set_up.band_hz))
    stiffness = draw_log_uniform(rng, 0.05, 1) * target.stiffness(motion)
    return Effect(
        name="unknown",
        kind="fractional_damper",
        location={"nodes": [node]},
        parameters={"stiffness_N_m": stiffness, "order": order},
        mounts=(
            Mount(motions=(motion,), stiffness=make_dynamic_stiffness([[stiffness]], lambda s: (s / middle) ** order)),
        ),
    )


def draw_damped_patch(rng: np.random.Generator, target: EffectTarget) -> Effect | None:
    """Draw dampers between neighbours over a part of the structure: damping that is not proportional."""
    nodes = list(target.nodes)
    count = min(8, len(nodes) // 2)
    if count < 3:
        return None
    start = int(rng.integers(0, len(nodes) - count))
    patch = nodes[start : start + count]
    motions = tuple((target.point(b), target.point(a)) for a, b in pairwise(patch))
    weakest = min(target.damping(motion) for motion in motions)
    damping = draw_log_uniform(rng, 0.5, 10) * weakest / len(motions)
    return Effect(
        name="unknown",
        kind="damped_patch",
        location={"nodes": patch},
        parameters={"damping_Ns_m": damping},
        mounts=(Mount(motions=motions, stiffness=make_dynamic_stiffness(damping * np.eye(len(motions)), lambda s: s)),),
    )


def draw_rotary_inertia(rng: np.random.Generator, target: EffectTarget) -> Effect | None:
    """Draw a body with rotary inertia, and hardly any mass, on a beam."""
    drawing = target.specimen.drawing
    if not isinstance(drawing, BeamDrawing):
        return None
    node = int(rng.choice(target.nodes))
    inertia = draw_log_uniform(rng, 3e-5, 3e-3) * target.mass_kg * drawing.length_m**2
    extra = Extra(point=Point(node, "ry"), mass=inertia)
    return Effect(
        name="unknown",
        kind="rotary_inertia",
        location={"nodes": [node]},
        parameters={"rotary_inertia_kgm2": inertia},
        change_reality=lambda reality: replace(reality, extras=(*reality.extras, extra)),
    )


def draw_delayed_feedback(rng: np.random.Generator, target: EffectTarget) -> Effect:
    """Draw an actuator that answers the motion of its node too late."""
    node = int(rng.choice(target.nodes))
    motion = (target.point(node), None)
    delay = float(rng.uniform(0.15, 0.5) / target.set_up.band_hz[1])
    # a late spring takes damping away: the modes of the band must keep most of theirs
    shapes, omega = target.shapes(motion)[target.in_band], target.modes.omega_rad_s[target.in_band]
    lost_damping = (shapes**2 * np.abs(np.sin(omega * delay)) / omega**2).max()
    stiffness = draw_log_uniform(rng, 0.1, 0.7) * 2 * 0.7 * target.set_up.damping_ratio / lost_damping
    return Effect(
        name="unknown",
        kind="delayed_feedback",
        location={"nodes": [node]},
        parameters={"stiffness_N_m": -stiffness, "delay_s": delay},
        mounts=(
            Mount(motions=(motion,), stiffness=make_dynamic_stiffness([[-stiffness]], lambda s: np.exp(-s * delay))),
        ),
    )


def draw_mounted_resonance(rng: np.random.Generator, target: EffectTarget) -> Effect:
    """Draw a sensor on a soft mount: a second-order resonance of its channel within or near the band."""
    sensor = target.set_up.sensors[int(rng.integers(len(target.set_up.sensors)))]
    frequency = draw_log_uniform(rng, 0.5, 2.0) * target.set_up.band_hz[1]
    omega, ratio = 2 * np.pi * frequency, draw_log_uniform(rng, 0.01, 0.1)
    return Effect(
        name="unknown",
        kind="mounted_resonance",
        location={"channels": [sensor.column]},
        parameters={"frequency_hz": frequency, "damping_ratio": ratio},
        gains={sensor.column: lambda s: (omega**2 + 2 * ratio * omega * s) / (s**2 + 2 * ratio * omega * s + omega**2)},
    )


def draw_crosstalk(rng: np.random.Generator, target: EffectTarget) -> Effect | None:
    """Draw a channel that leaks into another one."""
    sensors = target.set_up.sensors
    if len(sensors) < 2:
        return None
    first, second = (sensors[i].column for i in rng.permutation(len(sensors))[:2])
    factor = float(rng.choice([-1, 1])) * draw_log_uniform(rng, 0.03, 0.4)
    return Effect(
        name="unknown",
        kind="crosstalk",
        location={"channels": [first, second]},
        parameters={"factor": factor},
        crosstalk=((first, second, factor),),
    )


def draw_drifting_stiffness(rng: np.random.Generator, target: EffectTarget) -> Effect:
    """Draw a structure that warms up: all frequencies drift from record to record."""
    del target
    drift = float(rng.choice([-1, 1])) * draw_log_uniform(rng, 0.003, 0.03)
    return Effect(name="unknown", kind="drifting_stiffness", parameters={"frequency_drift": drift}, drift=drift)


def draw_saturating_amplifier(rng: np.random.Generator, target: EffectTarget) -> Effect:
    """Draw a channel whose amplifier bends softly at high levels."""
    sensor = target.set_up.sensors[int(rng.integers(len(target.set_up.sensors)))]
    level = draw_log_uniform(rng, 0.3, 2.0)
    return Effect(
        name="unknown",
        kind="saturating_amplifier",
        location={"channels": [sensor.column]},
        parameters={"level_over_peak": level},
        saturation={sensor.column: level},
    )


def draw_quadratic_spring(rng: np.random.Generator, target: EffectTarget) -> Effect:
    """Draw a spring that hardens one way and softens the other."""
    motion, location = draw_law_location(rng, target)
    largest, _ = target.peak_motion(motion)
    stiffness = draw_log_uniform(rng, 0.05, 0.3) * target.stiffness(motion) / largest
    law = PowerSpring(stiffness=stiffness, power=2)
    return _make_unknown_law("quadratic_spring", location, {"quadratic_N_m2": stiffness}, law, motion)


def draw_quintic_spring(rng: np.random.Generator, target: EffectTarget) -> Effect:
    """Draw a spring of fifth order."""
    motion, location = draw_law_location(rng, target)
    largest, _ = target.peak_motion(motion)
    stiffness = draw_log_uniform(rng, 0.5, 20) * target.stiffness(motion) / largest**4
    law = PowerSpring(stiffness=stiffness, power=5)
    return _make_unknown_law("quintic_spring", location, {"quintic_N_m5": stiffness}, law, motion)


def draw_two_sided_stop(rng: np.random.Generator, target: EffectTarget) -> Effect:
    """Draw stops on both sides: a piecewise linear spring."""
    motion, location = draw_law_location(rng, target)
    largest, _ = target.peak_motion(motion)
    gap, stiffness = float(largest * rng.uniform(0.08, 0.5)), draw_log_uniform(rng, 0.1, 10) * target.stiffness(motion)
    law = TwoSided(stiffness=stiffness, gap=gap)
    return _make_unknown_law("two_sided_stop", location, {"gap_m": gap, "stiffness_N_m": stiffness}, law, motion)


def draw_square_drag(rng: np.random.Generator, target: EffectTarget) -> Effect:
    """Draw damping that grows with the square of the velocity."""
    motion, location = draw_law_location(rng, target)
    _, fastest = target.peak_motion(motion)
    drag = draw_log_uniform(rng, 3, 60) * target.damping(motion) / fastest
    return _make_unknown_law("square_drag", location, {"drag_Ns2_m2": drag}, SquareDrag(drag=drag), motion)


def draw_bouc_wen(rng: np.random.Generator, target: EffectTarget) -> Effect:
    """Draw a joint that slips gradually."""
    motion, location = draw_law_location(rng, target)
    largest, _ = target.peak_motion(motion)
    stiffness, limit = (
        draw_log_uniform(rng, 0.05, 1) * target.stiffness(motion),
        float(largest * rng.uniform(0.05, 0.4)),
    )
    law = BoucWen(stiffness=stiffness, yield_m=limit)
    return _make_unknown_law("bouc_wen", location, {"stiffness_N_m": stiffness, "yield_m": limit}, law, motion)


def _make_unknown_law(
    kind: str, location: dict[str, object], parameters: dict[str, float], law: Law, motion: Motion
) -> Effect:
    return Effect(name="unknown", kind=kind, location=location, parameters=parameters, law=law, law_motion=motion)


LAWS: dict[str, Draw] = {
    draw.__name__.removeprefix("draw_"): draw
    for draw in (draw_quadratic_spring, draw_quintic_spring, draw_two_sided_stop, draw_square_drag, draw_bouc_wen)
}
DRAWS: dict[str, Draw] = {
    draw.__name__.removeprefix("draw_"): draw
    for draw in (
        draw_skew, draw_resonator_chain, draw_fractional_damper, draw_damped_patch, draw_rotary_inertia,
        draw_delayed_feedback, draw_mounted_resonance, draw_crosstalk, draw_drifting_stiffness,
        draw_saturating_amplifier,
    )
} | LAWS  # fmt: skip
NONLINEAR = (*LAWS, "saturating_amplifier")
