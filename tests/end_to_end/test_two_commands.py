"""Two commands at once in one folder: their results are never mixed, and stopping one loses nothing of the other."""

import itertools
import os
import random
import re
import shutil
import signal
import sys
import urllib.request
from contextlib import suppress

import pytest

import commands
from small_campaign import write_quick_campaign
from whole_results import faults_after_a_command, faults_of_reading, results_of

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="processes are copied, and stopped by signals")

WRITERS = ("fit", "run", "diagnose", "export", "report")
READERS = ("plot", "show")
N_TRIALS = int(os.environ.get("TRIALS", "1"))  # of each pair; a long proof asks for 10
PAIRS = tuple(itertools.combinations_with_replacement((*WRITERS, *READERS), 2))[:: 1 if N_TRIALS > 1 else 3]
SOME_PAIRS = (("run", "diagnose"), ("export", "show"), ("fit", "plot"))
N_CHANGES = 250  # of a command that writes everything; the other one begins, or it is stopped, after some of them
STOPPED = 128 + signal.SIGINT


class Campaign:
    """Two pipelines that differ in the band, the results of a third one, and the keys of each of their stages."""

    def __init__(self, folder):
        self.folder, self.out, self.old = folder, folder / "out", folder / "old"
        text = write_quick_campaign(folder).read_text()
        self.pipelines = []
        for name, high in (("a", 600.0), ("b", 580.0), ("c", 590.0)):
            self.pipelines.append(folder / f"{name}.toml")
            self.pipelines[-1].write_text(text.replace("600.0", str(high)))
        self.keys = [self._keys(pipeline) for pipeline in self.pipelines]
        assert commands.run("run", self.pipelines[2], "--out", self.old, log=folder / "log")[0] == 0

    def _keys(self, pipeline):
        """Keys that each stage may have, whichever command made it."""
        keys = {}
        for verb in ("run", "diagnose", "run"):
            place = self.folder / pipeline.stem
            assert commands.run(verb, pipeline, "--out", place, log=self.folder / "log")[0] == 0
            for stage, result in results_of(place).items():
                keys.setdefault(stage, set()).add(result["key"])
        return keys

    def start(self, place, verb):
        """The first or the second of two commands."""
        arguments = {
            "plot": (self.out, "fit", "--out", self.folder / f"{place}.svg"),
            "show": (self.out, "--no-browser", "--port", "0"),
        }.get(verb, (self.pipelines[place], "--out", self.out))
        log = self.folder / f"log_{place}"
        return commands.Command(verb, *arguments, work=commands.patient, log=log, within=self.out)

    def faults(self):
        """What is wrong with the folder: litter, a file of another run, or stages of two pipelines as one result."""
        results = {name: result for name, result in results_of(self.out).items() if name != "report"}
        fresh = {name: result["key"] for name, result in results.items() if not result.get("stale")}
        fits = [all(key in keys.get(name, ()) for name, key in fresh.items()) for keys in self.keys]
        return [*faults_after_a_command(self.out), *([] if any(fits) else [f"mixed: {sorted(fresh)}"])]


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    return Campaign(tmp_path_factory.mktemp("two"))


def look_at_page(command):
    """Ask the page what it shows until the server ends, and stop it."""
    address = None
    while address is None and command.is_at_work:
        address = re.search(r"http://\S+", command.said)
        command.pause()
    if address is None:  # it was stopped before
        return
    with suppress(OSError):
        urllib.request.urlopen(address[0] + "state", timeout=60).read()
        assert b"<html" in urllib.request.urlopen(address[0], timeout=60).read()
    command.signal(signal.SIGINT)


def at_once(campaign, verbs, rng, *, stopped=None):
    """Start two commands, the second while the first is at work; one may be stopped. Their exit statuses."""
    shutil.rmtree(campaign.out, ignore_errors=True)
    shutil.copytree(campaign.old, campaign.out)
    at_work = [campaign.start(0, verbs[0])]
    if verbs[0] in WRITERS:
        at_work[0].wait_for(rng.randrange(N_CHANGES))
    at_work.append(campaign.start(1, verbs[1]))
    if stopped is not None:
        if verbs[stopped] in WRITERS:
            at_work[stopped].wait_for(rng.randrange(N_CHANGES))
        else:
            at_work[stopped].wait_for_begin(words=verbs[stopped] == "show")
        at_work[stopped].signal(signal.SIGINT)
    for verb, command in zip(verbs, at_work, strict=True):
        if verb == "show":
            look_at_page(command)
    assert faults_of_reading(campaign.out) == []
    return [command.wait() for command in at_work], [command.said for command in at_work]


def judge(campaign, verbs, rng, *, stopped=None):
    statuses, said = at_once(campaign, verbs, rng, stopped=stopped)
    for place, verb in enumerate(verbs):
        allowed = {STOPPED} if verb == "show" else {0, STOPPED} if place == stopped else {0}
        assert statuses[place] in allowed, said[place]
    assert campaign.faults() == []
    keys = [results_of(campaign.out)[stage]["key"] for stage in ("ingest", "fit")]
    done = [place for place, verb in enumerate(verbs) if verb in WRITERS and statuses[place] == 0] or [2]
    if stopped is not None and verbs[stopped] in WRITERS and statuses[stopped] == STOPPED:
        done.append(stopped)  # the signal may have come after its commit, while it said what it had found
    assert any(key in campaign.keys[place]["fit"] for key in keys for place in done)  # the last that came to its end


@pytest.mark.parametrize("verbs", SOME_PAIRS, ids="-".join)
def test_two_commands_at_once_are_never_mixed(campaign, verbs):
    judge(campaign, verbs, random.Random(1))


@pytest.mark.parametrize("stopped", [0, 1])
def test_stopping_one_of_two_loses_nothing_of_the_other(campaign, stopped):
    judge(campaign, ("run", "fit"), random.Random(2), stopped=stopped)


@pytest.mark.slow
@pytest.mark.parametrize("verbs", PAIRS, ids="-".join)
def test_all_pairs_of_commands_at_once_are_never_mixed(campaign, verbs):
    rng = random.Random("-".join(verbs))
    for _ in range(N_TRIALS):
        judge(campaign, verbs if rng.random() < 0.5 else verbs[::-1], rng)


@pytest.mark.slow
@pytest.mark.parametrize("verbs", PAIRS, ids="-".join)
def test_stopping_one_of_any_pair_loses_nothing_of_the_other(campaign, verbs):
    rng = random.Random("-".join(verbs))
    for trial in range(N_TRIALS):
        judge(campaign, verbs, rng, stopped=trial % 2)
