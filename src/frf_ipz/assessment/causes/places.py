"""Sensors and excited points that are not where the test says."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.assessment.causes.cause import Cause
from frf_ipz.dofs import AnyDof, Dof, node_dofs

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from frf_ipz.arrays import BoolArray, FloatArray, IntArray
    from frf_ipz.assessment.causes.cause import Situation


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ExchangedSensors:
    """All pairs of sensors that may be exchanged.

    Parameters
    ----------
    situation : Situation
        Measurement and model.
    sensors : tuple of Dof
        Unsigned.
    first, second : (n,) int array
        The two sensors of each pair.
    signs : (n_sensors,) array
        Of the DOFs of the sensors, as they are written: dofs are exchanged with them.
    frfs : (n_sensors, n_frfs) bool array
        Which FRFs are those of each sensor.
    """

    situation: Situation
    sensors: tuple[AnyDof, ...]
    first: IntArray
    second: IntArray
    signs: FloatArray
    frfs: BoolArray

    def __len__(self) -> int:
        """Count the pairs."""
        return len(self.first)

    def __getitem__(self, number: int, /) -> Cause:
        """Give a pair as a cause."""
        first, second = self.sensors[self.first[number]], self.sensors[self.second[number]]
        keys = [self.situation.key_of("output", self.situation.channels[dof], "dof") for dof in (first, second)]
        moved = {first: second, second: first}
        says = f"the sensors at {first.name} and {second.name} are exchanged: exchange their dofs"
        ends = [self.first[number], self.second[number]]
        sign = float(self.signs[ends].prod())
        frfs = np.asarray(np.any(self.frfs[ends], axis=0))
        return _moved(self.situation, says, "; ".join(keys), moved, {}, len(self), sign=sign, of=frfs)


def exchanged_sensors(situation: Situation) -> ExchangedSensors:
    """List pairs of sensors that may be exchanged.

    Parameters
    ----------
    situation : Situation
        Measurement and model.

    Returns
    -------
    ExchangedSensors
        One cause a pair.
    """
    signs = {label.output_dof.unsigned: label.output_dof.sign for label in situation.measured.labels}
    first, second = np.triu_indices(len(signs), 1)
    return ExchangedSensors(
        situation=situation,
        sensors=tuple(signs),
        first=first,
        second=second,
        signs=np.array(list(signs.values()), float),
        frfs=_frfs_of(signs, [label.output_dof.unsigned for label in situation.measured.labels]),
    )


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
    signs = {label.input_dof.unsigned: label.input_dof.sign for label in situation.measured.labels}
    frfs = _frfs_of(signs, [label.input_dof.unsigned for label in situation.measured.labels])
    pairs = list(combinations(zip(signs, frfs, strict=True), 2))
    for (first, of_first), (second, of_second) in pairs:
        says = f"the excited points {first.name} and {second.name} are exchanged: exchange their dofs"
        key = f"dof of {first.name} and {second.name} in [[hit]], [[record]] or [[frf]]"
        moved = {first: second, second: first}
        sign = float(signs[first] * signs[second])
        yield _moved(situation, says, key, {}, moved, len(pairs), sign=sign, of=of_first | of_second)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MisplacedSensors:
    """All sensors at all nodes where they may sit instead.

    Parameters
    ----------
    situation : Situation
        Measurement and model.
    sensors : tuple of Dof
        Unsigned.
    places : tuple of tuple of Dof
        Where each may be.
    ends : (n_sensors,) int array
        Number of causes up to each sensor, with its own.
    """

    situation: Situation
    sensors: tuple[AnyDof, ...]
    places: tuple[tuple[AnyDof, ...], ...]
    ends: IntArray

    def __len__(self) -> int:
        """Count the sensors with their nodes."""
        return int(self.ends[-1]) if len(self.ends) else 0

    def __getitem__(self, number: int, /) -> Cause:
        """Give a sensor at a node as a cause."""
        sensor = int(np.searchsorted(self.ends, number, side="right"))
        dof, nodes = self.sensors[sensor], self.places[sensor]
        place, channel = nodes[number - int(self.ends[sensor]) + len(nodes)], self.situation.channels[dof]
        says = f"the sensor of '{channel}' seems to sit near {place.name}, not at {dof.name}: correct its dof"
        key = self.situation.key_of("output", channel, "dof")
        return _moved(self.situation, says, key, {dof: place}, {}, len(self))


def misplaced_sensor(situation: Situation) -> MisplacedSensors:
    """List nodes at which a sensor may sit instead.

    Parameters
    ----------
    situation : Situation
        Measurement and model.

    Returns
    -------
    MisplacedSensors
        One cause a sensor and node; none where there is one sensor only.
    """
    outputs = _unique(label.output_dof.unsigned for label in situation.measured.labels)
    along: dict[str, list[AnyDof]] = defaultdict(list)
    for place in node_dofs(tuple(situation.computed.shapes)):
        along[place.direction].append(place)
    places = tuple(
        tuple(place for place in along[dof.direction] if place != dof) if isinstance(dof, Dof) else ()
        for dof in (outputs if len(outputs) > 1 else ())
    )
    return MisplacedSensors(
        situation=situation,
        sensors=tuple(outputs),
        places=places,
        ends=np.cumsum([len(nodes) for nodes in places], dtype=np.int64),
    )


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


def _frfs_of(dofs: Iterable[AnyDof], ends: Sequence[AnyDof]) -> BoolArray:
    """Which FRFs, by the DOF at one of their ends, are those of each DOF, (n_dofs, n_frfs)."""
    number = {dof: place for place, dof in enumerate(dofs)}
    return np.asarray(np.array([number[end] for end in ends]) == np.arange(len(number))[:, None])


def _moved(
    situation: Situation,
    says: str,
    key: str,
    outputs: Mapping[AnyDof, AnyDof],
    inputs: Mapping[AnyDof, AnyDof],
    count: int,
    *,
    sign: float = 1.0,
    of: BoolArray | None = None,
) -> Cause:
    return Cause(
        says=says,
        file=situation.test_file,
        line_or_key=key,
        moved_outputs=outputs,
        moved_inputs=inputs,
        gain=sign,
        gained=of,
        log_prior=-float(np.log(max(count, 1))),
    )


def _unique(dofs: Iterable[AnyDof]) -> list[AnyDof]:
    return list(dict.fromkeys(dofs))
