"""Effects by name: which specimens can have them, and how they are drawn, alone or two at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from frf_testbench.simulator.effects import dissipative, measuring, nonlinear, out_of_catalogue, structural
from frf_testbench.simulator.effects.effect import Effect, EffectTarget

CATALOGUE = {**structural.DRAWS, **dissipative.DRAWS, **measuring.DRAWS, **nonlinear.DRAWS}
OUT_OF_CATALOGUE = out_of_catalogue.DRAWS
NONLINEAR = (*nonlinear.DRAWS, *out_of_catalogue.NONLINEAR)

BEAMS = (
    "cantilever", "pinned-pinned", "clamped-pinned", "clamped-clamped", "clamped-sliding", "pinned-sliding",
    "free-free", "stepped",
)  # fmt: skip
SUITABLE_KINDS = {  # all others suit every kind
    "boundary_compliance": tuple(kind for kind in BEAMS if kind != "free-free"),
    "axial_load": tuple(kind for kind in BEAMS if kind not in ("free-free", "cantilever")),
    "shear_rotary_inertia": BEAMS,
    "unknown:rotary_inertia": BEAMS,
}
# with a nonlinear law the structure is integrated in its modes: nothing with a dynamic stiffness of its own
INCOMPATIBLE_WITH_LAW = {"attached_resonator", "local_damper", "viscoelastic_joint", "structural_damping"}


def select_effects(rng: np.random.Generator, request: str, kinds: Sequence[str]) -> tuple[tuple[str, ...], list[str]]:
    """Select the effects to be drawn, and the kinds of specimens that can have them.

    Parameters
    ----------
    rng : Generator
        Of the case.
    request : str
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
    names: tuple[str, ...]
    if request == "null":
        return (), list(kinds)
    if request == "unknown":
        names = (f"unknown:{rng.choice(list(OUT_OF_CATALOGUE))}",)
    elif request.startswith("pair"):
        names = tuple(request.removeprefix("pair:").split("+")) if ":" in request else _draw_pair(rng)
    else:
        names = (request,)
    known = {*CATALOGUE, *(f"unknown:{kind}" for kind in OUT_OF_CATALOGUE)}
    for name in names:
        if name not in known:
            raise ValueError(
                f"there is no effect '{name}'; known are null, unknown, pair and {', '.join(sorted(known))}"
            )
    suitable = [kind for kind in kinds if all(kind in SUITABLE_KINDS.get(name, kinds) for name in names)]
    return names, suitable


def _draw_pair(rng: np.random.Generator) -> tuple[str, str]:
    """Draw two different effects; a nonlinear law in one of ten pairs."""
    linear = [name for name in CATALOGUE if name not in NONLINEAR]
    first = str(rng.choice(list(nonlinear.DRAWS) if rng.random() < 0.1 else linear))
    partners = [name for name in linear if name != first and (first in linear or name not in INCOMPATIBLE_WITH_LAW)]
    return first, str(rng.choice(partners))


def depends_on_level(names: tuple[str, ...]) -> bool:
    """Whether any of the effects depends on level or on time."""
    return any(name.removeprefix("unknown:") in (*NONLINEAR, "drifting_stiffness") for name in names)


def draw_effects(rng: np.random.Generator, names: tuple[str, ...], target: EffectTarget) -> tuple[Effect, ...] | None:
    """Draw effects on a specimen.

    Parameters
    ----------
    rng : Generator
        Of the case.
    names : tuple of str
        As `select_effects` gives them.
    target : EffectTarget
        The specimen in its test.

    Returns
    -------
    tuple of Effect, or None
        None where the specimen cannot have one of them, where two would sit on the same channel, or where a nonlinear
        law would feel little but the drift of a free structure.
    """
    effects: list[Effect] = []
    for name in names:
        unknown_kind = name.removeprefix("unknown:")
        draw = OUT_OF_CATALOGUE[unknown_kind] if name.startswith("unknown:") else CATALOGUE[name]
        effect = draw(rng, target)
        if effect is None or (effect.law_motion is not None and not target.is_mostly_vibration(effect.law_motion)):
            return None
        effects.append(effect)
    channels = [channel for effect in effects for channel in {*effect.gains, *effect.sensor_nodes}]
    return tuple(effects) if len(set(channels)) == len(channels) else None
