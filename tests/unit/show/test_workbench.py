"""Changes reach the file, the run follows, and what the run refuses is taken back."""

import json
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
