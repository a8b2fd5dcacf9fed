"""Maximum-likelihood poles by variable projection [Golub1973].

Residues and smooth terms are eliminated: only the poles iterate. With weights of one over the standard deviation the
misfit is minus twice the log likelihood, and its Gauss-Newton matrix is the Fisher information of the poles.

[Golub1973] G. H. Golub, V. Pereyra, The differentiation of pseudo-inverses and nonlinear least squares problems whose
variables separate, SIAM J. Numerical Analysis 10, 1973, 413-432, doi:10.1137/0710036.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray
from frf_ipz.identification.likelihood.compression import CompressedSystem, compress
from frf_ipz.identification.measured_lines import WeightedLines
from frf_ipz.numerics.levenberg_marquardt import LeastSquaresStatus, LevenbergMarquardt, NormalEquations, minimise
from frf_ipz.rational import damping_ratio

if TYPE_CHECKING:
    from frf_ipz.identification.likelihood.smooth_terms import SmoothTerms

MAX_ITERATIONS = 30
SETTINGS = LevenbergMarquardt(
    steps=MAX_ITERATIONS,
    initial_damping=1e-4,
    predicted_decrease=0.02,  # of minus twice the log likelihood: less is no gain that data could show
)
MAX_STEP = 0.7  # of a pole's distance from the imaginary axis, or of a line where that is larger
MAX_RATIO = 0.4  # damping ratio above which a pole is no mode but background
MERGED = 0.02  # of the distance from the axis: two poles closer than this are one
POLE_BAND = (0.7, 1.1)  # of the edges of the band: how far a pole may leave it


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RefinedPoles:
    """Poles at the optimum.

    Parameters
    ----------
    system : CompressedSystem
        The data around the poles.
    information : (2 n_poles, 2 n_poles) array
        Fisher information of the poles: all real parts, then all imaginary parts.
    discarded : (n_discarded,) complex array
        Poles that were discarded: they left the band, became background, or merged with another.
    has_converged : bool
        No step gains anything that data could show.
    """

    system: CompressedSystem
    information: FloatArray
    discarded: ComplexArray
    has_converged: bool

    @property
    def poles(self) -> ComplexArray:
        """(n_poles,) complex array, rad/s."""
        return self.system.poles

    @property
    def misfit(self) -> float:
        """Weighted sum of squares."""
        return float(np.sum(self.system.misfit))


def refine_poles(
    data: WeightedLines, poles: ComplexArray, terms: SmoothTerms, *, iterations: int = MAX_ITERATIONS
) -> RefinedPoles:
    """Iterate poles to the maximum of the likelihood.

    Parameters
    ----------
    data : WeightedLines
        Lines and weights.
    poles : (n_poles,) complex array
        Where to start, rad/s.
    terms : SmoothTerms
        Terms for modes out of band.
    iterations : int
        Largest number of steps, those that are rejected included.

    Returns
    -------
    RefinedPoles
        The optimum.
    """
    refinement = _Refinement(
        data=data,
        terms=terms,
        line=float(np.median(np.diff(data.s.imag))),
        band=(float(data.s.imag[0]), float(data.s.imag[-1])),
        discarded=[],
    )
    settings = replace(SETTINGS, steps=iterations, trials=iterations)
    optimum = minimise(refinement, refinement.compress_valid(poles), settings, revise=refinement.discard_invalid)
    return RefinedPoles(
        system=optimum.point,
        information=optimum.linearise().matrix,
        discarded=np.array(refinement.discarded, complex),
        has_converged=optimum.status is LeastSquaresStatus.CONVERGED,
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Refinement:
    """What is minimised over the poles; those that are no modes are discarded on the way."""

    data: WeightedLines
    terms: SmoothTerms
    line: float
    band: tuple[float, float]
    discarded: list[complex]

    def cost(self, system: CompressedSystem) -> float:
        """Sum the weighted squares."""
        return float(np.sum(system.misfit))

    def linearise(self, system: CompressedSystem) -> NormalEquations:
        """Give information and gradient of the poles, residues eliminated: all real parts, then all imaginary parts."""
        n, n_poles = system.n_linear, system.n_poles
        # the Jacobian of an FRF is the real part of C times its residues, and minus the imaginary part: so products
        # of C serve all FRFs of a system
        C = system.U[:, n:, n : n + n_poles] - 1j * system.U[:, n:, n + n_poles :]
        residues = system.scaled_residues().reshape(len(C), len(system.z) // len(C), n_poles)
        rows = system.z[:, n:].reshape(len(C), len(system.z) // len(C), 2 * n_poles)
        transposed, residues_transposed = C.transpose(0, 2, 1), residues.transpose(0, 2, 1)
        hermitian = np.sum((transposed.conj() @ C) * (residues_transposed.conj() @ residues), axis=0)
        symmetric = np.sum((transposed @ C) * (residues_transposed @ residues), axis=0)
        real, imag = (hermitian.real + symmetric.real) / 2, (hermitian.real - symmetric.real) / 2
        mixed = -(hermitian.imag + symmetric.imag) / 2
        gradient = np.sum((rows @ C) * residues, axis=(0, 1))
        return NormalEquations(
            matrix=np.block([[real, mixed], [mixed.T, imag]]), right=np.concatenate([gradient.real, -gradient.imag])
        )

    def move(self, system: CompressedSystem, _equations: NormalEquations, step: FloatArray) -> CompressedSystem:
        """Compress the data around the poles that a step leads to."""
        return compress(self.data, _stepped_poles(system.poles, step, self.line), self.terms)

    def discard_invalid(self, system: CompressedSystem) -> CompressedSystem:
        """Drop the poles that are no modes, if there are any."""
        return self.compress_valid(system.poles) if _is_invalid(system.poles, self.band).any() else system

    def compress_valid(self, poles: ComplexArray) -> CompressedSystem:
        """Compress the data around the poles that may be modes."""
        invalid = _is_invalid(poles, self.band)
        self.discarded.extend(poles[invalid].tolist())
        return compress(self.data, poles[~invalid], self.terms)


def pole_jacobian(system: CompressedSystem) -> FloatArray:
    """Differentiate each FRF by the poles, without the part that residues can follow.

    Parameters
    ----------
    system : CompressedSystem
        The data around the poles.

    Returns
    -------
    (n_frfs, 2 n_poles, 2 n_poles) array
        In the orthonormal basis of the compressed rows.
    """
    n, n_poles = system.n_linear, system.n_poles
    D = system.U[:, n:, n:]
    residues = system.scaled_residues()[:, None]
    a, b = residues.real, residues.imag
    real, imag = D[:, :, :n_poles], D[:, :, n_poles:]
    return np.concatenate([real * a + imag * b, imag * a - real * b], axis=2)


def _stepped_poles(poles: ComplexArray, step: FloatArray, line: float) -> ComplexArray:
    n = len(poles)
    change = step[:n] + 1j * step[n:]
    limit = MAX_STEP * np.maximum(-poles.real, line / 4)
    change *= np.minimum(1.0, limit / np.maximum(np.abs(change), np.finfo(float).tiny))
    stepped = poles + change
    # a pole stays in the left half plane and in the upper one
    real = np.where(stepped.real < 0, stepped.real, 0.3 * poles.real)
    return np.asarray(real + 1j * np.abs(stepped.imag))


def _is_invalid(poles: ComplexArray, band: tuple[float, float]) -> BoolArray:
    """Mark poles outside the band, overdamped ones, and all but one of those that have merged."""
    outside = (poles.imag < POLE_BAND[0] * band[0]) | (poles.imag > POLE_BAND[1] * band[1])
    distance = np.abs(poles[:, None] - poles)
    closest = np.where(np.tri(len(poles), dtype=bool), np.inf, distance).min(axis=1, initial=np.inf)
    return np.asarray(outside | (damping_ratio(poles) > MAX_RATIO) | (closest < MERGED * -poles.real))
