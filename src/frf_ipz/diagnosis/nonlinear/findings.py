"""Laws at their locations as findings: evidence, parameters with intervals, and the location set."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.result import (
    LISTED_PROBABILITY,
    MAX_LOCATIONS,
    NORMAL_95,
    Estimate,
    Finding,
    describe_location_set,
    with_confidence,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.arrays import FloatArray
    from frf_ipz.diagnosis.nonlinear.fitting.alternating_fit import LawFit
    from frf_ipz.diagnosis.nonlinear.model.modal_model import ModalModel

LOG_RANGE = np.log(1e6)  # of a law's parameters: uniform over six decades each
LEAST_SPREAD = 1e-12  # of the logarithm of a parameter
FAR_BEHIND = 2 * float(np.log(LOG_RANGE / LEAST_SPREAD))  # log evidence: more than the Occam factor of two parameters
STD_INFLATION = 2.0  # of the fit's standard deviations: neighbouring lines share the model's errors
MIN_STDS = 3.0  # from zero: laws that were there had 9 and more, two that explained without being there had 2


def log_evidence_gains(fits: Sequence[LawFit], drops: FloatArray, n_locations: int, scale: float) -> FloatArray:
    """Subtract the Occam factors of laws from the drops of the cost.

    A fit that no Occam factor can bring before the best of its law is left without one: its probability is zero, and
    no covariance is needed.

    Parameters
    ----------
    fits : sequence of LawFit
        Laws at their locations.
    drops : (n_fits,) array
        Half the drop of the cost against the linear model, over the expected mean square of the misfit.
    n_locations : int
        At which a law might act.
    scale : float
        Expected mean square of the misfit.

    Returns
    -------
    (n_fits,) array
        Log evidence of each over that of the linear model.
    """
    best = {fit.law.name: -np.inf for fit in fits}
    for fit, drop in zip(fits, drops, strict=True):
        best[fit.law.name] = max(best[fit.law.name], float(drop))
    behind = np.array([best[fit.law.name] for fit in fits]) - drops
    factors = [
        _log_occam_factor(fit, scale) if late < FAR_BEHIND else 0.0 for fit, late in zip(fits, behind, strict=True)
    ]
    return np.asarray(drops - np.log(n_locations) + np.array(factors))


def _log_occam_factor(fit: LawFit, scale: float) -> float:
    factor = 0.0
    for value, variance in fit.numbers.values():
        spread = min(np.sqrt(max(variance, 1e-300) * scale) / max(abs(value), 1e-300), LOG_RANGE)
        factor += float(np.log(np.sqrt(2 * np.pi) * max(spread, LEAST_SPREAD) / LOG_RANGE))
    return factor


def make_findings(
    modal_model: ModalModel, fits: list[LawFit], gains: FloatArray, probability: FloatArray, scale: float
) -> tuple[Finding, ...]:
    """Make one finding of each law, at its best location.

    Parameters
    ----------
    modal_model : ModalModel
        The structure.
    fits : list of LawFit
        Laws at locations.
    gains, probability : (n_fits,) array
        Log evidence of each over the linear model, and its probability among them.
    scale : float
        Expected mean square of the misfit.

    Returns
    -------
    tuple of Finding
        The most probable first.
    """
    order = np.argsort(-gains)
    findings: dict[str, Finding] = {}
    for index in order:
        fit = fits[index]
        if fit.law.name in findings:
            continue
        of_law = [i for i in order if fits[i].law is fit.law]
        share = np.cumsum(probability[of_law]) / max(probability[of_law].sum(), 1e-300)
        covering = of_law[: min(int(np.searchsorted(share, LISTED_PROBABILITY)) + 1, MAX_LOCATIONS)]
        location_set = tuple(modal_model.locations[fits[i].location].place for i in covering)
        estimates = _estimate_parameters(fit, scale)
        phrase = fit.law.phrase.format(*(estimate.in_words() for estimate in estimates.values()))
        law_probability = float(probability[of_law].sum())
        where = modal_model.describe_location(fit.location)
        statement = with_confidence(f"At {where} sits {phrase} that the model lacks.", law_probability)
        findings[fit.law.name] = Finding(
            effect=fit.law.name,
            location=modal_model.locations[fit.location],
            parameters=estimates,
            probability=law_probability,
            log_evidence_gain=float(gains[index]),
            statement=statement + describe_location_set(location_set),
            location_set=location_set,
        )
    return tuple(findings.values())


def is_determined(fit: LawFit, scale: float) -> bool:
    """Tell whether records determine any parameter of a law: if none, the law explains nothing.

    Parameters
    ----------
    fit : LawFit
        A law at its location.
    scale : float
        Expected mean square of the misfit.

    Returns
    -------
    bool
        False where all parameters may as well be zero.
    """
    return any(abs(estimate.value) > MIN_STDS * estimate.std for estimate in _estimate_parameters(fit, scale).values())


def _estimate_parameters(fit: LawFit, scale: float) -> dict[str, Estimate]:
    estimates = {}
    for name, (value, variance) in fit.numbers.items():
        std = STD_INFLATION * float(np.sqrt(max(variance, 0.0) * scale))
        estimates[name] = Estimate(value=value, std=std, low=value - NORMAL_95 * std, high=value + NORMAL_95 * std)
    return estimates
