"""The server: on the loopback only, for one run or one campaign, until it is stopped."""

from __future__ import annotations

import secrets
import socket
from typing import TYPE_CHECKING

import uvicorn

from frf_ipz.errors import InputError
from frf_ipz.show.app import TOKEN_BYTES, build_app
from frf_ipz.show.campaign import find_runs
from frf_ipz.show.open_run import OpenRun
from frf_ipz.show.patience import PatientProtocol
from frf_ipz.show.workbench import Workbench

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from starlette.types import ASGIApp

    from frf_ipz.pipeline.inputs import PipelineInputs
    from frf_ipz.show.workbench import Run

ADDRESS = "127.0.0.1"
MOST_CONNECTIONS = 512  # at once; half of the files that a process may have open on most systems


def serve(
    folder: Path, run: Run, read: Callable[[Path], PipelineInputs], *, port: int, announce: Callable[[str], None]
) -> None:
    """Serve the page of a run, or of a campaign, until the process is interrupted.

    Parameters
    ----------
    folder : Path
        The run's folder, or the campaign's.
    run : Run
        Runs a pipeline.
    read : callable
        Reads a pipeline file and all that it names.
    port : int
        Where to listen on the loopback; 0 for any that is free.
    announce : callable
        Called with the address of the page as soon as the server listens.

    Raises
    ------
    InputError
        If there is no run and no pipeline in the folder, or the port is taken.
    """
    opened = OpenRun()
    benches = [Workbench(paths, run, read, opened) for paths in find_runs(folder)]
    with listen(port) as listener:
        bound_port = int(listener.getsockname()[1])
        token = secrets.token_urlsafe(TOKEN_BYTES)
        server = make_server(build_app(benches, port=bound_port, token=token))
        announce(f"http://{ADDRESS}:{bound_port}/{token}/")
        try:
            server.run(sockets=[listener])
        finally:
            for bench in benches:
                bench.close()


def make_server(app: ASGIApp) -> uvicorn.Server:
    """Make the server of an application: it loses patience with slow clients, and with too many at once.

    Parameters
    ----------
    app : ASGI application
        What answers.

    Returns
    -------
    Server
        To be run on a socket.
    """
    return uvicorn.Server(
        uvicorn.Config(
            app,
            log_level="warning",
            lifespan="off",
            ws="none",
            http=PatientProtocol,
            limit_concurrency=MOST_CONNECTIONS,
            timeout_graceful_shutdown=2,
        )
    )


def listen(port: int) -> socket.socket:
    """Listen on the loopback.

    Parameters
    ----------
    port : int
        0 for any that is free.

    Returns
    -------
    socket
        Connections wait in it from now on.

    Raises
    ------
    InputError
        If the port cannot be had.
    """
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        listener.bind((ADDRESS, port))
        listener.listen()
    except (OSError, OverflowError) as error:
        listener.close()
        raise InputError(
            f"port {port} of {ADDRESS} cannot be used ({error}); leave out --port to take a free one"
        ) from None
    return listener
