"""What a folder holds: recordings, FRFs, an FE model's matrices and the table of their rows."""

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from frf_ipz.errors import FileFormatError, InputError
from frf_ipz.ingest.formats.frf_analyser import require_phase
from frf_ipz.ingest.formats.frf_file import FrfSource
from frf_ipz.ingest.formats.modes_uff import holds_shapes
from frf_ipz.ingest.formats.registry import is_known_recording, look_at_frfs, look_at_recording
from frf_ipz.ingest.formats.text_layout import sniff
from frf_ipz.meshes.formats.universal import holds_geometry
from frf_ipz.pipeline.init.model_files import MODEL_SUFFIXES, FoundModel, find_models, is_array_of_model
from frf_ipz.quantities import FrfQuantity
from frf_ipz.text_numbers import NumberError, parse_number

MODES_COLUMNS = frozenset({"mode", "frequency_hz", "damping_ratio", "dof", "real"})
CSV = ".csv"
TEXT = (".txt", ".dat", ".asc", ".tsv", ".prn", ".xlsx")  # may be a table, and may be anything else
OTHER = (".toml", ".py", ".m", ".md", ".json", ".html", ".mtx")  # settings, programs, results
UNTIMED = (
    "is a table without a column of time that grows by equal steps; where it is a recording, call it .csv, and write "
    "sample_rate_hz under [test]; where it is an FRF, say 'columns' in an [[frf]]"
)
BARE_FRF = ("frequency_hz", "real", "imag")  # columns of a table without names, as CutPro writes it
FEWEST_ROWS = 16  # of a recording
DOF_COLUMNS = frozenset({"node", "direction"})
PLACE_COLUMNS = re.compile(r"node( [xyz]([ _]*[\[(/]?[a-z]+[\])]?)?){3}")
UNIVERSAL = (".unv", ".uff")
KEPT_ASIDE = re.compile(r"reference|aside|poi([_-]|$)|truth|validation", re.IGNORECASE)


@dataclass(frozen=True, slots=True, kw_only=True)
class FolderContents:
    """Files of a folder, by what they are.

    Parameters
    ----------
    folder : Path
        The folder.
    recordings, frfs : tuple of Path
        Files of signals over time, and of FRFs, in any format that is read.
    references : tuple of Path
        FRFs that were kept aside: by their names, or because there are recordings too.
    modes : Path, optional
        Modes that were identified elsewhere.
    models : tuple of FoundModel
        FE models, the one to take first; more than one where a folder holds several.
    geometry : Path, optional
        Universal file with nodes and lines or elements between them.
    unread : dict of Path to str
        Files that look like measurements, and why they cannot be read as such.
    """

    folder: Path
    recordings: tuple[Path, ...]
    frfs: tuple[Path, ...]
    references: tuple[Path, ...]
    modes: Path | None
    models: tuple[FoundModel, ...]
    geometry: Path | None
    unread: dict[Path, str]

    @property
    def model(self) -> FoundModel:
        """The FE model to take; an empty one where there is none."""
        return self.models[0] if self.models else FoundModel()

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
    dof_tables = [path for path in files if path.suffix.lower() == CSV and _columns(path) >= DOF_COLUMNS]
    modes = [path for path in files if path.suffix.lower() == CSV and _columns(path) >= MODES_COLUMNS]
    modes += [path for path in files if path.suffix.lower() in UNIVERSAL and holds_shapes(path)]
    places = [path for path in files if path.suffix.lower() == CSV and _holds_places(path)]
    models = find_models(files, dof_tables, places)
    of_models = {path for model in models for path in model.paths}
    jobs = {path.with_suffix("") for path in of_models}  # what a solver printed has the name of its deck
    geometries = [path for path in files if path.suffix.lower() in UNIVERSAL and holds_geometry(path)]
    found: dict[str, list[Path]] = {"recording": [], "frf": []}
    unread: dict[Path, str] = {}
    tables: list[FileFormatError] = []  # that cannot be read
    for path in files:
        if (
            path in {*dof_tables, *places, *modes, *of_models}
            or path.suffix.lower() in {*OTHER, *MODEL_SUFFIXES}
            or is_array_of_model(path)
        ):
            continue
        try:
            kind = _kind(path)
        except FileFormatError as error:
            if path in geometries or path.with_suffix("") in jobs:
                continue
            tables += [error] if path.suffix.lower() == CSV else []
            unread[path] = str(error).partition(": ")[2]
            continue
        if kind:
            found[kind].append(path)
    recordings, all_frfs = tuple(found["recording"]), found["frf"]
    references = tuple(path for path in all_frfs if recordings or modes or KEPT_ASIDE.search(path.stem))
    frfs = tuple(path for path in all_frfs if path not in references)
    if not recordings and not frfs and not modes:
        if tables:
            raise tables[0]
        hint = "".join(f"; {path.name}: {reason}" for path, reason in list(unread.items())[:1])
        problem = "holds no recordings and no FRFs in a format that is read (CSV, text, UFF, MATLAB, HDF5, ...)"
        raise InputError(f"{folder}: {problem}; put them there, one file an impact, then run init again{hint}")
    return FolderContents(
        folder=folder,
        recordings=recordings,
        frfs=frfs,
        references=references,
        modes=next(iter(modes), None),
        models=tuple(models),
        geometry=next(iter(geometries), None),
        unread=unread,
    )


