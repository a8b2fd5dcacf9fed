"""A sensor that sits at another node than the test file says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from frf_ipz.diagnosis.catalogue.effect import Builder, Effect, Parameter, Place
from frf_ipz.diagnosis.model.change import Change

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.result import Estimate


class SensorMisplaced(Effect):
    """The channel is that of another node."""

    name = "sensor_misplaced"
    imitators = ("sensor_gain",)

    def places(self, specimen: ModelContext) -> Sequence[Place]:
        """Every other node for every channel that stays at one node."""
        channels = [channel for channel, _ in specimen.layout.outputs]
        return [
            _place(channel, other.node)
            for channel, dof in specimen.layout.outputs
            if channels.count(channel) == 1
            for other in specimen.moving_dofs
            if other.direction == dof.direction and other.node != dof.node
        ]

    def parameters(self, specimen: ModelContext, place: Place) -> tuple[Parameter, ...]:
        """None: the node says it all."""
        del specimen, place
        return ()

    def build(self, specimen: ModelContext, place: Place) -> Builder:
        """Move the sensor."""
        del specimen
        return self.chain(place)

    def chain(self, place: Place) -> Builder:
        """Do the same for any structure."""
        change = Change(moved={str(place.key[0]): int(str(place.key[1]))})
        return lambda _: change

    def neighbours(self, specimen: ModelContext, place: Place) -> Sequence[Place]:
        """Nodes beside."""
        channel, node = str(place.key[0]), int(str(place.key[1]))
        dof = next(dof for name, dof in specimen.layout.outputs if name == channel)
        return [_place(channel, other) for other in specimen.nodes_near(node, dof.direction) if other != dof.node]

    def statement(self, specimen: ModelContext, place: Place, values: Mapping[str, Estimate]) -> str:
        """Say which sensor, and where it is."""
        del values
        channel, node = str(place.key[0]), int(str(place.key[1]))
        dof = next(dof for name, dof in specimen.layout.outputs if name == channel)
        return f"The sensor of '{channel}' sits at {specimen.where(node)}, not at node {dof.node}."


def _place(channel: str, node: int) -> Place:
    return Place(key=(channel, node), location={"channels": [channel], "nodes": [node]})
