"""Tracking of poles and zeros while the model changes: by their vectors, not by their order."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.errors import NumericalError
from frf_ipz.numerics.pencils import Roots, damped_poles, damped_zeros, undamped_poles, undamped_zeros


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TargetRoots:
    """Poles and zeros that are targets.

    Parameters
    ----------
    frf : (n,) int array
        FRF of each target; -1 for poles.
    rows : dict of int to pair of (r,) arrays
        Output and input row of each FRF with zeros among the targets.
    """

    frf: IntArray
    rows: dict[int, tuple[FloatArray, FloatArray]]

    def undamped(self, mass: FloatArray, stiffness: FloatArray) -> dict[int, Roots]:
        """Compute all undamped roots.

        Parameters
        ----------
        mass, stiffness : (r, r) array
            The model.

        Returns
        -------
        dict of int to Roots
            Poles under -1, where any are targets, and the zeros of every FRF, squared.
        """
        poles = {-1: undamped_poles(mass, stiffness)} if (self.frf < 0).any() else {}
        return poles | {number: undamped_zeros(mass, stiffness, *pair) for number, pair in self.rows.items()}

    def damped(self, mass: FloatArray, damping: FloatArray, stiffness: FloatArray) -> dict[int, Roots]:
        """Compute all damped roots.

        Parameters
        ----------
        mass, damping, stiffness : (r, r) array
            The model.

        Returns
        -------
        dict of int to Roots
            Poles under -1, where any are targets, and the zeros of every FRF, rad/s.
        """
        poles = {-1: damped_poles(mass, damping, stiffness)} if (self.frf < 0).any() else {}
        return poles | {number: damped_zeros(mass, damping, stiffness, *pair) for number, pair in self.rows.items()}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrackedRoots:
    """The model's roots that belong to the targets.

    Parameters
    ----------
    groups : tuple of (IntArray, Roots)
        Indices among the targets, and their roots: poles first, then the zeros of each FRF.
    """

    groups: tuple[tuple[IntArray, Roots], ...]

    def values(self, count: int) -> ComplexArray:
        """Give the squared roots in the order of the targets.

        Parameters
        ----------
        count : int
            Number of targets.

        Returns
        -------
        (count,) complex array
            (rad/s)^2.
        """
        values = np.zeros(count, complex)
        for indices, roots in self.groups:
            values[indices] = roots.values
        return values


def nominal_roots(
    targets: TargetRoots, mass: FloatArray, stiffness: FloatArray, computed: ComplexArray
) -> TrackedRoots:
    """Find the undamped roots that the pairing named, by their modulus.

    Parameters
    ----------
    targets : TargetRoots
        Poles and zeros that are targets.
    mass, stiffness : (r, r) array
        Of the nominal model.
    computed : (n,) complex array
        The model's roots with damping, rad/s.

    Returns
    -------
    TrackedRoots
        One root a target.
    """
    groups = []
    for number, roots in targets.undamped(mass, stiffness).items():
        indices = np.flatnonzero(targets.frf == number)
        logs = np.log(np.abs(computed[indices]))
        distance = np.abs(logs[:, None] - 0.5 * np.log(np.abs(roots.values) + np.finfo(float).tiny)[None])
        groups.append((indices, roots.take(_assign(distance))))
    return TrackedRoots(groups=tuple(groups))


def track(targets: TargetRoots, before: TrackedRoots, mass: FloatArray, stiffness: FloatArray) -> TrackedRoots:
    """Find the same roots in a changed model.

    Parameters
    ----------
    targets : TargetRoots
        Poles and zeros that are targets.
    before : TrackedRoots
        In the model before the change.
    mass, stiffness : (r, r) array
        After the change.

    Returns
    -------
    TrackedRoots
        Those whose vectors overlap most with the ones before.
    """
    groups = []
    all_roots = targets.undamped(mass, stiffness)
    for indices, old in before.groups:
        new = all_roots[int(targets.frf[indices[0]])]
        groups.append((indices, new.take(_assign(-_overlap(old, new, mass, new.slope)))))
    return TrackedRoots(groups=tuple(groups))


def with_damping(
    targets: TargetRoots, undamped: TrackedRoots, mass: FloatArray, damping: FloatArray, stiffness: FloatArray
) -> TrackedRoots:
    """Find the damped roots that belong to undamped ones, by their vectors.

    Parameters
    ----------
    targets : TargetRoots
        Poles and zeros that are targets.
    undamped : TrackedRoots
        Squared roots of the same model without damping.
    mass, damping, stiffness : (r, r) array
        The model.

    Returns
    -------
    TrackedRoots
        Of the upper half plane, rad/s.
    """
    groups = []
    all_roots = targets.damped(mass, damping, stiffness)
    for indices, old in undamped.groups:
        new = all_roots[int(targets.frf[indices[0]])]
        new = new.take(np.flatnonzero(new.values.imag > 0))
        groups.append((indices, new.take(_assign(-_overlap(old, new, mass, new.slope / (2 * new.values))))))
    return TrackedRoots(groups=tuple(groups))


def _overlap(old: Roots, new: Roots, mass: FloatArray, norm: ComplexArray) -> FloatArray:
    forward = old.left_vectors.T @ mass @ new.right_vectors
    backward = new.left_vectors.T @ mass @ old.right_vectors
    return np.asarray(np.abs(forward * backward.T) / np.abs(np.outer(old.slope, norm)))


def _assign(cost: FloatArray) -> IntArray:
    rows, columns = linear_sum_assignment(cost)
    if len(rows) < len(cost):
        raise NumericalError("the changed model has fewer poles or zeros than there are targets: look at the pairs")
    return np.asarray(columns[np.argsort(rows)], int)
