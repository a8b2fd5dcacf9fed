"""What a user may choose in ``[reduce]`` of a pipeline."""

from __future__ import annotations

from dataclasses import dataclass

from frf_ipz.option_types import Count
from frf_ipz.toml_files import STRICT, check_values


@dataclass(frozen=True, slots=True, kw_only=True)
class ReduceOptions:
    """How the FE model is reduced.

    Parameters
    ----------
    modes : int, optional
        Eigenmodes of the basis, rigid-body modes included; by default those up to 2.5 times the band, and more where
        DOFs need them.
    dofs : tuple of str
        DOFs to retain, as many as modes and residual vectors; by default chosen so that the modes are well conditioned.
    residual_flexibility : tuple of str, optional
        DOFs whose residual flexibility joins the basis; by default the actuators, or the sensors and points where these
        are fewer, and DOFs with dampers.

    Examples
    --------
    >>> import frf_ipz
    >>> frf_ipz.ReduceOptions(modes=5, residual_flexibility=("101:z",))
    ReduceOptions(modes=5, dofs=(), residual_flexibility=('101:z',))
    """

    __pydantic_config__ = STRICT

    modes: Count | None = None
    dofs: tuple[str, ...] = ()
    residual_flexibility: tuple[str, ...] | None = None

    def __post_init__(self) -> None:
        check_values(self)
