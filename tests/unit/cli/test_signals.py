"""Ctrl-C and SIGTERM: one line, an exit status that says which, and nothing lost on the way."""

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress

import pytest

from frf_ipz.cli import main as command

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows sends no signals to another process")


@pytest.fixture(autouse=True)
def _signals_as_at_a_terminal():
    """Whatever started the tests: jobs in the background ignore some signals, as does what `nohup` starts."""
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    handlers = {signal.SIGINT: signal.default_int_handler}
    before = {number: signal.signal(number, handlers.get(number, signal.SIG_DFL)) for number in numbers}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


def send(number):
    os.kill(os.getpid(), number)
    time.sleep(0.1)  # interrupted


def dropped(number):
    """As imports do that go on without what they tried to import."""
    with suppress(BaseException):
        send(number)


def in_a_destructor(number):
    class Signalling:
        def __del__(self):
            send(number)

    Signalling()


@pytest.mark.parametrize("arrive", [send, dropped, in_a_destructor], ids=lambda item: item.__name__)
@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)])
def test_a_signal_ends_the_command_with_one_line_wherever_it_arrives(monkeypatch, capsys, arrive, number, status):
    handlers = [signal.getsignal(item) for item in (signal.SIGINT, signal.SIGTERM)]
    came_to_the_end = []

    def work():
        arrive(number)
        for _ in range(500):  # no single call: that is not interrupted
            time.sleep(0.01)
        came_to_the_end.append(True)

    monkeypatch.setattr(command, "_run", work)
    with pytest.raises(SystemExit) as stopped:
        command.main()
    assert not came_to_the_end
    assert stopped.value.code == status
    assert capsys.readouterr().err == f"frf-ipz: {command.STOPPED}\n"
    assert [signal.getsignal(item) for item in (signal.SIGINT, signal.SIGTERM)] == handlers


def test_a_signal_that_is_ignored_stays_ignored(monkeypatch):
    monkeypatch.setattr(command, "_run", lambda: send(signal.SIGHUP))
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as nohup does
    try:
        command.main()
    finally:
        signal.signal(signal.SIGHUP, before)


def test_a_signal_while_the_command_is_loaded_is_one_line():
    source = (
        "import os, signal, sys\n"
        "class Loading:\n"
        "    def find_spec(self, name, path, target=None):\n"
        "        if name == 'frf_ipz.cli.commands':\n"
        "            os.kill(os.getpid(), signal.SIGTERM)\n"
        "sys.meta_path.insert(0, Loading())\n"
        "from frf_ipz.cli.main import main\n"
        "main()\n"
    )
    ended = subprocess.run([sys.executable, "-c", source], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout, ended.stderr) == (143, "", f"frf-ipz: {command.STOPPED}\n")
