"""Effects that act together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.effect import Builder, Effect, Place
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.model.change import Change


def build_together(specimen: ModelContext, effects: Sequence[tuple[Effect, Place]]) -> tuple[Builder, ...]:
    """Prepare effects that act together: where one exchanges the model, the others change the new one.

    Parameters
    ----------
    specimen : ModelContext
        What is tested.
    effects : sequence of (Effect, Place)
        What acts, and where.

    Returns
    -------
    tuple of Builder
        In the same order.
    """
    builders = [effect.build(specimen, place) for effect, place in effects]
    if len(effects) < 2:
        return tuple(builders)
    for number, ((effect, place), build) in enumerate(zip(effects, builders, strict=True)):
        model = typical_change(specimen, effect, place, build).model
        if model is not None:
            exchanged = replace(specimen, basis=replace(specimen.basis, model=model))
            others = build_together(exchanged, [*effects[:number], *effects[number + 1 :]])
            return (*others[:number], build, *others[number:])
    return tuple(builders)


def typical_change(specimen: ModelContext, effect: Effect, place: Place, build: Builder) -> Change:
    """Give what an effect changes at typical values of its parameters.

    Parameters
    ----------
    specimen : ModelContext
        What is tested.
    effect : Effect
        What acts.
    place : Place
        Where.
    build : Builder
        Of the effect there.

    Returns
    -------
    Change
        Only its places matter.
    """
    return build(np.array([parameter.typical for parameter in effect.parameters(specimen, place)]))
