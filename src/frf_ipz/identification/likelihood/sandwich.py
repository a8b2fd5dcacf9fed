"""How much larger errors of poles are where the misfit is not white: errors that lines, or FRFs, have in common.

The covariance of an optimum is ``I^-1 B I^-1`` with the information I and the covariance B of the score, which is
``I`` itself for white noise [Huber1967]. B is found from the score of each line, summed over the FRFs: a structure
whose frequencies waver moves all FRFs at once. Scores of neighbouring lines are added with falling weights
[Newey1987], and each line's misfit is corrected for its leverage on the coefficients.

[Huber1967] P. J. Huber, The behavior of maximum likelihood estimates under nonstandard conditions, Proc. 5th Berkeley
Symposium on Mathematical Statistics and Probability 1, 1967, 221-233.
[Newey1987] W. K. Newey, K. D. West, A simple, positive semi-definite, heteroskedasticity and autocorrelation consistent
covariance matrix, Econometrica 55, 1987, 703-708, doi:10.2307/1913610.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.identification.likelihood.compression import model_columns, response
from frf_ipz.identification.measured_lines import WeightedLines
from frf_ipz.numerics.partial_fractions import stacked

if TYPE_CHECKING:
    from frf_ipz.identification.likelihood.refinement import RefinedPoles
    from frf_ipz.identification.likelihood.smooth_terms import SmoothTerms

LAGS = (0, 2)  # lines on either side whose scores count as correlated; the larger result is taken
MAX_LEVERAGE = 0.95  # of a line that the coefficients follow nearly by themselves


def pole_variance_factors(data: WeightedLines, fit: RefinedPoles, terms: SmoothTerms) -> FloatArray:
    """Find the factor on the variance of each pole that the misfit shows.

    Parameters
    ----------
    data : WeightedLines
        Lines and weights.
    fit : RefinedPoles
        The fit.
    terms : SmoothTerms
        Terms for modes out of band.

    Returns
    -------
    (2 n_poles,) array
        For all real parts, then all imaginary parts; about 1 where the misfit is white noise of the stated size.
    """
    scores = _scores(data, fit, terms)
    inverse = np.linalg.pinv(fit.information, hermitian=True)
    expected = np.diag(inverse)
    variances = [np.einsum("ij,jk,ki->i", inverse, _score_covariance(scores, max_lag), inverse) for max_lag in LAGS]
    return np.asarray(np.max(variances, axis=0) / expected)


def _score_covariance(scores: FloatArray, max_lag: int) -> FloatArray:
    total = scores.T @ scores
    for lag in range(1, max_lag + 1):
        shifted = scores[lag:].T @ scores[:-lag]
        total += (1 - lag / (max_lag + 1)) * (shifted + shifted.T)
    return np.asarray(total)


def _scores(data: WeightedLines, fit: RefinedPoles, terms: SmoothTerms) -> FloatArray:
    """Gradient of the log likelihood by the poles on each line, (n_lines, 2 n_poles), all FRFs together."""
    system = fit.system
    n_lines, n_poles = len(data.s), system.n_poles
    columns = model_columns(data.s, fit.poles, terms, real_modes=system.real_modes, with_slopes=True)
    misfit = stacked((data.receptance - response(system, terms, data.s)) * data.weight)
    residues = system.scaled_residues()
    scores = np.zeros((n_lines, 2 * n_poles))
    for number, weight in enumerate([data.profile] if data.is_shared else data.weight.T):
        frfs = np.arange(len(residues)) if data.is_shared else np.array([number])
        weighted = columns * np.tile(weight, 2)[:, None]
        basis = np.linalg.qr(weighted[:, : system.n_linear])[0]
        slopes = weighted[:, system.n_linear :]
        real, imag = np.split(slopes - basis @ (basis.T @ slopes), 2, axis=1)
        leverage = np.minimum(np.einsum("ij,ij->i", basis, basis), MAX_LEVERAGE)
        corrected = misfit[:, frfs] / np.sqrt(1 - leverage)[:, None]
        a, b = corrected @ residues[frfs].real, corrected @ residues[frfs].imag
        by_poles = np.concatenate([real * a + imag * b, imag * a - real * b], axis=1)
        scores += by_poles[:n_lines] + by_poles[n_lines:]
    return scores
