"""Effects on stiffness and mass: the first half of the contract's table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from frf_testbench.simulator.effects.effect import Bench, Effect, Mount, constant, log_uniform
from frf_testbench.simulator.structures.beams import BeamDrawing
from frf_testbench.simulator.structures.frames import FrameDrawing
from frf_testbench.simulator.structures.reality import Extra, Reality

Draw = Callable[[np.random.Generator, Bench], Effect | None]


def _with_extra(extra: Extra) -> Callable[[Reality], Reality]:
    return lambda reality: replace(reality, extras=(*reality.extras, extra))


def boundary_compliance(rng: np.random.Generator, bench: Bench) -> Effect | None:
    """Draw a held end of a beam that is held by springs."""
    drawing = bench.specimen.drawing
    if not isinstance(drawing, BeamDrawing):
        return None
    ends = [end for end in ("left", "right") if getattr(drawing, end) != "free"]
    if not ends:
        return None
    end = str(rng.choice(ends))
    support = getattr(drawing, end)
    held = {"clamped": ["both", "rotation", "translation"], "pinned": ["translation"], "sliding": ["rotation"]}[support]
    which = str(rng.choice(held))
    bending = drawing.youngs_modulus_pa * drawing.width_m * drawing.thickness_m**3 / 12
    rotational = log_uniform(rng, 4, 250) * bending / drawing.length_m if which != "translation" else None
    translational = log_uniform(rng, 1e2, 2e4) * bending / drawing.length_m**3 if which != "rotation" else None
    values = {"rotational_stiffness_Nm_rad": rotational, "translational_stiffness_N_m": translational}
    springs = (rotational, translational)
    return Effect(
        name="boundary_compliance",
        location={"end": end, "nodes": [1 if end == "left" else drawing.elements + 1]},
        parameters={name: value for name, value in values.items() if value is not None},
        change=lambda reality: replace(reality, released={**reality.released, end: springs}),
    )


def added_mass(rng: np.random.Generator, bench: Bench) -> Effect:
    """Draw a mass at a node."""
    node = int(rng.choice(bench.nodes))
    mass = log_uniform(rng, 2e-3, 0.15) * bench.mass_kg
    return Effect(
        name="added_mass",
        location={"nodes": [node]},
        parameters={"mass_kg": mass},
        change=_with_extra(Extra(point=bench.point(node), mass=mass)),
    )


def _ratio(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a stiffness ratio between `low` and `high`; weak changes are as likely as strong ones."""
    down = rng.random() < 0.7
    change = log_uniform(rng, 0.04, 1 - low) if down else log_uniform(rng, 0.05, high - 1)
    return round(1 - change if down else 1 + change, 4)


