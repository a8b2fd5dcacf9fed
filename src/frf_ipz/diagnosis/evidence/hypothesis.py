"""A hypothesis: components at their locations, ready to be evaluated for any values of their parameters."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import accumulate
from typing import TYPE_CHECKING, TypeAlias, TypeVar

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.catalogue.joint_change import build_together, typical_change
from frf_ipz.diagnosis.deadline import NO_LIMIT, Deadline
from frf_ipz.diagnosis.model.basis import Basis, enrich_basis
from frf_ipz.diagnosis.model.change import NO_CHANGE, Change
from frf_ipz.diagnosis.model.modes import (
    Modes,
    ModifiedStructure,
    MotionRows,
    make_motion_rows,
    modify_structure,
    scatter_modes,
)
from frf_ipz.diagnosis.model.nuisance import NuisancePrior, NuisanceValues
from frf_ipz.diagnosis.model.response import Response, respond

if TYPE_CHECKING:
    from collections.abc import Callable

    from frf_ipz.diagnosis.catalogue.effect import Builder, Effect, Parameter
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.location import Location


Remembered = TypeVar("Remembered")
ComponentKey: TypeAlias = "tuple[str, Location]"
N_REMEMBERED = 4  # sets of values


@dataclass(frozen=True, slots=True, kw_only=True)
class Component:
    """An effect at a location.

    Parameters
    ----------
    effect : Effect
        The effect.
    location : Location
        Its location.
    n_locations : int
        Number of possible locations: the prior of this one.
    """

    effect: Effect
    location: Location
    n_locations: int

    @property
    def key(self) -> ComponentKey:
        """Distinguishes it from others."""
        return self.effect.name, self.location


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Hypothesis:
    """Components together, with the coordinates that they need.

    Parameters
    ----------
    components : tuple of Component
        Empty for the nominal model.
    parameters : tuple of Parameter
        Of all components in turn.
    builders : tuple of Builder
        Of each component.
    counts : tuple of int
        Number of parameters of each component.
    basis : Basis
        Coordinates.
    rows : MotionRows
        Sensors and excited points in them.
    context : ModelContext
        Model, layout and tolerances.
    nuisance_prior : NuisancePrior
        Nuisance parameters.
    deadline : Deadline
        When no further step of a fit is made.
    """

    components: tuple[Component, ...]
    parameters: tuple[Parameter, ...]
    builders: tuple[Builder, ...]
    counts: tuple[int, ...]
    basis: Basis
    rows: MotionRows
    context: ModelContext
    nuisance_prior: NuisancePrior
    deadline: Deadline = NO_LIMIT
    _latest: dict[bytes, ModifiedStructure] = field(init=False, default_factory=dict, repr=False)
    _latest_nuisance: dict[bytes, NuisanceValues] = field(init=False, default_factory=dict, repr=False)

    @property
    def key(self) -> tuple[ComponentKey, ...]:
        """Distinguishes it from others."""
        return tuple(component.key for component in self.components)

    @property
    def low(self) -> FloatArray:
        """Lower bounds in search coordinates."""
        return self.to_searched(np.array([parameter.low for parameter in self.parameters]))

    @property
    def high(self) -> FloatArray:
        """Upper bounds in search coordinates."""
        return self.to_searched(np.array([parameter.high for parameter in self.parameters]))

    def clip_to_searched(self, values: FloatArray) -> FloatArray:
        """Clip physical values to the bounds and transform them to search coordinates."""
        bounds = [(parameter.low, parameter.high) for parameter in self.parameters]
        inside = [np.clip(value, low, high) for value, (low, high) in zip(values, bounds, strict=True)]
        return np.clip(self.to_searched(np.array(inside)), self.low, self.high)

    def to_searched(self, values: FloatArray) -> FloatArray:
        """Transform physical values to search coordinates: logarithms, or parts of the range."""
        return np.array(
            [
                np.log(value) if parameter.is_log else value / (parameter.high - parameter.low)
                for parameter, value in zip(self.parameters, values, strict=True)
            ]
        )

    def to_physical(self, searched: FloatArray) -> FloatArray:
        """Transform search coordinates to physical values."""
        return np.array(
            [
                np.exp(value) if parameter.is_log else value * (parameter.high - parameter.low)
                for parameter, value in zip(self.parameters, searched, strict=True)
            ]
        )

    def change(self, values: FloatArray) -> Change:
        """Everything that is changed for physical values of the parameters."""
        total = NO_CHANGE
        for build, part in zip(self.builders, self._split(values), strict=True):
            total = total + build(part)
        return total

    def implausibilities(self, values: FloatArray) -> tuple[str, ...]:
        """Why each component is implausible with its values; empty where it is not."""
        parts = zip(self.components, self._split(values), strict=True)
        return tuple(component.effect.implausibility(part) for component, part in parts)

    def log_prior(self, values: FloatArray) -> float:
        """Log prior of the locations, and of the values within their bounds."""
        return sum(
            component.effect.log_prior(self.context, component.location, part) - float(np.log(component.n_locations))
            for component, part in zip(self.components, self._split(values), strict=True)
        )

    def _split(self, values: FloatArray) -> list[FloatArray]:
        stops = list(accumulate(self.counts))
        return [values[stop - count : stop] for stop, count in zip(stops, self.counts, strict=True)]

    def modes(self, values: FloatArray, nuisance: FloatArray) -> Modes:
        """Modes for physical values of the parameters, and nuisance parameters in standard deviations."""
        return scatter_modes(self.basis, self._modified(values), self.rows, self._unpacked(nuisance))

    def respond(self, values: FloatArray, nuisance: FloatArray, s: ComplexArray) -> Response:
        """FRFs for physical values of the parameters, and nuisance parameters in standard deviations."""
        modified, nuisance_values = self._modified(values), self._unpacked(nuisance)
        modes = scatter_modes(self.basis, modified, self.rows, nuisance_values)
        return respond(modes, modified.change, self.context.layout, nuisance_values, s, self.basis)

    def _modified(self, values: FloatArray) -> ModifiedStructure:
        """Solve without scatter, once for the latest values: a fit tries several nuisance values with the same."""
        return _remember(self._latest, values, lambda: modify_structure(self.basis, self.change(values)))

    def _unpacked(self, nuisance: FloatArray) -> NuisanceValues:
        """Unpack once for the latest nuisance: derivatives by parameters are all taken with the same."""
        return _remember(self._latest_nuisance, nuisance, lambda: self.nuisance_prior.unpack(nuisance))


def _remember(latest: dict[bytes, Remembered], values: FloatArray, compute: Callable[[], Remembered]) -> Remembered:
    """Give what belongs to values, computed where it is not among the latest."""
    key = values.tobytes()
    if key not in latest:
        if len(latest) >= N_REMEMBERED:
            latest.pop(next(iter(latest)))
        latest[key] = compute()
    return latest[key]


def make_hypothesis(
    context: ModelContext,
    nuisance_prior: NuisancePrior,
    components: tuple[Component, ...],
    *,
    exact: bool = True,
    deadline: Deadline = NO_LIMIT,
) -> Hypothesis:
    """Make a hypothesis.

    Parameters
    ----------
    context : ModelContext
        Model, layout and tolerances.
    nuisance_prior : NuisancePrior
        Prior of the nuisance parameters.
    components : tuple of Component
        Empty for the nominal model.
    exact : bool
        Add the static shapes that the last component needs; without them a global scan is faster. Those of the
        components before it are added always: what one more component changes is compared with a fit of theirs.
    deadline : Deadline
        When no further step of a fit is made.

    Returns
    -------
    Hypothesis
        To evaluate.
    """
    parameters = tuple(component.effect.parameters(context, component.location) for component in components)
    builders = build_together(context, [(component.effect, component.location) for component in components])
    basis, moved = replace(context.basis), NO_CHANGE  # a copy remembers what this hypothesis needs, and no other
    typicals = [
        (component is not components[-1], typical_change(context, component.effect, component.location, build))
        for component, build in zip(components, builders, strict=True)
    ]
    for is_known, typical in sorted(
        typicals, key=lambda entry: entry[1].model is None
    ):  # an exchanged model comes first
        moved = moved + Change(moved=typical.moved)
        if exact or is_known or typical.released or typical.model is not None:
            basis = enrich_basis(basis, typical)
    return Hypothesis(
        components=components,
        parameters=tuple(parameter for group in parameters for parameter in group),
        builders=builders,
        counts=tuple(len(group) for group in parameters),
        basis=basis,
        rows=make_motion_rows(basis, context.layout, moved, nuisance_prior),
        context=context,
        nuisance_prior=nuisance_prior,
        deadline=deadline,
    )
