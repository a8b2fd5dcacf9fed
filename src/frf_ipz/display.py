"""How results show themselves: as a table, as a picture, and in a notebook.

What makes tables and pictures lies above the results that it shows, so it is found by its name when it is first asked
for, as pandas finds what plots for it: Matplotlib is loaded by the first picture, not before.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import fields
from html import escape
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

TABLES, PICTURES, REPORT = "frf_ipz.export.frames", "frf_ipz.plotting.result_pictures", "frf_ipz.report.page"
ROWS_SHOWN = 10
VALUES_SHOWN = 6


class Tabulated:
    """What has tables: gives `to_frame`, and its first table in a notebook."""

    __slots__ = ()

    def to_frame(self, table: str | None = None) -> pd.DataFrame:
        """Give a table of this result, with the columns of the file of the same name.

        Parameters
        ----------
        table : str, optional
            Which of the tables of this type; the first where it is left out.

        Returns
        -------
        DataFrame
            Units are in the names of the columns, and in the reference of the files.

        Raises
        ------
        InputError
            If there is no such table: the message lists those there are.
        """
        frame: pd.DataFrame = import_module(TABLES).to_frame(self, table)
        return frame

    def _repr_html_(self) -> str:
        frame = self.to_frame()
        rows: Any = frame.to_html(max_rows=ROWS_SHOWN, index=False, border=0)
        return f"<p>{escape(repr(self))}</p>{rows if len(frame) else ''}"


class Drawn:
    """What has pictures: gives `plot`."""

    __slots__ = ()

    def plot(self, picture: str | None = None, *, ax: Axes | None = None) -> Axes:
        """Draw a picture of this result.

        Parameters
        ----------
        picture : str, optional
            Which of the pictures of this type; the first where it is left out.
        ax : Axes, optional
            Where to draw; axes of a new figure where it is left out.

        Returns
        -------
        Axes
            With the picture.

        Raises
        ------
        InputError
            If there is no such picture: the message lists those there are.
        """
        axes: Axes = import_module(PICTURES).plot(self, picture, ax=ax)
        return axes


class Concise:
    """Gives a text of one line: numbers and texts as they are, of arrays and tables the shape."""

    __slots__ = ()

    def __repr__(self) -> str:
        values = ", ".join(f"{item.name}={_concise(getattr(self, item.name))}" for item in fields(self) if item.repr)  # type: ignore[arg-type]
        return f"{type(self).__name__}({values})"


def _concise(value: object) -> str:
    shape = getattr(value, "shape", None)
    if shape:
        return f"{'x'.join(map(str, shape))} {type(value).__name__}"
    if isinstance(value, Collection) and not isinstance(value, str) and len(value) > VALUES_SHOWN:
        return f"{len(value)} in a {type(value).__name__}"
    return repr(value)
