"""A sensor that sits at another node than the test file says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from frf_ipz.diagnosis.catalogue.effect import Builder, Effect, Location, Parameter, Reading
from frf_ipz.diagnosis.model.change import Change
from frf_ipz.diagnosis.model.motion import Motion
from frf_ipz.dofs import Dof

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.result import Estimate


class SensorMisplaced(Effect):
    """The channel is that of another node."""

    name = "sensor_misplaced"
    imitators = ("sensor_gain",)

    def locations(self, context: ModelContext) -> Sequence[Location]:
        """Every other node for every channel that stays at one node; a port has none."""
        channels = [channel for channel, _ in context.layout.outputs]
        return [
            _make_location(channel, candidate.node)
            for channel, dof in context.layout.outputs
            if channels.count(channel) == 1 and isinstance(dof, Dof)
            for candidate in context.moving_dofs
            if candidate.direction == dof.direction and candidate.node != dof.node
        ]

    def parameters(self, context: ModelContext, location: Location) -> tuple[Parameter, ...]:
        """None: the node says it all."""
        del context, location
        return ()

    def build(self, context: ModelContext, location: Location) -> Builder:
        """Move the sensor."""
        del context
        return self.chain(location)

    def chain(self, location: Location) -> Builder:
        """Do the same for any structure."""
        change = Change(moved={str(location.key[0]): int(str(location.key[1]))})
        return lambda _: change

    def reading(self, context: ModelContext, location: Location) -> Reading:
        """Read the same direction at the other node."""
        channel, node = str(location.key[0]), int(str(location.key[1]))
        dof = _nominal_dof(context, channel)
        row = context.model.full_index(Dof(node, dof.direction))
        return Reading(channel=channel, motion=Motion(rows=(row,), weights=(float(dof.sign),)))

    def neighbours(self, context: ModelContext, location: Location) -> Sequence[Location]:
        """Nodes beside."""
        channel, node = str(location.key[0]), int(str(location.key[1]))
        dof = _nominal_dof(context, channel)
        return [
            _make_location(channel, neighbour)
            for neighbour in context.neighbouring_nodes(node, dof.direction)
            if neighbour != dof.node
        ]

    def statement(self, context: ModelContext, location: Location, values: Mapping[str, Estimate]) -> str:
        """Say which sensor, and where it is."""
        del values
        channel, node = str(location.key[0]), int(str(location.key[1]))
        dof = _nominal_dof(context, channel)
        return f"The sensor of '{channel}' sits at {context.describe_node(node)}, not at node {dof.node}."


def _nominal_dof(context: ModelContext, channel: str) -> Dof:
    return next(dof for name, dof in context.layout.outputs if name == channel and isinstance(dof, Dof))


def _make_location(channel: str, node: int) -> Location:
    return Location(key=(channel, node), entries={"channels": [channel], "nodes": [node]})
