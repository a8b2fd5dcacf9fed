"""Arrays and pictures as JSON: every array once for the whole page, as single-precision bytes in base64."""

from __future__ import annotations

import base64
from dataclasses import dataclass, field
from typing import Any

import numpy as np

LEAST_PACKED = 24  # shorter arrays are written as numbers
DIGITS = 8  # of numbers that are written: single precision, as the packed ones


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
