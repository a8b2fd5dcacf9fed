"""Changes reach the file, the run follows, and what the run refuses is taken back."""

import json
import time
from functools import partial
from threading import Event

import pyarrow.parquet as pq
import pytest

from frf_ipz.errors import InputError
from frf_ipz.pipeline.inputs import read_inputs
from frf_ipz.pipeline.run import run_pipeline
from frf_ipz.show.campaign import RunPaths
from frf_ipz.show.workbench import Workbench

SOON_S = 120.0  # a whole run takes seconds
REJECT = {"kind": "reject", "hz": 101.83, "why": "to see it go"}


def place_of(demo):
    return RunPaths(folder=demo / "out", pipeline=demo / "pipeline.toml")


def frequencies(folder):
    return pq.read_table(folder / "poles.parquet")["frequency_hz"].to_pylist()


@pytest.mark.slow
def test_a_rejected_pole_is_gone_and_the_command_line_repeats_it(demo, tmp_path):
    out, pipeline = demo / "out", demo / "pipeline.toml"
    before, text = frequencies(out), pipeline.read_text(encoding="utf-8")
    bench = Workbench(place_of(demo), run_pipeline, read_inputs)
    bench.change(REJECT)
    bench.wait(SOON_S)
    assert bench.status.error == ""
    remaining = frequencies(out)
    assert any(abs(hz / 101.83 - 1) < 0.02 for hz in before)
    assert not any(abs(hz / 101.83 - 1) < 0.02 for hz in remaining)
    assert text.splitlines()[0] in pipeline.read_text(encoding="utf-8")
    repeated = run_pipeline(pipeline, tmp_path / "again")
    assert frequencies(repeated.path) == remaining


def test_only_what_depends_on_a_change_is_computed_anew(demo):
    bench = Workbench(place_of(demo), run_pipeline, read_inputs)
    keys = []
    for dof in ("49:+z", "33:+z"):
        bench.change({"kind": "point", "dof": dof})
        bench.wait(SOON_S)
        assert bench.status.error == ""
        stages = json.loads((demo / "out" / "run.json").read_text(encoding="utf-8"))["stages"]
        keys.append({name: entry["key"] for name, entry in stages.items()})
    before, after = keys
    assert {name for name in after if after[name] == before[name]} >= {"ingest", "fit"}
    assert after["predict"] != before["predict"]


def test_a_change_that_the_run_refuses_is_taken_back(demo):
    out, pipeline = demo / "out", demo / "pipeline.toml"
    text, poles = pipeline.read_bytes(), (out / "poles.parquet").read_bytes()
    bench = Workbench(place_of(demo), run_pipeline, read_inputs)
    bench.change({"kind": "point", "dof": "4711:+z"})
    bench.wait(SOON_S)
    assert "no node 4711" in bench.status.error
    assert bench.status.error.endswith("(the change was taken back)")
    assert pipeline.read_bytes() == text
    assert (out / "poles.parquet").read_bytes() == poles


def test_a_refused_change_leaves_what_another_program_wrote_meanwhile(demo):
    pipeline = demo / "pipeline.toml"

    def refuse(*_, **__):
        pipeline.write_text("# mine\n", encoding="utf-8")
        raise InputError("no")

    bench = Workbench(place_of(demo), refuse, read_inputs)
    bench.change(REJECT)
    bench.wait(SOON_S)
    assert pipeline.read_text(encoding="utf-8") == "# mine\n"


def test_a_change_during_a_run_is_refused_without_the_one_before_it(demo):
    pipeline = demo / "pipeline.toml"
    runs, begun, go_on = [], Event(), Event()

    def run(*_, **__):
        runs.append(pipeline.read_text(encoding="utf-8"))
        begun.set()
        assert go_on.wait(SOON_S)
        if len(runs) == 2:
            raise InputError("no")

    bench = Workbench(place_of(demo), run, read_inputs)
    bench.change(REJECT)
    assert begun.wait(SOON_S)
    bench.change({"kind": "pin", "hz": 300.0})
    go_on.set()
    bench.wait(SOON_S)
    assert len(runs) == 2
    assert pipeline.read_text(encoding="utf-8") == runs[0]


def test_nothing_is_written_for_a_change_that_makes_no_sense(demo):
    text = (demo / "pipeline.toml").read_bytes()
    bench = Workbench(place_of(demo), run_pipeline, read_inputs)
    with pytest.raises(InputError, match="say why"):
        bench.change({"kind": "reject", "hz": 101.8})
    assert (demo / "pipeline.toml").read_bytes() == text
    assert not bench.status.running


def test_without_its_pipeline_file_a_run_can_be_read_only(demo):
    (demo / "pipeline.toml").unlink()
    bench = Workbench(place_of(demo), run_pipeline, read_inputs)
    assert bench.contents().fit is not None
    with pytest.raises(InputError, match="is gone"):
        bench.change(REJECT)


POINTS = [{"kind": "point", "dof": dof} for dof in ("33:+z", "25:+z")]


