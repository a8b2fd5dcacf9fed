"""One command at a time for a folder: the second waits, says for whom, and gives up after ten seconds."""

import json
import os
import sys
import threading
from types import SimpleNamespace

import pytest

import commands
from frf_ipz.errors import InputError
from frf_ipz.progress import silent
from frf_ipz.runs import folder_lock
from frf_ipz.runs.folder_lock import HOLDER, LOCK, WAIT_S, lock_folder
from frf_ipz.runs.generations import HIDDEN
from small_campaign import write_campaign


@pytest.fixture
def clock(monkeypatch):
    """Time that passes only where it is waited for; `meanwhile` is done then."""
    clock = SimpleNamespace(now=100.0, meanwhile=lambda: None)

    def sleep(seconds):
        clock.now += seconds
        clock.meanwhile()

    monkeypatch.setattr(folder_lock, "time", SimpleNamespace(monotonic=lambda: clock.now, sleep=sleep))
    return clock


def lock(path, progress=silent):
    return lock_folder(path, path / "hidden", progress=progress)


def test_the_second_waits_ten_seconds_says_for_whom_and_gives_up(tmp_path, clock, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["/usr/bin/frf-ipz", "run", "my pipeline.toml"])
    said = []
    with lock(tmp_path):
        holder = json.loads((tmp_path / "hidden" / HOLDER).read_text())
        waiting = lock(tmp_path, lambda fraction, text: said.append((fraction, text)))
        with pytest.raises(InputError, match="wait until it is done, or choose another --out") as refused, waiting:
            pass
        assert (tmp_path / "hidden" / HOLDER).exists()
    assert clock.now - 100.0 == pytest.approx(WAIT_S, rel=0.02) == pytest.approx(10.0)
    who = f"process {os.getpid()} (frf-ipz run 'my pipeline.toml', since {holder['since']})"
    assert str(refused.value).startswith(f"{tmp_path}: {who} is at work here")
    assert {text for _, text in said} == {f"waiting for {who}"}
    assert [fraction for fraction, _ in said] == sorted(fraction for fraction, _ in said)
    assert not (tmp_path / "hidden" / HOLDER).exists()


def test_a_holder_that_cannot_be_read_is_another_command(tmp_path, clock):
    del clock
    with lock(tmp_path):
        (tmp_path / "hidden" / HOLDER).write_text("{half")
        with pytest.raises(InputError, match=f"{tmp_path}: another command is at work here"), lock(tmp_path):
            pass


def test_the_second_of_two_threads_works_when_the_first_is_done(tmp_path, clock):
    works, may_end, done = threading.Event(), threading.Event(), []

    def first():
        with lock(tmp_path):
            works.set()
            may_end.wait()
            done.append("first")

    thread = threading.Thread(target=first, daemon=True)
    thread.start()
    works.wait()

    def end_the_first():
        may_end.set()
        thread.join()

    clock.meanwhile = end_the_first
    with lock(tmp_path):
        done.append("second")
    assert done == ["first", "second"]
    assert clock.now > 100.0


def test_a_lock_whose_file_was_removed_keeps_nobody_out_who_comes_later(tmp_path, clock):
    """As a first command does that fails: it has nothing to leave."""

    def remove():
        (tmp_path / "hidden" / LOCK).unlink()
        (tmp_path / "hidden").rmdir()
        holding.release()
        clock.meanwhile = lambda: None

    holding = folder_lock.FileLock(tmp_path / "hidden" / LOCK)
    (tmp_path / "hidden").mkdir()
    holding.acquire()
    clock.meanwhile = remove
    with lock(tmp_path), pytest.raises(InputError, match="is at work here"), lock(tmp_path):
        pass


@pytest.mark.skipif(sys.platform == "win32", reason="no signals there")
def test_a_command_that_is_kept_out_ends_with_one_line_and_status_2(tmp_path):
    pipeline, out = write_campaign(tmp_path), tmp_path / "out"
    with lock_folder(out, out / HIDDEN, progress=silent):
        status, said, _ = commands.run("fit", pipeline, "--out", out, work=commands.impatient, log=tmp_path / "log")
    assert status == 2
    assert said.count("\n") == 1
    assert said.startswith(f"frf-ipz: {out}: process {os.getpid()} (")
    assert not (out / "run.json").exists()
    assert commands.run("fit", pipeline, "--out", out, work=commands.impatient, log=tmp_path / "log")[0] == 0
