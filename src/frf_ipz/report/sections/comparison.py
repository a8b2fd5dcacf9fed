"""Measurement and model side by side: any measured FRF, and the MAC of the modes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from frf_ipz.plotting.registry import overlay_pictures
from frf_ipz.report.section import Choice, Section, run_figures

if TYPE_CHECKING:
    from frf_ipz.runs.results import Results


def build(run: Results) -> Section | None:
    """Give the section that lays the model over the measurement.

    Parameters
    ----------
    run : Results
        What the run holds.

    Returns
    -------
    Section or None
        None without an updated model.
    """
    overlays = overlay_pictures(run)
    if not overlays:
        shapes = tuple(run_figures(run, "mac"))
        lead = "The mode shapes of the measurement and of the model; no FRF was measured."
        return Section(anchor="comparison", title="Measured and model", lead=lead, blocks=shapes) if shapes else None
    choice = Choice(name="overlay", label="FRF", pictures=overlays)
    return Section(
        anchor="comparison",
        title="Measured and model",
        lead="The FRFs at the measured points, and the mode shapes, of the measurement and of the model.",
        blocks=(choice, *run_figures(run, "mac")),
    )
