"""A machine with physics outside the catalogue: what a part of it looks like is said as that, never as a fact."""

import re

import pytest

import frf_ipz
from frf_testbench.simulator.cases.case import make_case

SEED, KIND = 812_024, "unknown:rotary_inertia"
TRIED = '\n[diagnose]\neffects = ["added_mass", "boundary_compliance"]\nseconds = 600\n'
APPEARANCE = "A part of it looks like this, and need not be: "
ALTERNATIVE = re.compile(r"<tr>(?:(?!</tr>).)*<td>alternative</td>.*?</tr>", re.DOTALL)
FACTS = ("A mass of", "The right end is not rigidly held", "The left end is not rigidly held")


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("unknown")
    make_case(SEED, KIND, analyse=False).write(folder / "case", folder / "truth" / "case.json")
    pipeline = folder / "case" / "pipeline.toml"
    pipeline.write_text(pipeline.read_text(encoding="utf-8") + TRIED, encoding="utf-8")
    return frf_ipz.run_pipeline(pipeline, folder / "out", diagnosing=True)


@pytest.mark.slow
def test_a_part_is_looks_like_and_never_a_fact(run):
    diagnosis = run.diagnosis
    assert not diagnosis.is_explained
    assert diagnosis.findings
    summary = run.summary()
    said = [line.strip().removeprefix("diagnosis").strip() for line in summary.splitlines()]
    assert sum(line.startswith(APPEARANCE) for line in said) == len(diagnosis.findings)
    assert not [line for line in said if line.startswith(FACTS)]
    page = (run.path / "report.html").read_text(encoding="utf-8")
    assert "looks like" in page
    page = ALTERNATIVE.sub("", page)  # what was tried beside it is a table of its own words
    assert not [fact for fact in FACTS if f">{fact}" in page]


@pytest.mark.slow
def test_its_result_takes_care_and_says_why(run):
    assert run.assessment.verdict is not frf_ipz.Verdict.USABLE
    assert "no known effect explains" in run.summary()
