"""The verdict of a run stands in run.json and in Python alike, and goes with the results that it was said of."""

import json

import pytest

import frf_ipz
from frf_ipz.report.sections.overview import verdict
from small_campaign import write_campaign

REFERENCE = "frequency_hz,output_dof,input_dof,real,imag\n"


@pytest.fixture
def campaign(tmp_path):
    write_campaign(tmp_path)
    return tmp_path


def edit(path, old, new):
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")


def run(campaign, until):
    results = frf_ipz.run_pipeline(campaign / "pipeline.toml", campaign / "out", until=until)
    return results, json.loads((campaign / "out" / "run.json").read_text(encoding="utf-8"))


def write_reference(campaign, factor):
    """The updated model's own prediction, kept aside, times a factor."""
    prediction = frf_ipz.open_results(campaign / "out").prediction
    rows = [
        f"{hertz},{label.output_dof},{label.input_dof},{value.real},{value.imag}"
        for place, label in enumerate(prediction.labels)
        for hertz, value in zip(prediction.frequency_hz, factor * prediction.values[:, place], strict=True)
    ]
    (campaign / "reference.csv").write_text(REFERENCE + "\n".join(rows) + "\n", encoding="utf-8")


def test_it_is_the_same_everywhere(campaign):
    results, stored = run(campaign, "predict")
    assessment = results.assessment
    assert stored["assessment"]["verdict"] == assessment.verdict.value
    assert [check["name"] for check in stored["assessment"]["checks"]] == [check.name for check in assessment.checks]
    assert f"verdict     {assessment.verdict.value}" in results.summary()
    assert results.to_frame("checks")["name"].tolist() == [check.name for check in assessment.checks]


def test_it_goes_with_the_results_that_it_was_said_of(campaign):
    run(campaign, "predict")
    edit(campaign / "pipeline.toml", "600.0", "550.0")
    results, stored = run(campaign, "fit")
    assert "assess" in results.stale
    assert results.assessment is None
    assert "assessment" not in stored
    assert "verdict  " not in results.summary()
    assert "sable" not in verdict(results)[0]
    assert run(campaign, "predict")[1]["assessment"]["verdict"]


def test_another_reference_is_another_verdict(campaign):
    run(campaign, "predict")
    write_reference(campaign, 1.0)
    edit(campaign / "pipeline.toml", "[predict]\n", '[predict]\nreference = "reference.csv"\n')
    agrees = run(campaign, "predict")[0].assessment
    write_reference(campaign, 10.0)
    differs = run(campaign, "predict")[0].assessment
    figures = [
        next(check.figure for check in found.checks if check.name == "reference at the points of interest")
        for found in (agrees, differs)
    ]
    assert figures == [pytest.approx(0.0, abs=1e-3), pytest.approx(20.0, abs=1e-3)]
    assert differs.verdict is frf_ipz.Verdict.NOT_USABLE
