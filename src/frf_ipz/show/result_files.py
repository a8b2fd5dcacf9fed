"""Files of a results folder in the browser: shown in a sandbox, or handed over to be saved; never trusted.

A results folder may come from anybody. What is shown of it has no origin, so that it cannot speak to the page that
makes changes; of scripts only those run that this program itself writes into a report.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from starlette.responses import FileResponse, PlainTextResponse, Response

from frf_ipz.report.html import REPORT, RUN_SCRIPTS, read_asset
from frf_ipz.report.policy import page_policy

if TYPE_CHECKING:
    import os
    from pathlib import Path

SHOWN = {".html": "text/html", ".png": "image/png", ".svg": "image/svg+xml"}  # the others are saved
SANDBOX = "sandbox allow-scripts allow-downloads allow-modals; frame-ancestors 'none'"


def send_file(folder: Path, name: str) -> Response:
    """Send a file of a run; whatever lies outside, and what begins with a dot, is not there.

    Parameters
    ----------
    folder : Path
        The run's folder, resolved.
    name : str
        What the browser asks for.

    Returns
    -------
    Response
        The file, or that there is none.
    """
    found = _find(folder, name)
    if found is None:
        return PlainTextResponse("There is no such file in this run.\n", 404)
    path, status = found
    kind = SHOWN.get(path.suffix.lower())
    policy = page_policy(*(read_asset(REPORT, script) for script in RUN_SCRIPTS))
    return FileResponse(
        path,
        media_type=kind or "application/octet-stream",
        headers={"content-security-policy": f"{SANDBOX}; {policy}"},
        stat_result=status,
        filename=None if kind else path.name,
    )


def _find(folder: Path, name: str) -> tuple[Path, os.stat_result] | None:
    try:
        path = (folder / name).resolve()
        is_hidden = any(part.startswith(".") for part in path.relative_to(folder).parts)
        return (path, path.stat()) if path.is_file() and not is_hidden else None
    except (OSError, ValueError):  # a link that goes round, a zero byte, too long a name; not below the folder
        return None
