"""``kind = "matrices"``: mass and stiffness matrices that another FE program exported."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np
from scipy import sparse

from frf_ipz.arrays import IntArray
from frf_ipz.errors import FileFormatError, errors_of_file
from frf_ipz.fe.assembly import stated_damping
from frf_ipz.fe.matrices.dof_table import DofTable, read_dof_table
from frf_ipz.fe.matrices.matrix_market import MatrixFile, read_matrix_market
from frf_ipz.fe.model_options import DampingSection, ModelSection
from frf_ipz.numerics.structural_matrices import MatrixOptions, ModelMatrices
from frf_ipz.option_types import Name
from frf_ipz.structure import Part, StructuralModel, drawn_geometry
from frf_ipz.toml_files import STRICT

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from frf_ipz.arrays import Matrix
    from frf_ipz.dofs import Dof

KIND = "matrices"
SUM_TOLERANCE = 1e-6  # of a diagonal entry: rounding of printed groups may add up to that


@dataclass(frozen=True, slots=True, kw_only=True)
class MatrixGroup:
    """``[[matrices.group]]``: an additive part of the matrices.

    Parameters
    ----------
    name : str
        As the user calls it.
    stiffness : str
        Matrix Market file, of the order of the whole.
    mass : str, optional
        The same for its mass.
    """

    __pydantic_config__ = STRICT

    name: Name
    stiffness: Name
    mass: Name | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class MatricesOptions:
    """``[matrices]``: files with the matrices and with what their rows are.

    Parameters
    ----------
    mass, stiffness : str
        Matrix Market file.
    dofs : str
        CSV file that names the rows.
    damping : str, optional
        Matrix Market file of viscous damping.
    group : tuple of MatrixGroup
        Additive parts of the matrices, which may be softer, stiffer, lighter or heavier than they should be.
    held : str
        ``auto``: rows that are zero, rows of the identity, and rows with a penalty such as 1e36 on the diagonal are
        held DOFs, which are left out; ``keep``: all rows are taken as they are.
    allow_negative_stiffness : bool
        The stiffness may have negative eigenvalues: magnets, buckling. Such a mode has a real pole that is unstable.
    """

    __pydantic_config__ = STRICT

    mass: Name
    stiffness: Name
    dofs: Name
    damping: Name | None = None
    group: tuple[MatrixGroup, ...] = ()
    held: Literal["auto", "keep"] = "auto"
    allow_negative_stiffness: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class MatricesFile:
    """A whole ``model.toml`` of matrices.

    Parameters
    ----------
    model : ModelSection
        ``[model]``.
    matrices : MatricesOptions
        ``[matrices]``.
    damping : DampingSection, optional
        ``[damping]``.
    """

    __pydantic_config__ = STRICT

    model: ModelSection
    matrices: MatricesOptions
    damping: DampingSection | None = None


FILE = MatricesFile


def files(file: MatricesFile, path: Path) -> tuple[Path, ...]:
    """Files besides ``model.toml``.

    Parameters
    ----------
    file : MatricesFile
        Content of ``model.toml``.
    path : Path
        Its path.

    Returns
    -------
    tuple of Path
        Matrices and the table of DOFs.
    """
    options = file.matrices
    names = [options.mass, options.stiffness, options.damping, options.dofs]
    names += [name for group in options.group for name in (group.stiffness, group.mass)]
    return tuple(path.parent / name for name in names if name is not None)


def read(file: MatricesFile, path: Path) -> StructuralModel:
    """Read the matrices, check them, and build a model.

    Parameters
    ----------
    file : MatricesFile
        Content of ``model.toml``.
    path : Path
        Its path.

    Returns
    -------
    StructuralModel
        The model with its groups as parts. Its notes say how the files were taken, and which rows were left out as
        those of held DOFs.

    Raises
    ------
    FileFormatError
        If a file cannot be read, sizes disagree, a matrix is not symmetric, the mass is not positive definite,
        stiffness or damping is indefinite, or groups add up to more than the whole.
    """
    options = file.matrices
    files = _Files(path=path, table=read_dof_table(path.parent / options.dofs), options=options)
    names = {"mass": options.mass, "stiffness": options.stiffness}
    if options.damping is not None:
        names["damping"] = options.damping
    whole = {what: files.read(name) for what, name in names.items()}
    table, units = files.table, file.model.system
    matrices = ModelMatrices.of(
        {what: matrix.matrix for what, matrix in whole.items()},
        table.dofs,
        MatrixOptions(
            held=options.held,
            units=units,
            allow_negative_stiffness=options.allow_negative_stiffness,
            axes=table.axes,
        ),
        errors=lambda what: errors_of_file(path.parent / names.get(what, options.stiffness)),
    )
    model = StructuralModel.from_model_matrices(
        matrices,
        name=file.model.name,
        geometry=drawn_geometry(matrices, table.nodes, units.length_m * table.coordinates),
        modal_damping=np.zeros(0),
        allow_negative_stiffness=options.allow_negative_stiffness,
    )
    modal_damping, damping = stated_damping(file.damping, model.mass, model.stiffness)
    return replace(
        model,
        modal_damping=modal_damping,
        damping_all=sparse.csr_array(damping + model.damping),
        parts=_groups(files, matrices),
        notes=(*(note for matrix in whole.values() for note in matrix.notes), *model.notes),
        source=file,
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Files:
    """The files of a model."""

    path: Path
    table: DofTable
    options: MatricesOptions

    def read(self, name: str) -> MatrixFile:
        return read_matrix_market(self.path.parent / name, len(self.table.dofs), self.options.dofs)

    def part(self, matrices: ModelMatrices, what: str, name: str) -> Matrix:
        with errors_of_file(self.path.parent / name):
            return matrices.part(what, self.read(name).matrix)


def _groups(files: _Files, matrices: ModelMatrices) -> tuple[Part, ...]:
    options, mass, stiffness = files.options, matrices.mass, matrices.stiffness
    repeated = next((name for name, count in Counter(group.name for group in options.group).items() if count > 1), None)
    if repeated is not None:
        raise FileFormatError(
            files.path, f"two groups are called '{repeated}'; rename one", where="key 'matrices.group'"
        )
    parts, remaining_stiffness, remaining_mass = [], stiffness.diagonal(), mass.diagonal()
    for group in options.group:
        group_stiffness = files.part(matrices, "stiffness", group.stiffness)
        group_mass = (
            files.part(matrices, "mass", group.mass)
            if group.mass is not None
            else sparse.csr_array(stiffness.shape, dtype=np.float64)
        )
        parts.append(_group_part(group.name, matrices.dofs, group_mass, group_stiffness))
        remaining_stiffness = remaining_stiffness - group_stiffness.diagonal()
        remaining_mass = remaining_mass - group_mass.diagonal()
    for what, remaining, whole in (("stiffness", remaining_stiffness, stiffness), ("mass", remaining_mass, mass)):
        excess = -remaining - SUM_TOLERANCE * whole.diagonal()
        if excess.max() > 0:
            dof = matrices.dofs[int(np.argmax(excess))]
            raise FileFormatError(
                files.path,
                f"the groups' {what} adds up to more than the whole at the DOF {dof.name}; groups have to be additive "
                "parts of the model's matrices, in the same units",
                where="key 'matrices.group'",
            )
    return tuple(parts)


def _group_part(name: str, dofs: Sequence[Dof], mass: Matrix, stiffness: Matrix) -> Part:
    indices: IntArray = np.union1d(_used_rows(mass), _used_rows(stiffness)).astype(np.int64)
    return Part(
        kind="group",
        name=name,
        nodes=tuple(sorted({dofs[index].node for index in indices.tolist()})),
        indices=indices,
        stiffness=stiffness[indices][:, indices],
        mass=mass[indices][:, indices],
    )


def _used_rows(matrix: Matrix) -> IntArray:
    entries = sparse.coo_array(matrix)
    return np.unique(entries.row[entries.data != 0]).astype(np.int64)
