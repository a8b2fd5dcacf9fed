"""Shear flexibility and rotary inertia of a beam that was modelled without them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING

from frf_ipz.diagnosis.catalogue.effect import Builder, Effect, Parameter
from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.model.change import Change
from frf_ipz.fe.beam_models import with_formulation
from frf_ipz.fe.kinds.beam import BeamFile

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.result import Estimate
    from frf_ipz.structure import StructuralModel


class ShearRotaryInertia(Effect):
    """Timoshenko instead of Euler-Bernoulli."""

    name = "shear_rotary_inertia"

    def locations(self, context: ModelContext) -> Sequence[Location]:
        """Return a beam that was modelled by Euler-Bernoulli."""
        source = context.model.source
        applies = isinstance(source, BeamFile) and source.beam.formulation == "euler-bernoulli"
        return [Location()] if applies else []

    def parameters(self, context: ModelContext, location: Location) -> tuple[Parameter, ...]:
        """None: dimensions and material are known."""
        del context, location
        return ()

    def build(self, context: ModelContext, location: Location) -> Builder:
        """Exchange the elements."""
        del location
        change = Change(model=_exchanged(context.model))
        return lambda _: change

    def statement(self, context: ModelContext, location: Location, values: Mapping[str, Estimate]) -> str:
        """Say what the model lacks."""
        del context, location, values
        return (
            "The beam is too thick for the Euler-Bernoulli theory of the model: it lacks shear flexibility and rotary "
            'inertia (formulation = "timoshenko").'
        )


@lru_cache(maxsize=2)  # a search asks for the same one again and again
def _exchanged(model: StructuralModel) -> StructuralModel:
    return with_formulation(model, "timoshenko")
