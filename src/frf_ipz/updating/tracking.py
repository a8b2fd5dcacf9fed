"""Tracking of poles and zeros while the model changes: by their vectors, not by their order.

The zeros of all FRFs are followed together, from where the first order puts them (`numerics.pole_forms`). Where one
does not keep the greater part of its vectors, or two end at one root, all zeros of that FRF are computed and assigned.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from frf_ipz.errors import NumericalError
from frf_ipz.late_imports import import_late
from frf_ipz.numerics.pencils import Roots, damped_poles, damped_zeros, undamped_poles
from frf_ipz.numerics.pole_forms import (
    DampedModel,
    PoleForm,
    damped_form,
    every_damped_zero,
    every_undamped_zero,
    undamped_form,
)

if TYPE_CHECKING:
    from scipy.optimize import linear_sum_assignment
else:
    linear_sum_assignment = import_late("scipy.optimize", "linear_sum_assignment")

SAME_ROOT = 0.5  # overlap of its vectors with those before, above which no other root can be more alike
APART = 1e-9  # relative distance below which two zeros of an FRF are one
NEAR = 0.05  # of the logarithm of the modulus: a zero farther from the one that was named may be another
UNMOVED = 1e-6  # relative distance of a zero that is the same but for rounding


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

    @property
    def poles(self) -> IntArray:
        """Targets that are poles."""
        return np.flatnonzero(self.frf < 0)

    @property
    def zeros(self) -> IntArray:
        """Targets that are zeros."""
        return np.flatnonzero(self.frf >= 0)

    def outputs(self, targets: IntArray) -> FloatArray:
        """Output row of each of some zeros.

        Parameters
        ----------
        targets : (k,) int array
            Which targets.

        Returns
        -------
        (k, r) array
            Motion of the sensor.
        """
        return np.array([self.rows[number][0] for number in self.frf[targets].tolist()])

    def inputs(self, targets: IntArray) -> FloatArray:
        """Input row of each of some zeros.

        Parameters
        ----------
        targets : (k,) int array
            Which targets.

        Returns
        -------
        (k, r) array
            Motion of the excited DOF.
        """
        return np.array([self.rows[number][1] for number in self.frf[targets].tolist()])

    def every_zero(self, frfs: list[int], mass: FloatArray, damping: FloatArray, stiffness: FloatArray) -> list[Roots]:
        """Compute all zeros of some FRFs.

        Parameters
        ----------
        frfs : list of int
            Numbers of the FRFs.
        mass, damping, stiffness : (r, r) array
            The model.

        Returns
        -------
        list of Roots
            Of each FRF those with an imaginary part of at least 0, rad/s.
        """
        if not frfs:
            return []
        return every_damped_zero(mass, damping, stiffness, *self._rows_of(frfs))

    def zeros_up_to(
        self, limit_rad_s: float, frfs: list[int], mass: FloatArray, damping: FloatArray, stiffness: FloatArray
    ) -> list[ComplexArray]:
        """Compute the zeros of some FRFs up to a frequency.

        Parameters
        ----------
        limit_rad_s : float
            Largest modulus, rad/s.
        frfs : list of int
            Numbers of the FRFs.
        mass, damping, stiffness : (r, r) array
            The model.

        Returns
        -------
        list of complex arrays
            Of each FRF those with an imaginary part of at least 0, rad/s.
        """
        model = DampedModel.of(mass, damping, stiffness) if frfs else None
        if model is None:
            every = self.every_zero(frfs, mass, damping, stiffness)
            return [roots.values[np.abs(roots.values) <= limit_rad_s] for roots in every]
        return model.zeros_up_to(*self._rows_of(frfs), limit_rad_s)

    def _rows_of(self, frfs: list[int]) -> tuple[FloatArray, FloatArray]:
        """Rows of sensors and of excitations of some FRFs, (n_frfs, r) each."""
        outputs, inputs = zip(*(self.rows[number] for number in frfs), strict=True)
        return np.array(outputs), np.array(inputs)

    def near(self, form: PoleForm, start: ComplexArray, targets: IntArray) -> tuple[Roots, BoolArray]:
        """Find zeros from near.

        Parameters
        ----------
        form : PoleForm
            The model.
        start : (k,) complex array
            Where to begin.
        targets : (k,) int array
            Which targets.

        Returns
        -------
        roots : Roots
            One a target.
        found : (k,) bool array
            False where there is none, or where two of an FRF are one.
        """
        outputs, inputs = self.outputs(targets), self.inputs(targets)
        values, found = form.zeros(outputs, inputs, start)
        values = np.where(found, values, start)
        roots, exact = form.roots(outputs, inputs, values)
        return roots, found & exact & self._apart(values, targets)

    def _apart(self, values: ComplexArray, targets: IntArray) -> BoolArray:
        order = np.lexsort((values.imag, values.real, self.frf[targets]))
        same_frf = np.diff(self.frf[targets][order]) == 0
        merged = same_frf & (np.abs(np.diff(values[order])) < APART * np.abs(values[order][1:]))
        apart = np.ones(len(values), bool)
        apart[order[1:][merged]] = apart[order[:-1][merged]] = False
        return apart


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrackedRoots:
    """The model's roots that belong to the targets.

    Parameters
    ----------
    groups : tuple of (IntArray, Roots)
        Indices among the targets, and their roots: poles first, then the zeros of all FRFs.
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

    def distance(indices: IntArray, roots: Roots) -> FloatArray:
        logs = np.log(np.abs(roots.values) + np.finfo(float).tiny)
        return np.asarray(np.abs(np.log(np.abs(computed[indices]))[:, None] - 0.5 * logs))

    poles, zeros = targets.poles, targets.zeros
    groups = []
    if len(poles):
        roots = undamped_poles(mass, stiffness)
        groups.append((poles, roots.take(_assign(distance(poles, roots)))))
    if len(zeros):
        form = undamped_form(mass, stiffness)
        roots, found = targets.near(form, -(computed[zeros] ** 2), zeros)
        logs = np.log(np.abs(computed[zeros]))
        found &= np.abs(logs - 0.5 * np.log(np.abs(roots.values) + np.finfo(float).tiny)) < NEAR
        for number, members in _lost(targets, zeros, found).items():
            every = every_undamped_zero(form, *targets.rows[number])
            _put(roots, members, every.take(_assign(distance(zeros[members], every))))
        groups.append((zeros, roots))
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
    for indices, old in before.groups:
        if targets.frf[indices[0]] < 0:
            new = undamped_poles(mass, stiffness)
            groups.append((indices, new.take(_assign(-_overlap(old, new, mass, new.slope)))))
            continue
        force = stiffness @ old.right_vectors - (mass @ old.right_vectors) * old.values
        start = old.values + np.sum(old.left_vectors * force, axis=0) / old.slope
        form = undamped_form(mass, stiffness)
        new, found = targets.near(form, start, indices)
        found &= _own_overlap(old, new, mass, new.slope) > SAME_ROOT
        for number, members in _lost(targets, indices, found).items():
            every = every_undamped_zero(form, *targets.rows[number])
            _put(new, members, every.take(_assign(-_overlap(old.take(members), every, mass, every.slope))))
        groups.append((indices, new))
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

    def upper_of(roots: Roots) -> Roots:
        return roots.take(np.flatnonzero(roots.values.imag > 0))

    form, groups = damped_form(mass, damping, stiffness), []
    for indices, old in undamped.groups:
        if targets.frf[indices[0]] < 0:
            new = upper_of(form.all_poles())
            groups.append((indices, new.take(_assign(-_overlap(old, new, mass, new.slope / (2 * new.values))))))
            continue
        s = 1j * np.sqrt(old.values.astype(complex))
        start = s - np.sum(old.left_vectors * (damping @ old.right_vectors), axis=0) / (2 * old.slope)
        new, found = targets.near(form, start, indices)
        found &= (new.values.imag > 0) & (_own_overlap(old, new, mass, new.slope / (2 * new.values)) > SAME_ROOT)
        lost = _lost(targets, indices, found)
        zeros = targets.every_zero(list(lost), mass, damping, stiffness)
        for members, roots in zip(lost.values(), zeros, strict=True):
            every = upper_of(roots)
            overlap = _overlap(old.take(members), every, mass, every.slope / (2 * every.values))
            _put(new, members, every.take(_assign(-overlap)))
        groups.append((indices, new))
    return TrackedRoots(groups=tuple(groups))


