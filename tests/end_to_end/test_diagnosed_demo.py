"""The demo with its diagnosis: what was found comes first, and damping that was measured is nothing missing."""

import pytest

import frf_ipz
from demo_case import ROOT
from frf_ipz.runs.summary import diagnosis_lines

TOLERATED = "damping_tolerance = 20.0    # the model's damping is a guess: a factor of 20 is nothing missing\n"


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Ask for what the model left out, in any time; the model states 0.1 % damping, and the lowest mode has 1.5 %."""
    folder = tmp_path_factory.mktemp("diagnosed_demo")
    text = (ROOT / "pipelines" / "cantilever.toml").read_text(encoding="utf-8")
    assert text.count(TOLERATED) == 1
    text = text.replace(TOLERATED, "").replace('"../data/', f'"{ROOT.as_posix()}/data/')
    (folder / "pipeline.toml").write_text(text, encoding="utf-8")
    return frf_ipz.run_pipeline(folder / "pipeline.toml", folder / "out", until="predict", diagnosing=True)


@pytest.mark.slow
def test_causes_come_first_and_damping_is_a_statement(run):
    assert run.diagnosis.is_explained
    assert {finding.effect for finding in run.diagnosis.findings} == {"added_mass", "boundary_compliance"}
    texts = [text for _, text in diagnosis_lines(run.diagnosis)]
    assert {text.split(" (95 %")[0].split(" of ")[0] for text in texts[:2]} == {
        "A mass",
        "The left end is not rigidly held: its support has a stiffness",
    }
    assert texts[2] == "With that and the measured damping, the model explains the measurement."
    assert texts[3].startswith("Damping ratios are as measured, and nothing missing: ")
    summary = run.summary()
    places = [summary.index(text) for text in (*texts, "recordings", "FRFs", "fit", "pairs")]
    assert places == sorted(places)
    for wrong in ("nothing in the catalogue", "no known effect", "looks like", "not looked for"):
        assert wrong not in summary


@pytest.mark.slow
def test_no_mistake_is_named_beside_what_was_found(run):
    assert run.assessment.likely_cause is None


@pytest.mark.slow
def test_the_error_with_the_causes_stands_beside_those_without(run):
    deviation = run.assessment.deviations[0]
    assert deviation.at == "points of interest"
    assert deviation.with_causes_db < deviation.updated_db < deviation.nominal_db
    assert deviation.figures in run.summary()
