"""Whatever the system refuses while results take their place: one line, exit 2, and all is as it was byte for byte."""

import errno
import shutil
import sys

import pytest

import commands
import small_results
from whole_results import content, faults_after_a_command, faults_of_reading, results_of

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="processes are copied")


@pytest.fixture
def old(tmp_path):
    """Results of a first command, and a file of the user's among them."""
    work(tmp_path / "old", "1")
    (tmp_path / "old" / "own.txt").write_text("the user's")
    return tmp_path / "old"


def work(out, number, **options):
    return commands.run(out, number, work=small_results.command, log=out.parent / "log", within=out, **options)


def judge(old, out, status, said):
    """Tell whether the command came to its end; else it has said so, and nothing has changed."""
    assert faults_of_reading(out) == []
    if status:
        assert (status, said.count("\n")) == (2, 1), said
        assert "cannot be written" in said
        assert content(out) == content(old)
        assert results_of(out) == results_of(old)
    assert work(out, "2")[0] == 0
    assert faults_after_a_command(out) == []
    assert content(out)["own.txt"] == b"the user's"
    return status != 0


@pytest.mark.parametrize(
    ("reason", "step"), [(errno.ENOSPC, 1), (errno.EACCES, 4), (errno.EROFS, 4)], ids=["no room", "denied", "read-only"]
)
def test_one_change_that_is_refused(old, reason, step):
    out, n_refused = old.parent / "out", 0
    shutil.copytree(old, out)
    n_changes = work(out, "2")[2]
    for number in range(0, n_changes, step):
        shutil.rmtree(out)
        shutil.copytree(old, out)
        status, said, _ = work(out, "2", refused=reason, refused_at=number)
        n_refused += judge(old, out, status, said)
    assert (
        n_changes / step / 4 < n_refused < n_changes / step
    )  # what is cleared up, or can be copied in place of linked, may fail


def test_a_disk_that_is_full_from_some_moment_on(old):
    out, n_refused = old.parent / "out", 0
    shutil.copytree(old, out)
    n_changes = work(out, "2")[2]
    for number in range(n_changes):
        shutil.rmtree(out)
        shutil.copytree(old, out)
        status, said, _ = work(out, "2", refused=errno.ENOSPC, refused_from=number)
        assert not status or "the disk is full" in said
        n_refused += judge(old, out, status, said)
    assert n_refused > n_changes / 4
