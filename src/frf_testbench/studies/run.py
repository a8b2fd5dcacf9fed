"""The studies by name."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from frf_ipz.progress import silent
from frf_testbench.studies.beam_physics import study_beam_physics
from frf_testbench.studies.cantilever_masses import study_cantilever_masses
from frf_testbench.studies.double_beam_ringdown import study_double_beam_ringdown
from frf_testbench.studies.left_out import study_left_out
from frf_testbench.studies.recordings import StudyError
from frf_testbench.studies.silverbox import study_silverbox

if TYPE_CHECKING:
    from pathlib import Path

    import pandas as pd

    from frf_ipz.progress import Progress


class Study(Protocol):
    """Turns a folder of recordings into tables."""

    def __call__(self, folder: Path, *, progress: Progress = silent) -> dict[str, pd.DataFrame]:
        """Return tables by their titles; `StudyError` where the folder does not hold the recordings."""


STUDIES: dict[str, Study] = {
    "beam_physics": study_beam_physics,
    "cantilever_masses": study_cantilever_masses,
    "double_beam_ringdown": study_double_beam_ringdown,
    "left_out": study_left_out,
    "silverbox": study_silverbox,
}


def run_study(name: str, folder: Path, *, progress: Progress = silent) -> dict[str, pd.DataFrame]:
    """Run a study.

    Parameters
    ----------
    name : str
        Of `STUDIES`.
    folder : Path
        Holds the recordings.
    progress : Progress
        Receives the progress.

    Returns
    -------
    dict of str to DataFrame
        Tables by their titles.

    Raises
    ------
    StudyError
        If there is no such study, or the folder does not hold its recordings.
    """
    if name not in STUDIES:
        raise StudyError(f"there is no study '{name}'; there are {', '.join(STUDIES)}")
    return STUDIES[name](folder, progress=progress)
