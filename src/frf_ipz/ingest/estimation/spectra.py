"""Averaged spectra and the FRFs made of them: H1, H2, Hv, coherence; arrays in, arrays out, one record at a time.

Only sums over the records are kept, so memory does not grow with their number.

[Bendat2010]: J. S. Bendat, A. G. Piersol, Random Data, 4th ed., Wiley 2010 (doi:10.1002/9781118032428).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray, require_shape

if TYPE_CHECKING:
    from collections.abc import Sequence


@dataclass(slots=True, eq=False)
class SpectrumSums:
    """Sums over records of auto and cross spectra; `add` a record at a time.

    Parameters
    ----------
    force : (n_outputs, n_lines) array
        Sum of the force's squared modulus over the records of each response.
    cross : (n_outputs, n_lines) complex array
        Sum of the conjugate force spectrum times the responses'.
    responses : (n_outputs, n_lines) array
        Sum of the responses' squared moduli.
    counts : (n_outputs,) int array
        Records, or segments of records, in the sums of each response.
    """

    force: FloatArray
    cross: ComplexArray
    responses: FloatArray
    counts: IntArray

    def add(
        self,
        force: FloatArray,
        responses: FloatArray,
        rows: Sequence[int] | None = None,
        weights: FloatArray | float = 1.0,
    ) -> None:
        """Add one record.

        Parameters
        ----------
        force : (n_samples,) array
            With its window applied.
        responses : (n_rows, n_samples) array
            With theirs.
        rows : sequence of int, optional
            Which responses these are; all of them where it is left out.
        weights : (n_rows, n_lines) array or float
            How much the record counts.

        Raises
        ------
        ShapeError
            If the number of outputs, or of the lines that the samples give, differs.
        """
        n_rows = len(self.cross) if rows is None else len(rows)
        require_shape("the responses of a record", responses, (n_rows, len(force)))
        require_shape("the spectrum of a record", self.force, (len(self.force), len(force) // 2 + 1))
        self.add_spectra(np.fft.rfft(force), np.fft.rfft(responses), rows, weights)

    def add_spectra(
        self,
        force: ComplexArray,
        responses: ComplexArray,
        rows: Sequence[int] | None = None,
        weights: FloatArray | float = 1.0,
    ) -> None:
        """Add the spectra of one record or segment.

        Parameters
        ----------
        force : (n_lines,) complex array
            Transform of the force.
        responses : (n_rows, n_lines) complex array
            Transforms of the responses.
        rows : sequence of int, optional
            Which responses these are; all of them where it is left out.
        weights : (n_rows, n_lines) array or float
            How much the record counts.
        """
        chosen = slice(None) if rows is None else list(rows)
        self.force[chosen] += weights * (force.real**2 + force.imag**2)
        self.responses[chosen] += weights * (responses.real**2 + responses.imag**2)
        self.cross[chosen] += weights * (force.conj() * responses)
        self.counts[chosen] += 1

    def take(self, rows: Sequence[int]) -> SpectrumSums:
        """Take the sums of some responses.

        Parameters
        ----------
        rows : sequence of int
            Which responses.

        Returns
        -------
        SpectrumSums
            Theirs.
        """
        chosen = list(rows)
        return SpectrumSums(self.force[chosen], self.cross[chosen], self.responses[chosen], self.counts[chosen])


def empty_sums(n_lines: int, n_outputs: int) -> SpectrumSums:
    """Make sums to which nothing has been added.

    Parameters
    ----------
    n_lines : int
        Frequency lines: half of the samples plus one.
    n_outputs : int
        Responses.

    Returns
    -------
    SpectrumSums
        Zeros.
    """
    shape = n_outputs, n_lines
    return SpectrumSums(np.zeros(shape), np.zeros(shape, complex), np.zeros(shape), np.zeros(n_outputs, np.int64))


def estimate_frf(sums: SpectrumSums, estimator: str = "H1") -> ComplexArray:
    """Estimate FRFs from averaged spectra, [Bendat2010].

    Parameters
    ----------
    sums : SpectrumSums
        Of at least one record.
    estimator : str
        ``H1`` (noise on the responses), ``H2`` (noise on the force), ``Hv`` (on both: the geometric mean of
        H1 and H2, which does not depend on units).

    Returns
    -------
    (n_lines, n_outputs) complex array
        Unit of the responses over that of the force; 0 where there is no force.

    Examples
    --------
    >>> sums = empty_sums(9, 1)
    >>> force = np.sin(np.arange(16.0)) + 1.0
    >>> sums.add(force, 3.0 * force[None])
    >>> bool(np.allclose(estimate_frf(sums), 3.0, rtol=1e-12, atol=0.0))
    True
    """
    h1 = _divide(sums.cross, sums.force)
    if estimator == "H1":
        return h1
    h2 = _divide(sums.responses, sums.cross.conj())
    if estimator == "H2":
        return h2
    magnitude = np.sqrt(np.abs(h1) * np.abs(h2))
    return np.asarray(magnitude * np.exp(1j * np.angle(h1)))


def estimate_coherence(sums: SpectrumSums) -> FloatArray:
    """Estimate the share of the responses' power that the force explains, [Bendat2010].

    Parameters
    ----------
    sums : SpectrumSums
        Of any number of records.

    Returns
    -------
    (n_lines, n_outputs) array
        0 to 1; NaN for fewer than two records, for which it says nothing.
    """
    cross = sums.cross.real**2 + sums.cross.imag**2
    coherence = np.minimum(_divide(cross, sums.force * sums.responses).real, 1.0)
    return np.where(sums.counts < 2, np.nan, coherence)


def unexplained_power(sums: SpectrumSums) -> FloatArray:
    """Give the responses' power that H1 does not explain, summed over records.

    Parameters
    ----------
    sums : SpectrumSums
        Of any number of records.

    Returns
    -------
    (n_lines, n_outputs) array
        Its expectation is the noise power of one record times the number of records less one.
    """
    cross = sums.cross.real**2 + sums.cross.imag**2
    explained = _divide(cross, sums.force).real
    return np.maximum(sums.responses.T - explained, 0.0)


def _divide(numerator: ComplexArray | FloatArray, denominator: ComplexArray | FloatArray) -> ComplexArray:
    """Divide (n_outputs, n_lines) by the same and transpose, with 0 for what cannot be divided."""
    dividend = np.asarray(numerator.T, complex)
    return np.asarray(np.divide(dividend, denominator.T, out=np.zeros_like(dividend), where=denominator.T != 0))
