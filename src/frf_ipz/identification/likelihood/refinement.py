"""Maximum-likelihood poles by variable projection [Golub1973].

Residues and smooth terms are eliminated: only the poles iterate. With weights of one over the standard deviation the
misfit is minus twice the log likelihood, and its Gauss-Newton matrix is the Fisher information of the poles.

[Golub1973] G. H. Golub, V. Pereyra, The differentiation of pseudo-inverses and nonlinear least squares problems whose
variables separate, SIAM J. Numerical Analysis 10, 1973, 413-432, doi:10.1137/0710036.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray
from frf_ipz.identification.likelihood.compression import Compressed, compress
from frf_ipz.identification.measured_lines import Weighted
from frf_ipz.rational import damping_ratio

if TYPE_CHECKING:
    from frf_ipz.identification.likelihood.smooth_terms import SmoothTerms

MAX_ITERATIONS = 30
SMALL_GAIN = 0.02  # of minus twice the log likelihood: less is no gain that data could show
LONGEST_STEP = 0.7  # of a pole's distance from the imaginary axis, or of a line where that is larger
FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-4, 1e-10, 1e8  # of the step, by the diagonal of the information
MAX_RATIO = 0.4  # damping ratio above which a pole is no mode but background
MERGED = 0.02  # of the distance from the axis: two poles closer than this are one
BESIDE = (0.7, 1.1)  # a free pole may leave the band by that much


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Refined:
    """Poles at the optimum.

    Parameters
    ----------
    system : Compressed
        The data around the poles.
    information : (2 n_poles, 2 n_poles) array
        Fisher information of the poles: all real parts, then all imaginary parts.
    lost : (n_lost,) complex array
        Poles that the iteration gave up: they ran out of the band, into the background or into one another.
    has_converged : bool
        No step gains anything that data could show.
    """

    system: Compressed
    information: FloatArray
    lost: ComplexArray
    has_converged: bool

    @property
    def poles(self) -> ComplexArray:
        """(n_poles,) complex array, rad/s."""
        return self.system.poles

    @property
    def misfit(self) -> float:
        """Weighted sum of squares."""
        return float(np.sum(self.system.misfit))


def refine(data: Weighted, poles: ComplexArray, terms: SmoothTerms, *, iterations: int = MAX_ITERATIONS) -> Refined:
    """Iterate poles to the maximum of the likelihood.

    Parameters
    ----------
    data : Weighted
        Lines and weights.
    poles : (n_poles,) complex array
        Where to start, rad/s.
    terms : SmoothTerms
        What lies out of band.
    iterations : int
        At most so many steps.

    Returns
    -------
    Refined
        The optimum.
    """
    line = float(np.median(np.diff(data.s.imag)))
    band = float(data.s.imag[0]), float(data.s.imag[-1])
    lost: list[complex] = []
    system, poles = _without_lost(data, poles, terms, band, lost)
    damping, count, has_converged = FIRST_DAMPING, 0, False
    information, gradient = normal_equations(system)
    while count < iterations and len(system.poles):
        count += 1
        step, gain = _damped_step(information, gradient, damping)
        if gain < SMALL_GAIN:
            has_converged = True
            break
        trial = compress(data, _moved(system.poles, step, line), terms)
        if np.sum(trial.misfit) > np.sum(system.misfit):
            damping *= 10
            if damping > MOST_DAMPING:
                break
            continue
        damping = max(damping / 10, LEAST_DAMPING)
        system = trial
        if (_gone(system.poles, band)).any():
            system, _ = _without_lost(data, system.poles, terms, band, lost)
        information, gradient = normal_equations(system)
    return Refined(system=system, information=information, lost=np.array(lost, complex), has_converged=has_converged)


def normal_equations(system: Compressed) -> tuple[FloatArray, FloatArray]:
    """Information and gradient of the poles, residues eliminated.

    Parameters
    ----------
    system : Compressed
        The data around the poles.

    Returns
    -------
    information : (2 n_poles, 2 n_poles) array
        Of all real parts, then all imaginary parts, (s/rad)^2.
    gradient : (2 n_poles,) array
        Of the log likelihood, s/rad.
    """
    jacobian = pole_jacobian(system)
    flat = jacobian.reshape(jacobian.shape[0] * jacobian.shape[1], jacobian.shape[2])
    return flat.T @ flat, flat.T @ system.z[:, system.n_linear :].ravel()


def pole_jacobian(system: Compressed) -> FloatArray:
    """Differentiate each FRF by the poles, less what residues can follow.

    Parameters
    ----------
    system : Compressed
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


def _damped_step(information: FloatArray, gradient: FloatArray, damping: float) -> tuple[FloatArray, float]:
    scale = np.sqrt(np.diag(information))
    scale = np.where(scale > 0, scale, 1.0)
    matrix = information / np.outer(scale, scale) + damping * np.eye(len(scale))
    step = linalg.solve(matrix, gradient / scale, assume_a="sym", check_finite=False) / scale
    return step, float(2 * step @ gradient - step @ information @ step)


def _moved(poles: ComplexArray, step: FloatArray, line: float) -> ComplexArray:
    n = len(poles)
    change = step[:n] + 1j * step[n:]
    longest = LONGEST_STEP * np.maximum(-poles.real, line / 4)
    change *= np.minimum(1.0, longest / np.maximum(np.abs(change), np.finfo(float).tiny))
    moved = poles + change
    # a pole stays in the left half plane and in the upper one
    real = np.where(moved.real < 0, moved.real, 0.3 * poles.real)
    return np.asarray(real + 1j * np.abs(moved.imag))


def _gone(poles: ComplexArray, band: tuple[float, float]) -> BoolArray:
    outside = (poles.imag < BESIDE[0] * band[0]) | (poles.imag > BESIDE[1] * band[1])
    distance = np.abs(poles[:, None] - poles)
    closest = np.where(np.tri(len(poles), dtype=bool), np.inf, distance).min(axis=1, initial=np.inf)
    return np.asarray(outside | (damping_ratio(poles) > MAX_RATIO) | (closest < MERGED * -poles.real))


def _without_lost(
    data: Weighted, poles: ComplexArray, terms: SmoothTerms, band: tuple[float, float], lost: list[complex]
) -> tuple[Compressed, ComplexArray]:
    gone = _gone(poles, band)
    lost.extend(poles[gone].tolist())
    return compress(data, poles[~gone], terms), poles[~gone]
