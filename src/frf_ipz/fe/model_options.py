"""Keys that every ``model.toml`` has, whatever its kind of model; and the types of numbers in it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from frf_ipz.option_types import Name, NotNegative, Ratio
from frf_ipz.toml_files import STRICT


def _as_list(value: Any) -> Any:  # noqa: ANN401 - any content of the file; the type behind it checks
    return value if isinstance(value, list | tuple) else [value]


Ratios = Annotated[tuple[Ratio, ...], BeforeValidator(_as_list), Field(min_length=1)]


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelSection:
    """``[model]``: what it is.

    Parameters
    ----------
    kind : str
        Kind of model, which determines the rest of the file: ``beam``, ``lumped``, ``matrices``, or a module that was
        added to `fe.kinds`.
    name : str
        As the user calls it.
    """

    __pydantic_config__ = STRICT

    kind: Name
    name: Name = "model"


@dataclass(frozen=True, slots=True, kw_only=True)
class RayleighDamping:
    """``rayleigh = { alpha_1_s, beta_s }``: the damping matrix is alpha M + beta K.

    Parameters
    ----------
    alpha_1_s : float
        Factor on the mass matrix.
    beta_s : float
        Factor on the stiffness matrix.
    """

    __pydantic_config__ = STRICT

    alpha_1_s: NotNegative = 0.0
    beta_s: NotNegative = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class DampingSection:
    """``[damping]``: one of its two keys.

    Parameters
    ----------
    modal_ratio : tuple of float
        Damping ratios of the modes that are no rigid-body motion, by ascending frequency; the last one holds for all
        further modes, so that one number is one ratio for all.
    rayleigh : RayleighDamping, optional
        Damping matrix made of mass and stiffness.

    Raises
    ------
    ValueError
        If both are given, or none.
    """

    __pydantic_config__ = STRICT

    modal_ratio: Ratios = ()
    rayleigh: RayleighDamping | None = None

    def __post_init__(self) -> None:
        if bool(self.modal_ratio) == (self.rayleigh is not None):
            raise ValueError("needs exactly one of modal_ratio and rayleigh; leave the section out for no damping")
