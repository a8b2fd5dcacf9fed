"""Each stage alone on what a run left: it computes what is missing, re-uses the rest, and leaves its files."""

import json
import sys

import numpy as np
import pytest
from markupsafe import escape

from frf_ipz.cli import main as command
from frf_ipz.export.state_space_files import read_ensemble, read_state_space, read_uncertainty_weights
from frf_ipz.report.findings import typeset
from frf_ipz.runs.results import open_results
from small_campaign import write_campaign

FILES = {
    "ingest": {"frf.parquet", "records.parquet"},
    "fit": {"poles.parquet", "zeros.parquet", "fit.parquet", "modes.parquet"},
    "pair": {"pairs.parquet"},
    "update": {"parameters.parquet", "updated_model.npz"},
    "predict": {"poi_frf.parquet"},
    "export": {"statespace.json", "statespace.mat"},
    "report": {"report.html"},
}
DELAY = 2e-4  # s
ROUNDING = 1e-6  # of the largest change: matrices are differences of large numbers
LATE = 5e-5  # s: of the delay that is found, half a sample of the recordings


@pytest.fixture(scope="module")
def pipeline(tmp_path_factory):
    return write_campaign(tmp_path_factory.mktemp("campaign"))


def stage(monkeypatch, name, pipeline, out):
    monkeypatch.setattr(sys, "argv", ["frf-ipz", name, str(pipeline), "--out", str(out)])
    with pytest.raises(SystemExit) as stop:
        command.main()
    assert not stop.value.code


def keys(out):
    return {name: stage["key"] for name, stage in json.loads((out / "run.json").read_text())["stages"].items()}


def test_each_stage_leaves_its_files_and_keeps_those_before_it(pipeline, tmp_path, monkeypatch):
    out, there, seconds = tmp_path / "out", set(), {}
    for name, files in FILES.items():
        stage(monkeypatch, name, pipeline, out)
        there |= files
        assert there <= {path.name for path in out.iterdir()}
        assert not {path.name for path in out.iterdir()} & {file for later in FILES.values() for file in later} - there
        record = json.loads((out / "run.json").read_text())["stages"]
        assert all(record[kept]["seconds"] == taken for kept, taken in seconds.items())  # not computed again
        seconds = {kept: entry["seconds"] for kept, entry in record.items()}


def test_the_ensemble_is_written_when_it_is_asked_for_and_goes_with_its_option(pipeline, tmp_path, monkeypatch):
    out, text = tmp_path / "out", pipeline.read_text()
    try:
        pipeline.write_text(text + "[export]\nensemble = 4\n")
        stage(monkeypatch, "export", pipeline, out)
        members, weights = (
            read_ensemble(out / "statespace_ensemble.mat"),
            read_uncertainty_weights(out / "uncertainty.json"),
        )
        model = read_state_space(out / "statespace.mat")
        assert len(members) == 4
        s = 2j * np.pi * weights.frequency_hz
        spread = np.abs(np.array([member(s)[0, 0] for member in members]) / model(s)[0, 0] - 1)
        assert 0 < np.median(spread.max(0)) < 10 * np.median(weights.relative_error[:, 0])
        before = keys(out)
        pipeline.write_text(text)
        stage(monkeypatch, "export", pipeline, out)
        assert not (out / "statespace_ensemble.mat").exists()
        assert not (out / "uncertainty.json").exists()
        assert {name for name, key in keys(out).items() if before[name] != key} == {"export"}
    finally:
        pipeline.write_text(text)


def test_a_delay_that_was_fitted_is_in_the_state_space_when_asked_for(tmp_path, monkeypatch):
    pipeline = write_campaign(tmp_path)
    for path in (tmp_path / "hits").glob("*.csv"):
        time, force, acc = np.loadtxt(path, delimiter=",", skiprows=1).T
        omega = 2j * np.pi * np.fft.rfftfreq(len(acc), time[1])
        acc = np.fft.irfft(np.fft.rfft(acc) * np.exp(-omega * DELAY), len(acc))
        np.savetxt(path, np.column_stack([time, force, acc]), delimiter=",", header="time,force,acc", comments="")
    text = pipeline.read_text().replace("[fit]", "[fit]\ndelay = true")
    pipeline.write_text(text + "[export]\npade_order = 1\n")
    stage(monkeypatch, "export", pipeline, tmp_path / "out")
    model = read_state_space(tmp_path / "out" / "statespace.json")
    row = model.state_labels.index("delay of 21:+z 1")
    assert abs(-2 / model.A[row, row] - DELAY) < LATE


def test_an_update_changes_what_the_diagnosis_has_found_and_nothing_else(tmp_path, monkeypatch):
    pipeline = write_campaign(tmp_path)
    chosen = '[diagnose]\napply = true\neffects = ["global_stiffness"]\n[update]\nparameters = "diagnosis"\n'
    pipeline.write_text(pipeline.read_text().replace('[diagnose]\nrun = "never"\n', chosen))
    stage(monkeypatch, "update", pipeline, tmp_path / "out")
    updated = open_results(tmp_path / "out").updated_model
    before, change = updated.nominal.stiffness, updated.model.stiffness - updated.nominal.stiffness
    factor = np.vdot(before, change) / np.vdot(before, before)
    assert factor != 0
    np.testing.assert_allclose(change, factor * before, atol=ROUNDING * np.abs(change).max())


def test_a_diagnosis_alone_has_a_page_that_shows_it_on_the_structure(tmp_path, monkeypatch):
    pipeline = write_campaign(tmp_path)
    chosen = '[diagnose]\neffects = ["global_stiffness"]\n'
    pipeline.write_text(pipeline.read_text().replace('[diagnose]\nrun = "never"\n', chosen))
    stage(monkeypatch, "diagnose", pipeline, tmp_path / "out")
    assert set(keys(tmp_path / "out")) == {"ingest", "fit", "model", "diagnose", "levels", "report"}
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    said = json.loads((tmp_path / "out" / "diagnosis.json").read_text())["findings"][0]["statement"]
    assert f'<p class="verdict">{escape(typeset(said))}</p>' in page
    assert "Position, m" in page
    assert "No model gives positions" not in page
