"""How the structure moves, measured beside model: mode shapes and operating shapes, and their drawing in space.

`draw_structure` gives where points stand and what joins them, `draw_shape` how far each moves; the script of a page
turns and animates them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.dofs import Dof, PortDof
from frf_ipz.errors import InputError
from frf_ipz.late_imports import import_late
from frf_ipz.modes import modal_assurance
from frf_ipz.numerics.closed_faces import faces_between_lines
from frf_ipz.numerics.pencils import damped_poles
from frf_ipz.rational import natural_frequency_hz
from frf_ipz.structure import Mesh
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from scipy import spatial

    from frf_ipz.dofs import AnyDof
    from frf_ipz.frf import FrfLabel
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.numerics.pencils import Roots
    from frf_ipz.runs.results import Results
    from frf_ipz.structure import Geometry, ReducedModel
else:
    spatial = import_late("scipy.spatial")

STEPS = 10_000  # whole numbers over the largest extent: finer than any screen
MOST_NODES = 3000  # that are drawn; of more, some
REACH = 0.16  # of the largest extent: how far the drawing moves at most
MOST_BEYOND = 3.0  # a model that moves more than this many times what was measured leaves the drawing
AXES = {"x": 0, "y": 1, "z": 2}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Motion:
    """How DOFs move.

    Parameters
    ----------
    name : str
        ``measured``, ``nominal`` or ``updated``.
    title : str
        For the legend.
    dofs : tuple of Dof
        Unsigned.
    values : (n_dofs,) complex array
        m/N where a force drives the motion, else on a common scale without a unit.
    """

    name: str
    title: str
    dofs: tuple[AnyDof, ...]
    values: ComplexArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Shape:
    """One shape of the structure, as measurement and models have it.

    Parameters
    ----------
    title : str
        Which one.
    motions : tuple of Motion
        Updated and nominal model where there are any, then the measurement: drawn in this order.
    """

    title: str
    motions: tuple[Motion, ...]

    @property
    def measured_dofs(self) -> tuple[AnyDof, ...]:
        """DOFs at which the motion was measured."""
        return self.motions[-1].dofs


def mode_shape(run: Results, number: int) -> Shape:
    """Give a mode, measured and of both models.

    Parameters
    ----------
    run : Results
        What the run holds.
    number : int
        Which mode of the fit, from 0.

    Returns
    -------
    Shape
        Each motion turned and scaled onto the measured one.

    Raises
    ------
    InputError
        If there is no such mode.
    """
    if run.fit is None or not 0 <= number < run.fit.n_modes:
        raise InputError(f"this run has no mode {number + 1}")
    return _mode_shape(run, run.fit, number, {})


def mode_shapes(run: Results) -> list[Shape]:
    """Give all modes of the fit, measured and of both models.

    Parameters
    ----------
    run : Results
        What the run holds.

    Returns
    -------
    list of Shape
        As `mode_shape` gives each; the models are solved once.
    """
    roots: dict[str, Roots] = {}
    return [] if run.fit is None else [_mode_shape(run, run.fit, mode, roots) for mode in range(run.fit.n_modes)]


def _mode_shape(run: Results, fit: ModalFit, number: int, roots: dict[str, Roots]) -> Shape:
    """Give a mode; `roots` holds the poles of the models that have been solved."""
    measured = _measured_shape(fit, number)
    frequency = float(natural_frequency_hz(fit.model.poles[number : number + 1])[0])
    models = _models(run, number)
    title = "measured" if models or run.updated_model is None else "measured; the model has no counterpart of this mode"
    motions = [_scaled(Motion(name="measured", title=title, dofs=tuple(measured), values=_values(measured)))]
    for name, (model, target) in models.items():
        if name not in roots:
            roots[name] = damped_poles(model.mass, model.damping, model.stiffness)
        closest = int(np.argmin(np.abs(roots[name].values - target)))
        root, vector = complex(roots[name].values[closest]), roots[name].right_vectors[:, closest]
        motion = Motion(name=name, title=name, dofs=model.expanded_dofs, values=model.expansion @ vector)
        motions.insert(0, _scaled_onto(motion, motions[-1], abs(root) / (2 * np.pi)))
    return Shape(title=f"Mode {number + 1}, {frequency:.5g} Hz", motions=tuple(motions))


def operating_shape(run: Results, hertz: float, input_dof: str) -> Shape:
    """Give the motion at a frequency for a force of 1 N at an excited DOF, measured and of both models.

    Parameters
    ----------
    run : Results
        What the run holds.
    hertz : float
        Hz; the nearest measured line is taken.
    input_dof : str
        Label of the excited DOF.

    Returns
    -------
    Shape
        All on one scale, m/N.

    Raises
    ------
    InputError
        If nothing was measured there.
    """
    frfs = run.frfs
    chosen = [] if frfs is None else [k for k, label in enumerate(frfs.labels) if str(label.input_dof) == input_dof]
    if frfs is None or not chosen or not np.isfinite(hertz):
        raise InputError(f"no FRF was measured with an input at '{input_dof}'")
    line = int(np.argmin(np.abs(frfs.frequency_hz - hertz)))
    s = complex(frfs.s[line]) or 1j
    labels = [frfs.labels[k] for k in chosen]
    values = frfs.values[line, chosen] / s ** np.array([label.quantity.power for label in labels])
    sign = labels[0].input_dof.sign
    moved = {
        label.output_dof.unsigned: complex(value) * label.output_dof.sign
        for label, value in zip(labels, values, strict=True)
    }
    motions = [Motion(name="measured", title="measured", dofs=tuple(moved), values=_values(moved))]
    models = (
        {} if run.updated_model is None else {"nominal": run.updated_model.nominal, "updated": run.updated_model.model}
    )
    for name, model in models.items():
        dynamic = s**2 * model.mass + s * model.damping + model.stiffness
        try:
            motion = model.expansion @ np.linalg.solve(dynamic, sign * model.row(labels[0].input_dof.unsigned))
        except np.linalg.LinAlgError:
            raise InputError(f"the {name} model has no damping and resonates at {hertz:g} Hz; take another") from None
        motions.insert(0, Motion(name=name, title=name, dofs=model.expanded_dofs, values=motion))
    return Shape(title=f"At {frfs.frequency_hz[line]:.5g} Hz for 1 N at {input_dof}", motions=tuple(motions))


def _measured_shape(fit: ModalFit, number: int) -> dict[AnyDof, complex]:
    """Give the shape of a mode by DOF: as it was stated, or from residues."""
    if fit.modes_given is not None:
        modes = fit.modes_given.as_model_has_them()
        return dict(zip(modes.dofs, modes.shapes[:, number].tolist(), strict=True))
    powers = np.array([label.quantity.power for label in fit.labels])
    return _largest_row(fit.labels, fit.model.residues[number] / fit.model.poles[number] ** powers)


def _largest_row(labels: tuple[FrfLabel, ...], residues: ComplexArray) -> dict[AnyDof, complex]:
    """Take a mode's shape from the residues of the row or column of the FRF matrix that shows it best."""
    rows: dict[tuple[str, AnyDof], dict[AnyDof, complex]] = {}
    for label, residue in zip(labels, residues, strict=True):
        value = complex(residue) * label.sign
        sensor, input_dof = label.output_dof.unsigned, label.input_dof.unsigned
        rows.setdefault(("input", input_dof), {})[sensor] = value
        rows.setdefault(("sensor", sensor), {})[input_dof] = value
    longest = max(len(row) for row in rows.values())
    return max((row for row in rows.values() if len(row) == longest), key=lambda row: np.linalg.norm(_values(row)))


