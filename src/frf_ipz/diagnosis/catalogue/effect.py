"""What a module of the catalogue has to say about its effect.

An effect is one module with one class that derives from `Effect`. It says where the effect could sit, which numbers it
has and within which bounds, and what it changes for given numbers; everything else (search, fit, evidence, verdict,
report) follows from that. A class in a user's own file does the same::

    # my_effects.py, named in pipeline.toml: [diagnose] extra_effects = ["my_effects.py:Sloshing"]
    from frf_ipz.diagnosis.catalogue.effect import Effect, Parameter, Signature, list_node_locations
    from frf_ipz.diagnosis.model.change import Attachment, Change

    class Sloshing(Effect):
        name = "sloshing"

        def locations(self, context):
            return list_node_locations(context)
        ...
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.model.motion import Motion

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.model.change import Change
    from frf_ipz.diagnosis.result import Estimate

Builder = Callable[[FloatArray], "Change"]
"""From the values of the parameters to what is changed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """A number that an effect has.

    Parameters
    ----------
    name : str
        As in `diagnosis.json`, with its unit at the end.
    low, high : float
        Bounds; the prior is uniform between them, or uniform in the logarithm.
    is_log : bool
        The logarithm is what is searched along: for what is known to a factor.
    neutral : float
        The value at which the effect vanishes; 0 or infinity for most, 1 for ratios.
    tolerance : float
        Distance from the neutral value that a user's tolerances allow; smaller effects are not significant.

    Examples
    --------
    >>> import frf_ipz
    >>> round(frf_ipz.Parameter(name="mass_kg", low=0.001, high=0.1).typical, 6)
    0.01
    """

    name: str
    low: float
    high: float
    is_log: bool = True
    neutral: float = 0.0
    tolerance: float = 0.0

    @property
    def typical(self) -> float:
        """A value at which the effect acts."""
        if not self.is_log:
            return 0.3 * self.high
        middle = float(np.sqrt(self.low * self.high))
        return middle if not np.isclose(middle, self.neutral, rtol=0.05) else 1.3 * middle


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Signature:
    """An effect as one dynamic stiffness on one motion, or on each of several, for a fast search.

    Parameters
    ----------
    motion : (n_all,) array, or Motion
        Weights of all DOFs, or those that are not zero.
    shapes : (n_shapes, n_points) complex array
        Dynamic stiffness along the contour for amplitude 1.
    values : (n_shapes, n_parameters) array
        Values of the parameters that each shape stands for, for amplitude 1.
    amplitude : int
        The parameter that multiplies the dynamic stiffness.
    amplitudes : (n,) array, optional
        What to try; chosen from the structure's own stiffness where it is left out.
    further_motions : tuple of Motion
        Other motions that the same dynamic stiffness acts on, each by itself: a mass acts in all directions.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> s = 2j * np.pi * np.array([10.0, 20.0])
    >>> mass = frf_ipz.Signature(motion=np.array([0.0, 1.0]), shapes=s[None] ** 2, values=np.ones((1, 1)))
    >>> mass.amplitude
    0
    """

    motion: FloatArray | Motion
    shapes: ComplexArray
    values: FloatArray
    amplitude: int = 0
    amplitudes: FloatArray | None = None
    further_motions: tuple[Motion, ...] = ()

    @property
    def motions(self) -> tuple[Motion, ...]:
        """All motions that it acts on."""
        return (Motion.of(self.motion), *self.further_motions)


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """An effect as a motion that a channel reads instead of the stated one, for a fast search.

    Parameters
    ----------
    channel : str
        An output with one position.
    motion : Motion
        What it reads, with its sign.
    """

    channel: str
    motion: Motion