def local_stiffness(rng: np.random.Generator, bench: Bench) -> Effect | None:
    """Draw a stretch of elements, a spring or a group of another stiffness."""
    drawing = bench.specimen.drawing
    if isinstance(drawing, BeamDrawing):
        longest = max(drawing.elements // 10, 2)
        count = int(rng.integers(1, longest + 1))
        first = int(rng.integers(1, drawing.elements - count + 2))
        key, location = (first, first + count - 1), {"elements": [first, first + count - 1]}
        ratio = _ratio(rng, 0.25, 2.0)
    elif isinstance(drawing, FrameDrawing):
        key = str(rng.choice([spring.id for spring in drawing.springs]))
        location, ratio = {"springs": [key]}, _ratio(rng, 0.4, 1.6)
    else:
        key = str(rng.choice(sorted(bench_groups(bench))))
        location, ratio = {"groups": [key]}, _ratio(rng, 0.5, 1.5)
    return Effect(
        name="local_stiffness",
        location=location,
        parameters={"stiffness_ratio": ratio},
        change=lambda reality: replace(reality, softened=(*reality.softened, (key, ratio))),
    )


def bench_groups(bench: Bench) -> list[str]:
    """Names of the groups of a model of kind matrices."""
    drawing = bench.specimen.drawing
    layout = getattr(drawing, "layout", None)
    return [member.name for member in layout[1]] if layout else [f"panel_{i}" for i in range(1, 5)]


def global_stiffness(rng: np.random.Generator, bench: Bench) -> Effect:
    """Draw another stiffness of everything."""
    del bench
    ratio = round(1 + float(rng.choice([-1, 1])) * log_uniform(rng, 0.005, 0.12), 5)
    return Effect(
        name="global_stiffness",
        parameters={"stiffness_ratio": ratio},
        change=lambda reality: replace(reality, stiffness_ratio=reality.stiffness_ratio * ratio),
    )


def grounded_spring(rng: np.random.Generator, bench: Bench) -> Effect:
    """Draw a spring between a node and the ground."""
    node = int(rng.choice(bench.nodes))
    point = bench.point(node)
    stiffness = log_uniform(rng, 0.01, 3) * bench.stiffness((point, None))
    return Effect(
        name="grounded_spring",
        location={"nodes": [node]},
        parameters={"stiffness_N_m": stiffness},
        change=_with_extra(Extra(point=point, stiffness=stiffness)),
    )


def coupling_spring(rng: np.random.Generator, bench: Bench) -> Effect | None:
    """Draw a spring between two nodes that are apart."""
    nodes = np.array(bench.nodes)
    if nodes.size < 3:
        return None
    first, second = sorted(int(node) for node in rng.choice(nodes, 2, replace=False))
    drawing = bench.specimen.drawing
    if isinstance(drawing, FrameDrawing):
        if any({first, second} == set(spring.nodes) for spring in drawing.springs):
            return None  # a stiffer spring, not a new one
    elif abs(first - second) < len(bench.structure.nodes) // 12:
        return None
    a, b = bench.point(first), bench.point(second)
    stiffness = log_uniform(rng, 0.02, 3) * bench.stiffness((a, b))
    return Effect(
        name="coupling_spring",
        location={"nodes": [first, second]},
        parameters={"stiffness_N_m": stiffness},
        change=_with_extra(Extra(point=a, stiffness=stiffness, other=b)),
    )


def attached_resonator(rng: np.random.Generator, bench: Bench) -> Effect:
    """Draw a mass on a spring and a damper, tuned within the band."""
    node = int(rng.choice(bench.nodes))
    low, high = bench.set_up.band_hz
    frequency = log_uniform(rng, 1.15 * low, 0.95 * high)
    mass = log_uniform(rng, 2e-3, 0.05) * bench.mass_kg
    ratio = log_uniform(rng, 0.004, 0.08)
    omega = 2 * np.pi * frequency
    return Effect(
        name="attached_resonator",
        location={"nodes": [node]},
        parameters={"mass_kg": mass, "frequency_hz": frequency, "damping_ratio": ratio},
        mounts=(
            Mount(
                motions=((bench.point(node), None),),
                stiffness=constant(
                    [[mass]],
                    lambda s: s**2 * (omega**2 + 2 * ratio * omega * s) / (s**2 + 2 * ratio * omega * s + omega**2),
                ),
            ),
        ),
    )


def axial_load(rng: np.random.Generator, bench: Bench) -> Effect | None:
    """Draw tension or compression of a beam whose ends do not run away."""
    drawing = bench.specimen.drawing
    if not isinstance(drawing, BeamDrawing) or "free" in (drawing.left, drawing.right):
        return None
    thickness = min([drawing.thickness_m, *(section.thickness_m for section in drawing.sections)])
    bending = drawing.youngs_modulus_pa * drawing.width_m * thickness**3 / 12
    euler = np.pi**2 * bending / drawing.length_m**2
    slow = "sliding" in (drawing.left, drawing.right)  # buckles at a quarter of the load
    force = log_uniform(rng, 0.01, 1.5) * euler if rng.random() < 0.6 else -log_uniform(rng, 0.01, 0.5) * euler
    force *= 0.25 if slow else 1.0
    return Effect(
        name="axial_load",
        parameters={"force_N": float(f"{force:.4g}")},
        change=lambda reality: replace(reality, axial_load_n=float(f"{force:.4g}")),
    )


def shear_rotary_inertia(rng: np.random.Generator, bench: Bench) -> Effect | None:
    """Give a thick beam that was drawn without shear what it lacks."""
    del rng
    drawing = bench.specimen.drawing
    if not isinstance(drawing, BeamDrawing) or drawing.formulation != "euler-bernoulli":
        return None
    return Effect(name="shear_rotary_inertia", change=lambda reality: replace(reality, formulation="timoshenko"))


DRAWS: dict[str, Draw] = {
    draw.__name__: draw
    for draw in (
        boundary_compliance, added_mass, local_stiffness, global_stiffness, grounded_spring, coupling_spring,
        attached_resonator, axial_load, shear_rotary_inertia,
    )
}  # fmt: skip
