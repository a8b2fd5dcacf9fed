"""How much a cause would explain, by one linear step: enough to leave out most of them unfitted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from frf_ipz.diagnosis.physics.response import nuisance_jacobian
from frf_ipz.numerics.least_squares import cholesky_with_prior

if TYPE_CHECKING:
    from frf_ipz.arrays import ComplexArray, FloatArray
    from frf_ipz.diagnosis.physics.response import Response
    from frf_ipz.diagnosis.search.fit import Data, Fit
    from frf_ipz.diagnosis.search.hypothesis import Hypothesis
    from frf_ipz.diagnosis.search.inference_problem import InferenceProblem


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Score:
    """Weighs misfits by what scatter cannot explain.

    Parameters
    ----------
    bench : InferenceProblem
        The data.
    base : Fit
        What is supposed already.
    data : Data
        What misfits are of.
    misfit : (n_data,) array
        Whitened misfit of the base, as it would be without scatter.
    columns : (n_data, n_nuisance) array
        Whitened derivatives of the FRFs by the pulls of what cannot be known.
    factor : (n_nuisance, n_nuisance) array
        Lower Cholesky factor of their curvature with its prior.
    pulls : (n_nuisance,) array
        Of the base.
    response : Response
        Of the base.
    """

    bench: InferenceProblem
    base: Fit
    data: Data
    misfit: FloatArray
    columns: FloatArray
    factor: FloatArray
    pulls: FloatArray
    response: Response

    def change(self, hypothesis: Hypothesis, values: FloatArray) -> ComplexArray:
        """Change of the FRFs by some values, scatter as in the base."""
        searched = hypothesis.start_at(np.concatenate([self.base.values, values]))
        response = hypothesis.respond(hypothesis.physical(searched), self.base.unknown, self.data.measured.s)
        return np.asarray(response.values - self.response.values)

    def at(self, hypothesis: Hypothesis, values: FloatArray) -> float:
        """Half the fall of the sum of squares at some values, nats."""
        misfit = self._misfit(hypothesis, hypothesis.start_at(np.concatenate([self.base.values, values])))
        return 0.5 * (self._square(self.misfit, self.misfit) - self._square(misfit, misfit))

    def weigh(self, changes: ComplexArray) -> tuple[FloatArray, FloatArray]:
        """Find the best sizes of changes, and the gain of each.

        Parameters
        ----------
        changes : (n_points, n_frfs, n) complex array
            Of the FRFs, for size 1.

        Returns
        -------
        sizes, gains : (n,) array
            Sizes may be negative; gains in nats.
        """
        white = self.data.slopes(self.response, changes)
        seen = linalg.solve_triangular(self.factor, self.columns.T @ white, lower=True, check_finite=False)
        known = linalg.solve_triangular(self.factor, self.columns.T @ self.misfit, lower=True, check_finite=False)
        squares = np.maximum(np.sum(white**2, 0) - np.sum(seen**2, 0), 1e-9 * np.sum(white**2, 0) + 1e-300)
        across = self.misfit @ white - known @ seen
        return across / squares, 0.5 * across**2 / squares

    def _misfit(self, hypothesis: Hypothesis, searched: FloatArray) -> FloatArray:
        """Whitened misfit, as it would be without scatter."""
        data = self.data
        response = hypothesis.respond(hypothesis.physical(searched), self.base.unknown, data.measured.s)
        return data.misfit(response) + self.columns @ self.pulls

    def _square(self, one: FloatArray, other: FloatArray) -> float:
        seen = [linalg.solve_triangular(self.factor, self.columns.T @ x, lower=True) for x in (one, other)]
        return float(one @ other - seen[0] @ seen[1])


def score_on(bench: InferenceProblem, base: Fit, data: Data) -> Score:
    """Prepare scores on top of a fit.

    Parameters
    ----------
    bench : InferenceProblem
        What is tested.
    base : Fit
        What is supposed already.
    data : Data
        What misfits are of.

    Returns
    -------
    Score
        For any further cause.
    """
    response = base.hypothesis.respond(base.values, base.unknown, data.measured.s)
    jacobian = nuisance_jacobian(response, bench.nuisance, bench.specimen.layout)
    pulls, slopes = bench.nuisance.pulls(base.unknown)
    columns = data.slopes(response, jacobian) / slopes
    return Score(
        bench=bench,
        base=base,
        data=data,
        misfit=data.misfit(response) + columns @ pulls,
        columns=columns,
        factor=cholesky_with_prior(columns.T),
        pulls=pulls,
        response=response,
    )
