"""A run's folder: everything or nothing, and nothing twice."""

import ctypes
import errno
import json
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import pytest

import frf_ipz
from frf_ipz.errors import InputError
from frf_ipz.runs.digests import digest, digest_file
from frf_ipz.runs.folder import STAGING, open_run, read_manifest, read_run


def write_text(text):
    return lambda path: path.write_text(text, encoding="utf-8")


def stage(folder, key, value):
    return folder.stage("fit", key, lambda: value, lambda result: {"fit.txt": write_text(str(result))})


def test_a_stage_is_computed_once_for_a_key(tmp_path):
    with open_run(tmp_path) as folder:
        assert stage(folder, "a", 1) == 1
    with open_run(tmp_path) as folder:
        assert stage(folder, "a", 2) == 1
        assert folder.computed == []
    with open_run(tmp_path) as folder:
        assert stage(folder, "b", 3) == 3
        assert folder.computed == ["fit"]
    assert (tmp_path / "fit.txt").read_text() == "3"
    assert read_run(tmp_path).load("fit") == 3


def test_a_damaged_result_is_computed_again(tmp_path):
    with open_run(tmp_path) as folder:
        stage(folder, "a", 1)
    (tmp_path / "stages" / "fit.result").write_bytes(b"no result")
    with open_run(tmp_path) as folder:
        assert stage(folder, "a", 2) == 2


def test_a_file_that_was_deleted_is_written_again(tmp_path):
    with open_run(tmp_path) as folder:
        stage(folder, "a", 1)
    (tmp_path / "fit.txt").unlink()
    with open_run(tmp_path) as folder:
        stage(folder, "a", 1)
    assert (tmp_path / "fit.txt").read_text() == "1"


def test_a_file_that_its_stage_no_longer_writes_goes_and_one_of_another_stage_stays(tmp_path):
    writers = {"fit.txt": write_text("1"), "more.txt": write_text("2"), "shared.txt": write_text("3")}
    with open_run(tmp_path) as folder:
        folder.stage("fit", "a", lambda: 1, lambda _: writers)
        folder.stage("pair", "a", lambda: 1, lambda _: {"shared.txt": write_text("4")})
    (tmp_path / "own.txt").write_text("the user's")
    with open_run(tmp_path) as folder:
        stage(folder, "b", 2)
        assert (tmp_path / "more.txt").exists()
    assert not (tmp_path / "more.txt").exists()
    assert (tmp_path / "shared.txt").read_text() == "4"
    assert (tmp_path / "own.txt").exists()


def test_a_run_that_fails_leaves_what_was_there(tmp_path):
    with open_run(tmp_path) as folder:
        stage(folder, "a", 1)
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    with pytest.raises(ZeroDivisionError), open_run(tmp_path) as folder:
        stage(folder, "b", 2)
        _ = 1 / 0
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before
    assert not list(tmp_path.glob(f"{STAGING}*"))


def test_a_first_run_that_fails_leaves_no_folder(tmp_path):
    out = tmp_path / "new" / "results"
    with pytest.raises(ZeroDivisionError), open_run(out):
        _ = 1 / 0
    assert not out.exists()


def test_a_reader_never_sees_half_a_file(tmp_path):
    with open_run(tmp_path) as folder:
        stage(folder, "a", 1)
        assert not (tmp_path / "fit.txt").exists()
    assert (tmp_path / "fit.txt").exists()


def test_what_a_killed_run_left_is_swept(tmp_path):
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    (tmp_path / f"{STAGING}{dead.pid}").mkdir()
    alive = tmp_path / f"{STAGING}{os.getppid()}"
    alive.mkdir()
    with open_run(tmp_path):
        pass
    assert not (tmp_path / f"{STAGING}{dead.pid}").exists()
    assert alive.exists()


def test_on_windows_no_signal_is_sent_to_ask_whether_a_process_runs(tmp_path, monkeypatch):
    """There, signal 0 is Ctrl-C. Process 11 has ended but is still known, 12 runs, 13 is another user's, 14 is none."""
    handles, closed = {11: 111, 12: 112}, []
    kernel = SimpleNamespace(
        OpenProcess=Mock(side_effect=lambda *arguments: handles.get(arguments[2])),
        WaitForSingleObject=lambda *arguments: 0x102 if arguments[0].value == 112 else 0,
        CloseHandle=lambda handle: closed.append(handle.value),
    )

    def last_error():
        return 5 if kernel.OpenProcess.call_args.args[2] == 13 else 87

    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setattr(ctypes, "WinDLL", Mock(return_value=kernel), raising=False)
    monkeypatch.setattr(ctypes, "get_last_error", last_error, raising=False)
    monkeypatch.delattr(os, "kill")
    for process in (11, 12, 13, 14):
        (tmp_path / f"{STAGING}{process}").mkdir()
    with open_run(tmp_path):
        pass
    assert {path.name for path in tmp_path.glob(f"{STAGING}*")} == {f"{STAGING}12", f"{STAGING}13"}
    assert sorted(closed) == [111, 112]


