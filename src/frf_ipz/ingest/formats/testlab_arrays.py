"""Structures that Simcenter Testlab (LMS Test.Lab) writes into MATLAB files: axes, values, units and names of channels.

``x_values`` has a start and an increment, ``y_values`` the numbers with one column a channel, ``function_record`` the
names, in which a point of the geometry stands with its direction, as in ``wing:12:+Z``.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.dofs import Dof

if TYPE_CHECKING:
    from collections.abc import Iterator

    from frf_ipz.arrays import FloatArray
    from frf_ipz.ingest.formats.file_arrays import FileArrays, NumericArray

VALUES, STEP, START = ".y_values.values", ".x_values.increment", ".x_values.start_value"
POINT = re.compile(r"(?<![\d.])(\d{1,9}):([+-]?)(r?[xyz])\b", re.IGNORECASE)
UNIT_LABELS = (".y_values.quantity.label", ".y_values.quantity.unit", ".y_values.unit")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TestlabBlock:
    """Functions that share an axis.

    Parameters
    ----------
    name : str
        Of the structure.
    x : (n,) array
        Times in s, or frequencies in Hz.
    values : (n, n_functions) array
        Real for signals, complex for FRFs.
    names : tuple of str
        Of the functions; may be empty.
    units : tuple of str
        Of the functions; may be empty.
    """

    __test__ = False  # no test of pytest

    name: str
    x: FloatArray
    values: NumericArray
    names: tuple[str, ...]
    units: tuple[str, ...]


def testlab_blocks(arrays: FileArrays) -> Iterator[TestlabBlock]:
    """Find the structures of Testlab in a file.

    Parameters
    ----------
    arrays : FileArrays
        All that the file holds.

    Yields
    ------
    TestlabBlock
        One a structure.
    """
    for key, raw_values in arrays.arrays.items():
        way = key.removesuffix(VALUES)
        step = arrays.arrays.get(way + STEP)
        if way == key or step is None or step.size != 1 or raw_values.ndim > 2:
            continue
        values = np.atleast_2d(raw_values)
        values = values.T if values.shape[0] == 1 else values
        start = arrays.arrays.get(way + START, np.zeros(1))
        n_functions = values.shape[1]
        units = next((arrays.texts[way + label] for label in UNIT_LABELS if way + label in arrays.texts), ())
        yield TestlabBlock(
            name=way,
            x=np.asarray(float(np.real(start.ravel()[0])) + float(np.real(step.ravel()[0])) * np.arange(len(values))),
            values=values,
            names=_of_each(arrays.texts.get(f"{way}.function_record.name", ()), n_functions),
            units=_of_each(units, n_functions),
        )


def points_of(name: str) -> tuple[Dof, ...]:
    """Read the points that a name of Testlab speaks of.

    Parameters
    ----------
    name : str
        Such as ``FRF wing:12:+Z/wing:1:+Z``.

    Returns
    -------
    tuple of Dof
        In their order.

    Examples
    --------
    >>> [str(dof) for dof in points_of("FRF wing:12:+Z/wing:1:-X")]
    ['12:+z', '1:-x']
    """
    return tuple(
        Dof(int(node), direction.lower(), -1 if sign == "-" else 1) for node, sign, direction in POINT.findall(name)
    )


def _of_each(texts: tuple[str, ...], n_functions: int) -> tuple[str, ...]:
    return texts if len(texts) == n_functions else texts * n_functions if len(texts) == 1 else ()
