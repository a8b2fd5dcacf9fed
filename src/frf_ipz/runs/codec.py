"""Results of stages into one file and back, exactly.

A result is a tree of our own dataclasses, arrays, tables, enums, tuples, mappings and plain values. Arrays go into an
``.npz`` archive, the tree that refers to them into a JSON text inside it. Nothing in a file can run code when it is
read: only dataclasses and enums of this package are built again.
"""

from __future__ import annotations

import json
from dataclasses import fields, is_dataclass
from enum import Enum
from importlib import import_module
from pathlib import Path
from typing import Any, cast
from zipfile import BadZipFile

import numpy as np
import pandas as pd
from scipy import sparse

from frf_ipz.errors import FileFormatError

PACKAGE = "frf_ipz."
TREE = "tree"
PLAIN = (str, int, float, bool, type(None))


def save_result(result: object, path: Path) -> None:
    """Write a stage's result.

    Parameters
    ----------
    result : object
        A tree of what the module's docstring names.
    path : Path
        File to write, ending in ``.npz``.

    Raises
    ------
    TypeError
        If the tree holds something else: a fault of the program.
    OSError
        If it cannot be written.
    """
    arrays: dict[str, np.ndarray[Any, Any]] = {}
    tree = _encode(result, arrays)
    with path.open("wb") as stream:
        np.savez(stream, allow_pickle=False, **{TREE: np.array(json.dumps(tree)), **arrays})


def load_result(path: Path) -> Any:
    """Read what `save_result` wrote.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    object
        The result, equal to the last bit.

    Raises
    ------
    FileFormatError
        If the file is damaged or was written by another version of the program.
    """
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
            return _decode(json.loads(str(archive[TREE])), archive)
    except (OSError, ValueError, KeyError, TypeError, AttributeError, ImportError, BadZipFile) as error:
        raise FileFormatError(path, f"is damaged or from another version ({error}); delete it and run again") from None


def _encode(value: Any, arrays: dict[str, Any]) -> Any:
    if isinstance(value, Enum):
        return {"enum": _type_name(type(value)), "name": value.name}
    if isinstance(value, PLAIN):
        return value
    if isinstance(value, np.ndarray | np.generic | complex):
        return {"array" if isinstance(value, np.ndarray) else "scalar": _keep(np.asarray(value), arrays)}
    if isinstance(value, Path):
        return {"path": str(value)}
    if isinstance(value, tuple | list):
        return {"tuple": [_encode(item, arrays) for item in value]}
    return _encode_mapping(value, arrays)


def _encode_mapping(value: Any, arrays: dict[str, Any]) -> Any:
    if sparse.issparse(value):
        part: Any = sparse.csr_array(cast("Any", value))
        return {"csr": [_keep(part.data, arrays), _keep(part.indices, arrays), _keep(part.indptr, arrays), part.shape]}
    if isinstance(value, pd.DataFrame):
        columns = [[str(name), _encode(_column(value[name]), arrays)] for name in value.columns]
        return {"frame": columns, "rows": len(value)}
    if is_dataclass(value) and not isinstance(value, type):
        items = {item.name: _encode(getattr(value, item.name), arrays) for item in fields(value) if item.init}
        return {"type": _type_name(type(value)), "fields": items}
    if isinstance(value, dict):
        return {"dict": [[_encode(key, arrays), _encode(item, arrays)] for key, item in value.items()]}
    raise TypeError(f"a stage's result holds a {type(value).__name__}, which cannot be kept")


def _column(series: Any) -> Any:
    values = series.to_numpy()
    return values if values.dtype.kind in "biufc" else [None if pd.isna(item) else item for item in series.tolist()]


def _keep(array: np.ndarray[Any, Any], arrays: dict[str, Any]) -> str:
    key = f"a{len(arrays)}"
    arrays[key] = array
    return key


def _type_name(cls: type) -> str:
    if not cls.__module__.startswith(PACKAGE):
        raise TypeError(f"{cls.__module__}.{cls.__qualname__} is no type of this package")
    return f"{cls.__module__}:{cls.__qualname__}"


def _type(name: str) -> Any:
    module, _, qualified = name.partition(":")
    if not module.startswith(PACKAGE):
        raise TypeError(f"{name} is no type of this package")
    return getattr(import_module(module), qualified)


def _decode(node: Any, archive: Any) -> Any:
    if not isinstance(node, dict):
        return node
    tag = next(iter(node))
    return DECODERS[tag](node, archive)


def _decode_frame(node: Any, archive: Any) -> pd.DataFrame:
    columns = {name: _decode(column, archive) for name, column in node["frame"]}
    return pd.DataFrame(
        {name: list(column) if isinstance(column, tuple) else column for name, column in columns.items()},
        index=range(node["rows"]),
    )


def _decode_csr(node: Any, archive: Any) -> Any:
    data, indices, indptr, shape = node["csr"]
    return sparse.csr_array((archive[data], archive[indices], archive[indptr]), shape=tuple(shape))


DECODERS: dict[str, Any] = {
    "enum": lambda node, _: _type(node["enum"])[node["name"]],
    "array": lambda node, archive: archive[node["array"]],
    "scalar": lambda node, archive: archive[node["scalar"]][()],
    "path": lambda node, _: Path(node["path"]),
    "tuple": lambda node, archive: tuple(_decode(item, archive) for item in node["tuple"]),
    "csr": _decode_csr,
    "frame": _decode_frame,
    "type": lambda node, archive: _type(node["type"])(
        **{name: _decode(item, archive) for name, item in node["fields"].items()}
    ),
    "dict": lambda node, archive: {_decode(key, archive): _decode(item, archive) for key, item in node["dict"]},
}
