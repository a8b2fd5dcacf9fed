"""What is not linear: a force law, over motion and in time, and what changes with the level of excitation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.plotting.curves import Q95, dash_of, magnitude_title
from frf_ipz.plotting.frfs import magnitude_hover
from frf_ipz.plotting.picture import Axis, Layer, Line, Panel, Picture, Role, frequency_axis, in_hover
from frf_ipz.plotting.wording import number, percent
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd

    from frf_ipz.diagnosis.measured.levels import LevelDependence
    from frf_ipz.diagnosis.result import LawInTime
    from frf_ipz.frf import FrfLabel

PERIODS = 12.0  # of the strongest line: what is seen before one zooms out
MOST_POINTS = 4000  # of the force
MOST_MODES = 6  # drawn over the level
SYMBOLS = ("circle", "square", "diamond", "cross", "triangle-up", "star")


def describe_law_force(law: LawInTime) -> Picture:
    """Describe the force of a law over motion and velocity at its location.

    Parameters
    ----------
    law : LawInTime
        Of a diagnosis.

    Returns
    -------
    Picture
        Two panels beside each other.
    """
    points = slice(None, None, max(1, len(law.motion_m) // MOST_POINTS))
    force = law.force_N[points]
    hover = "{x:.4g}: {y:.4g} N"
    y = Axis(title="Force of the law, N")
    return Picture(
        name="law-force",
        title="Force of the law over motion and velocity at its location",
        alt=f"Curves of a force of up to {number(float(np.abs(law.force_N).max()), 3)} N over a motion of up to "
        f"{number(float(np.abs(law.motion_m).max()), 3)} m, and over its velocity.",
        panels=tuple(
            Panel(
                x=Axis(title=title),
                y=y,
                layers=(Line(name=name, colour=colour, x=x[points], y=force, hover=hover),),
            )
            for name, title, colour, x in (
                ("over motion", "Motion, m", Role.UPDATED, law.motion_m),
                ("over velocity", "Velocity, m/s", 1, law.velocity_m_s),
            )
        ),
        note="In the record that moves it most, over its motion. A spring shows as a line on the left, a damper or "
        "friction as one on the right.",
        height_px=360,
        has_legend=False,
    )


def describe_law_response(law: LawInTime) -> Picture | None:
    """Describe a record as measured, with a force law and without it.

    Parameters
    ----------
    law : LawInTime
        Of a diagnosis.

    Returns
    -------
    Picture or None
        Responses, and the misfit that remains; None where no record was simulated.
    """
    if not law.record:
        return None
    hover = f"{{x:.5g}} s: {{y:.4g}} {in_hover(law.unit)}"
    curves = tuple(
        Line(name=name, colour=colour, x=law.time_s, y=values, dash=dash, width=width, hover=hover)
        for name, colour, values, dash, width in (
            ("measured", Role.MEASURED, law.measured, "solid", 2.6),
            ("without the law", Role.MUTED, law.without, "dash", 1.2),
            ("with the law", Role.UPDATED, law.simulated, "solid", 1.6),
        )
    )
    misfit = Line(
        name="measured minus with the law", colour=Role.BAD, x=law.time_s, y=law.measured - law.simulated, hover=hover
    )
    errors = [_relative_error(law, model) for model in (law.without, law.simulated)]
    use = "not shown to the fit" if law.is_held_out else "among those that were fitted"
    response = law.response.capitalize()
    return Picture(
        name="law-response",
        title=f"{law.channel} in {law.record} ({use}): measured, with the law and without it",
        alt=f"{response} over time. The model without the law misses {percent(errors[0], 2)} of it, "
        f"with the law {percent(errors[1], 2)}.",
        panels=(
            Panel(y=Axis(title=f"{response}, {law.unit}"), layers=curves, share=2.0),
            Panel(y=Axis(title=f"Misfit, {law.unit}"), layers=(misfit,)),
        ),
        x=Axis(title="Time, s", limits=_window(law)),
        note=f"Simulated in time from the measured force. The misfit has a norm of {percent(errors[0], 2)} of the "
        f"measured one without the law, of {percent(errors[1], 2)} with it.",
        height_px=440,
    )


def _relative_error(law: LawInTime, model: FloatArray) -> float:
    size = max(float(np.linalg.norm(law.measured)), np.finfo(float).tiny)
    return float(np.linalg.norm(law.measured - model)) / size


def _window(law: LawInTime) -> tuple[float, float]:
    """Choose a few periods about where the law changes most."""
    step = law.time_s[1] - law.time_s[0]
    lines = np.abs(np.fft.rfft(law.measured))
    strongest = 1 + int(np.argmax(lines[1:]))
    width = PERIODS * len(law.time_s) * step / strongest
    end = float(law.time_s[-1])
    largest = float(law.time_s[np.argmax(np.abs(law.simulated - law.without))])
    start = float(np.clip(largest - width / 2, 0.0, max(end - width, 0.0)))
    return start, min(start + width, end)


def describe_levels(
    levels: LevelDependence,
    measured: Sequence[FrfLabel] = (),
    *,
    band_hz: tuple[float, float] | None = None,
) -> Picture | None:
    """Describe FRFs at low and at high level of excitation.

    Parameters
    ----------
    levels : LevelDependence
        Weak beside strong records.
    measured : sequence of FrfLabel
        All FRFs of the run, by whose numbers a page shows and hides them.
    band_hz : pair of float, optional
        What is seen at first; all lines where it is left out.

    Returns
    -------
    Picture or None
        None where there is one level only.
    """
    if not levels.labels:
        return None
    numbers = {(label.output_dof, label.input_dof, label.quantity): frf for frf, label in enumerate(measured)}
    layers: list[Layer] = []
    for row, label in enumerate(levels.labels):
        frf = numbers.get((label.output_dof, label.input_dof, label.quantity), row)
        layers += _weak_and_strong(levels, row, frf)
    difference = np.linalg.norm(levels.strong - levels.weak) / max(np.linalg.norm(levels.strong), np.finfo(float).tiny)
    low, high = float(levels.weak_N.min()), float(levels.strong_N.max())
    ends = (float(levels.frequency_hz[0]), float(levels.frequency_hz[-1]))
    return Picture(
        name="levels",
        title="FRFs at low level (dashed) and at high level of excitation (solid)",
        alt=f"Magnitude of {counted(len(levels.labels), 'FRF')} at low and at high level of excitation, "
        f"{number(low, 3)} to {number(high, 3)} N; they differ by {percent(float(difference), 2)}.",
        panels=(Panel(y=Axis(title=magnitude_title(levels.labels), scale="log"), layers=tuple(layers)),),
        x=frequency_axis(*(ends if band_hz is None else band_hz)),
        note="The weaker and the stronger half of the records, each averaged by itself; of FRFs that were given at "
        f"several levels the lowest and the highest. The two differ by {percent(float(difference), 2)} of their norm. "
        "Of a linear structure the curves fall onto each other, but for noise.",
        height_px=420,
    )


def _weak_and_strong(levels: LevelDependence, row: int, frf: int) -> list[Layer]:
    label, tiny = levels.labels[row], np.finfo(float).tiny
    forces = [number(float(values[row]), 3) for values in (levels.strong_N, levels.weak_N)]
    return [
        Line(
            name=name,
            colour=frf,
            frf=frf,
            group=str(label),
            x=levels.frequency_hz,
            y=np.maximum(values[:, row], tiny),
            dash=dash,
            width=width,
            hover=magnitude_hover(label),
        )
        for name, values, dash, width in (
            (f"{label} strong, {forces[0]} N", levels.strong, "solid", 1.6),
            (f"{label} weak, {forces[1]} N", levels.weak, "dash", 1.2),
        )
    ]


def describe_level_modes(levels: LevelDependence) -> Picture | None:
    """Describe frequency and damping of each mode over the level of excitation, with 95 % bars.

    Parameters
    ----------
    levels : LevelDependence
        Weak beside strong records.

    Returns
    -------
    Picture or None
        A line of a linear structure stays at zero; None where no mode was found at several levels.
    """
    modes = levels.modes
    groups = _clearest_modes(modes)
    if not groups:
        return None
    curves = [_mode(rows, index) for index, rows in enumerate(groups)]
    low, high = float(modes["level_N"].min()), float(modes["level_N"].max())
    return Picture(
        name="level-modes",
        title="Frequency and damping of each mode against the level of excitation, with 95 % bars",
        alt=f"Change of frequency and damping ratio of {counted(len(groups), 'mode')} over the level of excitation, "
        f"{number(low, 3)} to {number(high, 3)} N.",
        panels=(
            Panel(y=Axis(title="Change of frequency, %"), layers=tuple(change for change, _ in curves)),
            Panel(y=Axis(title="Damping ratio, %", scale="log"), layers=tuple(damping for _, damping in curves)),
        ),
        x=Axis(title="Level of excitation, N", scale="log", limits=(0.9 * low, 1.1 * high)),
        note="From the FRF of each single record (the level is its peak force), or of each level given, in the "
        "sensor that shows the mode best; the change is that from the strongest. A line that leaves the level by more "
        "than its bars is a mode that is not linear. A mode that is seen on a few lines only, or not by itself, is "
        "left out.",
        height_px=460,
    )


def _clearest_modes(modes: pd.DataFrame) -> list[pd.DataFrame]:
    """Of each mode the FRF with the most records, and of many modes those that are known best, by frequency."""
    best = []
    for _, of_mode in modes.groupby("mode"):
        groups = [rows.sort_values("level_N") for _, rows in of_mode.groupby("frf")]
        best.append(max(groups, key=lambda rows: (len(rows), -_relative_std(rows))))
    best = [rows for rows in best if len(rows) > 1]
    best = sorted(best, key=lambda rows: (-len(rows), _relative_std(rows)))[:MOST_MODES]
    return sorted(best, key=lambda rows: float(rows["frequency_hz"].iloc[-1]))


def _relative_std(rows: pd.DataFrame) -> float:
    return float((rows["frequency_std_hz"] / rows["frequency_hz"]).max())


def _mode(rows: pd.DataFrame, index: int) -> tuple[Line, Line]:
    """Change of frequency, and damping ratio."""
    level, hertz, ratio = (rows[name].to_numpy(float) for name in ("level_N", "frequency_hz", "damping_ratio"))
    name = f"mode {int(rows['mode'].iloc[0]) + 1}, {number(float(hertz[-1]), 4)} Hz, {rows['frf'].iloc[0]}"
    texts = [f"{record}: {value:.6g} Hz" for record, value in zip(rows["record"], hertz, strict=True)]
    change, damping = (
        Line(
            name=name,
            colour=index,
            group=name,
            x=level,
            y=values,
            dash=dash_of(index),
            width=1.1,
            symbol=SYMBOLS[index % len(SYMBOLS)],
            size=8,
            deviation=Q95 * deviation,
            hover=hover,
            texts=texts,
        )
        for values, deviation, hover in (
            (
                100 * (hertz / hertz[-1] - 1),
                100 * rows["frequency_std_hz"].to_numpy(float) / hertz,
                "{text}, {x:.4g} N: {y:.3g} %",
            ),
            (100 * ratio, 100 * rows["damping_ratio_std"].to_numpy(float), "{text}, {x:.4g} N: damping {y:.4g} %"),
        )
    )
    return change, damping
