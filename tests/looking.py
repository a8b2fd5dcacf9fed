"""Looking at a results folder in every way there is, in a process of its own that is watched."""

import os
import sys
import traceback
import warnings
from contextlib import suppress
from functools import partial
from pathlib import Path

from starlette.testclient import TestClient

from frf_ipz.cli.pictures import picture_list
from frf_ipz.errors import FrfIpzError
from frf_ipz.plotting.registry import describe
from frf_ipz.runs.results import errors_of_results, open_results
from frf_ipz.show.app import build_app
from frf_ipz.show.campaign import find_runs
from frf_ipz.show.list_page import render_list
from frf_ipz.show.workbench import Workbench
from frf_ipz.visible_text import lines

MOST_BYTES = 500_000_000
PAGES = ("", "choices", "state", "shape?mode=0", "shape?hz=100&input={input}", "zoom?low=50&high=200&frfs=0,1")
FORBIDDEN = {
    "os.remove",
    "os.rename",
    "os.rmdir",
    "os.system",
    "os.exec",
    "subprocess.Popen",
    "socket.connect",
    "pty.spawn",
}


def views(folder, out):
    """Everything that looks at results, by name."""

    def bench():
        return Workbench(find_runs(folder)[0], run=None, read=_no_pipeline)

    return {
        "library": lambda: open_results(folder).load().summary(),
        "plot": lambda: _draw_all(folder),
        "report": lambda: open_results(folder).write_report(out / "report.html"),
        "list": lambda: render_list([bench(), bench()]),
        **{f"show {path}": partial(_get, bench, path) for path in PAGES},
    }


def _get(bench, path):
    client = TestClient(build_app([bench()], port=1, token="t"), base_url="http://127.0.0.1:1")
    inputs = [str(label.input_dof) for label in open_results(bench().folder).labels] if "{input}" in path else []
    answer = client.get(f"/t/{path}".replace("{input}", (inputs or [""])[0].replace("+", "%2B")))
    if answer.status_code == 400:
        raise FrfIpzError(answer.json()["error"])
    assert answer.status_code == 200


def _draw_all(folder):
    names, run = picture_list(folder).splitlines()[1:], open_results(folder)
    for name in names:
        with suppress(FrfIpzError), errors_of_results(folder):
            describe(name, run)


def _no_pipeline(path):
    raise FrfIpzError(f"{path} is not read here")


def look(folder, out, names=None):
    """What each view, or each of those of these names, did wrong or said."""
    wrong, said = [], {}
    for name, view in views(folder, out).items():
        if names is not None and name not in names:
            continue
        try:
            view()
        except FrfIpzError as error:
            said[name] = str(error)
            if lines(str(error)).count("\n") or len(str(error)) > 2000:
                wrong.append(f"{name}: {error}"[:3000])
        except BaseException as error:
            place = traceback.extract_tb(error.__traceback__)[-1]
            wrong.append(f"{name}: {error!r:.200} at {place.filename}:{place.lineno}")
    return wrong, said


def in_a_child(work):
    """Do something in a process of its own; what it wrote, and how much memory it took beyond what it began with."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reading)
        status = 1
        try:
            with os.fdopen(writing, "w", encoding="utf-8", errors="backslashreplace") as stream:
                stream.write(work())
            status = 0
        finally:
            os._exit(status)
    os.close(writing)
    with os.fdopen(reading, encoding="utf-8") as stream:
        text = stream.read()
    _, status = os.waitpid(child, 0)
    assert status == 0, text
    return text


def memory(name):
    return next(
        int(line.split()[1]) * 1024 for line in Path("/proc/self/status").read_text().splitlines() if name in line
    )


def content(folder):
    files = [path for path in folder.rglob("*") if path.is_file() and not path.is_symlink()]
    return {path: path.read_bytes() if path.stat().st_size < MOST_BYTES else path.stat().st_mtime_ns for path in files}


class Watch:
    """Notes every file that is opened for writing, and everything that starts or removes, but what is in one folder."""

    def __init__(self, out):
        self.out = str(out)
        self.noted = []
        warnings.simplefilter("ignore")  # numbers that make no sense may be said to make none
        sys.dont_write_bytecode = True  # what Python keeps of a module that a view imports is not the view's doing
        sys.addaudithook(self._note)

    def _note(self, event, arguments):
        if event in FORBIDDEN and not str(arguments[0]).startswith(self.out):
            self.noted.append(f"{event} {arguments}")
        if event == "open" and isinstance(arguments[0], str | bytes) and arguments[2] & (os.O_WRONLY | os.O_RDWR):
            path = os.fsdecode(arguments[0])
            if not path.startswith((self.out, "/dev/null")):
                self.noted.append(f"open for writing {path}")
        if event == "import" and str(arguments[0]).startswith("harm"):
            self.noted.append(f"import {arguments}")

    def look(self, folder, out, names=None):
        """Look at a folder; what went wrong, and what each view said."""
        with suppress(OSError):
            Path("/proc/self/clear_refs").write_text("5")  # the peak starts anew
        before = memory("VmRSS")
        self.noted = []
        wrong, said = look(folder, out, names)
        grown = memory("VmHWM") - before
        if grown > MOST_BYTES:
            wrong.append(f"{grown / 1e6:.0f} MB")
        return [*wrong, *self.noted], said
