"""Fits that explain alike, told apart with the variance that each of them leaves.

How much the model may miss is a guess beforehand: one part of every response, on all lines of all channels. Here it is
a further unknown of each channel and band, as in iteratively reweighted least squares: a fit is worth the likelihood
that it reaches with the variances that suit it best. Where less is left than was guessed the data count for more.
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
    from frf_ipz.diagnosis.nonlinear.fitting.candidates import LawFitProgress
    from frf_ipz.diagnosis.nonlinear.fitting.refine import LawFit
    from frf_ipz.diagnosis.nonlinear.recorded.segments import SegmentSet

ALIKE, MOST = 0.1, 4  # relative difference of the costs of fits that are compared, and how many of them
BANDS = 8  # in which the variance is read: wide enough for tens of numbers
LEAST = 1e-4  # of the variance expected: what may be left of it
STEPS, ROUNDS = 12, 2  # of each fit under a new variance, and of new variances
FAR_OFF = 4.0  # mean square over the expected one: with more, the model is wrong, not its variance


def tell_apart(track: LawFitProgress, fits: Sequence[LawFit]) -> tuple[list[LawFit], FloatArray]:
    """Compare the best fits once more.

    Parameters
    ----------
    track : LawFitProgress
        The data.
    fits : sequence of LawFit
        Fitted to them, the smallest cost first.

    Returns
    -------
    fits : list of LawFit
        The first of them, in the same order, fitted with the variance that each leaves; cost and misfit are of the
        data as they are. As they were, where nothing explains like the best.
    behind : (n_fits,) array
        Evidence that each lacks against the best of them, nats.
    """
    near = list(takewhile(lambda fit: fit.cost <= (1 + ALIKE) * fits[0].cost, fits[:MOST]))
    if len(near) == 1 or near[0].cost > FAR_OFF * near[0].n_rows:
        return near, np.zeros(len(near))
    near = [_reweighted(track, fit) for fit in near]
    evidence = np.array([_evidence(track.stretches, fit) for fit in near])
    return near, evidence.max() - evidence


def _reweighted(track: LawFitProgress, fit: LawFit) -> LawFit:
    """Fit with the variance that is left, and see what then is left of the data as they are."""
    stretches, nuisance_prior = track.stretches, track.linear.nuisance_prior
    for _ in range(ROUNDS):
        own = replace(stretches, variance=stretches.variance * _along_lines(stretches, _left(stretches, fit)))
        again = fit_output_error(own, nuisance_prior, fit.start(), iterations=STEPS)
        fit = fit_output_error(stretches, nuisance_prior, again.start(), iterations=0)
    return fit


def _evidence(stretches: SegmentSet, fit: LawFit) -> float:
    """Logarithm of the likelihood with the best variance of each channel and band, and of the prior, nats."""
    seen = np.isfinite(stretches.variance).any(2)
    logarithms = np.log(_left(stretches, fit)[seen])
    return float(-np.sum(logarithms * np.diff(_edges(stretches))) - fit.unknowns @ fit.unknowns / 2)


def _left(stretches: SegmentSet, fit: LawFit) -> FloatArray:
    """(n_blows, n_sensors, n_bands) mean square that a fit leaves, over the expected one."""
    shape = (*stretches.variance.shape[:2], len(stretches.used))
    square = np.abs(fit.misfit.view(complex).reshape(shape)) ** 2 / 2
    left = np.stack([square[..., a:b].mean(-1) for a, b in pairwise(_edges(stretches))], -1)
    return np.asarray(np.maximum(left, LEAST))


def _edges(stretches: SegmentSet) -> IntArray:
    """(n_bands + 1,) edges of the bands, numbers of used lines."""
    return np.unique(np.linspace(0, len(stretches.used), BANDS + 1).astype(int))


def _along_lines(stretches: SegmentSet, of_bands: FloatArray) -> FloatArray:
    """(n_blows, n_sensors, n_lines) smooth course of positive numbers of the bands."""
    edges, lines = _edges(stretches), np.arange(len(stretches.s))
    middle = stretches.used[(edges[:-1] + edges[1:]) // 2]
    smooth = np.apply_along_axis(lambda row: np.interp(lines, middle, row), -1, np.log(of_bands))
    return np.asarray(np.exp(smooth))
