"""What the user has chosen, drawn into the stabilisation diagram and into the structure."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.dofs import node_dofs
from frf_ipz.plotting.picture import Layer, Panel, Picture, Points, Role, Span, VerticalLines, with_layers
from frf_ipz.plotting.projection import project
from frf_ipz.rational import natural_frequency_hz
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.dofs import AnyDof
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.identification.options import FitOptions
    from frf_ipz.structure import Geometry

DIAGRAM, STRUCTURE = "stabilisation", "structure"
STRIP = 0.08  # of the height, below the poles: room for the handles


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
    (panel,) = picture.panels
    low, high = panel.y.limits or (0.0, 1.0)
    strip = STRIP * (high - low)
    pins = [f"pinned: {pin.why}" if pin.why else "pinned" for pin in options.pinned]
    rejections = [f"rejected: {rejection.why}" for rejection in options.strike]
    words = [f"{len(pins)} pinned"] if pins else []
    words += [f"{len(rejections)} rejected"] if rejections else []
    words += [f"{counted(len(options.exclude_hz), 'range')} left out (shaded)"] if options.exclude_hz else []
    layers: list[Layer] = [_handles(fit, low - strip / 2)]
    layers += _lines("pinned", Role.GOOD, [pin.hz for pin in options.pinned], pins)
    layers += _lines("rejected", Role.BAD, [rejection.hz for rejection in options.strike], rejections)
    layers += [_left_out(*ends) for ends in options.exclude_hz]
    taller: Panel = replace(panel, y=replace(panel.y, limits=(low - strip, high)))
    note = f"{picture.note} Your choices: {', '.join(words)}." if words else picture.note
    return with_layers(replace(picture, panels=(taller,), note=note), *layers)


def with_retained(picture: Picture, geometry: Geometry, dofs: Sequence[AnyDof]) -> Picture:
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
    mesh = geometry.outline(dof.node for dof in node_dofs(dofs))
    rows = {int(node): row for row, node in enumerate(mesh.nodes)}
    known = [dof for dof in node_dofs(dofs) if dof.node in rows]
    if not known:
        return picture
    coordinates = project(mesh.coordinates_m)[[rows[dof.node] for dof in known]]
    names = [dof.name for dof in known]
    rings = Points(
        name="retained in the reduction",
        colour=3,
        x=coordinates[:, 0],
        y=coordinates[:, 1],
        size=14,
        is_filled=False,
        hover="{text}: the model is reduced to it",
        texts=names,
    )
    return with_layers(replace(picture, alt=f"{picture.alt}; reduced to {', '.join(names)}"), rings)


def _handles(fit: ModalFit, height: float) -> Points:
    hertz = natural_frequency_hz(fit.model.poles[: fit.n_modes])
    return Points(
        name="handles of the modes",
        colour=Role.INK,
        x=hertz,
        y=np.full(len(hertz), height),
        symbol="triangle-up",
        size=12,
        hover="{x:.6g} Hz: click to pin or reject",
    )


def _lines(name: str, colour: Role, frequencies: Sequence[float], texts: Sequence[str]) -> list[Layer]:
    if not frequencies:
        return []
    x = np.array(frequencies, float)
    return [VerticalLines(name=name, colour=colour, x=x, width=2.5, hover="{x:.6g} Hz, {text}", texts=texts)]


def _left_out(low_hz: float, high_hz: float) -> Span:
    return Span(name="left out", colour=Role.MUTED, opacity=0.3, in_legend=False, low=low_hz, high=high_hz)
