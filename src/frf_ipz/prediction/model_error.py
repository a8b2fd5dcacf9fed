"""What an updated model cannot express, estimated where it was measured and carried to where it was not.

At every line, what the updated model misses of the measured FRFs, beyond the spread of its ensemble and the noise of
the fit, and what the fit itself misses of them beyond their noise, is divided by the size of the FRF: the sum of the
moduli of its modes' contributions, which does not vanish at zeros. The mean square over the measured FRFs is the
relative size of the error there; that of an FRF which was not measured is as large in relation to its own size. The
mean square of n independent complex numbers is uncertain by itself, so that the error has a Student distribution with
2 n degrees of freedom; n is the number of sensors or of excited DOFs, whichever are fewer, for what is wrong at one of
them is so in all its FRFs.

[Kennedy2001]: M. C. Kennedy, A. O'Hagan, Bayesian calibration of computer models, Journal of the Royal Statistical
Society B 63 (2001) 425-464 (doi:10.1111/1467-9868.00294), for a discrepancy beside the parameters.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
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

    def draw(self, count: int) -> ComplexArray:
        """Draw errors, the same for all FRFs.

        Parameters
        ----------
        count : int
            Number of draws.

        Returns
        -------
        (count,) complex array
            Times `ratio` and the size of an FRF they are added to it.
        """
        rng = np.random.default_rng(SEED)
        normal = rng.standard_normal((count, 2)) @ np.array([1.0, 1.0j]) / np.sqrt(2.0)
        return np.asarray(normal / np.sqrt(rng.chisquare(self.degrees, count) / self.degrees))


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
    on_time = replace(fit.model, delay_s=np.zeros_like(fit.model.delay_s))  # a model of the structure is never late
    measured = on_time(s) / (scale.gains(fit.labels) if scale.is_relative else fit.gain * scale.level)
    if updated.expansion is not None:  # a wrong gain is an error of the test
        measured = measured / updated.expansion.wrong_gains_of(fit.labels)
    centre = as_ensemble(updated, ensemble.lowest_rad_s)
    lines_hz = np.abs(s) / (2 * np.pi)
    power = np.zeros(len(s))
    outputs, inputs = frf_rows(updated, fit.labels)
    powers = np.array([label.quantity.power for label in fit.labels])
    gains, sizes = scale.gains(fit.labels), frf_sizes(updated, fit.labels, s, centre)
    values = {(lines.start, frfs.start): block[0] for lines, frfs, block in centre.receptances(outputs, inputs, s)}
    drawn = np.stack([scale.drawn_about_level(label, len(ensemble.matrices)) for label in fit.labels], axis=1)
    noise = (_at(lines_hz, fit, fit.value_std) / gains) ** 2
    not_fitted = np.zeros_like(noise) if fit.missed is None else (_at(lines_hz, fit, fit.missed) / gains) ** 2
    for lines, frfs, block in ensemble.receptances(outputs, inputs, s):
        factor = s[lines, None] ** powers[frfs]
        block *= drawn[:, None, frfs]
        block -= block.mean(axis=0)
        parts = block.view(float).reshape(*block.shape, 2)
        spread = np.einsum("mlfp,mlfp->lf", parts, parts) / len(block) * np.abs(factor) ** 2
        missed = measured[lines, frfs] - values[lines.start, frfs.start] * factor
        excess = np.maximum(np.abs(missed) ** 2 - spread - noise[lines, frfs], 0.0) + not_fitted[lines, frfs]
        size = sizes[lines, frfs] ** 2
        power[lines] += np.divide(excess, size, out=np.zeros_like(size), where=size > 0.0).sum(axis=1)
    return ModelError(ratio=np.sqrt(power / len(fit.labels)), degrees=2 * _independent(fit.labels))


def _at(lines_hz: FloatArray, fit: ModalFit, values: FloatArray) -> FloatArray:
    """Values of the fit's lines at others, (n_lines, n_frfs)."""
    return np.stack([np.interp(lines_hz, fit.frequency_hz, of_frf) for of_frf in values.T], axis=1)


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


def frf_rows(updated: UpdatedModel, labels: Sequence[FrfLabel]) -> tuple[FloatArray, FloatArray]:
    """Rows of sensors and excitations in a model.

    Parameters
    ----------
    updated : UpdatedModel
        The updated model.
    labels : sequence of FrfLabel
        Which FRFs.

    Returns
    -------
    outputs, inputs : (n_frfs, r) array
        Motion for unit motions of the retained DOFs.
    """
    outputs = np.array([updated.model.row(label.output_dof) for label in labels])
    return outputs, np.array([updated.model.row(label.input_dof) for label in labels])


def frf_sizes(updated: UpdatedModel, labels: Sequence[FrfLabel], s: ComplexArray, centre: ModelEnsemble) -> FloatArray:
    """Add up the moduli of the contributions of all modes to each FRF.

    Parameters
    ----------
    updated : UpdatedModel
        The updated model.
    labels : sequence of FrfLabel
        Which FRFs.
    s : (n_lines,) complex array
        Lines, rad/s.
    centre : ModelEnsemble
        The updated model as an ensemble of one.

    Returns
    -------
    (n_lines, n_frfs) array
        In the unit of the FRF; no less than its modulus.
    """
    squares, shapes = centre.modes[0][0], centre.modes[1][0]
    damping = np.sum(shapes * (updated.model.damping @ shapes), axis=0)
    outputs, inputs = frf_rows(updated, labels)
    products = np.abs((outputs @ shapes) * (inputs @ shapes))
    powers = np.array([label.quantity.power for label in labels])
    by_mode = 1 / np.abs(s[:, None] ** 2 + s[:, None] * damping + squares)
    return np.asarray((by_mode @ products.T) * np.abs(s[:, None]) ** powers)


def _independent(labels: Sequence[FrfLabel]) -> int:
    """Count the errors that are independent: FRFs of one sensor or one excited DOF share that one's."""
    return min(len({label.output_dof.name for label in labels}), len({label.input_dof.name for label in labels}))
