"""Rigid-body modes of a stage, one a channel: combinations of actuators and of sensors.

In the rigid-body coordinates q, ``q'' = B u`` and the sensors' displacements are ``y = C q``. With ``T_y = C^+`` and
``T_u = B^+`` the plant ``T_y G T_u`` is 1/s^2 on its diagonal and 0 beside it, but for the flexible modes: channel by
channel a single-loop controller fits. More actuators or sensors than modes share the work by least squares.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arguments import require_type
from frf_ipz.arrays import FloatArray
from frf_ipz.display import Concise
from frf_ipz.errors import InputError, did_you_mean
from frf_ipz.export.state_space import StateSpaceModel, from_control, to_control
from frf_ipz.numerics.one_thread import on_one_thread

if TYPE_CHECKING:
    from collections.abc import Sequence

    import control

DEPENDENT = 1e-9  # of the largest: combinations of rigid-body modes that no sensor, or no actuator, tells apart
RIGID = "rigid-body mode"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class RigidBodyDecoupling(Concise):
    """Matrices that turn a stage into one channel for each rigid-body mode.

    Parameters
    ----------
    inputs : (n_inputs, n_axes) array
        Commands to the actuators for a unit acceleration of each axis, T_u.
    outputs : (n_axes, n_outputs) array
        Position of each axis from the outputs, T_y; 0 for outputs that are no displacements.
    axes : tuple of str
        Names of the axes.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> mass = frf_ipz.StateSpaceModel(
    ...     A=np.array([[0.0, 1.0], [0.0, 0.0]]), B=np.array([[0.0], [0.5]]), C=np.array([[1.0, 0.0]]),
    ...     D=np.zeros((1, 1)), dt=0.0, input_names=("1:+x",), output_names=("1:+x",),
    ...     state_names=("rigid-body mode 1 displacement", "rigid-body mode 1 velocity"), input_units=("N",),
    ...     output_units=("m",),
    ... )
    >>> decoupling = frf_ipz.decouple_rigid_body(mass)
    >>> decoupling.inputs.tolist(), decoupling.outputs.tolist()
    ([[2.0]], [[1.0]])
    """

    inputs: FloatArray
    outputs: FloatArray
    axes: tuple[str, ...]

    def apply(self, system: control.StateSpace | StateSpaceModel) -> control.StateSpace:
        """Put both matrices around a state space with the same inputs and outputs, such as one with a delay.

        Parameters
        ----------
        system : control.StateSpace or StateSpaceModel
            The plant.

        Returns
        -------
        control.StateSpace
            One input (an acceleration) and one output (a position) for each axis.

        Raises
        ------
        InputError
            If the plant has other numbers of inputs and outputs.
        """
        model = system if isinstance(system, StateSpaceModel) else from_control(system)
        if (len(model.output_names), len(model.input_names)) != (self.outputs.shape[1], self.inputs.shape[0]):
            raise InputError(
                f"the plant has {len(model.output_names)} outputs and {len(model.input_names)} inputs; the decoupling "
                f"is for {self.outputs.shape[1]} and {self.inputs.shape[0]}"
            )
        return to_control(
            replace(
                model,
                B=model.B @ self.inputs,
                C=self.outputs @ model.C,
                D=self.outputs @ model.D @ self.inputs,
                input_names=self.axes,
                output_names=self.axes,
                input_units=("",) * len(self.axes),
                output_units=("",) * len(self.axes),
            )
        )


@on_one_thread
def decouple_rigid_body(
    system: control.StateSpace | StateSpaceModel, *, axes: Sequence[str] = ()
) -> RigidBodyDecoupling:
    """Find the combinations of actuators and sensors in which rigid-body modes do not couple.

    Parameters
    ----------
    system : control.StateSpace or StateSpaceModel
        Exported with displacements among its outputs (``[export] outputs``), without ``delay_s``: the matrices serve
        the plant with a delay as well.
    axes : sequence of str
        Names of displacement outputs, as many as rigid-body modes, that the axes shall be: points of interest, tilts.
        Channel i is then the position of axis i, and its input the acceleration of that axis alone. The rigid-body
        modes of the model (mass-normalised, in no particular directions) where it is left out.

    Returns
    -------
    RigidBodyDecoupling
        Matrices of inputs and outputs.

    Raises
    ------
    InputError
        If there is no rigid-body mode, outputs are no displacements, or actuators, sensors or axes do not move or see
        all rigid-body modes.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> mass = frf_ipz.StateSpaceModel(
    ...     A=np.array([[0.0, 1.0], [0.0, 0.0]]), B=np.array([[0.0], [0.5]]), C=np.array([[1.0, 0.0]]),
    ...     D=np.zeros((1, 1)), dt=0.0, input_names=("1:+x",), output_names=("1:+x",),
    ...     state_names=("rigid-body mode 1 displacement", "rigid-body mode 1 velocity"), input_units=("N",),
    ...     output_units=("m",),
    ... )
    >>> decoupled = frf_ipz.decouple_rigid_body(mass, axes=["1:+x"]).apply(mass)
    >>> abs(complex(decoupled(2j)) * (2j) ** 2)
    1.0
    """
    if isinstance(axes, str) or not isinstance(axes, Iterable):
        raise InputError(f"axes = {axes!r} is no list; give names of outputs such as ['height', 'pitch']")
    model = _as_model(system)
    states = _rigid_states(model)
    step = model.dt or 1.0
    rates = np.array([model.A[place, place + 1] for place in states]) / step
    driven = np.array([model.B[place + 1] for place in states]) / step  # q'' / rate for unit inputs
    seen = np.stack([model.C[:, place] for place in states], axis=1) * rates  # per q, as displacement = rate q
    velocities = np.abs(np.stack([model.C[:, place + 1] for place in states], axis=1)).any(axis=1)
    is_position = np.asarray(np.abs(seen).any(axis=1) & ~velocities, bool)
    if not is_position.any():
        raise InputError(
            "no output is a displacement that sees rigid-body modes; export with outputs = 'displacement', or with a "
            "list that contains it"
        )
    motions = np.where(is_position[:, None], seen, 0.0)
    _require_rank(driven.T, len(states), "the inputs move")
    _require_rank(motions, len(states), "the displacement outputs see")
    basis = _axes(model, motions, axes) if axes else np.eye(len(states))
    names = tuple(axes) or tuple(f"{RIGID} {number + 1}" for number in range(len(states)))
    return RigidBodyDecoupling(
        inputs=np.asarray(np.linalg.pinv(driven) @ np.linalg.inv(basis)),
        outputs=np.asarray(basis @ np.linalg.pinv(motions)),
        axes=names,
    )


def _as_model(system: control.StateSpace | StateSpaceModel) -> StateSpaceModel:
    if isinstance(system, StateSpaceModel):
        return system
    require_type("system", system, object)
    return from_control(system)


def _rigid_states(model: StateSpaceModel) -> list[int]:
    """Places of the displacements of rigid-body modes."""
    names = model.state_names
    states = [place for place, name in enumerate(names) if name.startswith(RIGID) and name.endswith("displacement")]
    if not states:
        raise InputError("the state space has no rigid-body mode; a structure that is held has nothing to decouple")
    if any(name.startswith("delay of ") or name.endswith("samples before") for name in names):
        raise InputError(
            "the state space has a delay at its inputs or outputs; find the decoupling without [export] delay_s (and "
            "with rebuild_state_space where channels are late), and apply it to the state space with it"
        )
    return states


def _axes(model: StateSpaceModel, motions: FloatArray, axes: Sequence[str]) -> FloatArray:
    rows = []
    for name in axes:
        if name not in model.output_names:
            raise InputError(f"'{name}' is no output; {did_you_mean(str(name), model.output_names)}")
        rows.append(motions[model.output_names.index(name)])
    if len(rows) != motions.shape[1]:
        raise InputError(f"{len(rows)} axes are named, and there are {motions.shape[1]} rigid-body modes; name as many")
    _require_rank(np.array(rows), motions.shape[1], "the axes see")
    return np.array(rows)


def _require_rank(rows: FloatArray, needed: int, doing: str) -> None:
    sizes = np.abs(rows).max(axis=1, keepdims=True, initial=0.0)
    scaled = rows / np.where(sizes > 0, sizes, 1.0)
    values = np.linalg.svd(scaled, compute_uv=False)
    rank = int(np.count_nonzero(values > DEPENDENT * max(values.max(initial=0.0), np.finfo(float).tiny)))
    if rank < needed:
        raise InputError(f"{doing} {rank} of {needed} rigid-body modes only; name others, or export more ports")
