"""What a folder holds: recordings, FRFs, an FE model's matrices and the table of their rows."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from frf_ipz.errors import InputError
from frf_ipz.ingest.formats.modes_uff import holds_shapes
from frf_ipz.ingest.formats.text_layout import sniff

FRF_COLUMNS = frozenset({"frequency_hz", "output_dof", "input_dof"})
MODES_COLUMNS = frozenset({"mode", "frequency_hz", "damping_ratio", "dof", "real"})
DOF_COLUMNS = frozenset({"node", "direction"})
UNIVERSAL = (".unv", ".uff")
MATRIX = re.compile(
    r"^(?:(?P<stiffness>k|stiff\w*)|(?P<mass>m|mass)|(?P<damping>[bcd]|damp\w*))(?:[_-](?P<group>.+))?$", re.I
)
KEPT_ASIDE = re.compile(r"reference|aside|poi([_-]|$)|truth|validation", re.IGNORECASE)


@dataclass(frozen=True, slots=True, kw_only=True)
class FolderContents:
    """Files of a folder, by what they are.

    Parameters
    ----------
    folder : Path
        The folder.
    recordings, frfs : tuple of Path
        Tables of signals over time, and of FRFs.
    references : tuple of Path
        FRFs that were kept aside: by their names, or because there are recordings too.
    modes : Path, optional
        Modes that were identified elsewhere.
    dof_table : Path, optional
        ``dofs.csv``.
    matrices : dict of str to Path
        ``stiffness``, ``mass``, ``damping``, as far as they are there.
    groups : dict of str to dict of str to Path
        The same for additive parts, by their names.
    """

    folder: Path
    recordings: tuple[Path, ...]
    frfs: tuple[Path, ...]
    references: tuple[Path, ...]
    modes: Path | None
    dof_table: Path | None
    matrices: dict[str, Path]
    groups: dict[str, dict[str, Path]]

    @property
    def has_matrices(self) -> bool:
        """There is what a model of matrices needs."""
        return {"mass", "stiffness"} <= set(self.matrices) and self.dof_table is not None

    def name(self, path: Path) -> str:
        """Name a file as a TOML file in the folder does."""
        return path.relative_to(self.folder).as_posix()


def look_into(folder: Path) -> FolderContents:
    """Sort the files of a folder, and of those below it, by what they are.

    Parameters
    ----------
    folder : Path
        The folder.

    Returns
    -------
    FolderContents
        With recordings, with FRFs, or with modes.

    Raises
    ------
    InputError
        If there is no such folder, or it holds none of them.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: there is no such folder; give the one that holds the recordings")
    files = sorted(path for path in folder.rglob("*") if path.is_file() and not _is_hidden(path, folder))
    tables = [path for path in files if path.suffix.lower() == ".csv"]
    columns = {path: _columns(path) for path in tables}
    dof_tables = [path for path in tables if columns[path] >= DOF_COLUMNS]
    all_frfs = [path for path in tables if columns[path] >= FRF_COLUMNS]
    modes = [path for path in tables if columns[path] >= MODES_COLUMNS]
    modes += [path for path in files if path.suffix.lower() in UNIVERSAL and holds_shapes(path)]
    others = {*dof_tables, *all_frfs, *modes}
    recordings = tuple(path for path in tables if path not in others)
    references = tuple(path for path in all_frfs if recordings or modes or KEPT_ASIDE.search(path.stem))
    frfs = tuple(path for path in all_frfs if path not in references)
    if not recordings and not frfs and not modes:
        raise InputError(
            f"{folder}: holds no .csv with recordings or FRFs; put them there, one file an impact, then run init again"
        )
    matrices, groups = _sort_matrices(files)
    return FolderContents(
        folder=folder,
        recordings=recordings,
        frfs=frfs,
        references=references,
        modes=next(iter(modes), None),
        dof_table=next(iter(dof_tables), None),
        matrices=matrices,
        groups=groups,
    )


def _is_hidden(path: Path, folder: Path) -> bool:
    return any(part.startswith(".") for part in path.relative_to(folder).parts)


def _columns(path: Path) -> frozenset[str]:
    return frozenset(name.strip().lower() for fields in sniff(path).header for name in fields)


def _sort_matrices(files: list[Path]) -> tuple[dict[str, Path], dict[str, dict[str, Path]]]:
    """Tell matrices by the letters that they usually have: K, M and B, C or D; what follows names a part."""
    matrices: dict[str, Path] = {}
    groups: dict[str, dict[str, Path]] = {}
    for path in files:
        found = MATRIX.match(path.stem) if path.suffix.lower() == ".mtx" else None
        if found is None:
            continue
        kind = next(name for name in ("stiffness", "mass", "damping") if found[name])
        if found["group"] is None:
            matrices.setdefault(kind, path)
        else:
            groups.setdefault(found["group"], {}).setdefault(kind, path)
    return matrices, {name: parts for name, parts in groups.items() if "stiffness" in parts}
