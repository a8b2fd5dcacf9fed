"""What is read in another process arrives as it was read, and what ends or keeps that process is one error."""

import os
import signal
import sys
import time

import numpy as np
import pytest

from frf_ipz import input_files, reader_process
from frf_ipz.errors import FileFormatError
from frf_ipz.reader_process import read_in_process

READER = """
import os, sys, time
from pathlib import Path
import numpy as np
from frf_ipz.errors import FileFormatError
from frf_ipz.reader_process import FileContents, as_file

def read(data, path):
    word = data.read().decode()
    if word == "abort":
        os.abort()
    if word == "sleep":
        time.sleep(60)
    if word == "refuse":
        raise FileFormatError(path, "is not what it should be", where="line 3")
    if word == "raise":
        raise ValueError("what a library\\nsays")
    if word == "object":
        return FileContents(arrays={"a": np.array([{}], object)})
    if word == "large":
        return FileContents(arrays={"a": np.zeros(1000)})
    if word == "print":
        print("a library prints", flush=True)
        os.write(1, b"so does a compiled one")
    if word == "arrays":
        table = np.arange(12.0).reshape(3, 4)
        return FileContents(
            arrays={
                "c": table, "f": table.T, "every other": table[:, ::2], "complex": table * 1j,
                "none": np.zeros((0, 3)), "one": np.asarray(7), "big": table.astype(">i4"),
                "texts": np.array(["m/s²", "N"]), "bytes": np.array([b"N"]), "true": table > 3,
                "cube": np.arange(24).reshape(2, 3, 4).transpose(1, 0, 2),
            },
            said={"texts": {"ü": ["a", "b"]}, "is": True},
        )
    with as_file(data, path) as copy:
        return FileContents(said={"word": word, "process": os.getpid(), "copy": copy.name})
"""


@pytest.fixture
def ask(tmp_path, monkeypatch):
    """Write a word into a file and have it read."""
    (tmp_path / "modules").mkdir()
    (tmp_path / "modules" / "some_reader.py").write_text(READER)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path / "modules"), *filter(None, sys.path)]))
    reader_process._reader_of.cache_clear()

    def read(word, most_bytes=10_000):
        path = tmp_path / "file.DAT"
        path.write_text(word)
        return read_in_process(path, "some_reader", kind="a file of words", most_bytes=most_bytes)

    yield read
    reader_process._reader_of(os.getpid()).end()
    reader_process._reader_of.cache_clear()


def test_arrays_arrive_as_they_were(ask):
    found = ask("arrays")
    table = np.arange(12.0).reshape(3, 4)
    expected = {
        "c": table,
        "f": table.T,
        "every other": table[:, ::2],
        "complex": table * 1j,
        "none": np.zeros((0, 3)),
        "one": np.asarray(7),
        "big": table.astype(">i4"),
        "texts": np.array(["m/s²", "N"]),
        "bytes": np.array([b"N"]),
        "true": table > 3,
        "cube": np.arange(24).reshape(2, 3, 4).transpose(1, 0, 2),
    }
    assert list(found.arrays) == list(expected)
    for name, values in expected.items():
        np.testing.assert_array_equal(found.arrays[name], values, strict=True)
        assert found.arrays[name].flags.writeable
    assert found.said == {"texts": {"ü": ["a", "b"]}, "is": True}


def test_one_process_reads_one_file_after_another(ask):
    first, second = ask("x"), ask("y")
    assert (first.said["word"], second.said["word"]) == ("x", "y")
    assert first.said["process"] == second.said["process"] != os.getpid()
    assert first.said["copy"] == "file.dat"


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("abort", "file.DAT: cannot be read as a file of words: it crashes the library that reads it; is it damaged"),
        ("refuse", "file.DAT, line 3: is not what it should be"),
        ("raise", "cannot be read as a file of words: what a library says"),
        ("object", "'a' is an array of object"),
        ("large", "file.DAT: it would be 0 MB of numbers in a file of"),
    ],
)
def test_what_a_file_does_to_its_reader_is_one_error_and_the_next_is_read(ask, word, message):
    with pytest.raises(FileFormatError, match=message):
        ask(word, most_bytes=1000)
    assert ask("x").said["word"] == "x"


def test_a_file_that_keeps_its_reader_is_one_error_and_the_next_is_read(ask, monkeypatch):
    with (
        monkeypatch.context() as patched,
        pytest.raises(FileFormatError, match="the library that reads it for more than 2 s"),
    ):
        patched.setattr(reader_process, "LONGEST_S", 2.0)
        ask("sleep")
    assert ask("x").said["word"] == "x"


def test_a_file_that_does_not_fit_into_the_memory_is_refused_before_it_is_read(ask, monkeypatch):
    monkeypatch.setattr(input_files, "_memory_bytes", lambda: 3)
    with pytest.raises(FileFormatError, match=r"file\.DAT: "):
        ask("words")
    assert ask("abc").said["word"] == "abc"


def test_what_a_library_prints_is_no_answer(ask):
    assert ask("print").said["word"] == "print"


def test_what_interrupts_an_answer_ends_the_process(ask, monkeypatch):
    def interrupt(*_):
        raise KeyboardInterrupt

    first = ask("x").said["process"]
    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        patched.setattr(reader_process, "_line", interrupt)
        ask("y")
    again = ask("z")
    assert again.said["word"] == "z"
    assert again.said["process"] != first


def test_nothing_in_the_users_folder_is_taken_for_a_module(ask, tmp_path, monkeypatch):
    (tmp_path / "json.py").write_text("raise SystemExit('a file of the user was run')")
    monkeypatch.chdir(tmp_path)
    assert ask("x").said["word"] == "x"


def exit_code_of(process, longest_s=10.0):
    """Wait for a child, and kill it where it takes too long."""
    end = time.monotonic() + longest_s
    while time.monotonic() < end:
        ended, status = os.waitpid(process, os.WNOHANG)
        if ended:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.01)
    os.kill(process, signal.SIGKILL)
    return os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])


def test_a_forked_process_has_a_reader_of_its_own(ask):
    ours = reader_process._reader_of(os.getpid())
    first = ask("x").said["process"]
    child = os.fork()
    if child == 0:
        code = 1
        try:
            ours.end()  # as at the end of the process
            code = 10 if ask("y").said["process"] != first else 1
        finally:
            os._exit(code)  # whatever was raised: the tests after this one are the parent's
    assert exit_code_of(child) == 10
    assert ask("z").said["process"] == first
