"""The errors of frf_ipz.

::

    FrfIpzError
    ├── InputError (ValueError)            the user's input is wrong: exit status 2
    │   ├── ShapeError                     an array has the wrong shape, or holds NaN or infinity
    │   ├── QuantityError                  a unit or a quantity does not fit
    │   └── FileFormatError                a file cannot be read as what it should be
    └── NumericalError (RuntimeError)      the computation cannot give a result: exit status 1
        ├── ConvergenceError               an iteration stopped without reaching its goal; carries ``result``
        ├── PairingError                   measured and computed poles or zeros cannot be matched
        └── IllConditionedError            a matrix is too close to singular to be used; a run, which knows the file
                                           that it comes from, raises a FileFormatError in its place

Every message says what was given, what was needed, and what to try.
"""

from __future__ import annotations

from contextlib import contextmanager
from difflib import get_close_matches
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path


NOT_FINITE = "must not contain infs or NaNs"  # what NumPy and SciPy say of such arrays, as an error of values
UNITS_OF_MODEL = (
    "check the units and sizes of the model (masses, springs, lengths) and of what was measured"  # that spread numbers
)
MOST_LETTERS = 800  # of a problem, of which the end says what to do; a damaged file may have a name of any length


class FrfIpzError(Exception):
    """Any error that frf_ipz raises on purpose.

    Examples
    --------
    >>> import frf_ipz
    >>> try:
    ...     frf_ipz.parse_dof("18")
    ... except frf_ipz.FrfIpzError as error:
    ...     print(error)
    '18' is no DOF label; expected NODE:SIGN DIRECTION as in '18:+z', '20:-z' or '7:rz'
    """


class InputError(FrfIpzError, ValueError):
    """The input is wrong: says which file, where in it, what was expected, what to do.

    Examples
    --------
    >>> import frf_ipz
    >>> frf_ipz.parse_dof("18:q")
    Traceback (most recent call last):
        ...
    frf_ipz.errors.InputError: '18:q' is no DOF label; expected NODE:SIGN DIRECTION as in '18:+z', '20:-z' or '7:rz'
    """


class ShapeError(InputError):
    """An array has the wrong shape, or holds values that are not finite.

    Examples
    --------
    >>> import frf_ipz
    >>> frf_ipz.FrfSet.from_arrays([1.0, 2.0], [[[1.0]]], outputs=["1:x"], inputs=["1:x"])
    Traceback (most recent call last):
        ...
    frf_ipz.errors.ShapeError: the FRFs' values [frequency, output, input] has the shape (1, 1, 1); needed is (2, 1, 1)
    """


class QuantityError(InputError):
    """A unit or a physical quantity does not fit where it is used.

    Examples
    --------
    >>> import frf_ipz
    >>> values = [[[1.0]], [[1.0]]]
    >>> frf_ipz.FrfSet.from_arrays([1.0, 2.0], values, outputs=["1:x"], inputs=["1:x"], quantity="mobilty")
    Traceback (most recent call last):
        ...
    frf_ipz.errors.QuantityError: 'mobilty' is no quantity of FRFs; did you mean 'mobility'?
    """


