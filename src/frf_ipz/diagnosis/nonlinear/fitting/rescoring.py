"""Rescoring of fits that explain equally well, with the variance that each of them leaves.

The expected error of the model is a guess beforehand: one part of every response, on all lines of all channels. Here it
is a further parameter of each channel and subband, as in iteratively reweighted least squares: the evidence of a fit is
its likelihood with the variances that suit it best. Where the misfit is smaller than guessed the data count for more.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise, takewhile
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.nonlinear.fitting.output_error_fit import fit_output_error

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.arrays import FloatArray, IntArray
    from frf_ipz.diagnosis.nonlinear.fitting.alternating_fit import LawFit
    from frf_ipz.diagnosis.nonlinear.fitting.problem import LawFitProblem
    from frf_ipz.diagnosis.nonlinear.segments import SegmentSet

MAX_DIFFERENCE, MAX_FITS = 0.1, 4  # relative difference of the costs of fits that are rescored, and how many of them
SUBBANDS = 8  # in which the variance is estimated: wide enough for tens of numbers
LEAST_RATIO = 1e-4  # of the expected variance
STEPS, ROUNDS = 12, 2  # of each fit under a new variance, and of new variances
MODEL_WRONG = 4.0  # mean square over the expected one: with more, the model is wrong, not its variance


def select_contenders(fits: Sequence[LawFit]) -> list[LawFit]:
    """Select fits that explain equally well.

    Parameters
    ----------
    fits : sequence of LawFit
        To the same data, the smallest cost first.

    Returns
    -------
    list of LawFit
        The first of them; one alone where no other is close, or where none explains.
    """
    contenders = list(takewhile(lambda fit: fit.cost <= (1 + MAX_DIFFERENCE) * fits[0].cost, fits[:MAX_FITS]))
    return contenders[:1] if contenders[0].cost > MODEL_WRONG * contenders[0].n_rows else contenders


def rescore(problem: LawFitProblem, contenders: Sequence[LawFit]) -> tuple[list[LawFit], FloatArray]:
    """Rescore fits that explain equally well.

    Parameters
    ----------
    problem : LawFitProblem
        The data.
    contenders : sequence of LawFit
        Fitted to them.

    Returns
    -------
    fits : list of LawFit
        In the same order, fitted with the variance that each leaves; cost and misfit are for the variance of the data.
    behind : (n_fits,) array
        Log evidence that each lacks against the best of them.
    """
    rescored = [_reweight(problem, fit) for fit in contenders]
    log_evidence = np.array([_log_evidence(problem.segments, fit) for fit in rescored])
    return rescored, log_evidence.max() - log_evidence


def _reweight(problem: LawFitProblem, fit: LawFit) -> LawFit:
    """Fit with the variance that remains, and evaluate that fit with the variance of the data."""
    segments, nuisance_prior = problem.segments, problem.linear.nuisance_prior
    for _ in range(ROUNDS):
        ratio = _along_lines(segments, _variance_ratio(segments, fit))
        reweighted = replace(segments, variance=segments.variance * ratio)
        known = fit.simulation and fit.simulation.weigh(reweighted)
        refitted = fit_output_error(reweighted, nuisance_prior, fit.start(), iterations=STEPS, known=known)
        known = refitted.simulation and refitted.simulation.weigh(segments)
        fit = fit_output_error(segments, nuisance_prior, refitted.start(), iterations=0, known=known)
    return fit


def _log_evidence(segments: SegmentSet, fit: LawFit) -> float:
    """Log likelihood with the best variance of each channel and subband, and log prior."""
    present = np.isfinite(segments.variance).any(2)
    logarithms = np.log(_variance_ratio(segments, fit)[present])
    return float(-np.sum(logarithms * np.diff(_subband_edges(segments))) - fit.nuisance @ fit.nuisance / 2)


def _variance_ratio(segments: SegmentSet, fit: LawFit) -> FloatArray:
    """(n_segments, n_sensors, n_subbands) mean square misfit over the expected one."""
    shape = (*segments.variance.shape[:2], len(segments.used))
    square = np.abs(fit.misfit.view(complex).reshape(shape)) ** 2 / 2
    ratio = np.stack([square[..., a:b].mean(-1) for a, b in pairwise(_subband_edges(segments))], -1)
    return np.asarray(np.maximum(ratio, LEAST_RATIO))


def _subband_edges(segments: SegmentSet) -> IntArray:
    """(n_subbands + 1,) edges of the subbands, numbers of used lines."""
    return np.unique(np.linspace(0, len(segments.used), SUBBANDS + 1).astype(int))


def _along_lines(segments: SegmentSet, of_subbands: FloatArray) -> FloatArray:
    """(n_segments, n_sensors, n_lines) smooth interpolation of positive numbers of the subbands."""
    edges, lines = _subband_edges(segments), np.arange(len(segments.s))
    middle = segments.used[(edges[:-1] + edges[1:]) // 2]
    smooth = np.apply_along_axis(lambda row: np.interp(lines, middle, row), -1, np.log(of_subbands))
    return np.asarray(np.exp(smooth))
