"""What can be taken away from a run: its files, and its pictures as for a publication."""

from __future__ import annotations

from io import BytesIO
from typing import TYPE_CHECKING

from frf_ipz import plotting  # gives what it draws with when that is asked for
from frf_ipz.errors import InputError, did_you_mean
from frf_ipz.plotting.registry import picture_names, run_pictures
from frf_ipz.report.section import Form, Section

if TYPE_CHECKING:
    from frf_ipz.runs.results import Results

KINDS = {"svg": "image/svg+xml", "png": "image/png"}


def downloads(run: Results, files: str) -> Section | None:
    """List what can be taken away.

    Parameters
    ----------
    run : Results
        What the run holds.
    files : str
        Address of its folder, with a slash at the end.

    Returns
    -------
    Section or None
        None before the first run.
    """
    stages = run.manifest.get("stages", {})
    names = dict.fromkeys(name for stage in stages.values() for name in stage.get("files", []))
    if not names:
        return None
    pictures = [name for name in picture_names(run) if run_pictures(run, name)]
    form = Form(
        template="show/downloads.html",
        data={"files": sorted(names), "address": files, "pictures": pictures, "kinds": list(KINDS)},
    )
    lead = "Tables are Parquet files. Pictures are drawn as 'frf-ipz plot' draws them, whatever is seen above."
    return Section(anchor="downloads", title="Downloads", lead=lead, blocks=(form,))


def picture_file(run: Results, name: str) -> tuple[bytes, str]:
    """Draw a picture of a run for a publication.

    Parameters
    ----------
    run : Results
        What the run holds.
    name : str
        Name of the picture and, behind a dot, the kind of file.

    Returns
    -------
    content : bytes
        Of the file.
    media_type : str
        What it is.

    Raises
    ------
    InputError
        If there is no such picture or kind.
    """
    picture, _, kind = name.rpartition(".")
    if kind not in KINDS:
        raise InputError(f"'{kind[:20]}' is no kind of picture; {did_you_mean(kind, KINDS)}")
    target = BytesIO()
    plotting.save_figure(run.plot(picture), target, file_format=kind)
    return target.getvalue(), KINDS[kind]