class FileFormatError(InputError):
    """A file cannot be read as what it should be.

    Parameters
    ----------
    path : Path
        The file.
    problem : str
        What is wrong, what was expected and what to do, as one sentence.
    where : str, optional
        Where in the file: a line, a column or a key.

    Examples
    --------
    >>> import frf_ipz
    >>> frf_ipz.read_model("missing.toml")
    Traceback (most recent call last):
        ...
    frf_ipz.errors.FileFormatError: missing.toml: there is no such file
    """

    def __init__(self, path: Path | str, problem: str, *, where: str = "") -> None:
        self.path = path
        self.problem = problem
        self.where = where
        where = _without_middle(where, MOST_LETTERS // 8)
        super().__init__(f"{path}{f', {where}' if where else ''}: {_without_middle(problem, MOST_LETTERS)}")

    @property
    def parts(self) -> tuple[FileFormatError, ...]:
        """What is wrong with each of several places in the file; by default the error itself."""
        return (self,)


def _without_middle(text: str, most: int) -> str:
    """Leave out what lies in the middle of a text that is too long."""
    return text if len(text) <= most else f"{text[: most // 2 - 3]} ... {text[2 - most // 2 :]}"


class NoModesError(InputError):
    """Measured FRFs show no mode: nothing stands out of their noise in the band.

    Examples
    --------
    >>> import frf_ipz
    >>> issubclass(frf_ipz.NoModesError, frf_ipz.InputError)
    True
    """


class NumericalError(FrfIpzError, RuntimeError):
    """A computation cannot give a result.

    Examples
    --------
    >>> import frf_ipz
    >>> issubclass(frf_ipz.NumericalError, RuntimeError)
    True
    """


class ConvergenceError(NumericalError):
    """An iteration stopped without reaching its goal.

    Parameters
    ----------
    message : str
        Why it stopped.
    result : object
        What was reached, of the type that the function returns when it converges.

    Examples
    --------
    >>> import frf_ipz
    >>> error = frf_ipz.ConvergenceError("stopped after 30 iterations", result={"misfit": 0.2})
    >>> error.result["misfit"], isinstance(error, frf_ipz.NumericalError)
    (0.2, True)
    """

    def __init__(self, message: str, *, result: object = None) -> None:
        self.result = result
        super().__init__(message)


class PairingError(NumericalError):
    """Measured and computed poles or zeros cannot be matched.

    Examples
    --------
    >>> import frf_ipz
    >>> issubclass(frf_ipz.PairingError, frf_ipz.NumericalError)
    True
    """


class IllConditionedError(NumericalError):
    """A matrix is too close to singular to be used.

    Parameters
    ----------
    message : str
        What is wrong with it, and what to do.
    key : str
        Key of the pipeline file that the message proposes to change; empty where the matrix itself has to be.

    Examples
    --------
    >>> import frf_ipz
    >>> issubclass(frf_ipz.IllConditionedError, frf_ipz.NumericalError)
    True
    >>> frf_ipz.IllConditionedError("the modes can hardly be distinguished", key="reduce.dofs").key
    'reduce.dofs'
    """

    def __init__(self, message: str, *, key: str = "") -> None:
        self.key = key
        super().__init__(message)


@contextmanager
def errors_of_file(path: Path | str, *, where: str = "") -> Iterator[None]:
    """Say in which file an input error was met.

    Parameters
    ----------
    path : Path
        The file.
    where : str, optional
        The place in the file: a line, a column or a key.

    Yields
    ------
    None
        While the file's content is worked on.

    Raises
    ------
    FileFormatError
        In the place of an `InputError` that names no file.
    """
    try:
        yield
    except FileFormatError:
        raise
    except InputError as error:
        raise FileFormatError(path, str(error), where=where) from None


@contextmanager
def errors_of_arithmetic(what: str, *, advice: str = UNITS_OF_MODEL) -> Iterator[None]:
    """Say as an error of the package that numbers leave double precision, or memory does not hold them.

    Parameters
    ----------
    what : str
        What is computed.
    advice : str, optional
        What to do where numbers leave double precision; by itself what may be wrong with a model.

    Yields
    ------
    None
        While it is computed.

    Raises
    ------
    IllConditionedError
        In the place of what a solver of NumPy or SciPy, or the system, says.
    """
    try:
        yield
    except MemoryError:
        raise IllConditionedError(f"{what}: memory does not hold it; use a smaller model or fewer lines") from None
    except (np.linalg.LinAlgError, FloatingPointError, OverflowError, ValueError) as error:
        if isinstance(error, FrfIpzError) or (type(error) is ValueError and NOT_FINITE not in str(error)):
            raise
        raise IllConditionedError(
            f"{what}: numbers lie too many decades apart for double precision; {advice}"
        ) from None


def problem_of(error: FrfIpzError) -> str:
    """Give what is wrong, without the file and what to do, where another way out has to be proposed.

    Parameters
    ----------
    error : FrfIpzError
        What was met.

    Returns
    -------
    str
        The first part of its message.

    Examples
    --------
    >>> problem_of(FileFormatError("frf.npz", "holds no FRFs; export it again"))
    'holds no FRFs'
    """
    text = error.problem if isinstance(error, FileFormatError) else str(error)
    return text.partition(";")[0]


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Propose the known word that is closest to an unknown one.

    Parameters
    ----------
    word : str
        What was given.
    known : iterable of str
        What could have been given.

    Returns
    -------
    str
        ``"did you mean 'dofs'?"`` or, where nothing is close, the list of what is known.

    Examples
    --------
    >>> did_you_mean("dof", ["dofs", "mass"])
    "did you mean 'dofs'?"
    """
    choices = list(known)
    matches = get_close_matches(word, choices, n=1)
    return f"did you mean '{matches[0]}'?" if matches else f"known are {', '.join(choices) or 'none'}"
