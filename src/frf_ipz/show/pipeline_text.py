"""The text of ``pipeline.toml``: read as the user wrote it, written whole or not at all."""

from __future__ import annotations

from typing import TYPE_CHECKING

import tomlkit
from tomlkit.exceptions import TOMLKitError

from frf_ipz.errors import FileFormatError
from frf_ipz.input_files import read_bytes
from frf_ipz.output_files import write_text as write_file
from frf_ipz.pipeline.config import PipelineFile
from frf_ipz.toml_files import parse_toml, to_options

if TYPE_CHECKING:
    from pathlib import Path

    from frf_ipz.show.changes import Change


def changed_text(text: str, change: Change, path: Path) -> str:
    """Apply a change to the text of a pipeline file.

    Parameters
    ----------
    text : str
        What the file says.
    change : Change
        What is wanted.
    path : Path
        The file, for messages.

    Returns
    -------
    str
        What it should say, checked.

    Raises
    ------
    InputError
        If the change, or what becomes of the file, makes no sense.
    """
    try:
        document = tomlkit.parse(text)
        change.apply(document)
    except TOMLKitError as error:
        raise FileFormatError(path, f"cannot be changed: {error}; change it in an editor") from None
    changed = tomlkit.dumps(document)
    parse(changed, path)
    return changed


def parse(text: str, path: Path) -> PipelineFile:
    """Read the text of a pipeline file.

    Parameters
    ----------
    text : str
        What the file says.
    path : Path
        The file, for messages.

    Returns
    -------
    PipelineFile
        Checked.

    Raises
    ------
    FileFormatError
        If it is no TOML or no pipeline.
    """
    return to_options(parse_toml(text, path), PipelineFile, path)


def write_text(path: Path, text: str) -> None:
    """Replace the text of a pipeline file; its line ends stay as they were.

    Parameters
    ----------
    path : Path
        The file.
    text : str
        What it should say; lines end with LF.

    Raises
    ------
    FileFormatError
        If it cannot be written.
    """
    ends = "\r\n" if b"\r\n" in read_bytes(path) else "\n"
    try:
        write_file(path, text, newline=ends)
    except OSError as error:
        raise FileFormatError(path, f"cannot be written: {error.strerror}") from None
