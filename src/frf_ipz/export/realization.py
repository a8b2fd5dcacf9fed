"""State spaces of second-order models, as bare matrices: modes as states, delays in series.

The states are each mode's displacement times a rate w and its velocity, in mass-normalised coordinates: with
``w = omega`` a mode is a rotation, ``[[0, omega], [-omega, -2 zeta omega]]``, and the matrices are of one size, which
is what the solvers of control design need. The modes are those without damping of the symmetric part; their
coupling (damping that is not modal, an unsymmetric stiffness by `ipz`) stays in the matrices, so nothing is lost.

Rigid-body modes are those that the FE model has found, not modes of a low frequency of the reduced matrices, whose
rounding would turn a double integrator into a stable and an unstable pole: ``[[0, w], [0, 0]]``, exactly.
"""

from __future__ import annotations

from math import factorial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.linalg import block_diag
from scipy.sparse.csgraph import connected_components

from frf_ipz.arrays import BoolArray, FloatArray
from frf_ipz.errors import InputError
from frf_ipz.numerics.pencils import undamped_poles
from frf_ipz.numerics.rigid_motions import mass_normalise, meet_no_force

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.structure import ReducedModel

EPS = float(np.finfo(float).eps)
ROUNDING = (
    1e3 * EPS
)  # of the sum of all terms' sizes: a reduced model's matrices hold the condition number of its modes
LOWEST_RATE = 1e-6  # of the highest natural frequency: lower bound of the rate by which a mode is scaled
UNSEEN = 1e-9  # of the largest residue, coupling or port: no resonance lifts what is below to where it matters


class Matrices(NamedTuple):
    """A state space without names: A, B, C and D."""

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: FloatArray


class SecondOrder(NamedTuple):
    """``z'' + G z' + L z = P u``, ``y_j = d^p_j/dt^p_j (Q z)_j``.

    ``damping`` (n, n) in 1/s, ``stiffness`` (n, n) in 1/s^2, ``inputs`` (n, n_inputs), ``outputs`` (n_outputs, n), and
    ``flexibility`` (n_outputs, n_inputs): displacement per force of the part without states. The first ``n_rigid``
    coordinates are rigid-body modes that nothing strains or damps: their rows and columns of both matrices are 0.
    """

    damping: FloatArray
    stiffness: FloatArray
    inputs: FloatArray
    outputs: FloatArray
    flexibility: FloatArray
    n_rigid: int = 0


class Selection(NamedTuple):
    """States that ports drive and see.

    ``driven`` rigid-body modes, or combinations of them, are moved by inputs, and ``seen`` of these by outputs;
    ``elastic`` marks the modes behind the rigid ones.
    """

    driven: int
    seen: int
    elastic: BoolArray


def modal_form(model: ReducedModel, input_rows: FloatArray, output_rows: FloatArray) -> SecondOrder:
    """Express a reduced model in its mass-normalised modes.

    Parameters
    ----------
    model : ReducedModel
        The model.
    input_rows : (n_inputs, r) array
        Motion of the excited DOFs for unit motions of the retained ones.
    output_rows : (n_outputs, r) array
        The same of the outputs.

    Returns
    -------
    SecondOrder
        Modes by ascending frequency.
    """
    rigid = _unstrained(model)
    shapes = np.column_stack([rigid, _elastic_modes(model, rigid)])
    stiffness, damping = (shapes.T @ matrix @ shapes for matrix in (model.stiffness, model.damping))
    n_rigid = rigid.shape[1]
    for matrix in (stiffness, damping):
        matrix[:n_rigid] = 0.0
        matrix[:, :n_rigid] = 0.0
    return SecondOrder(
        damping=damping,
        stiffness=stiffness,
        inputs=shapes.T @ input_rows.T,
        outputs=output_rows @ shapes,
        flexibility=np.zeros((len(output_rows), len(input_rows))),
        n_rigid=n_rigid,
    )


def _unstrained(model: ReducedModel) -> FloatArray:
    """Rigid-body modes that an update has left without stiffness and damping, mass-normalised, (r, n_rigid) array."""
    if not model.rigid.size:
        return np.zeros((len(model.mass), 0))
    free = meet_no_force(model.stiffness, model.rigid) & meet_no_force(model.damping, model.rigid)
    return mass_normalise(model.rigid[:, free], model.mass)