class Runs:
    """In the place of a run: notes whether causes were to be looked for, and waits to be told to go on."""

    def __init__(self, *, waits=False):
        self.diagnosing, self.begun, self.go_on = [], Event(), Event()
        if not waits:
            self.go_on.set()

    def __call__(self, *_, diagnosing, progress):
        self.diagnosing.append(diagnosing)
        self.begun.set()
        assert self.go_on.wait(SOON_S)
        progress(0.5, "")


def test_causes_are_looked_for_when_somebody_asks_and_not_after_a_change(demo):
    runs = Runs()
    bench = Workbench(place_of(demo), runs, read_inputs)
    wishes = [partial(bench.change, POINTS[0]), bench.undo, bench.redo, bench.run, bench.diagnose]
    for wish in wishes:
        wish()
        bench.wait(SOON_S)
    assert runs.diagnosing == [False, False, False, None, True]


def test_a_diagnosis_that_corrects_the_model_is_a_part_of_every_run(demo):
    runs = Runs()
    bench = Workbench(place_of(demo), runs, read_inputs)
    text = bench.text().replace("[diagnose]\n", "[diagnose]\napply = true\n").replace('run = "never"\n', "")
    bench.pipeline.write_text(text, encoding="utf-8")
    bench.change(POINTS[0])
    bench.wait(SOON_S)
    assert runs.diagnosing == [None]


def test_causes_cannot_be_looked_for_without_a_model(demo):
    bench = Workbench(place_of(demo), Runs(), read_inputs)
    lines = bench.text().splitlines(keepends=True)
    bench.pipeline.write_text("".join(line for line in lines if not line.startswith("model =")), encoding="utf-8")
    with pytest.raises(InputError, match="no FE model"):
        bench.diagnose()


def test_changes_are_undone_and_made_again(demo):
    runs = Runs()
    bench = Workbench(place_of(demo), runs, read_inputs)
    texts = [bench.text()]
    assert bench.steps() == (False, False)
    for wish in POINTS:
        bench.change(wish)
        texts.append(bench.text())
        bench.wait(SOON_S)
    assert len(set(texts)) == 3
    for step, text in ((bench.undo, 1), (bench.undo, 0), (bench.redo, 1), (bench.redo, 2), (bench.undo, 1)):
        step()
        assert bench.text() == texts[text]
    assert bench.steps() == (True, True)
    bench.change(REJECT)
    assert bench.steps() == (True, False)
    with pytest.raises(InputError, match="nothing to redo"):
        bench.redo()
    bench.wait(SOON_S)
    assert len(runs.diagnosing) >= 1


def test_what_another_program_has_written_is_not_undone(demo):
    bench = Workbench(place_of(demo), Runs(), read_inputs)
    bench.change(POINTS[0])
    bench.wait(SOON_S)
    text = bench.text() + "# by an editor\n"
    bench.pipeline.write_text(text, encoding="utf-8")
    assert bench.steps() == (False, False)
    with pytest.raises(InputError, match="nothing to undo"):
        bench.undo()
    bench.change(POINTS[1])
    bench.undo()
    bench.wait(SOON_S)
    assert bench.text() == text
    assert bench.steps() == (False, True)


def test_a_change_that_the_run_refuses_leaves_what_can_be_undone_before_it(demo):
    faults = [None, InputError("no"), None, InputError("no")]

    def run(*_, **__):
        if (fault := faults.pop(0)) is not None:
            raise fault

    bench = Workbench(place_of(demo), run, read_inputs)
    texts = [bench.text()]
    for wish in POINTS:
        bench.change(wish)
        bench.wait(SOON_S)
        texts.append(bench.text())
    assert texts[2] == texts[1]
    assert bench.steps() == (True, False)
    bench.undo()
    bench.wait(SOON_S)
    assert (bench.text(), bench.steps()) == (texts[0], (False, True))
    bench.redo()
    bench.wait(SOON_S)
    assert bench.status.error.endswith("(the change was taken back)")
    assert (bench.text(), bench.steps()) == (texts[0], (False, False))


def test_a_change_that_is_cancelled_is_taken_back(demo):
    runs = Runs(waits=True)
    bench = Workbench(place_of(demo), runs, read_inputs)
    text = bench.text()
    bench.change(POINTS[0])
    assert runs.begun.wait(SOON_S)
    assert bench.text() != text
    bench.cancel()
    runs.go_on.set()
    bench.wait(SOON_S)
    assert (bench.text(), bench.steps(), bench.status.running) == (text, (False, False), False)
    bench.change(POINTS[1])
    bench.wait(SOON_S)
    assert bench.steps() == (True, False)


def test_a_diagnosis_is_cancelled_and_leaves_everything_as_it_was(demo):
    bench = Workbench(place_of(demo), run_pipeline, read_inputs)
    text, stamp = bench.text(), bench.stamp
    bench.diagnose()
    end = time.monotonic() + SOON_S
    while not bench.status.text.startswith("diagnose: "):
        assert bench.status.running
        assert time.monotonic() < end
        time.sleep(0.01)
    bench.cancel()
    bench.wait(SOON_S)
    assert (bench.text(), bench.stamp, bench.status.running, bench.status.error) == (text, stamp, False, "")
