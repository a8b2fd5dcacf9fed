"""The updated model against every measured FRF: amplitude, phase, better than before, inside its own band.

Limits are those of the controller that the model is for, see `control_margins`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.assessment.assessment import Check, Verdict
from frf_ipz.assessment.deviations import worst_median
from frf_ipz.control_margins import GAIN_MARGIN_DB, HALF, PHASE_MARGIN_DEG, SIXTH
from frf_ipz.late_imports import import_late

if TYPE_CHECKING:
    from scipy.optimize import minimize_scalar

    from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray
    from frf_ipz.assessment.evidence import Evidence
else:
    minimize_scalar = import_late("scipy.optimize", "minimize_scalar")

NORMAL_90 = 1.645  # standard deviations that hold 90 % of a normal distribution
OVERSAMPLED = 4  # points of a transform between two that are independent: one of them is near its peak
INSIDE = 0.75  # of the lines: of a 90 % band, a quarter outside is no chance
MOSTLY_OUTSIDE = 0.25
TOGETHER, ALL_FRFS = "better than before", "all measured FRFs"


def amplitude(evidence: Evidence) -> Iterator[Check]:
    """Compare the amplitudes.

    Parameters
    ----------
    evidence : Evidence
        The run.

    Yields
    ------
    Check
        One, where anything was measured above its noise.
    """
    deviation = evidence.deviation
    if deviation is None:
        return
    after = deviation.updated_db
    relative = " (with the gains that are fitted: the scale is unknown)" if evidence.is_relative else ""
    yield Check(
        name="amplitude at the measured points",
        verdict=judge(after, SIXTH * GAIN_MARGIN_DB, HALF * GAIN_MARGIN_DB),
        figure=after,
        limit=SIXTH * GAIN_MARGIN_DB,
        unit="dB",
        where=deviation.frf,
        says=f"the model is off the measured FRF {deviation.where} (median): {deviation.figures}{relative}; half of a "
        f"gain margin of {GAIN_MARGIN_DB:g} dB is the most that a controller can bear",
        advice="" if after <= SIXTH * GAIN_MARGIN_DB else "compare model and measurement there",
    )


def left_out_points(evidence: Evidence) -> Iterator[Check]:
    """Ask how well measured points follow from each other, where measured shapes stand in the place of an update.

    Such a model has what was measured, so that it agrees with that in any case. It takes care at best: what the model
    of the structure lacks is not explained.

    Parameters
    ----------
    evidence : Evidence
        The run.

    Yields
    ------
    Check
        One, where shapes were expanded.
    """
    expansion = evidence.updated_model.expansion
    if expansion is None:
        return
    after = expansion.median_db
    is_no_use = judge(after, SIXTH * GAIN_MARGIN_DB, HALF * GAIN_MARGIN_DB) is Verdict.NOT_USABLE
    yield Check(
        name="measured points left out",
        verdict=Verdict.NOT_USABLE if is_no_use else Verdict.WITH_CARE,
        figure=after,
        limit=HALF * GAIN_MARGIN_DB,
        unit="dB",
        says=f"the model has the measured shapes, expanded, as no change of its matrices meets them: each measured "
        f"point, left out in turn, follows from the others to {after:.2g} dB (median)",
        advice="find what the model lacks: see the notes of the update, and frf-ipz diagnose",
    )


def phase(evidence: Evidence) -> Iterator[Check]:
    """Compare the phases, the sign among them.

    Parameters
    ----------
    evidence : Evidence
        The run.

    Yields
    ------
    Check
        One, where anything was measured above its noise.
    """
    turned = _phasors(evidence)
    after, worst = worst_median(np.where(evidence.is_heard, np.degrees(np.abs(np.angle(turned))), np.nan))
    if worst < 0:
        return
    where = str(evidence.frfs.labels[worst])
    says = f"the updated model is {after:.2g} degrees off the measured FRF {where} ({evidence.band_text}, median)"
    verdict, advice = judge(after, SIXTH * PHASE_MARGIN_DEG, HALF * PHASE_MARGIN_DEG), ""
    delay_s = common_delay(evidence.frfs.frequency_hz[evidence.lines], turned)
    on_time = turned * np.exp(2j * np.pi * evidence.frfs.frequency_hz[evidence.lines, None] * delay_s)
    is_late = _median_angle(on_time, evidence.is_heard) < HALF * _median_angle(turned, evidence.is_heard)
    if verdict is not Verdict.USABLE and is_late:
        says += f"; a delay of {1e3 * delay_s:.2g} ms that all FRFs have in common explains most of it"
        advice = "correct what makes the responses late or early (filters, trigger), or set [fit] delay = true"
    elif evidence.has_targets and np.nansum(np.where(evidence.is_heard, turned, 0)[:, worst]).real < 0:
        says += ": its sign is reversed"
        advice = f"turn the sign of the sensor's or the input's dof of {where}"
    yield Check(
        name="phase at the measured points",
        verdict=verdict,
        figure=after,
        limit=SIXTH * PHASE_MARGIN_DEG,
        unit="deg",
        where=where,
        says=says,
        advice=advice,
    )


def common_delay(frequency_hz: FloatArray, turned: ComplexArray) -> float:
    """Give the delay that all FRFs have in common, by the largest of the sums of their turned phasors.

    Parameters
    ----------
    frequency_hz : (n_lines,) array
        Lines, Hz.
    turned : (n_lines, n_frfs) complex array
        Measured FRFs over computed ones, of modulus 1; NaN where they are not known.

    Returns
    -------
    float
        Seconds; positive where the measured ones are late.
    """
    if len(frequency_hz) < 2:
        return 0.0
    step_hz = float(np.median(np.diff(frequency_hz)))
    places = np.round((frequency_hz - frequency_hz[0]) / step_hz).astype(int)
    count = OVERSAMPLED * (int(places[-1]) + 1)
    on_grid = np.zeros((count, turned.shape[1]), complex)
    on_grid[places] = np.nan_to_num(turned)
    sums = np.abs(np.fft.ifft(on_grid, axis=0)).sum(axis=1)
    delays_s = np.fft.fftfreq(count, step_hz)
    near, apart = float(delays_s[np.argmax(sums)]), float(delays_s[1])
    known = np.nan_to_num(turned)
    omega = 2 * np.pi * frequency_hz[:, None]

    def loss(delay_s: float) -> float:
        return -float(np.abs((known * np.exp(1j * omega * delay_s)).sum(axis=0)).sum())

    return float(minimize_scalar(loss, bounds=(near - apart, near + apart), method="bounded").x)


def _phasors(evidence: Evidence) -> ComplexArray:
    """(n_lines, n_frfs) measured over updated FRFs, of modulus 1; NaN where one of them is 0."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = evidence.measured / evidence.updated
        return np.asarray(ratio / np.abs(ratio))


