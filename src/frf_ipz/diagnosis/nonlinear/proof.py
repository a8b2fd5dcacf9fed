"""Figures of what a law explains, on what it was fitted to and on what it was not shown."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.nonlinear.fitting.output_error_fit import fit_output_error
from frf_ipz.diagnosis.nonlinear.fitting.score_test import as_real, linear_motion
from frf_ipz.diagnosis.nonlinear.linear.modal_model import respond
from frf_ipz.diagnosis.result import Misfit

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray
    from frf_ipz.diagnosis.nonlinear.fitting.candidates import LawFitProgress
    from frf_ipz.diagnosis.nonlinear.fitting.refine import LawFit
    from frf_ipz.diagnosis.nonlinear.linear.modal_model import ModalModel
    from frf_ipz.diagnosis.nonlinear.linear.nuisance_prior import NuisancePrior
    from frf_ipz.diagnosis.nonlinear.recorded.segments import SegmentSet


def prove(track: LawFitProgress, held_out: SegmentSet | None, fit: LawFit) -> tuple[Misfit, Misfit, Misfit]:
    """Compare the nominal model, the same with its tolerances, and the law, with what was fitted and was held out.

    Parameters
    ----------
    track : LawFitProgress
        What was fitted, and the linear model.
    held_out : SegmentSet, optional
        What was not.
    fit : LawFit
        The law at its place.

    Returns
    -------
    before, updated, after : Misfit
        Not a number where nothing was held out, or where it starts in motion.
    """
    nuisance_prior, stretches = track.linear.nuisance_prior, track.stretches
    models = track.linear.as_stated, track.linear.unknowns
    training = [_figures(stretches, _linear(stretches, nuisance_prior, unknowns)) for unknowns in models]
    training.append(_figures(stretches, fit.misfit))
    other = [(np.nan, np.nan)] * len(training)
    if held_out is not None and not held_out.moving.any():
        resting, unknowns = nuisance_prior.without_starts(fit.unknowns)
        simulated = fit_output_error(held_out, resting, fit.start(unknowns), iterations=0).misfit
        plain = [_linear(held_out, resting, nuisance_prior.without_starts(model)[1]) for model in models]
        other = [_figures(held_out, misfit) for misfit in (*plain, simulated)]
    before, updated, after = (
        Misfit(training=mine[0], held_out=its[0], training_noise=mine[1], held_out_noise=its[1])
        for mine, its in zip(training, other, strict=True)
    )
    return before, updated, after


def _linear(stretches: SegmentSet, nuisance_prior: NuisancePrior, unknowns: FloatArray) -> FloatArray:
    """Weighted misfit of the linear model."""
    response = respond(nuisance_prior.modal_model, stretches.s, nuisance_prior.deviations(unknowns))
    shown = linear_motion(stretches, nuisance_prior, response)
    shown[nuisance_prior.moving] += nuisance_prior.sensor_starts(unknowns, response)
    used = stretches.used
    return as_real((stretches.motion - shown)[:, :, used] / np.sqrt(stretches.variance[:, :, used]))


def _figures(stretches: SegmentSet, misfit: FloatArray) -> tuple[float, float]:
    """Norm of the misfit over that of the measured, and over what noise and the model's errors make one expect."""
    used = stretches.used
    deviation = np.sqrt(stretches.variance[:, :, used])
    present = np.isfinite(deviation)
    left = misfit.view(complex).reshape(deviation.shape)
    away = np.linalg.norm((left * np.where(present, deviation, 0.0))[present])
    size = np.linalg.norm(stretches.motion[:, :, used][present])
    expected = np.sqrt(np.mean(np.abs(left[present]) ** 2) / 2)
    return float(away / size), float(expected)


def relative_misfit(stretches: SegmentSet, misfit: FloatArray) -> float:
    """Give what is left as a part of the response.

    Parameters
    ----------
    stretches : SegmentSet
        The data.
    misfit : (n_rows,) array
        Weighted, as `LawFit.misfit`.

    Returns
    -------
    float
        Norm over norm, on the used lines.
    """
    return _figures(stretches, misfit)[0]


def working_range(fit: LawFit, modal_model: ModalModel) -> str:
    """Say for which motions of its place a law was seen.

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
        f"It was seen for motions of {modal_model.places[fit.place].words} of up to {largest.max():.3g} m; the weakest "
        f"blow reached {largest.min():.3g} m."
    )