def _elastic_modes(model: ReducedModel, rigid: FloatArray) -> FloatArray:
    """Mass-normalised modes of the symmetric part beside the rigid ones, by ascending frequency."""
    stiffness = (model.stiffness + model.stiffness.T) / 2
    poles = undamped_poles(model.mass, stiffness)
    beside_rigid = np.sort(np.argsort(np.abs(poles.values), kind="stable")[rigid.shape[1] :])
    shapes = poles.right_vectors.real[:, beside_rigid]
    shapes = shapes - rigid @ (rigid.T @ model.mass @ shapes)
    if not shapes.shape[1]:
        return shapes
    modes = undamped_poles(shapes.T @ model.mass @ shapes, shapes.T @ stiffness @ shapes)
    return np.asarray(shapes @ modes.right_vectors.real)


def select_states(system: SecondOrder) -> Selection:
    """Find the modes that some input drives and some output sees.

    Modes that are coupled, by damping or by an unsymmetric stiffness, are driven and seen together.

    Parameters
    ----------
    system : SecondOrder
        Modes by ascending frequency.

    Returns
    -------
    Selection
        All modes where no port sees any.
    """
    n_rigid = system.n_rigid
    share_in, share_out = _shares(system.inputs.T).max(0), _shares(system.outputs).max(0)
    rates = np.sqrt(np.abs(np.diag(system.stiffness)))[n_rigid:]
    with np.errstate(divide="ignore", invalid="ignore"):  # a mode without stiffness that is no rigid-body mode
        coupling = np.abs(system.damping[n_rigid:, n_rigid:]) / np.sqrt(np.outer(rates, rates))
        coupling = np.maximum(coupling, np.abs(system.stiffness[n_rigid:, n_rigid:]) / np.outer(rates, rates))
    _, group = connected_components(~(coupling <= UNSEEN), directed=False)
    together = group[:, None] == group
    share_in, share_out = (np.max(together * share[n_rigid:], axis=1, initial=0.0) for share in (share_in, share_out))
    elastic = share_in * share_out > UNSEEN
    driven = _rank(system, system.inputs.T, np.eye(n_rigid))
    seen = _rank(system, system.outputs, _leading(system, system.inputs.T, np.eye(n_rigid), driven))
    if not seen and not elastic.any():
        return Selection(n_rigid, n_rigid, np.ones(len(rates), bool))
    return Selection(driven, seen, elastic)


def take_states(system: SecondOrder, selection: Selection) -> SecondOrder:
    """Leave the other modes out.

    Parameters
    ----------
    system : SecondOrder
        Modes by ascending frequency.
    selection : Selection
        Of this system, or of one with the same ports.

    Returns
    -------
    SecondOrder
        With the same FRFs. Its rigid-body modes are combinations of all where not every one is driven and seen.
    """
    n_rigid = system.n_rigid
    turn = _leading(system, system.inputs.T, np.eye(n_rigid), selection.driven)
    turn = _leading(system, system.outputs, turn, selection.seen)
    kept = n_rigid + np.flatnonzero(selection.elastic)
    block = np.ix_(kept, kept)
    zero = np.zeros((selection.seen, selection.seen))
    return SecondOrder(
        damping=block_diag(zero, system.damping[block]),
        stiffness=block_diag(zero, system.stiffness[block]),
        inputs=np.vstack([turn.T @ system.inputs[:n_rigid], system.inputs[kept]]),
        outputs=np.hstack([system.outputs[:, :n_rigid] @ turn, system.outputs[:, kept]]),
        flexibility=system.flexibility,
        n_rigid=selection.seen,
    )


def _shares(rows: FloatArray) -> FloatArray:
    """Share of each mode in each port, of the largest one."""
    largest = np.abs(rows).max(axis=1, keepdims=True, initial=0.0)
    return np.abs(rows) / np.where(largest > 0, largest, 1.0)


def _rank(system: SecondOrder, rows: FloatArray, turn: FloatArray) -> int:
    """Count the combinations of rigid-body modes that take part in some port."""
    sizes = np.linalg.svd(_in_ports(system, rows, turn), compute_uv=False)
    return int(np.count_nonzero(sizes > UNSEEN))


