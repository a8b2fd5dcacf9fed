"""What every change is, and the entries of ``pipeline.toml`` that it adds and removes; comments and order stay."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

import tomlkit
from tomlkit.items import AoT

if TYPE_CHECKING:
    from collections.abc import Callable

    from tomlkit import TOMLDocument

Section: TypeAlias = "Any"  # tomlkit's containers share no type that tells what they can do


class Change(Protocol):
    """One wish of the user's."""

    def apply(self, document: TOMLDocument) -> None:
        """Write it into a pipeline file.

        Parameters
        ----------
        document : TOMLDocument
            The file; changed in place.
        """


def section_of(document: TOMLDocument, name: str) -> Section:
    """Give a section of a pipeline file; it is made where there is none.

    Parameters
    ----------
    document : TOMLDocument
        The file.
    name : str
        The section.

    Returns
    -------
    Section
        To change in place.
    """
    if name not in document:
        document.add(tomlkit.nl())
        document.add(name, tomlkit.table())
    return document[name]


def append_entry(section: Section, key: str, entry: Any) -> None:  # noqa: ANN401  a number, a text, a pair or a table
    """Add an entry to a list.

    Parameters
    ----------
    section : Section
        Where the list is, or will be.
    key : str
        Its name.
    entry : number, text, pair or table
        What is added.
    """
    if key not in section:
        section.add(key, tomlkit.array())
    entries = section[key]
    if isinstance(entries, AoT):
        entries.append(tomlkit.item(dict(entry)))
    else:
        entries.append(entry)


def remove_entries(section: Section, key: str, fits: Callable[[Any], bool]) -> None:
    """Take entries out of a list, and the key with the last one of them.

    Parameters
    ----------
    section : Section
        Where the list is.
    key : str
        Its name.
    fits : callable
        Tells which entries go.
    """
    entries = section.get(key, [])
    found = [place for place, entry in enumerate(entries) if fits(entry)]
    for place in reversed(found):
        del entries[place]
    if found and not len(entries):
        section.pop(key)