def test_files_are_synced_as_windows_wants_it(tmp_path, monkeypatch):
    synced = []

    def sync(descriptor):
        os.write(descriptor, b"")  # fails for what is open for reading only, as does Windows' fsync
        synced.append(descriptor)

    monkeypatch.setattr(os, "fsync", sync)
    with open_run(tmp_path) as folder:
        stage(folder, "a", 1)
    assert len(synced) == 3


@pytest.fixture
def open_elsewhere(monkeypatch):
    """Files that are open in another program, as Windows sees it: nothing can take their place, nor can they go."""
    held = set()
    replace, unlink = Path.replace, Path.unlink

    def replace_if_free(self, target):
        if target in held:
            raise PermissionError(errno.EACCES, "Permission denied")
        return replace(self, target)

    def unlink_if_free(self, missing_ok=False):
        if self in held:
            raise PermissionError(errno.EACCES, "Permission denied")
        unlink(self, missing_ok=missing_ok)

    monkeypatch.setattr(Path, "replace", replace_if_free)
    monkeypatch.setattr(Path, "unlink", unlink_if_free)
    return held


def test_a_table_that_is_open_elsewhere_is_said_and_no_new_result_stands_under_an_old_key(tmp_path, open_elsewhere):
    with open_run(tmp_path) as folder:
        stage(folder, "a", 1)
    open_elsewhere.add(tmp_path / "fit.txt")
    with pytest.raises(InputError, match=r"fit\.txt: cannot be written: .*close it"), open_run(tmp_path) as folder:
        folder.stage("fit", "b", lambda: 2, lambda _: {"a.txt": write_text("2"), "fit.txt": write_text("2")})
    assert (tmp_path / "a.txt").read_text() == "2"  # it took its place before
    assert not list(tmp_path.glob(f"{STAGING}*"))
    open_elsewhere.clear()
    with open_run(tmp_path) as folder:
        assert stage(folder, "a", 3) == 3
    assert (tmp_path / "fit.txt").read_text() == "3"


def test_an_abandoned_table_that_is_open_elsewhere_is_said(tmp_path, open_elsewhere):
    with open_run(tmp_path) as folder:
        folder.stage("fit", "a", lambda: 1, lambda _: {"more.txt": write_text("1")})
    open_elsewhere.add(tmp_path / "more.txt")
    with pytest.raises(InputError, match=r"more\.txt: cannot be written: .*close it"), open_run(tmp_path) as folder:
        stage(folder, "b", 2)


def test_a_full_disk_is_said_in_one_line_and_loses_nothing(tmp_path):
    with open_run(tmp_path) as folder:
        stage(folder, "a", 1)

    def fail(path):
        path.write_text("half")
        raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.raises(InputError, match="disk is full"), open_run(tmp_path) as folder:
        folder.stage("fit", "b", lambda: 2, lambda _: {"fit.txt": fail})
    assert (tmp_path / "fit.txt").read_text() == "1"


def test_an_out_folder_that_cannot_be_made_is_said(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="choose another --out"), open_run(tmp_path / "file" / "results"):
        pass


def test_a_folder_without_a_run_is_said(tmp_path):
    with pytest.raises(InputError, match="no run here"):
        read_run(tmp_path)


def test_a_damaged_manifest_means_computing_anew(tmp_path):
    (tmp_path / "run.json").write_text("{half")
    assert read_manifest(tmp_path) == {}


def test_files_of_a_page_are_written_again_when_they_are_gone(tmp_path):
    for expected in (["report"], [], ["report"]):
        with open_run(tmp_path) as folder:
            folder.page("report", "a", {"report.html": write_text("page")})
            assert folder.computed == expected
        if not expected:
            (tmp_path / "report.html").unlink()


def test_digests_follow_the_content(tmp_path):
    assert digest({"a": 1, "b": 2}) == digest({"b": 2, "a": 1})
    assert digest({"a": 1}) != digest({"a": 2})
    (tmp_path / "file").write_text("1")
    first = digest_file(tmp_path / "file")
    (tmp_path / "file").write_text("2")
    assert digest_file(tmp_path / "file") != first


def test_results_of_another_version_are_refused_with_what_to_do(tmp_path):
    manifest = {"frf_ipz": "0.1.0", "pipeline": "p.toml", "stages": {}}
    (tmp_path / "run.json").write_text(json.dumps(manifest), encoding="utf-8")
    with pytest.raises(InputError, match=r"made by frf_ipz 0\.1\.0, .*frf-ipz run p\.toml --out") as refused:
        read_run(tmp_path)
    assert "\n" not in str(refused.value)
    (tmp_path / "run.json").write_text(json.dumps({**manifest, "frf_ipz": frf_ipz.__version__}), encoding="utf-8")
    assert read_run(tmp_path).manifest["pipeline"] == "p.toml"