def _leading(system: SecondOrder, rows: FloatArray, turn: FloatArray, count: int) -> FloatArray:
    """Orthogonal combinations of rigid-body modes that take part in ports most, (n_rigid, count) array.

    All have the frequency 0, so that any turn of them is as good; where all take part they stay as they are.
    """
    if count == turn.shape[1]:
        return turn
    _, _, directions = np.linalg.svd(_in_ports(system, rows, turn))
    return np.asarray(turn @ directions[:count].T)


def _in_ports(system: SecondOrder, rows: FloatArray, turn: FloatArray) -> FloatArray:
    largest = np.abs(rows).max(axis=1, keepdims=True, initial=0.0)
    return np.asarray(rows[:, : system.n_rigid] @ turn / np.where(largest > 0, largest, 1.0))


def condense_high_modes(system: SecondOrder, n_modes: int) -> SecondOrder:
    """Retain the lowest modes; the higher ones follow without inertia and damping.

    Parameters
    ----------
    system : SecondOrder
        Modes by ascending frequency.
    n_modes : int
        Number of retained modes.

    Returns
    -------
    SecondOrder
        With the flexibility of the higher modes.
    """
    low, high = slice(0, n_modes), slice(n_modes, None)
    high_stiffness, coupling = system.stiffness[high, high], system.stiffness[low, high]
    by_low = np.linalg.solve(high_stiffness, system.stiffness[high, low])
    by_inputs = np.linalg.solve(high_stiffness, system.inputs[high])
    return SecondOrder(
        damping=system.damping[low, low],
        stiffness=system.stiffness[low, low] - coupling @ by_low,
        inputs=system.inputs[low] - coupling @ by_inputs,
        outputs=system.outputs[:, low] - system.outputs[:, high] @ by_low,
        flexibility=system.flexibility + system.outputs[:, high] @ by_inputs,
        n_rigid=system.n_rigid,
    )


def to_first_order(system: SecondOrder, powers: Sequence[int]) -> Matrices:
    """Turn a second-order model into a state space.

    Parameters
    ----------
    system : SecondOrder
        The model.
    powers : sequence of int
        For each output 0 for its displacement, 1 for its velocity, 2 for its acceleration.

    Returns
    -------
    Matrices
        States: displacement times its rate, then velocity, mode by mode.

    Raises
    ------
    InputError
        If there is a flexibility without states and an output is no displacement: its derivative is not proper.
    """
    power = np.asarray(powers)
    if system.flexibility.any() and power.any():
        raise InputError(
            "[export] residual = 'feedthrough' needs outputs = 'displacement': a velocity or an acceleration of a "
            "part without states is not proper; use residual = 'dynamics', or displacements"
        )
    count = len(system.stiffness)
    rates = np.sqrt(np.abs(np.diag(system.stiffness)))
    elastic = np.maximum(rates[system.n_rigid :], LOWEST_RATE * rates.max(initial=0.0))
    elastic = np.where(elastic > 0, elastic, 1.0)
    rates = np.concatenate([np.full(system.n_rigid, elastic.min(initial=np.inf)), elastic])
    rates = np.where(np.isfinite(rates), rates, 1.0)  # nothing is elastic: any rate will do
    A, B = np.zeros((2 * count, 2 * count)), np.zeros((2 * count, system.inputs.shape[1]))
    A[::2, 1::2] = np.diag(rates)
    A[1::2, ::2], A[1::2, 1::2] = -system.stiffness / rates, -system.damping
    B[1::2] = system.inputs
    C, D = np.zeros((len(power), 2 * count)), system.flexibility.copy()
    C[power == 0, ::2] = system.outputs[power == 0] / rates
    C[power == 1, 1::2] = system.outputs[power == 1]
    C[power == 2] = system.outputs[power == 2] @ A[1::2]
    D[power == 2] = system.outputs[power == 2] @ system.inputs
    return Matrices(A, B, C, D)


