"""How much larger errors of poles are where the misfit is not white: errors that lines, or FRFs, have in common.

The covariance of an optimum is ``I^-1 B I^-1`` with the information I and the covariance B of the score, which is
``I`` itself for white noise [Huber1967]. B is found from the score of each line, summed over the FRFs: a structure
whose frequencies waver moves all FRFs at once. Scores of neighbouring lines are added with falling weights
[Newey1987], and each line's misfit is corrected for its leverage on the coefficients.

Where the noise of the force is known, B is known beforehand: the errors that it makes are the same few samples of noise
on all lines. They move a sharp peak less than white noise of that size would, and what lies beside the lines that the
force excites more.

[Huber1967] P. J. Huber, The behavior of maximum likelihood estimates under nonstandard conditions, Proc. 5th Berkeley
Symposium on Mathematical Statistics and Probability 1, 1967, 221-233.
[Newey1987] W. K. Newey, K. D. West, A simple, positive semi-definite, heteroskedasticity and autocorrelation consistent
covariance matrix, Econometrica 55, 1987, 703-708, doi:10.2307/1913610.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.identification.likelihood.compression import model_columns, response
from frf_ipz.identification.measured_lines import MeasuredLines, WeightedLines
from frf_ipz.numerics.partial_fractions import stacked

if TYPE_CHECKING:
    from collections.abc import Iterator

    from frf_ipz.identification.likelihood.refinement import RefinedPoles
    from frf_ipz.identification.likelihood.smooth_terms import SmoothTerms

TIMES = 4  # samples of the noise in a period of the highest line
TIMES_AT_ONCE = 256
FINER = 16  # blocks of lines in the distance of lines whose noise is independent
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


def force_noise_factors(lines: MeasuredLines, fit: RefinedPoles, terms: SmoothTerms) -> FloatArray:
    """Find the factor on the variance of each pole by noise of the force that lines share.

    Parameters
    ----------
    lines : MeasuredLines
        Lines, their variance, and the noise of the force that is part of it.
    fit : RefinedPoles
        The fit.
    terms : SmoothTerms
        Terms for modes out of band.

    Returns
    -------
    (2 n_poles,) array
        For all real parts, then all imaginary parts; 1 where no noise of the force is known.
    """
    noise, n_lines, n_poles = lines.force_noise, len(lines.s), len(fit.poles)
    if noise is None or not n_poles:
        return np.ones(2 * n_poles)
    data = lines.weighted()
    error = response(fit.system, terms, lines.s) * noise.relative
    is_own = np.tile(np.clip(1 - np.abs(error) ** 2 / lines.variance, 0.0, 1.0), (2, 1))
    residues = fit.system.scaled_residues()
    covariance = np.zeros((2 * n_poles, 2 * n_poles))
    shared: dict[int, ComplexArray] = {}
    for frfs, real, imag, _ in _pole_slopes(data, fit, terms):
        for frf in frfs.tolist():
            a, b = residues[frf].real, residues[frf].imag
            slopes = np.concatenate([real * a + imag * b, imag * a - real * b], axis=1)
            covariance += (slopes * is_own[:, frf, None]).T @ slopes
            scores = (slopes[:n_lines] - 1j * slopes[n_lines:]) * (data.weight[:, frf] * error[:, frf])[:, None]
            shared[int(noise.force[frf])] = shared.get(int(noise.force[frf]), 0.0) + scores
    for scores in shared.values():
        covariance += _covariance_in_time(lines.frequency_hz, scores, noise.interval_s)
    inverse = np.linalg.pinv(fit.information, hermitian=True)
    return np.asarray(np.einsum("ij,jk,ki->i", inverse, covariance, inverse) / np.diag(inverse))


def _covariance_in_time(frequency_hz: FloatArray, scores: ComplexArray, interval_s: tuple[float, float]) -> FloatArray:
    """Sum scores over lines that share white noise in an interval of time, and their products over its samples."""
    length_s = interval_s[1] - interval_s[0]
    middle_s = interval_s[0] + length_s / 2
    n_times = max(int(np.ceil(length_s * TIMES * frequency_hz[-1])), 1)
    times_s = ((np.arange(n_times) + 0.5) / n_times - 0.5) * length_s
    # lines so close that the noise is the same on them are added first
    starts = np.flatnonzero(np.diff(np.floor((frequency_hz - frequency_hz[0]) * length_s * FINER), prepend=-1.0))
    middles_hz = np.add.reduceat(frequency_hz, starts) / np.diff(starts, append=len(frequency_hz))
    sums = np.add.reduceat(scores * np.exp(-2j * np.pi * frequency_hz * middle_s)[:, None], starts, axis=0)
    covariance = np.zeros((scores.shape[1], scores.shape[1]))
    for start in range(0, n_times, TIMES_AT_ONCE):
        waves = np.exp(-2j * np.pi * np.outer(times_s[start : start + TIMES_AT_ONCE], middles_hz))
        in_time = (waves @ sums).real
        covariance += in_time.T @ in_time / n_times
    return covariance


def _scores(data: WeightedLines, fit: RefinedPoles, terms: SmoothTerms) -> FloatArray:
    """Gradient of the log likelihood by the poles on each line, (n_lines, 2 n_poles), all FRFs together."""
    system = fit.system
    n_lines, n_poles = len(data.s), system.n_poles
    misfit = stacked((data.receptance - response(system, terms, data.s)) * data.weight)
    residues = system.scaled_residues()
    scores = np.zeros((n_lines, 2 * n_poles))
    for frfs, real, imag, leverage in _pole_slopes(data, fit, terms):
        corrected = misfit[:, frfs] / np.sqrt(1 - leverage)[:, None]
        a, b = corrected @ residues[frfs].real, corrected @ residues[frfs].imag
        by_poles = np.concatenate([real * a + imag * b, imag * a - real * b], axis=1)
        scores += by_poles[:n_lines] + by_poles[n_lines:]
    return scores


def _pole_slopes(
    data: WeightedLines, fit: RefinedPoles, terms: SmoothTerms
) -> Iterator[tuple[IntArray, FloatArray, FloatArray, FloatArray]]:
    """Give FRFs with a common basis, slopes by the poles that coefficients cannot follow, and leverages of the lines.

    Slopes are (2 n_lines, n_poles) arrays, by real and by imaginary part, for a residue of one; leverages (2 n_lines,).
    """
    system = fit.system
    columns = model_columns(data.s, fit.poles, terms, real_modes=system.real_modes, with_slopes=True)
    for number, weight in enumerate([data.profile] if data.is_shared else data.weight.T):
        frfs = np.arange(data.receptance.shape[1]) if data.is_shared else np.array([number])
        weighted = columns * np.tile(weight, 2)[:, None]
        basis = np.linalg.qr(weighted[:, : system.n_linear])[0]
        slopes = weighted[:, system.n_linear :]
        real, imag = np.split(slopes - basis @ (basis.T @ slopes), 2, axis=1)
        yield frfs, real, imag, np.minimum(np.einsum("ij,ij->i", basis, basis), MAX_LEVERAGE)
