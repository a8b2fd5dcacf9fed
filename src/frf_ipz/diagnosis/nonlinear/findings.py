"""Laws at their places as findings: their evidence, their numbers with intervals, and where else each may sit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.result import Estimate, Finding, describe_location_set

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray
    from frf_ipz.diagnosis.nonlinear.fitting.refine import LawFit
    from frf_ipz.diagnosis.nonlinear.linear.modal_model import ModalModel

LOG_RANGE = np.log(1e6)  # of a law's numbers: uniform over six decades each
NORMAL_95 = 1.96
WIDER = 2.0  # times the standard deviation of the fit: neighbouring lines share the model's errors
TOLD = 3.0  # standard deviations from zero: laws that were there had 9 and more, two that explained without being 2
MOST_PLACES = 12
LISTED = 0.95


def gain_of(fit: LawFit, drop: float, n_places: int, scale: float) -> float:
    """Take off from a drop of the cost what the freedom of the law is worth.

    Parameters
    ----------
    fit : LawFit
        A law at its place.
    drop : float
        Half the drop of the cost against the linear model, nats.
    n_places : int
        At which it might sit.
    scale : float
        Expected mean square of the misfit.

    Returns
    -------
    float
        Evidence, nats.
    """
    gain = drop - np.log(n_places)
    for value, variance in fit.numbers.values():
        spread = min(np.sqrt(max(variance, 1e-300) * scale) / max(abs(value), 1e-300), LOG_RANGE)
        gain += np.log(np.sqrt(2 * np.pi) * max(spread, 1e-12) / LOG_RANGE)
    return float(gain)


def findings_of(
    modal_model: ModalModel, fits: list[LawFit], gains: FloatArray, probability: FloatArray, scale: float
) -> tuple[Finding, ...]:
    """Make one finding of each law, at its best place.

    Parameters
    ----------
    modal_model : ModalModel
        The structure.
    fits : list of LawFit
        Laws at places.
    gains, probability : (n_fits,) array
        Evidence of each, nats, and how probable it is among them.
    scale : float
        Expected mean square of the misfit.

    Returns
    -------
    tuple of Finding
        The most probable first.
    """
    order = np.argsort(-gains)
    found: dict[str, Finding] = {}
    for index in order:
        fit, place = fits[index], modal_model.places[fits[index].place]
        if fit.law.name in found:
            continue
        mine = [i for i in order if fits[i].law is fit.law]
        share = np.cumsum(probability[mine]) / max(probability[mine].sum(), 1e-300)
        listed = mine[: min(int(np.searchsorted(share, LISTED)) + 1, MOST_PLACES)]
        numbers = _numbers(fit, scale)
        places = tuple(dict(modal_model.places[fits[i].place].location) for i in listed)
        what = fit.law.phrase.format(f"{fit.strength:.3g}", f"{fit.shape:.3g}")
        says = f"At {place.words} sits {what} that the model lacks."
        found[fit.law.name] = Finding(
            effect=fit.law.name,
            location=dict(place.location),
            parameters=numbers,
            probability=float(probability[mine].sum()),
            log_evidence_gain=float(gains[index]),
            statement=says + describe_location_set(places),
            location_set=places,
        )
    return tuple(found.values())


def is_told(fit: LawFit, scale: float) -> bool:
    """Say whether recordings determine any number of a law: if none, a force that is hardly there is no explanation.

    Parameters
    ----------
    fit : LawFit
        A law at its place.
    scale : float
        Expected mean square of the misfit.

    Returns
    -------
    bool
        Not so where all numbers may as well be zero.
    """
    return any(abs(number.value) > TOLD * number.std for number in _numbers(fit, scale).values())


def _numbers(fit: LawFit, scale: float) -> dict[str, Estimate]:
    found = {}
    for name, (value, variance) in fit.numbers.items():
        std = WIDER * float(np.sqrt(max(variance, 0.0) * scale))
        found[name] = Estimate(value=value, std=std, low=value - NORMAL_95 * std, high=value + NORMAL_95 * std)
    return found
