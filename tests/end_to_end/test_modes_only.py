"""A test of modes without any FRF goes from `init` to the page, and says what it cannot know."""

import re
import sys

import numpy as np
import pytest

import frf_ipz
from frf_ipz.cli.main import main
from stated_modes import MODEL, PIPELINE, POINT, TEST, as_csv, softer_beam, stated_modes, write_campaign

OFF_DB = 0.3  # median error at the point of interest: nominal is 0.9 dB off, and the level of the mass is right here
HELD = (0.75, 1.0)  # share of lines in their 90 % bands, of one draw


@pytest.fixture
def command(monkeypatch):
    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["frf-ipz", *map(str, arguments)])
        with pytest.raises(SystemExit) as exit_:
            main()
        return exit_.value.code or 0

    return run


def truth(prediction):
    return frf_ipz.compute_frfs(softer_beam(), prediction.labels, 2j * np.pi * prediction.frequency_hz)


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    folder = tmp_path_factory.mktemp("modes")
    return frf_ipz.run_pipeline(write_campaign(folder, stated_modes(1)), folder / "out")


def test_modes_are_paired_and_met(results):
    assert results.pairs.count("pole").paired == 4
    assert results.pairs.count("zero").measured == 0
    frequencies = np.abs(results.updated_model.after) / (2 * np.pi)
    np.testing.assert_allclose(frequencies, results.fit.modes["frequency_hz"], rtol=1e-4)


def test_prediction_is_near_the_truth_and_in_its_band(results):
    prediction = results.prediction
    true = truth(prediction)
    after = frf_ipz.compare_frfs(true, prediction.values).median_db[0]
    before = frf_ipz.compare_frfs(true, prediction.nominal).median_db[0]
    assert after < OFF_DB < before
    inside = (np.abs(true) >= prediction.magnitude_low) & (np.abs(true) <= prediction.magnitude_high)
    assert HELD[0] <= np.mean(inside) <= HELD[1]


def test_assessment_says_what_needs_frfs(results):
    checks = {check.name: check for check in results.assessment.checks}
    assert results.assessment.verdict is frf_ipz.Verdict.WITH_CARE
    assert "cannot be compared" in checks["measured FRFs"].says
    assert checks["measured shapes"].figure > 0.99
    assert "modes do not tell" in checks["diagnosis"].says
    assert not {"amplitude at the measured points", "misfit of the fit"} & set(checks)


def test_files_and_page(results):
    files = {path.name for path in results.path.iterdir()}
    assert {"poles.parquet", "modes.parquet", "pairs.parquet", "poi_frf.parquet", "statespace.json"} <= files
    assert not {"frf.parquet", "fit.parquet", "zeros.parquet"} & files
    page = (results.path / "report.html").read_text(encoding="utf-8")
    text = re.sub(r"<[^>]+>", " ", re.sub(r"<(script|style).*?</\1>", "", page, flags=re.DOTALL))
    assert "no FRF was measured" in text
    assert "MAC" in text
    assert "4 modes identified elsewhere" in text
    assert set(results.to_frame("modes")["dof"]) == {"6:z", "11:z", "16:z", "21:z"}
    assert results.frfs is None


def test_a_reference_judges_the_prediction(tmp_path):
    label = frf_ipz.FrfLabel(POINT, POINT, "accelerance")
    lines = np.arange(10.0, 400.0, 0.5)
    values = frf_ipz.compute_frfs(softer_beam(), [label], 2j * np.pi * lines)[:, 0]
    rows = [
        f"{f!r},{POINT},{POINT},{v.real!r},{v.imag!r}" for f, v in zip(lines.tolist(), values.tolist(), strict=True)
    ]
    (tmp_path / "poi.csv").write_text("\n".join(["frequency_hz,output_dof,input_dof,real,imag", *rows]) + "\n")
    path = write_campaign(tmp_path, stated_modes(2), pipeline=PIPELINE + 'reference = "poi.csv"\n')
    results = frf_ipz.run_pipeline(path, tmp_path / "out", until="predict")
    assert results.assessment.deviations[0].updated_db < OFF_DB
    assert results.assessment.verdict is frf_ipz.Verdict.USABLE


def test_forces_act_where_the_test_says(tmp_path):
    test = TEST + 'input_dofs = ["6:+z", "21:+z"]\nquantity = "receptance"\n'
    results = frf_ipz.run_pipeline(write_campaign(tmp_path, stated_modes(3), test=test), tmp_path / "out")
    assert [str(label) for label in results.prediction.labels] == [f"{POINT} / 6:+z", f"{POINT} / 21:+z"]
    assert results.prediction.labels[0].unit == "m/N"


def test_diagnosis_says_what_it_cannot_know(tmp_path, capsys, command):
    path = write_campaign(tmp_path, stated_modes(4))
    assert command("diagnose", path, "--out", tmp_path / "out") == 2
    message = capsys.readouterr().err
    assert message.count("\n") <= 1
    assert "cannot be told from modes" in message
    test = frf_ipz.read_test(tmp_path / "test.toml").with_forces_at([frf_ipz.parse_dof(POINT)])
    with pytest.raises(frf_ipz.InputError, match="a diagnosis compares FRFs"):
        frf_ipz.diagnose(test, frf_ipz.read_model(tmp_path / "model.toml"))


def test_init_and_check_know_modes(tmp_path, capsys, command):
    (tmp_path / "shapes.csv").write_text(as_csv(stated_modes(5)))
    (tmp_path / "model.toml").write_text(MODEL)
    assert command("init", tmp_path) == 0
    assert 'kind = "modes"' in (tmp_path / "test.toml").read_text()
    capsys.readouterr()
    assert command("check", tmp_path) == 0
    said = capsys.readouterr().out
    assert "4 modes at 4 DOFs" in said
    assert "Everything fits together" in said


def test_check_names_a_common_factor(tmp_path, capsys, command):
    modes = stated_modes(6)
    write_campaign(tmp_path, stated_modes(6, natural_frequency_hz=2.0 * modes.natural_frequency_hz))
    assert command("check", tmp_path) == 0
    assert "common factor" in capsys.readouterr().out


def test_memory_gives_what_files_give(tmp_path):
    modes = stated_modes(7)
    path = write_campaign(tmp_path, modes)
    from_files = frf_ipz.run_pipeline(path, tmp_path / "out", until="predict").prediction
    model = frf_ipz.read_model(tmp_path / "model.toml")
    in_memory = frf_ipz.Campaign(modes, model, points=[POINT]).run(until="predict").prediction
    np.testing.assert_allclose(in_memory.values, from_files.values, rtol=1e-12)


def test_hidden_sensors_and_left_out_modes(tmp_path):
    pipeline = PIPELINE.replace("[predict]", "[ingest]\nhide = ['6:z']\n[fit]\nband_hz = [5.0, 350.0]\n[predict]")
    results = frf_ipz.run_pipeline(write_campaign(tmp_path, stated_modes(8), pipeline=pipeline), tmp_path / "out")
    assert results.fit.n_modes == 3
    assert "6:z" not in set(results.to_frame("modes")["dof"])
    assert results.to_frame("decisions")["reason"].tolist() == ["outside of the band"]


def test_deviations_that_are_not_stated_are_said():
    modes = stated_modes(9, frequency_std_hz=None, damping_ratio_std=None)
    assert "not stated" in frf_ipz.fit_modes(modes).warnings[0]
