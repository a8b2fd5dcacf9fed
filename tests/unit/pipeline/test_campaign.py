"""The chain on what is in memory gives what it gives on files."""

from pathlib import Path

import control
import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

import frf_ipz

DATA = Path(__file__).parents[3] / "data" / "raw" / "cantilever"
BAND = frf_ipz.FitOptions(band_hz=(10.0, 700.0))
CHOSEN = {"fit": BAND, "diagnose": frf_ipz.DiagnoseOptions(run="never")}


@pytest.fixture(scope="module")
def test():
    return frf_ipz.read_test(DATA / "test.toml")


@pytest.fixture(scope="module")
def fe_model():
    return frf_ipz.read_model(DATA / "model.toml")


@pytest.fixture(scope="module")
def from_files(test, fe_model):
    return frf_ipz.Campaign(test, fe_model, points=["49:+z"], name="demo", **CHOSEN).run()


def test_a_campaign_gives_all_results(from_files):
    assert from_files.fit.n_modes == 4
    assert isinstance(from_files.state_space, control.StateSpace)
    assert from_files.state_space.output_labels == ["101:+z", "49:+z"]
    assert [str(label.output_dof) for label in from_files.prediction.labels] == ["49:+z", "49:+z"]
    assert from_files.diagnosis is None
    assert from_files.path is None
    assert "demo" in repr(from_files)
    assert from_files.summary().startswith("demo")


def test_frfs_in_memory_give_the_same_fit_and_prediction(from_files, fe_model):
    again = frf_ipz.Campaign(from_files.frfs, fe_model, points=["49:+z"], **CHOSEN).run()
    assert_allclose(again.fit.model.poles, from_files.fit.model.poles, rtol=1e-12)
    assert_allclose(again.prediction.values, from_files.prediction.values, rtol=1e-6)


def test_recordings_in_memory_give_the_same_frfs(from_files, test):
    recordings = []
    for setup, path in test.recordings:
        table = pd.read_csv(path)
        recordings.append(
            frf_ipz.Recording(
                force=table["force"],
                responses=table["acc_tip"].to_numpy()[None],
                sample_rate_hz=1 / np.diff(table["time"]).mean(),
                input_dof=setup.input_dof,
                output_dofs=["101:+z"],
            )
        )
    frfs = frf_ipz.estimate_frfs(frf_ipz.VibrationTest.from_recordings(recordings)).frfs
    assert [str(label) for label in frfs.labels] == [str(label) for label in from_files.frfs.labels]
    assert_allclose(frfs.values, from_files.frfs.values, rtol=1e-6, atol=1e-9 * np.abs(frfs.values).max())


def test_results_in_a_folder_are_those_in_memory(from_files, test, fe_model, tmp_path):
    kept = frf_ipz.Campaign(test, fe_model, points=["49:+z"], name="demo", **CHOSEN).run(tmp_path / "out")
    opened = frf_ipz.open_results(str(tmp_path / "out"))
    assert (tmp_path / "out" / "report.html").is_file()
    for results in (kept, opened):
        assert_allclose(results.prediction.values, from_files.prediction.values, rtol=1e-12)
        assert results.path == tmp_path / "out"


def test_other_arrays_are_not_taken_for_the_same(from_files, fe_model, tmp_path):
    n_lines = frf_ipz.Campaign(from_files.frfs, fe_model, **CHOSEN).run(tmp_path, until="fit").frfs.n_lines
    lines = from_files.frfs.in_band((0.0, 1000.0))
    other = frf_ipz.Campaign(from_files.frfs.select_lines(lines), fe_model, **CHOSEN).run(tmp_path, until="fit")
    assert other.frfs.n_lines < n_lines


def test_without_a_model_the_chain_ends_with_the_fit(test):
    results = frf_ipz.Campaign(test, **CHOSEN).run()
    assert results.fit.n_modes == 4
    assert results.updated_model is results.state_space is None


def test_points_need_a_model(test):
    with pytest.raises(frf_ipz.InputError, match="need an FE model"):
        frf_ipz.Campaign(test, points=["49:+z"])


def test_a_model_without_a_measured_dof_is_refused(test):
    beam = frf_ipz.make_beam(
        length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=7e10, density_kg_m3=2700, elements=50
    )
    with pytest.raises(frf_ipz.InputError, match="no node 101"):
        frf_ipz.Campaign(test, beam)
