"""Files with FRFs: how the test describes one, what it holds, and the protocol of a format for such files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np

from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray
from frf_ipz.dofs import AnyDof
from frf_ipz.frf import FrfLabel
from frf_ipz.quantities import FrfQuantity


@dataclass(frozen=True, slots=True, kw_only=True)
class FrfSource:
    """A file with FRFs, as `test.toml` describes it.

    Parameters
    ----------
    path : Path
        The file.
    quantity : FrfQuantity
        What its FRFs are.
    unit : str
        Unit of the values; empty for what the file says, or SI.
    output_dofs, input_dofs : tuple of AnyDof
        What the FRFs connect where the file does not say so: one each for a single FRF.
    columns : tuple of str
        What the columns of a text file are.
    skip_rows : int
        Lines before the numbers of a text file.
    direction : str
        Direction, with a sign or without, of the ends of FRFs of a universal file that have none.
    sets : tuple of int
        Which data sets of a universal file to read, counted from 1; all FRFs where empty.
    is_conjugated : bool
        The file has the time convention exp(-i omega t).
    is_reciprocal : bool
        The file has force over response: the reciprocals of FRFs of `quantity`.
    force_dof : AnyDof, optional
        Where the force acts, for a file of transmissibilities: response over the response of a reference.
    reference : FrfSource, optional
        The file with the FRF of that reference.
    level_N : float, optional
        Amplitude of the excitation, N, where the test holds the same FRFs at several.
    variables : tuple of pairs of str
        What stands where in a file of arrays, such as ``("frf", "yspec")``.
    """

    path: Path
    quantity: FrfQuantity
    unit: str = ""
    output_dofs: tuple[AnyDof, ...] = ()
    input_dofs: tuple[AnyDof, ...] = ()
    columns: tuple[str, ...] = ()
    skip_rows: int = 0
    direction: str = ""
    sets: tuple[int, ...] = ()
    is_conjugated: bool = False
    is_reciprocal: bool = False
    force_dof: AnyDof | None = None
    reference: FrfSource | None = None
    level_N: float | None = None  # noqa: N815  a unit
    variables: tuple[tuple[str, str], ...] = ()

    @property
    def output_dof(self) -> AnyDof | None:
        """The one output, where there is one."""
        return self.output_dofs[0] if len(self.output_dofs) == 1 else None

    @property
    def input_dof(self) -> AnyDof | None:
        """The one input, where there is one."""
        return self.input_dofs[0] if len(self.input_dofs) == 1 else None


@dataclass(frozen=True, slots=True, kw_only=True)
class FrfContents:
    """What a file of FRFs holds, for `init`.

    Parameters
    ----------
    n_outputs, n_inputs : int
        How many.
    ends : tuple of pairs of AnyDof
        What each FRF connects; empty where the file does not say.
    quantity : FrfQuantity, optional
        Where the file says it.
    unit : str
        What the file says; may be empty.
    about : str
        How it was found, where that had to be chosen.
    lacks_directions : bool
        Nodes are named without directions.
    arrays : tuple of str
        Arrays of a file that holds several, each with its own FRFs.
    """

    n_outputs: int
    n_inputs: int
    ends: tuple[tuple[AnyDof, AnyDof], ...] = ()
    quantity: FrfQuantity | None = None
    unit: str = ""
    about: str = ""
    lacks_directions: bool = False
    arrays: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MeasuredFrf:
    """One FRF of a file, in the file's units.

    Parameters
    ----------
    source : FrfSource
        Where it comes from.
    output_dof, input_dof : Dof or PortDof
        What it connects.
    frequency_hz : (n_lines,) array
        Ascending, Hz.
    values : (n_lines,) complex array
        In `unit`.
    unit : str
        Unit that the file states; empty where it states none.
    is_level : bool
        The values were levels in decibels, relative to that unit.
    coherence, variance : (n_lines,) array, optional
        Where the file has them; the variance is in the square of the unit.
    notes : tuple of str
        What the user has to know of how it was read.
    """

    source: FrfSource
    output_dof: AnyDof
    input_dof: AnyDof
    frequency_hz: FloatArray
    values: ComplexArray
    unit: str = ""
    is_level: bool = False
    coherence: FloatArray | None = None
    variance: FloatArray | None = None
    notes: tuple[str, ...] = ()

    @property
    def label(self) -> FrfLabel:
        """What it connects, and what it is."""
        return frf_label(self.output_dof, self.input_dof, self.source.quantity)


def frf_label(output_dof: AnyDof, input_dof: AnyDof, quantity: FrfQuantity) -> FrfLabel:
    """Name an FRF that was estimated elsewhere; its channels are called after its DOFs.

    Parameters
    ----------
    output_dof, input_dof : Dof or PortDof
        What it connects.
    quantity : FrfQuantity
        What it is.

    Returns
    -------
    FrfLabel
        The label.
    """
    return FrfLabel(output_dof, input_dof, quantity, f"output {output_dof}", f"input {input_dof}")


@runtime_checkable
class FrfFormat(Protocol):
    """A format of files with FRFs.

    Attributes
    ----------
    rank : int
        Formats are asked in ascending order whether a file is theirs.
    """

    rank: int

    def holds(self, source: FrfSource, head: bytes) -> bool:
        """Tell whether a file is of this format.

        Parameters
        ----------
        source : FrfSource
            The file as the test describes it.
        head : bytes
            Its first bytes.

        Returns
        -------
        bool
            True if it is.
        """

    def read(self, source: FrfSource) -> tuple[MeasuredFrf, ...]:
        """Read all its FRFs.

        Parameters
        ----------
        source : FrfSource
            The file as the test describes it.

        Returns
        -------
        tuple of MeasuredFrf
            At least one.

        Raises
        ------
        FileFormatError
            If it is none, or does not say what its FRFs connect.
        """

    def look(self, source: FrfSource) -> FrfContents:
        """Say what a file holds.

        Parameters
        ----------
        source : FrfSource
            The file; nothing is known of it yet.

        Returns
        -------
        FrfContents
            How many FRFs, and what they connect.

        Raises
        ------
        FileFormatError
            If it holds no FRFs.
        """


def undefined_at_rest(columns: dict[str, FloatArray]) -> BoolArray:
    """Find lines at 0 Hz that are not finite, as those of an integrated motion: they are to be left out.

    Parameters
    ----------
    columns : dict of str to (n_lines,) array
        ``frequency_hz`` and the numbers of each line.

    Returns
    -------
    (n_lines,) bool array
        True for such a line.
    """
    is_finite = np.isfinite(np.column_stack(list(columns.values()))).all(axis=1)
    return np.asarray(~is_finite & (columns["frequency_hz"] == 0.0))


def note_at_rest(source: FrfSource, output_dof: AnyDof, input_dof: AnyDof, left_out: BoolArray) -> tuple[str, ...]:
    """Say that the line at 0 Hz is left out.

    Parameters
    ----------
    source : FrfSource
        The file.
    output_dof, input_dof : Dof or PortDof
        What the FRF connects.
    left_out : (n_lines,) bool array
        Lines that are.

    Returns
    -------
    tuple of str
        Empty where none is.
    """
    note = f"{source.path.name}: the line at 0 Hz of {output_dof} / {input_dof} is not finite: left out"
    return (note,) if left_out.any() else ()
