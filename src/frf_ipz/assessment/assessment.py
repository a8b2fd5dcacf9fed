"""What an assessment says: the verdict, its checks, and what most likely has to be corrected."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class LikelyCause:
    """What a user most likely has to correct.

    Parameters
    ----------
    says : str
        The mistake, and what to write instead.
    file : str
        The file in which it stands.
    line_or_key : str
        The key or line in it.
    probability : float
        That it is this, given what was measured.
    """

    says: str
    file: str
    line_or_key: str
    probability: float
