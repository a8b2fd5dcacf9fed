"""How far poles move from one fit to another, and how far they are expected to where both have data in common.

Two fits to nearly the same data hardly differ, however uncertain both are; a third of the data differs from all of it
by more than a deviation of the latter. So what was to be expected stands beside it: estimates from overlapping data
differ by a variance of 1/A + 1/B - 2 C/(A B), if A and B is what each knows of a pole (Fisher's information) and C what
they know in common; where a share p is left of A, that is (1/p - 1)/A (Hausman 1978, doi:10.2307/1913827).
"""

import numpy as np
from scipy.optimize import linear_sum_assignment

import frf_ipz

Band = tuple[float, float]
Lost = tuple[np.ndarray, np.ndarray | float]
SURE, SAME = 0.9, 0.5  # found_again; half widths within which two poles are one mode


def expected(base: frf_ipz.ModalFit, frfs: frf_ipz.FrfSet, band: Band, lost: Lost) -> np.ndarray:
    """Give the variance of the change of each pole over its own, which overlapping data leave.

    Errors of values are as they were measured, or else the same part of each, and as large as the deviations say.
    """
    errors = np.where(np.isfinite(frfs.variance), frfs.variance, np.abs(frfs.values) ** 2)
    before, after = (frfs.in_band(edges)[:, None] for edges in (base.band_hz, band))
    kept, noise = lost
    ratios = []
    for k, (pole, residues) in enumerate(zip(base.model.poles[: base.n_modes], base.model.residues, strict=False)):
        slopes = np.abs(residues / (frfs.s[:, None] - pole) ** 2) ** 2
        told = np.mean(np.diag(base.covariance[2 * k : 2 * k + 2, 2 * k : 2 * k + 2]))
        size = told * (before * slopes / errors).sum()
        alone, other = before * slopes / (size * errors), after * kept * slopes / (size * errors + noise)
        ratios.append(1 + alone.sum() / other.sum() - 2 * np.minimum(alone, other).sum() / other.sum())
    return np.array(ratios)


def compare(base: frf_ipz.ModalFit, fit: frf_ipz.ModalFit) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Give which sure modes of the first fit the second has, the changes of their poles over deviations, and which."""
    poles, others = (one.model.poles[: one.n_modes] for one in (base, fit))
    distance = np.abs(poles[:, None] - others) / np.minimum(-poles.real[:, None], -others.real)
    rows, columns = linear_sum_assignment(np.minimum(distance, 1))
    is_sure = base.modes["found_again"].to_numpy() > SURE
    same = distance[rows, columns] < SAME
    found, rows, columns = np.isin(np.flatnonzero(is_sure), rows[same]), rows[same], columns[same]
    rows, columns = rows[is_sure[rows]], columns[is_sure[rows]]
    deviation = np.array([np.sqrt(np.diag(base.covariance[2 * k : 2 * k + 2, 2 * k : 2 * k + 2])) for k in rows])
    change = others[columns] - poles[rows]
    return found, np.stack([change.real, change.imag], axis=1) / deviation.reshape(-1, 2), rows


def rms(values: np.ndarray) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(values**2)))