def _values(moved: Mapping[AnyDof, complex]) -> ComplexArray:
    return np.array(list(moved.values()), np.complex128)


def _scaled(motion: Motion) -> Motion:
    """Turn a mode's shape so that it is as real as can be, its largest value 1."""
    turn = np.exp(-0.5j * np.angle(np.sum(motion.values**2)))
    real = motion.values * turn
    largest = real[np.argmax(np.abs(real))]
    scale = abs(largest) * (np.sign(largest.real) or 1.0)
    return Motion(name=motion.name, title=motion.title, dofs=motion.dofs, values=real / (scale or 1.0))


def _models(run: Results, number: int) -> dict[str, tuple[ReducedModel, complex]]:
    """Give the models, and which of their poles the measured one was paired with."""
    updated, pairs = run.updated_model, run.pairs
    if updated is None or pairs is None:
        return {}
    for target, row in enumerate(pairs.targets):
        if row.kind == "pole" and row.measured == number:
            return {
                "nominal": (updated.nominal, row.computed_value),
                "updated": (updated.model, complex(updated.after[target])),
            }
    return {}


def _scaled_onto(motion: Motion, measured: Motion, hertz: float) -> Motion:
    """Turn and scale a model's shape onto the measured one, and state their MAC."""
    rows_of = {dof: k for k, dof in enumerate(motion.dofs)}
    shared = [(rows_of[dof], k) for k, dof in enumerate(measured.dofs) if dof in rows_of]
    if not shared:
        return _scaled(motion)
    rows, columns = (list(part) for part in zip(*shared, strict=True))
    mine, theirs = motion.values[rows], measured.values[columns]
    factor = np.vdot(mine, theirs) / (np.vdot(mine, mine).real or 1.0)
    title = f"{motion.name}, {hertz:.5g} Hz"
    if len(shared) > 1:
        mac = float(modal_assurance(mine[:, None], theirs[:, None])[0, 0])
        title += f", MAC {mac:.3f} at {counted(len(shared), 'DOF')}"
    return Motion(name=motion.name, title=title, dofs=motion.dofs, values=motion.values * factor)