def balance_modes(system: Matrices, outputs: FloatArray) -> Matrices:
    """Scale the two states of each mode so that inputs drive them as much as outputs see their velocities.

    The coordinates are then balanced but for terms of the order of the damping ([Gawronski2004], section 4.2), and
    those of a rigid-body mode are scaled alike. The blocks of modes in A stay as they are. States do not depend on the
    quantities of the outputs: exports of the same ports in several quantities have the same A and B.

    [Gawronski2004] W. K. Gawronski, Advanced structural dynamics and active control of structures, Springer, 2004,
    doi:10.1007/978-0-387-21836-6.

    Parameters
    ----------
    system : Matrices
        Of `to_first_order`.
    outputs : (n_outputs, n_modes) array
        Motion of each output for unit motions of the modes.

    Returns
    -------
    Matrices
        With the same FRFs.
    """
    n_modes = outputs.shape[1]
    driven = np.linalg.norm(system.B.reshape(n_modes, -1), axis=1)
    seen = np.linalg.norm(np.unique(outputs, axis=0), axis=0)  # each port once, whatever its quantities
    is_minimal = (driven > 0) & (seen > 0)
    factors = np.repeat(np.sqrt(np.where(is_minimal, seen, 1.0) / np.where(is_minimal, driven, 1.0)), 2)
    ratios = factors[:, None] / factors  # exactly 1 within a mode
    return Matrices(system.A * ratios, system.B * factors[:, None], system.C / factors, system.D)


def with_input_delay(system: Matrices, delay_s: float, order: int) -> Matrices:
    """Delay all inputs of a continuous system by a Pade approximant.

    Parameters
    ----------
    system : Matrices
        Continuous.
    delay_s : float
        Positive.
    order : int
        Of the approximant, 1 or more.

    Returns
    -------
    Matrices
        With the states of the approximants at the end.
    """
    n_inputs = system.B.shape[1]
    A, B, C, D = (np.kron(np.eye(n_inputs), part) for part in pade_delay(delay_s, order))
    zero = np.zeros((len(A), len(system.A)))
    return Matrices(
        np.block([[system.A, system.B @ C], [zero, A]]),
        np.vstack([system.B @ D, B]),
        np.hstack([system.C, system.D @ C]),
        system.D @ D,
    )


def pade_delay(delay_s: float, order: int) -> Matrices:
    """Realise the diagonal Pade approximant of a delay.

    Parameters
    ----------
    delay_s : float
        Positive.
    order : int
        1 or more.

    Returns
    -------
    Matrices
        One input, one output, all-pass; `order` states.

    Examples
    --------
    >>> A, B, C, D = pade_delay(2.0, 1)
    >>> float(A[0, 0]), float(D[0, 0])  # (1 - s) / (1 + s)
    (-1.0, -1.0)
    """
    powers = np.arange(order, -1, -1)
    scale = [
        factorial(2 * order - k) * factorial(order) / (factorial(2 * order) * factorial(k) * factorial(order - k))
        for k in powers
    ]
    below = np.array(scale) / scale[0]  # of s delay, descending, monic
    sign = (-1.0) ** powers
    A = np.vstack([-below[1:], np.eye(order)[:-1]])
    feedthrough = sign[0]
    C = sign[1:] * below[1:] - feedthrough * below[1:]
    # the lines above are for time in units of the delay
    return Matrices(A / delay_s, np.eye(order)[:, :1] / delay_s, C[None], np.array([[feedthrough]]))


def with_delays(system: Matrices, delays_s: Sequence[float], order: int) -> Matrices:
    """Delay outputs.

    Parameters
    ----------
    system : Matrices
        Continuous.
    delays_s : sequence of float
        Delay of each output; 0 for none.
    order : int
        Order of the Pade approximants.

    Returns
    -------
    Matrices
        With the states of the approximants at the end.
    """
    delayed = [index for index, delay in enumerate(delays_s) if delay > 0]
    if not delayed or not order:
        return system
    delays = [pade_delay(delays_s[index], order) for index in delayed]
    A, B, C, D = (block_diag(*(delay[part] for delay in delays)) for part in range(4))
    n_states, n_added = len(system.A), len(A)
    outputs = np.hstack([system.C, np.zeros((len(system.C), n_added))])
    outputs[delayed] = np.hstack([D @ system.C[delayed], C])
    feedthrough = system.D.copy()
    feedthrough[delayed] = D @ system.D[delayed]
    return Matrices(
        np.block([[system.A, np.zeros((n_states, n_added))], [B @ system.C[delayed], A]]),
        np.vstack([system.B, B @ system.D[delayed]]),
        outputs,
        feedthrough,
    )