def _median_angle(turned: ComplexArray, is_heard: BoolArray) -> float:
    return float(np.nanmedian(np.where(is_heard, np.abs(np.angle(turned)), np.nan)))


def improvement(evidence: Evidence) -> Iterator[Check]:
    """Ask whether updating has made the model better: over all measured FRFs, and at a point of interest that is known.

    Parameters
    ----------
    evidence : Evidence
        The run.

    Yields
    ------
    Check
        One, where anything was measured above its noise.
    """
    after, before = (
        float(np.nanmedian(evidence.decibels(values))) if evidence.is_heard.any() else float("nan")
        for values in (evidence.updated, evidence.nominal)
    )
    if not np.isfinite(after):
        return
    noise = float(np.median(20 * np.log10(1 + (evidence.noise / np.abs(evidence.measured))[evidence.is_heard])))
    where, worst, point = ALL_FRFS, evidence.deviation, evidence.point_deviation
    says = (
        f"over all {evidence.frfs.n_frfs} measured FRFs ({evidence.band_text}, median) the model is off by "
        f"{before:.2g} dB before updating, {after:.2g} dB after"
    )
    if worst is not None and worst.updated_db > worst.nominal_db + noise:
        says += f"; the worst of them, {worst.frf}, by {worst.figures}"
    if point is not None and _is_worse(point.nominal_db, point.updated_db, noise):
        before, after, where = point.nominal_db, point.updated_db, point.frf
        says += f"; at the point of interest, {point.where}, by {point.figures}"
    is_worse, worsened = _is_worse(before, after, noise), _say_worsened(evidence)
    yield Check(
        name=TOGETHER,
        verdict=Verdict.WITH_CARE if is_worse else Verdict.USABLE,
        figure=after,
        limit=before,
        unit="dB",
        where=where,
        says=says + worsened + (": updating has made it worse" if is_worse else ""),
        advice="look at the pairs, and for what the model leaves out: frf-ipz diagnose" if is_worse or worsened else "",
    )


