"""A hypothesis: causes at their places, ready to be evaluated for any values of their parameters."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.catalogue.joint_change import build_together, typical_change
from frf_ipz.diagnosis.model.basis import Basis, enrich
from frf_ipz.diagnosis.model.change import NOTHING, Change
from frf_ipz.diagnosis.model.modes import Modes, Modified, Rows, modify, rows_of, scatter
from frf_ipz.diagnosis.model.nuisance import Nuisance
from frf_ipz.diagnosis.model.response import Response, respond

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.effect import Builder, Effect, Parameter, Place
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext


REMEMBERED = 4  # sets of values


@dataclass(frozen=True, slots=True, kw_only=True)
class Cause:
    """An effect at a place.

    Parameters
    ----------
    effect : Effect
        What.
    place : Place
        Where.
    n_places : int
        How many places it could have been: the prior of this one.
    """

    effect: Effect
    place: Place
    n_places: int

    @property
    def key(self) -> tuple[object, ...]:
        """What tells it from others."""
        return (self.effect.name, *self.place.key)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Hypothesis:
    """Causes together, with the coordinates that they need.

    Parameters
    ----------
    causes : tuple of Cause
        Empty for the nominal model.
    parameters : tuple of Parameter
        Of all causes in turn.
    builders : tuple of Builder
        Of each cause.
    counts : tuple of int
        Number of parameters of each cause.
    basis : Basis
        Coordinates.
    rows : Rows
        Sensors and blows in them.
    specimen : ModelContext
        What is tested.
    nuisance : Nuisance
        What cannot be known.
    """

    causes: tuple[Cause, ...]
    parameters: tuple[Parameter, ...]
    builders: tuple[Builder, ...]
    counts: tuple[int, ...]
    basis: Basis
    rows: Rows
    specimen: ModelContext
    nuisance: Nuisance
    _latest: dict[bytes, Modified] = field(init=False, default_factory=dict, repr=False)

    @property
    def key(self) -> tuple[tuple[object, ...], ...]:
        """What tells it from others."""
        return tuple(cause.key for cause in self.causes)

    @property
    def low(self) -> FloatArray:
        """Lower bounds as searched."""
        return self.searched(np.array([parameter.low for parameter in self.parameters]))

    @property
    def high(self) -> FloatArray:
        """Upper bounds as searched."""
        return self.searched(np.array([parameter.high for parameter in self.parameters]))

    def start_at(self, values: FloatArray) -> FloatArray:
        """Turn physical values, brought within the bounds, into what is searched along."""
        bounds = [(parameter.low, parameter.high) for parameter in self.parameters]
        inside = [np.clip(value, low, high) for value, (low, high) in zip(values, bounds, strict=True)]
        return np.clip(self.searched(np.array(inside)), self.low, self.high)

    def searched(self, values: FloatArray) -> FloatArray:
        """Turn physical values into what is searched along: logarithms, or parts of the range."""
        return np.array(
            [
                np.log(value) if parameter.is_log else value / (parameter.high - parameter.low)
                for parameter, value in zip(self.parameters, values, strict=True)
            ]
        )

    def physical(self, searched: FloatArray) -> FloatArray:
        """Turn what is searched along into physical values."""
        return np.array(
            [
                np.exp(value) if parameter.is_log else value * (parameter.high - parameter.low)
                for parameter, value in zip(self.parameters, searched, strict=True)
            ]
        )

    def change(self, values: FloatArray) -> Change:
        """Everything that is changed for physical values of the parameters."""
        total = NOTHING
        for build, own in zip(self.builders, self._split(values), strict=True):
            total = total + build(own)
        return total

    def doubts(self, values: FloatArray) -> tuple[str, ...]:
        """Why each cause is rather something else; empty where it is not."""
        own = self._split(values)
        return tuple(cause.effect.doubt(mine) for cause, mine in zip(self.causes, own, strict=True))

    def log_prior(self, values: FloatArray) -> float:
        """How likely the places are, and the values beside their bounds, nats."""
        return sum(
            cause.effect.log_prior(self.specimen, cause.place, own) - float(np.log(cause.n_places))
            for cause, own in zip(self.causes, self._split(values), strict=True)
        )

    def _split(self, values: FloatArray) -> list[FloatArray]:
        return np.split(values, np.cumsum(self.counts)[:-1]) if self.counts else []

    def modes(self, values: FloatArray, unknown: FloatArray) -> Modes:
        """Modes for physical values of the parameters, and of what cannot be known in standard deviations."""
        return scatter(self.basis, self._modified(values), self.rows, self.nuisance.unpack(unknown))

    def respond(self, values: FloatArray, unknown: FloatArray, s: ComplexArray) -> Response:
        """FRFs for physical values of the parameters, and of what cannot be known in standard deviations."""
        modified, unknowns = self._modified(values), self.nuisance.unpack(unknown)
        modes = scatter(self.basis, modified, self.rows, unknowns)
        return respond(modes, modified.change, self.specimen.layout, unknowns, s, self.basis)

    def _modified(self, values: FloatArray) -> Modified:
        """Solve without scatter, once for the latest values: steps try several scatters for the same."""
        key = values.tobytes()
        if key not in self._latest:
            if len(self._latest) >= REMEMBERED:
                self._latest.pop(next(iter(self._latest)))
            self._latest[key] = modify(self.basis, self.change(values))
        return self._latest[key]


def suppose(specimen: ModelContext, nuisance: Nuisance, causes: tuple[Cause, ...], *, exact: bool = True) -> Hypothesis:
    """Make a hypothesis.

    Parameters
    ----------
    specimen : ModelContext
        What is tested.
    nuisance : Nuisance
        What cannot be known.
    causes : tuple of Cause
        Empty for the nominal model.
    exact : bool
        Add the static shapes that the last cause needs; without them a wide search is faster. Those of the causes
        before it are added always: what one more cause changes is compared with a fit of theirs.

    Returns
    -------
    Hypothesis
        To evaluate.
    """
    parameters = tuple(cause.effect.parameters(specimen, cause.place) for cause in causes)
    builders = build_together(specimen, [(cause.effect, cause.place) for cause in causes])
    basis, moved = specimen.basis, NOTHING
    typicals = [
        (cause is not causes[-1], typical_change(specimen, cause.effect, cause.place, build))
        for cause, build in zip(causes, builders, strict=True)
    ]
    for is_known, typical in sorted(typicals, key=lambda one: one[1].model is None):  # an exchanged model comes first
        moved = moved + Change(moved=typical.moved)
        if exact or is_known or typical.released or typical.model is not None:
            basis = enrich(basis, typical)
    return Hypothesis(
        causes=causes,
        parameters=tuple(parameter for own in parameters for parameter in own),
        builders=builders,
        counts=tuple(len(own) for own in parameters),
        basis=basis,
        rows=rows_of(basis, specimen.layout, moved, nuisance),
        specimen=specimen,
        nuisance=nuisance,
    )
