"""Specimens: structures of all families with random dimensions, as their owners have drawn them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from frf_testbench.simulator.structures.beams import BeamDrawing, PointPart, Section, build_beam
from frf_testbench.simulator.structures.frames import FrameDrawing, Spring, build_frame
from frf_testbench.simulator.structures.grids import GridDrawing, build_grid
from frf_testbench.simulator.structures.nominal import (
    NominalModel,
    nominal_beam,
    nominal_frame,
    nominal_grid,
    nominal_plate,
)
from frf_testbench.simulator.structures.plates import PlateDrawing, build_plate
from frf_testbench.simulator.structures.points import Structure
from frf_testbench.simulator.structures.reality import Reality

BEAM_KINDS = {
    "cantilever": ("clamped", "free"),
    "pinned-pinned": ("pinned", "pinned"),
    "clamped-pinned": ("clamped", "pinned"),
    "clamped-clamped": ("clamped", "clamped"),
    "clamped-sliding": ("clamped", "sliding"),
    "pinned-sliding": ("pinned", "sliding"),
    "free-free": ("free", "free"),
}
KINDS = (*BEAM_KINDS, "stepped", "frame", "grid", "plate")
MATERIALS = {"steel": (2.08e11, 7830.0, 0.29), "aluminium": (7.05e10, 2710.0, 0.33)}

Drawing = BeamDrawing | FrameDrawing | GridDrawing | PlateDrawing


@dataclass(frozen=True, slots=True, kw_only=True)
class Specimen:
    """One structure.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    name : str
        As its owner calls it.
    drawing : BeamDrawing, FrameDrawing, GridDrawing or PlateDrawing
        What is known about it.
    """

    kind: str
    name: str
    drawing: Drawing

    @property
    def family(self) -> str:
        """Kind of the model file."""
        return {BeamDrawing: "beam", FrameDrawing: "lumped"}.get(type(self.drawing), "matrices")

    @property
    def direction(self) -> str:
        """Of sensors and blows."""
        return self.drawing.direction if isinstance(self.drawing, FrameDrawing) else "z"

    @property
    def length_m(self) -> tuple[float, float]:
        """Extent along x and y, for positions; zero for a frame."""
        if isinstance(self.drawing, BeamDrawing):
            return self.drawing.length_m, 0.0
        return (0.0, 0.0) if isinstance(self.drawing, FrameDrawing) else self.drawing.size_m

    @property
    def mass_kg(self) -> float:
        """Mass of all that is drawn."""
        return self.drawing.mass_kg

    @property
    def n_modes(self) -> int:
        """Flexible modes that the nominal model has converged, or has at all."""
        if isinstance(self.drawing, BeamDrawing):
            return min(self.drawing.elements // 8, 6)
        if isinstance(self.drawing, FrameDrawing):
            return min(len(self.drawing.masses_kg) - self.drawing.n_rigid, 8)
        return 7

    def build(self, reality: Reality | None = None) -> Structure:
        """Build the structure as it really is."""
        build = {BeamDrawing: build_beam, FrameDrawing: build_frame, GridDrawing: build_grid, PlateDrawing: build_plate}
        return build[type(self.drawing)](self.drawing, reality)

    def nominal(self) -> NominalModel:
        """Build the model its owner has."""
        build = {
            BeamDrawing: nominal_beam,
            FrameDrawing: nominal_frame,
            GridDrawing: nominal_grid,
            PlateDrawing: nominal_plate,
        }
        return build[type(self.drawing)](self.drawing)


def draw_specimen(rng: np.random.Generator, kind: str, *, thick_euler: bool = False) -> Specimen:
    """Draw a structure.

    Parameters
    ----------
    rng : Generator
        Of the case.
    kind : str
        One of `KINDS`.
    thick_euler : bool
        A thick beam that its owner has drawn without shear and rotary inertia.

    Returns
    -------
    Specimen
        Numbers have four digits, as in a drawing.
    """
    if kind == "frame":
        return Specimen(kind=kind, name="frame", drawing=_frame(rng))
    material = str(rng.choice(list(MATERIALS)))
    if kind == "grid":
        return Specimen(kind=kind, name=f"{material} grid", drawing=_grid(rng, material))
    if kind == "plate":
        return Specimen(kind=kind, name=f"{material} plate", drawing=_plate(rng, material))
    ends = BEAM_KINDS[str(rng.choice(list(BEAM_KINDS))) if kind == "stepped" else kind]
    drawing = _beam(rng, material, ends, stepped=kind == "stepped", thick_euler=thick_euler)
    return Specimen(kind=kind, name=f"{material} beam", drawing=drawing)


def _four(value: float) -> float:
    return float(f"{value:.4g}")


def _log(rng: np.random.Generator, low: float, high: float) -> float:
    return _four(float(np.exp(rng.uniform(np.log(low), np.log(high)))))


def _material(rng: np.random.Generator, name: str) -> dict[str, float]:
    modulus, density, ratio = MATERIALS[name]
    return {
        "youngs_modulus_pa": _four(modulus * rng.uniform(0.96, 1.04)),
        "density_kg_m3": _four(density * rng.uniform(0.99, 1.01)),
        "poisson_ratio": round(ratio * rng.uniform(0.97, 1.03), 3),
    }


def _beam(
    rng: np.random.Generator, material: str, ends: tuple[str, str], *, stepped: bool, thick_euler: bool
) -> BeamDrawing:
    length = _log(rng, 0.25, 1.3)
    euler = thick_euler or rng.random() < 0.35
    slenderness = rng.uniform(0.03, 0.12) if thick_euler else float(np.exp(rng.uniform(np.log(0.006), np.log(0.07))))
    elements = int(rng.integers(30, 121))
    left, right = ends if rng.random() < 0.5 else ends[::-1]
    thickness, width = _four(length * slenderness), _log(rng, 0.015, 0.06)
    sections: tuple[Section, ...] = ()
    if stepped:
        first = int(rng.integers(elements // 5, elements // 2 + 1))
        last = first + int(rng.integers(elements // 12 + 1, elements // 3))
        step = {
            "width_m": _four(width * rng.uniform(0.6, 1.5)),
            "thickness_m": _four(thickness * rng.uniform(0.7, 1.6)),
        }
        sections = (Section(first=first, last=last, **step),)
    parts: tuple[PointPart, ...] = ()
    if rng.random() < 0.4:
        density = MATERIALS[material][1]
        mass = density * length * width * thickness * rng.uniform(0.01, 0.15)
        parts = (PointPart(node=int(rng.integers(4, elements - 2)), mass_kg=_four(mass)),)
    return BeamDrawing(
        length_m=length,
        elements=elements,
        formulation="euler-bernoulli" if euler else "timoshenko",
        **_material(rng, material),
        width_m=width,
        thickness_m=thickness,
        left=left,
        right=right,
        sections=sections,
        parts=parts,
    )


def _frame(rng: np.random.Generator) -> FrameDrawing:
    n = int(rng.integers(4, 13)) if rng.random() < 0.7 else int(rng.integers(20, 41))
    mass, stiffness = _log(rng, 0.5, 12), _log(rng, 2e4, 2e6)
    ends = str(rng.choice(["one", "both", "none"], p=[0.6, 0.15, 0.25]))
    pairs = [(i, i + 1) for i in range(0 if ends != "none" else 1, n)]
    pairs += [(0, n)] if ends == "both" else []
    if n > 5 and rng.random() < 0.3:  # a brace past one mass
        start = int(rng.integers(1, n - 2))
        pairs.append((start, start + 2))
    return FrameDrawing(
        masses_kg=tuple(_four(mass * rng.uniform(0.75, 1.3)) for _ in range(n)),
        springs=tuple(
            Spring(id=f"k{i + 1}", nodes=pair, stiffness_n_m=_four(stiffness * rng.uniform(0.75, 1.3)))
            for i, pair in enumerate(pairs)
        ),
        direction=str(rng.choice(["x", "x", "y", "z"])),
    )


def _grid(rng: np.random.Generator, material: str) -> GridDrawing:
    n_ties, n_rails = int(rng.integers(2, 5)), int(rng.integers(2, 4))
    span_x, span_y = _log(rng, 0.3, 1.0), _log(rng, 0.3, 0.9)
    thickness = _log(rng, 0.004, 0.012)
    cells = n_rails * (n_ties - 1) + n_ties * (n_rails - 1)
    divisions = int(np.clip(88 // cells, 3, 9))

    def lines(n: int, span: float) -> tuple[float, ...]:
        steps = rng.uniform(0.7, 1.3, n - 1)
        return (0.0, *(_four(float(x)) for x in span * np.cumsum(steps) / steps.sum()))

    supports: dict[int, str] = {}
    if rng.random() < 0.55:
        corners = [1, n_ties, 1 + n_ties * (n_rails - 1), n_ties * n_rails]
        chosen = rng.permutation(corners)[: int(rng.integers(2, 5))].tolist()
        kinds = (
            ["clamped"] * len(chosen) if len(chosen) < 3 else rng.choice(["clamped", "pinned"], len(chosen)).tolist()
        )
        supports = dict(zip(chosen, kinds, strict=True))
    return GridDrawing(
        ties_x_m=lines(n_ties, span_x),
        rails_y_m=lines(n_rails, span_y),
        divisions_x=(divisions,) * (n_ties - 1),
        divisions_y=(divisions,) * (n_rails - 1),
        rail=(_log(rng, 0.012, 0.04), thickness),
        tie=(_log(rng, 0.012, 0.04), _four(thickness * rng.uniform(0.7, 1.3))),
        **_material(rng, material),
        supports=supports,
    )


def _plate(rng: np.random.Generator, material: str) -> PlateDrawing:
    long = _log(rng, 0.3, 0.9)
    nodes_x, nodes_y = int(rng.integers(9, 11)), 8
    edges = [{}, {"left": "clamped"}, {"left": "clamped", "right": "clamped"}, {"left": "pinned", "right": "pinned"}]
    return PlateDrawing(
        size_m=(long, _four(long * rng.uniform(0.55, 0.9))),
        thickness_m=_four(long * rng.uniform(0.004, 0.012)),
        nodes_x=nodes_x,
        nodes_y=nodes_y,
        split=(nodes_x // 2 - int(rng.integers(0, 2)), nodes_y // 2 - int(rng.integers(0, 2))),
        **_material(rng, material),
        edges=edges[int(rng.choice(4, p=[0.5, 0.25, 0.15, 0.1]))],
    )
