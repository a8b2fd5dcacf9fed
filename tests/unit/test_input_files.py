"""The one door to files of others: only what is a file is opened, and what is wrong is one line."""

import os
import sys
from pathlib import Path

import pytest

from frf_ipz.errors import FileFormatError
from frf_ipz.input_files import open_input, read_bytes, read_text, require_regular_file

POSIX = pytest.mark.skipif(sys.platform == "win32", reason="no devices and pipes among the files there")


def message_of(read, path, **options):
    with pytest.raises(FileFormatError) as caught:
        read(path, **options)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def _pipe(folder):
    os.mkfifo(folder / "pipe")
    return folder / "pipe"


def _circle(folder):
    (folder / "a").symlink_to(folder / "b")
    (folder / "b").symlink_to(folder / "a")
    return folder / "a"


@POSIX
@pytest.mark.parametrize(
    ("make", "problem"),
    [
        (lambda _: Path("/dev/zero"), "device or a pipe"),
        (_pipe, "device or a pipe"),
        (_circle, "leads in a circle"),
        (lambda folder: folder, "is a folder"),
        (lambda folder: folder / "missing.toml", "no such file"),
        (lambda folder: folder / ("a" * 300), "cannot be read: File name too long"),
        (lambda folder: folder / "a\0b", "no name that a file can have"),
        (lambda folder: folder / "a\udcff", "not in UTF-8"),
        (lambda _: Path(__file__) / "inside", "cannot be read: Not a directory"),
    ],
    ids=["device", "pipe", "circle", "folder", "missing", "long name", "NUL", "not UTF-8", "inside a file"],
)
@pytest.mark.parametrize("read", [read_bytes, read_text, require_regular_file])
def test_what_is_no_file_is_refused_in_one_line(tmp_path, make, problem, read):
    assert problem in message_of(read, make(tmp_path))


def test_a_file_that_may_not_be_read_is_named(tmp_path, monkeypatch):
    path = tmp_path / "locked.csv"
    path.write_text("1")
    monkeypatch.setattr(Path, "open", lambda *_: (_ for _ in ()).throw(PermissionError(13, "Permission denied")))
    assert message_of(read_bytes, path) == f"{path}: cannot be read: Permission denied"


def test_a_file_larger_than_its_limit_is_refused_before_it_is_read(tmp_path):
    path = tmp_path / "large.toml"
    with path.open("wb") as stream:
        stream.truncate(1 << 40)  # without content on the disk
    assert "has 1099512 MB" in message_of(read_bytes, path)
    assert "at most 67 MB" in message_of(read_text, path)
    assert "at most 0 MB" in message_of(read_bytes, path, most_bytes=10)


def test_parts_and_whole_are_the_same_bytes(tmp_path):
    path = tmp_path / "file"
    path.write_bytes(b"\xef\xbb\xbfone\r\ntwo")
    with open_input(path) as stream:
        assert stream.read(3) + stream.read() == read_bytes(path) == path.read_bytes()
    assert read_text(path) == "one\ntwo"
    assert require_regular_file(path) == len(path.read_bytes())


def test_what_is_wrong_with_the_content_stays_what_it_is(tmp_path):
    path = tmp_path / "file"
    path.write_bytes(b"x")
    with pytest.raises(ValueError, match="no number") as caught, open_input(path):
        raise ValueError("no number")
    assert not isinstance(caught.value, FileFormatError)
    with pytest.raises(FileFormatError, match="cannot be read: Input/output error"), open_input(path):
        raise OSError(5, "Input/output error")  # a stick that is pulled out, while it is read