class Effect(ABC):
    """One thing that a nominal model may lack.

    Examples
    --------
    >>> import frf_ipz
    >>> class Ballast(frf_ipz.Effect):
    ...     name = "ballast"
    ...     def locations(self, context):
    ...         return [frf_ipz.Location.at_node(dof.node) for dof in context.moving_dofs]
    ...     def parameters(self, context, location):
    ...         return (frf_ipz.Parameter(name="mass_kg", low=1e-3, high=1.0),)
    ...     def build(self, context, location):
    ...         matrix = context.model.mass_all * 0
    ...         row = context.model.full_index(frf_ipz.Dof(location.node, "x"))
    ...         unit = matrix.tolil()
    ...         unit[row, row] = 1.0
    ...         return lambda values: frf_ipz.Change(mass=values[0] * unit.tocsr())
    ...     def statement(self, context, location, values):
    ...         return f"Ballast of {values['mass_kg'].value:.3g} kg at node {location.node}."
    >>> import numpy as np
    >>> stiffness = 1e5 * np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    >>> dofs = ["1:x", "2:x", "3:x"]
    >>> masses = np.diag([2.0, 1.0, 1.0])
    >>> model = frf_ipz.StructuralModel.from_matrices(masses, stiffness, dofs=dofs, modal_damping=0.01)
    >>> heavier = frf_ipz.StructuralModel.from_matrices(
    ...     masses + np.diag([0.0, 0.0, 0.2]), stiffness, dofs=dofs, modal_damping=0.01
    ... )
    >>> lines = np.arange(5, 100.0, 0.5)
    >>> first, accelerance = frf_ipz.Dof(1, "x"), frf_ipz.FrfQuantity.ACCELERANCE
    >>> labels = [frf_ipz.FrfLabel(frf_ipz.parse_dof(dof), first, accelerance) for dof in dofs]
    >>> values = frf_ipz.compute_frfs(heavier, labels, 2j * np.pi * lines)[:, :, None]
    >>> frfs = frf_ipz.FrfSet.from_arrays(
    ...     lines, values, outputs=dofs, inputs=["1:x"], variance=np.full(values.shape, 2e-6)
    ... )
    >>> options = frf_ipz.DiagnoseOptions(effects=("sensor_gain",))
    >>> frf_ipz.diagnose(frfs, model, options=options, effects=[Ballast()]).verdict
    'explained'
    """

    name: ClassVar[str]
    """As in `diagnosis.json`."""
    has_dynamics: ClassVar[bool] = False
    """Something with dynamics of its own hangs at a location: two of that kind at one location imitate many things."""

    @abstractmethod
    def locations(self, context: ModelContext) -> Sequence[Location]:
        """Say where the effect could sit: nowhere if it does not apply to this kind of model."""

    @abstractmethod
    def parameters(self, context: ModelContext, location: Location) -> tuple[Parameter, ...]:
        """Say which numbers it has there."""

    @abstractmethod
    def build(self, context: ModelContext, location: Location) -> Builder:
        """Give what changes the model or the measuring chain, for values of the parameters."""

    def chain(self, location: Location) -> Builder | None:
        """Give what changes the measuring chain, if that is all that changes: it needs no structure."""
        del location
        return None

    @abstractmethod
    def statement(self, context: ModelContext, location: Location, values: Mapping[str, Estimate]) -> str:
        """Say what it is and where, in one sentence for the user."""

    def signature(self, context: ModelContext, location: Location) -> Signature | None:
        """Give the effect as one dynamic stiffness, if it is one; else it is searched from `start_values`."""
        del context, location
        return None

    def reading(self, context: ModelContext, location: Location) -> Reading | None:
        """Give the effect as what a channel reads instead, if it is that and has no parameters."""
        del context, location
        return None

    def start_values(self, context: ModelContext, location: Location) -> FloatArray:
        """Give values to start from, (n_starts, n_parameters): a grid over the bounds unless it knows better."""
        return grid(self.parameters(context, location), 8)

    def log_prior(self, context: ModelContext, location: Location, values: FloatArray) -> float:
        """Say how likely values at a location are besides bounds and number of locations: log density."""
        del context, location, values
        return 0.0

    def implausibility(self, values: FloatArray) -> str:
        """Say why values that explain a measurement are implausible for this effect; empty where they are not."""
        del values
        return ""

    def texts(self, location: Location) -> Mapping[str, str]:
        """Give parameters that are text: the kind of a filter."""
        del location
        return {}

    def report_value(self, location: Location, name: str, value: float) -> float:
        """Turn a value that was searched into the one that is reported: a sign, for one."""
        del location, name
        return value

    def neighbours(self, context: ModelContext, location: Location) -> Sequence[Location]:
        """Neighbours of a location, to try when it is nearly right."""
        del context, location
        return ()

    def surroundings(self, context: ModelContext, location: Location) -> Sequence[Location]:
        """Locations further around one, with the same parameters: the best few are tried if no neighbour is better."""
        del context, location
        return ()


def grid(parameters: Sequence[Parameter], count: int) -> FloatArray:
    """Spread values over the bounds of parameters.

    Parameters
    ----------
    parameters : sequence of Parameter
        What to spread over.
    count : int
        Number of values along each.

    Returns
    -------
    (n_values, n_parameters) array
        All combinations.
    """
    axes = [
        np.geomspace(parameter.low, parameter.high, count + 2)[1:-1]
        if parameter.is_log
        else np.linspace(parameter.low, parameter.high, count + 2)[1:-1]
        for parameter in parameters
    ]
    return np.array(list(product(*axes))).reshape(count ** len(axes), len(axes))


def list_node_locations(context: ModelContext) -> list[Location]:
    """List every node that can move in a direction of the test.

    Parameters
    ----------
    context : ModelContext
        Model, layout and tolerances.

    Returns
    -------
    list of Location
        By node.
    """
    return [Location.at_node(dof.node, dof.direction) for dof in context.moving_dofs]


def list_neighbouring_nodes(context: ModelContext, location: Location) -> list[Location]:
    """List the nodes next to one.

    Parameters
    ----------
    context : ModelContext
        Model, layout and tolerances.
    location : Location
        At a node, in a direction.

    Returns
    -------
    list of Location
        The nearest ones, the same but for the node.
    """
    beside = context.neighbouring_nodes(location.node, location.direction)
    return [replace(location, nodes=(node,)) for node in beside]
