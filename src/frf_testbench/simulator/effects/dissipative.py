"""Effects on damping: the middle of the contract's table."""

from __future__ import annotations

import numpy as np

from frf_testbench.simulator.effects.effect import (
    ComplexArray,
    Draw,
    Effect,
    EffectTarget,
    Gain,
    Mount,
    draw_log_uniform,
    make_dynamic_stiffness,
)
from frf_testbench.simulator.structures.beams import BeamDrawing
from frf_testbench.simulator.structures.frames import FrameDrawing
from frf_testbench.simulator.structures.structure import Motion, Point

RATE_MARGIN, RATE_STEP = 1000.0, 0.5  # rates from below to above the band by this factor, and logarithmic steps


def draw_damping_level(rng: np.random.Generator, target: EffectTarget) -> Effect:
    """Draw another ratio of all modes."""
    factor = draw_log_uniform(rng, 1.6, 8) if rng.random() < 0.75 else 1 / draw_log_uniform(rng, 2, 4)
    ratio = float(f"{factor * target.set_up.damping_ratio:.3g}")
    return Effect(
        name="damping_level",
        parameters={"modal_ratio": ratio},
        damping_factor=ratio / target.set_up.damping_ratio,
    )


def draw_local_damper(rng: np.random.Generator, target: EffectTarget) -> Effect:
    """Draw a damper between a node and the ground."""
    node = int(rng.choice(target.nodes))
    motion = (target.point(node), None)
    damping = draw_log_uniform(rng, 0.15, 15) * target.damping(motion)
    return Effect(
        name="local_damper",
        location={"nodes": [node]},
        parameters={"damping_Ns_m": damping},
        mounts=(Mount(motions=(motion,), stiffness=make_dynamic_stiffness([[damping]], lambda s: s)),),
    )


def draw_structural_damping(rng: np.random.Generator, target: EffectTarget) -> Effect:
    """Draw a loss factor of the stiffness matrix."""
    loss = draw_log_uniform(rng, 1.5, 15) * target.set_up.damping_ratio
    modulus = make_lossy_modulus(loss, target.set_up.band_hz)
    return Effect(name="structural_damping", parameters={"loss_factor": loss}, modulus=modulus)


def make_lossy_modulus(loss: float, band_hz: tuple[float, float]) -> Gain:
    """Build a stiffness with the same loss factor at all frequencies from standard solids, so that it is causal.

    Parameters
    ----------
    loss : float
        Loss factor.
    band_hz : (low, high)
        In its middle the stiffness is the nominal one.

    Returns
    -------
    callable
        Stiffness at `s` over the nominal one.
    """
    low, high = (2 * np.pi * edge for edge in band_hz)
    slope = 2 / np.pi * np.arctan(loss)
    logs = np.arange(np.log(low / RATE_MARGIN), np.log(high * RATE_MARGIN), RATE_STEP)
    rates = np.exp(logs) / np.sqrt(low * high)
    strengths = np.sin(np.pi * slope) / np.pi * RATE_STEP * rates**slope
    slowest = np.sin(np.pi * slope) / (np.pi * slope) * np.exp(-slope * RATE_STEP / 2) * rates[0] ** slope

    def stiffness(s: ComplexArray) -> ComplexArray:
        s = s / np.sqrt(low * high)
        return np.asarray(slowest + sum(k * s / (s + rate) for k, rate in zip(strengths, rates, strict=True)))

    middle = stiffness(np.array([1j * np.sqrt(low * high)]))[0].real
    return lambda s: stiffness(s) / middle


def draw_viscoelastic_joint(rng: np.random.Generator, target: EffectTarget) -> Effect:
    """Draw a joint that relaxes: between a node and the ground, across a spring, or on the rotation of a pinned end."""
    low, high = target.set_up.band_hz
    relaxation = 1 / (2 * np.pi * draw_log_uniform(rng, 1.2 * low, 0.9 * high))
    motion, location, name = _draw_joint_location(rng, target)
    stiffness = draw_log_uniform(rng, 0.02, 2) * target.stiffness(motion)
    return Effect(
        name="viscoelastic_joint",
        location=location,
        parameters={name: stiffness, "relaxation_time_s": relaxation},
        mounts=(
            Mount(
                motions=(motion,),
                stiffness=make_dynamic_stiffness([[stiffness]], lambda s: s * relaxation / (1 + s * relaxation)),
            ),
        ),
    )


def _draw_joint_location(rng: np.random.Generator, target: EffectTarget) -> tuple[Motion, dict[str, object], str]:
    drawing = target.specimen.drawing
    if isinstance(drawing, BeamDrawing):
        pinned = [end for end in ("left", "right") if getattr(drawing, end) == "pinned"]
        if pinned and rng.random() < 0.6:
            end = str(rng.choice(pinned))
            node = 1 if end == "left" else drawing.elements + 1
            return (Point(node, "ry"), None), {"end": end, "nodes": [node]}, "rotational_stiffness_Nm_rad"
    if isinstance(drawing, FrameDrawing) and rng.random() < 0.6:
        spring = drawing.springs[int(rng.integers(len(drawing.springs)))]
        return spring_extension(target, spring.id), {"springs": [spring.id]}, "stiffness_N_m"
    node = int(rng.choice(target.nodes))
    return (target.point(node), None), {"nodes": [node]}, "stiffness_N_m"


def spring_extension(target: EffectTarget, spring_id: str) -> Motion:
    """Return the extension of a spring of a frame: the second node minus the first."""
    drawing = target.specimen.drawing
    if not isinstance(drawing, FrameDrawing):
        raise TypeError(f"springs are parts of frames, not of a {type(drawing).__name__}")
    first, second = (target.point(node) for node in drawing.spring(spring_id).nodes)
    return second, first


DRAWS: dict[str, Draw] = {
    draw.__name__.removeprefix("draw_"): draw
    for draw in (draw_damping_level, draw_local_damper, draw_structural_damping, draw_viscoelastic_joint)
}
