"""A process that is killed before any change that it makes on the disk leaves old or new results, whole."""

import shutil
import signal
import sys

import pytest

import commands
import small_results
from whole_results import content, faults_after_a_command, faults_of_reading, results_of

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="processes are copied, and killed by a signal")


def work(out, number, **options):
    return commands.run(out, number, work=small_results.command, log=out.parent / "log", within=out, **options)


@pytest.fixture(params=["first", "later", "after an older version"])
def before(request, tmp_path):
    """What a folder holds before the command."""
    folder = tmp_path / "before"
    if request.param != "first":
        assert work(folder, "1")[0] == 0
        (folder / "own.txt").write_text("the user's")
    if request.param == "after an older version":
        shutil.rmtree(folder / ".frf_ipz")
    return folder


def copy(before, place):
    shutil.rmtree(place, ignore_errors=True)
    if before.exists():
        shutil.copytree(before, place)
    return place


def without_times(folder):
    """Its files, but for what says how long the stages took."""
    return {name: text for name, text in content(folder).items() if name != "run.json"}


def test_killed_before_any_change_it_is_the_old_or_the_new_whole(before, tmp_path):
    out = tmp_path / "out"
    status, said, n_changes = work(copy(before, out), "2")
    assert (status, faults_after_a_command(out)) == (0, []), said
    old, new = results_of(before), results_of(out)
    clean = without_times(out)
    found = []
    for number in range(n_changes):
        assert work(copy(before, out), "2", killed_before=number)[0] == -signal.SIGKILL
        assert faults_of_reading(out) == []
        found.append(results_of(out))
        again = "1" if old is not None and number % 2 else "2"  # back to the old ones, or on to the new ones
        assert work(out, again)[0] == 0
        assert faults_after_a_command(out) == []
        if again == "2":
            assert without_times(out) == clean
    first = found.index(new)
    assert 0 < first < n_changes - 1
    assert found == [old] * first + [new] * (n_changes - first)
