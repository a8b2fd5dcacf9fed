"""Looking at anybody's results: none of their code, nothing outside touched, one line, 500 MB at most."""

import os
import shutil
import sys
import traceback
import warnings
from contextlib import suppress
from functools import partial
from pathlib import Path

import pytest
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
from hostile_folders import KINDS, write_folder

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


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    return write_folder(tmp_path_factory.mktemp("good") / "results")


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
    for name in picture_list(folder).splitlines()[1:]:
        with suppress(FrfIpzError), errors_of_results(folder):
            describe(name, open_results(folder))


def _no_pipeline(path):
    raise FrfIpzError(f"{path} is not read here")


def look(folder, out):
    """What each view said or did wrong."""
    wrong, said = [], {}
    for name, view in views(folder, out).items():
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


def audited(folder, out, user):
    """Look, while every file that is opened for writing and everything that starts or removes is noted."""
    noted = []

    def hook(event, arguments):
        if event in FORBIDDEN and not str(arguments[0]).startswith(str(out)):
            noted.append(f"{event} {arguments}")
        if event == "open" and isinstance(arguments[0], str | bytes) and arguments[2] & (os.O_WRONLY | os.O_RDWR):
            path = os.fsdecode(arguments[0])
            if not path.startswith((str(out), "/dev/null")):
                noted.append(f"open for writing {path}")
        if event == "import" and str(arguments[0]).startswith("harm"):
            noted.append(f"import {arguments}")

    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")  # the peak starts anew
    warnings.simplefilter("ignore")  # numbers that make no sense may be said to make none
    before = memory("VmRSS")
    sys.addaudithook(hook)
    os.chdir(folder)
    wrong, _ = look(folder, out)
    grown = memory("VmHWM") - before
    if grown > MOST_BYTES:
        wrong.append(f"{grown / 1e6:.0f} MB")
    assert (user / "precious.txt").exists()
    return "\n".join([*wrong, *noted])


@pytest.mark.skipif(sys.platform != "linux", reason="measured by what Linux tells of a process")
@pytest.mark.parametrize("name", KINDS)
def test_looking_does_no_harm_and_says_what_is_wrong_in_one_line(tmp_path, good, name):
    folder, user, out = tmp_path / "results", tmp_path / "user", tmp_path / "out"
    shutil.copytree(good, folder)
    user.mkdir()
    out.mkdir()
    (user / "precious.txt").write_text("years of work")
    KINDS[name](folder, user)
    before = content(tmp_path)
    assert in_a_child(lambda: audited(folder, out, user)) == ""
    after = {path: data for path, data in content(tmp_path).items() if not path.is_relative_to(out)}
    assert after.keys() == before.keys()
    assert after == before


def test_a_good_folder_is_shown_without_a_word(tmp_path, good):
    wrong, said = look(good, tmp_path)
    assert wrong == []
    assert said == {}
