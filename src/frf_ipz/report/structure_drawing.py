"""The structure as a drawing in the plane: nodes, supports, sensors, inputs, points of interest, what is missing."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from frf_ipz.arrays import FloatArray, IntArray
from frf_ipz.plotting.projection import project
from frf_ipz.report.picture import Picture, Trace, line, markers
from frf_ipz.report.wording import listed, number

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from frf_ipz.dofs import Dof
    from frf_ipz.structure import Geometry

MOST_LABELS = 24  # DOFs of a kind that are labelled; more would cover each other
ABOVE_MARK, BELOW_MARK = 0.1, 0.16  # from a mark to its label, on a structure that is a line
MOST_JOINED = 4  # labels in a row; of more the first and the last
CHARACTER = 0.0085  # of the structure's length: width of a character on a page of the usual width
SHELF = {"sensor": 0.2, "input": 0.62, "point": -0.34, "missing": 0.0}  # above and below a structure that is a line


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Marks:
    """What is marked on the structure.

    Parameters
    ----------
    sensors, inputs, points : sequence of Dof
        DOFs of the test, and points of interest.
    missing : mapping of int to str
        Nodes at which something is missing in the model, and what.
    mismatch : mapping of int to str
        Nodes at which the cause of an unexplained mismatch seems to sit, and what is said of them.
    across : str
        Title of the axis under a structure that is a line.
    """

    sensors: Sequence[Dof] = ()
    inputs: Sequence[Dof] = ()
    points: Sequence[Dof] = ()
    missing: Mapping[int, str] = field(default_factory=dict)
    mismatch: Mapping[int, str] = field(default_factory=dict)
    across: str = "Position, m"


def draw_structure(geometry: Geometry | None, marks: Marks) -> Picture | None:
    """Draw the structure with all marks.

    Parameters
    ----------
    geometry : Geometry, optional
        Of the FE model; without it, the nodes stand in a row by their numbers.
    marks : Marks
        What to mark.

    Returns
    -------
    Picture or None
        None where there is nothing to draw.
    """
    nodes, positions, lines = _plan(geometry, marks)
    if not len(nodes):
        return None
    place = {int(node): index for index, node in enumerate(nodes)}
    is_line = not np.ptp(positions[:, 1])
    traces = [_body(positions, lines, place), _nodes(nodes, positions)]
    traces += _supports(geometry, positions, place)
    traces += _dofs("sensor", marks.sensors, positions, place, is_line=is_line)
    traces += _dofs("input", marks.inputs, positions, place, is_line=is_line)
    traces += _dofs("point", marks.points, positions, place, is_line=is_line)
    traces += _rings("missing in the model", marks.missing, positions, place)
    traces += _rings("location of the mismatch", marks.mismatch, positions, place)
    note = "" if geometry is not None else "No model gives positions: the nodes stand in a row by their numbers."
    return Picture(
        name="structure",
        title="The structure",
        alt=_in_words(geometry, marks),
        traces=tuple(traces),
        layout=_layout(marks.across if geometry is not None else "Node number", positions, is_line=is_line),
        note=note,
        height_px=230 if is_line else 430,
    )


def _plan(geometry: Geometry | None, marks: Marks) -> tuple[IntArray, FloatArray, IntArray]:
    """Nodes, their positions on the drawing, and lines as pairs of nodes."""
    if geometry is None:
        dofs = (*marks.sensors, *marks.inputs, *marks.points)
        nodes = np.array(sorted({dof.node for dof in dofs if dof.node > 0}), int)
        positions = np.stack([nodes, np.zeros(len(nodes))], 1).astype(float)
        return nodes, positions, np.stack([nodes[:-1], nodes[1:]], 1)
    return geometry.nodes, project(geometry.coordinates_m), geometry.lines


def _body(positions: FloatArray, lines: IntArray, place: Mapping[int, int]) -> Trace:
    ends = [(place[int(a)], place[int(b)]) for a, b in lines if int(a) in place and int(b) in place]
    points = np.full((3 * len(ends), 2), np.nan)
    for row, (first, second) in enumerate(ends):
        points[3 * row], points[3 * row + 1] = positions[first], positions[second]
    return line(points[:, 0], points[:, 1], "structure", "@muted", width=4, showlegend=False)


def _nodes(nodes: IntArray, positions: FloatArray) -> Trace:
    texts = [f"node {node}" for node in nodes]
    size = 5 if len(nodes) < 200 else 3
    hover = "%{text}"
    return markers(
        positions[:, 0], positions[:, 1], "nodes", "@ink", text=texts, hover=hover, size=size, showlegend=False
    )


def _supports(geometry: Geometry | None, positions: FloatArray, place: Mapping[int, int]) -> list[Trace]:
    held = {} if geometry is None else {place[node]: how for node, how in geometry.supports.items() if node in place}
    if not held:
        return []
    rows = list(held)
    texts = [f"{how}" for how in held.values()]
    style: Trace = {"symbol": "square-x-open", "size": 15, "text": texts, "hover": "%{text}"}
    return [markers(positions[rows, 0], positions[rows, 1], "support", "@ink", **style)]


KINDS = {
    "sensor": ("sensor", "@c0", "square", "top center"),
    "input": ("input", "@c1", "triangle-down", "top center"),
    "point": ("point of interest", "@c2", "star", "bottom center"),
}


BESIDE = {"sensor": "top left", "input": "bottom right", "point": "bottom left"}  # labels of one node side by side


def _dofs(
    kind: str, dofs: Sequence[Dof], positions: FloatArray, place: Mapping[int, int], *, is_line: bool
) -> list[Trace]:
    known = [dof for dof in dofs if dof.node in place]
    if not known:
        return []
    name, colour, symbol, where = KINDS[kind]
    rows = [place[dof.node] for dof in known]
    heights = positions[rows, 1] + (SHELF[kind] if is_line else 0.0)
    where = where if is_line else BESIDE[kind]
    labelled = {"mode": "markers+text", "textposition": where} if len(known) <= MOST_LABELS and not is_line else {}
    size = 15 if is_line or kind == "sensor" else 11
    style: Trace = {"symbol": symbol, "size": size, "text": [str(dof) for dof in known], "hover": "%{text}", **labelled}
    font = {"color": colour, "size": 12.5}
    points = markers(positions[rows, 0], heights, name, colour, textfont=font, **style)
    if not is_line:
        return [points]
    extent = float(np.ptp(positions[:, 0])) or 1.0
    labels = _side_by_side([(float(positions[place[dof.node], 0]), str(dof)) for dof in known], extent)
    words: Trace = {"mode": "text", "text": [text for _, text in labels], "textposition": where, "textfont": font}
    unlisted: Trace = {**words, "showlegend": False, "legendgroup": name}
    height = heights[0] + (ABOVE_MARK if where.startswith("top") else -BELOW_MARK)
    at = markers([x for x, _ in labels], np.full(len(labels), height), name, colour, **unlisted)
    return [{**points, "legendgroup": name}, at]


def _side_by_side(labels: Sequence[tuple[float, str]], extent: float) -> list[tuple[float, str]]:
    """Join labels that would cover each other into one, at their middle.

    Parameters
    ----------
    labels : sequence of (float, str)
        Place along the structure, m, and text.
    extent : float
        Length of the structure, m.

    Returns
    -------
    list of (float, str)
        From left to right.
    """
    joined: list[list[tuple[float, str]]] = []
    for place, text in sorted(labels):
        needed = CHARACTER * extent * (len(_joined(joined[-1])[1]) + len(text) + 2) / 2 if joined else 0.0
        if joined and place - _joined(joined[-1])[0] < needed:
            joined[-1].append((place, text))
        else:
            joined.append([(place, text)])
    return [_joined(group) for group in joined]


def _joined(group: Sequence[tuple[float, str]]) -> tuple[float, str]:
    texts = [text for _, text in group]
    names = texts if len(texts) <= MOST_JOINED else [texts[0], "…", texts[-1]]
    return (group[0][0] + group[-1][0]) / 2, " ".join(names)


RINGS = {"missing in the model": "circle-open", "location of the mismatch": "diamond-open"}


def _rings(name: str, nodes: Mapping[int, str], positions: FloatArray, place: Mapping[int, int]) -> list[Trace]:
    known = {place[node]: text for node, text in nodes.items() if node in place}
    if not known:
        return []
    rows, texts = list(known), list(known.values())
    style: Trace = {"symbol": RINGS[name], "size": 30, "text": texts, "hover": "%{text}"}
    return [markers(positions[rows, 0], positions[rows, 1], name, "@bad", **style)]


def _layout(across_title: str, positions: FloatArray, *, is_line: bool) -> dict[str, Any]:
    hidden = {"showgrid": False, "zeroline": False, "showline": False, "ticks": "", "showticklabels": False}
    extent = float(np.ptp(positions[:, 0])) or 1.0
    margin = 0.06 * extent
    across = [float(positions[:, 0].min()) - margin, float(positions[:, 0].max()) + margin]
    if is_line:
        x = {"title": {"text": across_title}, "range": across, "showgrid": False, "zeroline": False}
        return {"xaxis": x, "yaxis": {**hidden, "range": [-0.9, 0.95], "fixedrange": True}}
    return {"xaxis": hidden, "yaxis": {**hidden, "scaleanchor": "x"}}


def _in_words(geometry: Geometry | None, marks: Marks) -> str:
    parts = ["Drawing of the structure"]
    if geometry is not None:
        extent = " by ".join(f"{number(value, 3)} m" for value in np.ptp(geometry.coordinates_m, axis=0) if value > 0)
        parts.append(f"{len(geometry.nodes)} nodes over {extent}")
        parts += [f"node {node} {how}" for node, how in list(geometry.supports.items())[:4]]
    for name, dofs in (("sensors", marks.sensors), ("inputs", marks.inputs), ("points of interest", marks.points)):
        parts += [f"{name} at {listed([str(dof) for dof in dofs])}"] if dofs else []
    parts += [f"{text} at node {node}" for node, text in list(marks.missing.items())[:4]]
    parts += [f"{text} (node {node})" for node, text in list(marks.mismatch.items())[:4]]
    return "; ".join(parts)
