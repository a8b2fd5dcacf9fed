"""The structure as a drawing in the plane: nodes, supports, sensors, inputs, points of interest, what is missing."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray, IntArray
from frf_ipz.dofs import PortDof, node_dofs
from frf_ipz.plotting.picture import Axis, Colour, Labels, Layer, Line, Panel, Picture, Points, Role, joined_segments
from frf_ipz.plotting.projection import project
from frf_ipz.plotting.wording import listed, number
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from frf_ipz.diagnosis.location import Location
    from frf_ipz.diagnosis.result import Diagnosis
    from frf_ipz.dofs import AnyDof
    from frf_ipz.frf import FrfSet
    from frf_ipz.structure import Geometry

MOST_LABELS = 24  # DOFs of a kind that are labelled; more would cover each other
ABOVE_MARK, BELOW_MARK = 0.1, 0.16  # from a mark to its label, on a structure that is a line
MOST_JOINED = 4  # labels in a row; of more the first and the last
CHARACTER = 0.0085  # of the structure's length: width of a character on a page of the usual width
LINE_LIMITS = (-0.9, 0.95)  # of the drawing of a structure that is a line
MARGIN = 0.06  # of the length, beside a structure that is a line
MANY_NODES = 200  # from which they are drawn small
SENSOR_NAME, INPUT_NAME, POINT_NAME = "sensor", "input", "point of interest"


@dataclass(frozen=True, slots=True)
class _Mark:
    """How DOFs of a kind are marked: on a line at a height of their own, else with labels on a side of their own."""

    colour: Colour
    symbol: str
    height: float
    side: str
    side_in_plane: str


MARKS = {
    SENSOR_NAME: _Mark(0, "square", 0.2, "above", "above left"),
    INPUT_NAME: _Mark(1, "triangle-down", 0.62, "above", "below right"),
    POINT_NAME: _Mark(2, "star", -0.34, "below", "below left"),
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StructureMarks:
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

    sensors: Sequence[AnyDof] = ()
    inputs: Sequence[AnyDof] = ()
    points: Sequence[AnyDof] = ()
    missing: Mapping[int, str] = field(default_factory=dict)
    mismatch: Mapping[int, str] = field(default_factory=dict)
    across: str = "Position, m"

    @property
    def dofs(self) -> dict[str, Sequence[AnyDof]]:
        """The DOFs by the name of their mark."""
        return {SENSOR_NAME: self.sensors, INPUT_NAME: self.inputs, POINT_NAME: self.points}


def describe_structure(geometry: Geometry | None, marks: StructureMarks) -> Picture | None:
    """Describe the structure with all marks.

    Parameters
    ----------
    geometry : Geometry, optional
        Of the FE model; without it, the nodes stand in a row by their numbers.
    marks : StructureMarks
        What to mark.

    Returns
    -------
    Picture or None
        None where there is nothing to draw.
    """
    nodes, positions, lines = _plan(geometry, marks)
    if not len(nodes):
        return None
    rows = {int(node): row for row, node in enumerate(nodes)}
    is_line = not np.ptp(positions[:, 1])
    layers: list[Layer] = [
        _body(positions, lines, rows, is_line=is_line),
        _nodes(nodes, positions),
        *_supports(geometry, positions, rows),
    ]
    for name, dofs in marks.dofs.items():
        layers += _dofs(name, dofs, positions, rows, is_line=is_line)
        layers += [] if geometry is None else _ports(name, dofs, geometry, positions, rows)
    layers += _rings("missing in the model", "circle", marks.missing, positions, rows)
    layers += _rings("location of the mismatch", "diamond", marks.mismatch, positions, rows)
    x, y = _axes(marks.across if geometry is not None else "Node number", positions, is_line=is_line)
    return Picture(
        name="structure",
        title="The structure",
        alt=_in_words(geometry, marks),
        panels=(Panel(y=y, layers=tuple(layers), is_to_scale=not is_line),),
        x=x,
        note="" if geometry is not None else "No model gives positions: the nodes stand in a row by their numbers.",
        height_px=230 if is_line else 430,
    )


def finding_nodes(diagnosis: Diagnosis | None, frfs: FrfSet | None) -> dict[int, str]:
    """Give the nodes at which something is missing.

    Parameters
    ----------
    diagnosis : Diagnosis, optional
        The result of the diagnosis.
    frfs : FrfSet, optional
        Says where channels sit.

    Returns
    -------
    dict of int to str
        What is missing at each node.
    """
    missing: dict[int, str] = {}
    for finding in () if diagnosis is None else diagnosis.findings:
        text = finding.effect.replace("_", " ")
        for node in _nodes_of(finding.location, frfs):
            missing[node] = text
    return missing


def mismatch_nodes(diagnosis: Diagnosis | None, frfs: FrfSet | None) -> dict[int, str]:
    """Give the nodes at which the cause of an unexplained mismatch seems to sit.

    Parameters
    ----------
    diagnosis : Diagnosis, optional
        The result of the diagnosis.
    frfs : FrfSet, optional
        Says where channels sit.

    Returns
    -------
    dict of int to str
        What is known of each node.
    """
    if diagnosis is None or diagnosis.is_explained:
        return {}
    text = "location of the mismatch: the cause is unknown"
    return dict.fromkeys(_nodes_of(diagnosis.mismatch_location, frfs), text)


def _nodes_of(location: Location, frfs: FrfSet | None) -> list[int]:
    nodes = list(location.nodes)
    if location.elements:
        nodes += range(location.elements[0], location.elements[-1] + 2)
    for label in () if frfs is None or nodes else frfs.labels:
        ends = ((label.output_dof, label.output_channel), (label.input_dof, label.input_channel))
        nodes += [dof.node for dof in node_dofs(dof for dof, channel in ends if channel in location.channels)]
    return nodes


def _plan(geometry: Geometry | None, marks: StructureMarks) -> tuple[IntArray, FloatArray, IntArray]:
    """Nodes, their positions on the drawing, and lines as pairs of nodes."""
    dofs = (*marks.sensors, *marks.inputs, *marks.points)
    if geometry is None:
        nodes = np.array(sorted({dof.node for dof in node_dofs(dofs) if dof.node > 0}), np.int64)
        positions = np.stack([nodes, np.zeros(len(nodes))], 1).astype(float)
        return nodes, positions, np.stack([nodes[:-1], nodes[1:]], 1)
    named = {dof.node for dof in node_dofs(dofs)} | {node for joined in geometry.ports.values() for node in joined}
    mesh = geometry.outline({*named, *geometry.supports, *marks.missing, *marks.mismatch})
    return mesh.nodes, project(mesh.coordinates_m), mesh.lines


def _body(positions: FloatArray, lines: IntArray, rows: Mapping[int, int], *, is_line: bool) -> Line:
    ends = np.array([(rows[int(a)], rows[int(b)]) for a, b in lines if int(a) in rows and int(b) in rows], int)
    starts, stops = positions[ends.reshape(-1, 2)].transpose(1, 0, 2)
    x, y = joined_segments(starts, stops)
    return Line(name="structure", colour=Role.MUTED, in_legend=False, x=x, y=y, width=4 if is_line else 2)


def _nodes(nodes: IntArray, positions: FloatArray) -> Points:
    return Points(
        name="nodes",
        colour=Role.INK,
        in_legend=False,
        x=positions[:, 0],
        y=positions[:, 1],
        size=5 if len(nodes) < MANY_NODES else 3,
        hover="{text}",
        texts=[f"node {node}" for node in nodes],
    )


def _supports(geometry: Geometry | None, positions: FloatArray, rows: Mapping[int, int]) -> list[Layer]:
    held = {} if geometry is None else {rows[node]: how for node, how in geometry.supports.items() if node in rows}
    if not held:
        return []
    coordinates = positions[list(held)]
    return [
        Points(
            name="support",
            colour=Role.INK,
            x=coordinates[:, 0],
            y=coordinates[:, 1],
            symbol="square-x",
            size=15,
            is_filled=False,
            hover="{text}",
            texts=[str(how) for how in held.values()],
        )
    ]


def _dofs(
    name: str, dofs: Sequence[AnyDof], positions: FloatArray, rows: Mapping[int, int], *, is_line: bool
) -> list[Layer]:
    known = [dof for dof in node_dofs(dofs) if dof.node in rows]
    if not known:
        return []
    mark, texts = MARKS[name], [str(dof) for dof in known]
    coordinates = positions[[rows[dof.node] for dof in known]]
    heights = coordinates[:, 1] + (mark.height if is_line else 0.0)
    is_labelled = len(known) <= MOST_LABELS and not is_line
    points = Points(
        name=name,
        colour=mark.colour,
        group=name,
        x=coordinates[:, 0],
        y=heights,
        symbol=mark.symbol,
        size=15 if is_line or name == SENSOR_NAME else 11,
        hover="{text}",
        texts=texts,
        labels=mark.side_in_plane if is_labelled else "",
    )
    if not is_line:
        return [points]
    extent = float(np.ptp(positions[:, 0])) or 1.0
    labels = _side_by_side([(float(x), text) for x, text in zip(coordinates[:, 0], texts, strict=True)], extent)
    height = heights[0] + (ABOVE_MARK if mark.side == "above" else -BELOW_MARK)
    words = Labels(
        name=name,
        colour=mark.colour,
        group=name,
        in_legend=False,
        x=np.array([x for x, _ in labels]),
        y=np.full(len(labels), height),
        texts=[text for _, text in labels],
        side=mark.side,
    )
    return [points, words]


def _ports(
    name: str, dofs: Sequence[AnyDof], geometry: Geometry, positions: FloatArray, rows: Mapping[int, int]
) -> list[Layer]:
    """Draw ports amid the nodes that they join, with a line to each."""
    known = [
        (dof, [rows[node] for node in geometry.ports.get(dof.name, ()) if node in rows])
        for dof in dofs
        if isinstance(dof, PortDof)
    ]
    known = [(dof, joined) for dof, joined in known if joined]
    if not known:
        return []
    middles = np.array([positions[joined].mean(axis=0) for _, joined in known])
    starts = np.concatenate(
        [np.broadcast_to(middle, (len(joined), 2)) for middle, (_, joined) in zip(middles, known, strict=True)]
    )
    ends = np.concatenate([positions[joined] for _, joined in known])
    mark = MARKS[name]
    x, y = joined_segments(starts, ends)
    links = Line(name=f"{name}: port", colour=mark.colour, group=f"{name}: port", in_legend=False, x=x, y=y, dash="dot")
    points = Points(
        name=f"{name}: port",
        colour=mark.colour,
        group=f"{name}: port",
        x=middles[:, 0],
        y=middles[:, 1],
        symbol=mark.symbol,
        size=13,
        is_filled=False,
        hover="{text}",
        texts=[str(dof) for dof, _ in known],
        labels=mark.side_in_plane if len(known) <= MOST_LABELS else "",
    )
    return [links, points]


def _side_by_side(labels: Sequence[tuple[float, str]], extent: float) -> list[tuple[float, str]]:
    """Join labels that would cover each other into one, at their middle.

    Parameters
    ----------
    labels : sequence of (float, str)
        Position along the structure, m, and text.
    extent : float
        Length of the structure, m.

    Returns
    -------
    list of (float, str)
        From left to right.
    """
    joined: list[list[tuple[float, str]]] = []
    for position, text in sorted(labels):
        needed = CHARACTER * extent * (len(_joined(joined[-1])[1]) + len(text) + 2) / 2 if joined else 0.0
        if joined and position - _joined(joined[-1])[0] < needed:
            joined[-1].append((position, text))
        else:
            joined.append([(position, text)])
    return [_joined(group) for group in joined]


def _joined(group: Sequence[tuple[float, str]]) -> tuple[float, str]:
    texts = [text for _, text in group]
    names = texts if len(texts) <= MOST_JOINED else [texts[0], "…", texts[-1]]
    return (group[0][0] + group[-1][0]) / 2, " ".join(names)


def _rings(
    name: str, symbol: str, nodes: Mapping[int, str], positions: FloatArray, rows: Mapping[int, int]
) -> list[Layer]:
    known = {rows[node]: text for node, text in nodes.items() if node in rows}
    if not known:
        return []
    coordinates = positions[list(known)]
    return [
        Points(
            name=name,
            colour=Role.BAD,
            x=coordinates[:, 0],
            y=coordinates[:, 1],
            symbol=symbol,
            size=30,
            is_filled=False,
            hover="{text}",
            texts=list(known.values()),
        )
    ]


def _axes(across: str, positions: FloatArray, *, is_line: bool) -> tuple[Axis, Axis]:
    if not is_line:
        return Axis(is_bare=True), Axis(is_bare=True)
    low, high = float(positions[:, 0].min()), float(positions[:, 0].max())
    margin = MARGIN * ((high - low) or 1.0)
    return (
        Axis(title=across, limits=(low - margin, high + margin)),
        Axis(is_bare=True, limits=LINE_LIMITS, is_fixed=True),
    )


def _in_words(geometry: Geometry | None, marks: StructureMarks) -> str:
    parts = ["Drawing of the structure"]
    if geometry is not None:
        extent = " by ".join(f"{number(value, 3)} m" for value in np.ptp(geometry.coordinates_m, axis=0) if value > 0)
        parts.append(f"{counted(len(geometry.nodes), 'node')} over {extent}")
        parts += [f"node {node} {how}" for node, how in list(geometry.supports.items())[:4]]
    for name, dofs in (("sensors", marks.sensors), ("inputs", marks.inputs), ("points of interest", marks.points)):
        parts += [f"{name} at {listed([str(dof) for dof in dofs])}"] if dofs else []
    parts += [f"{text} at node {node}" for node, text in list(marks.missing.items())[:4]]
    parts += [f"{text} (node {node})" for node, text in list(marks.mismatch.items())[:4]]
    return "; ".join(parts)
