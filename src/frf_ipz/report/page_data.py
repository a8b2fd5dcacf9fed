"""What the page's script draws from: pictures as JSON, every array once for the whole page.

Arrays are single-precision bytes in base64; what lies on an even spacing, as the lines of FRFs do, is as exact in
numbers of 16 bits. On a page of hundreds of FRFs all are of 16 bits: curves are then good to less than a screen shows.
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

    from frf_ipz.arrays import FloatArray
    from frf_ipz.report.section import Section
    from frf_ipz.runs.results import Results

UINT16 = np.dtype(np.uint16).newbyteorder("little")
LEAST_PACKED = 24  # shorter arrays are written as numbers
MANY_FRFS = 100  # above which the page holds numbers of 16 bits
STEPS = 65534  # between the least and the largest number of 16 bits; one more stands for no number
ON_A_LINE = 1e-3  # of their spacing, by which printed frequencies are off
DECADES = 2.0  # of positive numbers above which their logarithm is spaced evenly
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
    packer = Packer(is_short=run.frfs is not None and run.frfs.n_frfs > MANY_FRFS)
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
    arrays : list of str or dict
        Bytes of each array, base64; of one of 16 bits with ``low``, ``step`` and ``log``, see `short_numbers`.
    is_short : bool
        Write numbers of 16 bits.
    """

    arrays: list[str | dict[str, Any]] = field(default_factory=list)
    is_short: bool = False
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
            is_short = self.is_short or _spacing(np.asarray(array, float)) > 0
            self.arrays.append(short_numbers(array) if is_short else base64.b64encode(data).decode("ascii"))
        return self._known[data]


def short_numbers(array: np.ndarray[Any, Any]) -> dict[str, Any]:
    """Write an array with 16 bits a number: ``low + step k``, or the exponential of that.

    Parameters
    ----------
    array : (n,) array
        Any numbers.

    Returns
    -------
    dict
        ``bytes`` in base64, ``low``, ``step``, and ``log`` where the logarithm is spaced evenly.

    Examples
    --------
    >>> short = short_numbers(np.array([10.0, 10.5, 12.0]))
    >>> short["low"], short["step"], np.frombuffer(base64.b64decode(short["bytes"]), "<u2").tolist()
    (10.0, 0.5, [0, 1, 4])
    """
    values = np.asarray(array, float)
    known = values[np.isfinite(values)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 0.0)
    is_log = low > 0 and np.log10(high / low) > DECADES
    step = _spacing(values)
    if step > 0:
        is_log = False
    else:
        low, high = (float(np.log(low)), float(np.log(high))) if is_log else (low, high)
        step = (high - low) / STEPS or 1.0
    with np.errstate(invalid="ignore"):  # NaN stays NaN, and is told apart below
        scaled = (np.log(values) if is_log else values) - low
    whole = np.where(np.isfinite(scaled), np.round(scaled / step), STEPS + 1)
    data = base64.b64encode(whole.astype(UINT16).tobytes()).decode("ascii")
    return {"bytes": data, "low": low, "step": step, **({"log": True} if is_log else {})}


def _spacing(values: FloatArray) -> float:
    """Give the spacing of which all numbers are multiples apart, where 16 bits can count them; else 0."""
    known = np.unique(values[np.isfinite(values)])
    apart = float(np.diff(known).min()) if len(known) > 1 else 0.0
    if not apart or known[-1] - known[0] > STEPS * apart:
        return 0.0
    counts = (known - known[0]) / apart
    is_even = np.allclose(counts, np.round(counts), rtol=0, atol=ON_A_LINE)
    return float((known[-1] - known[0]) / np.round(counts[-1])) if is_even else 0.0


def _plain(value: Any) -> Any:  # noqa: ANN401  a leaf of such a tree
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None
    return value