def nearest_roots(
    targets: TargetRoots, reference: ComplexArray, mass: FloatArray, damping: FloatArray, stiffness: FloatArray
) -> ComplexArray:
    """Find the damped roots nearest to given values.

    Parameters
    ----------
    targets : TargetRoots
        Poles and zeros that are targets.
    reference : (n,) complex array
        One value for each target, rad/s.
    mass, damping, stiffness : (r, r) array
        The model.

    Returns
    -------
    (n,) complex array
        The model's, one to one, imaginary part > 0, rad/s; 0 where it has too few.
    """
    values = np.zeros(len(reference), complex)

    def assign(indices: IntArray, every: ComplexArray) -> None:
        upper = every[every.imag > 0]
        distance = np.abs(reference[indices][:, None] - upper) / np.abs(reference[indices])[:, None]
        rows, columns = linear_sum_assignment(distance)
        values[indices[rows]] = upper[columns]

    poles, zeros = targets.poles, targets.zeros
    if len(poles):
        assign(poles, damped_poles(mass, damping, stiffness).values)
    if len(zeros):
        roots, found = targets.near(damped_form(mass, damping, stiffness), reference[zeros], zeros)
        found &= np.abs(roots.values - reference[zeros]) < UNMOVED * np.abs(reference[zeros])
        values[zeros] = np.where(found, roots.values, 0.0)
        lost = _lost(targets, zeros, found)
        # one of twice the modulus is farther from a value than none at all
        limit = 2 * float(np.abs(reference[zeros]).max())
        of_lost = targets.zeros_up_to(limit, list(lost), mass, damping, stiffness)
        for members, every in zip(lost.values(), of_lost, strict=True):
            values[zeros[members]] = 0.0
            assign(zeros[members], every)
    return values


