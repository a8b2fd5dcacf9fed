"""Matrices as FE programs export them, checked and brought to those of a structure in SI.

In this order: rows of held DOFs are left out, small asymmetries averaged out, units brought to SI, nodes' own axes
turned to those of the whole, Lagrange multipliers replaced by the equations that they stand for; then mass, stiffness
and damping have to be those of a structure.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import sparse

from frf_ipz.arrays import IntArray, require_finite
from frf_ipz.dofs import DIRECTIONS, GENERALISED, Dof
from frf_ipz.errors import InputError
from frf_ipz.numerics.constraints import (
    AdmissibleMotions,
    eliminate_multipliers,
    find_multipliers,
    solve_equations,
)
from frf_ipz.numerics.definiteness import count_massless_motions, require_semidefinite, symmetrise
from frf_ipz.numerics.held_rows import find_held_rows
from frf_ipz.numerics.rounding import printed_rounding
from frf_ipz.unit_systems import SI, UnitSystem

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from contextlib import AbstractContextManager

    from frf_ipz.arrays import BoolArray, FloatArray, Matrix

DOFS_SHOWN = 6
HELD = "held"
STRUCTURAL = "structural"  # the imaginary part of the stiffness
FEIGNED = 1e-10  # of the geometric mean of the diagonal: its square, by which it moves frequencies, is below rounding
NO_DAMPING = 1e-12  # of the stiffness: an imaginary part that is rounding


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FreeRows:
    """Rows of matrices that are not those of held DOFs.

    Parameters
    ----------
    rows : (n_free,) int array
        Their numbers, from 0.
    dofs, held_dofs : tuple of Dof
        DOFs of these rows, and of the others.
    notes : tuple of str
        What was recognised.
    """

    rows: IntArray
    dofs: tuple[Dof, ...]
    held_dofs: tuple[Dof, ...]
    notes: tuple[str, ...]

    @property
    def supports(self) -> dict[int, str]:
        """Nodes with held DOFs, and how they are held."""
        moving = {dof.node for dof in self.dofs}
        return {dof.node: "pinned" if dof.node in moving else "clamped" for dof in self.held_dofs}


def select_free_rows(matrices: Mapping[str, Matrix], dofs: Sequence[Dof], options: MatrixOptions) -> FreeRows:
    """Tell the rows of free DOFs from those that are left in matrices for held ones.

    Parameters
    ----------
    matrices : mapping of str to (n, n) sparse array
        ``mass``, ``stiffness`` and perhaps damping, of all rows; they need not be symmetric.
    dofs : sequence of Dof
        The DOF of each row.
    options : MatrixOptions
        Whether held ones are told, and the units.

    Returns
    -------
    FreeRows
        The rows, and notes on what is left out.

    Raises
    ------
    InputError
        If a value is not finite.
    """
    mass, stiffness = matrices["mass"], matrices["stiffness"]
    for matrix in (mass, stiffness):
        require_finite("the matrices", matrix.data)
    further = [matrix for what, matrix in matrices.items() if what not in ("mass", "stiffness")]
    marks = find_held_rows(mass, stiffness, *further)
    if options.held == "keep":
        return FreeRows(rows=np.arange(len(dofs)), dofs=tuple(dofs), held_dofs=(), notes=())
    hz = np.sqrt(np.abs(stiffness.diagonal()) / np.where(mass.diagonal() != 0, np.abs(mass.diagonal()), np.inf))
    hz /= 2 * np.pi * options.units.time_s
    notes = []
    for ways, why, rows in (
        ("zero in mass and stiffness", HELD, marks.zero),
        ("those of the identity", HELD, marks.identity),
        (*_loose_masses(mass.diagonal()[marks.loose]), marks.loose),
        (f"alone in mass and stiffness, {_shared_hz(hz[marks.shared])}", "held, or joined to nothing", marks.shared),
        ("marked by a penalty on the diagonal", HELD, marks.penalty),
    ):
        if rows.any():
            dofs_are = "this DOF is" if np.count_nonzero(rows) == 1 else "these DOFs are"
            notes.append(
                f"{_count_rows(rows, dofs, ways)}: {dofs_are} {why}, and left out; [matrices] held = 'keep' takes the "
                "rows as they are"
            )
    if marks.lone.any():
        at = ", ".join(f"{value:.5g}" for value in hz[marks.lone][:DOFS_SHOWN])
        notes.append(
            f"{_count_rows(marks.lone, dofs, 'alone in mass and stiffness')}: kept, with a mode of its own at {at} "
            "Hz; where the DOF is held, take the row out"
        )
    free = np.flatnonzero(~marks.any)
    return FreeRows(
        rows=free,
        dofs=tuple(dofs[row] for row in free.tolist()),
        held_dofs=tuple(dofs[row] for row in np.flatnonzero(marks.any).tolist()),
        notes=tuple(notes),
    )


def _count_rows(rows: BoolArray, dofs: Sequence[Dof], ways: str) -> str:
    """Say how many rows are in which way, and the first of their DOFs."""
    names = [dofs[row].name for row in np.flatnonzero(rows).tolist()]
    shown = ", ".join(names[:DOFS_SHOWN]) + (", ..." if len(names) > DOFS_SHOWN else "")
    return f"{'1 row is' if len(names) == 1 else f'{len(names)} rows are'} {ways} ({shown})"


def _shared_hz(hz: FloatArray) -> str:
    """Say at which frequencies rows are that share theirs with others."""
    texts = list(dict.fromkeys(f"{value:.5g}" for value in np.sort(hz)))
    return f"all at {texts[0]} Hz" if len(texts) == 1 else f"several at each of {', '.join(texts[:DOFS_SHOWN])} Hz"


def _loose_masses(masses: FloatArray) -> tuple[str, str]:
    """Say what rows without stiffness are, and why: a mark of held DOFs is the same in all, masses of bodies differ."""
    if len(np.unique(masses)) > 1:
        many = f"{masses.min():.4g} to {masses.max():.4g}"
        return f"zero in the stiffness, with masses of {many} that couple to nothing", "held by nothing"
    one = f"{masses.max(initial=0.0):.4g}"
    return f"zero in the stiffness, with a mass of {one} that couples to nothing", "held, or held by nothing"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MatrixOptions:
    """How matrices are to be taken.

    Parameters
    ----------
    held : str
        ``auto``, or ``keep`` to take all rows as they are.
    units : UnitSystem
        What they are in.
    allow_negative_stiffness : bool
        Whether the stiffness may have negative eigenvalues.
    axes : mapping of int to (3, 3) array
        Nodes whose DOFs are along axes of their own, which are the rows of the array.
    """

    held: str = "auto"
    units: UnitSystem = field(default_factory=lambda: UnitSystem.of(SI))
    allow_negative_stiffness: bool = False
    axes: Mapping[int, FloatArray] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ExportedRows:
    """How rows of files become rows of a structure.

    Parameters
    ----------
    free : FreeRows
        Rows that are not those of held DOFs.
    units : UnitSystem
        What the matrices are in.
    turn : (n_free, n) sparse array, optional
        Motions along nodes' own axes by those along the axes of the whole.
    dofs : tuple of Dof
        The n motions along the axes of the whole.
    equations : (n_equations, n) sparse array
        What holds them where a node lacks a motion along one of its own axes.
    kept : (n_kept,) int array
        Those of the n motions that are no multipliers.
    """

    free: FreeRows
    units: UnitSystem
    turn: Matrix | None
    dofs: tuple[Dof, ...]
    equations: Matrix
    kept: IntArray

    @classmethod
    def of(cls, free: FreeRows, options: MatrixOptions) -> ExportedRows:
        """Turn nodes' own axes to those of the whole.

        Parameters
        ----------
        free : FreeRows
            Rows that are not those of held DOFs.
        options : MatrixOptions
            Units and axes.

        Returns
        -------
        ExportedRows
            Without multipliers known.
        """
        dofs, turn, equations = free.dofs, None, sparse.csr_array((0, len(free.dofs)))
        if any(dof.node in options.axes for dof in free.dofs):
            dofs, turn, equations = _turned(free.dofs, options.axes)
        return cls(
            free=free,
            units=options.units,
            turn=turn,
            dofs=dofs,
            equations=equations,
            kept=np.arange(len(dofs)),
        )

    def block(self, what: str, matrix: Matrix) -> Matrix:
        """Bring a matrix of a file to the axes of the whole and to SI.

        Parameters
        ----------
        what : str
            ``mass``, ``damping``, ``stiffness`` or ``structural``.
        matrix : sparse array
            As exported.

        Returns
        -------
        (n, n) sparse array
            With the rows of multipliers.

        Raises
        ------
        InputError
            If it is not symmetric.
        """
        rows = self.free.rows
        try:
            block = symmetrise(matrix[rows][:, rows], rows=rows)
        except InputError as error:
            if what != STRUCTURAL:
                raise
            raise InputError(f"has an imaginary part that {error}") from None
        block = self.units.matrix_in_si("stiffness" if what == STRUCTURAL else what, block, self.free.dofs)
        return block if self.turn is None else sparse.csr_array(self.turn.T @ block @ self.turn)


def _turned(dofs: Sequence[Dof], axes: Mapping[int, FloatArray]) -> tuple[tuple[Dof, ...], Matrix, Matrix]:
    """DOFs along the axes of the whole, the motions along nodes' own axes by them, and what holds them."""
    triads = (DIRECTIONS[:3], DIRECTIONS[3:])
    turned: dict[Dof, int] = {}
    rows, columns, values = [], [], []
    known = set(dofs)
    missing = []
    for row, dof in enumerate(dofs):
        triad = next((names for names in triads if dof.direction in names), ())
        own = axes.get(dof.node) if triad else None
        if own is None:
            rows.append(row)
            columns.append(turned.setdefault(dof, len(turned)))
            values.append(1.0)
            continue
        whole = [Dof(dof.node, direction) for direction in triad]
        is_first = whole[0] not in turned
        places = [turned.setdefault(motion, len(turned)) for motion in whole]
        rows += [row] * 3
        columns += places
        values += own[triad.index(dof.direction)].tolist()
        if is_first:
            missing += [(places, own[axis]) for axis, motion in enumerate(whole) if motion not in known]
    turn = sparse.csr_array(sparse.coo_array((values, (rows, columns)), shape=(len(dofs), len(turned))))
    equations = np.zeros((len(missing), len(turned)))
    for number, (places, axis) in enumerate(missing):
        equations[number, places] = axis
    return tuple(turned), turn, sparse.csr_array(equations)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ModelMatrices:
    """Matrices of a structure, and how they came about.

    Parameters
    ----------
    dofs : tuple of Dof
        Their rows.
    mass, stiffness, damping, structural_damping : (n, n) sparse array
        kg, N/m, N s/m and N/m (and their rotational counterparts); the last two are empty where there is none.
    motions : AdmissibleMotions, optional
        Where constraint equations join DOFs.
    n_massless : int
        Motions without mass.
    held_dofs : tuple of Dof
        DOFs whose rows were left out.
    supports : mapping of int to str
        Nodes with such DOFs.
    rounding : float
        Relative rounding of the stiffness.
    notes : tuple of str
        What was recognised.
    exported : ExportedRows
        How the rows became those of files.
    """

    dofs: tuple[Dof, ...]
    mass: Matrix
    stiffness: Matrix
    damping: Matrix
    structural_damping: Matrix
    motions: AdmissibleMotions | None
    n_massless: int
    held_dofs: tuple[Dof, ...]
    supports: Mapping[int, str]
    rounding: float
    notes: tuple[str, ...]
    exported: ExportedRows

    @classmethod
    def of(
        cls,
        matrices: Mapping[str, Matrix],
        dofs: Sequence[Dof],
        options: MatrixOptions,
        *,
        errors: Callable[[str], AbstractContextManager[None]],
    ) -> ModelMatrices:
        """Check matrices, and bring them to SI.

        Parameters
        ----------
        matrices : mapping of str to (n, n) sparse array
            ``mass``, ``stiffness`` and perhaps ``damping``, as exported. The stiffness may be complex.
        dofs : sequence of Dof
            One a row.
        options : MatrixOptions
            How they are to be taken.
        errors : callable
            Given the name of a matrix: a context that says in an error which it is.

        Returns
        -------
        ModelMatrices
            The matrices.

        Raises
        ------
        InputError
            If a value is not finite, a matrix is not symmetric, or none that a structure has.
        """
        whole = {what: matrix for what, matrix in matrices.items() if what != "stiffness"}
        whole["stiffness"], imaginary = _real_and_imaginary(matrices["stiffness"])
        if imaginary is not None:
            whole[STRUCTURAL] = imaginary
        free = select_free_rows(whole, dofs, options)
        exported = ExportedRows.of(free, options)
        rounding = printed_rounding(whole["stiffness"][free.rows][:, free.rows].data)
        notes = list(free.notes)
        if not options.units.is_si:
            notes.append(f"matrices and coordinates are brought from {options.units.name} to SI")
        blocks = {}
        for what, matrix in whole.items():
            with errors("stiffness" if what == STRUCTURAL else what):
                blocks[what] = exported.block(what, matrix)
        if STRUCTURAL in blocks:
            share = float(abs(blocks[STRUCTURAL]).sum() / abs(blocks["stiffness"]).sum())
            notes.append(
                f"the imaginary part of the stiffness, {share:.2g} of the real one, is structural damping, "
                "K (1 + i eta); it adds to the damping that the model states"
            )
        blocks["stiffness"] = _without_feigned_couplings(blocks["stiffness"], exported.dofs)
        multipliers = find_multipliers(blocks["mass"], blocks["stiffness"])
        equations = exported.equations
        if multipliers.any() and not multipliers.all():
            kept = np.flatnonzero(~multipliers)
            blocks["stiffness"], further = eliminate_multipliers(blocks["stiffness"], multipliers)
            for what in blocks.keys() - {"stiffness"}:
                blocks[what] = sparse.csr_array(blocks[what][kept][:, kept])
            exported = replace(exported, kept=kept)
            equations = sparse.csr_array(sparse.vstack([equations[:, kept], further]))
            notes.append(
                f"{int(multipliers.sum())} rows are Lagrange multipliers: replaced by the constraint equations that "
                "they stand for"
            )
        with errors("stiffness"):
            motions = solve_equations(equations) if equations.nnz else None
        none = sparse.csr_array(blocks["mass"].shape, dtype=np.float64)
        made = cls(
            dofs=tuple(exported.dofs[row] for row in exported.kept.tolist()),
            mass=blocks["mass"],
            stiffness=blocks["stiffness"],
            damping=blocks.get("damping", none),
            structural_damping=blocks.get(STRUCTURAL, none),
            motions=motions,
            held_dofs=free.held_dofs,
            supports=free.supports,
            rounding=rounding,
            n_massless=0,
            notes=tuple(notes),
            exported=exported,
        )
        n_massless = made._count_massless(errors, allow_negative_stiffness=options.allow_negative_stiffness)
        if n_massless:
            notes.append(f"motions without mass: {n_massless}, which follow the others statically")
        return replace(made, n_massless=n_massless, notes=tuple(notes))

    def part(self, what: str, matrix: Matrix) -> Matrix:
        """Bring the matrix of a part of the structure to the same rows and units.

        Parameters
        ----------
        what : str
            ``mass`` or ``stiffness``.
        matrix : sparse array
            As exported, of the order of the whole.

        Returns
        -------
        (n, n) sparse array
            In SI.

        Raises
        ------
        InputError
            If it is not symmetric.
        """
        kept = self.exported.kept
        return sparse.csr_array(self.exported.block(what, matrix)[kept][:, kept])

    def _count_massless(
        self, errors: Callable[[str], AbstractContextManager[None]], *, allow_negative_stiffness: bool
    ) -> int:
        """Count motions without mass, and require that the matrices are those of a structure."""
        dofs = self.dofs
        mass, stiffness, damping, structural = self.mass, self.stiffness, self.damping, self.structural_damping
        if self.motions is not None:
            mass, stiffness, damping, structural = map(self.motions.reduced, (mass, stiffness, damping, structural))
            dofs = tuple(dofs[row] for row in self.motions.independent.tolist())
        with errors("mass"):
            n_massless = count_massless_motions(mass, stiffness, dofs)
        with errors("stiffness"):
            if not allow_negative_stiffness:
                require_semidefinite(stiffness, dofs, "stiffness", rounding=self.rounding)
            require_semidefinite(structural, dofs, "imaginary part of the stiffness", rounding=self.rounding)
        with errors("damping"):
            require_semidefinite(damping, dofs, "damping", rounding=printed_rounding(damping.data))
        return n_massless


