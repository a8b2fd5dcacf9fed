"""Who may speak to the page: a browser on this machine that was given the token, and no other site in that browser."""

from __future__ import annotations

import secrets
from typing import TYPE_CHECKING

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse

if TYPE_CHECKING:
    from starlette.types import ASGIApp, Message, Receive, Scope, Send

LOOPBACK = ("127.0.0.1", "localhost")
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
HEADERS = {
    "content-security-policy": POLICY,
    "cache-control": "no-store",
    "cross-origin-resource-policy": "same-origin",
    "referrer-policy": "no-referrer",
    "x-content-type-options": "nosniff",
}
MOST_BYTES = 20_000  # of a request: a change is a few words


class Guard:
    """Lets through what comes from this machine's own page.

    The name in the address must be that of the loopback, so that no other site can point its own name here (DNS
    rebinding); a request that another site, or a file shown in a sandbox, has made names another origin; and every
    address begins with a token that is drawn at each start.

    Parameters
    ----------
    app : ASGI application
        What answers.
    port : int
        Where the server listens.
    tokens : tuple of str
        First part of every path: one of them.
    """

    def __init__(self, app: ASGIApp, *, port: int, tokens: tuple[str, ...]) -> None:
        self._app = app
        self._tokens = [token.encode() for token in tokens]
        self._hosts = {f"{name}:{port}" for name in LOOPBACK} | (set(LOOPBACK) if port == 80 else set())
        self._origins = {f"http://{host}" for host in self._hosts}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or refuse it.

        Parameters
        ----------
        scope, receive, send : as ASGI has them
            The request.
        """
        if scope["type"] != "http":
            return
        refusal = self._refusal(scope)

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        app = self._app if refusal is None else refusal
        await app(scope, receive, send_with_headers)

    def _refusal(self, scope: Scope) -> PlainTextResponse | None:
        headers = Headers(scope=scope)
        if headers.get("host", "") not in self._hosts:
            return PlainTextResponse("This server answers to its own machine only.\n", 403)
        if headers.get("origin", "") not in {"", *self._origins}:
            return PlainTextResponse("Another site has asked for this.\n", 403)
        if headers.get("sec-fetch-site", "none") not in {"none", "same-origin"}:
            return PlainTextResponse("Another site has asked for this.\n", 403)
        first = "".join(str(scope["path"]).split("/")[1:2]).encode()
        if not any(secrets.compare_digest(first, token) for token in self._tokens):
            return PlainTextResponse("Use the address that 'frf-ipz show' has printed: it holds a token.\n", 403)
        if not _is_short(headers.get("content-length", "0")) or "transfer-encoding" in headers:
            return PlainTextResponse("This is too long for a change.\n", 413)
        return None


def _is_short(length: str) -> bool:
    is_number = length.isascii() and length.isdecimal() and len(length) <= len(str(MOST_BYTES))
    return is_number and int(length) <= MOST_BYTES
