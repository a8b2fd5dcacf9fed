"""A viscoelastic joint: stiff at high frequencies, soft at low ones, and lossy between."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.catalogue.effect import (
    Builder,
    Effect,
    Parameter,
    Signature,
    list_neighbouring_nodes,
    list_node_locations,
)
from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.model.change import Attachment, Change
from frf_ipz.diagnosis.model.motion import Motion
from frf_ipz.fe.kinds.beam import BeamFile

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.result import Estimate

SOFTEST, STIFFEST = 1e-5, 1e2  # of the structure's own stiffness there
SLOWEST, FASTEST = 0.15, 6.0  # relaxation rate over the edges of the band: beyond, it is a spring or a damper
N_TIMES = 9
LIGHT = 30.0  # frequency of the point between spring and damper over the band's upper edge: its mass has no effect


class ViscoelasticJoint(Effect):
    """A spring and a damper in series, beside the model: at a node, across a spring, at a pinned end."""

    name = "viscoelastic_joint"
    has_dynamics = True

    def locations(self, context: ModelContext) -> Sequence[Location]:
        """Every node that moves, every spring, the rotation of every pinned end."""
        springs = [part for part in context.model.parts if part.kind == "spring"]
        to_ground = {node for part in springs if 0 in part.nodes for node in part.nodes}
        at_nodes = [location for location in list_node_locations(context) if location.node not in to_ground]
        at_springs = [Location(springs=(part.name,)) for part in springs]
        return at_nodes + at_springs + _ends(context)

    def parameters(self, context: ModelContext, location: Location) -> tuple[Parameter, ...]:
        """Stiffness and relaxation time."""
        scale = context.stiffness_against(motion_at(context, location))
        low, high = (2 * np.pi * edge for edge in context.band_hz)
        name = "rotational_stiffness_Nm_rad" if location.end else "stiffness_N_m"
        return (
            Parameter(name=name, low=SOFTEST * scale, high=STIFFEST * scale),
            Parameter(name="relaxation_time_s", low=1 / (FASTEST * high), high=1 / (SLOWEST * low)),
        )

    def build(self, context: ModelContext, location: Location) -> Builder:
        """Attach its dynamic stiffness."""
        motion = motion_at(context, location).dense(len(context.model.all_dofs))[:, None]
        light = 1 / (LIGHT * 2 * np.pi * context.band_hz[1]) ** 2

        def change(values: FloatArray) -> Change:
            stiffness, time = values
            between = np.array([[1.0, -1.0], [-1.0, 1.0]])
            attachment = Attachment(
                motions=motion,
                stiffness=lambda s: stiffness * relaxing(s, time),
                matrices=(
                    np.diag([0.0, stiffness * light]),
                    np.diag([0.0, stiffness * time]),
                    stiffness * between,
                ),
            )
            return Change(attachments=(attachment,))

        return change

    def signature(self, context: ModelContext, location: Location) -> Signature:
        """Take some relaxation times."""
        low, high = (2 * np.pi * edge for edge in context.band_hz)
        times = np.geomspace(1 / (2 * high), 1 / (0.5 * low), N_TIMES)
        return Signature(
            motion=motion_at(context, location),
            shapes=np.array([relaxing(context.contour, time) for time in times]),
            values=np.stack([np.ones(N_TIMES), times], 1),
        )

    def neighbours(self, context: ModelContext, location: Location) -> Sequence[Location]:
        """Nodes beside, and ends, which look like the nodes beside them; for others nothing."""
        if location.end or location.springs:
            return []
        return list_neighbouring_nodes(context, location) + _ends(context)

    def log_prior(self, context: ModelContext, location: Location, values: FloatArray) -> float:
        """Joints sit at ends: one of them is as likely as one at any node between."""
        del values
        return float(np.log(len(list_node_locations(context)) / len(_ends(context)))) if location.end else 0.0

    def statement(self, context: ModelContext, location: Location, values: Mapping[str, Estimate]) -> str:
        """Say how stiff, how fast, where."""
        if location.end:
            where = f"at the {location.end} end, against its rotation,"
        elif location.springs:
            where = f"across the spring '{location.springs[0]}'"
        else:
            where = f"between {context.describe_node(location.node)} and the ground"
        name, stiffness = next(iter(values.items()))
        unit = "N m/rad" if name.startswith("rot") else "N/m"
        relaxation = values["relaxation_time_s"].in_words("ms", 1e3)
        return (
            f"A viscoelastic joint acts {where} that the model lacks: its stiffness is {stiffness.in_words(unit)} at "
            f"high frequencies and 0 at low ones, its relaxation time {relaxation}."
        )


def relaxing(s: ComplexArray, time_s: float) -> ComplexArray:
    """Dynamic stiffness of a Maxwell element of unit stiffness, s tau / (1 + s tau).

    Parameters
    ----------
    s : (n_points,) complex array
        rad/s.
    time_s : float
        Relaxation time, s.

    Returns
    -------
    (n_points,) complex array
        1.
    """
    return np.asarray(s * time_s / (1 + s * time_s))


def _ends(context: ModelContext) -> list[Location]:
    """Pinned ends of a beam."""
    source = context.model.source
    if not isinstance(source, BeamFile):
        return []
    return [
        Location(end=end, nodes=(node,), directions=("ry",))
        for end, node in (("left", 1), ("right", source.beam.elements + 1))
        if getattr(source.beam, end) == "pinned"
    ]


def motion_at(context: ModelContext, location: Location) -> Motion:
    """Give the motion of a joint.

    Parameters
    ----------
    context : ModelContext
        Model, layout and tolerances.
    location : Location
        A node, a spring, or a pinned end.

    Returns
    -------
    Motion
        The motion of a node, the extension of a spring, the rotation of an end.
    """
    return context.extension(context.spring_at(location)) if location.springs else context.motion(location.dof)
