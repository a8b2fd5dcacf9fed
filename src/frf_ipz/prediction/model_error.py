"""What an updated model cannot express, estimated where it was measured and carried to where it was not.

At every line, what the updated model misses of the measured FRFs, beyond the spread of its ensemble and the noise of
the fit, is divided by the size of the FRF: the sum of the moduli of its modes' contributions, which does not vanish at
zeros. The mean square over the measured FRFs is the relative size of the error there; that of an FRF which was not
measured is as large in relation to its own size. The mean square of n independent complex numbers is uncertain by
itself, so that the error has a Student distribution with 2 n degrees of freedom; n is the number of sensors or of
excited DOFs, whichever are fewer, for what is wrong at one of them is so in all its FRFs.

[Kennedy2001]: M. C. Kennedy, A. O'Hagan, Bayesian calibration of computer models, Journal of the Royal Statistical
Society B 63 (2001) 425-464 (doi:10.1111/1467-9868.00294), for a discrepancy beside the parameters.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.prediction.ensemble import ModelEnsemble

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.arrays import ComplexArray, FloatArray
    from frf_ipz.frf import FrfLabel
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.updating.updated_model import UpdatedModel

SEED = 0  # of the draws: the same bands from the same inputs


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ModelError:
    """Relative size of what a model cannot express.

    Parameters
    ----------
    ratio : (n_lines,) array
        Root mean square of the error over the size of an FRF.
    degrees : int
        Of freedom of that estimate.
    """

    ratio: FloatArray
    degrees: int

    def draw(self, size: FloatArray, count: int) -> ComplexArray:
        """Draw errors of an FRF.

        Parameters
        ----------
        size : (n_lines,) array
            Sum of the moduli of the contributions of its modes.
        count : int
            Number of draws.

        Returns
        -------
        (count, n_lines) complex array
            To be added to the FRF.
        """
        rng = np.random.default_rng(SEED)
        normal = rng.standard_normal((count, 2)) @ np.array([1.0, 1.0j]) / np.sqrt(2.0)
        student = normal / np.sqrt(rng.chisquare(self.degrees, count) / self.degrees)
        return np.asarray(student[:, None] * (self.ratio * size))


def estimate_model_error(fit: ModalFit, updated: UpdatedModel, ensemble: ModelEnsemble, s: ComplexArray) -> ModelError:
    """Estimate what an updated model cannot express from the measured FRFs.

    Parameters
    ----------
    fit : ModalFit
        The fitted model of the measured FRFs.
    updated : UpdatedModel
        The updated model.
    ensemble : ModelEnsemble
        Its ensemble.
    s : (n_lines,) complex array
        Lines, rad/s.

    Returns
    -------
    ModelError
        0 where the ensemble and the noise explain what is missed.
    """
    scale = updated.scale
    measured = fit.model(s) / (scale.gains(fit.labels) if scale.is_relative else fit.gain)
    centre = as_ensemble(updated, ensemble.lowest_rad_s)
    lines_hz = np.abs(s) / (2 * np.pi)
    power = np.zeros(len(s))
    for frf, label in enumerate(fit.labels):
        output, force = updated.model.row(label.output_dof), updated.model.row(label.input_dof)
        factor = s**label.quantity.power
        value = centre.receptance(output, force, s)[0] * factor
        members = ensemble.receptance(output, force, s) * factor
        spread = np.var(members * scale.drawn(label, len(members))[:, None], axis=0)
        noise = (np.interp(lines_hz, fit.frequency_hz, fit.value_std[:, frf]) / scale.gain(label)) ** 2
        excess = np.maximum(np.abs(measured[:, frf] - value) ** 2 - spread - noise, 0.0)
        size = frf_size(updated, label, s, centre)
        power += np.divide(excess, size**2, out=np.zeros(len(s)), where=size > 0.0)
    return ModelError(ratio=np.sqrt(power / len(fit.labels)), degrees=2 * _independent(fit.labels))


def as_ensemble(updated: UpdatedModel, lowest_rad_s: float) -> ModelEnsemble:
    """Take the updated model as an ensemble of one.

    Parameters
    ----------
    updated : UpdatedModel
        The updated model.
    lowest_rad_s : float
        Lowest frequency at which FRFs are evaluated.

    Returns
    -------
    ModelEnsemble
        With one member.
    """
    model = updated.model
    matrices = np.stack([model.mass, model.damping, model.stiffness])[None]
    return ModelEnsemble(matrices=matrices, lowest_rad_s=lowest_rad_s)


def frf_size(updated: UpdatedModel, label: FrfLabel, s: ComplexArray, centre: ModelEnsemble) -> FloatArray:
    """Add up the moduli of the contributions of all modes to an FRF.

    Parameters
    ----------
    updated : UpdatedModel
        The updated model.
    label : FrfLabel
        Which FRF.
    s : (n_lines,) complex array
        Lines, rad/s.
    centre : ModelEnsemble
        The updated model as an ensemble of one.

    Returns
    -------
    (n_lines,) array
        In the unit of the FRF; no less than its modulus.
    """
    squares, shapes = centre.modes[0][0], centre.modes[1][0]
    damping = np.einsum("ir,ij,jr->r", shapes, updated.model.damping, shapes)
    products = (updated.model.row(label.output_dof) @ shapes) * (updated.model.row(label.input_dof) @ shapes)
    contributions = np.abs(products) / np.abs(s[:, None] ** 2 + s[:, None] * damping + squares)
    return np.asarray(contributions.sum(axis=1) * np.abs(s) ** label.quantity.power)


def _independent(labels: Sequence[FrfLabel]) -> int:
    """Count the errors that are independent: FRFs of one sensor or one excited DOF share that one's."""
    return min(len({label.output_dof.name for label in labels}), len({label.input_dof.name for label in labels}))
