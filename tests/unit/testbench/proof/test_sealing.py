"""What a diagnosis can read holds nothing of the truth, and answers cannot change unseen."""

import json
import os
import re
import sys
import tomllib
from itertools import pairwise
from pathlib import Path
from shutil import copytree

import pytest

from frf_testbench.proof.blind_runs import diagnose_all, is_worth_predicting, predict_all, write_pipeline
from frf_testbench.proof.commands import compute_code_digest, find_public_command, read_outcome, run, run_all
from frf_testbench.proof.plan import FULL, QUICK, Folders, list_effects, plan_cases
from frf_testbench.proof.sealing import BrokenSealError, check_seal, make_cases
from frf_testbench.simulator.effects.catalogue import CATALOGUE, NONLINEAR

COUNTS = {"linear": 1, "null": 1}
FAKE = """
import json, sys
from pathlib import Path
stage, pipeline, _, out, _ = sys.argv[1:]
if stage == "diagnose":
    Path(out).mkdir(parents=True)
    Path(out, "diagnosis.json").write_text(json.dumps({"verdict": "explained", "findings": []}))
with Path(sys.argv[0]).with_suffix(".log").open("a") as log:
    log.write(json.dumps(sys.argv[1:]) + chr(10))
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folders = Folders.inside(tmp_path_factory.mktemp("proof"))
    steps = []
    make_cases(plan_cases(COUNTS), folders, workers=1, step=lambda: steps.append(1))
    return folders, steps


@pytest.fixture
def fake(tmp_path):
    path = tmp_path / "fake.py"
    path.write_text(FAKE, encoding="utf-8")
    return [sys.executable, str(path)]


def names_in(folder):
    return sorted(path.name for path in folder.iterdir())


def test_names_tell_nothing_and_a_slice_is_part_of_the_whole():
    everything = plan_cases(FULL)
    assert len({order.name for order in everything}) == len(everything) == 480
    assert len({order.seed for order in everything}) == 480
    assert [order.name for order in everything] == sorted(order.name for order in everything)
    part = plan_cases(QUICK)
    assert set(part) <= set(everything)
    groups = [order.group for order in everything]
    changes = sum(a != b for a, b in pairwise(groups))
    assert changes > 200  # sorted by group there would be four
    assert not [order.name for order in everything if order.group in order.name or order.effect in order.name]


def test_every_effect_takes_its_turn():
    assert sorted(list_effects("linear")) == sorted(set(CATALOGUE) - set(NONLINEAR))
    assert {order.effect for order in plan_cases(FULL) if order.group == "linear"} == set(list_effects("linear"))
    assert len({order.effect for order in plan_cases(FULL) if order.group == "unknown"}) == 15


def test_a_case_holds_nothing_of_the_truth(made):
    folders, steps = made
    assert len(steps) == 2
    for name in names_in(folders.cases):
        truth = json.loads((folders.sealed / f"{name}.json").read_text(encoding="utf-8"))
        files = [path for path in (folders.cases / name).rglob("*") if path.is_file()]
        kinds = {path.suffix for path in files}
        assert kinds <= {".toml", ".csv", ".mtx"}
        assert not [path for path in files if "truth" in path.name or "points" in path.name]
        words = "".join(path.read_text(encoding="utf-8") for path in files if path.suffix == ".toml")
        for effect in truth["effects"]:
            assert effect["effect"] not in words
            assert not [value for value in effect["parameters"].values() if repr(value) in words]
        assert not re.search(rf"(?<!\d){truth['seed']}(?!\d)", words)  # digits of a longer number are none of it
        assert "seed" not in words
    assert not [path for path in folders.cases.rglob("*") if path.is_symlink()]


def test_a_case_whose_answer_is_gone_is_made_again_as_it_was(made, tmp_path):
    folders = Folders.inside(tmp_path)
    copytree(made[0].root, folders.root, dirs_exist_ok=True)
    name = plan_cases(COUNTS)[0].name
    answer = folders.sealed / f"{name}.json"
    expected = answer.read_bytes()
    answer.unlink()
    (folders.cases / name / "test.toml").write_text("half", encoding="utf-8")
    make_cases(plan_cases(COUNTS), folders, workers=1, step=lambda: None)
    assert answer.read_bytes() == expected
    assert (folders.cases / name / "test.toml").read_bytes() == (made[0].cases / name / "test.toml").read_bytes()
    check_seal(folders, [name])


def test_what_is_made_is_not_made_again(made):
    folders, _ = made
    before = {path: path.stat().st_mtime_ns for path in folders.root.rglob("*") if path.is_file()}
    make_cases(plan_cases(COUNTS), folders, workers=1, step=lambda: None)
    assert {path: path.stat().st_mtime_ns for path in folders.root.rglob("*") if path.is_file()} == before


def test_an_answer_that_changes_is_noticed(made):
    folders, _ = made
    names = names_in(folders.cases)
    check_seal(folders, names)
    path = folders.sealed / f"{names[0]}.json"
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("1", "2", 1), encoding="utf-8")
    with pytest.raises(BrokenSealError, match=names[0]):
        check_seal(folders, names)
    path.write_text(text, encoding="utf-8")
    check_seal(folders, names)


def test_the_diagnosis_told_nothing_of_the_answers(made, fake):
    folders, _ = made
    names = names_in(folders.cases)
    diagnose_all(names, folders, workers=2, step=lambda: None, command=fake)
    log = Path(fake[1]).with_suffix(".log")
    calls = [json.loads(line) for line in log.read_text(encoding="utf-8").splitlines()]
    assert len(calls) == 2
    for stage, pipeline, option, out, quiet in calls:
        assert (stage, option, quiet) == ("diagnose", "--out", "--quiet")
        told = " ".join([pipeline, out, Path(pipeline).read_text(encoding="utf-8")])
        assert str(folders.sealed) not in told
        assert folders.sealed.name not in told
    diagnose_all(names, folders, workers=2, step=lambda: None, command=fake)
    assert len(log.read_text(encoding="utf-8").splitlines()) == 2  # what this code has diagnosed is not done again
    assert all(read_outcome(folders.diagnosed, name).code == compute_code_digest() for name in names)
    assert all(is_worth_predicting(name, folders) for name in names if points_of(folders, name))
    predict_all(names, folders, workers=1, step=lambda: None, command=fake)
    calls = [json.loads(line) for line in log.read_text(encoding="utf-8").splitlines()][2:]
    assert [call[0] for call in calls] == ["predict"] * 4
    assert [Path(call[3]).name for call in calls] == ["with", "without"] * 2


def points_of(folders, name):
    return tomllib.loads((folders.cases / name / "pipeline.toml").read_text(encoding="utf-8"))["predict"]["points"]


def test_pipelines_apply_the_finding_or_leave_it_out(made):
    folders, _ = made
    name = names_in(folders.cases)[0]
    handed_in = (folders.cases / name / "pipeline.toml").read_bytes()
    applied = tomllib.loads(write_pipeline(folders, name, applies=True).read_text(encoding="utf-8"))
    without = tomllib.loads(write_pipeline(folders, name, applies=False).read_text(encoding="utf-8"))
    assert applied["diagnose"] == {"apply": True}
    assert without["diagnose"] == {"run": "never"}
    for table in (applied, without):
        assert Path(table["pipeline"]["test"]) == (folders.cases / name / "test.toml").resolve()
        assert table["fit"] == tomllib.loads(handed_in.decode())["fit"]
    assert (folders.cases / name / "pipeline.toml").read_bytes() == handed_in


def test_options_of_a_diagnosis_are_kept_or_left_out_as_a_whole(tmp_path):
    folders = Folders.inside(tmp_path)
    (folders.cases / "case_1").mkdir(parents=True)
    text = '[pipeline]\ntest = "test.toml"\n[diagnose]\ngain_tolerance = 0.01\napply = false\n'
    (folders.cases / "case_1" / "pipeline.toml").write_text(text, encoding="utf-8")
    applied = tomllib.loads(write_pipeline(folders, "case_1", applies=True).read_text(encoding="utf-8"))
    assert applied["diagnose"] == {"gain_tolerance": 0.01, "apply": True}
    without = tomllib.loads(write_pipeline(folders, "case_1", applies=False).read_text(encoding="utf-8"))
    assert without["diagnose"] == {"run": "never"}


def test_a_chain_of_commands_stops_where_one_fails(tmp_path):
    fails = [sys.executable, "-c", "import sys; sys.exit('frf-ipz: first')"]
    writes = [sys.executable, "-c", f"open({str(tmp_path / 'second')!r}, 'w').close()"]
    jobs = {"case_1": lambda: [fails, writes], "case_2": lambda: [writes, fails]}
    steps = []
    run_all({"case_1": jobs["case_1"]}, tmp_path / "logs", workers=1, code="x", step=lambda: steps.append(1))
    assert not (tmp_path / "second").exists()
    assert read_outcome(tmp_path / "logs", "case_1").message == "frf-ipz: first"
    run_all(jobs, tmp_path / "logs", workers=1, code="x", step=lambda: steps.append(1))
    assert (tmp_path / "second").exists()
    assert read_outcome(tmp_path / "logs", "case_2").status == 1
    assert len(steps) == 3
    assert read_outcome(tmp_path / "logs", "case_3") is None


def test_a_command_that_fails_or_hangs_is_written_down(tmp_path):
    failed = run([sys.executable, "-c", "import sys; sys.exit('frf-ipz: no such file')"], code="x")
    assert (failed.status, failed.message) == (1, "frf-ipz: no such file")
    hung = run([sys.executable, "-c", "import time; time.sleep(60)"], code="x", longest_s=0.2)
    assert hung.status == -9
    busy = run([sys.executable, "-c", "import time\nwhile time.process_time() < 0.3: pass"], code="x")
    assert busy.status == 0
    assert busy.cpu_s >= 0.3
    assert not list(tmp_path.iterdir())


def test_without_process_groups_commands_run_and_stop_too(monkeypatch):
    """What Windows lacks: processor times of a child, and groups that can be stopped as a whole."""
    monkeypatch.delattr(os, "wait4")
    monkeypatch.delattr(os, "killpg")
    failed = run([sys.executable, "-c", "import sys; sys.exit('frf-ipz: no such file')"], code="x")
    assert (failed.status, failed.message, failed.cpu_s) == (1, "frf-ipz: no such file", None)
    assert run([sys.executable, "-c", "import time; time.sleep(60)"], code="x", longest_s=0.2).status == -9


def test_the_public_command_is_the_script_or_the_module(monkeypatch, tmp_path):
    script = tmp_path / "frf-ipz"
    script.write_text("#!/bin/sh\n", encoding="utf-8")
    script.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python"))
    assert find_public_command() == [str(script)]
    script.unlink()
    assert find_public_command() == [str(tmp_path / "python"), "-m", "frf_ipz.cli.main"]


def test_a_trial_has_the_same_effects_and_other_seeds():
    orders, others = plan_cases(COUNTS), plan_cases(COUNTS, shift=7)
    assert [one.effect for one in orders] == [one.effect for one in others]
    assert [one.seed + 7 for one in orders] == [one.seed for one in others]
