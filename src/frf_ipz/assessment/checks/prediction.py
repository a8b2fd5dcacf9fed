"""The prediction at the points of interest: how wide its band is, and a reference that was kept aside."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.assessment.assessment import Check, Verdict
from frf_ipz.assessment.checks.agreement import INSIDE, MOSTLY_OUTSIDE, judge
from frf_ipz.control_margins import GAIN_MARGIN_DB, HALF, SIXTH
from frf_ipz.prediction.reference import measured_at

if TYPE_CHECKING:
    from frf_ipz.assessment.evidence import Evidence


def band_width(evidence: Evidence) -> Iterator[Check]:
    """Ask how wide the bands at the points of interest are: they grow with the distance from what was measured.

    Parameters
    ----------
    evidence : Evidence
        The run.

    Yields
    ------
    Check
        One, where there is a point of interest.
    """
    prediction = evidence.prediction
    if not prediction.labels:
        return
    widths = prediction.half_width_db
    if np.isnan(widths).all():
        yield Check(
            name="band at the points of interest",
            verdict=Verdict.WITH_CARE,
            says="the method of updating gives no band: how far the prediction is off is not known",
            advice='use [update] method = "minimal-change"',
        )
        return
    worst = int(np.nanargmax(widths))
    width, where = float(widths[worst]), str(prediction.labels[worst])
    reach = prediction.band_db_text(worst).replace("+-", "±")
    yield Check(
        name="band at the points of interest",
        verdict=judge(width, SIXTH * GAIN_MARGIN_DB, HALF * GAIN_MARGIN_DB),
        figure=width,
        limit=SIXTH * GAIN_MARGIN_DB,
        unit="dB",
        where=where,
        says=f"the 90 % band of {where} is {reach} ({prediction.band_text}, median)",
        advice="measure nearer to the point, or at more points" if width > SIXTH * GAIN_MARGIN_DB else "",
    )


def reference(evidence: Evidence) -> Iterator[Check]:
    """Hold the prediction against FRFs that were measured at its points.

    Parameters
    ----------
    evidence : Evidence
        The run.

    Yields
    ------
    Check
        One, where there are such FRFs.
    """
    prediction, deviation = evidence.prediction, evidence.point_deviation
    if deviation is None:
        return
    known = measured_at(prediction, evidence.reference) or measured_at(prediction, evidence.frfs)
    columns = list(known)
    measured = np.stack([known[column] for column in columns], 1)
    lines = np.isfinite(measured).all(axis=1)
    off, where = deviation.updated_db, deviation.frf
    low, high = (band[lines][:, columns] for band in (prediction.magnitude_low, prediction.magnitude_high))
    magnitude = np.abs(measured[lines])
    share = float(np.mean((magnitude >= low) & (magnitude <= high))) if np.isfinite(low).any() else float("nan")
    verdict = judge(off, SIXTH * GAIN_MARGIN_DB, HALF * GAIN_MARGIN_DB)
    inside = judge(1 - share, 1 - INSIDE, 1 - MOSTLY_OUTSIDE) if np.isfinite(share) else Verdict.USABLE
    if inside is not Verdict.USABLE and verdict is Verdict.USABLE:
        verdict = Verdict.WITH_CARE  # close to what was measured, though the band says closer
    text = f"; its 90 % band holds {100 * share:.0f} % of the lines" if np.isfinite(share) else ""
    text += " (compared in shape: the level is not known)" if prediction.relative else ""
    yield Check(
        name="reference at the points of interest",
        verdict=verdict,
        figure=off,
        limit=SIXTH * GAIN_MARGIN_DB,
        unit="dB",
        where=where,
        says=f"the prediction is off the FRF {deviation.where} that was kept aside (median): {deviation.figures}{text}",
        advice="" if verdict is Verdict.USABLE else "believe the reference: look for what the model leaves out",
    )
