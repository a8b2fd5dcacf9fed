"""Keys that every ``model.toml`` has, whatever its kind of model; and the types of numbers in it."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from frf_ipz.option_types import Finite, Name, NotNegative, Ratio
from frf_ipz.toml_files import STRICT
from frf_ipz.unit_systems import SI, UnitSystem


def _as_list(value: Any) -> Any:  # noqa: ANN401 - any content of the file; the type behind it checks
    return value if isinstance(value, list | tuple) else [value]


Ratios = Annotated[tuple[Ratio, ...], BeforeValidator(_as_list), Field(min_length=1)]


@dataclass(frozen=True, slots=True, kw_only=True)
class UnitTable:
    """``units = { length, mass, time }``.

    Parameters
    ----------
    length, mass, time : str
        Units as pint reads them.
    """

    __pydantic_config__ = STRICT

    length: Name = "m"
    mass: Name = "kg"
    time: Name = "s"


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
    units : str or UnitTable
        What all numbers of the model are in, coordinates and matrices included: ``SI``, ``mm-t-s``, ``mm-kg-ms``,
        ``cm-g-s``, ``in-lbf-s``, or a table such as ``{ length = "mm", mass = "t", time = "s" }`` in units that pint
        reads. A key that ends in a unit of SI is then in the unit of this system; ``[[port]]`` stays in SI.

    Raises
    ------
    ValueError
        If there is no such system, or a unit cannot be read.
    """

    __pydantic_config__ = STRICT

    kind: Name
    name: Name = "model"
    units: str | UnitTable = SI

    def __post_init__(self) -> None:
        _ = self.system

    @property
    def system(self) -> UnitSystem:
        """The system of units."""
        return UnitSystem.of(self.units if isinstance(self.units, str) else asdict(self.units))


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
    """``[damping]``: one of its keys.

    Parameters
    ----------
    modal_ratio : tuple of float
        Damping ratios of the modes that are no rigid-body motion, by ascending frequency; the last one holds for all
        further modes, so that one number is one ratio for all.
    rayleigh : RayleighDamping, optional
        Damping matrix made of mass and stiffness.
    loss_factor : float, optional
        eta of a stiffness K (1 + i eta): a damping ratio of eta / 2 for all modes, which is right at each resonance.

    Raises
    ------
    ValueError
        If none is given, or more than one.
    """

    __pydantic_config__ = STRICT

    modal_ratio: Ratios = ()
    rayleigh: RayleighDamping | None = None
    loss_factor: Ratio | None = None

    def __post_init__(self) -> None:
        if bool(self.modal_ratio) + (self.rayleigh is not None) + (self.loss_factor is not None) != 1:
            raise ValueError(
                "needs exactly one of modal_ratio, rayleigh and loss_factor; leave the section out for no damping"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class PortSection:
    """``[[port]]``: an input or output that is no single DOF. Either `dofs` and `unit`, or `point_m` and `direction`.

    Parameters
    ----------
    name : str
        May stand wherever a DOF label may; no colon, no sign at its beginning.
    dofs : mapping of str to float
        Weight of each DOF, SI whatever the units of the model.
    unit : str, optional
        ``m`` or ``rad``; with a point it follows from the direction.
    point_m : (3,) tuple of float, optional
        A point of the mesh, m, where the motion is interpolated from the nodes around.
    direction : str or (3,) tuple of float
        ``x``, ``y``, ``z``, a rotation ``rx``, ``ry``, ``rz``, with a sign or without, or a vector along which the
        motion is measured.

    Raises
    ------
    ValueError
        If it is neither a sum of DOFs nor a point.
    """

    __pydantic_config__ = STRICT

    name: Name
    dofs: dict[str, Finite] | None = None
    unit: Literal["m", "rad"] | None = None
    point_m: tuple[Finite, Finite, Finite] | None = None
    direction: str | tuple[Finite, Finite, Finite] | None = None

    def __post_init__(self) -> None:
        if (self.dofs is None) == (self.point_m is None):
            raise ValueError("needs either dofs or point_m")
        if self.dofs is not None and self.unit is None:
            raise ValueError("needs a unit beside dofs: m, or rad for an angle")
        if (self.point_m is None) != (self.direction is None):
            raise ValueError("needs point_m and direction together, and neither beside dofs")
