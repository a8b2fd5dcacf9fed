"""Nonlinear effects: the last part of the contract's table. Sizes follow what the place does in the strongest blow."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from frf_testbench.simulator.effects.dissipative import spring_motion
from frf_testbench.simulator.effects.effect import Bench, Effect, Pair, log_uniform
from frf_testbench.simulator.signals.laws import Coulomb, Gap, PowerSpring
from frf_testbench.simulator.structures.frames import FrameDrawing

Draw = Callable[[np.random.Generator, Bench], Effect | None]


def draw_place(rng: np.random.Generator, bench: Bench) -> tuple[Pair, dict[str, object]]:
    """Draw a node that blows move, or a spring of a frame.

    Parameters
    ----------
    rng : Generator
        Of the case.
    bench : Bench
        The specimen on its test bench.

    Returns
    -------
    motion : Pair
        What the law feels.
    location : dict
        As in ``diagnosis.json``.
    """
    drawing = bench.specimen.drawing
    if isinstance(drawing, FrameDrawing) and rng.random() < 0.5:
        spring = drawing.springs[int(rng.integers(len(drawing.springs)))]
        return spring_motion(bench, spring.id), {"springs": [spring.id]}
    place: Pair | None = None
    while place is None or not bench.swing(place)[0]:  # members of a grid may be at rest while others move
        node = int(rng.choice(bench.nodes))
        place = bench.point(node), None
    return place, {"nodes": [node]}


def cubic_stiffness(rng: np.random.Generator, bench: Bench) -> Effect:
    """Draw a hardening cubic spring."""
    motion, location = draw_place(rng, bench)
    largest, _ = bench.swing(motion)
    cubic = log_uniform(rng, 0.1, 8) * bench.stiffness(motion) / largest**2
    return Effect(
        name="cubic_stiffness",
        location=location,
        parameters={"cubic_N_m3": cubic},
        law=PowerSpring(stiffness=cubic, power=3),
        law_motion=motion,
    )


def gap_contact(rng: np.random.Generator, bench: Bench) -> Effect:
    """Draw a stop that is touched in strong blows."""
    motion, location = draw_place(rng, bench)
    largest, _ = bench.swing(motion)
    gap = float(f"{largest * rng.uniform(0.08, 0.7):.4g}")
    stiffness = log_uniform(rng, 0.1, 20) * bench.stiffness(motion)
    return Effect(
        name="gap_contact",
        location=location,
        parameters={"gap_m": gap, "contact_stiffness_N_m": stiffness},
        law=Gap(stiffness=stiffness, gap=gap),
        law_motion=motion,
    )


def dry_friction(rng: np.random.Generator, bench: Bench) -> Effect:
    """Draw Coulomb friction."""
    motion, location = draw_place(rng, bench)
    largest, _ = bench.swing(motion)
    friction = log_uniform(rng, 3e-4, 0.02) * bench.stiffness(motion) * largest
    return Effect(
        name="dry_friction",
        location=location,
        parameters={"friction_N": friction},
        law=Coulomb(friction=friction),
        law_motion=motion,
    )


DRAWS: dict[str, Draw] = {draw.__name__: draw for draw in (cubic_stiffness, gap_contact, dry_friction)}
