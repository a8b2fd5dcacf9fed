"""FRFs and poles of a model, full or reduced, at any complex frequency.

A full model is expressed in its modes: a small one in all of them, a large one in those up to three times the highest
frequency, with the rest as a series in s^2 whose first term is their exact static flexibility.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arguments import require_each, require_type, take_array
from frf_ipz.arrays import ComplexArray, FloatArray, Matrix
from frf_ipz.fe.assembly import multiply
from frf_ipz.fe.eigen import ModalBasis, mode_damping_ratios, solve_basis
from frf_ipz.frf import FrfLabel
from frf_ipz.numerics.factorization import DENSE_ORDER
from frf_ipz.numerics.pencils import damped_poles
from frf_ipz.structure import ReducedModel, StructuralModel

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.dofs import AnyDof

MODES_BEYOND = 3.0  # times the highest frequency: modes above follow in the series
SERIES_TERMS = 5  # the last one is off by (1/3)^10 of the first mode beyond
COUPLED_ORDER = 100  # modes that viscous damping may couple; with more DOFs, only those up to MODES_BEYOND
COUPLING = 1e-9  # of the geometric mean of the diagonal terms: damping below couples no modes
LINES_AT_ONCE = 256  # so that stacks of small matrices take some MB
NEAR_ZERO = 1e-6  # of the lowest other frequency, or rad/s: where 0 Hz is evaluated
NO_STIFFNESS = 64.0  # roundings of the largest omega^2, times the condition of the mass: no stiffness
REAL_POLE = 1e-12  # of the modulus: imaginary part of a pole that is real


def compute_frfs(model: StructuralModel | ReducedModel, labels: Sequence[FrfLabel], s: ComplexArray) -> ComplexArray:
    """Evaluate FRFs of a model.

    Parameters
    ----------
    model : StructuralModel or ReducedModel
        The model.
    labels : sequence of FrfLabel
        Outputs, inputs, signs and quantities of the FRFs.
    s : (n_lines,) complex array
        Laplace variable, rad/s: i omega, or sigma + i omega. At s = 0 the FRF just beside is given, since
        the receptance of a free structure is infinite there.

    Returns
    -------
    (n_lines, n_frfs) complex array
        SI, in the quantity and with the signs of each label.

    Raises
    ------
    InputError
        If the model lacks a DOF or holds it.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> beam = frf_ipz.make_beam(
    ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=10,
    ...     left="clamped", modal_ratio=0.01,
    ... )
    >>> tip = frf_ipz.Dof(11, "z")
    >>> receptance = frf_ipz.FrfLabel(tip, tip, frf_ipz.FrfQuantity.RECEPTANCE)
    >>> float(frf_ipz.compute_frfs(beam, [receptance], np.array([0.0]))[0, 0].real.round(6))
    0.002857
    >>> round(0.5**3 / (3 * 70e9 * 0.02 * 0.005**3 / 12), 6)
    0.002857
    """
    require_type("model", model, StructuralModel, ReducedModel)
    require_each("labels", labels, FrfLabel)
    s = take_array("the Laplace variable s", s, np.complex128)
    moduli = np.abs(s[s != 0])
    s = np.where(s == 0, NEAR_ZERO * (moduli.min() if moduli.size else 1.0), s).astype(np.complex128)
    if isinstance(model, ReducedModel):
        receptance = _reduced_receptances(model, labels, s)
    else:
        receptance = _modal_receptances(model, labels, s)
    powers = np.array([label.quantity.power for label in labels])
    return np.asarray(receptance * s[:, None] ** powers)


def model_poles(model: StructuralModel | ReducedModel, *, up_to_hz: float | None = None) -> ComplexArray:
    """Poles of a model.

    Parameters
    ----------
    model : StructuralModel or ReducedModel
        The model.
    up_to_hz : float, optional
        Only poles up to this modulus over 2 pi, Hz; needed for a large model.

    Returns
    -------
    (n_poles,) complex array
        rad/s, by ascending modulus; of a conjugate pair the one with the positive imaginary part. Real poles are listed
        one by one: an undamped rigid-body mode has two of them, at 0.

    Raises
    ------
    InputError
        If a large model is given without `up_to_hz`.
    """
    if isinstance(model, ReducedModel):
        poles = _pencil_poles(model.mass, model.damping, model.stiffness)
    else:
        basis = solve_basis(model, up_to_hz=up_to_hz)
        damping = _modal_damping(model, basis)
        if damping.ndim == 1:
            root = np.sqrt((damping / 2) ** 2 - basis.eigenvalues.astype(np.complex128))
            poles = np.concatenate([-damping / 2 + root, -damping / 2 - root])
        else:
            poles = _pencil_poles(np.eye(len(damping)), damping, np.diag(basis.eigenvalues))
    poles = _upper_half(poles)
    return poles if up_to_hz is None else poles[np.abs(poles) <= 2 * np.pi * up_to_hz]


@dataclass(frozen=True, slots=True, eq=False)
class _Ends:
    """Output and input DOFs of FRFs, each once, and the products of the signs."""

    outputs: list[AnyDof]
    inputs: list[AnyDof]
    output_of: list[int]
    input_of: list[int]
    sign: FloatArray

    @classmethod
    def of_labels(cls, labels: Sequence[FrfLabel]) -> _Ends:
        outputs = list(dict.fromkeys(label.output_dof.unsigned for label in labels))
        inputs = list(dict.fromkeys(label.input_dof.unsigned for label in labels))
        return cls(
            outputs,
            inputs,
            [outputs.index(label.output_dof.unsigned) for label in labels],
            [inputs.index(label.input_dof.unsigned) for label in labels],
            np.array([label.sign for label in labels], dtype=float),
        )


def _reduced_receptances(model: ReducedModel, labels: Sequence[FrfLabel], s: ComplexArray) -> ComplexArray:
    ends = _Ends.of_labels(labels)
    outputs = np.array([model.row(dof) for dof in ends.outputs])
    inputs = np.array([model.row(dof) for dof in ends.inputs])
    receptance = _solve_receptances(s, (model.mass, model.damping, model.stiffness), outputs, inputs)
    return np.asarray(receptance[:, ends.output_of, ends.input_of] * ends.sign)


def _modal_receptances(model: StructuralModel, labels: Sequence[FrfLabel], s: ComplexArray) -> ComplexArray:
    ends = _Ends.of_labels(labels)
    output_rows, input_rows = model.rows(ends.outputs), model.rows(ends.inputs)
    basis = _basis_up_to(model, s)
    outputs, inputs = np.asarray(output_rows @ basis.shapes), np.asarray(input_rows @ basis.shapes)
    damping = _modal_damping(model, basis)
    if damping.ndim == 1:
        resonance = 1 / (s[:, None] ** 2 + s[:, None] * damping + basis.eigenvalues)
        receptance = resonance @ (outputs[ends.output_of] * inputs[ends.input_of]).T
    else:
        matrices = (np.eye(len(damping)), damping, np.diag(basis.eigenvalues))
        receptance = _solve_receptances(s, matrices, outputs, inputs)[:, ends.output_of, ends.input_of]
    if len(basis.eigenvalues) < len(basis.shapes):
        terms = _flexibility_series(basis, output_rows, input_rows)[:, ends.output_of, ends.input_of]
        receptance = receptance + sum(term * (-(s[:, None] ** 2)) ** power for power, term in enumerate(terms))
    return np.asarray(receptance * ends.sign)


def _basis_up_to(model: StructuralModel, s: ComplexArray) -> ModalBasis:
    order = int(np.count_nonzero(~model.fixed))
    if order <= (COUPLED_ORDER if model.damping_all.count_nonzero() else DENSE_ORDER - 1):
        return solve_basis(model)
    highest_hz = float(np.abs(s).max()) / (2 * np.pi)
    return solve_basis(model, up_to_hz=MODES_BEYOND * highest_hz)


def _modal_damping(model: StructuralModel, basis: ModalBasis) -> FloatArray:
    """Damping in modal coordinates, 2 zeta omega: (n,) where it couples no modes, else (n, n)."""
    ratios = mode_damping_ratios(model, basis.eigenvalues, basis.shapes, basis.n_rigid)
    stated = 2 * ratios * basis.omega_rad_s
    if not model.damping_all.count_nonzero():
        return stated
    viscous = np.asarray(basis.shapes.T @ multiply(model.damping, basis.shapes))
    diagonal = np.diag(viscous)
    coupling = np.abs(viscous - np.diag(diagonal))
    if (coupling <= COUPLING * np.sqrt(np.outer(np.abs(diagonal), np.abs(diagonal)))).all():
        return stated + diagonal
    return viscous + np.diag(stated)


def _flexibility_series(basis: ModalBasis, output_rows: Matrix, input_rows: Matrix) -> FloatArray:
    """Sum phi phi^T / omega^2, / omega^4, ... over the modes beyond, (n_terms, n_outputs, n_inputs)."""
    # flexibility is symmetric: load the side that has fewer DOFs
    fewer_inputs = input_rows.shape[0] <= output_rows.shape[0]
    loaded, observed = (input_rows, output_rows) if fewer_inputs else (output_rows, input_rows)
    loads = loaded.toarray().T
    terms = []
    for _ in range(SERIES_TERMS):
        deflection = basis.residual_flexibility(loads)
        term = np.asarray(observed @ deflection)
        terms.append(term if fewer_inputs else term.T)
        loads = np.asarray(multiply(basis.mass, deflection))
    return np.array(terms)


def _solve_receptances(
    s: ComplexArray, matrices: tuple[FloatArray, FloatArray, FloatArray], outputs: FloatArray, inputs: FloatArray
) -> ComplexArray:
    """Receptances of small matrices (mass, damping, stiffness), (n_lines, n_outputs, n_inputs)."""
    mass, damping, stiffness = matrices
    blocks = []
    for start in range(0, len(s), LINES_AT_ONCE):
        part = s[start : start + LINES_AT_ONCE, None, None]
        dynamic = part**2 * mass + part * damping + stiffness
        blocks.append(outputs @ np.linalg.solve(dynamic, np.broadcast_to(inputs.T, (len(part), *inputs.T.shape))))
    return np.concatenate(blocks)


def _pencil_poles(mass: FloatArray, damping: FloatArray, stiffness: FloatArray) -> ComplexArray:
    """All poles of small matrices; the double pole of a rigid-body motion, which rounding spreads, is set to 0."""
    poles = damped_poles(mass, damping, stiffness).values
    scale = 1 / np.sqrt(np.diag(mass))
    condition = float(np.linalg.cond(mass * np.outer(scale, scale)))
    largest = np.abs(poles).max(initial=0.0)
    rounding = largest * np.sqrt(NO_STIFFNESS * float(np.finfo(float).eps) * condition)
    return np.asarray(np.where(np.abs(poles) <= rounding, 0.0, poles), np.complex128)


def _upper_half(poles: ComplexArray) -> ComplexArray:
    poles = np.where(np.abs(poles.imag) <= REAL_POLE * np.abs(poles), poles.real + 0j, poles)
    upper = poles[poles.imag >= 0]
    return np.asarray(upper[np.argsort(np.abs(upper), kind="stable")], np.complex128)
