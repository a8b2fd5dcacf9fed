"""Machines with random dimensions: a frame, a folded sheet, or a stage, each on mounts."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import product

import numpy as np

from frf_testbench.machines.frames import Drawing, FloatArray, Member

STEEL, ALUMINIUM = (205e9, 7850.0), (69e9, 2700.0)
UPRIGHT, SIDEWAYS = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)
NODES = {"frame": (90, 480), "sheet": (120, 480), "stage": (90, 480)}  # 500 to 3 000 DOFs


def draw_machine(rng: np.random.Generator, kind: str) -> Drawing:
    """Draw a machine.

    Parameters
    ----------
    rng : Generator
        Of the case.
    kind : str
        One of `KINDS`.

    Returns
    -------
    Drawing
        With a model of 500 to 3 000 DOFs.
    """
    drawing = KINDS[kind](rng)
    wanted = np.exp(rng.uniform(*np.log(NODES[kind])))
    elements = max(round((wanted - len(drawing.points)) / len(drawing.members)) + 1, 2)
    return replace(drawing, elements=elements)


def _draw_frame(rng: np.random.Generator) -> Drawing:
    """Draw a rack of one to three storeys of square tubes, with braces."""
    width, depth, storey = rng.uniform(0.6, 1.4), rng.uniform(0.4, 0.9), rng.uniform(0.5, 0.9)
    storeys = int(rng.integers(1, 4))
    side, wall = rng.uniform(0.03, 0.06), rng.uniform(0.002, 0.004)
    corners = [(0.0, 0.0), (width, 0.0), (width, depth), (0.0, depth)]
    points = np.array([(x, y, level * storey) for level in range(storeys + 1) for x, y in corners])

    def bar(a: int, b: int, group: str, up: tuple[float, float, float], part: float = 1.0) -> Member:
        return Member(ends=(a, b), size_m=(part * side, part * side), wall_m=wall, up=up, group=group)

    members = []
    for level in range(storeys + 1):
        ring = [4 * level + corner for corner in range(4)]
        if level:
            members += [bar(a - 4, a, f"column_{corner + 1}", SIDEWAYS) for corner, a in enumerate(ring)]
        members += [bar(a, b, f"ring_{level}", UPRIGHT, 0.9) for a, b in zip(ring, [*ring[1:], ring[0]], strict=True)]
    members += [bar(0, 5, "brace_1", UPRIGHT, 0.6), bar(1, 6, "brace_2", UPRIGHT, 0.6)][: int(rng.integers(0, 3))]
    lumps = {int(point): float(rng.uniform(2, 15)) for point in rng.choice(np.arange(4, len(points)), 2, replace=False)}
    return _on_mounts(rng, "frame", points, members, (0, 1, 2, 3), lumps, STEEL)


def _draw_sheet(rng: np.random.Generator) -> Drawing:
    """Draw two sheets that meet at a fold, each a lattice of strips."""
    long, wide, high = (int(n) for n in rng.integers((7, 4, 3), (10, 7, 6)))
    cell, thickness = rng.uniform(0.04, 0.08), rng.uniform(0.003, 0.006)
    lean = rng.uniform(0.0, 0.5)
    flat = {(i, j): (i * cell, j * cell, 0.0) for i in range(long + 1) for j in range(wide + 1)}
    wall = {
        (i, -j): (i * cell, -j * cell * np.sin(lean), j * cell * np.cos(lean))
        for i in range(long + 1)
        for j in range(1, high + 1)
    }
    index = {key: number for number, key in enumerate([*flat, *wall])}
    points = np.array([*flat.values(), *wall.values()])
    normals = {"floor": UPRIGHT, "wall": (0.0, float(np.cos(lean)), float(np.sin(lean)))}
    members = [
        Member(
            ends=(index[a], index[b]),
            size_m=(thickness, cell),
            wall_m=0.0,
            up=normals[group],
            group=group,
        )
        for a, b in _lattice(index)
        for group in ["wall" if min(a[1], b[1]) < 0 else "floor"]
    ]
    feet = tuple(index[key] for key in ((0, 1), (long, 1), (long, wide), (0, wide)))
    lumps = {index[int(rng.integers(1, long)), int(rng.integers(1, wide))]: float(rng.uniform(0.1, 0.5))}
    return _on_mounts(rng, "sheet", points, members, feet, lumps, ALUMINIUM)


def _lattice(index: dict[tuple[int, int], int]) -> Iterator[tuple[tuple[int, int], tuple[int, int]]]:
    for (i, j), (right, up) in product(index, ((1, 0), (0, 1))):
        if (i + right, j + up) in index:
            yield (i, j), (i + right, j + up)


def _draw_stage(rng: np.random.Generator) -> Drawing:
    """Draw a base plate of stiff bars with two columns, a bridge and a carriage."""
    cells, cell, height = 4, rng.uniform(0.15, 0.25), rng.uniform(0.3, 0.6)
    base = {(i, j): (i * cell, j * cell, 0.0) for i in range(cells + 1) for j in range(cells + 1)}
    index = {key: number for number, key in enumerate(base)}
    bar, tube = rng.uniform(0.03, 0.05), rng.uniform(0.05, 0.08)
    at = {key: tuple(base[key][:2]) for key in ((0, 2), (4, 2))}
    points = np.array([*base.values(), *((*xy, height) for xy in at.values()), (2 * cell, 2 * cell, height)])
    left, right, middle = range(len(base), len(base) + 3)
    members = [
        Member(ends=(index[a], index[b]), size_m=(bar, 1.5 * bar), wall_m=0.0, up=UPRIGHT, group="base")
        for a, b in _lattice(index)
    ]
    for number, (foot, top) in enumerate(((index[0, 2], left), (index[4, 2], right))):
        members.append(
            Member(ends=(foot, top), size_m=(tube, tube), wall_m=0.004, up=SIDEWAYS, group=f"column_{number + 1}")
        )
    for number, ends in enumerate(((left, middle), (middle, right))):
        members.append(
            Member(ends=ends, size_m=(tube, 0.7 * tube), wall_m=0.004, up=UPRIGHT, group=f"bridge_{number + 1}")
        )
    feet = tuple(index[key] for key in ((0, 0), (4, 0), (4, 4), (0, 4)))
    lumps = {middle: float(rng.uniform(2, 8)), index[2, 1]: float(rng.uniform(2, 10))}
    return _on_mounts(rng, "stage", points, members, feet, lumps, ALUMINIUM)


def _on_mounts(
    rng: np.random.Generator,
    kind: str,
    points: FloatArray,
    members: list[Member],
    feet: tuple[int, ...],
    lumps: dict[int, float],
    material: tuple[float, float],
) -> Drawing:
    """Put a machine on mounts that it makes heave at 8 to 25 Hz."""
    youngs, density = material
    lengths = [np.linalg.norm(points[m.ends[1]] - points[m.ends[0]]) for m in members]
    areas = [m.size_m[0] * m.size_m[1] - (m.size_m[0] - 2 * m.wall_m) * (m.size_m[1] - 2 * m.wall_m) * bool(m.wall_m)
             for m in members]  # fmt: skip
    mass = density * float(np.dot(lengths, areas)) + sum(lumps.values())
    along = mass * (2 * np.pi * rng.uniform(8, 25)) ** 2 / len(feet)
    across = along * rng.uniform(0.4, 0.8)
    mounts = {foot: (float(along * rng.uniform(0.8, 1.25)), float(across * rng.uniform(0.8, 1.25))) for foot in feet}
    return Drawing(
        kind=kind,
        points=points,
        members=tuple(members),
        elements=2,
        youngs_modulus_pa=youngs,
        density_kg_m3=density,
        mounts=mounts,
        lumps=lumps,
    )


KINDS: dict[str, Callable[[np.random.Generator], Drawing]] = {
    "frame": _draw_frame,
    "sheet": _draw_sheet,
    "stage": _draw_stage,
}
