"""Files with modes that were identified elsewhere: how the test describes one, and the protocol of a format."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, runtime_checkable

from frf_ipz.dofs import AnyDof
from frf_ipz.errors import FileFormatError, InputError
from frf_ipz.modes import ModalParameters
from frf_ipz.quantities import FrfQuantity


@dataclass(frozen=True, slots=True, kw_only=True)
class ModesSource:
    """A file with modes, as `test.toml` describes it.

    Parameters
    ----------
    path : Path
        The file.
    input_dofs : tuple of Dof
        Where forces act in the FRFs that a model predicts.
    quantity : FrfQuantity
        What these FRFs are.
    """

    path: Path
    input_dofs: tuple[AnyDof, ...] = ()
    quantity: FrfQuantity = FrfQuantity.ACCELERANCE


@runtime_checkable
class ModesFormat(Protocol):
    """Interface of a format for modes."""

    rank: int

    def holds_modes(self, path: Path, head: bytes) -> bool:
        """Tell whether a file is of this format.

        Parameters
        ----------
        path : Path
            The file.
        head : bytes
            Its beginning.

        Returns
        -------
        bool
            True where it is.
        """

    def read_modes(self, source: ModesSource) -> ModalParameters:
        """Read the modes of a file.

        Parameters
        ----------
        source : ModesSource
            The file.

        Returns
        -------
        ModalParameters
            One mode at least.
        """


def make_modes(source: ModesSource, **values: object) -> ModalParameters:
    """Make modes of what a file holds.

    Parameters
    ----------
    source : ModesSource
        The file.
    **values : object
        Fields of `ModalParameters`.

    Returns
    -------
    ModalParameters
        Checked.

    Raises
    ------
    FileFormatError
        If they are none: names the file.
    """
    try:
        return ModalParameters(input_dofs=source.input_dofs, quantity=source.quantity, **values)  # type: ignore[arg-type]
    except InputError as error:
        raise FileFormatError(source.path, f"{error}; correct the file") from None
