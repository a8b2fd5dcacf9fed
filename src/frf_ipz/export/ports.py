"""Inputs and outputs of a state space: their DOFs, quantities and delays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from frf_ipz.errors import InputError, did_you_mean
from frf_ipz.quantities import FrfQuantity, frf_quantity_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from frf_ipz.dofs import AnyDof
    from frf_ipz.export.options import ExportOptions
    from frf_ipz.frf import FrfLabel


@dataclass(frozen=True, slots=True, kw_only=True)
class Output:
    """One output of a state space.

    Parameters
    ----------
    dof : Dof or PortDof
        Its sign counts.
    quantity : FrfQuantity
        Determines whether it is a displacement, a velocity or an acceleration.
    delay_s : float
        Its delay.
    """

    dof: AnyDof
    quantity: FrfQuantity
    delay_s: float = 0.0

    @property
    def unit(self) -> str:
        """SI unit."""
        return self.quantity.unit(self.dof.direction).removesuffix("/N")


@dataclass(frozen=True, slots=True, kw_only=True)
class Ports:
    """Inputs and outputs.

    Parameters
    ----------
    inputs : tuple of Dof
        The excited DOFs, each once.
    outputs : tuple of Output
        The sensors, then the points of interest without a sensor.
    """

    inputs: tuple[AnyDof, ...]
    outputs: tuple[Output, ...]

    @property
    def input_units(self) -> tuple[str, ...]:
        """SI units of the inputs."""
        return tuple("N m" if dof.direction.startswith("r") else "N" for dof in self.inputs)


def choose_ports(
    labels: Sequence[FrfLabel], points: Sequence[AnyDof], options: ExportOptions, delays_s: Mapping[str, float]
) -> Ports:
    """Choose inputs and outputs from the measured FRFs, the points of interest and the options.

    Parameters
    ----------
    labels : sequence of FrfLabel
        What was measured.
    points : sequence of Dof
        Points of interest.
    options : ExportOptions
        Quantity of the outputs.
    delays_s : mapping of str to float
        Known delay of each delayed channel. That of a force channel belongs to the recording and not to the plant.

    Returns
    -------
    Ports
        Inputs and outputs.

    Raises
    ------
    InputError
        If nothing was measured, or a delay is negative or names a channel that does not exist.
    """
    if not labels:
        raise InputError("a state space needs at least one measured FRF: its label says where actuator and sensor are")
    channels = {name for label in labels for name in (label.output_channel, label.input_channel)}
    for name, delay in delays_s.items():
        if name not in channels:
            raise InputError(
                f"a delay is given for the channel '{name}', which no FRF has; {did_you_mean(name, channels)}"
            )
        if delay < 0:
            raise InputError(f"the delay of the channel '{name}' is {delay:g} s; it cannot be negative")
    common_quantity = None if options.outputs == "measured" else frf_quantity_of(options.outputs)
    sensors = {
        label.output_dof: Output(
            dof=label.output_dof,
            quantity=common_quantity or label.quantity,
            delay_s=delays_s.get(label.output_channel, 0.0),
        )
        for label in reversed(labels)  # of several FRFs to one sensor the first one determines the quantity
    }
    output_dofs = dict.fromkeys(label.output_dof for label in labels) | dict.fromkeys(points)
    point_quantity = common_quantity or labels[0].quantity
    return Ports(
        inputs=tuple(dict.fromkeys(label.input_dof for label in labels)),
        outputs=tuple(sensors.get(dof) or Output(dof=dof, quantity=point_quantity) for dof in output_dofs),
    )
