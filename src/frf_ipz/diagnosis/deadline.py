"""The time that a search may take: looked at between hypotheses, so that what was found until then is kept."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field


class DeadlineError(Exception):
    """The time of a search is over; whoever holds what was found so far goes on with that."""


def _go_on() -> None:
    """Say nothing."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Deadline:
    """A moment after which no further hypothesis is tried.

    Parameters
    ----------
    seconds : float, optional
        Wall time from now, s; no limit where it is left out.
    clock : callable
        Gives the time, s.
    at_check : callable
        Called between hypotheses; what it raises ends the search, and nothing is kept.
    """

    seconds: float | None = None
    clock: Callable[[], float] = time.monotonic
    at_check: Callable[[], None] = _go_on
    _started: float = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_started", self.clock())

    @property
    def is_over(self) -> bool:
        """True once the time is over."""
        return self.seconds is not None and self.clock() - self._started > self.seconds

    def check(self) -> None:
        """Go on while there is time, and somebody waits.

        Raises
        ------
        DeadlineError
            If there is none.
        """
        self.at_check()
        if self.is_over:
            raise DeadlineError


NO_LIMIT = Deadline()
