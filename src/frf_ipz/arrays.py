"""Names of array types, and the checks of arrays at the public edge."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt

from frf_ipz.errors import FileFormatError, InputError, ShapeError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from scipy import sparse

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]
Matrix: TypeAlias = "sparse.csr_array[np.float64, tuple[int, int]]"  # sparse, as the matrices of an FE model are

Scalar = TypeVar("Scalar", bound=np.generic)
LARGEST_WHOLE = 2**53  # above it doubles leave whole numbers out


def as_doubles(path: Path, name: str, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Bring wider floating-point numbers of a file to double precision, whole.

    Parameters
    ----------
    path : Path
        The file, for the message.
    name : str
        What the array is called there.
    values : array
        Of any kind.

    Returns
    -------
    array
        The same, in double precision where it was in more.

    Raises
    ------
    FileFormatError
        If a number is too large for double precision.

    Examples
    --------
    >>> from pathlib import Path
    >>> as_doubles(Path("frf.h5"), "f", np.array([1.5], np.longdouble)).dtype.name
    'float64'
    """
    doubles = {"f": np.float64, "c": np.complex128}.get(values.dtype.kind)
    if doubles is None or values.dtype.itemsize <= np.dtype(doubles).itemsize:
        return values
    with np.errstate(over="ignore"):
        taken: npt.NDArray[Any] = values.astype(doubles)
    if not np.isfinite(taken[np.isfinite(values)]).all():
        problem = f"'{name}' holds numbers above {np.finfo(np.float64).max:.2g}, in {values.dtype}, as no measurement"
        raise FileFormatError(path, f"{problem} or matrix has them; is the file damaged? export it again, in doubles")
    return taken


def as_whole_numbers(values: npt.ArrayLike, what: str) -> IntArray:
    """Take numbers of a file as whole ones: places, counts and nodes, that a cast would cut or turn over.

    Parameters
    ----------
    values : array
        Integers, or floating-point numbers without a fraction.
    what : str
        What they are, for the message.

    Returns
    -------
    array
        The same numbers, as integers.

    Raises
    ------
    InputError
        If one is no whole number, or too large to be known exactly.

    Examples
    --------
    >>> as_whole_numbers([1.0, 3.0], "the rows").tolist()
    [1, 3]
    >>> as_whole_numbers([1.0, 1.5], "the rows")
    Traceback (most recent call last):
    ...
    frf_ipz.errors.InputError: the rows hold 1.5, which is no whole number that can be read
    """
    numbers = np.asarray(values)
    if numbers.dtype.kind not in "iufb":
        raise InputError(f"the array with {what} holds {numbers.dtype}; whole numbers are needed")
    is_whole = (numbers >= -LARGEST_WHOLE) & (numbers <= LARGEST_WHOLE) & (numbers == np.rint(numbers))
    if not is_whole.all():
        wrong = numbers[~is_whole].ravel()[0]
        raise InputError(f"{what} hold {wrong:.10g}, which is no whole number that can be read")
    return numbers.astype(np.int64)


def read_only(array: npt.NDArray[Scalar]) -> npt.NDArray[Scalar]:
    """Give a view of an array that cannot be written to.

    Parameters
    ----------
    array : array
        Any array; it is not copied.

    Returns
    -------
    array
        The same data, read-only.

    Examples
    --------
    >>> read_only(np.zeros(2)).flags.writeable
    False
    """
    view = array.view()
    view.flags.writeable = False
    return view


def complex_array(real: npt.ArrayLike, imag: npt.ArrayLike) -> ComplexArray:
    """Put real and imaginary parts together, each as it is.

    A product with the imaginary unit would make NaN of the real part where the imaginary one is infinite.

    Parameters
    ----------
    real, imag : array
        Of shapes that go together.

    Returns
    -------
    complex array
        Of their common shape.

    Examples
    --------
    >>> complex_array([1.0, 2.0], [np.inf, 0.0]).real
    array([1., 2.])
    """
    values = np.empty(np.broadcast_shapes(np.shape(real), np.shape(imag)), np.complex128)
    values.real, values.imag = real, imag
    return values


def require_shape(name: str, array: npt.NDArray[Scalar], shape: Sequence[int | None]) -> None:
    """Refuse an array that does not have the required shape.

    Parameters
    ----------
    name : str
        What the array is, for the message.
    array : array
        The array to check.
    shape : sequence of int or None
        The required lengths; None stands for any length.

    Raises
    ------
    ShapeError
        If the number of axes or a length differs.
    """
    fits = array.ndim == len(shape) and all(
        required is None or required == length for required, length in zip(shape, array.shape, strict=False)
    )
    if not fits:
        required_text = ", ".join("any" if length is None else str(length) for length in shape)
        raise ShapeError(f"{name} has the shape {array.shape}; needed is ({required_text})")


def require_finite(name: str, array: npt.NDArray[Scalar]) -> None:
    """Refuse an array that holds NaN or infinity.

    Parameters
    ----------
    name : str
        What the array is, for the message.
    array : array
        The array to check.

    Raises
    ------
    ShapeError
        If a value is not finite; the message gives the index of the first.
    """
    is_bad = ~np.isfinite(array)
    if is_bad.any():
        first = tuple(int(index) for index in np.argwhere(is_bad)[0])
        raise ShapeError(f"{name} holds {int(is_bad.sum())} values that are not finite, the first at {first}")