def _lost(targets: TargetRoots, zeros: IntArray, found: BoolArray) -> dict[int, IntArray]:
    """FRFs with a zero that was not found, and where their zeros stand."""
    frf = targets.frf[zeros]
    return {int(number): np.flatnonzero(frf == number) for number in np.unique(frf[~found])}


def _put(roots: Roots, members: IntArray, others: Roots) -> None:
    roots.values[members] = others.values
    roots.right_vectors[:, members] = others.right_vectors
    roots.left_vectors[:, members] = others.left_vectors
    roots.slope[members] = others.slope


def _own_overlap(old: Roots, new: Roots, mass: FloatArray, norm: ComplexArray) -> FloatArray:
    """Overlap of each root with itself; see `_overlap`."""
    forward = np.sum(old.left_vectors * (mass @ new.right_vectors), axis=0)
    backward = np.sum(new.left_vectors * (mass @ old.right_vectors), axis=0)
    return _over(np.abs(forward * backward), np.abs(old.slope * norm))


def _overlap(old: Roots, new: Roots, mass: FloatArray, norm: ComplexArray) -> FloatArray:
    forward = old.left_vectors.T @ mass @ new.right_vectors
    backward = new.left_vectors.T @ mass @ old.right_vectors
    return _over(np.abs(forward * backward.T), np.abs(np.outer(old.slope, norm)))


def _over(products: FloatArray, sizes: FloatArray) -> FloatArray:
    """Divide; 0 where a size is 0, which is that of a zero on its way to infinity."""
    return np.divide(products, sizes, out=np.zeros_like(products), where=sizes > 0)


def _assign(cost: FloatArray) -> IntArray:
    rows, columns = linear_sum_assignment(cost)
    if len(rows) < len(cost):
        raise NumericalError("the changed model has fewer poles or zeros than there are targets: look at the pairs")
    return np.asarray(columns[np.argsort(rows)], int)
