"""Pairing of the zeros of one FRF with those of the model, on a frequency axis on which the paired poles agree.

A wrong stiffness shifts poles and zeros, so frequencies are first mapped by the poles; the remaining distance separates
the zeros. The slope of the FRF at a zero must have the same sign: two zeros without a pole between them differ in it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.pairing.frequency_scatter import NARROWER, frequency_cost
from frf_ipz.pairing.matching import Hypothesis, Matching, match, mixed_probabilities
from frf_ipz.rational import PoleResidueModel

if TYPE_CHECKING:
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.pairing.model_roots import ModelZeros

ZERO_STD = 0.04  # of the logarithm of a zero's frequency, after the mapping by poles
ZERO_GATE = 0.25  # logarithm, of the modulus or of the angle, beyond which two zeros are not the same
WRONG_SLOPE = 6.0  # cost of a slope of the other sign
UNMATCHED = 9.0  # a zero stays unmatched rather than three standard deviations off
UNMEASURED = 3.0  # a zero of the model in the band need not show: damping may hide it
PAIRABLE = ("complex", "quadruple")  # a real zero is never a target: no measured line shows where it is


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ZeroPairing:
    """Assignment of the measured zeros of one FRF to those of the model.

    Parameters
    ----------
    measured : (n,) int array
        Indices of the FRF's zeros among all measured ones.
    matching : Matching
        Rows are those, columns the model's zeros.
    probabilities : (n, m + 1) array
        Of every pair; the last column is that of no partner.
    costs : (n, m) array
        Of every pair.
    """

    measured: IntArray
    matching: Matching
    probabilities: FloatArray
    costs: FloatArray


def pair_zeros(
    fit: ModalFit, frf: int, model: ModelZeros, poles: tuple[FloatArray, FloatArray], polarity: float
) -> ZeroPairing:
    """Assign the measured zeros of one FRF to those of the model.

    Parameters
    ----------
    fit : ModalFit
        The fitted model.
    frf : int
        Which FRF.
    model : ModelZeros
        The model's zeros of that FRF.
    poles : pair of (k,) arrays
        Logarithms of the moduli of the paired poles, measured and computed.
    polarity : float
        Sign of the measured FRF against the model's.

    Returns
    -------
    ZeroPairing
        Zeros of different kinds are never paired.
    """
    measured = np.flatnonzero(fit.zeros.frf == frf)
    values = fit.zeros.values[measured]
    gap = map_frequency(np.log(np.abs(values)), *poles)[:, None] - np.log(np.abs(model.values) + np.finfo(float).tiny)
    slopes = measured_slope_sign(fit.model, frf, fit.labels[frf].quantity.power, values) * np.sign(polarity)
    wrong = WRONG_SLOPE * (slopes[:, None] * model.slope_sign < 0)
    kinds = np.array([fit.zeros.kind[zero] for zero in measured], dtype=object)
    is_pairable = np.isin(kinds.astype(str), PAIRABLE) & fit.zeros.identifiable[measured]
    is_same_kind = kinds[:, None] == np.array(model.kind, dtype=object)
    turn = np.angle(values)[:, None] - np.angle(model.values)
    is_allowed = is_pairable[:, None] & is_same_kind & (np.abs(gap) < ZERO_GATE) & (np.abs(turn) < ZERO_GATE)
    unmeasured = np.where(in_band(model.values, fit.band_hz, poles), UNMEASURED, 0.0)
    unmatched = np.full(len(values), UNMATCHED), unmeasured
    tried = []
    for scatter in (ZERO_STD, *(ZERO_STD / NARROWER).tolist()):
        costs = np.where(is_allowed, frequency_cost(gap, ZERO_STD, scatter) + wrong, np.inf)
        matching = match(costs, *unmatched)
        tried.append(Hypothesis(matching=matching, costs=costs, unmatched=unmatched, total=matching.cost))
    best = min(tried, key=lambda hypothesis: hypothesis.total)
    return ZeroPairing(
        measured=measured,
        matching=best.matching,
        probabilities=mixed_probabilities(tried),
        costs=best.costs,
    )


def highest_zero(fit: ModalFit, poles: tuple[FloatArray, FloatArray]) -> float:
    """Modulus up to which zeros of the model have a part in pairing.

    Parameters
    ----------
    fit : ModalFit
        The fitted model.
    poles : pair of (k,) arrays
        Logarithms of the moduli of the paired poles, measured and computed.

    Returns
    -------
    float
        On the model's axis, rad/s: beyond the band, and out of reach of every measured zero that can be a target.
    """
    pairable = np.isin(np.array(fit.zeros.kind, str), PAIRABLE) & fit.zeros.identifiable
    logs = np.log(np.append(np.abs(fit.zeros.values[pairable]), 2 * np.pi * fit.band_hz[1]))
    return float(np.exp(map_frequency(logs, *poles).max() + ZERO_GATE))


def map_frequency(logs: FloatArray, measured: FloatArray, computed: FloatArray) -> FloatArray:
    """Map measured frequencies onto the model's axis by the paired poles around them.

    Parameters
    ----------
    logs : (n,) array
        Logarithms of measured frequencies.
    measured, computed : (k,) array
        Logarithms of the paired poles.

    Returns
    -------
    (n,) array
        Logarithms on the model's axis; beyond the outermost poles the shift is theirs.
    """
    if not len(measured):
        return logs
    order = np.argsort(measured)
    return np.asarray(logs + np.interp(logs, measured[order], (computed - measured)[order]))


def in_band(values: ComplexArray, band_hz: tuple[float, float], poles: tuple[FloatArray, FloatArray]) -> np.ndarray:
    """Mark the roots of the model that a measurement in the band would show.

    Parameters
    ----------
    values : (n,) complex array
        The model's roots, rad/s.
    band_hz : pair of float
        The band that was fitted, Hz.
    poles : pair of (k,) arrays
        Logarithms of the paired poles, measured and computed.

    Returns
    -------
    (n,) bool array
        True inside.
    """
    edges = map_frequency(np.log(2 * np.pi * np.array(band_hz)), *poles)
    logs = np.log(np.abs(values) + np.finfo(float).tiny)
    return np.asarray((logs > edges[0]) & (logs < edges[1]))


def measured_slope_sign(model: PoleResidueModel, frf: int, power: int, zeros: ComplexArray) -> FloatArray:
    """Sign of the slope of the fitted receptance along the frequency axis at its zeros.

    Parameters
    ----------
    model : PoleResidueModel
        The fitted model.
    frf : int
        Which FRF.
    power : int
        Power of s that its quantity has over a receptance.
    zeros : (n,) complex array
        rad/s.

    Returns
    -------
    (n,) array
        -1, 0 or 1.
    """
    residues = model.residues[:, frf]
    residues = np.concatenate([residues, residues[model.poles.imag > 0].conj()])
    slope = -(residues / (zeros[:, None] - model.all_poles) ** 2).sum(axis=1)
    scaled = zeros / model.scale_rad_s
    for exponent, coefficient in zip(model.powers, model.coefficients[:, frf], strict=True):
        slope += coefficient * exponent * scaled ** (exponent - 1) / model.scale_rad_s
    return np.asarray(np.sign((1j * slope / zeros**power).real))
