"""How much larger errors of poles are where the misfit is not white: errors that lines, or FRFs, have in common.

The covariance of an optimum is ``I^-1 B I^-1`` with the information I and the covariance B of the score, which is
``I`` itself for white noise [Huber1967]. B is found from the score of each line, summed over the FRFs: a structure
whose frequencies waver moves all FRFs at once. Scores of neighbouring lines are added with falling weights
[Newey1987], and each line's misfit is corrected for its leverage on the coefficients.

Where the noise is known, B is known beforehand. The errors that noise of the force makes are the same few samples of
noise on all lines: they move a sharp peak less than white noise of that size would, and what lies beside the lines that
the force excites more. Relative errors that change slowly with frequency are the same on all lines of a peak: the
residue follows them, and they hardly move the pole. An exponential window leaves the first samples of the response's
noise, so that neighbouring lines are alike: they move a sharp peak more.

[Huber1967] P. J. Huber, The behavior of maximum likelihood estimates under nonstandard conditions, Proc. 5th Berkeley
Symposium on Mathematical Statistics and Probability 1, 1967, 221-233.
[Newey1987] W. K. Newey, K. D. West, A simple, positive semi-definite, heteroskedasticity and autocorrelation consistent
covariance matrix, Econometrica 55, 1987, 703-708, doi:10.2307/1913610.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg, sparse

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.identification.likelihood.compression import LINES_AT_ONCE, model_columns, response
from frf_ipz.identification.measured_lines import MeasuredLines, WeightedLines
from frf_ipz.numerics.partial_fractions import stacked
from frf_ipz.rational import partial_fractions

if TYPE_CHECKING:
    from collections.abc import Iterator

    from frf_ipz.identification.likelihood.refinement import RefinedPoles
    from frf_ipz.identification.likelihood.smooth_terms import SmoothTerms

TIMES = 3  # samples of the noise in a period of the highest line: products of two have twice its frequency
FINER = 8  # places of a grid in the distance of lines whose noise is independent
ON_GRID = 1e-6  # of a place: what rounding takes from a whole number
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
    inverse = np.linalg.pinv(fit.information, hermitian=True)
    errors = _scores(data, fit, terms) @ inverse  # of the poles, by each line
    variances = [_variance(errors, max_lag) for max_lag in LAGS]
    return np.asarray(np.max(variances, axis=0) / np.diag(inverse))


def _variance(errors: FloatArray, max_lag: int) -> FloatArray:
    """Variance of the sum of errors, those of neighbouring lines being correlated."""
    total = np.einsum("lk,lk->k", errors, errors)
    for lag in range(1, max_lag + 1):
        total += 2 * (1 - lag / (max_lag + 1)) * np.einsum("lk,lk->k", errors[lag:], errors[:-lag])
    return np.asarray(total)


def shared_noise_factors(
    lines: MeasuredLines, fit: RefinedPoles, terms: SmoothTerms, *, windowed_s: float
) -> FloatArray:
    """Find the factor on the variance of each pole by noise that lines share.

    That of the force lasts as long as the force is kept; that of a response falls with its exponential window. Slow
    relative errors are in the variance of the lines, but move poles only by what they change by within a peak, which is
    known of what records lack of the force.

    Parameters
    ----------
    lines : MeasuredLines
        Lines, their variance, and what is part of it: the noise of the force, and slow relative errors.
    fit : RefinedPoles
        The fit.
    terms : SmoothTerms
        Terms for modes out of band.
    windowed_s : float
        Length of the records whose responses had an exponential window, s; 0 where lines have noise of their own.

    Returns
    -------
    (2 n_poles,) array
        For all real parts, then all imaginary parts; 1 where each line has noise of its own.
    """
    noise, slow_variance, n_poles = lines.force_noise, lines.gain_variance, len(fit.poles)
    if not n_poles or (noise is None and slow_variance is None and not windowed_s):
        return np.ones(2 * n_poles)
    data, residues = lines.weighted(), fit.system.scaled_residues()
    error = np.zeros_like(lines.receptance) if noise is None else response(fit.system, terms, lines.s) * noise.relative
    slow = 0.0 if slow_variance is None else slow_variance
    own = data.weight * np.sqrt(np.maximum(lines.variance / lines.overlap - slow - np.abs(error) ** 2, 0.0))
    of_response = NoiseInTime.under_window(lines.s, windowed_s) if windowed_s else _on_lines
    covariance = np.zeros((2 * n_poles, 2 * n_poles))
    of_force, shared_samples = None, dict[int, FloatArray]()
    lacks = _lacking_at_the_beginning(lines, fit)
    lacking: dict[int, FloatArray] = {}
    if noise is not None:
        of_force = NoiseInTime.within(lines.frequency_hz, noise.interval_s)
        error = error * np.exp(-2j * np.pi * lines.frequency_hz * np.mean(noise.interval_s))[:, None]
    for frfs, slopes in _pole_slopes(data, fit, terms, slice(None)):
        for frf in frfs.tolist():
            samples = of_response(slopes.scores(own[:, [frf]], residues[[frf]]))
            covariance += samples.T @ samples
        if lacks is not None:
            for force in np.unique(lines.force[frfs]).tolist():
                alike = frfs[lines.force[frfs] == force]
                change = slopes.scores(data.weight[:, alike] * lacks[:, alike], residues[alike])
                lacking[force] = lacking.get(force, 0.0) + change.real.sum(axis=0, keepdims=True)
        if noise is None or of_force is None:
            continue
        for force in np.unique(noise.force[frfs]).tolist():
            alike = frfs[noise.force[frfs] == force]
            samples = of_force(slopes.scores(data.weight[:, alike] * error[:, alike], residues[alike]))
            shared_samples[force] = shared_samples.get(force, 0.0) + samples
    covariance += sum(samples.T @ samples for samples in (*shared_samples.values(), *lacking.values()))
    inverse = np.linalg.pinv(fit.information, hermitian=True)
    return np.asarray(np.einsum("ij,jk,ki->i", inverse, covariance, inverse) / np.diag(inverse))


def _lacking_at_the_beginning(lines: MeasuredLines, fit: RefinedPoles) -> ComplexArray | None:
    """Give the error by what records lack of the force, (n_lines, n_frfs), all of it with one factor; None without.

    The part L of the force that precedes a record leaves free motion in it. The mode R s^k / (s - p) of an FRF is off
    by ``R p^k L(p) / (F(s) (s - p))``, and L is so short that L(p) is about L(s).
    """
    if lines.missing_force is None:
        return None
    poles, residues = fit.poles[:, None], fit.system.residues()
    free = partial_fractions(lines.s, fit.poles) @ (residues * poles**lines.powers)
    free += partial_fractions(lines.s, fit.poles.conj()) @ (residues * poles**lines.powers).conj()
    return np.asarray(free / lines.s[:, None] ** lines.powers * lines.missing_force)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NoiseInTime:
    """What each sample of noise adds to sums over lines.

    Parameters
    ----------
    to_grid : (n_places, n_lines) sparse array
        Shares lines out to multiples of one over the time that the transform covers.
    finer : int
        That time over the time in which there is noise.
    std : (n_times,) array
        Of the noise, from sample to sample; in the mean square 1.
    """

    to_grid: sparse.csr_array
    finer: int
    std: FloatArray

    @classmethod
    def within(cls, frequency_hz: FloatArray, interval_s: tuple[float, float]) -> NoiseInTime:
        """Describe white noise in an interval that is much shorter than a record.

        Parameters
        ----------
        frequency_hz : (n_lines,) array
            Lines, Hz.
        interval_s : pair of float
            First and last time; the middle counts as zero.

        Returns
        -------
        NoiseInTime
            Of one in the mean square on each line.
        """
        length_s = np.diff(interval_s).item()
        n_times = _n_times(length_s, frequency_hz)
        return cls(to_grid=_grid(frequency_hz * length_s * FINER), finer=FINER, std=np.ones(n_times))

    @classmethod
    def under_window(cls, s: ComplexArray, record_s: float) -> NoiseInTime:
        """Describe white noise over a record under an exponential window, which starts at zero.

        Parameters
        ----------
        s : (n_lines,) complex array
            Lines, rad/s; the real part is the decay of the window.
        record_s : float
            Length of the record, s.

        Returns
        -------
        NoiseInTime
            Of one in the mean square on each line.
        """
        frequency_hz, decay_1_s = s.imag / (2 * np.pi), float(s.real.max())
        n_times = _n_times(record_s, frequency_hz)
        window = np.exp(-decay_1_s * record_s * np.arange(n_times) / n_times)
        std = window / np.sqrt(np.mean(window**2))
        return cls(to_grid=_grid(frequency_hz * record_s), finer=1, std=std)

    def __call__(self, scores: ComplexArray) -> FloatArray:
        """Turn sums over lines into those over samples.

        Parameters
        ----------
        scores : (n_lines, n) complex array
            What each line would add to a sum.

        Returns
        -------
        (n_times, n) array
            What each sample adds; a sum's variance is that of its squares.
        """
        n_times = len(self.std)
        spectrum: ComplexArray = np.asarray(self.to_grid @ scores)
        spectrum[0] *= 2  # counts once, the others and their conjugates twice
        samples = np.fft.hfft(spectrum, self.finer * n_times, axis=0) / (2 * np.sqrt(n_times))
        if self.finer > 1:
            samples = samples[np.arange(-(n_times // 2), n_times // 2 + 1)]
        return np.asarray(samples * self.std[:, None])


def _on_lines(scores: ComplexArray) -> FloatArray:
    """Scores of noise of its own on each line, as those of samples."""
    return np.asarray(stacked(scores) / np.sqrt(2.0))


def _n_times(length_s: float, frequency_hz: FloatArray) -> int:
    return 2 * int(np.ceil(TIMES / 2 * length_s * frequency_hz[-1])) + 1


def _grid(places: FloatArray) -> sparse.csr_array:
    """Share lines out to the whole numbers beside their places, (n_whole, n_lines)."""
    low, lines = np.floor(places + ON_GRID).astype(int), np.arange(len(places))
    shares = np.concatenate([1 - (places - low), places - low])
    return sparse.csr_array((shares, (np.concatenate([low, low + 1]), np.tile(lines, 2))))


def _scores(data: WeightedLines, fit: RefinedPoles, terms: SmoothTerms) -> FloatArray:
    """Gradient of the log likelihood by the poles on each line, (n_lines, 2 n_poles), all FRFs together."""
    misfit = (data.receptance - response(fit.system, terms, data.s)) * data.weight
    residues = fit.system.scaled_residues()
    scores = np.zeros((len(data.s), 2 * fit.system.n_poles))
    for first in range(0, len(data.s), LINES_AT_ONCE):
        lines = slice(first, first + LINES_AT_ONCE)
        of_lines, stacked_misfit = scores[lines], stacked(misfit[lines])
        for frfs, slopes in _pole_slopes(data, fit, terms, lines):
            corrected = stacked_misfit[:, frfs] / np.sqrt(1 - slopes.leverage)[:, None]
            a, b = corrected @ residues[frfs].real, corrected @ residues[frfs].imag
            by_poles = np.concatenate([slopes.real * a + slopes.imag * b, slopes.imag * a - slopes.real * b], axis=1)
            of_lines += by_poles[: len(of_lines)] + by_poles[len(of_lines) :]
    return scores


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _PoleSlopes:
    """Slopes by the poles that coefficients cannot follow, for a residue of one.

    Parameters
    ----------
    real, imag : (2 n_lines, n_poles) array
        By real and by imaginary part of the pole.
    leverage : (2 n_lines,) array
        Of the coefficients.
    """

    real: FloatArray
    imag: FloatArray
    leverage: FloatArray

    def scores(self, weighted: ComplexArray, residues: ComplexArray) -> ComplexArray:
        """Scores of weighted errors, (n_lines, n_frfs), that are the same but for the phase on each line."""
        real, imag = (np.conj(_complex(part)) for part in (self.real, self.imag))
        a, b = weighted @ residues.real, weighted @ residues.imag
        return np.concatenate([real * a + imag * b, imag * a - real * b], axis=1)


def _complex(parts: FloatArray) -> ComplexArray:
    real, imag = np.split(parts, 2)
    return np.asarray(real + 1j * imag)


def _pole_slopes(
    data: WeightedLines, fit: RefinedPoles, terms: SmoothTerms, lines: slice
) -> Iterator[tuple[IntArray, _PoleSlopes]]:
    """Give FRFs with a common basis, and their slopes on some lines.

    The basis is that of the compressed system, ``B = Q U``: an orthonormal one need not be made anew.
    """
    system, n = fit.system, fit.system.n_linear
    columns = model_columns(data.s[lines], fit.poles, terms, real_modes=system.real_modes, with_slopes=True)
    weights = data.profile[lines, None] if data.is_shared else data.weight[lines]
    for number, (U, weight) in enumerate(zip(system.U, weights.T, strict=True)):
        frfs = np.arange(data.receptance.shape[1]) if data.is_shared else np.array([number])
        weighted = columns * np.tile(weight, 2)[:, None]
        basis = linalg.solve_triangular(U[:n, :n], weighted[:, :n].T, trans="T", check_finite=False)
        real, imag = np.split(weighted[:, n:] - basis.T @ U[:n, n:], 2, axis=1)
        leverage = np.minimum(np.einsum("ij,ij->j", basis, basis), MAX_LEVERAGE)
        yield frfs, _PoleSlopes(real=real, imag=imag, leverage=leverage)
