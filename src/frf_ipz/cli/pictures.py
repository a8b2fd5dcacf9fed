"""Pictures of a run for publications, from the command line."""

from __future__ import annotations

from pathlib import Path

from frf_ipz.errors import InputError, did_you_mean
from frf_ipz.plotting.figures import FORMATS, draw_pictures, save_figure
from frf_ipz.plotting.registry import describe, picture_names
from frf_ipz.runs.results import errors_of_results, open_results


def picture_list(folder: Path) -> str:
    """Say what can be drawn of a run.

    Parameters
    ----------
    folder : Path
        The run's folder.

    Returns
    -------
    str
        Text.

    Raises
    ------
    InputError
        If there is no run in the folder.
    """
    run = open_results(folder)
    with errors_of_results(folder):
        names = picture_names(run)
    return "\n".join([f"frf-ipz plot {folder} NAME, with one of the names", *names])


def draw_picture(folder: Path, name: str, file_format: str | None, out: Path | None) -> str:
    """Draw a picture of a run into a file.

    Parameters
    ----------
    folder : Path
        The run's folder.
    name : str
        Which picture.
    file_format : str, optional
        ``svg``, ``pdf`` or ``png``; where it is left out, what the name of the file ends with, or ``svg``.
    out : Path, optional
        File to write; the picture's name in the folder of work where it is left out.

    Returns
    -------
    str
        What was written.

    Raises
    ------
    InputError
        If there is no such run, picture or format, the name of the file ends as that of another, or it cannot be
        written.
    """
    ending = "" if out is None else out.suffix.lower().removeprefix(".")
    chosen = file_format or ending or "svg"
    if chosen not in FORMATS:
        raise InputError(f"the format '{chosen}' is not known; {did_you_mean(chosen, FORMATS)}")
    if ending in FORMATS and ending != chosen:
        raise InputError(f"--out {out} ends as .{ending}, and --format is {chosen}; leave one of them out")
    path = Path(f"{name}.{chosen}") if out is None else out
    run = open_results(folder).load()
    with errors_of_results(folder):
        figure = draw_pictures(describe(name, run))
    try:
        save_figure(figure, path, file_format=chosen)
    except InputError as error:
        raise InputError(f"{error}; choose another --out") from None
    return f"wrote {path}"
