"""Predictive check of a law: misfits on the records that it was fitted to and on those that were held out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.nonlinear.fitting.linear_fit import as_real_rows, linear_sensor_motion
from frf_ipz.diagnosis.nonlinear.fitting.output_error_fit import fit_output_error
from frf_ipz.diagnosis.nonlinear.model.modal_model import respond
from frf_ipz.diagnosis.result import Misfit

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray
    from frf_ipz.diagnosis.nonlinear.fitting.alternating_fit import LawFit
    from frf_ipz.diagnosis.nonlinear.fitting.problem import LawFitProblem
    from frf_ipz.diagnosis.nonlinear.model.modal_model import ModalModel
    from frf_ipz.diagnosis.nonlinear.model.nuisance_prior import NuisancePrior
    from frf_ipz.diagnosis.nonlinear.segments import SegmentSet


def compare_misfits(problem: LawFitProblem, held_out: SegmentSet | None, fit: LawFit) -> tuple[Misfit, Misfit, Misfit]:
    """Compare the nominal model, the same within its tolerances, and the law with the data.

    Parameters
    ----------
    problem : LawFitProblem
        The data that were fitted, and the linear model.
    held_out : SegmentSet, optional
        The data that were not.
    fit : LawFit
        The law at its location.

    Returns
    -------
    before, updated, after : Misfit
        NaN where nothing was held out, or where it starts in motion.
    """
    nuisance_prior, segments = problem.linear.nuisance_prior, problem.segments
    models = problem.linear.start_nuisance, problem.linear.nuisance
    training = [_misfit_figures(segments, _linear_misfit(segments, nuisance_prior, nuisance)) for nuisance in models]
    training.append(_misfit_figures(segments, fit.misfit))
    predicted = [(np.nan, np.nan)] * len(training)
    if held_out is not None and not held_out.moving.any():
        at_rest, nuisance = nuisance_prior.without_initial_states(fit.nuisance)
        simulated = fit_output_error(held_out, at_rest, fit.start(nuisance), iterations=0).misfit
        linear = [
            _linear_misfit(held_out, at_rest, nuisance_prior.without_initial_states(model)[1]) for model in models
        ]
        predicted = [_misfit_figures(held_out, misfit) for misfit in (*linear, simulated)]
    before, updated, after = (
        Misfit(training=fitted[0], held_out=new[0], training_noise=fitted[1], held_out_noise=new[1])
        for fitted, new in zip(training, predicted, strict=True)
    )
    return before, updated, after


def _linear_misfit(segments: SegmentSet, nuisance_prior: NuisancePrior, nuisance: FloatArray) -> FloatArray:
    """Weighted misfit of the linear model."""
    response = respond(nuisance_prior.modal_model, segments.s, nuisance_prior.to_values(nuisance))
    motion = linear_sensor_motion(segments, nuisance_prior, response)
    motion[nuisance_prior.moving] += nuisance_prior.sensor_free_vibration(nuisance, response)
    used = segments.used
    return as_real_rows((segments.motion - motion)[:, :, used] / np.sqrt(segments.variance[:, :, used]))


def _misfit_figures(segments: SegmentSet, misfit: FloatArray) -> tuple[float, float]:
    """Norm of the misfit over that of the response, and over the one expected by noise and errors of the model."""
    used = segments.used
    std = np.sqrt(segments.variance[:, :, used])
    present = np.isfinite(std)
    weighted = misfit.view(complex).reshape(std.shape)
    absolute = np.linalg.norm((weighted * np.where(present, std, 0.0))[present])
    size = np.linalg.norm(segments.motion[:, :, used][present])
    over_expected = np.sqrt(np.mean(np.abs(weighted[present]) ** 2) / 2)
    return float(absolute / size), float(over_expected)


def relative_misfit(segments: SegmentSet, misfit: FloatArray) -> float:
    """Compute the misfit as a part of the response.

    Parameters
    ----------
    segments : SegmentSet
        The data.
    misfit : (n_rows,) array
        Weighted, as `LawFit.misfit`.

    Returns
    -------
    float
        Norm over norm, on the used lines.
    """
    return _misfit_figures(segments, misfit)[0]


def describe_working_range(fit: LawFit, modal_model: ModalModel) -> str:
    """Say for which motions of its location a law was fitted.

    Parameters
    ----------
    fit : LawFit
        The law.
    modal_model : ModalModel
        The structure.

    Returns
    -------
    str
        A sentence.
    """
    largest = np.abs(fit.motion).max(1)
    return (
        f"It was fitted to motions of {modal_model.describe_location(fit.location)} of up to {largest.max():.3g} m; "
        f"the weakest record reached {largest.min():.3g} m."
    )
