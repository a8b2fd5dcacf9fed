"""The controller-ready model: a state space with named and dimensioned inputs and outputs.

Sits after updating. Actuators are inputs; sensors and points of interest are outputs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from frf_ipz.arguments import require_type
from frf_ipz.arrays import FloatArray, require_shape
from frf_ipz.display import Concise
from frf_ipz.dofs import as_dofs
from frf_ipz.errors import InputError
from frf_ipz.export.options import ExportOptions
from frf_ipz.export.ports import Ports, choose_ports
from frf_ipz.export.realization import (
    Matrices,
    SecondOrder,
    Selection,
    balance_modes,
    condense_high_modes,
    modal_form,
    select_states,
    take_states,
    to_first_order,
    with_delays,
    with_input_delay,
)
from frf_ipz.export.sampling import discretise_with_delays
from frf_ipz.frf import require_measured
from frf_ipz.numerics.one_thread import on_one_thread
from frf_ipz.updating.scale import MeasuredScale
from frf_ipz.updating.updated_model import UpdatedModel

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import control

    from frf_ipz.dofs import AnyDof
    from frf_ipz.frf import Measured
    from frf_ipz.structure import ReducedModel

ARRAYS = ("A", "B", "C", "D")
MODES_SHOWN = 6
MEMBERS, SIGNIFICANT = 20, 2.0  # of the posterior, and deviations from 0 of a residue that is known to be there
NAMES = ("input_names", "output_names", "state_names", "input_units", "output_units")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class StateSpaceModel(Concise):
    """x' = A x + B u, y = C x + D u, or its discrete counterpart.

    Parameters
    ----------
    A : (n_states, n_states) array
        Dynamics, SI units.
    B : (n_states, n_inputs) array
        Inputs, SI units.
    C : (n_outputs, n_states) array
        Outputs, SI units.
    D : (n_outputs, n_inputs) array
        Feedthrough, SI units.
    dt : float
        Sample time in s; 0 for continuous time.
    input_names, output_names : tuple of str
        DOF labels with the signs of the test, and what they measure where one is measured in several ways.
    state_names : tuple of str
        Names of the states.
    input_units, output_units : tuple of str
        SI units.
    notes : tuple of str
        What was left out, and which poles lie at 0 exactly.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> oscillator = frf_ipz.StateSpaceModel(
    ...     A=np.array([[0.0, 1.0], [-100.0, -0.2]]), B=np.array([[0.0], [1.0]]), C=np.array([[1.0, 0.0]]),
    ...     D=np.zeros((1, 1)), dt=0.0, input_names=("1:+x",), output_names=("1:+x",), state_names=("x", "v"),
    ...     input_units=("N",), output_units=("m",),
    ... )
    >>> oscillator.A.shape
    (2, 2)
    """

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: FloatArray
    dt: float
    input_names: tuple[str, ...]
    output_names: tuple[str, ...]
    state_names: tuple[str, ...]
    input_units: tuple[str, ...]
    output_units: tuple[str, ...]
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name, shape in matrix_shapes({name: getattr(self, name) for name in NAMES}).items():
            require_shape(name, getattr(self, name), shape)


def matrix_shapes(names: Mapping[str, Any]) -> dict[str, tuple[int, int]]:
    """Shapes of the arrays of a state space.

    Parameters
    ----------
    names : mapping of str to sequence of str
        Its ``state_names``, ``input_names`` and ``output_names``.

    Returns
    -------
    dict of str to (int, int)
        Shapes of ``A``, ``B``, ``C`` and ``D``.
    """
    states, inputs, outputs = (len(names[f"{end}_names"]) for end in ("state", "input", "output"))
    return {"A": (states, states), "B": (states, inputs), "C": (outputs, states), "D": (outputs, inputs)}


def make_state_space(
    measured: Measured,
    updated_model: UpdatedModel,
    *,
    points: Sequence[AnyDof | str] = (),
    options: ExportOptions | None = None,
    delays_s: Mapping[str, float] | None = None,
) -> StateSpaceModel:
    """Turn an updated model into a state space.

    Parameters
    ----------
    measured : ModalFit or FrfSet
        What was measured: its excited DOFs are the inputs, its sensors the first outputs.
    updated_model : UpdatedModel
        The updated model.
    points : sequence of Dof or str
        Points of interest: the further outputs, in the quantity of the first FRF unless the options say another.
    options : ExportOptions, optional
        Its form.
    delays_s : mapping of str to float, optional
        Known delay of each delayed output channel, by its column in the recordings.

    Returns
    -------
    StateSpaceModel
        Continuous, or sampled where the options say so.

    Raises
    ------
    InputError
        If nothing was measured, a channel or a point is not known, or residual flexibility is required as feedthrough
        of a velocity or an acceleration.
    """
    _require_exported(measured, updated_model, options, delays_s)
    chosen = options or ExportOptions()
    ports = _ports(measured, updated_model, points, chosen, delays_s)
    system = _modal_system(updated_model.model, updated_model.scale, ports, chosen)
    selection = _select_known_states(system, updated_model, ports, chosen)
    return _to_state_space(system, selection, ports, chosen, scale=updated_model.scale)


def make_state_space_ensemble(
    measured: Measured,
    updated_model: UpdatedModel,
    *,
    points: Sequence[AnyDof | str] = (),
    options: ExportOptions | None = None,
    delays_s: Mapping[str, float] | None = None,
) -> tuple[StateSpaceModel, ...]:
    """Turn members of the posterior into state spaces, for robust design.

    Parameters
    ----------
    measured : ModalFit or FrfSet
        What was measured.
    updated_model : UpdatedModel
        The updated model.
    points : sequence of Dof or str
        Points of interest.
    options : ExportOptions, optional
        Their form; `ensemble` is their number.
    delays_s : mapping of str to float, optional
        Known delay of each delayed output channel.

    Returns
    -------
    tuple of StateSpaceModel
        At most as many as the update has drawn; none where its method draws none.

    Raises
    ------
    InputError
        As for `make_state_space`.
    """
    _require_exported(measured, updated_model, options, delays_s)
    chosen = options or ExportOptions()
    ports = _ports(measured, updated_model, points, chosen, delays_s)
    system = _modal_system(updated_model.model, updated_model.scale, ports, chosen)
    selection = _select_known_states(system, updated_model, ports, chosen)  # one for all: they have the same states
    systems = _systems_of_members(updated_model, ports, chosen, chosen.ensemble)
    return tuple(_to_state_space(system, selection, ports, chosen, scale=updated_model.scale) for system in systems)


def realise_state_space(model: ReducedModel, ports: Ports, options: ExportOptions) -> StateSpaceModel:
    """Turn a reduced model into a state space between ports that are chosen already.

    Parameters
    ----------
    model : ReducedModel
        The model, in the units of its FE model.
    ports : Ports
        Inputs and outputs.
    options : ExportOptions
        Its form.

    Returns
    -------
    StateSpaceModel
        Continuous, or sampled where the options say so.

    Raises
    ------
    InputError
        If residual flexibility is required as feedthrough of a velocity or an acceleration.
    """
    scale = MeasuredScale()
    system = _modal_system(model, scale, ports, options)
    return _to_state_space(system, select_states(system), ports, options, scale=scale)


def to_state_space(
    measured: Measured,
    updated_model: UpdatedModel,
    *,
    points: Sequence[AnyDof | str] = (),
    options: ExportOptions | None = None,
    delays_s: Mapping[str, float] | None = None,
) -> control.StateSpace:
    """Turn an updated model into a state space of python-control.

    Parameters
    ----------
    measured, updated_model, points, options, delays_s
        As for `make_state_space`.

    Returns
    -------
    control.StateSpace
        With the names of inputs, outputs and states; SI units.

    Raises
    ------
    InputError
        As for `make_state_space`.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> beam = frf_ipz.make_beam(
    ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=10,
    ...     left="clamped", modal_ratio=0.01,
    ... )
    >>> lines = np.arange(5, 400.0, 0.5)
    >>> tip, middle = frf_ipz.Dof(11, "z"), frf_ipz.Dof(6, "z")
    >>> labels = [frf_ipz.FrfLabel(output, tip, frf_ipz.FrfQuantity.ACCELERANCE) for output in (middle, tip)]
    >>> values = frf_ipz.compute_frfs(beam, labels, 2j * np.pi * lines)[:, :, None]
    >>> frfs = frf_ipz.FrfSet.from_arrays(
    ...     lines, values, outputs=[middle, tip], inputs=[tip], variance=np.full(values.shape, 1e-4)
    ... )
    >>> fit = frf_ipz.fit_modes(frfs)
    >>> reduced_model = frf_ipz.reduce_model(fit, beam, points=["9:+z"])
    >>> updated_model = frf_ipz.update_model(fit, reduced_model)
    >>> system = frf_ipz.to_state_space(fit, updated_model, points=["9:+z"])
    >>> system.input_labels, system.output_labels
    (['11:+z'], ['6:+z', '11:+z', '9:+z'])
    >>> bool((system.poles().real < 0).all())
    True
    """
    return to_control(make_state_space(measured, updated_model, points=points, options=options, delays_s=delays_s))


@on_one_thread
def to_state_space_ensemble(
    measured: Measured,
    updated_model: UpdatedModel,
    *,
    points: Sequence[AnyDof | str] = (),
    options: ExportOptions | None = None,
    delays_s: Mapping[str, float] | None = None,
) -> list[control.StateSpace]:
    """Turn members of the posterior into state spaces of python-control, for robust design.

    Parameters
    ----------
    measured, updated_model, points, options, delays_s
        As for `make_state_space_ensemble`.

    Returns
    -------
    list of control.StateSpace
        With the names of inputs, outputs and states.

    Raises
    ------
    InputError
        As for `make_state_space`.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> beam = frf_ipz.make_beam(
    ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=10,
    ...     left="clamped", modal_ratio=0.01,
    ... )
    >>> lines = np.arange(5, 400.0, 0.5)
    >>> tip, middle = frf_ipz.Dof(11, "z"), frf_ipz.Dof(6, "z")
    >>> labels = [frf_ipz.FrfLabel(output, tip, frf_ipz.FrfQuantity.ACCELERANCE) for output in (middle, tip)]
    >>> values = frf_ipz.compute_frfs(beam, labels, 2j * np.pi * lines)[:, :, None]
    >>> frfs = frf_ipz.FrfSet.from_arrays(
    ...     lines, values, outputs=[middle, tip], inputs=[tip], variance=np.full(values.shape, 1e-4)
    ... )
    >>> fit = frf_ipz.fit_modes(frfs)
    >>> reduced_model = frf_ipz.reduce_model(fit, beam, points=["9:+z"])
    >>> updated_model = frf_ipz.update_model(fit, reduced_model)
    >>> options = frf_ipz.ExportOptions(ensemble=3)
    >>> len(frf_ipz.to_state_space_ensemble(fit, updated_model, options=options))
    3
    """
    members = make_state_space_ensemble(measured, updated_model, points=points, options=options, delays_s=delays_s)
    return [to_control(member) for member in members]


def to_control(model: StateSpaceModel) -> control.StateSpace:
    """Hand a state space to python-control.

    Parameters
    ----------
    model : StateSpaceModel
        The state space.

    Returns
    -------
    control.StateSpace
        With the names of inputs, outputs and states.
    """
    import control  # here, since it takes a second and loads pyplot

    return control.ss(
        *(np.array(getattr(model, name)) for name in ARRAYS),
        model.dt,
        inputs=list(model.input_names),
        outputs=list(model.output_names),
        states=list(model.state_names),
    )


def from_control(system: control.StateSpace) -> StateSpaceModel:
    """Take a state space of python-control, which knows no units.

    Parameters
    ----------
    system : control.StateSpace
        The state space.

    Returns
    -------
    StateSpaceModel
        With the names of inputs, outputs and states; its units are empty.

    Raises
    ------
    InputError
        If it is no state space.
    """
    try:
        arrays: dict[str, Any] = {name: np.array(getattr(system, name), float) for name in ARRAYS}
        return StateSpaceModel(
            **arrays,
            dt=float(system.dt or 0.0),
            input_names=tuple(system.input_labels),
            output_names=tuple(system.output_labels),
            state_names=tuple(system.state_labels),
            input_units=("",) * system.ninputs,
            output_units=("",) * system.noutputs,
        )
    except (AttributeError, TypeError, ValueError):
        raise InputError(f"a state space is needed, as to_state_space gives it; given is {system!r:.60}") from None


def _require_exported(
    measured: Measured, updated_model: UpdatedModel, options: ExportOptions | None, delays_s: object
) -> None:
    require_measured(measured)
    require_type("updated_model", updated_model, UpdatedModel)
    require_type("options", options, ExportOptions, optional=True)
    require_type("delays_s", delays_s, Mapping, optional=True)


def _modal_system(model: ReducedModel, scale: MeasuredScale, ports: Ports, options: ExportOptions) -> SecondOrder:
    inputs = np.array([scale.input_gain(dof) * model.row(dof) for dof in ports.inputs])
    outputs = np.array([scale.output_gain(port.dof) * model.row(port.dof) for port in ports.outputs])
    system = modal_form(model, inputs, outputs)
    return condense_high_modes(system, model.n_modes) if options.residual == "feedthrough" else system


def _systems_of_members(
    updated_model: UpdatedModel, ports: Ports, options: ExportOptions, count: int
) -> Iterator[SecondOrder]:
    members = updated_model.ensemble[:count]
    scales = updated_model.scale.members(len(members))
    for (mass, damping, stiffness), scale in zip(members, scales, strict=True):
        model = replace(updated_model.model, mass=mass, damping=damping, stiffness=stiffness)
        yield _modal_system(model, scale, ports, options)


def _select_known_states(
    system: SecondOrder, updated_model: UpdatedModel, ports: Ports, options: ExportOptions
) -> Selection:
    """Find the modes that ports drive and see, without those that only noise makes them drive.

    An update bends shapes within what the measurement leaves open: of a mode with a node at the only input the residues
    are no longer 0, but of either sign among the members, where nothing was measured of it.
    """
    selection = select_states(system)
    nominal = _modal_system(updated_model.nominal, updated_model.nominal_scale, ports, options)
    unseen = ~select_states(nominal).elastic
    if unseen.shape != selection.elastic.shape or not (unseen & selection.elastic).any():
        return selection
    members = [_residues(member) for member in _systems_of_members(updated_model, ports, options, MEMBERS)]
    if len(members) < MEMBERS or any(member.shape != members[0].shape for member in members):
        return selection
    of_noise = (np.abs(np.mean(members, axis=0)) <= SIGNIFICANT * np.std(members, axis=0)).all(axis=(1, 2))
    known = selection.elastic & ~(unseen & of_noise)
    return selection._replace(elastic=known) if known.any() or selection.seen else selection


def _residues(system: SecondOrder) -> FloatArray:
    """Give what outputs see of each elastic mode per force, (n_elastic, n_outputs, n_inputs), whatever its sign."""
    elastic = slice(system.n_rigid, None)
    return np.asarray(system.outputs[:, elastic].T[:, :, None] * system.inputs[elastic][:, None, :])


def _to_state_space(
    system: SecondOrder, selection: Selection, ports: Ports, options: ExportOptions, *, scale: MeasuredScale
) -> StateSpaceModel:
    outputs = ports.outputs
    taken = take_states(system, selection)
    matrices = to_first_order(taken, [output.quantity.power for output in outputs])
    matrices = balance_modes(matrices, taken.outputs)
    modes = [f"rigid-body mode {number + 1}" for number in range(selection.seen)]
    modes += [f"mode {system.n_rigid + place + 1}" for place in np.flatnonzero(selection.elastic)]
    names = [f"{mode} {quantity}" for mode in modes for quantity in ("displacement", "velocity")]
    (A, B, C, D), delay_names = _with_delays(matrices, ports, options)
    names += delay_names
    return StateSpaceModel(
        A=A,
        B=B,
        C=C,
        D=D,
        dt=options.sample_time_s,
        input_names=tuple(str(dof) for dof in ports.inputs),
        output_names=tuple(output.name for output in outputs),
        state_names=tuple(names),
        input_units=ports.input_units,
        output_units=tuple(output.unit for output in outputs),
        notes=(*_notes(system, selection), *_scale_notes(scale)),
    )


def _with_delays(system: Matrices, ports: Ports, options: ExportOptions) -> tuple[Matrices, list[str]]:
    """Add the delays of outputs and of the loop, exactly where the model is sampled, and name the states they take."""
    inputs = [str(dof) for dof in ports.inputs]
    delays_s = [output.delay_s for output in ports.outputs]
    if options.sample_time_s > 0:
        sampled, n_before = discretise_with_delays(system, options.sample_time_s, options.delay_s, delays_s)
        n_waiting = (len(sampled.A) - len(system.A) - int(n_before.sum())) // len(inputs)
        names = [f"input {name}, {number + 1} samples before" for number in range(n_waiting) for name in inputs]
        late = zip(ports.outputs, n_before.tolist(), strict=True)
        return sampled, names + [
            f"output {output.name}, {number + 1} samples before" for output, count in late for number in range(count)
        ]
    orders = range(1, options.pade_order + 1)
    names = [f"delay of {output.name} {order}" for output in ports.outputs if output.delay_s > 0 for order in orders]
    system = with_delays(system, delays_s, options.pade_order)
    if options.delay_s > 0:
        system = with_input_delay(system, options.delay_s, options.pade_order)
        names += [f"delay of input {name} {order}" for name in inputs for order in orders]
    return system, names


def _notes(system: SecondOrder, selection: Selection) -> tuple[str, ...]:
    notes = []
    if selection.seen:
        many = selection.seen > 1
        notes.append(
            f"{selection.seen} rigid-body {'modes are double integrators' if many else 'mode is a double integrator'}, "
            "with poles at 0 exactly; methods that want none on the axis need a shift of your choice"
        )
    hertz = np.sqrt(np.abs(np.diag(system.stiffness)[system.n_rigid :])) / (2 * np.pi)
    left_out = [f"a mode at {value:.4g} Hz" for value in hertz[~selection.elastic]]
    count = system.n_rigid - selection.seen
    left_out = [*([f"{count} rigid-body mode{'s' if count > 1 else ''}"] if count else []), *left_out]
    if left_out:
        shown = ", ".join(left_out[:MODES_SHOWN]) + (", ..." if len(left_out) > MODES_SHOWN else "")
        notes.append(f"left out, since no input drives it or no output sees it: {shown}")
    return tuple(notes)


def _scale_notes(scale: MeasuredScale) -> tuple[str, ...]:
    if not scale.is_relative:
        return ()
    place = "; inputs and outputs carry these gains, so the state space gives FRFs as they were measured"
    return (scale.statement + (place if scale.is_fitted else ""),)


def _ports(
    measured: Measured,
    updated_model: UpdatedModel,
    points: Sequence[AnyDof | str],
    options: ExportOptions,
    delays_s: Mapping[str, float] | None,
) -> Ports:
    known = updated_model.model.expanded_dofs
    return choose_ports(measured.connections, list(as_dofs(points)), options, delays_s or {}, known)
