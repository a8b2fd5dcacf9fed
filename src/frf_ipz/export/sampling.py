"""State spaces in discrete time: inputs that are held between samples, delays of inputs and of outputs, all exact."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import block_diag, expm

from frf_ipz.export.realization import Matrices

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.arrays import FloatArray, IntArray

WHOLE_SAMPLES = 1e-9  # of a sample: a delay written in decimal digits is whole samples to within rounding


def discretise_with_delays(
    system: Matrices, sample_time_s: float, input_delay_s: float, output_delays_s: Sequence[float]
) -> tuple[Matrices, IntArray]:
    """Discretise for inputs that are held and act late, and outputs that come late: exact for any delay.

    Within a sample the inputs of two samples act one after the other ([FranklinPowellWorkman1998], section 4.3.4). An
    output that is late by a part of a sample is what it was between two samples.

    [FranklinPowellWorkman1998] G. F. Franklin, J. D. Powell, M. Workman, Digital control of dynamic systems, third
    edition, Addison-Wesley, 1998.

    Parameters
    ----------
    system : Matrices
        Continuous.
    sample_time_s : float
        Positive.
    input_delay_s : float
        Of all inputs, 0 or more.
    output_delays_s : sequence of float
        Of each output, 0 or more.

    Returns
    -------
    system : Matrices
        Discrete; behind the states are the inputs of the samples before, the last one first, then the samples before of
        each late output, the last one first.
    n_before : (n_outputs,) int array
        Number of samples before of each output.
    """
    held = _HeldInputs(system=system, sample_time_s=sample_time_s, delay_s=input_delay_s)
    transition, driven = held.state_after(sample_time_s)
    n_states, n_inputs = system.B.shape
    shift = np.kron(np.eye(held.count, k=-1), np.eye(n_inputs))
    A = np.vstack([transition, np.hstack([np.zeros((held.count * n_inputs, n_states)), shift])])
    B = np.vstack([driven, np.kron(np.eye(held.count, 1), np.eye(n_inputs))])
    parts = [_parts_of_delay(delay, sample_time_s) for delay in output_delays_s]
    rows = {after: held.outputs_after(after) for _, after in parts}
    C, D = (np.array([rows[after][part][output] for output, (_, after) in enumerate(parts)]) for part in range(2))
    n_before = np.array([count for count, _ in parts], int)
    return _with_late_outputs(Matrices(A, B, C, D), n_before), n_before


def _parts_of_delay(delay_s: float, sample_time_s: float) -> tuple[int, float]:
    """Whole samples, rounded up, and how long after the first of them the delayed instant is."""
    count = max(ceil(delay_s / sample_time_s - WHOLE_SAMPLES), 0)
    after = count * sample_time_s - delay_s
    return count, after if after > WHOLE_SAMPLES * sample_time_s else 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _HeldInputs:
    """A continuous system whose inputs are held between samples and act late."""

    system: Matrices
    sample_time_s: float
    delay_s: float

    @property
    def count(self) -> int:
        """Number of samples whose inputs are still to act."""
        return _parts_of_delay(self.delay_s, self.sample_time_s)[0]

    @property
    def _change_s(self) -> float:
        """When, after a sample, the next input begins to act."""
        count, after = _parts_of_delay(self.delay_s, self.sample_time_s)
        return self.sample_time_s - after if count else 0.0

    def state_after(self, time_s: float) -> tuple[FloatArray, FloatArray]:
        """Give the state some time after a sample, by states and inputs before, and by the inputs of the sample."""
        old_s = min(self._change_s, time_s)
        whole, new = discretise(self.system, time_s), discretise(self.system, time_s - old_s).B
        return self._of_inputs(whole.A, whole.B - new, new)

    def outputs_after(self, time_s: float) -> tuple[FloatArray, FloatArray]:
        """Give the outputs some time after a sample, by the same."""
        states, inputs = self.state_after(time_s)
        has_changed = time_s >= self._change_s
        unacted = np.zeros_like(self.system.D)
        feedthrough = (unacted, self.system.D) if has_changed else (self.system.D, unacted)
        direct = self._of_inputs(np.zeros_like(self.system.C), *feedthrough)
        return self.system.C @ states + direct[0], self.system.C @ inputs + direct[1]

    def _of_inputs(self, states: FloatArray, old: FloatArray, new: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Place what two inputs do among all: the oldest that is still to act, and the one after it."""
        n_inputs = old.shape[1]
        waiting = np.zeros((len(states), (self.count + 1) * n_inputs))
        if self.count:
            waiting[:, self.count * n_inputs :] = old
            waiting[:, (self.count - 1) * n_inputs : self.count * n_inputs] = new
        else:
            waiting = new
        return np.hstack([states, waiting[:, n_inputs:]]), waiting[:, :n_inputs]


def _with_late_outputs(system: Matrices, n_before: IntArray) -> Matrices:
    """Delay outputs by whole samples."""
    n_states, n_added = len(system.A), int(n_before.sum())
    A = block_diag(system.A, np.zeros((n_added, n_added)))
    B = np.vstack([system.B, np.zeros((n_added, system.B.shape[1]))])
    C, D = np.hstack([system.C, np.zeros((len(system.C), n_added))]), system.D.copy()
    first = n_states
    for output, count in enumerate(n_before.tolist()):
        if count:
            A[first, :n_states], B[first] = system.C[output], system.D[output]
            A[first + 1 : first + count, first : first + count - 1] = np.eye(count - 1)
            C[output], D[output] = 0.0, 0.0
            C[output, first + count - 1] = 1.0
            first += count
    return Matrices(A, B, C, D)


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
    for place in _double_integrators(system.A):  # to the last bit: a pole of 1 + 1e-16 is an unstable one
        rate = system.A[place, place + 1] * sample_time_s
        force = system.B[place + 1] * sample_time_s
        transition[place : place + 2] = 0.0
        transition[place, place : place + 2] = 1.0, rate
        transition[place + 1, place + 1] = 1.0
        transition[place : place + 2, states:] = rate * force / 2, force
    return Matrices(transition[:states, :states], transition[:states, states:], system.C, system.D)


def _double_integrators(A: FloatArray) -> list[int]:
    """Places of displacements whose rate is their velocity's, which nothing but inputs changes."""
    return [
        place
        for place in range(len(A) - 1)
        if not A[place + 1].any() and A[place, place + 1] and np.count_nonzero(A[place]) == 1
    ]
