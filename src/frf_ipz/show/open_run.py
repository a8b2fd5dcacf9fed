"""Results in memory: those of the run that somebody looks at, and of no other."""

from __future__ import annotations

from threading import Lock
from typing import TYPE_CHECKING

from frf_ipz.runs.results import open_results

if TYPE_CHECKING:
    from pathlib import Path

    from frf_ipz.runs.results import Results


class OpenRun:
    """Keeps the results that were looked at last; others are read again when they are looked at."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._place: tuple[Path, str] | None = None
        self._results: Results | None = None

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
                self._results = None  # before others are read: never two at a time
                self._results, self._place = open_results(folder).load(), (folder, stamp)
            return self._results
