"""The pipeline of a folder: a folder may stand wherever a pipeline file may, where it holds exactly one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from frf_ipz.errors import FileFormatError, InputError
from frf_ipz.input_files import read_text
from frf_ipz.plotting.wording import listed
from frf_ipz.runs.folder import read_manifest
from frf_ipz.runs.manifest import MANIFEST
from frf_ipz.toml_files import parse_toml

if TYPE_CHECKING:
    from pathlib import Path


def find_pipeline(path: Path) -> Path:
    """Find the pipeline file that is meant.

    Parameters
    ----------
    path : Path
        A pipeline file, or the folder that holds one.

    Returns
    -------
    Path
        The file; what is no folder is given back.

    Raises
    ------
    InputError
        If the folder holds none or several: lists them.
    """
    if not path.is_dir():
        return path
    found = pipelines_in(path)
    if len(found) == 1:
        return found[0]
    if found:
        raise InputError(f"{path}: holds {len(found)} pipelines; name one of them: {_listed(found)}")
    if (path / MANIFEST).is_file():
        made_from = read_manifest(path).get("pipeline", "")
        raise InputError(f"{path}: holds results and no pipeline; name the one they were made from: {made_from}")
    below = [file for folder in sorted(path.glob("*/")) for file in pipelines_in(folder)]
    if below:
        raise InputError(f"{path}: holds no pipeline itself; name one of those below it: {_listed(below)}")
    raise InputError(
        f"{path}: holds no pipeline, which is a .toml with the section [pipeline]; write one with 'frf-ipz init {path}'"
    )


def pipelines_in(folder: Path) -> list[Path]:
    """List the pipeline files of a folder, not of those below it.

    Parameters
    ----------
    folder : Path
        The folder.

    Returns
    -------
    list of Path
        Sorted by name.
    """
    return [file for file in sorted(folder.glob("*.toml")) if _is_pipeline(file)]


def _is_pipeline(file: Path) -> bool:
    try:
        text = read_text(file)
    except FileFormatError:
        return False
    try:
        return "pipeline" in parse_toml(text, file)
    except FileFormatError:  # who reads it says what is wrong with it
        return file.name == "pipeline.toml"


def _listed(files: list[Path]) -> str:
    return listed([str(file) for file in files])
