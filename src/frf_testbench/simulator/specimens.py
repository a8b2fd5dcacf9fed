"""Specimens: structures of all families with random dimensions, as their owners have drawn them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from frf_testbench.simulator.structures.beams import BeamDrawing, PointPart, Section, build_beam
from frf_testbench.simulator.structures.frames import FrameDrawing, Spring, build_frame
from frf_testbench.simulator.structures.grids import GridDrawing, build_grid
from frf_testbench.simulator.structures.nominal import (
    NominalModel,
    build_nominal_beam,
    build_nominal_frame,
    build_nominal_grid,
    build_nominal_plate,
)
from frf_testbench.simulator.structures.plates import PlateDrawing, build_plate
from frf_testbench.simulator.structures.reality import Reality
from frf_testbench.simulator.structures.structure import Structure

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
        """Of sensors and excitation."""
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
        match self.drawing:
            case BeamDrawing():
                return build_beam(self.drawing, reality)
            case FrameDrawing():
                return build_frame(self.drawing, reality)
            case GridDrawing():
                return build_grid(self.drawing, reality)
            case PlateDrawing():
                return build_plate(self.drawing, reality)

    def build_nominal_model(self) -> NominalModel:
        """Build the model its owner has."""
        match self.drawing:
            case BeamDrawing():
                return build_nominal_beam(self.drawing)
            case FrameDrawing():
                return build_nominal_frame(self.drawing)
            case GridDrawing():
                return build_nominal_grid(self.drawing)
            case PlateDrawing():
                return build_nominal_plate(self.drawing)


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
        return Specimen(kind=kind, name="frame", drawing=_draw_frame(rng))
    material = str(rng.choice(list(MATERIALS)))
    if kind == "grid":
        return Specimen(kind=kind, name=f"{material} grid", drawing=_draw_grid(rng, material))
    if kind == "plate":
        return Specimen(kind=kind, name=f"{material} plate", drawing=_draw_plate(rng, material))
    ends = BEAM_KINDS[str(rng.choice(list(BEAM_KINDS))) if kind == "stepped" else kind]
    drawing = _draw_beam(rng, material, ends, stepped=kind == "stepped", thick_euler=thick_euler)
    return Specimen(kind=kind, name=f"{material} beam", drawing=drawing)


def _round(value: float) -> float:
    """Round to four digits, as in a drawing."""
    return float(f"{value:.4g}")


def _draw_log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return _round(float(np.exp(rng.uniform(np.log(low), np.log(high)))))


def _draw_material(rng: np.random.Generator, name: str) -> dict[str, float]:
    modulus, density, ratio = MATERIALS[name]
    return {
        "youngs_modulus_pa": _round(modulus * rng.uniform(0.96, 1.04)),
        "density_kg_m3": _round(density * rng.uniform(0.99, 1.01)),
        "poisson_ratio": round(ratio * rng.uniform(0.97, 1.03), 3),
    }


def _draw_beam(
    rng: np.random.Generator, material: str, ends: tuple[str, str], *, stepped: bool, thick_euler: bool
) -> BeamDrawing:
    length = _draw_log_uniform(rng, 0.25, 1.3)
    euler = thick_euler or rng.random() < 0.35
    slenderness = rng.uniform(0.03, 0.12) if thick_euler else float(np.exp(rng.uniform(np.log(0.006), np.log(0.07))))
    elements = int(rng.integers(30, 121))
    left, right = ends if rng.random() < 0.5 else ends[::-1]
    thickness, width = _round(length * slenderness), _draw_log_uniform(rng, 0.015, 0.06)
    sections: tuple[Section, ...] = ()
    if stepped:
        first = int(rng.integers(elements // 5, elements // 2 + 1))
        last = first + int(rng.integers(elements // 12 + 1, elements // 3))
        step = {
            "width_m": _round(width * rng.uniform(0.6, 1.5)),
            "thickness_m": _round(thickness * rng.uniform(0.7, 1.6)),
        }
        sections = (Section(first=first, last=last, **step),)
    parts: tuple[PointPart, ...] = ()
    if rng.random() < 0.4:
        density = MATERIALS[material][1]
        mass = density * length * width * thickness * rng.uniform(0.01, 0.15)
        parts = (PointPart(node=int(rng.integers(4, elements - 2)), mass_kg=_round(mass)),)
    return BeamDrawing(
        length_m=length,
        elements=elements,
        formulation="euler-bernoulli" if euler else "timoshenko",
        **_draw_material(rng, material),
        width_m=width,
        thickness_m=thickness,
        left=left,
        right=right,
        sections=sections,
        parts=parts,
    )


def _draw_frame(rng: np.random.Generator) -> FrameDrawing:
    n = int(rng.integers(4, 13)) if rng.random() < 0.7 else int(rng.integers(20, 41))
    mass, stiffness = _draw_log_uniform(rng, 0.5, 12), _draw_log_uniform(rng, 2e4, 2e6)
    ground = str(rng.choice(["one", "both", "none"], p=[0.6, 0.15, 0.25]))
    pairs = [(i, i + 1) for i in range(0 if ground != "none" else 1, n)]
    pairs += [(0, n)] if ground == "both" else []
    if n > 5 and rng.random() < 0.3:  # a brace past one mass
        start = int(rng.integers(1, n - 2))
        pairs.append((start, start + 2))
    return FrameDrawing(
        masses_kg=tuple(_round(mass * rng.uniform(0.75, 1.3)) for _ in range(n)),
        springs=tuple(
            Spring(id=f"k{i + 1}", nodes=pair, stiffness_n_m=_round(stiffness * rng.uniform(0.75, 1.3)))
            for i, pair in enumerate(pairs)
        ),
        direction=str(rng.choice(["x", "x", "y", "z"])),
    )


def _draw_grid(rng: np.random.Generator, material: str) -> GridDrawing:
    n_ties, n_rails = int(rng.integers(2, 5)), int(rng.integers(2, 4))
    span_x, span_y = _draw_log_uniform(rng, 0.3, 1.0), _draw_log_uniform(rng, 0.3, 0.9)
    thickness = _draw_log_uniform(rng, 0.004, 0.012)
    cells = n_rails * (n_ties - 1) + n_ties * (n_rails - 1)
    divisions = int(np.clip(88 // cells, 3, 9))

    def lines(n: int, span: float) -> tuple[float, ...]:
        steps = rng.uniform(0.7, 1.3, n - 1)
        return (0.0, *(_round(float(x)) for x in span * np.cumsum(steps) / steps.sum()))

    supports: dict[int, str] = {}
    if rng.random() < 0.55:
        corners = [1, n_ties, 1 + n_ties * (n_rails - 1), n_ties * n_rails]
        held_corners = rng.permutation(corners)[: int(rng.integers(2, 5))].tolist()
        kinds = (
            ["clamped"] * len(held_corners)
            if len(held_corners) < 3
            else rng.choice(["clamped", "pinned"], len(held_corners)).tolist()
        )
        supports = dict(zip(held_corners, kinds, strict=True))
    return GridDrawing(
        ties_x_m=lines(n_ties, span_x),
        rails_y_m=lines(n_rails, span_y),
        divisions_x=(divisions,) * (n_ties - 1),
        divisions_y=(divisions,) * (n_rails - 1),
        rail=(_draw_log_uniform(rng, 0.012, 0.04), thickness),
        tie=(_draw_log_uniform(rng, 0.012, 0.04), _round(thickness * rng.uniform(0.7, 1.3))),
        **_draw_material(rng, material),
        supports=supports,
    )


def _draw_plate(rng: np.random.Generator, material: str) -> PlateDrawing:
    length = _draw_log_uniform(rng, 0.3, 0.9)
    nodes_x, nodes_y = int(rng.integers(9, 11)), 8
    edges = [{}, {"left": "clamped"}, {"left": "clamped", "right": "clamped"}, {"left": "pinned", "right": "pinned"}]
    return PlateDrawing(
        size_m=(length, _round(length * rng.uniform(0.55, 0.9))),
        thickness_m=_round(length * rng.uniform(0.004, 0.012)),
        nodes_x=nodes_x,
        nodes_y=nodes_y,
        split=(nodes_x // 2 - int(rng.integers(0, 2)), nodes_y // 2 - int(rng.integers(0, 2))),
        **_draw_material(rng, material),
        edges=edges[int(rng.choice(4, p=[0.5, 0.25, 0.15, 0.1]))],
    )
