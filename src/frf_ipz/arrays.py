"""Names of array types, and the checks of arrays at the public edge."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt

from frf_ipz.errors import ShapeError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scipy import sparse

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]
Matrix: TypeAlias = "sparse.csr_array[np.float64, tuple[int, int]]"  # sparse, as the matrices of an FE model are

Scalar = TypeVar("Scalar", bound=np.generic)


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
