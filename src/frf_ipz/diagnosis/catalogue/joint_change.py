"""Effects that act together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.effect import Builder, Effect
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.location import Location
    from frf_ipz.diagnosis.model.change import Change


def build_together(context: ModelContext, effects: Sequence[tuple[Effect, Location]]) -> tuple[Builder, ...]:
    """Prepare effects that act together: where one exchanges the model, the others change the new one.

    Parameters
    ----------
    context : ModelContext
        Model, layout and tolerances.
    effects : sequence of (Effect, Location)
        What acts, and where.

    Returns
    -------
    tuple of Builder
        In the same order.
    """
    builders = [effect.build(context, location) for effect, location in effects]
    if len(effects) < 2:
        return tuple(builders)
    for number, ((effect, location), build) in enumerate(zip(effects, builders, strict=True)):
        model = typical_change(context, effect, location, build).model
        if model is not None:
            exchanged = replace(context, basis=replace(context.basis, model=model))
            remaining = build_together(exchanged, [*effects[:number], *effects[number + 1 :]])
            return (*remaining[:number], build, *remaining[number:])
    return tuple(builders)


def typical_change(context: ModelContext, effect: Effect, location: Location, build: Builder) -> Change:
    """Give what an effect changes at typical values of its parameters.

    Parameters
    ----------
    context : ModelContext
        Model, layout and tolerances.
    effect : Effect
        What acts.
    location : Location
        Where.
    build : Builder
        Of the effect there.

    Returns
    -------
    Change
        Only the motions that it acts on matter.
    """
    return build(np.array([parameter.typical for parameter in effect.parameters(context, location)]))
