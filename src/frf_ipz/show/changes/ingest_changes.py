"""Blows and sensors: ``[ingest]``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from frf_ipz.dofs import parse_dof
from frf_ipz.ingest.survey.selection import is_named
from frf_ipz.show.changes.change import append_entry, remove_entries, section_of
from frf_ipz.toml_files import STRICT

if TYPE_CHECKING:
    from tomlkit import TOMLDocument


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordChoice:
    """A blow is used, or left out, whatever the checks say.

    Parameters
    ----------
    name : str
        As in the table of blows.
    use : str
        ``keep``, ``drop``, or ``checks`` to leave it to the checks.
    """

    __pydantic_config__ = STRICT

    name: str
    use: Literal["keep", "drop", "checks"]

    def apply(self, document: TOMLDocument) -> None:
        """Write it into ``[ingest] keep`` or ``drop``.

        Parameters
        ----------
        document : TOMLDocument
            The file; changed in place.
        """
        ingest = section_of(document, "ingest")
        for key in ("keep", "drop"):
            remove_entries(ingest, key, lambda entry: is_named(self.name, [entry]))
        if self.use != "checks":
            append_entry(ingest, self.use, self.name)


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensor:
    """What a sensor measured is left out.

    Parameters
    ----------
    dof : str
        Label of its DOF.
    on : bool
        False to take the wish back.
    """

    __pydantic_config__ = STRICT

    dof: str
    on: bool = True

    def apply(self, document: TOMLDocument) -> None:
        """Write it into ``[ingest] hide``.

        Parameters
        ----------
        document : TOMLDocument
            The file; changed in place.

        Raises
        ------
        InputError
            If it is no label of a DOF.
        """
        sensor = parse_dof(self.dof)
        ingest = section_of(document, "ingest")
        remove_entries(ingest, "hide", lambda entry: parse_dof(entry).unsigned == sensor.unsigned)
        if self.on:
            append_entry(ingest, "hide", str(sensor))
