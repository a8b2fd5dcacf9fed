"""Points of interest and retained DOFs: ``[predict]`` and ``[reduce]``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from frf_ipz.dofs import parse_dof
from frf_ipz.errors import InputError
from frf_ipz.show.changes.change import append_entry, remove_entries, section_of
from frf_ipz.toml_files import STRICT

if TYPE_CHECKING:
    from tomlkit import TOMLDocument


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """The FRFs at a DOF are wanted.

    Parameters
    ----------
    dof : str
        Its label.
    on : bool
        False to take the wish back.
    """

    __pydantic_config__ = STRICT

    dof: str
    on: bool = True

    def apply(self, document: TOMLDocument) -> None:
        """Write it into ``[predict] points``.

        Parameters
        ----------
        document : TOMLDocument
            The file; changed in place.

        Raises
        ------
        InputError
            If it is no label of a DOF.
        """
        wanted = parse_dof(self.dof)
        predict = section_of(document, "predict")
        remove_entries(predict, "points", lambda entry: parse_dof(entry) == wanted)
        if self.on:
            append_entry(predict, "points", str(wanted))


@dataclass(frozen=True, slots=True, kw_only=True)
class Retain:
    """The model is reduced to these DOFs.

    Parameters
    ----------
    dofs : tuple of str
        Their labels; signs do not matter.
    on : bool
        False to let the program choose.
    """

    __pydantic_config__ = STRICT

    dofs: tuple[str, ...] = ()
    on: bool = True

    def apply(self, document: TOMLDocument) -> None:
        """Write it into ``[reduce] dofs``.

        Parameters
        ----------
        document : TOMLDocument
            The file; changed in place.

        Raises
        ------
        InputError
            If none is named, or one is no label of a DOF.
        """
        names = list(dict.fromkeys(parse_dof(text).name for text in self.dofs))
        reduce = section_of(document, "reduce")
        if self.on and not names:
            raise InputError("name the DOFs to reduce to, or take the choice back to leave it to the program")
        if self.on:
            reduce["dofs"] = names
        else:
            reduce.pop("dofs", None)
