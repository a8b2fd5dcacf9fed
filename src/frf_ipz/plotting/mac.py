"""The MAC matrix: measured mode shapes against those of the model, before and after updating."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.plotting.picture import Axis, HeatMap, Panel, Picture, Role
from frf_ipz.plotting.wording import number
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.arrays import FloatArray
    from frf_ipz.runs.picture_data import ShapeAgreement


def describe_mac(agreements: Sequence[ShapeAgreement]) -> Picture | None:
    """Describe how alike measured and computed mode shapes are.

    Parameters
    ----------
    agreements : sequence of ShapeAgreement
        One a model, side by side.

    Returns
    -------
    Picture or None
        Maps from 0 to 1; None without any.
    """
    if not agreements:
        return None
    n_measured, n_dofs = len(agreements[0].measured_hz), agreements[0].n_dofs
    few = n_dofs < n_measured
    return Picture(
        name="mac",
        title="MAC: measured mode shapes against those of the model",
        alt=f"Maps of {counted(n_measured, 'measured mode')} by modes of the model, at {n_dofs} DOFs. Closest mode of "
        + "; ".join(f"the {agreement.model}: {_closest(agreement)}" for agreement in agreements),
        panels=tuple(
            Panel(
                y=Axis(title="Measured, Hz", scale="category", is_reversed=True),
                x=Axis(title=f"{agreement.model.partition(' ')[0].capitalize()}, Hz", scale="category", tick_angle=-40),
                layers=(_map(agreement),),
            )
            for agreement in agreements
        ),
        note=f"1: the same shape, 0: nothing in common. Compared at {counted(n_dofs, 'DOF')}"
        + (", fewer than there are modes: shapes of different modes can look alike there." if few else "."),
        height_px=int(np.clip(150 + 34 * n_measured, 240, 760)),
        has_legend=False,
    )


def _map(agreement: ShapeAgreement) -> HeatMap:
    return HeatMap(
        name=agreement.model,
        colour=Role.INK,
        in_legend=False,
        columns=_numbered(agreement.computed_hz),
        rows=_numbered(agreement.measured_hz),
        values=agreement.mac,
        texts=[[f"{value:.2f}" for value in row] for row in agreement.mac],
        highest=1.0,
        is_linear=True,
        scale_title="MAC",
        hover="measured {y} Hz, model {x} Hz: MAC {text}",
    )


def _numbered(hertz: FloatArray) -> list[str]:
    """Name modes by their frequency: no two alike, as names on an axis are its positions."""
    texts = [number(float(value), 4) for value in hertz]
    return [text if texts.count(text) == 1 else f"{text} ({place + 1})" for place, text in enumerate(texts)]


def _closest(agreement: ShapeAgreement) -> str:
    best = agreement.mac.argmax(axis=1)
    return ", ".join(
        f"{number(float(hertz), 4)} Hz has {number(float(agreement.computed_hz[column]), 4)} Hz with {row[column]:.2f}"
        for hertz, column, row in zip(agreement.measured_hz, best, agreement.mac, strict=True)
    )
