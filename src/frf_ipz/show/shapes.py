"""How the structure moves, measured beside model: mode shapes and operating shapes, and their drawing in the plane.

`draw_shape` gives where points stand and how far each moves; the page's script animates them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.dofs import Dof, node_dofs
from frf_ipz.errors import InputError
from frf_ipz.modes import modal_assurance
from frf_ipz.numerics.pencils import damped_poles
from frf_ipz.rational import natural_frequency_hz

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from frf_ipz.dofs import AnyDof
    from frf_ipz.frf import FrfLabel
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.runs.results import Results
    from frf_ipz.structure import Geometry, ReducedModel

FLAT = 1e-6  # of the largest extent: thinner than this is flat
MOST_NODES = 3000  # that are drawn; of more, some
REACH = 0.16  # of the largest extent: how far the drawing moves at most
MOST_BEYOND = 3.0  # a model that moves more than this many times what was measured leaves the drawing
TALL = 1.25  # of the drawing against what moves in it
BESIDE = 0.15  # of the margin above: a row of nodes moves upwards only
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
    fit = run.fit
    if fit is None or not 0 <= number < fit.n_modes:
        raise InputError(f"this run has no mode {number + 1}")
    measured = _measured_shape(fit, number)
    frequency = float(natural_frequency_hz(fit.model.poles[number : number + 1])[0])
    models = _models(run, number)
    title = "measured" if models or run.updated_model is None else "measured; the model has no counterpart of this mode"
    motions = [_scaled(Motion(name="measured", title=title, dofs=tuple(measured), values=_values(measured)))]
    for name, (model, target) in models.items():
        root, vector = _closest_mode(model, target)
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


def _closest_mode(model: ReducedModel, pole: complex) -> tuple[complex, ComplexArray]:
    roots = damped_poles(model.mass, model.damping, model.stiffness)
    mode = int(np.argmin(np.abs(roots.values - pole)))
    return complex(roots.values[mode]), roots.right_vectors[:, mode]


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
        title += f", MAC {mac:.3f} at {len(shared)} DOFs"
    return Motion(name=motion.name, title=title, dofs=motion.dofs, values=motion.values * factor)


def draw_shape(shape: Shape, geometry: Geometry | None) -> dict[str, Any]:
    """Put a shape on the plane.

    Parameters
    ----------
    shape : Shape
        Measured and models.
    geometry : Geometry, optional
        Where the nodes are; without it they stand in a row.

    Returns
    -------
    dict
        ``title``, ``lines`` as pairs of points, ``frame`` (left, top, width, height), ``motions``, each with its
        points, ``at`` and ``move`` (real and imaginary part across and up), and whether it has ``lines``.
    """
    nodes, positions, lines = _plan(geometry, shape.motions)
    is_row = not np.ptp(positions[:, 1:]) if len(nodes) else True
    extent = (float(np.ptp(positions, axis=0).max()) if len(nodes) else 0.0) or 1.0
    node_rows = {int(node): row for row, node in enumerate(nodes)}
    moves = [_move(motion, node_rows, is_row=is_row) for motion in shape.motions]
    scale = _scale(shape, [move for _, move in moves], extent)
    ground = _project(positions, is_row=is_row)
    drawn = [
        {
            "name": motion.name,
            "title": motion.title,
            "at": _digits(ground[rows], extent),
            "move": _digits(np.concatenate([scale * move.real, scale * move.imag], axis=1), extent),
            "nodes": [int(node) for node in nodes[rows]],
            "hasLines": len(rows) == len(nodes),
        }
        for motion, (rows, move) in zip(shape.motions, moves, strict=True)
    ]
    return {
        "title": shape.title,
        "ground": _digits(ground, extent),
        "lines": [
            [node_rows[int(a)], node_rows[int(b)]] for a, b in lines if int(a) in node_rows and int(b) in node_rows
        ],
        "frame": _frame(ground, extent, is_row=is_row),
        "motions": drawn,
    }


def _plan(geometry: Geometry | None, motions: Sequence[Motion]) -> tuple[IntArray, FloatArray, IntArray]:
    """Nodes, their positions in space, and lines as pairs of nodes."""
    if geometry is None:
        named = {dof.node for motion in motions for dof in node_dofs(motion.dofs)}
        nodes = np.array(sorted(node for node in named if node > 0), np.int64)
        positions = np.zeros((len(nodes), 3))
        positions[:, 0] = nodes
        return nodes, positions, np.stack([nodes[:-1], nodes[1:]], 1)
    if len(geometry.nodes) <= MOST_NODES:
        return geometry.nodes, geometry.coordinates_m, geometry.lines
    measured = {dof.node for motion in motions if motion.name == "measured" for dof in node_dofs(motion.dofs)}
    is_drawn = np.isin(geometry.nodes, list(measured))
    is_drawn[:: -(-len(geometry.nodes) // MOST_NODES)] = True
    return geometry.nodes[is_drawn], geometry.coordinates_m[is_drawn], geometry.lines


def _move(motion: Motion, node_rows: dict[int, int], *, is_row: bool) -> tuple[IntArray, ComplexArray]:
    """Which points move, and how, across and up. In a row of nodes all motion is drawn upwards."""
    moved: dict[int, ComplexArray] = {}
    for dof, value in zip(motion.dofs, motion.values, strict=True):
        if isinstance(dof, Dof) and dof.direction in AXES and dof.node in node_rows:
            moved.setdefault(node_rows[dof.node], np.zeros(3, complex))[AXES[dof.direction]] = value
    if len(moved) > len(node_rows) / 2:  # a model that knows nearly all nodes: the others are held
        moved = {row: moved.get(row, np.zeros(3, complex)) for row in node_rows.values()}
    rows = sorted(moved)
    space = np.array([moved[row] for row in rows], complex).reshape(-1, 3)
    if is_row:
        axis = int(np.argmax(np.abs(space).sum(axis=0)))
        space = np.stack([np.zeros(len(space)), space[:, axis], np.zeros(len(space))], 1)
    return np.array(rows, int), _project(space, is_row=is_row)


def _project(points: Any, *, is_row: bool) -> Any:  # noqa: ANN401  positions are real, motions complex
    x, y, z = points.T
    if is_row:
        return np.stack([x, y], 1)
    return np.stack([(x - y) * np.cos(np.pi / 6), z + (x + y) * np.sin(np.pi / 6)], 1)


def _scale(shape: Shape, moves: Sequence[ComplexArray], extent: float) -> float:
    """Metres drawn for a motion of 1: a model that is far off must not leave the measurement without a visible one."""
    sizes = {
        motion.name: float(np.abs(move).max(initial=0.0)) for motion, move in zip(shape.motions, moves, strict=True)
    }
    largest = min(max(sizes.values(), default=0.0), MOST_BEYOND * sizes.get("measured", np.inf))
    return REACH * extent / largest if largest > 0 else 0.0


def _frame(ground: FloatArray, extent: float, *, is_row: bool) -> list[float]:
    if not len(ground):
        return [0.0, 0.0, 1.0, 1.0]
    margin = TALL * REACH * extent * np.array([BESIDE if is_row else 1.0, 1.0])
    low, high = ground.min(axis=0) - margin, ground.max(axis=0) + margin
    return [float(low[0]), float(low[1]), float(high[0] - low[0]), float(high[1] - low[1])]


def _digits(values: FloatArray, extent: float) -> list[list[float]]:
    """Numbers with the digits that a screen can show."""
    digits = max(0, 4 - int(np.floor(np.log10(extent))))
    return [[round(float(value), digits) for value in row] for row in values]
