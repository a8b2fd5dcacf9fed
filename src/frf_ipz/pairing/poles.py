"""Pairing of measured poles with those of the model: by frequency and by the amplitude of the mode in every FRF.

The cost of a pair is a squared distance in standard deviations: of the frequency, after a factor common to all modes
(a wrong modulus shifts them all), and of the mass-normalised amplitudes in every FRF, after one gain an FRF (its scale
may not be known). Neither alone is enough: frequencies cannot separate two close modes, and shapes at few points
cannot separate distant ones. A measured mode that is one with probability p only is as much less likely to be one of
the model: a pair costs ``-2 ln p`` more, and no partner does not.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.modes import modal_assurance
from frf_ipz.pairing.frequency_scatter import NARROWER, frequency_cost
from frf_ipz.pairing.matching import Hypothesis, Matching, match, mixed_probabilities
from frf_ipz.pairing.model_roots import ModelPoles

if TYPE_CHECKING:
    from frf_ipz.frf import FrfLabel
    from frf_ipz.identification.modal_fit import ModalFit

FREQUENCY_STD = 0.05  # of the logarithm of a frequency, after the common factor
LIKELY_FACTORS = 5  # tried for each narrow scatter: those with which most frequencies agree
COMMON_STD = 0.08  # of the logarithm of the common factor
COMMON_STEPS = 17  # of the search for it, over three standard deviations to each side
FREQUENCY_GATE = 0.3  # logarithm beyond which two poles are not the same whatever the shapes say
AMPLITUDE_STD = 0.4  # of an amplitude, over the mean amplitude in its FRF: shapes change with the stiffness
UNMATCHED = 9.0  # a pole stays unmatched rather than three standard deviations off
MAX_SHAPE = 12.0  # many FRFs must not outweigh any frequency: costs of shapes approach it
ROUNDS = 3  # of assigning and estimating the gains in turn


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PolePairing:
    """Assignment of measured poles to those of the model.

    Parameters
    ----------
    matching : Matching
        Rows are measured poles, columns the model's.
    probabilities : (n_measured, n_model + 1) array
        Of every pair, over all common factors and scatters; the last column is that of no partner.
    costs : (n_measured, n_model) array
        Of every pair.
    gains : (n_frfs,) array
        Measured over computed amplitude of each FRF; the sign is a polarity.
    """

    matching: Matching
    probabilities: FloatArray
    costs: FloatArray
    gains: FloatArray


def pair_poles(fit: ModalFit, model: ModelPoles) -> PolePairing:
    """Assign measured poles to those of the model.

    Parameters
    ----------
    fit : ModalFit
        The fitted model.
    model : ModelPoles
        The model's poles.

    Returns
    -------
    PolePairing
        The cheapest assignment over all common factors.
    """
    measured = np.log(np.abs(fit.model.poles[: fit.n_modes]))
    computed = np.log(np.abs(model.values) + np.finfo(float).tiny)
    band = np.log(2 * np.pi * np.array(fit.band_hz))
    gains = np.ones(len(fit.labels))
    amplitudes, noise = measured_amplitudes(fit)
    if fit.modes_given is not None:
        amplitudes = np.asarray(fit.modes_given.as_model_has_them().shapes.T)
    shapes = _direction_costs(amplitudes, model.amplitudes)  # gains are not known yet, and of a stated shape never
    doubt = -2 * np.log(np.maximum(probability_of_modes(fit), np.finfo(float).tiny))[:, None]
    for _ in range(ROUNDS if fit.labels else 0):
        best, *_ = _tried(measured, computed, shapes + doubt, band)
        gains = _gains(amplitudes, model.amplitudes, noise, best.matching.partner, fit.labels)
        shapes = _shape_costs(amplitudes, model.amplitudes, noise, gains, fit.labels)
    tried = _tried(measured, computed, shapes + doubt, band)
    return PolePairing(
        matching=tried[0].matching,
        probabilities=mixed_probabilities(tried),
        costs=tried[0].costs,
        gains=gains,
    )


def probability_of_modes(fit: ModalFit) -> FloatArray:
    """Give the probability that a measured mode is one: that it is found again.

    Parameters
    ----------
    fit : ModalFit
        The fitted model.

    Returns
    -------
    (n_modes,) array
        1 where nothing is known of it, as of stated modes.
    """
    if len(fit.modes) != fit.n_modes or "found_again" not in fit.modes:
        return np.ones(fit.n_modes)
    found_again = np.asarray(fit.modes["found_again"], float)
    return np.asarray(np.clip(np.nan_to_num(found_again, nan=1.0), 0.0, 1.0))


def measured_amplitudes(fit: ModalFit) -> tuple[ComplexArray, FloatArray]:
    """Residues of the fit as mass-normalised amplitudes of the receptance, with their standard deviations.

    Parameters
    ----------
    fit : ModalFit
        The fitted model.

    Returns
    -------
    amplitudes : (n_modes, n_frfs) complex array
        1/kg; complex where the modes are.
    std : (n_modes, n_frfs) array
        Of the modulus, 1/kg.
    """
    poles = fit.model.poles[: fit.n_modes]
    powers = np.array([label.quantity.power for label in fit.labels])
    to_amplitude = 2j * np.abs(poles)[:, None] / poles[:, None] ** powers
    std = np.sqrt(np.trace(fit.residue_covariance, axis1=2, axis2=3))
    return fit.model.residues[: fit.n_modes] * to_amplitude, std * np.abs(to_amplitude)


def _tried(measured: FloatArray, computed: FloatArray, shapes: FloatArray, band: FloatArray) -> list[Hypothesis]:
    """All common factors and scatters that are tried, the most likely first."""
    gaps = measured[:, None] - computed
    grid = COMMON_STD * np.linspace(-3, 3, COMMON_STEPS)
    hypotheses = [(float(offset), FREQUENCY_STD) for offset in grid]
    for scatter in (FREQUENCY_STD / NARROWER).tolist():
        hypotheses += [(offset, scatter) for offset in _likely_factors(gaps, shapes, scatter)]
    tried = []
    for offset, scatter in hypotheses:
        costs = frequency_cost(gaps - offset, FREQUENCY_STD, scatter) + shapes
        costs[np.abs(gaps) > FREQUENCY_GATE] = np.inf
        in_band = (computed + offset > band[0]) & (computed + offset < band[1])
        unmatched = np.full(len(measured), UNMATCHED), np.where(in_band, UNMATCHED, 0.0)
        matching = match(costs, *unmatched)
        # of factors as exact as the scatter, more could have been tried than there are steps of the grid
        choice = 2 * np.log(max((grid[1] - grid[0]) / scatter, 1.0))
        total = matching.cost + (offset / COMMON_STD) ** 2 + choice
        tried.append(Hypothesis(matching=matching, costs=costs, unmatched=unmatched, total=total))
    return sorted(tried, key=lambda hypothesis: hypothesis.total)


def _likely_factors(gaps: FloatArray, shapes: FloatArray, scatter: float) -> list[float]:
    """Factors with which most frequencies of like shapes agree to within a scatter."""
    candidates = np.abs(gaps) < min(3 * COMMON_STD, FREQUENCY_GATE)
    offsets, weights = gaps[candidates], np.exp(-shapes[candidates] / 2)
    votes = np.array([weights @ np.exp(-(((offsets - offset) / scatter) ** 2) / 2) for offset in offsets])
    chosen: list[float] = []
    for place in np.argsort(-votes):
        if len(chosen) == LIKELY_FACTORS:
            break
        if all(abs(offsets[place] - other) > scatter for other in chosen):
            chosen.append(float(offsets[place]))
    return chosen


def _sizes(amplitudes: ComplexArray, labels: tuple[FrfLabel, ...]) -> FloatArray:
    """Root of mean square of the amplitudes that an FRF would have if its sensor and its excitation shared all modes.

    Ports of two axes of a symmetric structure hardly do: the amplitudes between them are small, not so their change
    with a shape, which is a part of what the sensor sees of other modes. Where one row or column of FRFs was measured
    it is what the FRF has.
    """
    power = np.abs(amplitudes) ** 2
    total = np.maximum(power.sum(axis=1, keepdims=True), np.finfo(float).tiny)
    parts = []
    for dofs in ([label.output_dof.unsigned for label in labels], [label.input_dof.unsigned for label in labels]):
        numbers = np.unique([str(dof) for dof in dofs], return_inverse=True)[1]
        summed = power @ (numbers[:, None] == np.arange(numbers.max(initial=0) + 1))
        parts.append((np.mean(summed, axis=0)[numbers], np.mean(summed / total, axis=0)[numbers]))
    (of_output, output_share), (of_input, input_share) = parts
    shared = np.minimum(of_output * input_share, of_input * output_share)
    return np.asarray(np.sqrt(np.maximum(np.mean(power, axis=0), shared)))


def _direction_costs(measured: ComplexArray, computed: ComplexArray) -> FloatArray:
    """Squared distance of shapes whose scale is not known: what the best factor leaves of each, as MAC has it."""
    left_over = 1 - modal_assurance(measured.T, computed.T)
    return _bounded(left_over / AMPLITUDE_STD**2 * np.sqrt(measured.shape[1]))


def _bounded(costs: FloatArray) -> FloatArray:
    """Let costs approach the largest one from its half on: a better shape costs less, however many FRFs there are."""
    half = MAX_SHAPE / 2
    return np.asarray(np.where(costs < half, costs, MAX_SHAPE - half**2 / np.maximum(costs, half)))


def _gains(
    measured: ComplexArray,
    computed: ComplexArray,
    noise: FloatArray,
    partner: IntArray,
    labels: tuple[FrfLabel, ...],
) -> FloatArray:
    """Least-squares gain of each FRF over the modes paired so far; only its sign where its size is not clear."""
    rows = np.flatnonzero(partner >= 0)
    if not len(rows):
        return np.ones(measured.shape[1])
    partners = computed[partner[rows]]
    weights = 1 / (noise[rows] ** 2 + (AMPLITUDE_STD * _sizes(measured[rows], labels)) ** 2)
    inner = np.sum(weights * (measured[rows] * partners.conj()).real, axis=0)
    sizes = np.sum(weights * np.abs(partners) ** 2, axis=0)
    ratio = np.sqrt(np.mean(np.abs(measured[rows]) ** 2, 0) / np.maximum(np.mean(np.abs(partners) ** 2, 0), 1e-300))
    gain = inner / np.maximum(sizes, 1e-300)
    polarity = np.where(inner**2 < UNMATCHED * sizes, 1.0, gain)  # a sign that shapes leave open is the model's
    return np.asarray(np.where(np.abs(gain) > ratio / 3, np.copysign(gain, polarity), np.copysign(ratio, polarity)))


def _shape_costs(
    measured: ComplexArray,
    computed: ComplexArray,
    noise: FloatArray,
    gains: FloatArray,
    labels: tuple[FrfLabel, ...],
) -> FloatArray:
    """Squared distance of amplitudes: of their directions, which MAC compares, and of their sizes.

    Errors of a direction are shared by many FRFs, so their number counts with its root. The size is one number, however
    many FRFs show it: a modal mass that is off must not hide that a direction agrees.
    """
    scaled = measured / gains
    size = _sizes(scaled, labels)
    weight = 1 / ((AMPLITUDE_STD * size) ** 2 + (noise / gains) ** 2)
    of_measured = np.sum(weight * np.abs(scaled) ** 2, axis=1)[:, None]
    of_computed = weight @ (np.abs(computed) ** 2).T
    inner = (weight * scaled.conj()) @ computed.T
    distance = of_measured - 2 * inner.real + of_computed
    assurance = np.abs(inner) ** 2 / np.maximum(of_measured * of_computed, np.finfo(float).tiny)
    direction = np.clip(of_measured * (1 - assurance), 0.0, distance)
    count = measured.shape[1]
    return _bounded((direction * np.sqrt(count) + (distance - direction)) / count)
