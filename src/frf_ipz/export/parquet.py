"""Parquet tables whose columns carry their unit and meaning as field metadata."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from frf_ipz.late_imports import import_late
from frf_ipz.output_files import replacing

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import pyarrow as pa
    import pyarrow.parquet as pq
else:
    pa, pq = import_late("pyarrow"), import_late("pyarrow.parquet")

KINDS = {"float": "float64", "int": "int64", "text": "string", "flag": "bool_"}  # names of Arrow's types


@dataclass(frozen=True, slots=True)
class Column:
    """One column of a table.

    Parameters
    ----------
    name : str
        With the unit at its end unless it is an SI base unit. A ``*`` in it stands for any text, where a table has one
        column for each of something.
    kind : str
        ``float``, ``int``, ``text`` or ``flag``.
    unit : str
        SI unit, ``1`` for a ratio, empty for what has none.
    meaning : str
        Meaning of the numbers.
    """

    name: str
    kind: str
    unit: str
    meaning: str

    @property
    def field(self) -> pa.Field:
        """The Arrow field with its metadata."""
        return pa.field(self.name, _arrow_type(self.kind), metadata={"unit": self.unit, "meaning": self.meaning})


def declared_column(columns: Sequence[Column], name: str) -> Column:
    """Find the declaration of a column.

    Parameters
    ----------
    columns : sequence of Column
        What is declared; the first one that fits counts.
    name : str
        Name of the column.

    Returns
    -------
    Column
        With this name.

    Raises
    ------
    KeyError
        If none fits: a table says what every column of it means.

    Examples
    --------
    >>> declared_column([Column("damping of mode *", "float", "1", "ratio")], "damping of mode 2").name
    'damping of mode 2'
    """
    for column in columns:
        if fnmatchcase(name, column.name):
            return replace(column, name=name)
    raise KeyError(f"the column '{name}' is not declared among {[column.name for column in columns]}")


def make_table(
    columns: Sequence[Column], values: Mapping[str, Any], *, about: Mapping[str, str] | None = None
) -> pa.Table:
    """Build a table.

    Parameters
    ----------
    columns : sequence of Column
        Its columns, in order.
    values : mapping of str to sequence
        The values of each column, and of no other; NaN in a column of floats becomes null.
    about : mapping of str to str, optional
        Metadata of the whole table.

    Returns
    -------
    pyarrow.Table
        The table.

    Raises
    ------
    KeyError
        If a column has no values, or values have no column: a fault of the program.

    Examples
    --------
    >>> table = make_table([Column("gain", "float", "1", "ratio")], {"gain": [1.0, np.nan]})
    >>> table["gain"].null_count, table.schema.field("gain").metadata[b"unit"]
    (1, b'1')
    """
    for name in values:
        declared_column(columns, name)
    arrays = [_array(values[column.name], column) for column in columns]
    metadata = dict(about or {})
    return pa.Table.from_arrays(arrays, schema=pa.schema([column.field for column in columns], metadata))


def repeated(texts: Sequence[str], count: int) -> pa.Array:
    """Repeat each text, without making a Python string of every row.

    Parameters
    ----------
    texts : sequence of str
        One an FRF.
    count : int
        Rows an FRF.

    Returns
    -------
    pyarrow.Array
        A column of text.

    Examples
    --------
    >>> repeated(["a", "b"], 2).to_pylist()
    ['a', 'a', 'b', 'b']
    """
    rows = np.repeat(np.arange(len(texts), dtype=np.int32), count)
    return pa.DictionaryArray.from_arrays(pa.array(rows), pa.array(texts, pa.string())).cast(pa.string())


def write_table(table: pa.Table, path: Path) -> None:
    """Write a table as Parquet.

    Parameters
    ----------
    table : pyarrow.Table
        The table.
    path : Path
        The file.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    with replacing(path) as target:
        pq.write_table(table, target, compression="zstd")


def _arrow_type(kind: str) -> Any:  # noqa: ANN401 - Arrow has no type hints
    return getattr(pa, KINDS[kind])()


def _array(values: Any, column: Column) -> pa.Array:  # noqa: ANN401  what Arrow takes has no common type
    if isinstance(values, pa.Array):
        return values
    if not len(values):  # an empty column of a data frame has no type of its own: the declared one counts
        return pa.array([], _arrow_type(column.kind))
    plain = np.ascontiguousarray(values) if isinstance(values, np.ndarray) else list(values)
    return pa.array(plain, _arrow_type(column.kind), from_pandas=column.kind == "float")
