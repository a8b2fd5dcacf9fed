"""What the page can ask for: itself, its script, the state of the run, shapes, files of the run; and changes."""

from __future__ import annotations

import json
import logging
import secrets
from dataclasses import asdict
from functools import partial
from typing import TYPE_CHECKING, Any

from anyio import CapacityLimiter, to_thread
from starlette.applications import Starlette
from starlette.requests import ClientDisconnect
from starlette.responses import HTMLResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Mount, Route

from frf_ipz.errors import FrfIpzError, InputError
from frf_ipz.report.html import PLOTLY, REPORT, read_asset
from frf_ipz.runs.results import errors_of_results
from frf_ipz.runs.shapes import draw_shape, draw_structure, mode_shape, operating_shape
from frf_ipz.show.downloads import picture_file
from frf_ipz.show.guard import Guard
from frf_ipz.show.list_page import render_list
from frf_ipz.show.page import SHOW, Addresses, render_choices, render_page
from frf_ipz.show.result_files import send_file
from frf_ipz.show.zoom import zoomed_traces

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Sequence

    from starlette.requests import Request
    from starlette.types import ASGIApp

    from frf_ipz.show.workbench import Workbench

LOG = logging.getLogger(__name__)
TOKEN_BYTES = 24
ASSETS = {
    "plotly.js": (REPORT, PLOTLY, "text/javascript"),
    "page.js": (REPORT, "page.js", "text/javascript"),
    "shapes.js": (REPORT, "shapes.js", "text/javascript"),
    "show.js": (SHOW, "show.js", "text/javascript"),
    "band_edges.js": (SHOW, "band_edges.js", "text/javascript"),
    "page.css": (REPORT, "page.css", "text/css"),
    "show.css": (SHOW, "show.css", "text/css"),
}


def build_app(benches: Sequence[Workbench], *, port: int, token: str) -> ASGIApp:
    """Make the web application of a run, or of a campaign: then its first page lists the runs.

    Files of the runs have addresses that begin with a token of their own: a page that lies in a results folder never
    knows the one by which changes are made.

    Parameters
    ----------
    benches : sequence of Workbench
        The runs.
    port : int
        Where it will listen: requests that name another one are refused.
    token : str
        First part of every path of the page.

    Returns
    -------
    ASGI application
        For uvicorn.
    """
    file_token = secrets.token_urlsafe(TOKEN_BYTES)
    routes = _Routes(benches, file_token)
    mounts = [Mount(f"/{token}", routes=routes.of_pages()), Mount(f"/{file_token}", routes=routes.of_files())]
    return Guard(Starlette(routes=mounts), port=port, tokens=(token, file_token))


class _Routes:
    """Addresses of one run, or of several by their numbers, from 1: each route stands once for all of them."""

    def __init__(self, benches: Sequence[Workbench], file_token: str) -> None:
        self._benches = {str(number): bench for number, bench in enumerate(benches, start=1)}
        self._is_campaign = len(benches) > 1
        self._file_token = file_token
        self._one_at_a_time = CapacityLimiter(1)  # pages and figures: memory for one of them is enough

    def of_pages(self) -> list[Route | Mount]:
        run = "/{run}" if self._is_campaign else ""
        routes: list[Route | Mount] = [
            Mount("/assets", routes=[_fixed(name, *asset) for name, asset in ASSETS.items()])
        ]
        if self._is_campaign:
            routes.append(Route("/", self._list))
        return [
            *routes,
            Route(f"{run}/", self._answering(self._page, self._one_at_a_time)),
            Route(f"{run}/state", self._answering(_state)),
            Route(f"{run}/choices", self._answering(_choices)),
            Route(f"{run}/shape", self._answering(_shape, self._one_at_a_time)),
            Route(f"{run}/zoom", self._answering(_zoom, self._one_at_a_time)),
            Route(f"{run}/picture/{{name}}", self._answering(_picture, self._one_at_a_time)),
            Route(f"{run}/change", self._answering(_change), methods=["POST"]),
            Route(f"{run}/allow", self._answering(_allow), methods=["POST"]),
            *[
                Route(f"{run}/{name}", self._answering(partial(_command, name)), methods=["POST"])
                for name in ("run", "diagnose", "cancel", "undo", "redo")
            ],
        ]

    def of_files(self) -> list[Route]:
        return [Route("/{run}/{path:path}", self._answering(_file))]

    def _page(self, bench: Workbench, request: Request) -> Response:
        up = "../" if self._is_campaign else ""
        files = f"../{up}{self._file_token}/{request.path_params.get('run', '1')}/"
        return HTMLResponse(render_page(bench, Addresses(home=up, assets=f"{up}assets/", files=files)))

    async def _list(self, request: Request) -> Response:
        del request
        benches = list(self._benches.values())
        return HTMLResponse(await to_thread.run_sync(render_list, benches, limiter=self._one_at_a_time))

    def _answering(
        self, answer: Callable[[Workbench, Request], Response], limiter: CapacityLimiter | None = None
    ) -> Callable[[Request], Awaitable[Response]]:
        """Answer in a thread, and turn errors of the user's into a sentence."""

        async def endpoint(request: Request) -> Response:
            bench = self._benches.get(request.path_params.get("run", "1"))
            if bench is None:
                return PlainTextResponse("There is no such run.\n", 404)
            try:
                if request.method == "POST":
                    request.state.wish = await _read_wish(request)
                return await to_thread.run_sync(_answer, bench, request, answer, limiter=limiter)
            except _Refusal as refusal:
                return _refuse(str(refusal), refusal.status)
            except FrfIpzError as error:
                return _refuse(str(error), 400)
            except Exception as error:
                LOG.exception("a fault of the program")
                return _refuse(f"a fault of the program: {type(error).__name__}", 500)

        return endpoint


