"""What a user may choose in ``[reduce]`` of a pipeline."""

from __future__ import annotations

from dataclasses import dataclass

from frf_ipz.toml_files import STRICT


@dataclass(frozen=True, slots=True, kw_only=True)
class ReduceOptions:
    """How the FE model is reduced.

    Parameters
    ----------
    modes : int, optional
        Eigenmodes to keep, rigid-body modes included; where it is left out those of the band, and what the residual
        terms need.
    dofs : tuple of str
        DOFs to retain, as many as modes and residual vectors; chosen well conditioned where it is left out.
    residual_flexibility : tuple of str, optional
        DOFs whose residual flexibility joins the basis; the actuators where it is left out.
    """

    __pydantic_config__ = STRICT

    modes: int | None = None
    dofs: tuple[str, ...] = ()
    residual_flexibility: tuple[str, ...] | None = None