def _real_and_imaginary(stiffness: Any) -> tuple[Matrix, Matrix | None]:  # noqa: ANN401 - real or complex
    """Split K (1 + i eta); None without an imaginary part."""
    if not np.iscomplexobj(stiffness.data):
        return stiffness, None
    imaginary = sparse.csr_array(stiffness.imag)
    is_rounding = abs(imaginary).sum() <= NO_DAMPING * abs(stiffness).sum()
    return sparse.csr_array(stiffness.real), None if is_rounding else imaginary


def _without_feigned_couplings(stiffness: Matrix, dofs: Sequence[Dof]) -> Matrix:
    """Clear what the rounding of a reduction leaves between the modes of a super-element and its other motions.

    Under a rigid motion it is a force that no sum of larger terms excuses.
    """
    generalised = np.array([dof.direction == GENERALISED for dof in dofs])
    if not generalised.any():
        return stiffness
    entries = sparse.coo_array(stiffness)
    size = np.sqrt(np.abs(stiffness.diagonal()))
    is_across = generalised[entries.row] != generalised[entries.col]
    is_real = ~is_across | (np.abs(entries.data) > FEIGNED * size[entries.row] * size[entries.col])
    places = (entries.row[is_real], entries.col[is_real])
    return sparse.csr_array(sparse.coo_array((entries.data[is_real], places), shape=stiffness.shape))
