"""Nonlinear laws outside the contract's table, at a node or across a spring."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from frf_testbench.simulator.effects.effect import Bench, Effect, Pair, log_uniform
from frf_testbench.simulator.effects.nonlinear import draw_place
from frf_testbench.simulator.signals.laws import BoucWen, PowerSpring, SquareDrag, TwoSided

Draw = Callable[[np.random.Generator, Bench], Effect]


def quadratic_spring(rng: np.random.Generator, bench: Bench) -> Effect:
    """Draw a spring that hardens one way and softens the other."""
    motion, location = draw_place(rng, bench)
    largest, _ = bench.swing(motion)
    stiffness = log_uniform(rng, 0.05, 0.3) * bench.stiffness(motion) / largest
    law = PowerSpring(stiffness=stiffness, power=2)
    return _unknown_law("quadratic_spring", location, {"quadratic_N_m2": stiffness}, law, motion)


def quintic_spring(rng: np.random.Generator, bench: Bench) -> Effect:
    """Draw a spring of fifth order."""
    motion, location = draw_place(rng, bench)
    largest, _ = bench.swing(motion)
    stiffness = log_uniform(rng, 0.5, 20) * bench.stiffness(motion) / largest**4
    law = PowerSpring(stiffness=stiffness, power=5)
    return _unknown_law("quintic_spring", location, {"quintic_N_m5": stiffness}, law, motion)


def two_sided_stop(rng: np.random.Generator, bench: Bench) -> Effect:
    """Draw stops on both sides: a piecewise linear spring."""
    motion, location = draw_place(rng, bench)
    largest, _ = bench.swing(motion)
    gap, stiffness = float(largest * rng.uniform(0.08, 0.5)), log_uniform(rng, 0.1, 10) * bench.stiffness(motion)
    law = TwoSided(stiffness=stiffness, gap=gap)
    return _unknown_law("two_sided_stop", location, {"gap_m": gap, "stiffness_N_m": stiffness}, law, motion)


def square_drag(rng: np.random.Generator, bench: Bench) -> Effect:
    """Draw damping that grows with the square of the velocity."""
    motion, location = draw_place(rng, bench)
    _, fastest = bench.swing(motion)
    drag = log_uniform(rng, 3, 60) * bench.damping(motion) / fastest
    return _unknown_law("square_drag", location, {"drag_Ns2_m2": drag}, SquareDrag(drag=drag), motion)


def bouc_wen(rng: np.random.Generator, bench: Bench) -> Effect:
    """Draw a joint that slips gradually."""
    motion, location = draw_place(rng, bench)
    largest, _ = bench.swing(motion)
    stiffness, limit = log_uniform(rng, 0.05, 1) * bench.stiffness(motion), float(largest * rng.uniform(0.05, 0.4))
    law = BoucWen(stiffness=stiffness, yield_m=limit)
    return _unknown_law("bouc_wen", location, {"stiffness_N_m": stiffness, "yield_m": limit}, law, motion)


def _unknown_law(kind: str, location: dict, parameters: dict, law: object, motion: Pair) -> Effect:
    return Effect(name="unknown", kind=kind, location=location, parameters=parameters, law=law, law_motion=motion)


DRAWS: dict[str, Draw] = {
    draw.__name__: draw for draw in (quadratic_spring, quintic_spring, two_sided_stop, square_drag, bouc_wen)
}
