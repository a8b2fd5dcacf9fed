"""Nodes and elements as texts: what all decks share."""

from __future__ import annotations

from typing import TYPE_CHECKING

from frf_ipz.errors import FileFormatError, InputError
from frf_ipz.text_numbers import parse_number

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

LONGEST_NUMBER = 18  # digits


def read_node(path: Path, line: int, text: str) -> int:
    """Read the number of a node.

    Parameters
    ----------
    path : Path
        The file, for messages.
    line : int
        Line of it, from 1.
    text : str
        What stands there.

    Returns
    -------
    int
        Not negative.

    Raises
    ------
    FileFormatError
        If it is none.
    """
    node = text.strip()
    if not (node.isascii() and node.isdecimal() and len(node) <= LONGEST_NUMBER):
        raise FileFormatError(path, f"'{node[:40]}' is no node number", where=f"line {line}")
    return int(node)


def read_position(path: Path, line: int, texts: Sequence[str]) -> tuple[float, float, float]:
    """Read where a node is.

    Parameters
    ----------
    path : Path
        The file, for messages.
    line : int
        Line of it, from 1.
    texts : sequence of str
        Three coordinates; one that is empty or missing is 0.

    Returns
    -------
    (3,) tuple of float
        In the file's unit.

    Raises
    ------
    FileFormatError
        If one is no number.
    """
    try:
        x, y, z = (parse_number(text.strip()) if text.strip() else 0.0 for text in (*texts, "", "", "")[:3])
    except InputError as error:
        raise FileFormatError(path, str(error), where=f"line {line}") from None
    return x, y, z
