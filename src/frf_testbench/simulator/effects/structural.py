"""Effects on stiffness and mass: the first half of the contract's table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from frf_testbench.simulator.effects.effect import (
    Draw,
    Effect,
    EffectTarget,
    Mount,
    draw_log_uniform,
    make_dynamic_stiffness,
)
from frf_testbench.simulator.structures.beams import BeamDrawing
from frf_testbench.simulator.structures.frames import FrameDrawing
from frf_testbench.simulator.structures.reality import Extra, PartKey, Reality


def _with_extra(extra: Extra) -> Callable[[Reality], Reality]:
    return lambda reality: replace(reality, extras=(*reality.extras, extra))


def draw_boundary_compliance(rng: np.random.Generator, target: EffectTarget) -> Effect | None:
    """Draw a held end of a beam that is held by springs."""
    drawing = target.specimen.drawing
    if not isinstance(drawing, BeamDrawing):
        return None
    ends = [end for end in ("left", "right") if getattr(drawing, end) != "free"]
    if not ends:
        return None
    end = str(rng.choice(ends))
    support = getattr(drawing, end)
    held = {"clamped": ["both", "rotation", "translation"], "pinned": ["translation"], "sliding": ["rotation"]}[support]
    released = str(rng.choice(held))
    bending = drawing.youngs_modulus_pa * drawing.width_m * drawing.thickness_m**3 / 12
    rotational = draw_log_uniform(rng, 4, 250) * bending / drawing.length_m if released != "translation" else None
    translational = draw_log_uniform(rng, 1e2, 2e4) * bending / drawing.length_m**3 if released != "rotation" else None
    values = {"rotational_stiffness_Nm_rad": rotational, "translational_stiffness_N_m": translational}
    springs = (rotational, translational)
    return Effect(
        name="boundary_compliance",
        location={"end": end, "nodes": [1 if end == "left" else drawing.elements + 1]},
        parameters={name: value for name, value in values.items() if value is not None},
        change_reality=lambda reality: replace(reality, released={**reality.released, end: springs}),
    )


def draw_added_mass(rng: np.random.Generator, target: EffectTarget) -> Effect:
    """Draw a mass at a node."""
    node = int(rng.choice(target.nodes))
    mass = draw_log_uniform(rng, 2e-3, 0.15) * target.mass_kg
    return Effect(
        name="added_mass",
        location={"nodes": [node]},
        parameters={"mass_kg": mass},
        change_reality=_with_extra(Extra(point=target.point(node), mass=mass)),
    )


def _draw_ratio(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a stiffness ratio between `low` and `high`; weak changes are as likely as strong ones."""
    down = rng.random() < 0.7
    change = draw_log_uniform(rng, 0.04, 1 - low) if down else draw_log_uniform(rng, 0.05, high - 1)
    return round(1 - change if down else 1 + change, 4)


