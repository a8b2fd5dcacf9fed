"""Figures of a run that more than one place shows: each is worked out here, once, for summary and page."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.assessment.deviations import measured_deviation, point_deviation
from frf_ipz.assessment.measured_points import MeasuredPoints
from frf_ipz.runs.picture_data import fitted_lines

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray
    from frf_ipz.assessment.deviations import FrfDeviation
    from frf_ipz.runs.results import Results

FULL_COHERENCE = 0.99995  # rounds to 1.0000, which no measurement has


def deviation_of(run: Results) -> FrfDeviation | None:
    """Give how far the models are from what was measured: at a point of interest, else at the measured points.

    It is what the assessment says; worked out anew where there is none.

    Parameters
    ----------
    run : Results
        The run.

    Returns
    -------
    FrfDeviation or None
        None where there is nothing to compare.
    """
    if run.assessment is not None:
        return next(iter(run.assessment.deviations), None)
    if run.prediction is not None:
        at_points = point_deviation(run.prediction, frfs=run.frfs, reference=run.reference)
        if at_points is not None:
            return at_points
    if run.frfs is None or run.fit is None or run.updated_model is None:
        return None
    return measured_deviation(MeasuredPoints(frfs=run.frfs, fit=run.fit, updated_model=run.updated_model))


def coherence_text(run: Results) -> str:
    """Say how coherent the measured FRFs are: the median over all of them and the lines of the fit, of all without one.

    Parameters
    ----------
    run : Results
        The run.

    Returns
    -------
    str
        With the band; empty where it is not known.
    """
    frfs = run.frfs
    if frfs is None:
        return ""
    lines = fitted_lines(run)
    figure, hertz = median_coherence(frfs.coherence[lines]), frfs.frequency_hz[lines]
    return f"{figure} (median, {hertz[0]:.4g} to {hertz[-1]:.4g} Hz)" if figure else ""


def median_coherence(coherence: FloatArray) -> str:
    """Write the median of coherences.

    Parameters
    ----------
    coherence : array
        NaN where it is not known.

    Returns
    -------
    str
        Four digits; empty where none is known.
    """
    if not np.isfinite(coherence).any():
        return ""
    median = float(np.nanmedian(coherence))
    return "above 0.9999" if median >= FULL_COHERENCE else f"{median:.4f}"
