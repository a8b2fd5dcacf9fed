"""FE models among the files of a folder: which files belong together, what their matrices, rows and nodes are.

What a file says itself goes first (formats of one matrix, names within a file, titles), then names of files. Matrices
that nothing names are told apart by size: the highest squared frequency of a mesh, stiffness over mass, is far above 1
in each system of units that a deck has.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import linalg

from frf_ipz.dofs import GENERALISED
from frf_ipz.errors import FileFormatError, InputError
from frf_ipz.fe.matrices.registry import matrix_names, read_matrix
from frf_ipz.fe.matrices.row_tables import read_rows
from frf_ipz.fe.matrices.stored import NAMES, MatrixRequest
from frf_ipz.input_files import open_input, read_bytes
from frf_ipz.meshes.registry import read_mesh
from frf_ipz.numerics.definiteness import symmetrise

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    from frf_ipz.dofs import Dof
    from frf_ipz.fe.matrices.stored import StoredMatrix
    from frf_ipz.meshes.mesh_file import StoredMesh

KINDS = ("stiffness", "mass", "damping")
ONE_MATRIX = {".sti": "stiffness", ".mas": "mass", ".dam": "damping"}
TITLED = {".hb", ".hbm", ".rsa", ".rua", ".matrix"}  # Harwell-Boeing
TEXTS_OF_ONE = {*ONE_MATRIX, *TITLED, ".mtx"}
TITLE = 72  # columns
NASTRAN = {".op4", ".pch", ".dmig", ".bdf", ".dat", ".nas", ".bulk", ".blk"}  # may hold matrices by name
FULL, OUTPUT4 = ".full", ".op4"
NAMING = (NASTRAN - {OUTPUT4}) | {FULL}  # say what their rows are
ARRAYS = {".npz", ".npy"}  # matrices where they are called so, else recordings or FRFs
ARRAYS_OF_BOTH = {".mat", ".npz"}
HEAD_BYTES = 4096
PACKED = {".gz", ".bz2"}
ROWS = {".dof", ".mapping", ".op2", ".asm"}
MESHES = {".inp", ".bdf", ".dat", ".nas", ".bulk", ".blk", ".cdb", ".unv", ".uff"}
RECORDED, GRID = ".dat", b"GRID"  # a suffix that recordings have too, and what a deck has
UNNUMBERED = {".msh", ".vtu", ".vtk", ".mesh", ".meshb", ".su2", ".ugrid", ".avs"}  # nodes count through from 1
DECKS = {FULL, OUTPUT4, *ONE_MATRIX, *TITLED, ".pch", ".dmig", *ROWS}
MODEL_SUFFIXES = (DECKS | MESHES | UNNUMBERED) - {".dat", ".unv", ".uff"}  # nothing that was measured has these
MATRIX = re.compile(
    r"^(?:(?P<stiffness>k|stiff\w*)|(?P<mass>m|mass)|(?P<damping>[bcd]|damp\w*))(?:[_-](?P<group>.+))?$", re.I
)
WORDS = {  # of names and titles; those with a number are Abaqus's
    "stiffness": re.compile(r"stif(f(ness)?)?\d*", re.I),
    "mass": re.compile(r"mass\d*", re.I),
    "damping": re.compile(r"(damp(ing)?|dmpv)\d*", re.I),
}
PARTS = re.compile(r"[^A-Za-z0-9]+")
IN_SI = (".npz", ".npy", ".mat")  # their users write them; programs write their own units
MARKET = "%%matrixmarket"
PRINTED = 1e-3  # of the extent: a position in a field of eight columns may have four digits (-1.234-5)


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundModel:
    """Files of one FE model.

    Parameters
    ----------
    key : str
        What names of its files have in common.
    matrices : dict of str to Path
        ``stiffness``, ``mass``, ``damping``, as far as they are there.
    variables : dict of str to str
        What they are called in their files, where that is not usual.
    names_rows : bool
        The files of the matrices say themselves what their rows are.
    rows, nodes : Path, optional
        What the rows are, where nodes are.
    groups : dict of str to dict of str to Path
        Additive parts, by their names.
    guessed : frozenset of str
        What was guessed: kinds of matrices, ``rows``, ``nodes``.
    is_in_si : bool
        The files are of no FE program, which has units of its own.
    """

    key: str = ""
    matrices: dict[str, Path] = field(default_factory=dict)
    variables: dict[str, str] = field(default_factory=dict)
    names_rows: bool = False
    rows: Path | None = None
    nodes: Path | None = None
    groups: dict[str, dict[str, Path]] = field(default_factory=dict)
    guessed: frozenset[str] = frozenset()
    is_in_si: bool = True

    @property
    def has_both(self) -> bool:
        """Mass and stiffness are there."""
        return {"mass", "stiffness"} <= set(self.matrices)

    @property
    def is_complete(self) -> bool:
        """All that a model needs is there."""
        return self.has_both and (self.rows is not None or self.names_rows)

    @property
    def paths(self) -> tuple[Path, ...]:
        """Its files, each once."""
        parts = [path for part in self.groups.values() for path in part.values()]
        others = [path for path in (self.rows, self.nodes) if path is not None]
        return tuple(dict.fromkeys([*self.matrices.values(), *parts, *others]))


def find_models(files: Sequence[Path], tables: Sequence[Path], places: Sequence[Path]) -> list[FoundModel]:
    """Find FE models.

    Parameters
    ----------
    files : sequence of Path
        All files of a folder.
    tables, places : sequence of Path
        Those among them that are tables of DOFs, and of positions, as CSV.

    Returns
    -------
    list of FoundModel
        The one to take first: complete ones before others.
    """
    models = [
        model
        for _, in_folder in groupby(sorted(files), key=lambda path: path.parent)
        for model in _in_folder(list(in_folder))
    ]
    rows = [*tables, *(path for path in files if path.suffix.lower() in ROWS)]
    meshes = [*(path for path in files if path.suffix.lower() in MESHES | UNNUMBERED), *places]
    if not any(model.has_both for model in models):
        models += _of_arrays(files)[:1]
    models = [_with_rows_and_nodes(model, rows, meshes) for model in models]
    return sorted(models, key=lambda model: (not model.is_complete, not model.has_both))


def is_array_of_model(path: Path) -> bool:
    """Tell whether a file of arrays is called as matrices are.

    Parameters
    ----------
    path : Path
        Any file.

    Returns
    -------
    bool
        True for ``K.npz``, ``M_bracket.npy`` and the like.
    """
    return path.suffix.lower() in ARRAYS and MATRIX.match(path.stem) is not None


def _in_folder(files: Sequence[Path]) -> list[FoundModel]:
    """Put together what the files of one folder have in common by their names."""
    found: dict[str, FoundModel] = {}
    unnamed: dict[str, Path] = {}
    whole: list[FoundModel] = []
    for path in files:
        suffix = _suffix(path)
        names = _names(path) if suffix in NASTRAN else ()
        if suffix == FULL:
            whole.append(_of_one_file(path))
        elif len(names) > 1:
            whole += _of_names(path, names)
        elif suffix in {*TEXTS_OF_ONE, OUTPUT4} or names or is_array_of_model(path):
            kind, key, is_stated = _kind_and_key(path, names)
            model = found.get(key, FoundModel(key=key))
            if kind and kind not in model.matrices:
                guessed = model.guessed | (set() if is_stated else {kind})
                found[key] = replace(model, matrices={**model.matrices, kind: path}, guessed=guessed)
            elif not kind and suffix == OUTPUT4 and not names:  # nobody here can look into it
                whole.append(_of_one_file(path))
            elif not kind:
                unnamed[path.name] = path
    if not any(model.has_both for model in found.values()):
        whole += _of_files_without_names(unnamed)
    return [*_with_groups(found), *whole]


def _with_damping(path: Path, stiffness: StoredMatrix | None) -> FoundModel:
    """Take the damping of a file of several matrices too, where it has one of the stiffness's order."""
    damping = None if stiffness is None else _read(path, "damping")
    found = _of_one_file(path)
    if stiffness is None or damping is None or damping.matrix.shape != stiffness.matrix.shape:
        return found
    return replace(found, matrices={**found.matrices, "damping": path})


