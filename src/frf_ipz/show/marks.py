"""What the user has chosen, drawn into the stabilisation diagram and into the structure."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.plotting.projection import project
from frf_ipz.rational import natural_frequency_hz
from frf_ipz.report.picture import Picture, Trace, line, markers, shaded_span
from frf_ipz.report.wording import counted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.dofs import Dof
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.identification.options import FitOptions
    from frf_ipz.structure import Geometry

DIAGRAM, STRUCTURE = "stabilisation", "structure"
STRIP = 0.08  # of the height, below the poles: room for the handles
CLEAR: Trace = {"unselected": {"marker": {"opacity": 1.0}}}  # poles outside a chosen range stay as clear as they were


def with_choices(picture: Picture, fit: ModalFit, options: FitOptions) -> Picture:
    """Draw pins, rejections and left-out ranges into the stabilisation diagram, and a handle for every mode of the fit.

    Parameters
    ----------
    picture : Picture
        The diagram of the report.
    fit : ModalFit
        The fit that it belongs to.
    options : FitOptions
        What the user has chosen.

    Returns
    -------
    Picture
        With further lines, handles and shaded ranges.
    """
    low, high = picture.layout["yaxis"]["range"]
    rejected = [rejection.hz for rejection in options.strike]
    reasons = [f"rejected: {rejection.why}" for rejection in options.strike]
    pins = [f"pinned: {pin.why}" if pin.why else "pinned" for pin in options.pinned]
    hertz = natural_frequency_hz(fit.model.poles[: fit.n_modes])
    strip = STRIP * (high - low)
    place, hover = np.full(len(hertz), low - strip / 2), "%{x:.6g} Hz: click to pin or reject"
    traces = [
        markers(hertz, place, "handles of the modes", "@ink", hover=hover, symbol="triangle-up", size=12),
        *_vertical_lines("pinned", "@good", [pin.hz for pin in options.pinned], pins, (low, high)),
        *_vertical_lines("rejected", "@bad", rejected, reasons, (low, high)),
    ]
    shapes = [shaded_span(pair, 0.0, 1.0, "@muted/0.3") for pair in options.exclude_hz]
    words = [f"{len(pins)} pinned"] if pins else []
    words += [f"{len(rejected)} rejected"] if rejected else []
    left_out = counted(len(options.exclude_hz), "range")
    words += [f"{left_out} left out (shaded)"] if options.exclude_hz else []
    note = f"{picture.note} Your choices: {', '.join(words)}." if words else picture.note
    below = {**picture.layout["yaxis"], "range": [low - strip, high]}
    layout = {**picture.layout, "yaxis": below, "shapes": [*picture.layout.get("shapes", []), *shapes]}
    drawn = [{**trace, **CLEAR} if trace["mode"] == "markers" else trace for trace in (*picture.traces, *traces)]
    return replace(picture, traces=tuple(drawn), layout=layout, note=note)


def with_retained(picture: Picture, geometry: Geometry, dofs: Sequence[Dof]) -> Picture:
    """Ring the nodes whose DOFs the model is reduced to.

    Parameters
    ----------
    picture : Picture
        The drawing of the structure.
    geometry : Geometry
        Where the nodes are.
    dofs : sequence of Dof
        The DOFs.

    Returns
    -------
    Picture
        With the rings.
    """
    place = {int(node): row for row, node in enumerate(geometry.nodes)}
    known = [dof for dof in dofs if dof.node in place]
    if not known:
        return picture
    at = project(geometry.coordinates_m)[[place[dof.node] for dof in known]]
    hover = "%{text}: the model is reduced to it"
    names = [dof.name for dof in known]
    rings = markers(
        at[:, 0], at[:, 1], "retained in the reduction", "@c3", hover=hover, symbol="circle-open", size=14, text=names
    )
    return replace(picture, traces=(*picture.traces, rings), alt=f"{picture.alt}; reduced to {', '.join(names)}")


def _vertical_lines(
    name: str, colour: str, frequencies: Sequence[float], texts: Sequence[str], ends: tuple[float, float]
) -> list[Trace]:
    if not frequencies:
        return []
    x, y = np.full((len(frequencies), 3), np.nan), np.full((len(frequencies), 3), np.nan)
    x[:, :2], y[:, :2] = np.array(frequencies)[:, None], ends
    hover = [text for text in texts for _ in range(3)]
    return [line(x.ravel(), y.ravel(), name, colour, hover="%{x:.6g} Hz, %{text}", width=2.5, text=hover)]
