"""A sensor that sits at another node than the test file says, or shows another direction of its node."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from frf_ipz.diagnosis.catalogue.effect import Builder, Effect, Parameter, Reading, list_neighbouring_nodes
from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.model.change import Change
from frf_ipz.diagnosis.model.layout import list_turns
from frf_ipz.diagnosis.model.motion import Motion
from frf_ipz.dofs import Dof

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.result import Estimate


class SensorMisplaced(Effect):
    """The channel is that of another node, or of another axis of a triaxial sensor."""

    name = "sensor_misplaced"

    def locations(self, context: ModelContext) -> Sequence[Location]:
        """Every other node, and every other axis, for every channel that stays at one node; a port has none."""
        channels = [channel for channel, _ in context.layout.outputs]
        staying = [
            (channel, dof)
            for channel, dof in context.layout.outputs
            if channels.count(channel) == 1 and isinstance(dof, Dof)
        ]
        elsewhere = [
            Location(channels=(channel,), nodes=(candidate.node,), directions=(dof.direction,))
            for channel, dof in staying
            for candidate in context.moving_dofs
            if candidate.direction == dof.direction and candidate.node != dof.node
        ]
        turned = [
            Location(channels=(channel,), nodes=(other.node,), directions=(other.direction,))
            for channel, dof in staying
            for other in list_turns(context.model, dof)
        ]
        return [*elsewhere, *turned]

    def parameters(self, context: ModelContext, location: Location) -> tuple[Parameter, ...]:
        """None: the node says it all."""
        del context, location
        return ()

    def build(self, context: ModelContext, location: Location) -> Builder:
        """Move or turn the sensor."""
        del context
        return self.chain(location)

    def chain(self, location: Location) -> Builder:
        """Do the same for any structure."""
        change = Change(moved={location.channel: location.dof if location.directions else location.node})
        return lambda _: change

    def reading(self, context: ModelContext, location: Location) -> Reading:
        """Read the same direction at the other node, or another one at the same."""
        dof, row = _nominal_dof(context, location.channel), context.model.full_index(location.dof)
        return Reading(channel=location.channel, motion=Motion(rows=(row,), weights=(float(dof.sign),)))

    def neighbours(self, context: ModelContext, location: Location) -> Sequence[Location]:
        """Nodes beside; for another axis none."""
        stated = _nominal_dof(context, location.channel).node
        if location.node == stated:
            return []
        return [beside for beside in list_neighbouring_nodes(context, location) if beside.node != stated]

    def statement(self, context: ModelContext, location: Location, values: Mapping[str, Estimate]) -> str:
        """Say which sensor, and where it is, or what it shows."""
        del values
        stated, where = _nominal_dof(context, location.channel), context.describe_node(location.node)
        if location.node == stated.node:
            shows = f"the direction {location.direction} of {where}, not {stated.direction}"
            return f"The sensor of '{location.channel}' shows {shows}."
        return f"The sensor of '{location.channel}' sits at {where}, not at node {stated.node}."


def _nominal_dof(context: ModelContext, channel: str) -> Dof:
    return next(dof for name, dof in context.layout.outputs if name == channel and isinstance(dof, Dof))
