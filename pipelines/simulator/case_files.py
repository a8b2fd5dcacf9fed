"""Files as a user would hand them in: recordings, test.toml, model.toml, pipeline.toml, matrices."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from simulator.beams import BeamDrawing, PointPart, Section

FloatArray = NDArray[np.float64]


def write_recording(path: Path, columns: dict[str, FloatArray], rate_hz: float, *, digits: int = 6) -> None:
    """Write a CSV: ``time`` and one column a channel.

    Parameters
    ----------
    path : Path
        The file; its folder is made.
    columns : dict of str to (n,) array
        Channels in their own units.
    rate_hz : float
        Sampling rate.
    digits : int
        Significant digits of the channels.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    table = np.column_stack([np.arange(len(next(iter(columns.values())))) / rate_hz, *columns.values()])
    table += 0.0  # no negative zeros
    form = ",".join(["%.9g", *[f"%.{digits}g"] * len(columns)])
    lines = [",".join(["time", *columns]), *(form % tuple(row) for row in table.tolist())]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def read_beam(path: Path) -> BeamDrawing:
    """Read the table ``[beam]`` of a model file.

    Parameters
    ----------
    path : Path
        A ``model.toml`` of kind ``beam``.

    Returns
    -------
    BeamDrawing
        What the nominal model knows.
    """
    table = tomllib.loads(path.read_text(encoding="utf-8"))["beam"]
    sections = tuple(
        Section(
            first=entry["elements"][0],
            last=entry["elements"][1],
            width_m=entry.get("width_m", table["width_m"]),
            thickness_m=entry.get("thickness_m", table["thickness_m"]),
        )
        for entry in table.pop("section", [])
    )
    parts = tuple(
        PointPart(**{name.lower(): value for name, value in entry.items()})
        for key in ("point_mass", "point_spring")
        for entry in table.pop(key, [])
    )
    numbers = {key.lower(): value for key, value in table.items()}
    return BeamDrawing(**numbers, sections=sections, parts=parts)
