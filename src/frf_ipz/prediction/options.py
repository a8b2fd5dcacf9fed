"""What a user may choose in ``[predict]`` of a pipeline."""

from __future__ import annotations

from dataclasses import dataclass

from frf_ipz.toml_files import STRICT


@dataclass(frozen=True, slots=True, kw_only=True)
class PredictOptions:
    """Where FRFs are predicted.

    Parameters
    ----------
    points : tuple of str
        Points of interest as DOF labels: never measured; may be empty.
    """

    __pydantic_config__ = STRICT

    points: tuple[str, ...] = ()
