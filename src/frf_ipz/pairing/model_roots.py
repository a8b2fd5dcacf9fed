"""Poles and zeros of a reduced model, in the order of the indices in pairs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray
from frf_ipz.numerics.pencils import Roots, damped_poles
from frf_ipz.numerics.pole_forms import DampedModel, every_damped_zero

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.dofs import AnyDof
    from frf_ipz.frf import FrfLabel
    from frf_ipz.structure import ReducedModel

RIGID = 1e-9  # slope over the largest one below which a root is a double one at zero
REAL = 1e-6  # imaginary part over modulus below which a root is real: rounding of a double root
UNSTABLE = 1e-4  # real part over modulus above which a zero lies in the right half plane
MIRRORED = 0.5  # distance of a mirrored zero from its image, over the real part, up to which the two are a quadruple


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ModelPoles:
    """Poles of a model and their amplitudes in each FRF.

    Parameters
    ----------
    values : (n,) complex array
        By ascending modulus, one a conjugate pair, rad/s.
    amplitudes : (n, n_frfs) complex array
        Mass-normalised product of the shape at sensor and excitation: the receptance's residue times ``2 i |p|``, 1/kg;
        without FRFs the mass-normalised shape at each DOF, 1/sqrt(kg).
    """

    values: ComplexArray
    amplitudes: ComplexArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ModelZeros:
    """Zeros of one FRF of a model.

    Parameters
    ----------
    values : (n,) complex array
        By ascending modulus, one a conjugate pair or quadruple, rad/s.
    kind : tuple of str
        ``complex``, ``real`` or ``quadruple``.
    slope_sign : (n,) array
        Sign of the receptance's slope along the frequency axis at the zero.
    """

    values: ComplexArray
    kind: tuple[str, ...]
    slope_sign: FloatArray

    def up_to(self, limit_rad_s: float) -> ModelZeros:
        """Select those up to a modulus.

        Parameters
        ----------
        limit_rad_s : float
            The modulus, rad/s.

        Returns
        -------
        ModelZeros
            The first ones.
        """
        count = int(np.searchsorted(np.abs(self.values), limit_rad_s, side="right"))
        return ModelZeros(values=self.values[:count], kind=self.kind[:count], slope_sign=self.slope_sign[:count])


def model_poles(model: ReducedModel, labels: tuple[FrfLabel, ...]) -> ModelPoles:
    """Compute the poles of a model.

    Parameters
    ----------
    model : ReducedModel
        The model.
    labels : tuple of FrfLabel
        The measured FRFs.

    Returns
    -------
    ModelPoles
        Signs of sensors and excitations are in the amplitudes.
    """
    roots = damped_poles(model.mass, model.damping, model.stiffness)
    roots = roots.take(_one_of_each_pair(roots.values))
    outputs = np.array([model.row(label.output_dof) for label in labels])
    inputs = np.array([model.row(label.input_dof) for label in labels])
    products = (outputs @ roots.right_vectors) * (inputs @ roots.left_vectors)
    # a rigid-body mode is a double root: it has no residue, and no measured mode is one
    is_simple = np.abs(roots.slope) > RIGID * np.abs(roots.slope).max(initial=0.0)
    residues = np.where(is_simple, products / np.where(is_simple, roots.slope, 1.0), 0.0)
    return ModelPoles(values=roots.values, amplitudes=(residues * 2j * np.abs(roots.values)).T)


def model_shapes(model: ReducedModel, dofs: tuple[AnyDof, ...]) -> ModelPoles:
    """Compute the poles of a model with their shapes at some DOFs.

    Parameters
    ----------
    model : ReducedModel
        The model.
    dofs : tuple of Dof
        Where modes were measured; their signs do not count.

    Returns
    -------
    ModelPoles
        Its amplitudes are the shapes.
    """
    roots = damped_poles(model.mass, model.damping, model.stiffness)
    roots = roots.take(_one_of_each_pair(roots.values))
    shapes = np.array([model.row(dof.unsigned) for dof in dofs]) @ roots.right_vectors
    modal_mass = np.sqrt(np.abs(np.einsum("ik,ij,jk->k", roots.right_vectors.conj(), model.mass, roots.right_vectors)))
    return ModelPoles(values=roots.values, amplitudes=(shapes / modal_mass).T)


def model_zeros(model: ReducedModel, labels: Sequence[FrfLabel], *, limit_rad_s: float = np.inf) -> list[ModelZeros]:
    """Compute the zeros of FRFs of a model.

    Parameters
    ----------
    model : ReducedModel
        The model.
    labels : sequence of FrfLabel
        Which FRFs.
    limit_rad_s : float
        Modulus up to which zeros are asked for; all finite ones where it is left out.

    Returns
    -------
    list of ModelZeros
        Of each FRF; those below a limit have the same indices as among all.
    """
    if not labels:
        return []
    outputs = np.array([model.row(label.output_dof) for label in labels])
    inputs = np.array([model.row(label.input_dof) for label in labels])
    has_limit = np.isfinite(limit_rad_s)
    by_poles = DampedModel.of(model.mass, model.damping, model.stiffness) if has_limit else None
    if by_poles is not None:
        # of a quadruple one may lie below the limit and the other above
        every = by_poles.zeros_up_to(outputs, inputs, limit_rad_s * (1 + MIRRORED))
        found = [_zeros_of(by_poles, *frf) for frf in zip(every, outputs, inputs, strict=True)]
        return [zeros.up_to(limit_rad_s) for zeros in found]
    roots = every_damped_zero(model.mass, model.damping, model.stiffness, outputs, inputs)
    found = [_zeros_with_vectors(model, *frf) for frf in zip(roots, outputs, inputs, strict=True)]
    return [zeros.up_to(limit_rad_s) for zeros in found]


def _zeros_of(model: DampedModel, values: ComplexArray, output: FloatArray, force: FloatArray) -> ModelZeros:
    values = values[np.argsort(np.abs(values), kind="stable")]
    kinds, is_listed = _kinds(values)
    values = values[is_listed]
    return ModelZeros(
        values=values,
        kind=tuple(kind for kind, listed in zip(kinds, is_listed, strict=True) if listed),
        slope_sign=np.sign((1j * model.slopes(output, force, values)).real),
    )


def _zeros_with_vectors(model: ReducedModel, upper: Roots, output: FloatArray, force: FloatArray) -> ModelZeros:
    order = np.argsort(np.abs(upper.values), kind="stable")
    upper = upper.take(order)
    kinds, is_listed = _kinds(upper.values)
    upper = upper.take(np.flatnonzero(is_listed))
    return ModelZeros(
        values=upper.values,
        kind=tuple(kind for kind, listed in zip(kinds, is_listed, strict=True) if listed),
        slope_sign=_slope_sign(model, upper, output, force),
    )


def _one_of_each_pair(values: ComplexArray) -> np.ndarray:
    """Select one root a conjugate pair; real ones (rigid-body, overdamped) come in pairs as well."""
    is_real = np.abs(values.imag) <= REAL * np.abs(values)
    real = np.flatnonzero(is_real)
    real = real[np.argsort(np.abs(values[real]))][::2]
    chosen = np.concatenate([np.flatnonzero((values.imag > 0) & ~is_real), real])
    return np.asarray(chosen[np.argsort(np.abs(values[chosen]), kind="stable")])


def _kinds(values: ComplexArray) -> tuple[list[str], BoolArray]:
    """Kind of every zero of the upper half plane; of a quadruple only the one in the left half plane is listed."""
    modulus = np.abs(values)
    kinds = [
        "real" if abs(value.imag) <= REAL * size else "complex" for value, size in zip(values, modulus, strict=True)
    ]
    is_listed = np.ones(len(values), bool)
    for index in np.flatnonzero((values.real > UNSTABLE * modulus) & (np.array(kinds) == "complex")):
        image = -values[index].conj()
        distance = np.where(is_listed & (values.real < 0), np.abs(values - image), np.inf)
        twin = int(np.argmin(distance))
        if distance[twin] <= MIRRORED * values[index].real:
            kinds[twin] = "quadruple"
            is_listed[index] = False
    return kinds, is_listed


def _slope_sign(model: ReducedModel, zeros: Roots, output: FloatArray, force: FloatArray) -> FloatArray:
    """Sign of dH/d omega at zeros of H(s) = c P(s)^-1 b; 0 where a pole lies on the zero.

    The vectors of a zero are held by the sensor and driven by the excitation: P x = a b and y^T P = h c, so
    H' = -c P^-1 P' P^-1 b = -(y^T P' x) / (a h), which needs no inverse of a P that may be singular.
    """
    powers = ((2, model.mass), (1, model.damping), (0, model.stiffness))
    driven = sum(zeros.values**power * (force @ matrix @ zeros.right_vectors) for power, matrix in powers)
    held = sum(zeros.values**power * (output @ matrix.T @ zeros.left_vectors) for power, matrix in powers)
    return np.asarray(np.sign((-1j * zeros.slope * np.conj(driven * held)).real))
