"""Units that names of columns of coordinates state: ``x_mm``, ``x [in]``, ``X (cm)``."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from frf_ipz.errors import FileFormatError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

LENGTHS_M = {"mm": 1e-3, "cm": 1e-2, "dm": 0.1, "in": 0.0254, "inch": 0.0254, "ft": 0.3048, "um": 1e-6}
NAME = re.compile(r"([xyz])[ _]*[\[(/]?\s*([a-z]+)\s*[\])]?", re.IGNORECASE)


def coordinate_unit(path: Path, header: Sequence[str]) -> tuple[list[str], float | None]:
    """Find the unit in the names of the columns of coordinates.

    Parameters
    ----------
    path : Path
        The file, for the message.
    header : sequence of str
        Its names of columns.

    Returns
    -------
    names : list of str
        In small letters; ``x``, ``y``, ``z`` where a unit was taken off.
    unit_m : float or None
        The unit in m; None where the names state none, and for ``x_m``, which is the model's own unit of length.

    Raises
    ------
    FileFormatError
        If coordinates are in different units.

    Examples
    --------
    >>> coordinate_unit("nodes.csv", ["Node", "x_mm", "y_mm", "z_mm"])
    (['node', 'x', 'y', 'z'], 0.001)
    """
    names = [name.strip().lower() for name in header]
    matches = {index: match for index, name in enumerate(names) if (match := NAME.fullmatch(name))}
    units = {index: match[2] for index, match in matches.items() if match[2] in LENGTHS_M}
    if not units:
        return names, None
    unit = next(iter(units.values()))
    if len({*units.values()}) > 1 or len(units) != 3:
        listed = ", ".join(names[index] for index in sorted(matches))
        raise FileFormatError(
            path,
            f"has coordinates in different units: {listed}; write all three in one, as in x_{unit},y_{unit},z_{unit}",
        )
    for index in units:
        names[index] = matches[index][1]
    return names, LENGTHS_M[unit]