def _is_worse(before: float, after: float, noise: float) -> bool:
    """Tell whether a deviation has grown beyond noise, to one that a controller feels; all in dB."""
    return after > before + noise and after > SIXTH * GAIN_MARGIN_DB


def _say_worsened(evidence: Evidence) -> str:
    """Say which measured FRFs are farther off than before, by more than noise and than their own band allows."""
    inside = _is_inside(evidence)
    if inside is None:
        return ""
    texts, labels = [], evidence.frfs.labels
    off_db = [evidence.decibels(values) for values in (evidence.nominal, evidence.updated)]
    for column in np.flatnonzero(evidence.is_heard.any(axis=0)).tolist():
        heard = evidence.is_heard[:, column]
        before, after = (float(np.nanmedian(values[:, column])) for values in off_db)
        noise = float(np.median(20 * np.log10(1 + (evidence.noise / np.abs(evidence.measured))[heard, column])))
        share = float(np.mean(inside[heard, column]))
        if after > before + noise and share < INSIDE:
            texts.append(
                f"{labels[column]} is worse after updating than before ({after:.2g} and {before:.2g} dB), and its own "
                f"90 % band holds {100 * share:.0f} % of its lines: the update has moved it to meet others, and points "
                "near it may be off by more than their bands"
            )
    return "".join(f"; {text}" for text in texts)


def _is_inside(evidence: Evidence) -> BoolArray | None:
    """(n_lines, n_frfs) whether the band of the updated model holds a measured value; None where there is no band."""
    low, high = evidence.band
    if not np.isfinite(low).any():
        return None
    reach = NORMAL_90 * evidence.noise / np.sqrt(2)  # half of the variance lies along the value
    magnitude = np.abs(evidence.measured)
    return np.asarray((magnitude >= low - reach) & (magnitude <= high + reach))


def own_band(evidence: Evidence) -> Iterator[Check]:
    """Ask whether the band that the prediction has at the points of interest holds where it can be looked at.

    Parameters
    ----------
    evidence : Evidence
        The run.

    Yields
    ------
    Check
        One, where the method of updating gives a band.
    """
    inside = _is_inside(evidence)
    if inside is None:
        return
    share = float(np.mean(inside[evidence.is_heard])) if evidence.is_heard.any() else float("nan")
    if not np.isfinite(share):
        return
    worst = int(np.argmin(np.mean(inside, axis=0)))
    is_felt = evidence.decibels(evidence.updated) > SIXTH * GAIN_MARGIN_DB  # False where an FRF is not heard
    outside = float(np.mean((~inside & is_felt)[evidence.is_heard]))
    verdict = judge(outside, 1 - INSIDE, 1 - MOSTLY_OUTSIDE)
    says = f"the 90 % band of the updated model holds {100 * share:.0f} % of the lines of the FRFs that were measured"
    if verdict is not Verdict.USABLE:
        says += ", so at the points of interest it is too narrow too"
    elif share < INSIDE:
        says += f"; on {100 * (1 - share - outside):.0f} % it misses by less than {SIXTH * GAIN_MARGIN_DB:g} dB"
        says += ", which is nothing to a controller"
    yield Check(
        name="measured FRFs in the band",
        verdict=verdict,
        figure=share,
        limit=INSIDE,
        unit="1",
        where=str(evidence.frfs.labels[worst]),
        says=says,
        advice="" if verdict is Verdict.USABLE else "something is missing in the model: frf-ipz diagnose",
    )


def judge(figure: float, care: float, no_use: float) -> Verdict:
    """Set a figure against two limits.

    Parameters
    ----------
    figure, care, no_use : float
        The figure; from where on it takes care; from where on the result is no use.

    Returns
    -------
    Verdict
        What follows.
    """
    if figure > no_use:
        return Verdict.NOT_USABLE
    return Verdict.WITH_CARE if figure > care else Verdict.USABLE
