"""What the page can ask for: itself, its script, the state of the run, shapes, files of the run; and changes."""

from __future__ import annotations

import json
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.responses import FileResponse, HTMLResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Mount, Route

from frf_ipz.errors import FrfIpzError, InputError
from frf_ipz.report.html import PLOTLY, REPORT, read_asset
from frf_ipz.runs.results import errors_of_results
from frf_ipz.show.guard import Guard
from frf_ipz.show.list_page import render_list
from frf_ipz.show.page import SHOW, render_choices, render_page
from frf_ipz.show.shapes import draw_shape, mode_shape, operating_shape
from frf_ipz.show.workbench import Workbench
from frf_ipz.show.zoom import zoomed_traces

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Sequence

    from starlette.requests import Request
    from starlette.types import ASGIApp

SCRIPT, STYLE = "text/javascript", "text/css"
REPORT_POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"


def build_app(benches: Sequence[Workbench], *, port: int, token: str) -> ASGIApp:
    """Make the web application of a run, or of a campaign: then its first page lists the runs.

    Parameters
    ----------
    benches : sequence of Workbench
        The runs.
    port : int
        Where it will listen: requests that name another one are refused.
    token : str
        First part of every path.

    Returns
    -------
    ASGI application
        For uvicorn.
    """
    if len(benches) == 1:
        mounts = [Mount(f"/{token}", routes=_routes(benches[0]))]
    else:
        mounts = [
            Mount(f"/{token}/{number}", routes=_routes(bench, home="../"))
            for number, bench in enumerate(benches, start=1)
        ]
        mounts.append(Mount(f"/{token}", routes=_routes_of_list(benches)))
    return Guard(Starlette(routes=mounts), port=port, token=token)


def _routes(bench: Workbench, *, home: str = "") -> list[Route]:
    return [
        Route("/", _answering(bench, partial(_page, home=home))),
        Route("/state", _answering(bench, _state)),
        Route("/choices", _answering(bench, _choices)),
        Route("/shape", _answering(bench, _shape)),
        Route("/zoom", _answering(bench, _zoom)),
        Route("/change", _answering(bench, _change), methods=["POST"]),
        Route("/run", _answering(bench, _run), methods=["POST"]),
        Route("/run/{path:path}", _answering(bench, _file)),
        Route("/plotly.js", _fixed(read_asset(REPORT, PLOTLY), SCRIPT)),
        Route("/page.js", _fixed(read_asset(REPORT, "page.js"), SCRIPT)),
        Route("/show.js", _fixed(read_asset(SHOW, "show.js"), SCRIPT)),
        *_styles(),
    ]


def _routes_of_list(benches: Sequence[Workbench]) -> list[Route]:
    async def page(request: Request) -> Response:
        del request
        return HTMLResponse(await run_in_threadpool(render_list, benches))

    return [Route("/", page), *_styles()]


def _styles() -> list[Route]:
    return [
        Route("/page.css", _fixed(read_asset(REPORT, "page.css"), STYLE)),
        Route("/show.css", _fixed(read_asset(SHOW, "show.css"), STYLE)),
    ]


def _page(bench: Workbench, request: Request, *, home: str) -> Response:
    del request
    return HTMLResponse(render_page(bench, home=home))


def _state(bench: Workbench, request: Request) -> Response:
    del request
    return JSONResponse({**asdict(bench.status), "stamp": bench.stamp})


def _choices(bench: Workbench, request: Request) -> Response:
    del request
    return JSONResponse({"choices": render_choices(bench)})


def _shape(bench: Workbench, request: Request) -> Response:
    query, run = request.query_params, bench.contents()
    try:
        if query.get("mode"):
            shape = mode_shape(run, int(query["mode"]))
        else:
            shape = operating_shape(run, float(query.get("hz", "nan")), query.get("input", ""))
    except ValueError as error:
        raise InputError(str(error)) from None
    return JSONResponse(draw_shape(shape, run.geometry))


def _zoom(bench: Workbench, request: Request) -> Response:
    query = request.query_params
    try:
        range_hz = float(query.get("low", "nan")), float(query.get("high", "nan"))
        frfs = [int(place) for place in query.get("frfs", "").split(",")]
    except ValueError as error:
        raise InputError(str(error)) from None
    return JSONResponse({"traces": zoomed_traces(bench.contents(), range_hz, frfs)})


def _change(bench: Workbench, request: Request) -> Response:
    bench.change(request.state.wish)
    return _choices(bench, request)


def _run(bench: Workbench, request: Request) -> Response:
    bench.run()
    return _choices(bench, request)


def _file(bench: Workbench, request: Request) -> Response:
    """Send a file of the run; whatever lies outside, and what begins with a dot, is not there."""
    path = _inside(bench.folder, str(request.path_params["path"]))
    if path is None:
        return PlainTextResponse("There is no such file in this run.\n", 404)
    headers = {"content-security-policy": REPORT_POLICY} if path.suffix == ".html" else {}
    return FileResponse(path, headers=headers)


def _inside(folder: Path, name: str) -> Path | None:
    try:
        path = (folder / name).resolve()
        hidden = any(part.startswith(".") for part in path.relative_to(folder).parts)
    except (OSError, ValueError):  # a link that goes round, a zero byte; not below the folder
        return None
    return path if path.is_file() and not hidden else None


def _answering(
    bench: Workbench, answer: Callable[[Workbench, Request], Response]
) -> Callable[[Request], Awaitable[Response]]:
    """Answer in a thread, and turn errors of the user's into a sentence."""

    async def endpoint(request: Request) -> Response:
        if request.method == "POST":
            if request.headers.get("content-type", "").split(";")[0] != "application/json":
                return JSONResponse({"error": "changes are sent as application/json"}, 415)
            try:
                request.state.wish = json.loads(await request.body())
            except (ValueError, RecursionError):
                return JSONResponse({"error": "this is no JSON"}, 400)
        try:
            return await run_in_threadpool(_answer, bench, request, answer)
        except FrfIpzError as error:
            return JSONResponse({"error": str(error)}, 400)

    return endpoint


def _answer(bench: Workbench, request: Request, answer: Callable[[Workbench, Request], Response]) -> Response:
    with errors_of_results(bench.folder):
        return answer(bench, request)


def _fixed(text: str, kind: str) -> Callable[[Request], Awaitable[Response]]:
    async def endpoint(request: Request) -> Response:
        del request
        return Response(text, media_type=kind, headers={"cache-control": "private, max-age=3600"})

    return endpoint
