"""Nonlinear effects: the last part of the contract's table. Sizes follow the motion of their location."""

from __future__ import annotations

import numpy as np

from frf_testbench.simulator.effects.dissipative import spring_extension
from frf_testbench.simulator.effects.effect import Draw, Effect, EffectTarget, draw_log_uniform
from frf_testbench.simulator.signals.laws import Coulomb, Gap, PowerSpring
from frf_testbench.simulator.structures.frames import FrameDrawing
from frf_testbench.simulator.structures.structure import Motion


def draw_law_location(rng: np.random.Generator, target: EffectTarget) -> tuple[Motion, dict[str, object]]:
    """Draw a node that the test moves, or a spring of a frame.

    Parameters
    ----------
    rng : Generator
        Of the case.
    target : EffectTarget
        The specimen in its test.

    Returns
    -------
    motion : Motion
        What the law acts on.
    location : dict
        As in ``diagnosis.json``.
    """
    drawing = target.specimen.drawing
    if isinstance(drawing, FrameDrawing) and rng.random() < 0.5:
        spring = drawing.springs[int(rng.integers(len(drawing.springs)))]
        return spring_extension(target, spring.id), {"springs": [spring.id]}
    motion: Motion | None = None
    while motion is None or not target.peak_motion(motion)[0]:  # members of a grid may be at rest while others move
        node = int(rng.choice(target.nodes))
        motion = target.point(node), None
    return motion, {"nodes": [node]}


def draw_cubic_stiffness(rng: np.random.Generator, target: EffectTarget) -> Effect:
    """Draw a hardening cubic spring."""
    motion, location = draw_law_location(rng, target)
    largest, _ = target.peak_motion(motion)
    cubic = draw_log_uniform(rng, 0.1, 8) * target.stiffness(motion) / largest**2
    return Effect(
        name="cubic_stiffness",
        location=location,
        parameters={"cubic_N_m3": cubic},
        law=PowerSpring(stiffness=cubic, power=3),
        law_motion=motion,
    )


def draw_gap_contact(rng: np.random.Generator, target: EffectTarget) -> Effect:
    """Draw a stop that is touched in strong records."""
    motion, location = draw_law_location(rng, target)
    largest, _ = target.peak_motion(motion)
    gap = float(f"{largest * rng.uniform(0.08, 0.7):.4g}")
    stiffness = draw_log_uniform(rng, 0.1, 20) * target.stiffness(motion)
    return Effect(
        name="gap_contact",
        location=location,
        parameters={"gap_m": gap, "contact_stiffness_N_m": stiffness},
        law=Gap(stiffness=stiffness, gap=gap),
        law_motion=motion,
    )


def draw_dry_friction(rng: np.random.Generator, target: EffectTarget) -> Effect:
    """Draw Coulomb friction."""
    motion, location = draw_law_location(rng, target)
    largest, _ = target.peak_motion(motion)
    friction = draw_log_uniform(rng, 3e-4, 0.02) * target.stiffness(motion) * largest
    return Effect(
        name="dry_friction",
        location=location,
        parameters={"friction_N": friction},
        law=Coulomb(friction=friction),
        law_motion=motion,
    )


DRAWS: dict[str, Draw] = {
    draw.__name__.removeprefix("draw_"): draw for draw in (draw_cubic_stiffness, draw_gap_contact, draw_dry_friction)
}
