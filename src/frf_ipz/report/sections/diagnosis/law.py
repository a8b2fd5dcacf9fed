"""A force law at work: its force over the motion of its place, and a blow as measured, with the law and without it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.report.picture import Axis, Picture, line, panels
from frf_ipz.report.thinning import BINS, thin
from frf_ipz.report.wording import number, percent

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray
    from frf_ipz.diagnosis.result import LawInTime

PERIODS = 12.0  # of the strongest line: what is seen before one zooms out
MOST_POINTS = 4000  # of the force


def law_pictures(law: LawInTime | None) -> list[Picture]:
    """Draw a law at work.

    Parameters
    ----------
    law : LawInTime, optional
        From the diagnosis.

    Returns
    -------
    list of Picture
        Empty where no law was found; the force alone where all blows start in motion.
    """
    if law is None:
        return []
    return [_force(law), *([_response(law)] if law.record else [])]


def _force(law: LawInTime) -> Picture:
    kept = slice(None, None, max(1, len(law.motion_m) // MOST_POINTS))
    hover = "%{x:.4g}: %{y:.4g} N"
    over_motion = line(law.motion_m[kept], law.force_N[kept], "over motion", "@updated", hover=hover)
    over_velocity = line(law.velocity_m_s[kept], law.force_N[kept], "over velocity", "@c1", hover=hover)
    left = {"title": {"text": "Motion, m"}, "domain": [0, 0.46]}
    layout = panels(left, Axis(title="Force of the law, N"), showlegend=False)
    layout["xaxis2"] = {"title": {"text": "Velocity, m/s"}, "domain": [0.54, 1.0], "anchor": "y"}
    return Picture(
        name="law-force",
        title="Force of the law over motion and velocity of its place",
        alt=f"Curves of a force of up to {number(float(np.abs(law.force_N).max()), 3)} N over a motion of up to "
        f"{number(float(np.abs(law.motion_m).max()), 3)} m, and over its velocity.",
        traces=(over_motion, {**over_velocity, "xaxis": "x2"}),
        layout=layout,
        note="In the blow that moves the place most, against the motion. A spring shows as a line on the left, a "
        "damper or friction as one on the right.",
        height_px=360,
    )


def _response(law: LawInTime) -> Picture:
    curves = (law.measured, law.without, law.simulated)
    kept = thin(law.time_s, curves, BINS[1])
    hover = f"%{{x:.5g}} s: %{{y:.4g}} {law.unit}"
    x = law.time_s[kept]
    traces = (
        line(x, law.measured[kept], "measured", "@measured", hover=hover, width=2.6),
        line(x, law.without[kept], "without the law", "@muted", hover=hover, dash="dash", width=1.2),
        line(x, law.simulated[kept], "with the law", "@updated", hover=hover),
        line(x, (law.measured - law.simulated)[kept], "measured minus with the law", "@bad", hover=hover, yaxis="y2"),
    )
    errors = [_error(law, model) for model in (law.without, law.simulated)]
    shown = "not shown to the fit" if law.is_held_out else "among those that were fitted"
    note = "Simulated in time from the measured force. What is left has a norm of "
    return Picture(
        name="law-response",
        title=f"{law.channel} in {law.record} ({shown}): measured, with the law and without it",
        alt=f"{law.response.capitalize()} over time. The model without the law misses {percent(errors[0], 2)} of it, "
        f"with the law {percent(errors[1], 2)}.",
        traces=traces,
        layout=panels(
            {"title": {"text": "Time, s"}, "range": _window(law)},
            Axis(title=f"{law.response.capitalize()}, {law.unit}", share=2.0),
            Axis(title=f"Left, {law.unit}"),
        ),
        note=f"{note}{percent(errors[0], 2)} of the measured one without the law, of {percent(errors[1], 2)} with it. "
        "Double-click to see the whole stretch.",
        height_px=440,
    )


def _error(law: LawInTime, model: FloatArray) -> float:
    size = max(float(np.linalg.norm(law.measured)), np.finfo(float).tiny)
    return float(np.linalg.norm(law.measured - model)) / size


def _window(law: LawInTime) -> list[float]:
    """Choose a few periods about where the law changes most."""
    step = law.time_s[1] - law.time_s[0]
    lines = np.abs(np.fft.rfft(law.measured))
    strongest = 1 + int(np.argmax(lines[1:]))
    width = PERIODS * len(law.time_s) * step / strongest
    end = float(law.time_s[-1])
    most = float(law.time_s[np.argmax(np.abs(law.simulated - law.without))])
    start = float(np.clip(most - width / 2, 0.0, max(end - width, 0.0)))
    return [start, min(start + width, end)]
