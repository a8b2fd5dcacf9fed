"""``kind = "matrices"``: mass and stiffness matrices that another FE program exported."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from frf_ipz.arrays import IntArray
from frf_ipz.errors import FileFormatError, errors_of_file
from frf_ipz.fe.assembly import stated_damping
from frf_ipz.fe.matrices.dof_table import DofTable, read_dof_table
from frf_ipz.fe.matrices.matrix_market import read_symmetric
from frf_ipz.fe.model_options import DampingSection, ModelSection
from frf_ipz.numerics.definiteness import require_positive_definite_mass, require_semidefinite
from frf_ipz.numerics.neighbours import lines_between_neighbours
from frf_ipz.option_types import Name
from frf_ipz.structure import Geometry, Part, StructuralModel
from frf_ipz.toml_files import STRICT

if TYPE_CHECKING:
    from pathlib import Path

    from frf_ipz.arrays import Matrix

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
    """

    __pydantic_config__ = STRICT

    mass: Name
    stiffness: Name
    dofs: Name
    damping: Name | None = None
    group: tuple[MatrixGroup, ...] = ()


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
        The model with its groups as parts. No DOF is held: supports are not part of exported matrices.

    Raises
    ------
    FileFormatError
        If a file cannot be read, sizes disagree, a matrix is not symmetric, the mass is not positive definite,
        stiffness or damping is indefinite, or groups add up to more than the whole.
    """
    options, folder = file.matrices, path.parent
    table = read_dof_table(folder / options.dofs)
    mass = _matrix(folder / options.mass, table, options)
    with errors_of_file(folder / options.mass):
        require_positive_definite_mass(mass, table.dofs)
    stiffness = _matrix(folder / options.stiffness, table, options)
    with errors_of_file(folder / options.stiffness):
        require_semidefinite(stiffness, table.dofs, "stiffness")
    modal_damping, damping = stated_damping(file.damping, mass, stiffness)
    if options.damping is not None:
        exported = _matrix(folder / options.damping, table, options)
        with errors_of_file(folder / options.damping):
            require_semidefinite(exported, table.dofs, "damping")
        damping = sparse.csr_array(damping + exported)
    return StructuralModel(
        name=file.model.name,
        kind=KIND,
        all_dofs=table.dofs,
        fixed=np.zeros(len(table.dofs), bool),
        mass_all=mass,
        stiffness_all=stiffness,
        damping_all=damping,
        modal_damping=modal_damping,
        geometry=Geometry(
            nodes=table.nodes,
            coordinates_m=table.coordinates_m,
            lines=lines_between_neighbours(stiffness, table.dofs, table.nodes, table.coordinates_m),
        ),
        parts=_groups(options, path, table, mass, stiffness),
        source=file,
    )


def _matrix(path: Path, table: DofTable, options: MatricesOptions) -> Matrix:
    return read_symmetric(path, len(table.dofs), options.dofs)


def _groups(options: MatricesOptions, path: Path, table: DofTable, mass: Matrix, stiffness: Matrix) -> tuple[Part, ...]:
    repeated = next((name for name, count in Counter(group.name for group in options.group).items() if count > 1), None)
    if repeated is not None:
        raise FileFormatError(path, f"two groups are called '{repeated}'; rename one", where="key 'matrices.group'")
    parts, remaining_stiffness, remaining_mass = [], stiffness.diagonal(), mass.diagonal()
    for group in options.group:
        group_stiffness = _matrix(path.parent / group.stiffness, table, options)
        group_mass = (
            _matrix(path.parent / group.mass, table, options)
            if group.mass is not None
            else sparse.csr_array(stiffness.shape, dtype=np.float64)
        )
        parts.append(_group_part(group.name, table, group_mass, group_stiffness))
        remaining_stiffness = remaining_stiffness - group_stiffness.diagonal()
        remaining_mass = remaining_mass - group_mass.diagonal()
    for what, remaining, whole in (("stiffness", remaining_stiffness, stiffness), ("mass", remaining_mass, mass)):
        excess = -remaining - SUM_TOLERANCE * whole.diagonal()
        if excess.max() > 0:
            dof = table.dofs[int(np.argmax(excess))]
            raise FileFormatError(
                path,
                f"the groups' {what} adds up to more than the whole at the DOF {dof.name}; groups have to be additive "
                "parts of the model's matrices, in the same units",
                where="key 'matrices.group'",
            )
    return tuple(parts)


def _group_part(name: str, table: DofTable, mass: Matrix, stiffness: Matrix) -> Part:
    indices: IntArray = np.union1d(_used_rows(mass), _used_rows(stiffness)).astype(np.int64)
    return Part(
        kind="group",
        name=name,
        nodes=tuple(sorted({table.dofs[index].node for index in indices.tolist()})),
        indices=indices,
        stiffness=stiffness[indices][:, indices],
        mass=mass[indices][:, indices],
    )


def _used_rows(matrix: Matrix) -> IntArray:
    entries = sparse.coo_array(matrix)
    return np.unique(entries.row[entries.data != 0]).astype(np.int64)
