"""Models drawn from the posterior of an update: its null space, and the noise of its targets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.late_imports import import_late
from frf_ipz.numerics.pencils import modes_of_stack
from frf_ipz.updating.gaussian import draw_posterior
from frf_ipz.updating.minimal_change.damping import DampingPhase
from frf_ipz.updating.minimal_change.gauss_newton import Phase, PhaseResult
from frf_ipz.updating.minimal_change.modal_frame import ModalFrame, is_negative
from frf_ipz.updating.minimal_change.stiffness import StiffnessPhase
from frf_ipz.updating.parameters import unwhiten
from frf_ipz.updating.tracking import with_damping

if TYPE_CHECKING:
    from scipy.optimize import linear_sum_assignment
else:
    linear_sum_assignment = import_late("scipy.optimize", "linear_sum_assignment")

MOST_HALVINGS = 53  # bits of a number: what is as far as that from a number is the number


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Posterior:
    """Both phases of an update with their results.

    Parameters
    ----------
    frame : ModalFrame
        Coordinates of the stiffness phase.
    stiffness : StiffnessPhase
        With its targets and noise.
    stiffness_result : PhaseResult
        Its result.
    inner : ModalFrame
        Coordinates of the damping phase: modes of the model with updated stiffness, inside `frame`.
    damping : DampingPhase
        With its targets and noise.
    damping_result : PhaseResult
        Its result.
    """

    frame: ModalFrame
    stiffness: StiffnessPhase
    stiffness_result: PhaseResult
    inner: ModalFrame
    damping: DampingPhase
    damping_result: PhaseResult

    def model(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Give mass, damping and stiffness of the updated model, each (r, r)."""
        mass, damping, stiffness = (self.frame.from_modal(matrix) for matrix in self._in_frame())
        return mass, damping, stiffness

    def _in_frame(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Mass, damping and stiffness in the coordinates in which they were updated."""
        mass, stiffness = self.stiffness.matrices(self.stiffness_result.theta)
        return mass, self.inner.from_modal(self.damping.damping(self.damping_result.theta)), stiffness

    def values(self, count: int) -> ComplexArray:
        """Roots of the updated model, followed from the stiffness that was found last: damping came before it.

        Parameters
        ----------
        count : int
            Number of targets.

        Returns
        -------
        (count,) complex array
            rad/s.
        """
        roots, tracked = self.stiffness.target_roots, self.stiffness_result.tracked
        return with_damping(roots, tracked, *self._in_frame()).values(count)


def draw_ensemble(
    posterior: Posterior, rng: np.random.Generator, count: int, *, drawn: FloatArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """Draw models.

    Parameters
    ----------
    posterior : Posterior
        Both phases of an update.
    rng : Generator
        Source of randomness.
    count : int
        Number of models.
    drawn : (count, k) array, optional
        Whitened parameters of their stiffness and mass, where `draw_whitened` has drawn as many with that source.

    Returns
    -------
    members : (count, 3, r, r) array
        Mass, damping and stiffness of each.
    theta : (count, p) array
        Parameters of their stiffness and mass.
    """
    whitened = draw_whitened(posterior, rng, count) if drawn is None else drawn
    theta, mass, stiffness = _stiffness_of(posterior, whitened)
    damping = _draw_damping(posterior, rng, count)
    frame = posterior.frame
    return np.stack([frame.from_modal(mass), frame.from_modal(damping), frame.from_modal(stiffness)], axis=1), theta


def draw_whitened(posterior: Posterior, rng: np.random.Generator, count: int) -> FloatArray:
    """Draw unit normal numbers of the parameters of stiffness and mass.

    Parameters
    ----------
    posterior : Posterior
        Of an update.
    rng : Generator
        Source of randomness.
    count : int
        Number of draws.

    Returns
    -------
    (count, k) array
        Whether or not they make a structure.
    """
    return _draw(posterior.stiffness, posterior.stiffness_result, rng, count)


def parameters_of(posterior: Posterior, whitened: FloatArray) -> FloatArray:
    """Give parameters of stiffness and mass from their unit normal numbers.

    Parameters
    ----------
    posterior : Posterior
        Of an update.
    whitened : (count, k) array
        As drawn.

    Returns
    -------
    (count, p) array
        The parameters.
    """
    return unwhiten(posterior.stiffness.terms, posterior.stiffness_result.scales[:-1], whitened)


def _stiffness_of(posterior: Posterior, drawn: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    phase, result = posterior.stiffness, posterior.stiffness_result
    whitened, theta, mass, stiffness = _with_positive_mass(posterior, drawn)
    # the poles predicted by the linear step are imposed: far from the mean, second-order terms would blur them
    poles = np.flatnonzero(phase.target_roots.frf < 0)
    sensitivity = np.empty((len(poles), result.linear.ends[-1] - result.linear.ends[0]))
    for place, rows in result.linear.sensitivity(result.scales[:-1]):
        is_pole = phase.target_roots.frf[place] < 0
        sensitivity[np.searchsorted(poles, place[is_pole])] = rows[is_pole]
    predicted = (phase.targets - result.error)[poles] + result.linear.combined(
        whitened - result.step.mean
    ) @ sensitivity.T
    squares = np.exp(2 * predicted)
    shapes = next((roots.right_vectors.real for _, roots in result.tracked.groups if len(poles)), None)
    if shapes is None:
        return theta, mass, stiffness
    n_negative = int(np.count_nonzero(is_negative(phase.eigenvalues)))
    return theta, mass, _with_poles(mass, stiffness, shapes, squares, n_negative)


def _with_positive_mass(
    posterior: Posterior, whitened: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Bring members whose mass no machine has, as those of a model that is far off, half way nearer to what was found.

    Its mass is positive; that of the mean of the last linear step need not be, where no step leads there. Gives
    whitened parameters, parameters, mass and stiffness of all.
    """
    phase, result = posterior.stiffness, posterior.stiffness_result
    found = result.whitened
    for number in range(MOST_HALVINGS + 1):
        theta = unwhiten(phase.terms, result.scales[:-1], whitened)
        mass, stiffness = phase.matrices(theta)
        values = np.linalg.eigvalsh(mass)
        is_far = values[:, 0] <= np.finfo(float).eps * values.shape[1] * values[:, -1]
        if not is_far.any() or number == MOST_HALVINGS:
            break
        whitened = np.where(is_far[:, None], found + (whitened - found) / 2, whitened)
    return whitened, theta, mass, stiffness


def _draw(phase: Phase, result: PhaseResult, rng: np.random.Generator, count: int) -> FloatArray:
    """Whitened parameters, (count, k)."""
    scales, factor = result.scales[:-1], float(result.scales[-1])
    return draw_posterior(result.linear, phase.terms, scales, result.noise, rng, count, factor=factor)


def _with_poles(
    mass: FloatArray, stiffness: FloatArray, shapes: FloatArray, squares: FloatArray, n_negative: int
) -> FloatArray:
    """Give squared frequencies to the modes most like some shapes; of the rest as many are negative as the model's."""
    values, vectors = modes_of_stack(mass, stiffness)
    values[:, n_negative:] = np.maximum(values[:, n_negative:], 0.0)
    sides = mass @ vectors
    likeness = (shapes.T @ sides) ** 2
    for member in range(len(values)):
        rows, columns = linear_sum_assignment(-likeness[member])
        values[member, columns] = squares[member, rows]
    return np.asarray((sides * values[:, None, :]) @ sides.swapaxes(1, 2))


def _draw_damping(posterior: Posterior, rng: np.random.Generator, count: int) -> FloatArray:
    phase, result = posterior.damping, posterior.damping_result
    whitened = _draw(phase, result, rng, count)
    members = phase.damping(unwhiten(phase.terms, result.scales[:-1], whitened))
    values, vectors = np.linalg.eigh(members)
    members = (vectors * np.maximum(values, 0.0)[:, None, :]) @ np.swapaxes(vectors, 1, 2)
    return posterior.inner.from_modal(members)