def _of_one_file(path: Path) -> FoundModel:
    return FoundModel(key=path.stem, matrices=dict.fromkeys(("mass", "stiffness"), path))


def _names(path: Path) -> tuple[str, ...]:
    try:
        return matrix_names(path)
    except FileFormatError:  # a deck without matrices, or its reader is not there
        return ()


def _of_names(path: Path, names: Sequence[str]) -> list[FoundModel]:
    """Take matrices of one file, by usual names, or else by their size."""
    if _usual("stiffness", names) and _usual("mass", names):
        return [_with_damping(path, _read(path, "stiffness"))]
    stored = {name: read for name in names if (read := _read(path, "stiffness", name)) is not None}
    variables = _told_apart(stored)
    matrices, guessed = dict.fromkeys(variables, path), frozenset(variables)
    return [FoundModel(key=path.stem, matrices=matrices, variables=variables, guessed=guessed)] if variables else []


def _usual(kind: str, names: Iterable[str]) -> str:
    by_name = {name.lower(): name for name in names}
    return next((by_name[name] for name in NAMES[kind] if name in by_name), "")


def _kind_and_key(path: Path, names: Sequence[str]) -> tuple[str, str, bool]:
    """Tell what a matrix is, what is left of the file's name without that, and whether the file says it itself."""
    stem, suffix = _stem(path), _suffix(path)
    if suffix in ONE_MATRIX:
        return ONE_MATRIX[suffix], stem, True
    if suffix in ARRAYS:
        match = MATRIX.match(stem)
        kind = next((kind for kind in KINDS if match and match[kind]), "")
        return kind, (match["group"] or "") if match else "", False
    words = PARTS.split(stem)
    ends = dict.fromkeys((0, len(words) - 1))
    by_word = [(kind, place) for place, word in enumerate(words) for kind in KINDS if WORDS[kind].fullmatch(word)]
    by_letter = [(kind, place) for place in ends for kind in KINDS if words[place].lower() in NAMES[kind]]
    kind, at = next(iter([*by_word, *by_letter]), ("", -1))
    key = "_".join(word for place, word in enumerate(words) if place != at) if kind else ""
    stated = next((kind for kind in KINDS if _usual(kind, names)), "") or _stated_by_title(path)
    return stated or kind, key, bool(stated)


