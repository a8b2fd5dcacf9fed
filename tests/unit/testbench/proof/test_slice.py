"""A slice of the proof with the public command, as a user runs it."""

import json

import pytest

from frf_testbench.proof.commands import find_public_command
from frf_testbench.proof.prove import run_proof

FRAMES = 106  # a shift of the seeds by which the cases are frames, diagnosed in a tenth of the time of a plate
SLICE = {"linear": 1, "null": 1, "nonlinear": 0, "pair": 0, "unknown": 0}


@pytest.mark.slow
def test_a_slice_of_the_proof_runs_through(tmp_path):
    run_proof(out=tmp_path, counts=SLICE, seed_shift=FRAMES, command=find_public_command())
    scores = json.loads((tmp_path / "scores.json").read_text(encoding="utf-8"))
    judged = [case["judgement"] for case in scores["cases"]]
    assert sorted(one["group"] for one in judged) == ["linear", "null"]
    assert {case["fault"] for case in scores["cases"]} == {""}
    assert {one["verdict"] for one in judged if one["group"] == "null"} == {"consistent"}
    assert any(one["is_right"] for one in judged if one["group"] == "linear")
    assert all(case["stage_s"] is not None for case in scores["cases"])
    assert (tmp_path / "proof.html").stat().st_size > 10_000
