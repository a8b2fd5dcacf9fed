"""How the structure moves, measured beside model: mode shapes, and operating shapes at a frequency."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray
from frf_ipz.errors import InputError
from frf_ipz.modes import modal_assurance
from frf_ipz.numerics.pencils import damped_poles
from frf_ipz.rational import natural_frequency_hz

if TYPE_CHECKING:
    from collections.abc import Mapping

    from frf_ipz.dofs import Dof
    from frf_ipz.frf import FrfLabel
    from frf_ipz.report.contents import RunContents
    from frf_ipz.structure import ReducedModel


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
    dofs: tuple[Dof, ...]
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


def mode_shape(run: RunContents, number: int) -> Shape:
    """Give a mode, measured and of both models.

    Parameters
    ----------
    run : RunContents
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
    pole = complex(fit.model.poles[number])
    powers = np.array([label.quantity.power for label in fit.labels])
    measured = _largest_row(fit.labels, fit.model.residues[number] / pole**powers)
    frequency = float(natural_frequency_hz(fit.model.poles[number : number + 1])[0])
    models = _models(run, number)
    title = "measured" if models or run.updated is None else "measured; the model has no counterpart of this mode"
    motions = [_scaled(Motion(name="measured", title=title, dofs=tuple(measured), values=_values(measured)))]
    for name, (model, wanted) in models.items():
        root, vector = _mode_near(model, wanted)
        found = Motion(name=name, title=name, dofs=model.expanded_dofs, values=model.expansion @ vector)
        motions.insert(0, _onto(found, motions[-1], abs(root) / (2 * np.pi)))
    return Shape(title=f"Mode {number + 1}, {frequency:.5g} Hz", motions=tuple(motions))


def operating_shape(run: RunContents, hertz: float, blow: str) -> Shape:
    """Give the motion at a frequency for a force of 1 N at a struck DOF, measured and of both models.

    Parameters
    ----------
    run : RunContents
        What the run holds.
    hertz : float
        Hz; the nearest measured line is taken.
    blow : str
        Label of the struck DOF.

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
    chosen = [] if frfs is None else [k for k, label in enumerate(frfs.labels) if str(label.input_dof) == blow]
    if frfs is None or not chosen or not np.isfinite(hertz):
        raise InputError(f"no FRF was measured with blows at '{blow}'")
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
    models = {} if run.updated is None else {"nominal": run.updated.nominal, "updated": run.updated.model}
    for name, model in models.items():
        dynamic = s**2 * model.mass + s * model.damping + model.stiffness
        motion = model.expansion @ np.linalg.solve(dynamic, sign * model.row(labels[0].input_dof.unsigned))
        motions.insert(0, Motion(name=name, title=name, dofs=model.expanded_dofs, values=motion))
    return Shape(title=f"At {frfs.frequency_hz[line]:.5g} Hz for 1 N at {blow}", motions=tuple(motions))


def _largest_row(labels: tuple[FrfLabel, ...], residues: ComplexArray) -> dict[Dof, complex]:
    """Take a mode's shape from the residues of the row or column of the FRF matrix that shows it best."""
    rows: dict[tuple[str, Dof], dict[Dof, complex]] = {}
    for label, residue in zip(labels, residues, strict=True):
        value = complex(residue) * label.sign
        sensor, blow = label.output_dof.unsigned, label.input_dof.unsigned
        rows.setdefault(("blow", blow), {})[sensor] = value
        rows.setdefault(("sensor", sensor), {})[blow] = value
    most = max(len(row) for row in rows.values())
    return max((row for row in rows.values() if len(row) == most), key=lambda row: np.linalg.norm(_values(row)))


def _values(moved: Mapping[Dof, complex]) -> ComplexArray:
    return np.array(list(moved.values()), np.complex128)


def _scaled(motion: Motion) -> Motion:
    """Turn a mode's shape so that it is as real as can be, its largest value 1."""
    turn = np.exp(-0.5j * np.angle(np.sum(motion.values**2)))
    real = motion.values * turn
    largest = real[np.argmax(np.abs(real))]
    scale = abs(largest) * (np.sign(largest.real) or 1.0)
    return Motion(name=motion.name, title=motion.title, dofs=motion.dofs, values=real / (scale or 1.0))


def _models(run: RunContents, number: int) -> dict[str, tuple[ReducedModel, complex]]:
    """Give the models, and which of their poles the measured one was paired with."""
    updated, pairs = run.updated, run.pairs
    if updated is None or pairs is None:
        return {}
    for place, row in enumerate(pairs.targets):
        if row.kind == "pole" and row.measured == number:
            return {
                "nominal": (updated.nominal, row.computed_value),
                "updated": (updated.model, complex(updated.after[place])),
            }
    return {}


def _mode_near(model: ReducedModel, wanted: complex) -> tuple[complex, ComplexArray]:
    roots = damped_poles(model.mass, model.damping, model.stiffness)
    place = int(np.argmin(np.abs(roots.values - wanted)))
    return complex(roots.values[place]), roots.right[:, place]


def _onto(motion: Motion, measured: Motion, hertz: float) -> Motion:
    """Turn and scale a model's shape onto the measured one, and say how alike they are."""
    place = {dof: k for k, dof in enumerate(motion.dofs)}
    both = [(place[dof], k) for k, dof in enumerate(measured.dofs) if dof in place]
    if not both:
        return _scaled(motion)
    rows, columns = (list(part) for part in zip(*both, strict=True))
    mine, theirs = motion.values[rows], measured.values[columns]
    factor = np.vdot(mine, theirs) / (np.vdot(mine, mine).real or 1.0)
    title = f"{motion.name}, {hertz:.5g} Hz"
    if len(both) > 1:
        alike = float(modal_assurance(mine[:, None], theirs[:, None])[0, 0])
        title += f", MAC {alike:.3f} at {len(both)} DOFs"
    return Motion(name=motion.name, title=title, dofs=motion.dofs, values=motion.values * factor)
