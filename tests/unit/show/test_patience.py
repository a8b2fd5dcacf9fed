"""Clients that are slow, or silent, or do not read: dropped after a while, and nobody waits for them meanwhile."""

import socket
import time
from contextlib import ExitStack, closing, suppress
from http.client import HTTPConnection
from threading import Thread

import pytest

from frf_ipz.show import patience
from frf_ipz.show.server import listen, make_server

WAIT_S = 1.0  # in the place of 20 s
SOON_S = 60.0
N_SLOW = 30
BLOCK = 65536  # bytes
REQUEST = b"GET / HTTP/1.1\r\nhost: x\r\n"
CHANGE = b"POST / HTTP/1.1\r\nhost: x\r\ncontent-length: 1000\r\n\r\n"
LARGE = b"GET /large HTTP/1.1\r\nhost: x\r\n\r\n"


async def application(scope, receive, send):
    """Read the request, and answer with a word, or with more than the system keeps for a client."""
    while scope["method"] == "POST":
        message = await receive()
        if message["type"] == "http.disconnect":
            return
        if not message["more_body"]:
            break
    body = b"x" * (400 * BLOCK) if scope["path"] == "/large" else b"here"
    await send({"type": "http.response.start", "status": 200, "headers": [(b"content-length", b"%d" % len(body))]})
    await send({"type": "http.response.body", "body": body})


@pytest.fixture
def server(monkeypatch):
    """A server with the patience of the page's, and its port."""
    monkeypatch.setattr(patience, "WAIT_S", WAIT_S)
    with closing(listen(0)) as listener:
        server = make_server(application)
        server.port = listener.getsockname()[1]
        thread = Thread(target=server.run, kwargs={"sockets": [listener]}, daemon=True)
        thread.start()
        yield server
        server.should_exit = True
        thread.join(SOON_S)
        assert not thread.is_alive()


def connect(server):
    client = socket.socket()
    client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BLOCK)
    client.settimeout(SOON_S)
    client.connect(("127.0.0.1", server.port))
    return client


def is_served(server):
    with closing(HTTPConnection("127.0.0.1", server.port, timeout=SOON_S)) as connection:
        connection.request("GET", "/")
        return connection.getresponse().read() == b"here"


def n_connected(server):
    return len(server.server_state.connections)


def wait_until(condition):
    end = time.monotonic() + SOON_S
    while not condition():
        assert time.monotonic() < end
        time.sleep(WAIT_S / 20)


def all_that_comes(client):
    """Read until the server ends the connection."""
    parts = []
    try:
        while part := client.recv(BLOCK):
            parts.append(part)
    except ConnectionError:
        parts.append(b"reset")
    return b"".join(parts)


def drip(client, text):
    """Send a byte, wait, send another, until the server has had enough; gives how many bytes it took."""
    client.setblocking(False)
    for number in range(len(text)):
        try:
            client.send(text[number : number + 1])
            time.sleep(WAIT_S / 5)
            if not client.recv(BLOCK):
                return number
        except BlockingIOError:  # nothing has come
            continue
        except ConnectionError:
            return number
    return len(text)


def test_a_client_that_sends_nothing_is_told_and_dropped(server):
    with closing(connect(server)) as client:
        assert all_that_comes(client).startswith(b"HTTP/1.1 408 ")
    wait_until(lambda: n_connected(server) == 0)


@pytest.mark.parametrize("begun", [b"", REQUEST + b"x: ", CHANGE], ids=["request", "header", "body"])
def test_a_client_that_sends_a_byte_now_and_then_is_dropped(server, begun):
    with closing(connect(server)) as client:
        client.sendall(begun)
        assert drip(client, b"x" * 100) < 20
    wait_until(lambda: n_connected(server) == 0)


def test_a_client_that_does_not_read_is_dropped(server):
    with closing(connect(server)) as client:
        client.sendall(LARGE)
        wait_until(lambda: n_connected(server) == 1)
        wait_until(lambda: n_connected(server) == 0)
        assert len(all_that_comes(client)) < 400 * BLOCK


def test_a_client_that_reads_next_to_nothing_is_dropped(server):
    with closing(connect(server)) as client:
        client.sendall(LARGE)
        wait_until(lambda: n_connected(server) == 1)

        def is_dropped():
            with suppress(ConnectionError):
                client.recv(1)
            return n_connected(server) == 0

        wait_until(is_dropped)


def test_a_client_that_reads_slowly_but_reads_gets_everything(server):
    with closing(connect(server)) as client:
        client.sendall(LARGE)
        size, end = 0, time.monotonic() + 3 * WAIT_S
        while size < 400 * BLOCK and (part := client.recv(BLOCK)):
            size += len(part)
            if time.monotonic() < end:
                time.sleep(WAIT_S / 100)
        assert size > 400 * BLOCK  # with the head


def test_others_are_served_while_slow_clients_wait(server):
    with ExitStack() as stack:
        for number in range(N_SLOW):
            client = stack.enter_context(closing(connect(server)))
            client.sendall((b"", REQUEST, CHANGE, LARGE)[number % 4])
        wait_until(lambda: n_connected(server) == N_SLOW)
        assert is_served(server)
        wait_until(lambda: n_connected(server) == 0)
        assert is_served(server)
