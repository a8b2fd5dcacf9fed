"""State spaces of second-order models, as bare matrices: modes as states, delays in series, sampling.

The states are each mode's displacement times a rate w and its velocity, in mass-normalised coordinates: with
``w = omega`` a mode is a rotation, ``[[0, omega], [-omega, -2 zeta omega]]``, and the matrices are of one size, which
is what the solvers of control design need. The modes are those without damping of the symmetric part; their
coupling (damping that is not modal, an unsymmetric stiffness by `ipz`) stays in the matrices, so nothing is lost.
"""

from __future__ import annotations

from math import factorial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.linalg import block_diag, expm

from frf_ipz.arrays import FloatArray
from frf_ipz.errors import InputError
from frf_ipz.numerics.pencils import undamped_poles

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.structure import ReducedModel

RIGID = 1e-6  # of the highest natural frequency: lower bound of the rate by which a mode is scaled


class Matrices(NamedTuple):
    """A state space without names: A, B, C and D."""

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: FloatArray


class SecondOrder(NamedTuple):
    """``z'' + G z' + L z = P u``, ``y_j = d^p_j/dt^p_j (Q z)_j``.

    ``damping`` (n, n) in 1/s, ``stiffness`` (n, n) in 1/s^2, ``inputs`` (n, n_inputs), ``outputs`` (n_outputs, n), and
    ``flexibility`` (n_outputs, n_inputs): displacement per force of the part without states.
    """

    damping: FloatArray
    stiffness: FloatArray
    inputs: FloatArray
    outputs: FloatArray
    flexibility: FloatArray


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
    shapes = undamped_poles(model.mass, (model.stiffness + model.stiffness.T) / 2).right_vectors.real
    return SecondOrder(
        damping=shapes.T @ model.damping @ shapes,
        stiffness=shapes.T @ model.stiffness @ shapes,
        inputs=shapes.T @ input_rows.T,
        outputs=output_rows @ shapes,
        flexibility=np.zeros((len(output_rows), len(input_rows))),
    )


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
    rates = np.maximum(rates, RIGID * rates.max())
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


def discretise(system: Matrices, sample_time_s: float) -> Matrices:
    """Discretise for inputs that are held between samples.

    Parameters
    ----------
    system : Matrices
        Continuous.
    sample_time_s : float
        Positive.

    Returns
    -------
    Matrices
        Discrete.
    """
    states, inputs = system.B.shape
    augmented = np.zeros((states + inputs, states + inputs))
    augmented[:states] = np.hstack([system.A, system.B]) * sample_time_s
    transition = expm(augmented)
    return Matrices(transition[:states, :states], transition[:states, states:], system.C, system.D)
