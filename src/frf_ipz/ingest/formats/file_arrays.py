"""Files of named arrays (MATLAB, HDF5, NumPy): what they hold, and how one array, or a column of one, is named.

Arrays within structures and groups are named by their way: ``beam.frf``, ``s(2).y``, ``day1/force``. A column is named
as MATLAB does, ``data(:,2)`` counted from 1, or as NumPy does, ``data[:,1]`` counted from 0.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from frf_ipz.errors import FileFormatError, did_you_mean

NumericArray = npt.NDArray[Any]

MOST_EXPANDED = 1 << 30  # bytes that a smaller file may hold when it is unpacked; more is refused before it is read
SELECTED = re.compile(r"(?P<name>.+?)\s*(?P<bracket>[(\[])(?P<places>[\d\s,:]+)[)\]]")
LAST_PART = re.compile(r"[./@]")
MOST_LISTED = 12  # arrays that a message lists


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FileArrays:
    """What a file of arrays holds.

    Parameters
    ----------
    path : Path
        The file.
    arrays : mapping of str to array
        Numbers, real or complex, with the axes in the order in which the program that wrote them counts.
    texts : mapping of str to tuple of str
        Texts, and lists of texts, such as names and units of channels.
    counts_from_one : bool
        Columns are named as MATLAB does.
    unread : tuple of str
        What stands there too and cannot be read: objects of MATLAB for one.
    """

    path: Path
    arrays: Mapping[str, NumericArray]
    texts: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    counts_from_one: bool = False
    unread: tuple[str, ...] = ()

    def select(self, selector: str) -> NumericArray:
        """Give an array, or a part of one.

        Parameters
        ----------
        selector : str
            Its name, with places in brackets or without; a name without its way does where there is one of it.

        Returns
        -------
        array
            The numbers.

        Raises
        ------
        FileFormatError
            If there is none of the name, or it has no such part.
        """
        found = self.find(selector)
        if found is not None:
            return self.arrays[found]
        match = SELECTED.fullmatch(selector)
        name = None if match is None else self.find(match["name"])
        if match is None or name is None:
            raise self._missing(selector)
        shift = 1 if match["bracket"] == "(" else 0
        array = self.arrays[name]
        places = [place.strip() for place in match["places"].split(",")]
        if len(places) == 1 and array.ndim == 2 and 1 in array.shape:  # x(2) of a vector
            array = array.ravel()
        index = [_index(place, shift) for place in places]
        is_inside = len(index) == array.ndim and all(
            isinstance(place, slice) or 0 <= place < size for place, size in zip(index, array.shape, strict=False)
        )
        if not is_inside:
            raise FileFormatError(self.path, f"'{selector}' is no part of '{name}', which is {describe(array)}")
        return np.asarray(array[tuple(index)])

    def find(self, name: str) -> str | None:
        """Find the whole name of an array: as it is given, without its way, or in another case.

        Parameters
        ----------
        name : str
            What is looked for.

        Returns
        -------
        str or None
            The name; None where there is none, or more than one.
        """
        if name in self.arrays:
            return name
        for same in (_same, _same_in_any_case):
            found = [known for known in self.arrays if same(known, name)]
            if len(found) == 1:
                return found[0]
        return None

    def column_name(self, name: str, place: tuple[int | None, ...]) -> str:
        """Name a part of an array.

        Parameters
        ----------
        name : str
            Of the array.
        place : tuple of int or None
            One an axis, counted from 0; None for all.

        Returns
        -------
        str
            As `select` reads it.
        """
        shift = 1 if self.counts_from_one else 0
        inside = ",".join(":" if number is None else str(number + shift) for number in place)
        return f"{name}({inside})" if self.counts_from_one else f"{name}[{inside}]"

    def listing(self) -> str:
        """Name what the file holds, with its sizes."""
        texts = [f"{name} ({describe(array)})" for name, array in list(self.arrays.items())[:MOST_LISTED]]
        more = len(self.arrays) - len(texts)
        hidden = f"; not readable: {', '.join(self.unread[:MOST_LISTED])}" if self.unread else ""
        return (", ".join(texts) or "no numbers") + (f" and {more} more" if more > 0 else "") + hidden

    def _missing(self, selector: str) -> FileFormatError:
        problem = f"has no array '{selector}'; {did_you_mean(selector, self.arrays)}"
        return FileFormatError(self.path, f"{problem}. It holds {self.listing()}")


@dataclass(frozen=True, slots=True, kw_only=True)
class ArrayFormat:
    """A format of files of named arrays; recordings and FRFs in them are found by their shapes.

    Parameters
    ----------
    rank : int
        Formats are asked in ascending order whether a file is theirs.
    recognises : callable
        Tells by the first bytes whether a file is of this format.
    read : callable
        Reads all its arrays.
    """

    rank: int
    recognises: Callable[[bytes], bool]
    read: Callable[[Path], FileArrays]


def describe(array: NumericArray) -> str:
    """Say how large an array is.

    Parameters
    ----------
    array : array
        Numbers.

    Returns
    -------
    str
        Such as ``4096 x 3, complex``.
    """
    sizes = " x ".join(map(str, array.shape)) or "one number"
    return f"{sizes}, complex" if np.iscomplexobj(array) else sizes


def last_part(name: str) -> str:
    """Give the name of an array without its way.

    Parameters
    ----------
    name : str
        Such as ``beam.frf`` or ``day1/force``.

    Returns
    -------
    str
        Such as ``frf``.
    """
    return LAST_PART.split(name)[-1]


def _same(known: str, name: str) -> bool:
    return last_part(known) == name or known.lstrip("/") == name.lstrip("/")


def _same_in_any_case(known: str, name: str) -> bool:
    return known.lower() == name.lower() or last_part(known).lower() == name.lower()


def _index(place: str, shift: int) -> int | slice:
    return slice(None) if place == ":" else int(place[:9]) - shift if place.isdigit() else -1
