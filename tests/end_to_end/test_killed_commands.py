"""A command that ends at any moment leaves the old results or the new ones, whole, and the next one is as ever.

One that is killed leaves work to the next; one that is asked to stop clears up behind itself.
"""

import os
import random
import shutil
import signal
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

import commands
from looking import look
from small_campaign import write_quick_campaign
from whole_results import content, faults_after_a_command, faults_of_reading, results_of

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="processes are copied, and killed by a signal")

VERBS = ("run", "diagnose", "export", "first run")
N_MOMENTS = 4  # of the changes of each verb, in the fast tests
N_TRIALS = int(os.environ.get("TRIALS", "1"))  # a long proof asks for 10: every change, and 100 moments at random
OTHER_BAND = "580.0"
STOPPED = 128 + signal.SIGINT


@dataclass(frozen=True)
class Case:
    """A folder of results, what a command makes of it, and how many changes it needs for that."""

    folder: Path
    verb: str
    n_changes: int
    old: object
    new: object
    clean: object  # what a run makes of nothing
    clean_after: object  # what a run makes of what the command makes of nothing: a run keeps what a diagnosis has found

    def copy(self, place):
        """The folder as it was before the command."""
        shutil.rmtree(place, ignore_errors=True)
        if (self.folder / "old").exists():
            shutil.copytree(self.folder / "old", place)
        return place

    def start(self, out, **options):
        """The command on a copy."""
        verb, pipeline = self.verb.split()[-1], self.folder / "pipeline.toml"
        return commands.Command(verb, pipeline, "--out", out, log=self.folder / "log", within=out, **options)


@pytest.fixture(scope="module")
def cases(tmp_path_factory):
    """A case of each verb, made when it is first asked for."""
    made = {}

    def case(verb):
        if verb not in made:
            made[verb] = _make_case(tmp_path_factory.mktemp("killed"), verb)
        return made[verb]

    return case


def _make_case(folder, verb):
    pipeline = write_quick_campaign(folder)
    log = folder / "log"
    if verb != "first run":
        assert commands.run("run", pipeline, "--out", folder / "old", log=log)[0] == 0
        (folder / "old" / "own.txt").write_text("the user's")
    pipeline.write_text(pipeline.read_text().replace("600.0", OTHER_BAND))
    case = Case(
        folder=folder, verb=verb, n_changes=0, old=results_of(folder / "old"), new=None, clean=None, clean_after=None
    )
    command = case.start(case.copy(folder / "new"))
    assert command.wait() == 0, command.said
    n_changes, new = command.counter.value, results_of(folder / "new")
    assert commands.run("run", pipeline, "--out", folder / "clean", log=log)[0] == 0
    clean = results_of(folder / "clean")
    after, verbs = ("after", (verb, "run")) if "run" not in verb else ("clean", ("run",))  # there it has run already
    for made in verbs:
        assert commands.run(made, pipeline, "--out", folder / after, log=log)[0] == 0
    return replace(case, n_changes=n_changes, new=new, clean=clean, clean_after=results_of(folder / after))


def judge(case, out):
    """The old or the new, whole, to whoever reads; and as a clean run after the next one."""
    assert faults_of_reading(out) == []
    found = results_of(out)
    assert found in (case.old, case.new)
    if found is not None:
        assert look(out, case.folder, ("plot", "show ")) == ([], {})
    status, said, _ = commands.run("run", case.folder / "pipeline.toml", "--out", out, log=case.folder / "log")
    assert status == 0, said
    assert faults_after_a_command(out) == []
    results = results_of(out)
    expected = case.clean_after if found == case.new else case.clean
    assert {name: results[name] for name in expected} == expected
    if case.old is not None:
        assert content(out)["own.txt"] == b"the user's"
    return found


def kill_before(case, number):
    out = case.copy(case.folder / "killed")
    command = case.start(out, killed_before=number)
    assert command.wait() == -signal.SIGKILL
    return judge(case, out)


@pytest.mark.parametrize(
    "verb", [verb if verb == "run" else pytest.param(verb, marks=pytest.mark.slow) for verb in VERBS]
)
def test_killed_before_some_changes_it_is_the_old_or_the_new_whole(cases, verb):
    case = cases(verb)
    assert case.n_changes > N_MOMENTS
    moments = sorted({round(place * (case.n_changes - 1) / (N_MOMENTS - 1)) for place in range(N_MOMENTS)})
    found = [kill_before(case, number) for number in moments]
    assert found[0] == case.old != case.new == found[-1]


@pytest.mark.slow
@pytest.mark.parametrize("verb", VERBS)
def test_killed_before_any_change_it_is_the_old_or_the_new_whole(cases, verb):
    case = cases(verb)
    moments = sorted({*range(0, case.n_changes, 1 if N_TRIALS > 1 else 60), case.n_changes - 1})
    found = [kill_before(case, number) for number in moments]
    first = found.index(case.new)
    assert first > 0
    assert found == [case.old] * first + [case.new] * (len(moments) - first)


@pytest.mark.slow
@pytest.mark.parametrize("verb", VERBS)
def test_stopped_before_any_change_nothing_is_left_lying_about(cases, verb):
    case = cases(verb)
    for number in range(0, case.n_changes, 1 if N_TRIALS > 1 else 25):
        out = case.copy(case.folder / "stopped")
        command = case.start(out, stopped_before=number)
        status = command.wait()
        found = results_of(out)
        assert (status, found) in ((STOPPED, case.old), (STOPPED, case.new), (0, case.new)), f"change {number}"
        assert faults_after_a_command(out) == [], f"change {number}"


@pytest.mark.slow
def test_killed_at_random_it_is_the_old_or_the_new_whole(cases):
    rng = random.Random(7)
    for number in range(10 * N_TRIALS):
        case = cases(VERBS[number % len(VERBS)])
        out = case.copy(case.folder / "killed")
        command = case.start(out)
        command.wait_for(rng.randrange(case.n_changes))  # then at a moment of its own: none that a change begins at
        time.sleep(rng.uniform(0, 2e-3))
        command.signal(signal.SIGKILL)
        command.wait()
        judge(case, out)
