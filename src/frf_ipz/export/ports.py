"""Inputs and outputs of a state space: their DOFs, quantities and delays."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from frf_ipz.dofs import PortDof, bind_port, parse_label
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
    names_quantity : bool
        There are several outputs at its DOF.
    """

    dof: AnyDof
    quantity: FrfQuantity
    delay_s: float = 0.0
    names_quantity: bool = False

    @property
    def name(self) -> str:
        """Its label, with what it measures where that is needed to tell it from others."""
        return f"{self.dof} {self.quantity.response}" if self.names_quantity else str(self.dof)

    @property
    def unit(self) -> str:
        """SI unit."""
        return self.quantity.response_unit(self.dof.direction)


@dataclass(frozen=True, slots=True, kw_only=True)
class Ports:
    """Inputs and outputs.

    Parameters
    ----------
    inputs : tuple of Dof or PortDof
        The excited DOFs, each once, or those that were chosen.
    outputs : tuple of Output
        The sensors, then the points of interest without a sensor, or those that were chosen.
    """

    inputs: tuple[AnyDof, ...]
    outputs: tuple[Output, ...]

    @property
    def input_units(self) -> tuple[str, ...]:
        """SI units of the inputs."""
        return tuple("N m" if dof.direction.startswith("r") else "N" for dof in self.inputs)


def choose_ports(
    labels: Sequence[FrfLabel],
    points: Sequence[AnyDof],
    options: ExportOptions,
    delays_s: Mapping[str, float],
    known: Sequence[AnyDof] = (),
) -> Ports:
    """Choose inputs and outputs from the measured FRFs, the points of interest and the options.

    Parameters
    ----------
    labels : sequence of FrfLabel
        What was measured.
    points : sequence of Dof or PortDof
        Points of interest.
    options : ExportOptions
        Quantities of the outputs, and which ports.
    delays_s : mapping of str to float
        Known delay of each delayed channel. That of a force channel belongs to the recording and not to the plant.
    known : sequence of Dof or PortDof
        What the reduced model has a row for, with the units of ports.

    Returns
    -------
    Ports
        Inputs and outputs.

    Raises
    ------
    InputError
        If nothing was measured, a port is not known, or a delay is negative or names a channel that does not exist.
    """
    if not labels:
        raise InputError("a state space needs at least one measured FRF: its label says where actuator and sensor are")
    _check_delays(labels, delays_s)
    sensors = {
        label.output_dof: Output(
            dof=label.output_dof, quantity=label.quantity, delay_s=delays_s.get(label.output_channel, 0.0)
        )
        for label in reversed(labels)  # of several FRFs to one sensor the first one determines the quantity
    }
    measured_and_points = dict.fromkeys([*(label.output_dof for label in labels), *points])
    excited = dict.fromkeys(label.input_dof for label in labels)
    units = {dof: dof for dof in known if isinstance(dof, PortDof)}
    output_dofs = _chosen("[export] ports", options.ports, [*measured_and_points, *known]) or tuple(measured_and_points)
    input_dofs = _chosen("[export] inputs", options.inputs, [*excited, *known]) or tuple(excited)
    ends = [sensors.get(dof) or Output(dof=dof, quantity=labels[0].quantity) for dof in output_dofs]
    return Ports(
        inputs=tuple(_with_unit(dof, units) for dof in input_dofs),
        outputs=tuple(
            replace(end, dof=_with_unit(end.dof, units), **asked)
            for end in ends
            for asked in _asked_quantities(options)
        ),
    )


def choose_ports_of_model(
    known: Sequence[AnyDof], options: ExportOptions, *, inputs: Sequence[AnyDof], outputs: Sequence[AnyDof]
) -> Ports:
    """Take inputs and outputs as they are named, without a measurement.

    Parameters
    ----------
    known : sequence of Dof or PortDof
        What the reduced model has a row for, with the units of ports.
    options : ExportOptions
        Quantities of the outputs.
    inputs, outputs : sequence of Dof or PortDof
        What was named.

    Returns
    -------
    Ports
        Inputs and outputs.

    Raises
    ------
    InputError
        If a port is not known.
    """
    units = {dof: dof for dof in known if isinstance(dof, PortDof)}
    input_dofs, output_dofs = (
        tuple(_with_unit(dof, units) for dof in _chosen(key, [str(dof) for dof in dofs], known))
        for key, dofs in (("inputs", inputs), ("outputs", outputs))
    )
    quantities = _asked_quantities(options)
    return Ports(
        inputs=input_dofs, outputs=tuple(Output(dof=dof, **asked) for dof in output_dofs for asked in quantities)
    )


def _asked_quantities(options: ExportOptions) -> list[dict[str, Any]]:
    """List what changes in an output as it was measured, once for each quantity that is asked for."""
    if options.outputs == "measured":
        return [{}]
    asked = (options.outputs,) if isinstance(options.outputs, str) else options.outputs
    return [{"quantity": frf_quantity_of(name), "names_quantity": len(asked) > 1} for name in asked]


def _chosen(key: str, names: Sequence[str], available: Sequence[AnyDof]) -> tuple[AnyDof, ...]:
    unsigned = {dof.unsigned for dof in available}
    chosen = tuple(parse_label(name) for name in names)
    for dof in chosen:
        if dof.unsigned not in unsigned:
            near = did_you_mean(str(dof), dict.fromkeys(str(other) for other in available))
            raise InputError(f"{key} names '{dof}', which the reduced model does not know; {near}")
    return chosen


def _with_unit(dof: AnyDof, units: Mapping[PortDof, PortDof]) -> AnyDof:
    return bind_port(dof, units) if isinstance(dof, PortDof) and dof.unsigned in units else dof


def _check_delays(labels: Sequence[FrfLabel], delays_s: Mapping[str, float]) -> None:
    channels = {name for label in labels for name in (label.output_channel, label.input_channel)}
    for name, delay in delays_s.items():
        if name not in channels:
            raise InputError(
                f"a delay is given for the channel '{name}', which no FRF has; {did_you_mean(name, channels)}"
            )
        if delay < 0:
            raise InputError(f"the delay of the channel '{name}' is {delay:g} s; it cannot be negative")
