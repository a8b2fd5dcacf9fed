"""The command itself: it listens on the loopback only, says where, and ends when asked."""

import http.client
import signal
import socket
import subprocess
import sys
from contextlib import closing
from urllib.parse import urlsplit

import pytest

from frf_ipz.errors import InputError
from frf_ipz.show.server import listen, serve

SOON_S = 60.0


@pytest.fixture
def served(demo):
    command = [sys.executable, "-m", "frf_ipz.cli.main", "show", str(demo / "out"), "--no-browser"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        yield process, urlsplit(process.stdout.readline().strip())
    finally:
        process.kill()
        process.communicate()


def get(address, path):
    with closing(http.client.HTTPConnection(address.hostname, address.port, timeout=SOON_S)) as connection:
        connection.request("GET", path)
        answer = connection.getresponse()
        return answer.status, answer.read()


def test_the_command_serves_the_page_on_the_loopback_and_stops(served, demo):
    process, address = served
    assert address.hostname == "127.0.0.1"
    assert len(address.path.strip("/")) >= 32
    status, page = get(address, address.path)
    assert status == 200
    assert b'id="stabilisation"' in page
    (demo / "secret.txt").write_text("secret", encoding="utf-8")
    for path in ("run/../../secret.txt", "run/..%2f..%2fsecret.txt", "../secret.txt", "run//etc/passwd"):
        assert get(address, address.path + path)[0] in {403, 404}, path
    with socket.socket() as outsider, pytest.raises(OSError, match=r"refused|unreachable|timed out"):
        outsider.settimeout(5)
        outsider.connect((_address_of_this_machine(), address.port))
    process.send_signal(signal.SIGINT)
    assert process.wait(SOON_S) in {0, 130}
    assert "Traceback" not in process.stderr.read()


def _address_of_this_machine():
    """One that is not the loopback, where there is one; else another of the loopback's."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))
        except OSError:
            return "127.0.0.2"
        return probe.getsockname()[0]


def test_the_server_starts_without_what_is_slow_to_import():
    code = "import sys, frf_ipz.show.server; sys.exit(bool({'matplotlib', 'pint', 'control'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_a_port_that_is_taken_is_refused_in_a_sentence():
    with listen(0) as listener, pytest.raises(InputError, match="leave out --port"):
        listen(listener.getsockname()[1])


def test_a_folder_without_a_run_is_refused_before_anything_listens(tmp_path):
    with pytest.raises(InputError, match=r"there is no run here.*and no pipeline"):
        serve(tmp_path, None, None, port=0, announce=pytest.fail)
