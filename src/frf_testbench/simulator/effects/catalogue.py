"""Effects by name: which specimens can have them, and how they are drawn, alone or two at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from frf_testbench.simulator.effects import dissipative, measuring, nonlinear, outside, structural
from frf_testbench.simulator.effects.effect import Bench, Effect

CONTRACT = {**structural.DRAWS, **dissipative.DRAWS, **measuring.DRAWS, **nonlinear.DRAWS}
OUTSIDE = outside.DRAWS
NONLINEAR = (*nonlinear.DRAWS, *outside.NONLINEAR)

BEAMS = (
    "cantilever", "pinned-pinned", "clamped-pinned", "clamped-clamped", "clamped-sliding", "pinned-sliding",
    "free-free", "stepped",
)  # fmt: skip
FITTING = {  # all others fit everything
    "boundary_compliance": tuple(kind for kind in BEAMS if kind != "free-free"),
    "axial_load": tuple(kind for kind in BEAMS if kind not in ("free-free", "cantilever")),
    "shear_rotary_inertia": BEAMS,
    "unknown:rotary_inertia": BEAMS,
}
# with a nonlinear law the structure is integrated in its modes: nothing with a dynamic stiffness of its own
NOT_WITH_A_LAW = {"attached_resonator", "local_damper", "viscoelastic_joint", "structural_damping"}


def kinds_for(rng: np.random.Generator, asked: str, kinds: Sequence[str]) -> tuple[tuple[str, ...], list[str]]:
    """Say what is to be drawn, and on which specimens.

    Parameters
    ----------
    rng : Generator
        Of the case.
    asked : str
        ``null``, the name of an effect, ``unknown``, ``unknown:KIND``, ``pair`` or ``pair:A+B``.
    kinds : sequence of str
        Specimens to choose from.

    Returns
    -------
    names : tuple of str
        Effects, none for ``null``.
    kinds : list of str
        Specimens that can have all of them.

    Raises
    ------
    ValueError
        If there is no such effect.
    """
    if asked == "null":
        return (), list(kinds)
    if asked == "unknown":
        names = (f"unknown:{rng.choice(list(OUTSIDE))}",)
    elif asked.startswith("pair"):
        names = tuple(asked.removeprefix("pair:").split("+")) if ":" in asked else _two(rng)
    else:
        names = (asked,)
    known = {*CONTRACT, *(f"unknown:{kind}" for kind in OUTSIDE)}
    for name in names:
        if name not in known:
            raise ValueError(
                f"there is no effect '{name}'; known are null, unknown, pair and {', '.join(sorted(known))}"
            )
    fitting = [kind for kind in kinds if all(kind in FITTING.get(name, kinds) for name in names)]
    return names, fitting


def _two(rng: np.random.Generator) -> tuple[str, str]:
    """Draw two different effects; a nonlinear law in one of ten pairs."""
    linear = [name for name in CONTRACT if name not in NONLINEAR]
    first = str(rng.choice(list(nonlinear.DRAWS) if rng.random() < 0.1 else linear))
    others = [name for name in linear if name != first and (first in linear or name not in NOT_WITH_A_LAW)]
    return first, str(rng.choice(others))


def needs_levels(names: tuple[str, ...]) -> bool:
    """Whether any of the effects depends on level or on time."""
    return any(name.removeprefix("unknown:") in (*NONLINEAR, "drifting_stiffness") for name in names)


def draw_effects(rng: np.random.Generator, names: tuple[str, ...], bench: Bench) -> tuple[Effect, ...] | None:
    """Draw effects on a specimen.

    Parameters
    ----------
    rng : Generator
        Of the case.
    names : tuple of str
        What is wanted.
    bench : Bench
        The specimen on its test bench.

    Returns
    -------
    tuple of Effect, or None
        None where the specimen cannot have one of them, where two would sit on the same channel, or where a nonlinear
        law would feel little but the drift of a free structure.
    """
    effects: list[Effect] = []
    for name in names:
        outside_kind = name.removeprefix("unknown:")
        effect = (OUTSIDE[outside_kind] if name.startswith("unknown:") else CONTRACT[name])(rng, bench)
        if effect is None or (effect.law_motion is not None and not bench.is_vibration(effect.law_motion)):
            return None
        effects.append(effect)
    channels = [channel for effect in effects for channel in {*effect.gains, *effect.moved}]
    return tuple(effects) if len(set(channels)) == len(channels) else None
