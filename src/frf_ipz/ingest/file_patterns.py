"""Patterns of file names in `test.toml`, expanded."""

from __future__ import annotations

from pathlib import Path

from frf_ipz.errors import FileFormatError


def expand_pattern(path: Path, pattern: str, *, where: str) -> list[Path]:
    """Find the files that a pattern names.

    Parameters
    ----------
    path : Path
        ``test.toml``; patterns are relative to its folder, or absolute.
    pattern : str
        Such as ``hits/p18_*.csv``.
    where : str
        The entry that names it, for the message.

    Returns
    -------
    list of Path
        At least one, sorted.

    Raises
    ------
    FileFormatError
        If the pattern is none, or no file fits it.
    """
    folder, relative = path.parent, Path(pattern)
    if relative.is_absolute():
        folder, relative = Path(relative.anchor), relative.relative_to(relative.anchor)
    try:
        files = sorted(file for file in folder.glob(str(relative)) if file.is_file())
    except (ValueError, NotImplementedError, OSError) as error:
        raise FileFormatError(path, f"'{pattern}' is no valid pattern of files: {error}", where=where) from None
    if not files:
        raise FileFormatError(path, f"no file fits '{pattern}' in {folder}; correct 'files'", where=where)
    return files
