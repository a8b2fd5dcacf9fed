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
from scipy import sparse

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.identification.likelihood.compression import model_columns, response
from frf_ipz.identification.measured_lines import MeasuredLines, WeightedLines
from frf_ipz.numerics.partial_fractions import stacked

if TYPE_CHECKING:
    from collections.abc import Iterator

    from frf_ipz.identification.likelihood.refinement import RefinedPoles
    from frf_ipz.identification.likelihood.smooth_terms import SmoothTerms

TIMES = 3  # samples of the noise in a period of the highest line: products of two have twice its frequency
FINER = 8  # places of a grid in the distance of lines whose noise is independent
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
    data, residues = lines.weighted(), fit.system.scaled_residues()
    error = response(fit.system, terms, lines.s) * noise.relative
    own = np.sqrt(np.tile(np.clip(1 - np.abs(error) ** 2 / lines.variance, 0.0, 1.0), (2, 1)))
    length_s, middle_s = np.diff(noise.interval_s).item(), np.mean(noise.interval_s)
    to_grid = _grid(lines.frequency_hz * length_s * FINER)
    n_times = 2 * int(np.ceil(TIMES / 2 * length_s * lines.frequency_hz[-1])) + 1
    weighted = data.weight * error * np.exp(-2j * np.pi * lines.frequency_hz * middle_s)[:, None]
    covariance = np.zeros((2 * n_poles, 2 * n_poles))
    in_time: dict[int, FloatArray] = {}
    for frfs, real, imag, _ in _pole_slopes(data, fit, terms):
        slopes = np.concatenate([real, imag], axis=1)
        for frf in frfs.tolist():
            part = slopes * own[:, frf, None]
            a, b = np.diag(residues[frf].real), np.diag(residues[frf].imag)
            by_parts = np.block([[a, -b], [b, a]])
            covariance += by_parts.T @ (part.T @ part) @ by_parts
        real, imag = (by_part[:n_lines] - 1j * by_part[n_lines:] for by_part in (real, imag))
        for force in np.unique(noise.force[frfs]).tolist():
            shared = frfs[noise.force[frfs] == force]
            a, b = (weighted[:, shared] @ part for part in (residues[shared].real, residues[shared].imag))
            scores = np.concatenate([real * a + imag * b, imag * a - real * b], axis=1)
            in_time[force] = in_time.get(force, 0.0) + _in_time(to_grid @ scores, n_times)
    covariance += sum(scores.T @ scores for scores in in_time.values())
    inverse = np.linalg.pinv(fit.information, hermitian=True)
    return np.asarray(np.einsum("ij,jk,ki->i", inverse, covariance, inverse) / np.diag(inverse))


def _grid(places: FloatArray) -> sparse.csr_array:
    """Share lines out to the whole numbers beside their places, (n_whole, n_lines)."""
    low, lines = np.floor(places).astype(int), np.arange(len(places))
    shares = np.concatenate([1 - (places - low), places - low])
    return sparse.csr_array((shares, (np.concatenate([low, low + 1]), np.tile(lines, 2))))


def _in_time(spectrum: ComplexArray, n_times: int) -> FloatArray:
    """Give what each sample of white noise, in a time about zero, adds to scores whose lines are on a grid.

    The grid is so fine that its transform covers the time `FINER` times over.
    """
    spectrum[0] *= 2  # counts once, the others and their conjugates twice
    samples = np.fft.hfft(spectrum, FINER * n_times, axis=0) / (2 * np.sqrt(n_times))
    return np.asarray(samples[np.arange(-(n_times // 2), n_times // 2 + 1)])


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