def draw_structure(run: Results, dofs: Iterable[AnyDof] = ()) -> Structure:
    """Choose what is drawn of the structure of a run.

    Parameters
    ----------
    run : Results
        What the run holds.
    dofs : iterable of Dof
        Further DOFs that are drawn in any case.

    Returns
    -------
    Structure
        With the sensors, excited DOFs and points of interest marked.
    """
    frfs = run.frfs
    kinds: dict[str, Sequence[AnyDof]] = {
        "sensor": () if frfs is None else frfs.output_dofs,
        "input": () if frfs is None else frfs.input_dofs,
        "point": run.points,
    }
    shown = [*dofs, *(dof for marked in kinds.values() for dof in marked)]
    return Structure.of(run.geometry, shown, kinds)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Structure:
    """What is drawn of a structure, whatever it does.

    Parameters
    ----------
    nodes : (n_nodes,) int array
        Those that are drawn.
    positions_m : (n_nodes, 3) array
        Where they are; in a row by their numbers where nobody knows.
    lines : list of pairs of int
        Rows of `nodes`.
    faces : list of tuple of int
        The same.
    marks : list of dict
        ``kind``, ``text`` and ``rows``: one row a DOF, several a port.
    """

    nodes: IntArray
    positions_m: FloatArray
    lines: list[list[int]]
    faces: list[tuple[int, ...]]
    marks: list[dict[str, Any]]

    @classmethod
    def of(
        cls, geometry: Geometry | None, dofs: Iterable[AnyDof], kinds: Mapping[str, Sequence[AnyDof]] | None = None
    ) -> Structure:
        """Choose nodes, lines and faces.

        Parameters
        ----------
        geometry : Geometry, optional
            Of the FE model; without it, nodes stand in a row.
        dofs : iterable of Dof
            Whose nodes are drawn in any case.
        kinds : mapping of str to sequence of Dof, optional
            What is marked.

        Returns
        -------
        Structure
            What is drawn.
        """
        ports = {} if geometry is None else geometry.ports
        named = {node for dof in dofs for node in _nodes_of(dof, ports) if node > 0}
        if geometry is None:
            mesh = _row_of(sorted(named))
        else:
            mesh = geometry.outline(named)
            mesh = _thinned(mesh, named) if len(mesh.nodes) > MOST_NODES else mesh
        rows = {int(node): row for row, node in enumerate(mesh.nodes)}
        lines = [[rows[a], rows[b]] for a, b in mesh.lines.tolist()]
        faces = [tuple(dict.fromkeys(rows[node] for node in face)) for face in mesh.faces.tolist()]
        marks = [
            {"kind": kind, "text": str(dof), "rows": [rows[node] for node in _nodes_of(dof, ports) if node in rows]}
            for kind, marked in (kinds or {}).items()
            for dof in marked
        ]
        return cls(
            nodes=mesh.nodes,
            positions_m=mesh.coordinates_m,
            lines=lines,
            faces=faces or faces_between_lines(lines, mesh.coordinates_m),
            marks=[mark for mark in marks if mark["rows"]],
        )

    @property
    def extent_m(self) -> float:
        """The largest extent along an axis; 1 where there is none."""
        return (float(np.ptp(self.positions_m, axis=0).max()) if len(self.nodes) else 0.0) or 1.0

    @property
    def is_row(self) -> bool:
        """All nodes lie along x: motions are then drawn upwards, whatever their direction."""
        return not np.ptp(self.positions_m[:, 1:]) if len(self.nodes) else True

    def to_json(self) -> dict[str, Any]:
        """Give what the page's script draws.

        Returns
        -------
        dict
            ``at`` (n_nodes, 3) in steps of the largest extent, ``lines``, ``faces``, ``marks``, ``nodes``, ``isRow``
            and ``reach``, how far it moves at most.
        """
        middle = (self.positions_m.max(axis=0) + self.positions_m.min(axis=0)) / 2 if len(self.nodes) else 0.0
        return {
            "nodes": self.nodes.tolist(),
            "at": _steps(self.positions_m - middle, self.extent_m),
            "lines": self.lines,
            "faces": self.faces,
            "marks": self.marks,
            "isRow": self.is_row,
            "reach": REACH * STEPS,
        }


