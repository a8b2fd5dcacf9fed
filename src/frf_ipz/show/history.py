"""What the pipeline file said before each change that was made on the page, and after it: to undo and to redo."""

from __future__ import annotations


class History:
    """Texts of a file, in the order in which the page has written them.

    It ends where another program changes the file: what that has written is never undone.

    Examples
    --------
    >>> history = History()
    >>> history.record("a", "b")
    >>> history.before("b")
    'a'
    >>> history.before("written by an editor")
    """

    def __init__(self) -> None:
        self._texts: list[str] = []
        self._place = 0

    def record(self, text: str, changed: str) -> None:
        """Add a change; what was undone before it is forgotten.

        Parameters
        ----------
        text, changed : str
            What the file said, and what it says from now on.
        """
        self._texts = [*self._texts[: self._place + 1], changed] if self._is_here(text) else [text, changed]
        self._place = len(self._texts) - 1

    def before(self, text: str) -> str | None:
        """Give what the file said before the last change.

        Parameters
        ----------
        text : str
            What it says.

        Returns
        -------
        str or None
            None where there is nothing to undo, or another program has changed it.
        """
        return self._texts[self._place - 1] if self._is_here(text) and self._place > 0 else None

    def after(self, text: str) -> str | None:
        """Give what the file said before the last change was undone.

        Parameters
        ----------
        text : str
            What it says.

        Returns
        -------
        str or None
            None where there is nothing to redo, or another program has changed it.
        """
        is_last = self._place + 1 >= len(self._texts)
        return None if is_last or not self._is_here(text) else self._texts[self._place + 1]

    def step(self, by: int) -> None:
        """Note that a change was undone or redone.

        Parameters
        ----------
        by : int
            -1 for undone, 1 for redone.
        """
        self._place += by

    def take_back(self, text: str) -> None:
        """Forget changes that were refused.

        Parameters
        ----------
        text : str
            What the file said before them, and says again.
        """
        kept = [place for place, known in enumerate(self._texts[: self._place + 1]) if known == text]
        if kept:
            self._texts = self._texts[: kept[-1] + 1]
            self._place = kept[-1]
        else:  # it was an undo that was refused
            self._texts, self._place = [text], 0

    def _is_here(self, text: str) -> bool:
        return bool(self._texts) and self._texts[self._place] == text
