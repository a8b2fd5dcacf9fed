"""``kind = "matrices"``: mass and stiffness matrices that another FE program exported."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np
from scipy import sparse

from frf_ipz.arrays import FloatArray, IntArray
from frf_ipz.dofs import GENERALISED, Dof
from frf_ipz.errors import FileFormatError, errors_of_file
from frf_ipz.fe.assembly import stated_damping
from frf_ipz.fe.matrices.registry import read_matrix
from frf_ipz.fe.matrices.row_tables import read_rows
from frf_ipz.fe.matrices.stored import MatrixRequest, StoredMatrix
from frf_ipz.fe.model_options import DampingSection, ModelSection, PortSection
from frf_ipz.meshes.registry import read_mesh
from frf_ipz.numerics.structural_matrices import MatrixOptions, ModelMatrices
from frf_ipz.option_types import Name, Truth
from frf_ipz.structure import Part, StructuralModel, drawn_geometry
from frf_ipz.toml_files import STRICT
from frf_ipz.unit_systems import SI

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from frf_ipz.arrays import Matrix
    from frf_ipz.structure import Mesh

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
        File of a matrix, of the order of the whole.
    mass : str, optional
        The same for its mass.
    """

    __pydantic_config__ = STRICT

    name: Name
    stiffness: Name
    mass: Name | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class MatrixNames:
    """``variables = { mass, stiffness, damping }``: what matrices are called in files that hold several.

    Parameters
    ----------
    mass, stiffness, damping : str, optional
        Names; by default the usual ones, such as ``M``, ``MAA`` or ``mass``.
    """

    __pydantic_config__ = STRICT

    mass: str = ""
    stiffness: str = ""
    damping: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class MatricesOptions:
    """``[matrices]``: files with the matrices and with what their rows are.

    Parameters
    ----------
    mass, stiffness : str
        File of a matrix, in any format that is read; one file may hold both.
    dofs : str, optional
        File that names the rows: CSV, CalculiX's ``.dof``, Ansys's ``.mapping``, Nastran's ``.op2`` or ``.asm``. Not
        needed where the files of the matrices name them.
    damping : str, optional
        File of viscous damping.
    nodes : str, optional
        Where nodes are, if the rows' file does not say it, and what lies between them, for the drawing: a deck
        (``.inp``, ``.bdf``), a universal file, an archive of Ansys (``.cdb``), a mesh (``.msh``, ``.vtu``, ...); or
        positions alone as CSV ``node,x,y,z``.
    variables : MatrixNames, optional
        What the matrices are called in files that hold several.
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
    dofs: Name | None = None
    damping: Name | None = None
    nodes: Name | None = None
    variables: MatrixNames | None = None
    group: tuple[MatrixGroup, ...] = ()
    held: Literal["auto", "keep"] = "auto"
    allow_negative_stiffness: Truth = False


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
    port : tuple of PortSection
        ``[[port]]``.
    """

    __pydantic_config__ = STRICT

    model: ModelSection
    matrices: MatricesOptions
    damping: DampingSection | None = None
    port: tuple[PortSection, ...] = ()


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
    names = [options.mass, options.stiffness, options.damping, options.dofs, options.nodes]
    names += [name for group in options.group for name in (group.stiffness, group.mass)]
    return tuple(dict.fromkeys(path.parent / name for name in names if name is not None))


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
    names = {"stiffness": options.stiffness, "mass": options.mass}
    if options.damping is not None:
        names["damping"] = options.damping
    units = file.model.system
    files = _Files.read(path, options, names, units.length_m)
    matrices = ModelMatrices.of(
        {what: stored.matrix for what, stored in files.whole.items()},
        files.dofs,
        MatrixOptions(
            held=options.held,
            units=units,
            allow_negative_stiffness=options.allow_negative_stiffness,
            axes=files.axes,
        ),
        errors=lambda what: errors_of_file(path.parent / names.get(what, options.stiffness)),
    )
    nodes, positions, is_schematic = files.places()
    model = StructuralModel.from_model_matrices(
        matrices,
        name=file.model.name,
        geometry=drawn_geometry(
            matrices, nodes, units.length_m * positions, is_schematic=is_schematic, mesh=files.mesh
        ),
        modal_damping=np.zeros(0),
        allow_negative_stiffness=options.allow_negative_stiffness,
    )
    modal_damping, damping = stated_damping(file.damping, model.mass, model.stiffness)
    return replace(
        model,
        modal_damping=modal_damping,
        damping_all=sparse.csr_array(damping + model.damping),
        parts=_groups(files, matrices),
        notes=(
            *(note for what in ("mass", "stiffness", "damping") for note in files.notes(what)),
            *(_about_metres(positions) if files.takes_metres and not is_schematic and file.model.units == SI else ()),
            *model.notes,
        ),
        source=file,
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Files:
    """The files of a model: its matrices, with all rows in one order."""

    path: Path
    options: MatricesOptions
    dofs: tuple[Dof, ...]
    ordered_by: str
    axes: Mapping[int, FloatArray]
    positions: Mapping[int, Sequence[float]]
    whole: Mapping[str, StoredMatrix]
    mesh: Mesh | None
    takes_metres: bool

    @classmethod
    def read(cls, path: Path, options: MatricesOptions, names: Mapping[str, str], unit_m: float) -> _Files:
        table = read_rows(path.parent / options.dofs) if options.dofs is not None else None
        ordered_by = options.dofs or options.stiffness
        if table is not None and table.choices:
            stiffness = _read_one(path, "stiffness", options.stiffness, options, order=None, ordered_by="")
            table = table.of_order(stiffness.matrix.shape[0])
        order = None if table is None else len(table.dofs)
        whole: dict[str, StoredMatrix] = {}
        dofs = () if table is None else table.dofs
        scale = 1.0 if table is None else (table.unit_m or unit_m) / unit_m
        positions: dict[int, Sequence[float]] = {
            node: tuple(scale * place for place in xyz) for node, xyz in (table.positions.items() if table else ())
        }
        for what, name in names.items():
            stored = _read_one(path, what, name, options, order=order, ordered_by=ordered_by)
            if not dofs:
                if stored.dofs is None:
                    raise FileFormatError(
                        path, f"{name} does not say what its rows are; name a file that does: dofs = \"dofs.csv\"",
                        where="key 'matrices.dofs'",
                    )  # fmt: skip
                dofs = stored.dofs
            positions = {**stored.positions, **positions}
            whole[what] = stored.in_rows(dofs, path.parent / name, ordered_by)
        mesh = None
        if options.nodes is not None:
            stored_mesh = read_mesh(path.parent / options.nodes)
            scale = (stored_mesh.unit_m or unit_m) / unit_m
            positions = {node: (scale * x, scale * y, scale * z) for node, (x, y, z) in stored_mesh.positions.items()}
            mesh = stored_mesh.drawn(unit_m)
        axes = {} if table is None else table.axes
        takes_metres = table is not None and table.without_unit and mesh is None
        return cls(
            path=path, options=options, dofs=dofs, ordered_by=ordered_by, axes=axes, positions=positions, whole=whole,
            mesh=mesh, takes_metres=takes_metres,
        )  # fmt: skip

    def notes(self, what: str) -> tuple[str, ...]:
        return self.whole[what].notes if what in self.whole else ()

    def places(self) -> tuple[IntArray, FloatArray, bool]:
        """Nodes, ascending, their positions, and whether these are none: then nodes stand in a row."""
        nodes = sorted({dof.node for dof in self.dofs})
        structural = {dof.node for dof in self.dofs if dof.direction != GENERALISED}
        missing = [node for node in nodes if node in structural and node not in self.positions]
        if missing and self.options.nodes is not None:
            raise FileFormatError(
                self.path.parent / self.options.nodes, f"has no position of node {missing[0]}, which the matrices name"
            )
        if missing:
            return np.array(nodes), np.array([(float(place), 0.0, 0.0) for place in range(len(nodes))]), True
        places = [tuple(self.positions.get(node, (0.0, 0.0, 0.0))) for node in nodes]
        return np.array(nodes), np.array(places, float), False

    def part(self, matrices: ModelMatrices, what: str, name: str) -> Matrix:
        stored = _read_one(
            self.path, what, name, self.options, order=len(self.dofs), ordered_by=self.ordered_by, is_part=True
        )
        with errors_of_file(self.path.parent / name):
            return matrices.part(what, stored.in_rows(self.dofs, self.path.parent / name, self.ordered_by).matrix)


def _read_one(
    path: Path,
    what: str,
    name: str,
    options: MatricesOptions,
    *,
    order: int | None,
    ordered_by: str,
    is_part: bool = False,
) -> StoredMatrix:
    variable = "" if is_part or options.variables is None else getattr(options.variables, what)
    request = MatrixRequest(path=path.parent / name, what=what, variable=variable, order=order, ordered_by=ordered_by)
    return read_matrix(request)


def _about_metres(positions: FloatArray) -> tuple[str, ...]:
    """Say what coordinates without a unit are taken for, and how large the structure is then."""
    size_m = float(np.ptp(positions, axis=0).max(initial=0.0))
    if size_m == 0.0:
        return ()
    taken = f"coordinates under x, y, z are taken for metres: the structure is {size_m:.4g} m long"
    return (f"{taken}; call the columns x_m, y_m, z_m where that is right, else bring them to metres",)


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
