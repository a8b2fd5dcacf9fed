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
    from frf_ipz.arrays import FloatArray
    from frf_ipz.diagnosis.nonlinear.fitting.alternating_fit import LawFit
    from frf_ipz.diagnosis.nonlinear.model.modal_model import ModalModel

LOG_RANGE = np.log(1e6)  # of a law's parameters: uniform over six decades each
STD_INFLATION = 2.0  # of the fit's standard deviations: neighbouring lines share the model's errors
MIN_STDS = 3.0  # from zero: laws that were there had 9 and more, two that explained without being there had 2


def log_evidence_gain(fit: LawFit, drop: float, n_locations: int, scale: float) -> float:
    """Subtract the Occam factor of a law from the drop of the cost.

    Parameters
    ----------
    fit : LawFit
        A law at its location.
    drop : float
        Half the drop of the cost against the linear model.
    n_locations : int
        At which it might act.
    scale : float
        Expected mean square of the misfit.

    Returns
    -------
    float
        Log evidence over that of the linear model.
    """
    gain = drop - np.log(n_locations)
    for value, variance in fit.numbers.values():
        spread = min(np.sqrt(max(variance, 1e-300) * scale) / max(abs(value), 1e-300), LOG_RANGE)
        gain += np.log(np.sqrt(2 * np.pi) * max(spread, 1e-12) / LOG_RANGE)
    return float(gain)


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