def _row_of(nodes: Sequence[int]) -> Mesh:
    """Nodes of which nobody knows where they are, by their numbers."""
    places = np.zeros((len(nodes), 3))
    places[:, 0] = nodes
    numbers = np.array(nodes, np.int64)
    pairs = np.stack([numbers[:-1], numbers[1:]], 1)
    return Mesh(nodes=numbers, coordinates_m=places, lines=pairs, faces=np.zeros((0, 4), np.int64))


def _thinned(mesh: Mesh, named: set[int]) -> Mesh:
    """Draw some of many nodes, and what lies between others between those nearest to them."""
    is_drawn = np.isin(mesh.nodes, list(named))
    is_drawn[:: -(-len(mesh.nodes) // MOST_NODES)] = True
    drawn, order = np.flatnonzero(is_drawn), np.argsort(mesh.nodes)
    nearest = drawn[spatial.cKDTree(mesh.coordinates_m[drawn]).query(mesh.coordinates_m)[1]]

    def moved(numbers: IntArray) -> IntArray:
        places = order[np.searchsorted(mesh.nodes[order], numbers)]
        ends = mesh.nodes[nearest[places]]
        _, first = np.unique(np.sort(ends, axis=1), axis=0, return_index=True)
        return np.asarray(ends[np.sort(first)])

    lines, faces = moved(mesh.lines), moved(mesh.faces)
    has_area = np.array([len(set(face)) > 2 for face in faces.tolist()], bool)
    return replace(
        mesh,
        nodes=mesh.nodes[drawn],
        coordinates_m=mesh.coordinates_m[drawn],
        lines=lines[lines[:, 0] != lines[:, 1]],
        faces=faces[has_area],
    )


def _nodes_of(dof: AnyDof, ports: Mapping[str, tuple[int, ...]]) -> tuple[int, ...]:
    return ports.get(dof.name, ()) if isinstance(dof, PortDof) else (dof.node,)


def draw_shape(shape: Shape, structure: Structure) -> dict[str, Any]:
    """Say how far each point of a drawing moves.

    Parameters
    ----------
    shape : Shape
        Measured and models.
    structure : Structure
        What is drawn.

    Returns
    -------
    dict
        ``title`` and ``motions``, each with ``name``, ``title``, ``rows`` of the structure, ``real`` and ``imag``
        (n, 3) in steps of the largest extent, and ``isWhole``: it moves all nodes.
    """
    moves = [_move(motion, structure) for motion in shape.motions]
    scale = _scale(shape, [move for _, move in moves])
    return {
        "title": shape.title,
        "motions": [
            {
                "name": motion.name,
                "title": motion.title,
                "rows": rows.tolist(),
                "real": _steps(scale * move.real, 1.0),
                "imag": _steps(scale * move.imag, 1.0),
                "isWhole": len(rows) == len(structure.nodes),
            }
            for motion, (rows, move) in zip(shape.motions, moves, strict=True)
        ],
    }


def _move(motion: Motion, structure: Structure) -> tuple[IntArray, ComplexArray]:
    """Which points move, and how. In a row of nodes all motion is drawn upwards."""
    places = {int(node): row for row, node in enumerate(structure.nodes)}
    moved: dict[int, ComplexArray] = {}
    for dof, value in zip(motion.dofs, motion.values, strict=True):
        if isinstance(dof, Dof) and dof.direction in AXES and dof.node in places:
            moved.setdefault(places[dof.node], np.zeros(3, complex))[AXES[dof.direction]] = value
    if len(moved) > len(places) / 2:  # a model that knows nearly all nodes: the others are held
        moved = {row: moved.get(row, np.zeros(3, complex)) for row in places.values()}
    rows = sorted(moved)
    space = np.array([moved[row] for row in rows], complex).reshape(-1, 3)
    if structure.is_row:
        axis = int(np.argmax(np.abs(space).sum(axis=0)))
        space = np.stack([np.zeros(len(space)), np.zeros(len(space)), space[:, axis]], 1)
    return np.array(rows, int), space


def _scale(shape: Shape, moves: Sequence[ComplexArray]) -> float:
    """Give the share of the extent for a motion of 1.

    A model that is far off must not leave the measurement without a visible one.
    """
    sizes = {
        motion.name: float(np.linalg.norm(move, axis=1).max(initial=0.0))
        for motion, move in zip(shape.motions, moves, strict=True)
    }
    largest = min(max(sizes.values(), default=0.0), MOST_BEYOND * sizes.get("measured", np.inf))
    return REACH / largest if largest > 0 else 0.0


def _steps(values: FloatArray, extent: float) -> list[list[int]]:
    return np.round(STEPS * values / extent).astype(int).tolist()  # type: ignore[no-any-return]
