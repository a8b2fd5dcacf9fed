"""Results in memory: those of the run that somebody looks at, and of no other; of those before them, one curve."""

from __future__ import annotations

from threading import Lock
from typing import TYPE_CHECKING

from frf_ipz.runs.results import open_results
from frf_ipz.show.ghost import Ghost

if TYPE_CHECKING:
    from pathlib import Path

    from frf_ipz.runs.results import Results


class OpenRun:
    """Keeps the results that were looked at last; others are read again when they are looked at."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._place: tuple[Path, str] | None = None
        self._results: Results | None = None
        self._ghost: Ghost | None = None

    def results(self, folder: Path, stamp: str) -> Results:
        """Give the results in a folder.

        Parameters
        ----------
        folder : Path
            The run's folder.
        stamp : str
            Another one whenever the folder holds other results.

        Returns
        -------
        Results
            Results of all stages.

        Raises
        ------
        InputError
            If there is no run yet, or a file is damaged.
        """
        with self._lock:
            if self._results is None or self._place != (folder, stamp):
                before = self._results if self._place is not None and self._place[0] == folder else None
                self._ghost = None if before is None else Ghost.of(before)
                del before
                self._results = None  # before others are read: never two at a time
                self._results, self._place = open_results(folder).load(), (folder, stamp)
            return self._results

    def ghost(self, folder: Path) -> Ghost | None:
        """Give what the run predicted before its results were made anew.

        Parameters
        ----------
        folder : Path
            The run's folder.

        Returns
        -------
        Ghost or None
            None where it is another run than that of `results`, or was not looked at before.
        """
        with self._lock:
            return self._ghost if self._place is not None and self._place[0] == folder else None
