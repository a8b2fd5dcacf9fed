"""An FE model that many runs use: read once, and reduced once for all runs that measure the same DOFs in the same band.

The model itself is handed on in memory. Its reductions stand in a folder, each under a digest of all that it depends
on, so that processes and computers share them; while one reduces, the others wait for it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from frf_ipz.errors import FileFormatError
from frf_ipz.fe.model_file import model_files, read_model
from frf_ipz.input_files import Ledger, digest_file, entering
from frf_ipz.late_imports import import_late
from frf_ipz.output_files import cannot_write
from frf_ipz.runs.codec import load_result, save_result
from frf_ipz.runs.stage_file import SUFFIX

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from filelock import FileLock

    from frf_ipz.structure import ReducedModel, StructuralModel
else:
    FileLock = import_late("filelock", "FileLock")

STAGE = "reduce"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SharedModel:
    """An FE model as it was read, and where its reductions are.

    Parameters
    ----------
    path : Path
        Its ``model.toml``.
    model : StructuralModel
        As it was read: without what a test adds to it.
    entries : mapping of str to tuple
        Of the ledger with which its files were read.
    reductions : Path
        Folder of the reduced models; made where there is none.
    """

    path: Path
    model: StructuralModel
    reductions: Path
    entries: Mapping[str, tuple[str, tuple[int, ...]]] = field(default_factory=dict)

    def ledger(self) -> Ledger:
        """Start a ledger that knows the files of the model: one that has been changed since it was read is refused.

        Returns
        -------
        Ledger
            For one run.
        """
        return Ledger(entries=dict(self.entries))

    def reduce(self, key: str, compute: Callable[[], ReducedModel]) -> ReducedModel:
        """Give a reduced model: the one that is there, or a new one.

        Parameters
        ----------
        key : str
            Digest of all that it depends on.
        compute : callable
            Gives it.

        Returns
        -------
        ReducedModel
            The reduced model.

        Raises
        ------
        InputError
            If it cannot be written.
        """
        file = self.reductions / f"{key}{SUFFIX}"
        try:
            self.reductions.mkdir(parents=True, exist_ok=True)
            with FileLock(file.with_suffix(".lock")):
                try:
                    reduced: ReducedModel = load_result(file, stage=STAGE, key=key)
                except FileFormatError:  # none yet, or a damaged one
                    reduced = compute()
                    save_result(reduced, file, key=key)
        except OSError as error:
            raise cannot_write(file, error) from None
        return reduced


def share_model(path: Path, reductions: Path) -> SharedModel:
    """Read a model for many runs.

    Parameters
    ----------
    path : Path
        Its ``model.toml``.
    reductions : Path
        Folder for the reduced models.

    Returns
    -------
    SharedModel
        To hand to each run.

    Raises
    ------
    FileFormatError
        If a file is missing or something in it does not fit.
    """
    path = path.resolve()
    ledger = Ledger()
    with entering(ledger):
        model = read_model(path)
        for file in model_files(path):
            digest_file(file)
    return SharedModel(path=path, model=model, reductions=reductions, entries=ledger.entries)
