"""Measured and computed modes in one form, so that a mistake of the user's is a change of the computed ones.

The residue of a receptance at a normal mode is ``phi_output phi_input / (2 i omega_d)``, sec. 2.6 of [Ewins2000]: what
is compared is the product of the two, which needs no scale and no sign of a shape.

[Ewins2000] D. J. Ewins, Modal Testing: Theory, Practice and Application, 2nd ed., Research Studies Press, 2000.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from frf_ipz.identification.results.shapes import product_factors
from frf_ipz.late_imports import import_late
from frf_ipz.rational import natural_frequency_hz

if TYPE_CHECKING:
    from collections.abc import Mapping

    from scipy.optimize import linear_sum_assignment

    from frf_ipz.dofs import AnyDof
    from frf_ipz.frf import FrfLabel
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.identification.peaks import FrfPeaks
    from frf_ipz.modes import ModeSet
else:
    linear_sum_assignment = import_late("scipy.optimize", "linear_sum_assignment")

# How far a model is off that is nearly right: what lies beyond is worth a cause.
FREQUENCY_SCALE = 0.03  # of a frequency, relative: 6 % of a stiffness, the scatter of moduli and thicknesses
SHAPE_SCALE = 0.2  # of a product of shapes, relative: what an unmodelled mass or joint of that size does
FAR = 10.0  # frequency scales: a mode further from every computed one has no counterpart, be it false or missing


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MeasuredModes:
    """What the fit says of each mode.

    Parameters
    ----------
    frequency_hz : (n_modes,) array
        Natural frequencies, Hz.
    products : (n_modes, n_frfs) complex array
        ``phi_output phi_input``, 1/kg, with the signs of the labels taken out.
    deviations : (n_modes, n_frfs) array
        Their standard deviations.
    labels : tuple of FrfLabel
        What each FRF connects.
    band_hz : pair of float
        The band that was fitted: modes of the model in it should have been measured.
    """

    frequency_hz: FloatArray
    products: ComplexArray
    deviations: FloatArray
    labels: tuple[FrfLabel, ...]
    band_hz: tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ComputedModes:
    """Elastic modes of the FE model at the measured DOFs.

    Parameters
    ----------
    frequency_hz : (n_modes,) array
        Natural frequencies, Hz.
    shapes : mapping of Dof to (n_modes,) array
        Mass-normalised, by unsigned DOF.
    """

    frequency_hz: FloatArray
    shapes: Mapping[AnyDof, FloatArray]

    def products(
        self,
        labels: tuple[FrfLabel, ...],
        moved_outputs: Mapping[AnyDof, AnyDof],
        moved_inputs: Mapping[AnyDof, AnyDof],
    ) -> FloatArray:
        """Give ``phi_output phi_input`` of each mode and FRF.

        Parameters
        ----------
        labels : tuple of FrfLabel
            What each FRF connects.
        moved_outputs, moved_inputs : mapping of Dof to Dof
            Where a DOF of the labels really is; those that are not named are where they say.

        Returns
        -------
        (n_modes, n_frfs) array
            1/kg.
        """
        outputs = [label.output_dof.unsigned for label in labels]
        inputs = [label.input_dof.unsigned for label in labels]
        at_outputs = np.stack([self.shapes[moved_outputs.get(dof, dof)] for dof in outputs], 1)
        at_inputs = np.stack([self.shapes[moved_inputs.get(dof, dof)] for dof in inputs], 1)
        return at_outputs * at_inputs


def measured_modes(fit: ModalFit) -> MeasuredModes:
    """Take the modes out of a fit.

    Parameters
    ----------
    fit : ModalFit
        The fitted model.

    Returns
    -------
    MeasuredModes
        Of the band.
    """
    factors = product_factors(fit)
    deviations = np.sqrt(np.maximum(np.trace(fit.residue_covariance, axis1=2, axis2=3), 0.0))
    return MeasuredModes(
        frequency_hz=natural_frequency_hz(fit.model.poles[: fit.n_modes]),
        products=fit.model.residues[: fit.n_modes] * factors,
        deviations=deviations * np.abs(factors),
        labels=fit.labels,
        band_hz=fit.band_hz,
    )


def modes_of_peaks(peaks: FrfPeaks, labels: tuple[FrfLabel, ...]) -> MeasuredModes:
    """Take the modes out of a first look at FRFs.

    Parameters
    ----------
    peaks : FrfPeaks
        Modes that make a peak.
    labels : tuple of FrfLabel
        What each FRF connects.

    Returns
    -------
    MeasuredModes
        Of the band.
    """
    return MeasuredModes(
        frequency_hz=peaks.frequency_hz,
        products=peaks.products,
        deviations=peaks.deviations,
        labels=labels,
        band_hz=peaks.band_hz,
    )


def computed_modes(modes: ModeSet) -> ComputedModes:
    """Take the elastic modes out of a set.

    Parameters
    ----------
    modes : ModeSet
        Of the FE model, mass-normalised.

    Returns
    -------
    ComputedModes
        Without the rigid-body modes.
    """
    elastic = modes.natural_frequency_hz > 0
    return ComputedModes(
        frequency_hz=modes.natural_frequency_hz[elastic],
        shapes={dof: row[elastic].real for dof, row in zip(modes.dofs, modes.shapes, strict=True)},
    )


def log_likelihood(measured: MeasuredModes, frequency_hz: FloatArray, products: ComplexArray | FloatArray) -> float:
    """Give the log likelihood of the measured modes, where the model is nearly right but for what was changed in it.

    Every measured mode is assigned a computed one. Errors of frequencies and of products of shapes are drawn from
    Cauchy's distribution, so that one mode or one FRF that is off for reasons of its own does not decide.

    Parameters
    ----------
    measured : MeasuredModes
        The measurement.
    frequency_hz : (n_computed,) array
        Of the changed model.
    products : (n_computed, n_frfs) array
        Of the changed model, as its channels would have measured them.

    Returns
    -------
    float
        Natural logarithm; 0 where all agrees.
    """
    return assigned_log_likelihood(
        measured,
        frequency_hz,
        _costs(measured, frequency_hz, products),
        costs_of_absence(measured, measured.products),
        costs_of_absence(measured, products),
    )


def assigned_log_likelihood(
    measured: MeasuredModes,
    frequency_hz: FloatArray,
    costs: FloatArray,
    not_computed: FloatArray,
    not_measured: FloatArray,
) -> float:
    """Give the log likelihood from the costs of all pairs of modes, under the assignment that costs least.

    Parameters
    ----------
    measured : MeasuredModes
        The measurement.
    frequency_hz : (n_computed,) array
        Of the changed model.
    costs : (n_modes, n_computed) array
        Of each pair; infinite to one that is far.
    not_computed : (n_modes,) array
        Of measured modes without a counterpart.
    not_measured : (n_computed,) array
        Of computed modes that nobody measured, wherever they are.

    Returns
    -------
    float
        Natural logarithm.
    """
    rows, columns = _assign(costs, not_computed)
    unseen = np.minimum(not_measured, _costs_outside(measured, frequency_hz))
    alone = np.delete(not_computed, rows).sum() + np.delete(unseen, columns).sum()
    return float(-costs[rows, columns].sum() - alone)


def _costs_outside(measured: MeasuredModes, frequency_hz: FloatArray) -> FloatArray:
    """Costs of frequencies that are off by as much as it takes to lie outside of the band: 0 where they do."""
    to_edges = np.log(frequency_hz / measured.band_hz[0]), np.log(measured.band_hz[1] / frequency_hz)
    nearest = np.minimum(*to_edges).clip(min=0)
    return np.asarray(np.log1p((nearest / FREQUENCY_SCALE) ** 2))


def _assign(costs: FloatArray, alone: FloatArray) -> tuple[IntArray, IntArray]:
    """Assign one to one; a measured mode that finds no computed one for less than it costs `alone` stays so."""
    rows, columns = linear_sum_assignment(np.hstack([costs, np.tile(alone[:, None], len(costs))]))
    assigned = columns < costs.shape[1]
    return rows[assigned], columns[assigned]


def _costs(measured: MeasuredModes, frequency_hz: FloatArray, products: ComplexArray | FloatArray) -> FloatArray:
    """Costs of assigning each measured mode (rows) to each computed one (columns); infinite to one that is far."""
    near, costs = cost_of_frequency(measured.frequency_hz, frequency_hz)
    rows, columns = np.nonzero(near)
    floor = np.sqrt(np.mean(np.abs(measured.products) ** 2, axis=1))[rows, None]
    of_products = cost_of_products(measured.products[rows], products[columns], measured.deviations[rows], floor)
    result = np.full(costs.shape, np.inf)
    result[rows, columns] = costs[rows, columns] + of_products.sum(axis=1)
    return result


def cost_of_frequency(measured_hz: FloatArray, computed_hz: FloatArray) -> tuple[BoolArray, FloatArray]:
    """Give the cost of each pair of natural frequencies.

    Parameters
    ----------
    measured_hz : (n,) array
        Hz.
    computed_hz : (m,) array
        Hz.

    Returns
    -------
    near : (n, m) bool array
        False where a pair is out of the question.
    costs : (n, m) array
        Minus the logarithm of Cauchy's density, over that of its middle.
    """
    ratios = np.log(measured_hz[:, None] / computed_hz)
    return np.abs(ratios) <= FAR * FREQUENCY_SCALE, np.log1p((ratios / FREQUENCY_SCALE) ** 2)


def cost_of_products(
    measured: ComplexArray, computed: ComplexArray | FloatArray, deviations: FloatArray, floor: FloatArray
) -> FloatArray:
    """Give the cost of pairs of products of shapes.

    Parameters
    ----------
    measured, computed : (..., n_frfs) arrays
        1/kg.
    deviations : (..., n_frfs) array
        Of the measured ones.
    floor : (..., 1) array
        Size of the measured mode.

    Returns
    -------
    (..., n_frfs) array
        Minus the logarithm of Cauchy's density, over that of its middle.
    """
    sizes = (_squares(measured) + _squares(computed)) / 2 + (SHAPE_SCALE * floor) ** 2
    scales = SHAPE_SCALE**2 * sizes + deviations**2
    return np.asarray(np.log1p(_squares(measured - computed) / np.maximum(scales, np.finfo(float).tiny)))


def _squares(values: ComplexArray | FloatArray) -> FloatArray:
    """Squares of moduli; roots are not needed, and of complex numbers cost as much as all the rest."""
    return np.asarray(values.real**2 + values.imag**2 if np.iscomplexobj(values) else values**2, np.float64)


def costs_of_absence(measured: MeasuredModes, products: ComplexArray | FloatArray) -> FloatArray:
    """Give the costs of modes without a counterpart, measured ones or computed ones: little for one that hardly shows.

    At most a mode is far in frequency, and its products of shapes are off by their own size. A false mode of a fit is
    small beside the others.

    Parameters
    ----------
    measured : MeasuredModes
        The measurement.
    products : (n_modes, n_frfs) array
        Of the modes in question, 1/kg.

    Returns
    -------
    (n_modes,) array
        As for `cost_of_products`.
    """
    visible = visibility(measured, products)
    return absence_of(np.log1p(visible**2).sum(axis=1), visible.max(axis=1), products.shape[1])


def absence_of(log_sizes: FloatArray, largest: FloatArray, n_frfs: int) -> FloatArray:
    """Give the costs of modes without a counterpart from what is visible of them; see `costs_of_absence`.

    Parameters
    ----------
    log_sizes : (n_modes,) array
        Sum over the FRFs of ``log(1 + v^2)`` for a visibility v.
    largest : (n_modes,) array
        Visibility in the FRF that shows the mode best.
    n_frfs : int
        Number of FRFs.

    Returns
    -------
    (n_modes,) array
        As for `cost_of_products`.
    """
    shapes = np.minimum(log_sizes, cost_of_own_size(n_frfs))
    return np.asarray(np.log1p(FAR**2) * largest.clip(max=1) + shapes)


def visibility(
    measured: MeasuredModes, products: ComplexArray | FloatArray, frfs: IntArray | None = None
) -> FloatArray:
    """Give the sizes of products of shapes beside what is off in those of a measured mode.

    Parameters
    ----------
    measured : MeasuredModes
        The measurement.
    products : (n_modes, n_frfs) array
        1/kg.
    frfs : (n_frfs,) int array, optional
        Which FRFs these are; all by default.

    Returns
    -------
    (n_modes, n_frfs) array
        Without a unit.
    """
    own = measured.products if frfs is None else measured.products[:, frfs]
    scale = SHAPE_SCALE * np.sqrt(np.mean(np.abs(own) ** 2, axis=0))
    return np.asarray(np.abs(products) / np.maximum(scale, np.finfo(float).tiny))


def cost_of_own_size(n_frfs: int) -> float:
    """Give the cost of products of shapes that are off by their own size.

    Parameters
    ----------
    n_frfs : int
        How many products a mode has.

    Returns
    -------
    float
        Of one mode.
    """
    return float(n_frfs * np.log1p(1 / SHAPE_SCALE**2))


def unrelated_log_likelihood(measured: MeasuredModes) -> float:
    """Give the log likelihood where something else is wrong: shapes are off by their size, frequencies fit by chance.

    Or a mode is a false one of the fit, which costs what it does without a counterpart.

    Parameters
    ----------
    measured : MeasuredModes
        The measurement.

    Returns
    -------
    float
        Natural logarithm.
    """
    off = np.minimum(costs_of_absence(measured, measured.products), cost_of_own_size(measured.products.shape[1]))
    return -float(off.sum())