def draw_local_stiffness(rng: np.random.Generator, target: EffectTarget) -> Effect | None:
    """Draw a segment of elements, a spring or a group of another stiffness."""
    drawing = target.specimen.drawing
    key: PartKey
    location: dict[str, list[int] | list[str]]
    if isinstance(drawing, BeamDrawing):
        longest = max(drawing.elements // 10, 2)
        count = int(rng.integers(1, longest + 1))
        first = int(rng.integers(1, drawing.elements - count + 2))
        key, location = (first, first + count - 1), {"elements": [first, first + count - 1]}
        ratio = _draw_ratio(rng, 0.25, 2.0)
    elif isinstance(drawing, FrameDrawing):
        spring_id = str(rng.choice([spring.id for spring in drawing.springs]))
        key, location, ratio = spring_id, {"springs": [spring_id]}, _draw_ratio(rng, 0.4, 1.6)
    else:
        group = str(rng.choice(sorted(list_groups(target))))
        key, location, ratio = group, {"groups": [group]}, _draw_ratio(rng, 0.5, 1.5)
    return Effect(
        name="local_stiffness",
        location=location,
        parameters={"stiffness_ratio": ratio},
        change_reality=lambda reality: replace(reality, softened=(*reality.softened, (key, ratio))),
    )


def list_groups(target: EffectTarget) -> list[str]:
    """List the names of the groups of a model of kind matrices."""
    drawing = target.specimen.drawing
    layout = getattr(drawing, "layout", None)
    return [member.name for member in layout[1]] if layout else [f"panel_{i}" for i in range(1, 5)]


def draw_global_stiffness(rng: np.random.Generator, target: EffectTarget) -> Effect:
    """Draw another stiffness of everything."""
    del target
    ratio = round(1 + float(rng.choice([-1, 1])) * draw_log_uniform(rng, 0.005, 0.12), 5)
    return Effect(
        name="global_stiffness",
        parameters={"stiffness_ratio": ratio},
        change_reality=lambda reality: replace(reality, stiffness_ratio=reality.stiffness_ratio * ratio),
    )


def draw_grounded_spring(rng: np.random.Generator, target: EffectTarget) -> Effect:
    """Draw a spring between a node and the ground."""
    node = int(rng.choice(target.nodes))
    point = target.point(node)
    stiffness = draw_log_uniform(rng, 0.01, 3) * target.stiffness((point, None))
    return Effect(
        name="grounded_spring",
        location={"nodes": [node]},
        parameters={"stiffness_N_m": stiffness},
        change_reality=_with_extra(Extra(point=point, stiffness=stiffness)),
    )


def draw_coupling_spring(rng: np.random.Generator, target: EffectTarget) -> Effect | None:
    """Draw a spring between two nodes that are apart."""
    nodes = np.array(target.nodes)
    if nodes.size < 3:
        return None
    first, second = sorted(int(node) for node in rng.choice(nodes, 2, replace=False))
    drawing = target.specimen.drawing
    if isinstance(drawing, FrameDrawing):
        if any({first, second} == set(spring.nodes) for spring in drawing.springs):
            return None  # a stiffer spring, not a new one
    elif abs(first - second) < len(target.structure.nodes) // 12:
        return None
    a, b = target.point(first), target.point(second)
    stiffness = draw_log_uniform(rng, 0.02, 3) * target.stiffness((a, b))
    return Effect(
        name="coupling_spring",
        location={"nodes": [first, second]},
        parameters={"stiffness_N_m": stiffness},
        change_reality=_with_extra(Extra(point=a, stiffness=stiffness, second_point=b)),
    )


def draw_attached_resonator(rng: np.random.Generator, target: EffectTarget) -> Effect:
    """Draw a mass on a spring and a damper, tuned within the band."""
    node = int(rng.choice(target.nodes))
    low, high = target.set_up.band_hz
    frequency = draw_log_uniform(rng, 1.15 * low, 0.95 * high)
    mass = draw_log_uniform(rng, 2e-3, 0.05) * target.mass_kg
    ratio = draw_log_uniform(rng, 0.004, 0.08)
    omega = 2 * np.pi * frequency
    return Effect(
        name="attached_resonator",
        location={"nodes": [node]},
        parameters={"mass_kg": mass, "frequency_hz": frequency, "damping_ratio": ratio},
        mounts=(
            Mount(
                motions=((target.point(node), None),),
                stiffness=make_dynamic_stiffness(
                    [[mass]],
                    lambda s: s**2 * (omega**2 + 2 * ratio * omega * s) / (s**2 + 2 * ratio * omega * s + omega**2),
                ),
            ),
        ),
    )


def draw_axial_load(rng: np.random.Generator, target: EffectTarget) -> Effect | None:
    """Draw tension or compression of a beam whose ends do not run away."""
    drawing = target.specimen.drawing
    if not isinstance(drawing, BeamDrawing) or "free" in (drawing.left, drawing.right):
        return None
    thickness = min([drawing.thickness_m, *(section.thickness_m for section in drawing.sections)])
    bending = drawing.youngs_modulus_pa * drawing.width_m * thickness**3 / 12
    euler = np.pi**2 * bending / drawing.length_m**2
    slow = "sliding" in (drawing.left, drawing.right)  # buckles at a quarter of the load
    force = (
        draw_log_uniform(rng, 0.01, 1.5) * euler if rng.random() < 0.6 else -draw_log_uniform(rng, 0.01, 0.5) * euler
    )
    force *= 0.25 if slow else 1.0
    return Effect(
        name="axial_load",
        parameters={"force_N": float(f"{force:.4g}")},
        change_reality=lambda reality: replace(reality, axial_load_n=float(f"{force:.4g}")),
    )


def draw_shear_rotary_inertia(rng: np.random.Generator, target: EffectTarget) -> Effect | None:
    """Give a thick beam that was drawn without shear what it lacks."""
    del rng
    drawing = target.specimen.drawing
    if not isinstance(drawing, BeamDrawing) or drawing.formulation != "euler-bernoulli":
        return None
    return Effect(
        name="shear_rotary_inertia", change_reality=lambda reality: replace(reality, formulation="timoshenko")
    )


DRAWS: dict[str, Draw] = {
    draw.__name__.removeprefix("draw_"): draw
    for draw in (
        draw_boundary_compliance, draw_added_mass, draw_local_stiffness, draw_global_stiffness, draw_grounded_spring,
        draw_coupling_spring, draw_attached_resonator, draw_axial_load, draw_shear_rotary_inertia,
    )
}  # fmt: skip
