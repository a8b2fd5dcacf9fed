"""Code that a pipeline file names: run from the page only after somebody has read its name and said yes.

``[diagnose] extra_effects`` names Python files, and a run executes them with the rights of whoever runs it. On the
command line that is what the user asked for; a folder that came from elsewhere and is looked at must not do it unasked.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from frf_ipz.input_files import digest_file
from frf_ipz.runs.digests import digest

if TYPE_CHECKING:
    from pathlib import Path

    from frf_ipz.pipeline.config import PipelineFile


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnCode:
    """Code that a run would execute.

    Parameters
    ----------
    names : tuple of str
        As the pipeline file has them.
    digest : str
        Of the names and of the files' content: who has allowed one content has not allowed another.
    """

    names: tuple[str, ...]
    digest: str


def find_code(file: PipelineFile, folder: Path) -> OwnCode | None:
    """Find what code a pipeline names.

    Parameters
    ----------
    file : PipelineFile
        The pipeline file.
    folder : Path
        Where its paths start.

    Returns
    -------
    OwnCode or None
        None where it names none.

    Raises
    ------
    InputError
        If a file that it names cannot be read.
    """
    names = file.diagnose.extra_effects
    if not names:
        return None
    contents = [digest_file(path) if path.is_file() else "" for path in file.diagnose.effect_files(folder)]
    return OwnCode(names=names, digest=digest({"names": names, "contents": contents, "folder": str(folder)}))