def _kind(path: Path) -> str:
    """Tell by its content whether a file is a recording or holds FRFs; empty where it is neither."""
    is_known = is_known_recording(path)
    if not is_known and path.suffix.lower() not in {CSV, *TEXT} and not _holds_frfs(path):
        return ""
    if _holds_frfs(path) or (not is_known and is_bare_frf(path)):
        return "frf"
    if not is_known:
        require_phase(path)
    if not is_known and path.suffix.lower() != CSV and not _is_table(path):
        return ""
    contents = look_at_recording(path)
    if path.suffix.lower() in TEXT and not contents.has_time:
        raise FileFormatError(path, UNTIMED)
    is_recording = path.suffix.lower() == CSV or contents.has_time
    return "recording" if is_recording and contents.columns else ""


def _holds_frfs(path: Path) -> bool:
    try:
        return look_at_frfs(FrfSource(path=path, quantity=FrfQuantity.ACCELERANCE)) is not None
    except FileFormatError:  # a file that might, and does not
        return False


def is_bare_frf(path: Path) -> bool:
    """Tell whether a table without names looks like frequency, real and imaginary part of an FRF.

    Parameters
    ----------
    path : Path
        A file.

    Returns
    -------
    bool
        True where lines go from 0 by whole numbers, and the last of three columns is 0 at 0 Hz, as a spectrum's is.
    """
    try:
        layout = sniff(path)
        rows = [[parse_number(text, decimal=layout.decimal) for text in row] for row in layout.rows]
    except (FileFormatError, NumberError):
        return False
    if layout.header or layout.n_columns != len(BARE_FRF) or len(rows) < 3 or len({len(row) for row in rows}) != 1:
        return False
    steps = {later[0] - row[0] for row, later in pairwise(rows)}
    return rows[0][0] == rows[0][2] == 0.0 and len(steps) == 1 and min(steps) >= 1.0 and min(steps).is_integer()


def _is_table(path: Path) -> bool:
    try:
        layout = sniff(path)
    except FileFormatError:
        return False
    return layout.n_columns > 1 and len(layout.rows) >= FEWEST_ROWS


def _is_hidden(path: Path, folder: Path) -> bool:
    return any(part.startswith(".") for part in path.relative_to(folder).parts)


def _holds_places(path: Path) -> bool:
    return PLACE_COLUMNS.fullmatch(" ".join(sorted(_columns(path)))) is not None


def _columns(path: Path) -> frozenset[str]:
    try:
        layout = sniff(path)
    except FileFormatError:  # said where its kind is asked for
        return frozenset()
    return frozenset(name.strip().lower() for fields in layout.header for name in fields)