def _stated_by_title(path: Path) -> str:
    words = PARTS.split(_first_line(path)[:TITLE]) if _suffix(path) in TITLED else []
    found = [kind for kind in KINDS if any(WORDS[kind].fullmatch(word) for word in words)]
    return found[0] if len(found) == 1 else ""


def _with_groups(found: Mapping[str, FoundModel]) -> list[FoundModel]:
    """Take ``K_bracket`` beside ``K`` for a part of it, where both have as many rows; else for a model of its own."""
    main = found.get("")
    if main is None or "stiffness" not in main.matrices:
        return list(found.values())
    parts = {key: model for key, model in found.items() if key and "stiffness" in model.matrices}
    orders = {key: _order(model.matrices["stiffness"]) for key, model in {"": main, **parts}.items()} if parts else {}
    groups: dict[str, dict[str, Path]] = {
        key: {kind: path for kind, path in model.matrices.items() if kind != "damping"}
        for key, model in parts.items()
        if orders[key] == orders[""] or "mass" not in model.matrices
    }
    others = [model for key, model in found.items() if key and key not in groups and model.has_both]
    return [replace(main, groups=groups), *others]


def _order(path: Path) -> int:
    stored = _read(path, "stiffness")
    return 0 if stored is None else stored.matrix.shape[0]


def _of_files_without_names(paths: Mapping[str, Path]) -> list[FoundModel]:
    stored = {name: read for name, path in paths.items() if (read := _read(path, "stiffness")) is not None}
    told = _told_apart(stored)
    matrices = {kind: paths[name] for kind, name in told.items()}
    return [FoundModel(matrices=matrices, guessed=frozenset(told))] if told else []


def _told_apart(stored: Mapping[str, StoredMatrix]) -> dict[str, str]:
    """Take the largest of the symmetric matrices of one order for the stiffness, the smallest for the mass."""
    candidates = {name: item.matrix for name, item in stored.items() if _may_be_of_a_structure(item)}
    orders = [matrix.shape[0] for matrix in candidates.values()]
    order = max(orders, key=lambda order: (orders.count(order), order), default=0)
    sizes = {name: float(linalg.norm(matrix)) for name, matrix in candidates.items() if matrix.shape[0] == order}
    if len(sizes) < 2:
        return {}
    return {"stiffness": max(sizes, key=lambda name: sizes[name]), "mass": min(sizes, key=lambda name: sizes[name])}


def _may_be_of_a_structure(stored: StoredMatrix) -> bool:
    """Leave out transformations, loads and matrices of zeros that an export has too."""
    try:
        symmetrise(stored.matrix)
    except InputError:
        return False
    return bool(stored.matrix.diagonal().real.sum() > 0)


def _of_arrays(files: Sequence[Path]) -> list[FoundModel]:
    """Files of arrays that hold both a stiffness and a mass."""
    found = []
    for path in files:
        if path.suffix.lower() not in ARRAYS_OF_BOTH:
            continue
        stiffness, mass = (_read(path, what) for what in ("stiffness", "mass"))
        if stiffness is None or mass is None or stiffness.matrix.shape != mass.matrix.shape:
            continue
        if (stiffness.matrix - mass.matrix).count_nonzero():
            found.append(_with_damping(path, stiffness))
    return found


