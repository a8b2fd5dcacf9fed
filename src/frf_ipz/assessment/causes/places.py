"""Sensors and excited points that are not where the test says."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.assessment.causes.cause import Cause
from frf_ipz.dofs import AnyDof, Dof, node_dofs

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from frf_ipz.arrays import ComplexArray
    from frf_ipz.assessment.causes.cause import Situation


def exchanged_sensors(situation: Situation) -> Iterator[Cause]:
    """List pairs of sensors that may be exchanged.

    Parameters
    ----------
    situation : Situation
        Measurement and model.

    Yields
    ------
    Cause
        One a pair.
    """
    outputs = _unique(label.output_dof.unsigned for label in situation.measured.labels)
    pairs = list(combinations(outputs, 2))
    keys = {dof: situation.key_of("output", _channel(situation, dof), "dof") for dof in outputs}
    written = [label.output_dof for label in situation.measured.labels]
    for first, second in pairs:
        says = f"the sensors at {first.name} and {second.name} are exchanged: exchange their dofs"
        key = f"{keys[first]}; {keys[second]}"
        moved = {first: second, second: first}
        yield _moved(situation, says, key, moved, {}, len(pairs), gain=_gain_of_exchange(written, moved))


def exchanged_inputs(situation: Situation) -> Iterator[Cause]:
    """List pairs of excited points that may be exchanged.

    Parameters
    ----------
    situation : Situation
        Measurement and model.

    Yields
    ------
    Cause
        One a pair.
    """
    inputs = _unique(label.input_dof.unsigned for label in situation.measured.labels)
    pairs = list(combinations(inputs, 2))
    for first, second in pairs:
        says = f"the excited points {first.name} and {second.name} are exchanged: exchange their dofs"
        key = f"dof of {first.name} and {second.name} in [[hit]], [[record]] or [[frf]]"
        moved = {first: second, second: first}
        written = [label.input_dof for label in situation.measured.labels]
        yield _moved(situation, says, key, {}, moved, len(pairs), gain=_gain_of_exchange(written, moved))


def misplaced_sensor(situation: Situation) -> Iterator[Cause]:
    """List nodes at which a sensor may sit instead.

    Parameters
    ----------
    situation : Situation
        Measurement and model.

    Yields
    ------
    Cause
        One a sensor and node.
    """
    outputs = _unique(label.output_dof.unsigned for label in situation.measured.labels)
    if len(outputs) < 2:
        return
    places = {dof: [other for other in situation.computed.shapes if _is_along(other, dof)] for dof in outputs}
    count = sum(map(len, places.values()))
    for dof, nodes in places.items():
        channel = _channel(situation, dof)
        key = situation.key_of("output", channel, "dof")
        for place in nodes:
            says = f"the sensor of '{channel}' seems to sit near {place.name}, not at {dof.name}: correct its dof"
            yield _moved(situation, says, key, {dof: place}, {}, count)


def mirrored(situation: Situation) -> Iterator[Cause]:
    """List axes along which the nodes may have been counted from the other end.

    Parameters
    ----------
    situation : Situation
        Measurement and model.

    Yields
    ------
    Cause
        One an axis.
    """
    geometry = situation.model.geometry
    labels = situation.measured.labels
    dofs = _unique([*(label.output_dof.unsigned for label in labels), *(label.input_dof.unsigned for label in labels)])
    for axis in np.flatnonzero(np.ptp(geometry.coordinates_m, axis=0) > 0):
        places = geometry.coordinates_m.copy()
        places[:, axis] = places[:, axis].min() + places[:, axis].max() - places[:, axis]
        moved: dict[AnyDof, AnyDof] = {}
        for dof in node_dofs(dofs):
            at = places[np.flatnonzero(geometry.nodes == dof.node)]
            if not len(at):
                return
            nearest = int(geometry.nodes[np.argmin(np.linalg.norm(geometry.coordinates_m - at[0], axis=1))])
            moved[dof] = Dof(nearest, dof.direction)
        if moved and all(place in situation.computed.shapes for place in moved.values()):
            says = (
                f"measured points are counted from the other end along {'xyz'[axis]}, or the model is held at the "
                "wrong end: turn the numbering, or exchange the supports"
            )
            key = "dof of all channels and inputs; in the model: left, right"
            yield _moved(situation, says, key, moved, moved, 3)


def _gain_of_exchange(written: Sequence[AnyDof], moved: Mapping[AnyDof, AnyDof]) -> ComplexArray:
    """Give the sign that an exchange leaves in each FRF: dofs are exchanged with their signs."""
    signs = {dof.unsigned: dof.sign for dof in written}
    first, second = (signs[dof] for dof in moved)
    return np.array([first * second if dof.unsigned in moved else 1 for dof in written], complex)


def _moved(
    situation: Situation,
    says: str,
    key: str,
    outputs: Mapping[AnyDof, AnyDof],
    inputs: Mapping[AnyDof, AnyDof],
    count: int,
    *,
    gain: complex | ComplexArray = 1.0,
) -> Cause:
    return Cause(
        says=says,
        file=situation.test_file,
        line_or_key=key,
        moved_outputs=outputs,
        moved_inputs=inputs,
        gain=gain,
        log_prior=-float(np.log(max(count, 1))),
    )


def _unique(dofs: Iterable[AnyDof]) -> list[AnyDof]:
    return list(dict.fromkeys(dofs))


def _channel(situation: Situation, dof: AnyDof) -> str:
    """Name the channel of a sensor."""
    label = next(label for label in situation.measured.labels if label.output_dof.unsigned == dof)
    return label.output_channel or str(label.output_dof)


def _is_along(place: AnyDof, dof: AnyDof) -> bool:
    are_nodes = isinstance(place, Dof) and isinstance(dof, Dof)
    return are_nodes and place != dof and place.direction == dof.direction
