"""Which is off by the factor between measured and computed amplitudes: the mass of the model, or the test.

A structure that is heavier than its model by a factor has squared frequencies and amplitudes that are both smaller by
it. A stiffness moves frequencies alone, a unit or sensitivity of the test amplitudes alone. So where the mass is off,
the frequencies tell the stiffness beside it, and where the test is off, all of their factor is one of the stiffness:
the less likely that stiffness is, by the prior of an update, the less likely is its hypothesis. A mass that is off at
some places only moves no frequencies by that factor either. Mass or test, all of the mass or some of it: each is as
likely as the other before.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.updating.parameters import GLOBAL_STD, SCALE_UNCERTAINTY

if TYPE_CHECKING:
    from frf_ipz.arrays import ComplexArray
    from frf_ipz.pairing.pairs import Pairs

NODES = 32  # of a quadrature over a lognormal scale: exact to all digits that a probability is used with


def frequency_factor(pairs: Pairs, computed: ComplexArray) -> tuple[float, float]:
    """Find the factor by which all squared frequencies are off, from the poles.

    Parameters
    ----------
    pairs : Pairs
        Measured poles with their counterparts.
    computed : (n_targets,) complex array
        Poles and zeros of the nominal model in the order of `Pairs.targets`, rad/s.

    Returns
    -------
    log_factor, std : float
        Logarithm of measured over computed squares, and its standard deviation by the scatter of the poles; infinite
        where fewer than two tell it.
    """
    both = [
        (abs(pair.measured_value), abs(root))
        for pair, root in zip(pairs.targets, computed, strict=True)
        if pair.kind == "pole"
    ]
    if len(both) < 2:
        return 0.0, np.inf
    measured, model = np.array(both).T
    logs = 2 * np.log(measured / model)
    return float(np.mean(logs)), float(np.std(logs, ddof=1) / np.sqrt(len(logs)))


def probability_of_mass(log_level: float, level_std: float, log_factor: float, factor_std: float) -> float:
    """Give the probability that the mass of the model is off, and not the test.

    Parameters
    ----------
    log_level, level_std : float
        Logarithm of measured over computed amplitudes, and its standard deviation.
    log_factor, factor_std : float
        The same of the squared frequencies, as `frequency_factor` gives them.

    Returns
    -------
    float
        From 0 to 1; a half where frequencies do not tell.

    Examples
    --------
    A model that is 15 % too heavy, and a sensitivity that is 15 % off:

    >>> round(probability_of_mass(0.15, 0.005, 0.15, 0.01), 2), round(probability_of_mass(0.15, 0.005, 0.0, 0.01), 2)
    (0.8, 0.36)
    """
    if not np.isfinite(factor_std):
        return 0.5
    of_all_mass = _density_of_stiffness(log_factor - log_level, float(np.hypot(level_std, factor_std)))
    of_others = _density_of_stiffness(log_factor, factor_std)
    of_mass = (of_all_mass + of_others) / 2
    return of_mass / (of_mass + of_others) if of_mass + of_others > 0.0 else 0.5


def _density_of_stiffness(log_factor: float, std: float) -> float:
    """Density of the logarithm of a factor common to all stiffnesses, measured with an error, over its scales."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(NODES)
    variance = (GLOBAL_STD * np.exp(SCALE_UNCERTAINTY * nodes)) ** 2 + std**2
    return float(weights @ (np.exp(-(log_factor**2) / (2 * variance)) / np.sqrt(variance)))
