"""Checks of what callers hand in: what kind of thing, which file, which numbers. Public functions call them first."""

from __future__ import annotations

from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from frf_ipz.arrays import require_finite, require_shape
from frf_ipz.errors import InputError, ShapeError, did_you_mean
from frf_ipz.input_files import require_regular_file

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

SHOWN = 60  # letters of a value in a message


def require_type(name: str, value: object, *kinds: type, optional: bool = False) -> None:
    """Refuse what is not of the needed kind.

    Parameters
    ----------
    name : str
        Name of the argument, for the message.
    value : object
        What was given.
    *kinds : type
        What it may be.
    optional : bool
        It may be None too.

    Raises
    ------
    InputError
        If it is of another kind.

    Examples
    --------
    >>> require_type("points", 3, tuple, list)
    Traceback (most recent call last):
        ...
    frf_ipz.errors.InputError: points is the int 3; needed is a tuple or list
    """
    if isinstance(value, kinds) or (optional and value is None):
        return
    needed = " or ".join(kind.__name__ for kind in kinds)
    raise InputError(f"{name} is {describe(value)}; needed is a {needed}")


def require_each(name: str, values: object, *kinds: type) -> None:
    """Refuse what is no list of things of the needed kind.

    Parameters
    ----------
    name : str
        Name of the argument, for the message.
    values : object
        What was given.
    *kinds : type
        What each may be.

    Raises
    ------
    InputError
        If it is no list, or holds something of another kind.

    Examples
    --------
    >>> require_each("recordings", [1.5], str)
    Traceback (most recent call last):
        ...
    frf_ipz.errors.InputError: one of recordings is the float 1.5; needed is a str
    """
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise InputError(
            f"{name} is {describe(values)}; needed is a list of {' or '.join(kind.__name__ for kind in kinds)}"
        )
    for value in values:
        require_type(f"one of {name}", value, *kinds)


def require_choice(name: str, value: object, choices: Sequence[str]) -> None:
    """Refuse a word that is not among those that are known.

    Parameters
    ----------
    name : str
        Name of the argument, for the message.
    value : object
        What was given.
    choices : sequence of str
        The words.

    Raises
    ------
    InputError
        If it is none of them: names the closest.

    Examples
    --------
    >>> require_choice("kind", "hamer", ("hammer", "random"))
    Traceback (most recent call last):
        ...
    frf_ipz.errors.InputError: kind = 'hamer' is not known; did you mean 'hammer'?
    """
    if value not in choices:
        raise InputError(f"{name} = {value!r} is not known; {did_you_mean(str(value), choices)}")


def describe(value: object) -> str:
    """Name a value by its type and its first letters.

    Parameters
    ----------
    value : object
        Anything.

    Returns
    -------
    str
        For example ``the str 'beam'``.

    Examples
    --------
    >>> describe("beam"), describe(None)
    ("the str 'beam'", 'None')
    """
    if value is None:
        return "None"
    text = " ".join(repr(value).split())
    return f"the {type(value).__name__} {text if len(text) <= SHOWN else text[:SHOWN] + '...'}"


def as_path(path: str | PathLike[str], *, name: str = "the path") -> Path:
    """Take a path, as text or as a path.

    Parameters
    ----------
    path : str or Path
        The path.
    name : str
        What it is, for the message.

    Returns
    -------
    Path
        The path.

    Raises
    ------
    InputError
        If it is neither.

    Examples
    --------
    >>> as_path("model.toml").name
    'model.toml'
    """
    require_type(name, path, str, PathLike)
    return Path(path)


def require_file(path: str | PathLike[str]) -> Path:
    """Take the path of a file that is there.

    Parameters
    ----------
    path : str or Path
        The path.

    Returns
    -------
    Path
        The path.

    Raises
    ------
    InputError
        If it is no path.
    FileFormatError
        If there is no such file, or it is a folder, a device or a pipe.
    """
    file = as_path(path)
    require_regular_file(file)
    return file


def take_array(
    name: str,
    values: ArrayLike,
    dtype: type[np.float64 | np.complex128],
    shape: Sequence[int | None] = (None,),
    *,
    is_finite: bool = True,
) -> NDArray[Any]:
    """Take numbers as an array, checked.

    Parameters
    ----------
    name : str
        What they are, for the message.
    values : array_like
        The numbers.
    dtype : type
        Real or complex numbers of double precision.
    shape : sequence of int or None
        The required lengths; None stands for any length.
    is_finite : bool
        NaN and infinity are refused.

    Returns
    -------
    array
        Of that shape and type.

    Raises
    ------
    ShapeError
        If they are no numbers, not finite, or of another shape.

    Examples
    --------
    >>> take_array("the lines", [1, 2], np.float64)
    array([1., 2.])
    """
    try:
        array = np.asarray(values)
        if dtype is np.float64 and np.iscomplexobj(array):
            raise ShapeError(f"{name} are complex; real numbers are needed")
        array = array.astype(dtype)
    except (TypeError, ValueError) as error:
        if isinstance(error, ShapeError):
            raise
        raise ShapeError(f"{name} are {describe(values)}; an array of numbers is needed") from None
    require_shape(name, array, shape)
    if is_finite:
        require_finite(name, array)
    return array
