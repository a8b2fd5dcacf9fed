"""How long computations report their progress, without knowing who shows it."""

from __future__ import annotations

from typing import Protocol


class Progress(Protocol):
    """Called now and then by a long computation.

    Examples
    --------
    >>> import frf_ipz
    >>> def report(fraction: float, text: str) -> None:
    ...     print(f"{fraction:.0%} {text}")
    >>> progress: frf_ipz.Progress = report
    >>> progress(0.5, "fitting")
    50% fitting
    """

    def __call__(self, fraction: float, text: str) -> None:
        """Report the progress.

        Parameters
        ----------
        fraction : float
            The part that is done, 0 to 1.
        text : str
            What is being done.
        """


def silent(fraction: float, text: str) -> None:
    """Ignore the progress.

    Parameters
    ----------
    fraction : float
        Ignored.
    text : str
        Ignored.
    """
    del fraction, text
