"""A state-space model with named and dimensioned inputs and outputs."""

from __future__ import annotations

from dataclasses import dataclass

from frf_ipz.arrays import FloatArray, require_shape


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StateSpaceModel:
    """x' = A x + B u, y = C x + D u, or its discrete counterpart.

    Parameters
    ----------
    A, B, C, D : arrays
        (n_states, n_states), (n_states, n_inputs), (n_outputs, n_states), (n_outputs, n_inputs), SI units.
    dt : float
        Sample time in s; 0 for continuous time.
    input_names, output_names, state_names : tuple of str
        Inputs and outputs are DOF labels with the signs of the test.
    input_units, output_units : tuple of str
        SI units.
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

    def __post_init__(self) -> None:
        states, inputs, outputs = len(self.state_names), len(self.input_names), len(self.output_names)
        require_shape("A", self.A, (states, states))
        require_shape("B", self.B, (states, inputs))
        require_shape("C", self.C, (outputs, states))
        require_shape("D", self.D, (outputs, inputs))
