"""The error at the point of interest with what the diagnosis found is what `[diagnose] apply` then gives."""

import json

import numpy as np
import pytest

import frf_ipz
from small_campaign import DAMPING, DENSITY, LENGTH, THICKNESS, WIDTH, YOUNG, write_campaign

LINES = np.arange(5.0, 650.0, 0.5)
DIAGNOSE = '[diagnose]\nrun = "always"\neffects = ["global_stiffness"]\ndamping_tolerance = 20.0\n'


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    """A model that is 5 % too soft, and the FRF of the true beam at the point of interest."""
    folder = tmp_path_factory.mktemp("causes")
    write_campaign(folder)
    beam = frf_ipz.make_beam(
        length_m=LENGTH, width_m=WIDTH, thickness_m=THICKNESS, youngs_modulus_Pa=YOUNG, density_kg_m3=DENSITY,
        elements=20, left="clamped", modal_ratio=DAMPING,
    )  # fmt: skip
    label = frf_ipz.FrfLabel("11:+z", "15:+z", "accelerance")
    values = frf_ipz.compute_frfs(beam, [label], 2j * np.pi * LINES)[:, 0]
    rows = [f"{hertz},11:+z,15:+z,{value.real},{value.imag}" for hertz, value in zip(LINES, values, strict=True)]
    table = "frequency_hz,output_dof,input_dof,real,imag\n" + "\n".join(rows) + "\n"
    (folder / "reference.csv").write_text(table, encoding="utf-8")
    path = folder / "pipeline.toml"
    text = path.read_text(encoding="utf-8").replace('[diagnose]\nrun = "never"\n', DIAGNOSE)
    path.write_text(text.replace("[predict]\n", '[predict]\nreference = "reference.csv"\n'), encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def results(campaign):
    return frf_ipz.run_pipeline(campaign / "pipeline.toml", campaign / "out")


def test_three_figures_stand_everywhere(campaign, results):
    assert results.diagnosis.verdict == "explained"
    deviation = results.assessment.deviations[0]
    assert (deviation.at, deviation.frf) == ("points of interest", "11:+z / 15:+z")
    assert deviation.nominal_db > deviation.updated_db > 0
    assert np.isfinite(deviation.with_causes_db)
    assert json.loads((campaign / "out" / "run.json").read_text())["assessment"]["deviations"][0] == deviation.to_json()
    assert f"error       {deviation.figures} (median of {deviation.where}; kept aside)" in results.summary()
    page = (campaign / "out" / "report.html").read_text(encoding="utf-8")
    figures = (deviation.nominal_db, deviation.updated_db, deviation.with_causes_db)
    assert " → ".join(f"{figure:.2g}" for figure in figures) + " dB" in page


def test_it_is_the_error_of_a_run_that_applies_the_causes(campaign, results):
    beside = results.assessment.deviations[0].with_causes_db
    path = campaign / "applied.toml"
    text = (campaign / "pipeline.toml").read_text(encoding="utf-8")
    path.write_text(text.replace("[diagnose]\n", "[diagnose]\napply = true\n"), encoding="utf-8")
    applied = frf_ipz.run_pipeline(path, campaign / "applied", until="predict").assessment.deviations[0]
    assert applied.updated_db == pytest.approx(beside, rel=1e-9)
    assert np.isnan(applied.with_causes_db)


def test_it_goes_with_the_diagnosis(campaign, results):
    assert results.with_causes is not None
    path = campaign / "pipeline.toml"
    text = path.read_text(encoding="utf-8")
    other = text.replace('run = "always"', 'run = "never"').replace("global_stiffness", "added_mass")
    path.write_text(other, encoding="utf-8")  # what was found of other effects no longer counts
    again = frf_ipz.run_pipeline(path, campaign / "out", until="predict")
    path.write_text(text, encoding="utf-8")
    assert np.isnan(again.assessment.deviations[0].with_causes_db)
    assert "with the causes" not in again.summary()
