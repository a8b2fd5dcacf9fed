"""How a real structure differs from its drawing."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from frf_testbench.simulator.structures.structure import Point, Structure

FloatArray = NDArray[np.float64]
PartKey = tuple[int, int] | str  # [first, last] element of a beam, the id of a spring, the name of a group


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Variation:
    """A field around 1: what a user cannot know about stiffness or mass.

    Parameters
    ----------
    cosines : (n_xi, n_eta) array
        Amplitudes of cos(j pi xi) cos(k pi eta) over the structure.
    parts : (n_parts,) array
        Deviations of single parts (springs, members, point masses) from 1.
    """

    cosines: FloatArray = field(default_factory=lambda: np.zeros((1, 1)))
    parts: FloatArray = field(default_factory=lambda: np.zeros(0))

    def __call__(self, xi: FloatArray, eta: FloatArray | float = 0.0, *, part: int | None = None) -> FloatArray:
        """Return the factor at normalised positions 0..1, within a part."""
        total = np.ones(np.broadcast(xi, eta).shape)
        for (j, k), amplitude in np.ndenumerate(self.cosines):
            total += amplitude * np.cos(j * np.pi * np.asarray(xi)) * np.cos(k * np.pi * np.asarray(eta))
        return total + (self.parts[part] if part is not None and self.parts.size else 0.0)

    def scaled(self, factor: float) -> Variation:
        """Return the same field with smaller or larger deviations."""
        return Variation(cosines=factor * self.cosines, parts=factor * self.parts)


@dataclass(frozen=True, slots=True, kw_only=True)
class Extra:
    """A mass or a spring that the drawing lacks.

    Parameters
    ----------
    point : Point
        Where it sits.
    mass : float
        kg, or kg m^2 on a rotation.
    stiffness : float
        N/m, or N m/rad on a rotation; to the ground, or to `second_point`.
    second_point : Point, optional
        Second end of the spring.
    """

    point: Point
    mass: float = 0.0
    stiffness: float = 0.0
    second_point: Point | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reality:
    """What is different from the drawing.

    Parameters
    ----------
    stiffness, density : Variation
        Fields around 1.
    stiffness_ratio : float
        Real over drawn stiffness of the whole structure.
    softened : tuple of (key, ratio)
        Parts, and real over drawn stiffness; masses stay.
    formulation : str, optional
        The real one of a beam, where it is not that of the drawing.
    axial_load_n : float
        Of a beam, tension positive.
    released : dict of str to (rotational, translational)
        Springs of a beam's end instead of its held motions, N m/rad and N/m; None where a motion stays held.
    extras : tuple of Extra
        Masses and springs.
    stations : tuple of int
        Nodes where forces act: the shear force may jump there.
    suspension_hz : float
        Highest rigid-body frequency of a free structure in its suspension; 0 for a structure that needs none.
    """

    stiffness: Variation = field(default_factory=Variation)
    density: Variation = field(default_factory=Variation)
    stiffness_ratio: float = 1.0
    softened: tuple[tuple[PartKey, float], ...] = ()
    formulation: str | None = None
    axial_load_n: float = 0.0
    released: dict[str, tuple[float | None, float | None]] = field(default_factory=dict)
    extras: tuple[Extra, ...] = ()
    stations: tuple[int, ...] = ()
    suspension_hz: float = 0.0

    @property
    def all_stations(self) -> set[int]:
        """Nodes where forces act, those of extra parts among them."""
        ends = [point.node for extra in self.extras for point in (extra.point, extra.second_point) if point is not None]
        return {*self.stations, *ends} - {0}

    def add_extras(self, structure: Structure) -> Structure:
        """Put extra masses and springs on a structure."""
        for extra in self.extras:
            if extra.mass:
                structure = structure.with_mass(extra.point, extra.mass)
            if extra.stiffness:
                structure = structure.with_spring(extra.point, extra.stiffness, extra.second_point)
        return structure

    @property
    def softened_segments(self) -> list[tuple[int, int, float]]:
        """First and last element of segments of a beam, and their real over drawn stiffness."""
        return [(*key, ratio) for key, ratio in self.softened if not isinstance(key, str)]

    def stiffness_ratio_of(self, name: str) -> float:
        """Return the real over the drawn stiffness of a spring or group."""
        return float(np.prod([ratio for key, ratio in self.softened if key == name]))
