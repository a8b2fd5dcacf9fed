"""How long the server waits for one client: nobody keeps a connection by sending or reading next to nothing."""

from __future__ import annotations

import asyncio

from uvicorn.protocols.http.h11_impl import H11Protocol

WAIT_S = 20.0  # for a whole request, and for a client to take the next block of what has been written
BLOCK = 65536  # bytes: what one buffer of a socket holds; a client behind the slowest of tunnels takes it in that time
GONE = b"HTTP/1.1 408 Request Timeout\r\ncontent-type: text/plain; charset=utf-8\r\nconnection: close\r\n\r\n"


class PatientProtocol(H11Protocol):
    """HTTP/1.1 with an end to waiting.

    A timer runs from the first moment in which the client is waited for; single bytes that arrive do not set it back.
    """

    _reading: asyncio.TimerHandle | None = None
    _writing: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin to wait for the first request.

        Parameters
        ----------
        transport : Transport
            The connection.
        """
        super().connection_made(transport)
        self._watch_reading()

    def data_received(self, data: bytes) -> None:
        """Take what has come; the timer ends with the last byte of a request.

        Parameters
        ----------
        data : bytes
            What has come.
        """
        super().data_received(data)
        self._watch_reading()

    def on_response_complete(self) -> None:
        """Begin to wait for the next request, where a part of it is there."""
        super().on_response_complete()
        self._watch_reading()

    def pause_writing(self) -> None:
        """Begin to wait for a client that does not read."""
        super().pause_writing()
        if self._writing is None:
            self._watch_writing()

    def resume_writing(self) -> None:
        """Go on: the client has read."""
        super().resume_writing()
        _cancel(self._writing)
        self._writing = None

    def connection_lost(self, exc: Exception | None) -> None:
        """Wait no more.

        Parameters
        ----------
        exc : Exception, optional
            Why the connection is gone.
        """
        _cancel(self._reading)
        _cancel(self._writing)
        super().connection_lost(exc)

    def _watch_reading(self) -> None:
        is_answering = self.cycle is not None and not self.cycle.response_complete
        if is_answering and not self.cycle.more_body:
            _cancel(self._reading)
            self._reading = None
        elif self._reading is None:
            self._reading = self.loop.call_later(WAIT_S, self._give_up)

    def _watch_writing(self) -> None:
        waiting = self.transport.get_write_buffer_size()
        self._writing = self.loop.call_later(WAIT_S, self._require_taken, waiting)

    def _require_taken(self, waiting: int) -> None:
        if waiting - self.transport.get_write_buffer_size() < BLOCK:
            self.transport.abort()
        else:
            self._watch_writing()

    def _give_up(self) -> None:
        if self.cycle is None or self.cycle.response_complete:
            self.transport.write(GONE)
        self.transport.close()


def _cancel(timer: asyncio.TimerHandle | None) -> None:
    if timer is not None:
        timer.cancel()
