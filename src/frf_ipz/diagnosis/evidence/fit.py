"""The data that hypotheses are fitted to, and the result of a fit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray

if TYPE_CHECKING:
    from frf_ipz.diagnosis.evidence.hypothesis import Hypothesis
    from frf_ipz.diagnosis.measured.transfer_functions import TransferFunctions, Whitening
    from frf_ipz.diagnosis.model.response import Response

FAR_OFF = 300.0  # mean squared misfit
NEARLY_RIGHT = 20.0  # the same: small effects are searched on top of such a fit
NEARLY_ALL = 2.0  # the same: nothing large can be missing
SMALL_NUISANCE_CHI2 = 600.0  # and this little is explained by nuisance parameters


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fit:
    """The maximum a posteriori (MAP) fit of a hypothesis.

    Parameters
    ----------
    hypothesis : Hypothesis
        Components at their locations.
    values : (n_parameters,) array
        Physical values of the parameters.
    nuisance : (n_nuisance,) array
        Nuisance parameters, in standard deviations.
    misfit : float
        Sum of squares of the whitened misfit.
    nuisance_chi2 : float
        Twice the prior's cost of `nuisance`: their sum of squares, more where they exceed a tolerance.
    log_evidence : float
        Natural logarithm, up to a constant that all hypotheses share.
    covariance : (n_parameters, n_parameters) array
        Of the parameters as searched (logarithms, parts of ranges).
    has_converged : bool
        True if the last step was small.
    n_determined : float
        Number of nuisance parameters that the data determine: what `nuisance_chi2` is expected to be at most.
    n_values : int
        Number of real values that it was fitted to.
    """

    hypothesis: Hypothesis
    values: FloatArray
    nuisance: FloatArray
    misfit: float
    nuisance_chi2: float
    log_evidence: float
    covariance: FloatArray
    has_converged: bool
    n_determined: float
    n_values: int

    @property
    def cost(self) -> float:
        """Minus the logarithm of likelihood times prior, up to a constant."""
        return 0.5 * (self.misfit + self.nuisance_chi2)

    @property
    def mean_misfit(self) -> float:
        """Mean square of the whitened misfit."""
        return self.misfit / self.n_values

    @property
    def is_far_off(self) -> bool:
        """So far off that its components are wrong or some are missing: its locations are not searched."""
        return self.mean_misfit > FAR_OFF

    @property
    def is_nearly_right(self) -> bool:
        """Its misfit is so small that small effects can explain it: they are searched on top of it."""
        return self.mean_misfit < NEARLY_RIGHT

    @property
    def explains_nearly_all(self) -> bool:
        """Nothing large can be missing beside it."""
        return self.mean_misfit <= NEARLY_ALL and self.nuisance_chi2 <= SMALL_NUISANCE_CHI2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Data:
    """What hypotheses are fitted to.

    Parameters
    ----------
    measured : TransferFunctions
        Transfer functions.
    whitening : Whitening
        Of their errors.
    free_gains : str
        ``none``, ``common`` or ``per_channel``: unknown gains; the model's FRFs are scaled to the measured ones.
    is_bounded : bool
        Tolerances are bounds; without them long steps are easier.
    """

    measured: TransferFunctions
    whitening: Whitening
    free_gains: str = "none"
    is_bounded: bool = True

    def gains(self, response: Response) -> FloatArray:
        """Real factors that bring the model's FRFs to the measured ones where scales are unknown, (n_frfs,) array."""
        return self._gains(response.values[:, :, None])[:, 0]

    def misfit(self, response: Response) -> FloatArray:
        """Whitened difference of measurement and model, (n_data,) array."""
        return self.whitening(self.measured.values - self.gains(response) * response.values)

    def misfits(self, values: ComplexArray) -> FloatArray:
        """Whitened differences of measurement and several models' FRFs, (n_points, n_frfs, n): (n_data, n) array."""
        return self.whitening(self.measured.values[:, :, None] - self._gains(values) * values)

    def _gains(self, values: ComplexArray) -> FloatArray:
        """Real factors that bring several models' FRFs to the measured ones, (n_frfs, n) array."""
        if self.free_gains == "none":
            return np.ones(values.shape[1:])
        model, measured = self._weigh(values), self._weigh(self.measured.values[:, :, None])
        products, squares = np.sum(model * measured, 1), np.sum(model**2, 1)
        if self.free_gains == "common":
            products = np.broadcast_to(products.sum(0), products.shape)
            squares = np.broadcast_to(squares.sum(0), squares.shape)
        return np.asarray(products / squares)

    def gain_directions(self, response: Response) -> FloatArray:
        """Orthonormal directions along which unknown gains move the whitened FRFs, (n_data, n_gains) array."""
        if self.free_gains == "none":
            return np.zeros((2 * self.measured.values.size, 0))
        model = self._weigh(response.values[:, :, None])[:, :, 0]
        if self.free_gains == "common":
            return np.asarray(model.reshape(-1, 1) / np.linalg.norm(model))
        directions = np.zeros((*model.shape, len(model)))
        own = np.arange(len(model))
        directions[own, :, own] = model / np.linalg.norm(model, axis=1)[:, None]
        return directions.reshape(-1, len(model))

    def slopes(self, response: Response, changes: ComplexArray) -> FloatArray:
        """Whitened changes of the model's FRFs, (n_data, n) array, projected on what unknown gains cannot change.

        [Kaufman1975] L. Kaufman, A variable projection method for solving separable nonlinear least squares problems,
        BIT 15 (1975) 49-57.
        """
        white = self.whitening(self.gains(response)[:, None] * changes)
        if self.free_gains == "none":
            return white
        model = self._weigh(response.values[:, :, None])[:, :, 0]
        by_frf = white.reshape(len(model), model.shape[1], -1)
        products, squares = np.einsum("fd,fdn->fn", model, by_frf), np.sum(model**2, 1)[:, None]
        if self.free_gains == "common":
            products = np.broadcast_to(products.sum(0), products.shape)
            squares = np.broadcast_to(squares.sum(), squares.shape)
        return np.asarray((by_frf - model[:, :, None] * (products / squares)[:, None]).reshape(white.shape))

    def _weigh(self, values: ComplexArray) -> FloatArray:
        """Weigh FRFs as misfits are, (n_frfs, 2 n_points, n) array; by their size where there is no whitening."""
        n_points, n_frfs, count = values.shape
        if self.whitening.factors.size:
            return self.whitening(values).reshape(n_frfs, 2 * n_points, count)
        relative = (values / self.measured.size[:, :, None]).swapaxes(0, 1)
        return np.concatenate([relative.real, relative.imag], axis=1)
