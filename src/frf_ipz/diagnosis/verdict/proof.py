"""How far models are from measurements, before and after: figures and curves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.measured.transfer_functions import ROUGH_PART, SMOOTH_PART
from frf_ipz.diagnosis.result import Curves, Misfit

if TYPE_CHECKING:
    from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray
    from frf_ipz.diagnosis.evidence.fit import Data, Fit
    from frf_ipz.diagnosis.evidence.inference_problem import InferenceProblem
    from frf_ipz.diagnosis.options import DiagnoseOptions

MAX_NOISE = 0.3  # of an FRF: where noise is more, a norm would be that of the noise


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Proof:
    """Figures of three models: as it is, with what tolerances allow, with the findings.

    Parameters
    ----------
    before, updated, after : Misfit
        The figures.
    curves : Curves
        FRFs to draw.
    """

    before: Misfit
    updated: Misfit
    after: Misfit
    curves: Curves


def prove(problem: InferenceProblem, held_out: Data, null: Fit, final: Fit) -> Proof:
    """Compare models with what was fitted and what was not.

    Parameters
    ----------
    problem : InferenceProblem
        With what was fitted.
    held_out : Data
        What was not.
    null, final : Fit
        Of the nominal model with what its tolerances allow, and with the findings.

    Returns
    -------
    Proof
        Figures and curves.
    """
    no_nuisance = np.zeros(problem.nuisance_prior.size)
    cases = ((null, no_nuisance), (null, null.nuisance), (final, final.nuisance))
    figures = [_misfit(fit, nuisance, problem.data, held_out) for fit, nuisance in cases]
    nominal, updated, explained = (_model_frfs(fit, nuisance, problem.data) for fit, nuisance in cases)
    measured = problem.data.measured
    curves = Curves(
        s=measured.s,
        labels=measured.labels,
        measured=measured.values,
        nominal=nominal,
        updated=updated,
        explained=explained,
        expected=compute_error_std(problem.data, problem.context.options),
    )
    return Proof(before=figures[0], updated=figures[1], after=figures[2], curves=curves)


def compute_error_std(data: Data, options: DiagnoseOptions) -> FloatArray:
    """Compute the standard deviation of noise and of model errors that no parameter stands for.

    Parameters
    ----------
    data : Data
        Transfer functions.
    options : DiagnoseOptions
        Tolerances.

    Returns
    -------
    (n_points, n_frfs) array
        SI.
    """
    measured = data.measured
    noise = np.array([np.diag(covariance).real for covariance in measured.covariance]).T
    shared = np.stack([np.sum(np.abs(measured.shared_errors[index]) ** 2, 1) for index in measured.input_index], 1)
    model = (np.hypot(SMOOTH_PART, ROUGH_PART) * options.stiffness_tolerance) ** 2
    return np.asarray(np.sqrt(noise + shared * np.abs(measured.values) ** 2 + model * measured.size**2))


def _model_frfs(fit: Fit, nuisance: FloatArray, data: Data) -> ComplexArray:
    response = fit.hypothesis.respond(fit.values, nuisance, data.measured.s)
    return np.asarray(data.gains(response) * response.values)


def _misfit(fit: Fit, nuisance: FloatArray, training: Data, held_out: Data) -> Misfit:
    figures = []
    for data in (training, held_out):
        response = fit.hypothesis.respond(fit.values, nuisance, data.measured.s)
        white = data.misfit(response)
        mask = _is_above_noise(data)
        measured = np.where(mask, data.measured.values, 0.0)
        deviation = measured - np.where(mask, data.gains(response) * response.values, 0.0)
        figures.append((_relative_norm(deviation, measured), float(np.sqrt(white @ white / len(white)))))
    return Misfit(
        training=figures[0][0],
        held_out=figures[1][0],
        training_noise=figures[0][1],
        held_out_noise=figures[1][1],
    )


def _is_above_noise(data: Data) -> BoolArray:
    """Where the FRFs are more than noise; everywhere, if they are nowhere."""
    noise = np.array([np.diag(covariance).real for covariance in data.measured.covariance]).T
    mask = noise < (MAX_NOISE * data.measured.size) ** 2
    return np.asarray(mask | ~mask.any(0))


def _relative_norm(deviation: ComplexArray, measured: ComplexArray) -> float:
    """Norm over norm; each FRF that is not zero counts by its own size, for sensors have several units."""
    scale = np.sqrt(np.mean(np.abs(measured) ** 2, 0))
    is_measured = scale > 0
    deviation, measured = (part[:, is_measured] / scale[is_measured] for part in (deviation, measured))
    return float(np.linalg.norm(deviation) / np.linalg.norm(measured))
