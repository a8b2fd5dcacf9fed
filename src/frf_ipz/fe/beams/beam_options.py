"""What ``[beam]`` of a ``model.toml`` may say."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from frf_ipz.fe.model_options import Count, DampingSection, ModelSection, Node, NotNegative, Positive
from frf_ipz.toml_files import STRICT

MAX_ELEMENTS = 100_000  # beyond, rounding in a beam's stiffness leaves no digit of the first modes

End = Literal["clamped", "pinned", "sliding", "free"]
Formulation = Literal["timoshenko", "euler-bernoulli"]
PoissonRatio = Annotated[float, Field(gt=-1, le=0.5, allow_inf_nan=False, strict=True)]
NumberOfElements = Annotated[int, Field(ge=1, le=MAX_ELEMENTS, strict=True)]


@dataclass(frozen=True, slots=True, kw_only=True)
class BeamSection:
    """``[[beam.section]]``: another cross-section for some elements.

    Parameters
    ----------
    elements : pair of int
        First and last element, both included.
    thickness_m, width_m : float, optional
        m; that of the beam where it is left out.
    """

    __pydantic_config__ = STRICT

    elements: tuple[Count, Count]
    thickness_m: Positive | None = None
    width_m: Positive | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class BeamPointMass:
    """``[[beam.point_mass]]``: a mass at a node.

    Parameters
    ----------
    node : int
        Where.
    mass_kg, rotary_inertia_kgm2 : float
        kg and kg m^2.
    """

    __pydantic_config__ = STRICT

    node: Node
    mass_kg: NotNegative
    rotary_inertia_kgm2: NotNegative = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class BeamPointSpring:
    """``[[beam.point_spring]]``: a spring between a node and the ground.

    Parameters
    ----------
    node : int
        Where.
    stiffness_N_m, rotational_stiffness_Nm_rad : float
        N/m and N m/rad.
    """

    __pydantic_config__ = STRICT

    node: Node
    stiffness_N_m: NotNegative = 0.0  # noqa: N815 - the contract's key
    rotational_stiffness_Nm_rad: NotNegative = 0.0  # noqa: N815 - the contract's key


@dataclass(frozen=True, slots=True, kw_only=True)
class BeamOptions:
    """``[beam]``.

    Parameters
    ----------
    length_m, width_m, thickness_m : float
        m; the beam bends about its width.
    elements : int
        Elements of equal length; nodes are 1 to elements + 1 from the left.
    formulation : str
        ``timoshenko`` or ``euler-bernoulli``.
    youngs_modulus_Pa, density_kg_m3, poisson_ratio : float
        Material. Poisson's ratio matters for Timoshenko only; 0.3 stands for a metal.
    left, right : str
        How an end is held: ``clamped`` (z, ry), ``pinned`` (z), ``sliding`` (ry) or ``free``.
    section : tuple of BeamSection
        Other cross-sections.
    point_mass : tuple of BeamPointMass
        Masses at nodes.
    point_spring : tuple of BeamPointSpring
        Springs to the ground.
    """

    __pydantic_config__ = STRICT

    length_m: Positive
    elements: NumberOfElements
    youngs_modulus_Pa: Positive  # noqa: N815 - the contract's key
    density_kg_m3: Positive
    width_m: Positive
    thickness_m: Positive
    formulation: Formulation = "timoshenko"
    poisson_ratio: PoissonRatio = 0.3
    left: End = "free"
    right: End = "free"
    section: tuple[BeamSection, ...] = ()
    point_mass: tuple[BeamPointMass, ...] = ()
    point_spring: tuple[BeamPointSpring, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class BeamFile:
    """A whole ``model.toml`` of a beam.

    Parameters
    ----------
    model : ModelSection
        ``[model]``.
    beam : BeamOptions
        ``[beam]``.
    damping : DampingSection, optional
        ``[damping]``.
    """

    __pydantic_config__ = STRICT

    model: ModelSection
    beam: BeamOptions
    damping: DampingSection | None = None