def _with_rows_and_nodes(model: FoundModel, tables: Sequence[Path], meshes: Sequence[Path]) -> FoundModel:
    path = model.matrices.get("stiffness", next(iter(model.matrices.values())))
    stored = _read(path, "stiffness", model.variables.get("stiffness", ""))
    model = replace(
        model,
        is_in_si=_suffix(path) in IN_SI or (_suffix(path) == ".mtx" and _is_matrix_market(path)),
        names_rows=path.suffix.lower() in NAMING if stored is None else stored.dofs is not None,
    )
    by_distance = sorted(tables, key=lambda table: _distance(table, model))
    rows = _rows(model, stored, by_distance)
    if rows is None and by_distance and not model.names_rows:
        return replace(model, rows=by_distance[0], guessed=model.guessed | {"rows"})
    dofs: Sequence[Dof] = () if stored is None or stored.dofs is None else stored.dofs
    positions: dict[int, Sequence[float]] = {} if stored is None else dict(stored.positions)
    if rows is not None:
        table = read_rows(rows)
        dofs = (table if stored is None else table.of_order(stored.matrix.shape[0])).dofs
        positions = {**positions, **table.positions}
    needed = {dof.node for dof in dofs if dof.direction != GENERALISED}
    nodes = _nodes(needed, positions, sorted(meshes, key=lambda mesh: _distance(mesh, model)))
    is_guess = nodes is not None and nodes.suffix.lower() in UNNUMBERED and not positions
    return replace(model, rows=rows, nodes=nodes, guessed=model.guessed | ({"nodes"} if is_guess else set()))


def _distance(path: Path, model: FoundModel) -> tuple[bool, bool, bool, Path]:
    """Sort files by how far they are from a model's: in another folder, by another name."""
    stems = {model.key, *(_stem(matrix) for matrix in model.matrices.values())}
    parents = {matrix.parent for matrix in model.matrices.values()}
    return path.parent not in parents, path.stem not in stems, path.suffix.lower() != ".csv", path


def _rows(model: FoundModel, stored: StoredMatrix | None, tables: Sequence[Path]) -> Path | None:
    """Choose the table that has as many rows as the matrix; where the matrix names them, the same ones."""
    for table in tables:
        try:
            rows = read_rows(table)
        except FileFormatError:
            continue
        if stored is None:
            return None if model.names_rows else table
        dofs = rows.of_order(stored.matrix.shape[0]).dofs
        if set(dofs) == set(stored.dofs) if stored.dofs is not None else len(dofs) == stored.matrix.shape[0]:
            return table
    return None


def _nodes(needed: set[int], positions: Mapping[int, Sequence[float]], meshes: Sequence[Path]) -> Path | None:
    """Choose the mesh that has all nodes, where they are known to be; one with elements before one without."""
    fitting = []
    for path in meshes if needed else ():
        if path.suffix.lower() == RECORDED and GRID not in read_bytes(path):
            continue
        try:
            mesh = read_mesh(path)
        except FileFormatError:
            continue
        if needed <= set(mesh.positions) and _agrees(mesh, needed & set(positions), positions):
            fitting.append((path, bool(mesh.elements)))
    drawn = [path for path, has_elements in fitting if has_elements]
    plain = [path for path, _ in fitting] if not needed <= set(positions) else []
    return next(iter([*drawn, *plain]), None)


def _agrees(mesh: StoredMesh, nodes: set[int], positions: Mapping[int, Sequence[float]]) -> bool:
    if not nodes:
        return True
    order = sorted(nodes)
    stated = np.array([positions[node] for node in order], float)
    found = np.array([mesh.positions[node] for node in order], float) * (mesh.unit_m or 1.0)
    extent = float(np.ptp(stated, axis=0).max())
    return bool(np.abs(found - stated).max() <= PRINTED * (extent or np.abs(stated).max()))


def _read(path: Path, what: str, variable: str = "") -> StoredMatrix | None:
    try:
        return read_matrix(MatrixRequest(path=path, what=what, variable=variable))
    except FileFormatError:  # check says what is wrong with it
        return None


def _suffix(path: Path) -> str:
    suffix = path.suffix.lower()
    return path.with_suffix("").suffix.lower() if suffix in PACKED else suffix


def _stem(path: Path) -> str:
    return path.with_suffix("").stem if path.suffix.lower() in PACKED else path.stem


def _is_matrix_market(path: Path) -> bool:
    return path.suffix.lower() in PACKED or _first_line(path).lower().startswith(MARKET)


def _first_line(path: Path) -> str:
    try:
        with open_input(path) as stream:
            return stream.readline(HEAD_BYTES).decode("latin-1")
    except FileFormatError:
        return ""
