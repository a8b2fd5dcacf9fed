"""Shear flexibility and rotary inertia of a beam that was modelled without them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING

from frf_ipz.diagnosis.catalogue.effect import Builder, Effect, Parameter, Place
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
    imitators = ("global_stiffness", "axial_load", "added_mass")

    def places(self, specimen: ModelContext) -> Sequence[Place]:
        """Return a beam that was modelled by Euler-Bernoulli."""
        source = specimen.model.source
        applies = isinstance(source, BeamFile) and source.beam.formulation == "euler-bernoulli"
        return [Place(key=())] if applies else []

    def parameters(self, specimen: ModelContext, place: Place) -> tuple[Parameter, ...]:
        """None: dimensions and material are known."""
        del specimen, place
        return ()

    def build(self, specimen: ModelContext, place: Place) -> Builder:
        """Exchange the elements."""
        del place
        change = Change(model=_exchanged(specimen.model))
        return lambda _: change

    def statement(self, specimen: ModelContext, place: Place, values: Mapping[str, Estimate]) -> str:
        """Say what the model lacks."""
        del specimen, place, values
        return (
            "The beam is too thick for the Euler-Bernoulli theory of the model: it lacks shear flexibility and rotary "
            'inertia (formulation = "timoshenko").'
        )


@lru_cache(maxsize=2)  # a search asks for the same one again and again
def _exchanged(model: StructuralModel) -> StructuralModel:
    return with_formulation(model, "timoshenko")