def _answer(bench: Workbench, request: Request, answer: Callable[[Workbench, Request], Response]) -> Response:
    with errors_of_results(bench.folder):
        return answer(bench, request)


class _Refusal(Exception):  # noqa: N818  nothing has gone wrong but the request
    def __init__(self, text: str, status: int) -> None:
        super().__init__(text)
        self.status = status


def _refuse(text: str, status: int) -> Response:
    return JSONResponse({"error": " ".join(text.splitlines())}, status)


async def _read_wish(request: Request) -> object:
    """Read what a page sends: JSON that JSON's standard knows, of characters that UTF-8 knows."""
    if request.headers.get("content-type", "").split(";")[0] != "application/json":
        raise _Refusal("changes are sent as application/json", 415)
    try:
        wish: object = json.loads(await request.body(), parse_constant=_refuse_constant)
        json.dumps(wish, ensure_ascii=False).encode()
    except (ValueError, RecursionError):
        raise _Refusal("this is no JSON", 400) from None
    except ClientDisconnect:
        raise _Refusal("the request ended before it was whole", 400) from None
    return wish


def _refuse_constant(name: str) -> Any:  # noqa: ANN401  never gives anything
    raise ValueError(name)


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
    structure = draw_structure(
        run, [dof for motion in shape.motions if motion.name == "measured" for dof in motion.dofs]
    )
    return JSONResponse({"structure": structure.to_json(), **draw_shape(shape, structure)})


def _zoom(bench: Workbench, request: Request) -> Response:
    query = request.query_params
    try:
        range_hz = float(query.get("low", "nan")), float(query.get("high", "nan"))
        frfs = [int(place) for place in query.get("frfs", "").split(",")]
    except ValueError as error:
        raise InputError(str(error)) from None
    return JSONResponse({"traces": zoomed_traces(bench.contents(), range_hz, frfs)})


def _picture(bench: Workbench, request: Request) -> Response:
    content, kind = picture_file(bench.contents(), str(request.path_params["name"]))
    return Response(content, media_type=kind, headers={"content-disposition": "attachment"})


def _change(bench: Workbench, request: Request) -> Response:
    bench.change(request.state.wish)
    return _choices(bench, request)


def _allow(bench: Workbench, request: Request) -> Response:
    bench.allow_code(request.state.wish)
    return _choices(bench, request)


def _command(name: str, bench: Workbench, request: Request) -> Response:
    getattr(bench, name)()
    return _choices(bench, request)


def _file(bench: Workbench, request: Request) -> Response:
    return send_file(bench.folder, str(request.path_params["path"]))


def _fixed(name: str, package: str, file: str, kind: str) -> Route:
    content = read_asset(package, file).encode()

    async def endpoint(request: Request) -> Response:
        del request
        return Response(content, media_type=kind, headers={"cache-control": "private, max-age=3600"})

    return Route(f"/{name}", endpoint)
