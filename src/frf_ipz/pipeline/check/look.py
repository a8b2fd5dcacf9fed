"""What a look at a part of the set-up gives: lines that state what is there, and what should be looked at."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """What was seen of a part of the set-up.

    Parameters
    ----------
    lines : tuple of str
        What is there.
    open_points : tuple of str
        What is likely wrong or has not been decided yet, each with its place.
    """

    lines: tuple[str, ...] = ()
    open_points: tuple[str, ...] = ()
