"""B-splines on an interval, with kinks where the physics has them.

The truth structures are Rayleigh-Ritz models on these functions: one smooth global basis instead of a chain of
two-node elements, so that an error of the package's elements cannot hide in the data it is judged by.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline

FloatArray = NDArray[np.float64]

GAUSS_POINTS = 8  # exact for products of two quintic splines and a field that is cubic within a knot interval


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SplineBasis:
    """All B-splines of one degree on a knot vector.

    Parameters
    ----------
    knots : (n_knots,) array
        Positions, m; both ends have full multiplicity, so that the first and last function carry the end values.
    degree : int
        Degree of the pieces.
    """

    knots: FloatArray
    degree: int

    @property
    def size(self) -> int:
        """Number of basis functions."""
        return self.knots.size - self.degree - 1

    def values(self, x: FloatArray, derivative: int = 0) -> FloatArray:
        """(n_points, size) array: each function, or a derivative of it, at positions `x`."""
        spline = BSpline(self.knots, np.eye(self.size), self.degree, extrapolate=False)
        inside = np.clip(np.atleast_1d(x), self.knots[0], self.knots[-1])
        return np.asarray(spline.derivative(derivative)(inside) if derivative else spline(inside))

    def quadrature(self) -> tuple[FloatArray, FloatArray]:
        """Gauss points and weights of all knot intervals."""
        edges = np.unique(self.knots)
        points, weights = np.polynomial.legendre.leggauss(GAUSS_POINTS)
        half = np.diff(edges) / 2
        middle = (edges[1:] + edges[:-1]) / 2
        return (middle[:, None] + half[:, None] * points).ravel(), (half[:, None] * weights).ravel()


def make_spline_basis(length: float, intervals: int, kinks: dict[float, int], *, degree: int = 5) -> SplineBasis:
    """B-splines on [0, length] with reduced smoothness at some positions.

    Parameters
    ----------
    length : float
        m.
    intervals : int
        Uniform knot intervals before the kinks are put in.
    kinks : dict of float to int
        Position, m, to the number of continuous derivatives there (0: a corner, 1: a jump of the curvature).
    degree : int
        Degree of the pieces.

    Returns
    -------
    SplineBasis
        Uniform knots that come within a fifth of an interval of a kink are moved onto it.
    """
    inner = {x: c for x, c in kinks.items() if 1e-9 * length < x < (1 - 1e-9) * length}
    uniform = np.linspace(0, length, intervals + 1)[1:-1]
    apart = [x for x in uniform if all(abs(x - kink) > 0.2 * length / intervals for kink in inner)]
    multiplicity = {float(x): 1 for x in apart} | {x: degree - c for x, c in inner.items()}
    middle = [x for x in sorted(multiplicity) for _ in range(multiplicity[x])]
    ends = [0.0] * (degree + 1), [length] * (degree + 1)
    return SplineBasis(knots=np.array([*ends[0], *middle, *ends[1]]), degree=degree)
