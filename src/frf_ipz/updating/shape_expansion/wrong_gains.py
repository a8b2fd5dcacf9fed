"""Points whose gain is wrong: what was measured there is off by one factor in all modes.

Tolerances of position and gain make every amplitude uncertain; that is the error of the expansion. A file with a wrong
gain is something else: in all modes it is off by the same factor, which the directions of the measured shapes show. The
directions of a zero-mean Gaussian field have a density that no longer knows its size [Tyler1987]. With it, each point
is compared as it is and with a factor of unknown order of magnitude, the error of the amplitudes being unknown in both
cases. How many points of how many are wrong is not known before; all numbers are as likely, so that more points need
more evidence [Scott2010].

[Tyler1987] D. E. Tyler, Statistical analysis for the angular central Gaussian distribution on the sphere, Biometrika
74, 1987, 579-589, doi:10.1093/biomet/74.3.579.
[Scott2010] J. G. Scott, J. O. Berger, Bayes and empirical-Bayes multiplicity adjustment in the variable-selection
problem, Annals of Statistics 38, 2010, 2587-2619, doi:10.1214/10-AOS792.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg
from scipy.special import logsumexp

from frf_ipz.arrays import FloatArray
from frf_ipz.updating.shape_expansion.attached_masses import ERROR_STD, LIKELY_ERROR
from frf_ipz.updating.shape_expansion.random_forces import ModalModel, field_at_points

if TYPE_CHECKING:
    from collections.abc import Collection

    from frf_ipz.dofs import AnyDof
    from frf_ipz.structure import ReducedModel
    from frf_ipz.updating.shape_expansion.measured_shapes import MeasuredShapes
    from frf_ipz.updating.shape_expansion.random_forces import FieldAtPoints

PROMISED = 0.05  # of a gain: less is what calibrations promise
LARGEST = 10.0  # factor: a wrong range, or units of g for m/s^2
STEP = PROMISED / 10  # of the logarithm of a gain: finer than what some ten modes tell of it
ERRORS = LIKELY_ERROR * np.exp(ERROR_STD * np.linspace(-3.0, 3.0, 31))
CORRELATIONS = np.linspace(-14.0, 14.0, 561)  # inverse hyperbolic tangent of a correlation, to rounding
ANGLES = 4000  # more than twice what the narrowest peak asks for
ROUNDING = 1e-12


@dataclass(frozen=True, slots=True, kw_only=True)
class WrongGain:
    """A point whose gain is wrong.

    Parameters
    ----------
    log_gain : float
        Logarithm of what was measured over what is.
    std : float
        Its standard deviation.
    """

    log_gain: float
    std: float


def find_wrong_gains(
    model: ReducedModel, measured: MeasuredShapes, candidates: Collection[AnyDof], *, scatter: float
) -> dict[AnyDof, WrongGain]:
    """Find points whose gain is wrong, of the side of the test that has more.

    Parameters
    ----------
    model : ReducedModel
        The model over which shapes are expanded.
    measured : MeasuredShapes
        Shapes at sensors and excited DOFs.
    candidates : collection of Dof or PortDof
        Points that may be wrong. One beyond all others is not among them: what the model lacks there, a mass at an end,
        makes all modes smaller too.
    scatter : float
        Standard deviation of the logarithms of measured frequencies about those of the model.

    Returns
    -------
    dict of Dof or PortDof to WrongGain
        Less than half of the points; none where each is more likely right.
    """
    is_output = len(measured.outputs) >= len(measured.inputs)
    points = measured.outputs if is_output else measured.inputs
    first = 0 if is_output else len(measured.outputs)
    modal = ModalModel.of(model, measured, scatter)
    wrong: dict[AnyDof, WrongGain] = {}
    while 2 * (len(wrong) + 1) < len(points):
        log_factors, gains, stds = _compare(modal, measured, is_output=is_output)
        log_factors[[point in wrong or point not in candidates for point in points]] = -np.inf
        worst = int(np.argmax(log_factors))
        odds = (len(wrong) + 1) / (len(points) - len(wrong))
        if log_factors[worst] + np.log(odds) < 0:
            break
        wrong[points[worst]] = WrongGain(log_gain=float(gains[worst]), std=float(stds[worst]))
        doubt = measured.doubt.copy()
        doubt[first + worst] = float(np.hypot(gains[worst], stds[worst])) ** 2  # it hardly counts
        measured = replace(measured, doubt=doubt)
    return wrong


def _compare(
    model: ModalModel, measured: MeasuredShapes, *, is_output: bool
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Compare each point with a gain of its own to none: logarithm of the Bayes factor, log gain, its deviation."""
    steps = round(np.log(LARGEST) / STEP)
    log_gains = STEP * np.arange(-steps, steps + 1)
    log_gains = log_gains[np.abs(log_gains) > PROMISED - STEP / 2]
    log_prior = -np.log(np.abs(log_gains))  # of unknown order of magnitude
    log_prior -= logsumexp(log_prior)
    log_weights = -0.5 * (np.log(ERRORS / LIKELY_ERROR) / ERROR_STD) ** 2
    density = DirectionDensity.of(model, is_output=is_output)
    count = len(model.outputs if is_output else model.inputs)
    as_it_is = np.zeros(len(ERRORS))
    corrected = np.zeros((len(ERRORS), count, len(log_gains)))
    for mode in range(len(measured.omega)):
        field = field_at_points(model, measured, mode)
        for number, error in enumerate(ERRORS):
            one, all_gains = density.of_mode(field, measured, mode, float(error), log_gains)
            as_it_is[number] += one
            corrected[number] += all_gains
    posterior = corrected + log_weights[:, None, None] + log_prior
    of_point = logsumexp(posterior, axis=(0, 2))
    shares = np.exp(logsumexp(posterior, axis=0) - of_point[:, None])
    mean = shares @ log_gains
    variance = np.maximum(shares @ log_gains**2 - mean**2, 0.0)
    return of_point - logsumexp(as_it_is + log_weights), mean, np.sqrt(variance)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DirectionDensity:
    """Density of the two directions of a measured mode, whose sizes are not known.

    Parameters
    ----------
    is_output : bool
        Whether gains of sensors are in question.
    mine, other : slice
        Places of that side and of the other.
    n_mine, n_other : int
        Points of each.
    log_angles : (n_correlations,) array
        Logarithm of the integral over how the sizes share what is not known of them, for each of `CORRELATIONS`.
    """

    is_output: bool
    mine: slice
    other: slice
    n_mine: int
    n_other: int
    log_angles: FloatArray

    @classmethod
    def of(cls, model: ModalModel, *, is_output: bool) -> DirectionDensity:
        """Prepare the integral.

        Parameters
        ----------
        model : ModalModel
            Has the sensors and the excited DOFs.
        is_output : bool
            Whether gains of sensors are in question.

        Returns
        -------
        DirectionDensity
            For all modes.
        """
        n_outputs, n_inputs = len(model.outputs), len(model.inputs)
        outputs, inputs = slice(0, n_outputs), slice(n_outputs, n_outputs + n_inputs)
        angle = (np.arange(ANGLES) + 0.5) * np.pi / ANGLES  # both polarities
        sizes = np.abs(np.cos(angle)) ** (n_outputs - 1) * np.abs(np.sin(angle)) ** (n_inputs - 1)
        spread = np.maximum(1 + np.tanh(CORRELATIONS)[:, None] * np.sin(2 * angle), ROUNDING)
        return cls(
            is_output=is_output,
            mine=outputs if is_output else inputs,
            other=inputs if is_output else outputs,
            n_mine=n_outputs if is_output else n_inputs,
            n_other=n_inputs if is_output else n_outputs,
            log_angles=np.log(np.mean(sizes * spread ** (-(n_outputs + n_inputs) / 2), axis=1)),
        )

    def of_mode(
        self, field: FieldAtPoints, measured: MeasuredShapes, mode: int, error: float, log_gains: FloatArray
    ) -> tuple[float, FloatArray]:
        """Give the density of a mode as it was measured, and if each point had a gain.

        Parameters
        ----------
        field : FieldAtPoints
            At the frequency of the mode.
        measured : MeasuredShapes
            Shapes at sensors and excited DOFs.
        mode : int
            Which one.
        error : float
            Relative error of each measured amplitude.
        log_gains : (n,) array
            Logarithm of the gain.

        Returns
        -------
        as_it_is : float
            Logarithm, but for a constant.
        with_gain : (n_mine, n) array
            The same where each point has each gain.
        """
        direction, opposite = np.zeros(self.n_mine + self.n_other), np.zeros(self.n_mine + self.n_other)
        direction[self.mine] = (measured.at_outputs if self.is_output else measured.at_inputs)[mode]
        opposite[self.other] = (measured.at_inputs if self.is_output else measured.at_outputs)[mode]
        lower = linalg.cholesky(field.prior + np.diag(field.error_variance(error)), lower=True)
        inverse = linalg.cho_solve((lower, True), np.eye(len(lower)))
        by_direction, by_opposite = inverse @ direction, inverse @ opposite
        square, square_opposite, product = direction @ by_direction, opposite @ by_opposite, direction @ by_opposite
        change = np.concatenate([[0.0], np.expm1(-log_gains)]) * direction[self.mine, None]
        squares = square + 2 * change * by_direction[self.mine, None] + change**2 * np.diag(inverse)[self.mine, None]
        correlation = (product + change * by_opposite[self.mine, None]) / np.sqrt(squares * square_opposite)
        hyperbolic = np.arctanh(np.clip(correlation, ROUNDING - 1, 1 - ROUNDING))
        values = (
            np.interp(hyperbolic, CORRELATIONS, self.log_angles)
            - self.n_mine / 2 * np.log(squares)
            - self.n_other / 2 * np.log(square_opposite)
            - np.log(np.diag(lower)).sum()
        )
        return float(values[0, 0]), values[:, 1:] - log_gains
