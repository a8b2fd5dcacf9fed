"""Sums over poles at many lines, of many models that are alike.

Seen from the band, a pole far from it is smooth: what all far poles add follows from a few Chebyshev nodes by
interpolation, to rounding [Trefethen2013]. Lines then cost what poles in the band and nodes are, not what a model has.

[Trefethen2013] L. N. Trefethen, Approximation Theory and Approximation Practice, SIAM, 2013, theorem 8.2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial import chebyshev

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray

if TYPE_CHECKING:
    from collections.abc import Sequence


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PoleSums:
    """Lines, and the poles of each model that are near to them and far from them.

    Parameters
    ----------
    s : (n_lines,) complex array
        rad/s.
    poles : sequence of (k,) complex arrays
        Of each model, without their conjugates, rad/s.
    near : sequence of int arrays
        Of each model the places of its near poles, among poles and conjugates.
    nodes : (n_nodes,) complex array
        Where far poles are evaluated, rad/s.
    carry : (n_lines, n_nodes) array
        From nodes to lines.
    """

    s: ComplexArray
    poles: Sequence[ComplexArray]
    near: Sequence[IntArray]
    nodes: ComplexArray
    carry: FloatArray

    @classmethod
    def over(cls, poles: Sequence[ComplexArray], s: ComplexArray) -> PoleSums:
        """Part poles so that the work is least.

        Parameters
        ----------
        poles : sequence of (k,) complex arrays
            Of each model, without their conjugates, rad/s.
        s : (n_lines,) complex array
            rad/s.

        Returns
        -------
        PoleSums
            All poles are near where lines are few, or do not lie on the imaginary axis.
        """
        every = [_closed(of_model) for of_model in poles]
        low, high = float(s.imag.min()), float(s.imag.max())
        if s.real.any() or low == high:
            near = [np.arange(len(of_model)) for of_model in every]
            return cls(s=s, poles=poles, near=near, nodes=np.zeros(0, complex), carry=np.zeros((len(s), 0)))
        centre, half = (low + high) / 2, (high - low) / 2
        # interpolation in n nodes leaves rho^-n of a pole on the ellipse rho
        scaled = [(of_model / 1j - centre) / half for of_model in every]
        roots = [np.sqrt(of_model**2 - 1) for of_model in scaled]
        rho = [np.maximum(np.abs(x + root), np.abs(x - root)) for x, root in zip(scaled, roots, strict=True)]
        limit, count = _cheapest(np.concatenate(rho), len(every), len(s))
        angles = (2 * np.arange(count) + 1) * np.pi / (2 * max(count, 1))
        to_polynomials = 2 / max(count, 1) * np.cos(np.arange(count)[:, None] * angles)
        to_polynomials[:1] /= 2
        return cls(
            s=s,
            poles=poles,
            near=[np.flatnonzero(of_model < limit) for of_model in rho],
            nodes=np.asarray(1j * (centre + half * np.cos(angles)), complex),
            carry=chebyshev.chebvander((s.imag - centre) / half, max(count - 1, 0))[:, :count] @ to_polynomials,
        )

    def terms(self, number: int, residues: ComplexArray) -> ComplexArray:
        """Give what the factors of a model are multiplied by.

        Parameters
        ----------
        number : int
            Of the model.
        residues : (k, n) complex array
            Of its poles, without those of the conjugates.

        Returns
        -------
        (n_near + n_nodes, n) complex array
            Residues of near poles, and the sums over the far ones at the nodes.
        """
        closed = np.concatenate([residues, residues.conj()])
        far = 1 / (self.nodes[:, None] - _closed(self.poles[number]))
        far[:, self.near[number]] = 0.0
        return np.concatenate([closed[self.near[number]], far @ closed])

    def factors(self, number: int, lines: slice) -> ComplexArray:
        """Give what times the terms of a model are its sums.

        Parameters
        ----------
        number : int
            Of the model.
        lines : slice
            Which lines.

        Returns
        -------
        (lines, n_near + n_nodes) complex array
            1/(rad/s), and shares of the nodes.
        """
        near = 1 / (self.s[lines, None] - _closed(self.poles[number])[self.near[number]])
        return np.concatenate([near, self.carry[lines]], axis=1)


def _closed(poles: ComplexArray) -> ComplexArray:
    return np.concatenate([poles, poles.conj()])


def _cheapest(rho: FloatArray, n_models: int, n_lines: int) -> tuple[float, int]:
    """Ellipse from which poles are far, and the number of nodes."""
    ascending = np.sort(rho)
    limits = ascending[ascending > 1.0]
    counts = np.ceil(-np.log(np.finfo(float).eps) / np.log(limits))
    inside = np.searchsorted(ascending, limits)
    work = n_lines * (inside / n_models + counts) + counts * len(rho) / n_models
    if not len(limits) or work.min() >= n_lines * len(rho) / n_models:
        return np.inf, 0
    best = int(np.argmin(work))
    return float(limits[best]), int(counts[best])
