"""Results of stages into one file and back, exactly. Data are never code.

What a file may hold follows from the types of `RESULTS` and from the annotations of their fields: a value that is
no such thing is refused. No name in a file is ever looked up, but in this table; arrays are plain numbers.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from enum import Enum
from functools import cache
from importlib import import_module
from types import UnionType
from typing import TYPE_CHECKING, Any, Union, cast, get_args, get_origin, get_type_hints

import numpy as np
from scipy import sparse

from frf_ipz.errors import FileFormatError, FrfIpzError
from frf_ipz.late_imports import import_late
from frf_ipz.runs.stage_file import ADVICE, StageFile, read_stage_file, write_stage_file

if TYPE_CHECKING:
    from pathlib import Path

    import pandas as pd
    from numpy.typing import NDArray

    from frf_ipz.numerics.compressed_places import require_places
else:
    pd = import_late("pandas")
    require_places = import_late("frf_ipz.numerics.compressed_places", "require_places")

RESULTS = {  # by stage: the whole list of what is ever built from a file, with the types of its fields
    "ingest": "frf_ipz.ingest.frf_estimate:FrfEstimate",
    "fit": "frf_ipz.identification.modal_fit:ModalFit",
    "model": "frf_ipz.structure:Geometry",
    "diagnose": "frf_ipz.diagnosis.result:Diagnosis",
    "levels": "frf_ipz.diagnosis.measured.levels:LevelDependence",
    "reduce": "frf_ipz.structure:ReducedModel",
    "pair": "frf_ipz.pairing.pairs:Pairs",
    "update": "frf_ipz.updating.updated_model:UpdatedModel",
    "predict": "frf_ipz.prediction.prediction:Prediction",
    "reference": "frf_ipz.frf:FrfSet",
    "causes": "frf_ipz.prediction.prediction:Prediction",
    "assess": "frf_ipz.assessment.assessment:Assessment",
    "export": "frf_ipz.export.state_space:StateSpaceModel",
}
LARGEST_INTEGER = 1 << 63
REASON = 200  # letters of what is wrong that are said


def save_result(result: object, path: Path, *, key: str = "") -> None:
    """Write a stage's result.

    Parameters
    ----------
    result : object
        Of a type of `RESULTS`, or plain values, arrays and tables.
    path : Path
        File to write.
    key : str
        Digest of all that the result depends on, to be kept with it.

    Raises
    ------
    TypeError
        If it holds what its annotations do not say: a fault of the program.
    OSError
        If it cannot be written.
    """
    arrays: list[NDArray[Any]] = []
    name = _name_of(type(result))
    kind: Any = type(result) if name in RESULTS.values() else object
    tree = [name if kind is not object else "", _kind(kind).encode(result, arrays)]
    write_stage_file(StageFile(key=key, tree=tree, arrays=arrays), path)


def load_result(path: Path, *, stage: str = "", key: str | None = None) -> Any:
    """Read what `save_result` wrote.

    Parameters
    ----------
    path : Path
        The file.
    stage : str
        The result must be what this stage gives; empty for anything.
    key : str, optional
        The key that must be kept with it; any by default.

    Returns
    -------
    object
        The result, equal to the last bit.

    Raises
    ------
    FileFormatError
        If the file is damaged, was written by another version of the program, or holds something else.
    """
    content = read_stage_file(path)
    if key is not None and content.key != key:
        raise FileFormatError(path, f"belongs to another run; {ADVICE}")
    allowed = (RESULTS[stage],) if stage else ("", *RESULTS.values())
    try:
        name, tree = content.tree
        if name not in allowed:
            raise _MisfitError(f"it holds {name or 'plain values'}")
        arrays = dict(enumerate(content.arrays))
        return _kind(_type_of(name) if name else object).decode(tree, arrays)
    except (FrfIpzError, ValueError, TypeError, LookupError, AttributeError, ArithmeticError, RecursionError) as error:
        reason = " ".join(str(error).split())[:REASON]
        raise FileFormatError(path, f"is damaged or from another version ({reason}); {ADVICE}") from None


class _MisfitError(ValueError):
    """A value is not what its annotation says."""


class _Kind:
    """Turns values of one annotation into JSON values and back; arrays go aside."""

    def encode(self, value: Any, arrays: list[NDArray[Any]]) -> Any:
        raise NotImplementedError

    def decode(self, node: Any, arrays: dict[int, NDArray[Any]]) -> Any:
        raise NotImplementedError


class _Scalar(_Kind):
    """A number, a truth value or a text."""

    def __init__(self, kind: type) -> None:
        self._kind = kind

    def encode(self, value: Any, arrays: list[NDArray[Any]]) -> Any:
        del arrays
        plain = value.item() if isinstance(value, np.generic) else value
        plain = float(plain) if self._kind is float and type(plain) is int else plain
        if not isinstance(plain, self._kind) or isinstance(plain, bool) is not (self._kind is bool):
            raise TypeError(f"a stage's result holds a {type(value).__name__} in the place of a {self._kind.__name__}")
        return self._kind(plain)

    def decode(self, node: Any, arrays: dict[int, NDArray[Any]]) -> Any:
        del arrays
        if type(node) is not self._kind or (type(node) is int and abs(node) >= LARGEST_INTEGER):
            raise _MisfitError(f"a {self._kind.__name__} was expected")
        if type(node) is str:
            node.encode()  # fails for half a letter, which no page and no table can say
        return node


class _Complex(_Kind):
    def encode(self, value: Any, arrays: list[NDArray[Any]]) -> Any:
        del arrays
        number = complex(value)
        return {"complex": [number.real, number.imag]}

    def decode(self, node: Any, arrays: dict[int, NDArray[Any]]) -> Any:
        real, imag = (REAL.decode(part, arrays) for part in node["complex"])
        return complex(real, imag)


class _Nothing(_Kind):
    def encode(self, value: Any, arrays: list[NDArray[Any]]) -> Any:
        del arrays
        if value is not None:
            raise TypeError(f"a stage's result holds a {type(value).__name__} in the place of None")

    def decode(self, node: Any, arrays: dict[int, NDArray[Any]]) -> Any:
        del arrays
        if node is not None:
            raise _MisfitError("nothing was expected")


class _Choice(_Kind):
    """A member of an enum, by its name."""

    def __init__(self, kind: type[Enum]) -> None:
        self._kind = kind

    def encode(self, value: Any, arrays: list[NDArray[Any]]) -> Any:
        del arrays
        return self._kind(value).name

    def decode(self, node: Any, arrays: dict[int, NDArray[Any]]) -> Any:
        return self._kind[TEXT.decode(node, arrays)]


class _Array(_Kind):
    def encode(self, value: Any, arrays: list[NDArray[Any]]) -> Any:
        if not isinstance(value, np.ndarray):
            raise TypeError(f"a stage's result holds a {type(value).__name__} in the place of an array")
        arrays.append(value)
        return {"array": len(arrays) - 1}

    def decode(self, node: Any, arrays: dict[int, NDArray[Any]]) -> Any:
        return arrays.pop(node["array"])  # once: many references to one array could grow without end


class _Sparse(_Kind):
    def encode(self, value: Any, arrays: list[NDArray[Any]]) -> Any:
        part: Any = sparse.csr_array(cast("Any", value))
        places = [ARRAY.encode(item, arrays) for item in (part.data, part.indices, part.indptr)]
        return {"csr": places, "shape": list(part.shape)}

    def decode(self, node: Any, arrays: dict[int, NDArray[Any]]) -> Any:
        data, indices, pointers = (ARRAY.decode(item, arrays) for item in node["csr"])
        n_rows, n_columns = (INTEGER.decode(item, arrays) for item in node["shape"])
        if n_rows != n_columns:
            raise _MisfitError("a square matrix was expected")
        matrix = sparse.csr_array((data, indices, pointers), shape=(n_rows, n_columns))
        require_places(matrix)  # an index beyond its end would be followed
        return matrix


class _Frame(_Kind):
    """A table: columns of numbers as arrays, others as lists of plain values."""

    def encode(self, value: Any, arrays: list[NDArray[Any]]) -> Any:
        if not isinstance(value, pd.DataFrame):
            raise TypeError(f"a stage's result holds a {type(value).__name__} in the place of a table")
        columns = [[str(name), _encode_column(value[name], arrays)] for name in value.columns]
        return {"frame": columns, "rows": len(value)}

    def decode(self, node: Any, arrays: dict[int, NDArray[Any]]) -> Any:
        columns = {TEXT.decode(name, arrays): _decode_column(column, arrays) for name, column in node["frame"]}
        if {len(column) for column in columns.values()} - {node["rows"]} or (node["rows"] and not columns):
            raise _MisfitError("the columns of a table are not of one length")
        return pd.DataFrame(columns, index=range(node["rows"]))


class _Tuple(_Kind):
    """Any number of values of one kind."""

    def __init__(self, item: _Kind) -> None:
        self._item = item

    def encode(self, value: Any, arrays: list[NDArray[Any]]) -> Any:
        if not isinstance(value, tuple | list):
            raise TypeError(f"a stage's result holds a {type(value).__name__} in the place of a tuple")
        return [self._item.encode(item, arrays) for item in value]

    def decode(self, node: Any, arrays: dict[int, NDArray[Any]]) -> Any:
        if not isinstance(node, list):
            raise _MisfitError("a list was expected")
        return tuple(self._item.decode(item, arrays) for item in node)


class _FixedTuple(_Kind):
    """As many values as the annotation names, each of its own kind."""

    def __init__(self, items: tuple[_Kind, ...]) -> None:
        self._items = items

    def encode(self, value: Any, arrays: list[NDArray[Any]]) -> Any:
        return [kind.encode(item, arrays) for kind, item in zip(self._items, value, strict=True)]

    def decode(self, node: Any, arrays: dict[int, NDArray[Any]]) -> Any:
        return tuple(kind.decode(item, arrays) for kind, item in zip(self._items, node, strict=True))


class _Mapping(_Kind):
    def __init__(self, key: _Kind, value: _Kind) -> None:
        self._key, self._value = key, value

    def encode(self, value: Any, arrays: list[NDArray[Any]]) -> Any:
        pairs = value.items()
        return {"dict": [[self._key.encode(key, arrays), self._value.encode(item, arrays)] for key, item in pairs]}

    def decode(self, node: Any, arrays: dict[int, NDArray[Any]]) -> Any:
        pairs = node["dict"]
        return {self._key.decode(key, arrays): self._value.decode(item, arrays) for key, item in pairs}


class _Fields(_Kind):
    """A dataclass of this package: its fields, each of the kind of its annotation."""

    def __init__(self, kind: Any) -> None:
        if not is_dataclass(kind) or not isinstance(kind, type) or not kind.__module__.startswith(PACKAGE):
            raise TypeError(f"{kind} is no dataclass of this package, and no annotation of what can be kept")
        hints = get_type_hints(kind)
        self.kind = kind
        self.kinds = {item.name: _kind(hints[item.name]) for item in fields(kind) if item.init}
        self._required = {
            item.name
            for item in fields(kind)
            if item.init and item.default is MISSING and item.default_factory is MISSING
        }

    def require(self, value: Any) -> None:
        """Refuse what is no such dataclass."""
        if type(value) is not self.kind:
            raise TypeError(f"a stage's result holds a {type(value).__name__} in the place of a {self.kind.__name__}")

    def named(self, items: Any) -> Any:
        """Refuse what has not the fields of the dataclass."""
        if items.keys() - self.kinds.keys() or self._required - items.keys():
            raise _MisfitError(f"it has not the fields of {self.kind.__name__}")
        return items

    def encode(self, value: Any, arrays: list[NDArray[Any]]) -> Any:
        self.require(value)
        return {"fields": {name: kind.encode(getattr(value, name), arrays) for name, kind in self.kinds.items()}}

    def decode(self, node: Any, arrays: dict[int, NDArray[Any]]) -> Any:
        items = self.named(node["fields"])
        return self.kind(**{name: self.kinds[name].decode(item, arrays) for name, item in items.items()})


class _Rows(_Kind):
    """Any number of one dataclass, as columns: numbers as arrays, and each text once. There may be 100 000."""

    def __init__(self, item: _Fields) -> None:
        self._item = item

    def encode(self, value: Any, arrays: list[NDArray[Any]]) -> Any:
        if not isinstance(value, tuple | list):
            raise TypeError(f"a stage's result holds a {type(value).__name__} in the place of a tuple")
        for item in value:
            self._item.require(item)
        columns = {
            name: _encode_values(kind, [getattr(item, name) for item in value], arrays)
            for name, kind in self._item.kinds.items()
        }
        return {"rows": len(value), "columns": columns}

    def decode(self, node: Any, arrays: dict[int, NDArray[Any]]) -> Any:
        columns = self._item.named(node["columns"])
        values = {name: _decode_values(self._item.kinds[name], column, arrays) for name, column in columns.items()}
        if {len(column) for column in values.values()} - {node["rows"]} or (node["rows"] and not values):
            raise _MisfitError("the columns of a table are not of one length")
        return tuple(
            self._item.kind(**dict(zip(values, row, strict=True))) for row in zip(*values.values(), strict=True)
        )


class _Union(_Kind):
    """The first of several kinds that fits."""

    def __init__(self, kinds: tuple[_Kind, ...]) -> None:
        self._kinds = kinds

    def encode(self, value: Any, arrays: list[NDArray[Any]]) -> Any:
        for kind in self._kinds:
            try:
                return kind.encode(value, arrays)
            except TypeError:
                continue
        raise TypeError(f"a stage's result holds a {type(value).__name__}, which its annotation does not name")

    def decode(self, node: Any, arrays: dict[int, NDArray[Any]]) -> Any:
        for kind in self._kinds:
            try:
                return kind.decode(node, arrays)
            except (TypeError, LookupError, _MisfitError):
                continue
        raise _MisfitError("a value is none of what it may be")


class _Plain(_Kind):
    """Whatever holds no type of the package: numbers, texts, arrays, tables, tuples and mappings of them."""

    def encode(self, value: Any, arrays: list[NDArray[Any]]) -> Any:
        if isinstance(value, complex | np.complexfloating):
            return COMPLEX.encode(value, arrays)
        plain = value.item() if isinstance(value, np.generic) else value
        for kinds, kind in self._by_value().items():
            if isinstance(plain, kinds):
                return kind.encode(plain, arrays)
        if isinstance(plain, Enum) or not isinstance(plain, str | int | float | None):
            raise TypeError(f"a stage's result holds a {type(value).__name__}, which cannot be kept")
        return plain

    def decode(self, node: Any, arrays: dict[int, NDArray[Any]]) -> Any:
        if isinstance(node, list):
            return TUPLE.decode(node, arrays)
        if isinstance(node, dict):
            by_tag = {"array": ARRAY, "csr": SPARSE, "frame": FRAME, "dict": MAPPING, "complex": COMPLEX}
            return by_tag[next(iter(node), "")].decode(node, arrays)
        return INTEGER.decode(node, arrays) if type(node) is int else node

    def _by_value(self) -> dict[Any, _Kind]:
        return {
            np.ndarray: ARRAY,
            pd.DataFrame: FRAME,
            sparse.sparray: SPARSE,
            (tuple, list): TUPLE,
            dict: MAPPING,
        }


PACKAGE = "frf_ipz."
REAL, INTEGER, TEXT, TRUTH = _Scalar(float), _Scalar(int), _Scalar(str), _Scalar(bool)
ARRAY, SPARSE, FRAME, COMPLEX, NOTHING, PLAIN = _Array(), _Sparse(), _Frame(), _Complex(), _Nothing(), _Plain()
TUPLE, MAPPING = _Tuple(PLAIN), _Mapping(PLAIN, PLAIN)


@cache
def _simple_kinds() -> dict[Any, _Kind]:
    return {
        float: REAL,
        int: INTEGER,
        str: TEXT,
        bool: TRUTH,
        complex: COMPLEX,
        type(None): NOTHING,
        object: PLAIN,
        pd.DataFrame: FRAME,
        np.ndarray: ARRAY,
        sparse.csr_array: SPARSE,
    }


@cache
def _kind(hint: Any) -> _Kind:
    """Find what turns the values of an annotation into a file and back."""
    origin, arguments = get_origin(hint), get_args(hint)
    simple = _simple_kinds()
    if hint in simple or origin in simple:
        return simple[hint if hint in simple else origin]
    if origin in {Union, UnionType}:
        return _Union(tuple(map(_kind, arguments)))
    if origin is tuple:
        if arguments[1:] != (...,):
            return _FixedTuple(tuple(map(_kind, arguments)))
        item = _kind(arguments[0])
        return _Rows(item) if isinstance(item, _Fields) else _Tuple(item)
    if origin is Mapping:
        return _Mapping(*map(_kind, arguments))
    return _Choice(hint) if isinstance(hint, type) and issubclass(hint, Enum) else _Fields(hint)


def _name_of(kind: type) -> str:
    return f"{kind.__module__}:{kind.__qualname__}"


def _type_of(name: str) -> type:
    module, _, qualified = name.partition(":")  # of the table above, not of a file
    kind: type = getattr(import_module(module), qualified)
    return kind


def _numbers() -> dict[_Kind, str]:
    return {REAL: "<f8", INTEGER: "<i8", TRUTH: "|b1", COMPLEX: "<c16"}


def _encode_values(kind: _Kind, values: list[Any], arrays: list[NDArray[Any]]) -> Any:
    """Encode values of one kind, as few of them outside of arrays as there are texts."""
    if kind is COMPLEX:
        return ARRAY.encode(np.array(values, np.complex128), arrays)
    encoded = [kind.encode(value, arrays) for value in values]
    if kind in _numbers():
        return ARRAY.encode(np.array(encoded, _numbers()[kind]), arrays)
    if kind is not TEXT and not isinstance(kind, _Choice):
        return encoded
    places = {text: place for place, text in enumerate(dict.fromkeys(encoded))}
    return [list(places), ARRAY.encode(np.array([places[text] for text in encoded], np.int64), arrays)]


def _decode_values(kind: _Kind, node: Any, arrays: dict[int, NDArray[Any]]) -> list[Any]:
    if kind in _numbers():
        return _values_of(node, arrays, _numbers()[kind])
    if kind is not TEXT and not isinstance(kind, _Choice):
        return [kind.decode(item, arrays) for item in node]
    texts, places = node
    known = [kind.decode(text, arrays) for text in texts]
    chosen = _values_of(places, arrays, "<i8")
    if chosen and not 0 <= min(chosen) <= max(chosen) < len(known):
        raise _MisfitError("a text was expected")
    return [known[place] for place in chosen]


def _values_of(node: Any, arrays: dict[int, NDArray[Any]], kind: str) -> list[Any]:
    """Numbers of an array of one axis, as Python's own."""
    column = ARRAY.decode(node, arrays)
    if column.ndim != 1 or column.dtype != np.dtype(kind):
        raise _MisfitError("a column of a table is of another kind")
    values: list[Any] = column.tolist()
    return values


def _encode_column(series: Any, arrays: list[NDArray[Any]]) -> Any:
    values = series.to_numpy()
    if values.dtype.kind in "biufc":
        return ARRAY.encode(values, arrays)
    return [None if pd.isna(item) else PLAIN.encode(item, arrays) for item in series.tolist()]


def _decode_column(node: Any, arrays: dict[int, NDArray[Any]]) -> Any:
    if isinstance(node, list):
        return pd.Series(TUPLE.decode(node, arrays), dtype=None if node else object)
    column = ARRAY.decode(node, arrays)
    if column.ndim != 1:
        raise _MisfitError("a column of a table has more than one axis")
    return column
