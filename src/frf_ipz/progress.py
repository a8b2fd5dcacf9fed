"""How long work tells how far it is, without knowing who listens."""

from __future__ import annotations

from typing import Protocol


class Progress(Protocol):
    """Called now and then by long work."""

    def __call__(self, fraction: float, text: str) -> None:
        """Take note.

        Parameters
        ----------
        fraction : float
            The part that is done, 0 to 1.
        text : str
            What is being done.
        """


def silent(fraction: float, text: str) -> None:
    """Listen to nothing.

    Parameters
    ----------
    fraction : float
        Ignored.
    text : str
        Ignored.
    """
    del fraction, text
