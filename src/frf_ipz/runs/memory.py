"""A run that is kept in memory: for arrays that came from no file, and results that nobody wants on disk."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from frf_ipz.runs.folder import Writers

Result = TypeVar("Result")


@dataclass(kw_only=True, eq=False)
class RunMemory:
    """Results of stages by name, with the interface of a `RunFolder`; the files that users read are not written.

    Parameters
    ----------
    manifest : dict
        What `run.json` would say.
    results : dict of str to object
        Results of stages.
    computed : list of str
        Stages that have been computed.
    """

    manifest: dict[str, Any] = field(default_factory=dict)
    results: dict[str, Any] = field(default_factory=dict)
    computed: list[str] = field(default_factory=list)

    @property
    def name(self) -> str:
        """Where the results are, for people."""
        return "in memory"

    def stage(self, name: str, key: str, compute: Callable[[], Result], files: Callable[[Result], Writers]) -> Result:
        """Compute a stage and keep its result.

        Parameters
        ----------
        name : str
            The stage.
        key : str
            Digest of all that the result depends on.
        compute : callable
            Gives the result.
        files : callable
            Not used.

        Returns
        -------
        object
            The result.
        """
        del files
        started = time.perf_counter()
        result = compute()
        self.results[name] = result
        self.computed.append(name)
        seconds = round(time.perf_counter() - started, 3)
        self.manifest.setdefault("stages", {})[name] = {"key": key, "seconds": seconds, "files": []}
        return result

    def page(self, name: str, key: str, files: Writers) -> None:
        """Write nothing: there is no folder.

        Parameters
        ----------
        name, key, files
            Not used.
        """
        del name, key, files

    def load(self, name: str) -> Any:  # noqa: ANN401  every stage has a result of its own type
        """Give a stage's result.

        Parameters
        ----------
        name : str
            The stage.

        Returns
        -------
        object
            The result, or None where the stage has not run.
        """
        return self.results.get(name)

    def mark_stale(self, names: Iterable[str]) -> None:
        """Mark nothing: every stage is computed in its turn.

        Parameters
        ----------
        names : iterable of str
            Not used.
        """
        del names

    def is_stale(self, name: str) -> bool:
        """Tell that no result is out of date.

        Parameters
        ----------
        name : str
            Not used.

        Returns
        -------
        bool
            False.
        """
        del name
        return False
