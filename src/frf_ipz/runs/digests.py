"""What a result depends on, as a digest; and options as plain values."""

from __future__ import annotations

import hashlib
import json
from dataclasses import fields, is_dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import sparse

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping


def digest(parts: Mapping[str, Any]) -> str:
    """Digest what a result depends on.

    Parameters
    ----------
    parts : mapping
        Options, digests of files and of earlier stages; what is no JSON value enters by its representation.

    Returns
    -------
    str
        SHA-256, hexadecimal.
    """
    text = json.dumps(parts, sort_keys=True, default=repr)
    return hashlib.sha256(text.encode()).hexdigest()


def plain(options: Any) -> Any:  # noqa: ANN401  options are trees of dataclasses and plain values
    """Turn options into plain values for JSON.

    Parameters
    ----------
    options : object
        A dataclass, or what can stand in one.

    Returns
    -------
    object
        Dictionaries, lists and plain values.
    """
    if is_dataclass(options) and not isinstance(options, type):
        return {item.name: plain(getattr(options, item.name)) for item in fields(options)}
    if isinstance(options, tuple | list):
        return [plain(item) for item in options]
    return options if isinstance(options, str | int | float | bool | None) else str(options)


def digest_arrays(arrays: Iterable[Any]) -> str:
    """Digest the content of arrays.

    Parameters
    ----------
    arrays : iterable of array
        Dense or sparse.

    Returns
    -------
    str
        SHA-256, hexadecimal.

    Examples
    --------
    >>> digest_arrays([np.zeros(2)]) == digest_arrays([np.zeros((2, 1))])
    False
    """
    total = hashlib.sha256()
    for array in arrays:
        for part in map(np.asarray, _dense_parts(array)):
            total.update(f"{part.dtype.str} {part.shape}".encode())
            total.update(np.ascontiguousarray(part).tobytes())
    return total.hexdigest()


def _dense_parts(array: Any) -> list[Any]:  # noqa: ANN401  arrays, sparse ones among them
    return [getattr(array, name) for name in ("data", "indices", "indptr")] if sparse.issparse(array) else [array]
