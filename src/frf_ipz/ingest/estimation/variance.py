"""The variance of estimated FRFs from the scatter between records.

With v the unexplained power of one record, which `signals.scatter` fits to that of all,

    var(H) = v / sum |F|^2.
"""

from __future__ import annotations

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.ingest.estimation.spectra import SpectrumSums, estimate_frf, unexplained_power
from frf_ipz.ingest.signals.scatter import ROUNDING, fit_noise_power


def frf_variance(
    sums: SpectrumSums, independent: FloatArray | None = None, force_noise: FloatArray | None = None
) -> FloatArray:
    """Estimate the variance of H1 from the scatter between records.

    Parameters
    ----------
    sums : SpectrumSums
        Of all records.
    independent : (n_outputs,) array, optional
        How many independent ones those of each response are worth, where they overlap.
    force_noise : (n_outputs, n_lines) array, optional
        Noise power of the force in one record, where it was measured.

    Returns
    -------
    (n_lines, n_outputs) array
        E of the squared modulus of the error of `estimate_frf`; NaN for fewer than two records and where there is
        no force.
    """
    degrees = np.maximum((sums.counts if independent is None else independent) - 1.0, 0.5)
    share = sums.counts / (degrees + 1.0)  # overlapping segments: fewer independent ones in the same sums
    power = np.full(sums.cross.T.shape, np.nan)
    unexplained, gains = unexplained_power(sums), np.abs(estimate_frf(sums)) ** 2
    floors = ROUNDING * sums.responses.max(axis=1, initial=0.0)
    for output in np.flatnonzero(sums.counts >= 2):
        scatter = unexplained[:, output] / (degrees[output] * share[output])
        power[:, output] = fit_noise_power(
            np.maximum(scatter, floors[output]),
            gains[:, output],
            float(degrees[output]),
            None if force_noise is None else force_noise[output],
        )
    return power_to_variance(power * share, sums.force)


def power_to_variance(power: FloatArray, force: FloatArray) -> FloatArray:
    """Turn the unexplained power of one record into the variance of the FRF.

    Parameters
    ----------
    power : (n_lines, n_outputs) array
        a + b |H|^2.
    force : (n_outputs, n_lines) array
        Sum of the force's squared modulus over the records of each response.

    Returns
    -------
    (n_lines, n_outputs) array
        Variance; NaN where there is no force.
    """
    return np.asarray(np.divide(power, force.T, out=np.full(power.shape, np.nan), where=force.T > 0))
