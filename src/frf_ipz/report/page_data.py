"""What the page's script draws from: pictures as JSON, every array once for the whole page.

Arrays are single-precision bytes in base64.
"""

from __future__ import annotations

import base64
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from frf_ipz.plotting.picture import frequency_axis
from frf_ipz.report.plotly_drawing import draw_picture
from frf_ipz.report.section import pictures_of
from frf_ipz.runs.picture_data import hidden_frfs

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.report.section import Section
    from frf_ipz.runs.results import Results

LEAST_PACKED = 24  # shorter arrays are written as numbers
DIGITS = 8  # of numbers that are written: single precision, as the packed ones


def page_data(run: Results, sections: Sequence[Section]) -> dict[str, object]:
    """Give what the page's script draws from.

    Parameters
    ----------
    run : Results
        What the run holds.
    sections : sequence of Section
        With the pictures.

    Returns
    -------
    dict
        What JSON can hold.
    """
    packer = Packer()
    pictures = packed_pictures(sections, packer)
    frequencies = [] if run.frfs is None else run.frfs.frequency_hz[run.frfs.frequency_hz > 0][:1].tolist()
    return {
        "pictures": pictures,
        "hiddenFrfs": hidden_frfs(run),
        "frequencyScale": frequency_axis(*run.band_hz).scale,
        "lowestHz": min([1.0, *frequencies]),
        "arrays": packer.arrays,
    }


def packed_pictures(sections: Sequence[Section], packer: Packer) -> dict[str, object]:
    """Draw the pictures of sections.

    Parameters
    ----------
    sections : sequence of Section
        With the pictures.
    packer : Packer
        Takes their arrays.

    Returns
    -------
    dict of str to object
        What JSON can hold, by the names of the pictures.
    """
    return {
        picture.name: packer.pack(draw_picture(picture, n_alike=n_alike)) for picture, n_alike in pictures_of(sections)
    }


@dataclass(kw_only=True, eq=False)
class Packer:
    """Collects the arrays of a page.

    Parameters
    ----------
    arrays : list of str
        Bytes of each array, base64.
    """

    arrays: list[str] = field(default_factory=list)
    _known: dict[bytes, int] = field(default_factory=dict)

    def pack(self, value: Any) -> Any:  # noqa: ANN401  trees of plain values and arrays
        """Replace arrays by references.

        Parameters
        ----------
        value : object
            A tree of dictionaries, lists, plain values and arrays.

        Returns
        -------
        object
            A tree that JSON can hold; ``{"$": k}`` stands for the k-th array. Values that are not finite are null.
        """
        if isinstance(value, dict):
            return {str(key): self.pack(item) for key, item in value.items()}
        if isinstance(value, np.ndarray) and value.dtype.kind in "fiu" and value.ndim == 1:
            return {"$": self._place(value)} if len(value) >= LEAST_PACKED else self.pack(value.tolist())
        if isinstance(value, np.ndarray):
            return self.pack(value.tolist())
        if isinstance(value, list | tuple):
            return [self.pack(item) for item in value]
        return _plain(value)

    def _place(self, array: np.ndarray[Any, Any]) -> int:
        data = np.ascontiguousarray(array, "<f4").tobytes()
        if data not in self._known:
            self._known[data] = len(self.arrays)
            self.arrays.append(base64.b64encode(data).decode("ascii"))
        return self._known[data]


def _plain(value: Any) -> Any:  # noqa: ANN401  a leaf of such a tree
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None
    return value
