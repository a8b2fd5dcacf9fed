"""Predicted FRFs at points of interest: nominal, updated with its band, and measured where they were."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.plotting.curves import LEAST, magnitude_title
from frf_ipz.plotting.frfs import PHASE_AXIS, magnitude_and_phase, magnitude_hover
from frf_ipz.plotting.picture import Axis, Band, Layer, Panel, Picture, Role, frequency_axis

if TYPE_CHECKING:
    from frf_ipz.arrays import ComplexArray
    from frf_ipz.prediction.prediction import Prediction


def describe_prediction(
    prediction: Prediction, frf: int, measured: ComplexArray | None = None, *, is_kept_aside: bool = False
) -> Picture:
    """Describe a predicted FRF with its 90 % band, beside the nominal one.

    Parameters
    ----------
    prediction : Prediction
        The prediction.
    frf : int
        Which of its FRFs.
    measured : (n_lines,) complex array, optional
        What was measured there, on the lines of the prediction, in SI units; NaN where nothing was.
    is_kept_aside : bool
        That was kept aside as a reference: the models know nothing of it.

    Returns
    -------
    Picture
        Magnitude and phase.
    """
    label, x = prediction.labels[frf], prediction.frequency_hz
    name_of_measured = "measured, kept aside" if is_kept_aside else "measured"
    name_of_measured += ", at the level of the prediction" if frf in prediction.relative else ""
    hover = magnitude_hover(label)
    magnitudes, phases = _band(prediction, frf), []
    if measured is not None:
        known = np.isfinite(measured)
        curve, phase = magnitude_and_phase(
            name_of_measured, Role.REFERENCE, x[known], measured[known], hover, opacity=0.35, width=5
        )
        magnitudes.append(curve)
        phases.append(phase)
    for name, colour, values, dash, width in (
        ("nominal model", Role.NOMINAL, prediction.nominal, "dash", 1.4),
        ("updated model", Role.UPDATED, prediction.values, "solid", 2.0),
    ):
        curve, phase = magnitude_and_phase(name, colour, x, values[:, frf], hover, dash=dash, width=width)
        magnitudes.append(curve)
        phases.append(phase)
    return Picture(
        name=f"prediction-{frf}",
        title=f"{label}: response at {label.output_dof} to a force at {label.input_dof}",
        alt=f"Magnitude and phase of the predicted FRF {label}: nominal model dashed, updated model solid with its "
        "90 % band" + (", measurement as a broad grey line." if measured is not None else "."),
        panels=(
            Panel(y=Axis(title=magnitude_title([label]), scale="log"), layers=tuple(magnitudes), share=2.2),
            Panel(y=PHASE_AXIS, layers=tuple(phases)),
        ),
        x=frequency_axis(float(x[0]), float(x[-1])),
        note="The band is what the targets and the prior leave open (90 %).",
        height_px=500,
    )


def _band(prediction: Prediction, frf: int) -> list[Layer]:
    low, high = prediction.magnitude_low[:, frf], prediction.magnitude_high[:, frf]
    if not (np.isfinite(low).all() and np.isfinite(high).all()):
        return []
    floor = LEAST * np.abs(prediction.values[:, frf])
    return [
        Band(
            name="90 % band",
            colour=Role.UPDATED,
            opacity=0.28,
            x=prediction.frequency_hz,
            low=np.maximum(low, floor),
            high=high,
        )
    ]
