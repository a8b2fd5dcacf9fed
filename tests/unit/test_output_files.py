"""Files are written whole or not at all."""

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from frf_ipz import output_files
from frf_ipz.output_files import link_or_copy, remove_litter, replacing, write_text


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_a_fault_half_way_leaves_what_was_there_and_nothing_beside_it(tmp_path):
    write_text(tmp_path / "a.txt", "old")
    with pytest.raises(ZeroDivisionError), replacing(tmp_path / "a.txt") as target:
        target.write_text("half")
        _ = 1 / 0
    assert (tmp_path / "a.txt").read_text() == "old"
    assert names(tmp_path) == ["a.txt"]


@pytest.mark.parametrize("step", ["replace", "fsync"])
def test_a_step_that_fails_leaves_what_was_there(tmp_path, monkeypatch, step):
    write_text(tmp_path / "a.txt", "old")

    def fail(*arguments):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), *map(str, arguments[:1]))

    monkeypatch.setattr(os, step, fail)
    with pytest.raises(OSError, match="No space"):
        write_text(tmp_path / "a.txt", "new")
    assert (tmp_path / "a.txt").read_text() == "old"
    assert names(tmp_path) == ["a.txt"]


def name_beside(folder):
    with replacing(folder / "a.txt") as beside:
        beside.write_text("half")
        return beside.name


@pytest.mark.skipif(sys.platform == "win32", reason="asking for a process would end it")
def test_what_killed_processes_have_left_is_removed_and_nothing_else(tmp_path):
    own = name_beside(tmp_path)
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    of_ended = own.replace(f"-{os.getpid()}-", f"-{ended.pid}-")
    others = [own, of_ended[:-5], of_ended + ".txt", ".frf-ipz-notes.txt", of_ended.replace("frf-ipz-", "frf-ipz-0")]
    assert of_ended != own
    for name in (of_ended, *others):
        (tmp_path / name).write_text("half")
    (tmp_path / "folder").mkdir()
    remove_litter(tmp_path)
    assert names(tmp_path) == sorted(["a.txt", "folder", *others])
    remove_litter(tmp_path / "none")


def test_until_it_is_whole_the_old_file_is_there(tmp_path):
    write_text(tmp_path / "a.txt", "old")
    with replacing(tmp_path / "a.txt") as target:
        target.write_text("new")
        assert (tmp_path / "a.txt").read_text() == "old"
        assert target.suffix == ".txt"
    assert (tmp_path / "a.txt").read_text() == "new"


def test_a_link_stays_one_and_permissions_stay(tmp_path):
    (tmp_path / "a.txt").write_text("old")
    (tmp_path / "a.txt").chmod(0o640)
    (tmp_path / "link.txt").symlink_to("a.txt")
    write_text(tmp_path / "link.txt", "new")
    assert (tmp_path / "link.txt").is_symlink()
    assert (tmp_path / "a.txt").read_text() == "new"
    assert (tmp_path / "a.txt").stat().st_mode & 0o777 == 0o640


def test_a_file_that_may_not_be_written_is_not_replaced(tmp_path, monkeypatch):
    (tmp_path / "a.txt").write_text("old")
    monkeypatch.setattr(os, "access", lambda path, mode: False)  # the user who runs the tests may be root  # noqa: ARG005
    with pytest.raises(PermissionError):
        write_text(tmp_path / "a.txt", "new")
    assert (tmp_path / "a.txt").read_text() == "old"


@pytest.mark.skipif(sys.platform == "win32", reason="no devices in the file system")
def test_a_device_is_written_to_and_not_replaced():
    write_text(Path("/dev/null"), "text")
    assert Path("/dev/null").is_char_device()


def test_a_name_as_long_as_names_can_be_is_written(tmp_path):
    path = tmp_path / ("n" * 251 + ".txt")
    write_text(path, "text")
    assert path.read_text() == "text"


def test_a_name_that_is_no_utf8_is_written_out(tmp_path):
    write_text(tmp_path / "a.json", '{"name": "b\udcff"}')
    assert (tmp_path / "a.json").read_bytes() == b'{"name": "b\\udcff"}'


def test_a_file_is_copied_where_there_are_no_links(tmp_path, monkeypatch):
    (tmp_path / "a.txt").write_text("text")
    link_or_copy(tmp_path / "a.txt", tmp_path / "b.txt")
    assert (tmp_path / "a.txt").samefile(tmp_path / "b.txt")

    def fail(source, target):  # noqa: ARG001  as the function that it stands for
        raise OSError(errno.EPERM, "Operation not permitted")

    monkeypatch.setattr(os, "link", fail)
    link_or_copy(tmp_path / "a.txt", tmp_path / "c.txt")
    assert (tmp_path / "c.txt").read_text() == "text"
    assert not (tmp_path / "a.txt").samefile(tmp_path / "c.txt")


def test_a_file_that_is_being_read_is_replaced_later_on_windows(tmp_path, monkeypatch):
    write_text(tmp_path / "a.txt", "old")
    replace, refused = os.replace, []

    def replace_at_the_third_try(source, target):
        if len(refused) < 2:
            refused.append(target)
            raise PermissionError(errno.EACCES, "Permission denied")
        replace(source, target)

    monkeypatch.setattr(os, "replace", replace_at_the_third_try)
    with pytest.raises(PermissionError):
        write_text(tmp_path / "a.txt", "new")
    refused.clear()
    monkeypatch.setattr(output_files, "IS_WINDOWS", True)
    write_text(tmp_path / "a.txt", "new")
    assert (tmp_path / "a.txt").read_text() == "new"
