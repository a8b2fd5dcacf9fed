"""A measured FRF with those of the model before and after updating."""

from __future__ import annotations

from typing import TYPE_CHECKING

from frf_ipz.plotting.curves import magnitude_title
from frf_ipz.plotting.frfs import PHASE_AXIS, magnitude_and_phase, magnitude_hover
from frf_ipz.plotting.picture import Axis, Panel, Picture, Role, frequency_axis

if TYPE_CHECKING:
    from frf_ipz.runs.picture_data import ModelsBesideMeasurement

AS_MEASURED = "The models are drawn with the window of the recordings, as the peaks were measured."
GAINS = " The scale of the measurement is unknown: each curve of a model has a gain that was fitted."


def describe_overlay(compared: ModelsBesideMeasurement, frf: int) -> Picture:
    """Describe one measured FRF with the nominal and the updated model's.

    Parameters
    ----------
    compared : ModelsBesideMeasurement
        All of them.
    frf : int
        Which one.

    Returns
    -------
    Picture
        Magnitude and phase.
    """
    label, x = compared.labels[frf], compared.frequency_hz
    hover = magnitude_hover(label)
    curves = [
        magnitude_and_phase("measured", Role.REFERENCE, x, compared.measured[:, frf], hover, opacity=0.35, width=5),
        magnitude_and_phase("nominal model", Role.NOMINAL, x, compared.nominal[:, frf], hover, dash="dash", width=1.4),
        magnitude_and_phase("updated model", Role.UPDATED, x, compared.updated[:, frf], hover, width=2.0),
    ]
    magnitudes, phases = zip(*curves, strict=True)
    return Picture(
        name=f"overlay-{frf}",
        title=f"{compared.names[frf]}: measured, and the model before and after updating",
        alt=f"Magnitude and phase of the FRF {compared.names[frf]}: measured as a broad grey line, nominal model "
        "dashed, updated model solid.",
        panels=(
            Panel(y=Axis(title=magnitude_title([label]), scale="log"), layers=magnitudes, share=2.2),
            Panel(y=PHASE_AXIS, layers=phases),
        ),
        x=frequency_axis(float(x[0]), float(x[-1])),
        note=((AS_MEASURED if compared.has_window else "") + (GAINS if compared.has_fitted_gains else "")).strip(),
        height_px=460,
    )
