"""Records of Fortran's unformatted files: each has its length before and behind it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from frf_ipz.errors import FileFormatError

if TYPE_CHECKING:
    from pathlib import Path

LONGEST_FIRST = 48  # bytes of the first record that Nastran writes: more where bytes stand in the other order


def check_records(path: Path, content: bytes) -> None:
    """Check that records end where their length says: a reader that goes by it alone may go back, for ever.

    Parameters
    ----------
    path : Path
        The file.
    content : bytes
        All of it.

    Raises
    ------
    FileFormatError
        If a record does not end as it began.
    """
    order: Literal["little", "big"] = "little" if int.from_bytes(content[:4], "little") <= LONGEST_FIRST else "big"
    place = 0
    while place < len(content):
        end = place + 4 + int.from_bytes(content[place : place + 4], order)
        if content[place : place + 4] != content[end : end + 4]:
            raise FileFormatError(path, f"has no record of the length that stands at byte {place}; is it damaged?")
        place = end + 4
