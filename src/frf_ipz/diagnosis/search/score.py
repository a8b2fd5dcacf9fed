"""How much a cause would explain, by one linear step: enough to leave out most of them unfitted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from frf_ipz.diagnosis.physics.response import nuisance_jacobian

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray
    from frf_ipz.diagnosis.search.bench import Bench
    from frf_ipz.diagnosis.search.hypothesis import Hypothesis
    from frf_ipz.diagnosis.search.polish import Fit

STEP = 1e-4  # of a parameter as searched, for its derivative
LONGEST = 1.0  # of a parameter as searched: farther, nothing is linear


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Score:
    """Weighs misfits by what scatter cannot explain.

    Parameters
    ----------
    bench : Bench
        The data.
    base : Fit
        What is supposed already.
    columns : (n_data, n_nuisance) array
        Whitened derivatives of the FRFs by what cannot be known.
    factor : (n_nuisance, n_nuisance) array
        Lower Cholesky factor of their curvature with its prior.
    """

    bench: Bench
    base: Fit
    columns: FloatArray
    factor: FloatArray

    def gain(self, hypothesis: Hypothesis, values: FloatArray) -> float:
        """Half the fall of the sum of squares that one linear step from some values promises, nats."""
        start = hypothesis.searched(np.concatenate([self.base.values, values]))
        fixed = len(self.base.values)
        misfit = self._misfit(hypothesis, start)
        moves = []
        for index in range(fixed, len(start)):
            moved = start.copy()
            moved[index] += STEP if moved[index] + STEP <= hypothesis.high[index] else -STEP
            moves.append((self._misfit(hypothesis, moved) - misfit) / (moved[index] - start[index]))
        left = self._square(misfit, misfit)
        if moves:
            curvature = np.array([[self._square(one, other) for other in moves] for one in moves])
            gradient = np.array([self._square(one, misfit) for one in moves])
            curvature += np.diag(1e-9 * np.diag(curvature) + 1e-300)
            step = np.clip(np.linalg.solve(curvature, -gradient), -LONGEST, LONGEST)
            left += float(2 * gradient @ step + step @ curvature @ step)
        return 0.5 * (self.base.misfit + self.base.pull - left)

    def _misfit(self, hypothesis: Hypothesis, searched: FloatArray) -> FloatArray:
        """Whitened misfit, as it would be without scatter."""
        data = self.bench.data
        response = hypothesis.respond(hypothesis.physical(searched), self.base.unknown, data.measured.s)
        return data.misfit(response) + self.columns @ self.base.unknown

    def _square(self, one: FloatArray, other: FloatArray) -> float:
        seen = [linalg.solve_triangular(self.factor, self.columns.T @ x, lower=True) for x in (one, other)]
        return float(one @ other - seen[0] @ seen[1])


def score_on(bench: Bench, base: Fit) -> Score:
    """Prepare scores on top of a fit.

    Parameters
    ----------
    bench : Bench
        The data.
    base : Fit
        What is supposed already.

    Returns
    -------
    Score
        For any further cause.
    """
    data = bench.data
    response = base.hypothesis.respond(base.values, base.unknown, data.measured.s)
    jacobian = nuisance_jacobian(response, bench.nuisance, bench.specimen.layout)
    columns = data.whitening(data.gains(response)[:, None] * jacobian)
    factor = linalg.cholesky(columns.T @ columns + np.eye(columns.shape[1]), lower=True)
    return Score(bench=bench, base=base, columns=columns, factor=factor)
