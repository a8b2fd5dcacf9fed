"""What a user may choose in ``[predict]`` of a pipeline."""

from __future__ import annotations

from dataclasses import dataclass

from frf_ipz.toml_files import STRICT, check_values


@dataclass(frozen=True, slots=True, kw_only=True)
class PredictOptions:
    """Where FRFs are predicted.

    Parameters
    ----------
    points : tuple of str
        Points of interest as DOF labels, which need no measurement; may be empty.
    reference : str, optional
        File of FRFs measured at the points of interest: the report compares the prediction with them, and nothing else
        uses them.

    Examples
    --------
    >>> import frf_ipz
    >>> frf_ipz.PredictOptions(points=("49:+z",)).points
    ('49:+z',)
    """

    __pydantic_config__ = STRICT

    points: tuple[str, ...] = ()
    reference: str | None = None

    def __post_init__(self) -> None:
        check_values(self)
