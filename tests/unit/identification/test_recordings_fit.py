"""What the fitter finds in measurements by others, and whether it says what is wrong with them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from frf_ipz.errors import InputError
from frf_ipz.fe.eigen import solve_modes
from frf_ipz.fe.model_file import read_model
from frf_ipz.identification.fit import fit_modes, fit_residues
from frf_ipz.identification.options import FitOptions
from frf_ipz.identification.results.gains import estimate_gains
from frf_ipz.identification.results.shapes import mode_shapes
from frf_ipz.ingest.campaign import Recording, VibrationTest
from frf_ipz.ingest.campaign_file import read_test
from frf_ipz.ingest.estimate import estimate_frfs
from frf_ipz.ingest.options import IngestOptions

DEMO = Path(__file__).parents[3] / "data" / "raw" / "cantilever" / "test.toml"
DEMO_DAMPING = np.array([0.015, 0.0036, 0.0024, 0.0021])  # data/README.md


def frfs_of(path):
    return estimate_frfs(read_test(path), options=IngestOptions()).frfs


def frequencies(fit):
    return np.abs(fit.model.poles[: fit.n_modes]) / (2 * np.pi)


def test_demo_campaign_has_its_four_modes_and_no_other():
    fit = fit_modes(frfs_of(DEMO), options=FitOptions(band_hz=(10.0, 700.0)))
    assert fit.n_modes == 4
    # two are given as rounded
    np.testing.assert_allclose(fit.model.damping_ratio[:4], DEMO_DAMPING, rtol=0.005, atol=0)
    assert fit.noise_from == "recordings"
    assert fit.warnings == ()
    assert list(fit.modes["quality"]) == ["good"] * 4
    assert np.sqrt(np.mean(fit.misfit["ratio"] ** 2)) < 1.1


def test_demo_campaign_without_a_band():
    fit = fit_modes(frfs_of(DEMO), options=FitOptions())
    assert fit.n_modes == 5  # the fifth lies above the pipeline's band
    damping = np.append(DEMO_DAMPING, 0.0027)
    np.testing.assert_allclose(fit.model.damping_ratio[:5], damping, rtol=0.005, atol=0)
    assert 1200 < fit.band_hz[1] < 1260  # the anti-alias filter takes the rest


@pytest.fixture(scope="module")
def beam(recordings):
    return frfs_of(recordings / "freefree_beam" / "test.toml")


BEAM_BAND = FitOptions(band_hz=(20.0, 999.0))
BEAM_HZ = np.array([111.994, 306.854, 596.368, 974.137])  # looked at in plots of all nine FRFs


@pytest.fixture(scope="module")
def beam_fit(beam):
    return fit_modes(beam, options=BEAM_BAND)


@pytest.mark.slow
def test_free_beam_weighs_the_same_by_three_of_its_modes(recordings, beam_fit):
    modes = mode_shapes(beam_fit)
    measured = modes.shapes[[dof.name for dof in modes.dofs].index("99:z")].real ** 2
    model = read_model(recordings / "freefree_beam" / "model.toml")
    computed = solve_modes(model, n_modes=6)
    shapes = computed.shapes[[dof.name for dof in computed.dofs].index("99:z"), 2:].real ** 2
    along = np.array([dof.direction == "z" for dof in model.all_dofs], float)  # a translation
    total = along @ (model.mass_all @ along)
    masses = total * shapes / measured
    by_three = masses[[0, 1, 3]]  # the third mode has its node there: its mass is hardly determined
    np.testing.assert_allclose(by_three, by_three.mean(), rtol=0.05, atol=0)


@pytest.mark.slow
def test_driving_point_of_the_free_beam_is_lower_than_the_others(recordings, beam_fit):
    modes = solve_modes(read_model(recordings / "freefree_beam" / "model.toml"), n_modes=8)
    table = estimate_gains(beam_fit, modes)
    is_driving = np.array([dof[:2] == "99" for dof in table["input_dof"]])
    assert float(table["gain"][is_driving].iloc[0]) == pytest.approx(0.86, abs=0.04)  # two standard deviations
    np.testing.assert_allclose(table["gain"][~is_driving], 1.0, rtol=0, atol=0.05)  # two standard deviations


@pytest.mark.slow
def test_free_beam_does_not_determine_gains_by_itself(beam):
    with pytest.raises(InputError, match=r"do not determine the gain of the channel 'input 99:\+z'"):
        fit_modes(beam, options=replace(BEAM_BAND, gain=("input 99:+z",)))


@pytest.mark.slow
def test_free_beam_has_four_modes_and_drifts(beam_fit):
    fit = beam_fit
    assert fit.n_modes == 4
    np.testing.assert_allclose(frequencies(fit), BEAM_HZ, rtol=1e-4, atol=0)  # the drift between its files
    assert "drifted while it was measured" in fit.warnings[-1]
    assert float(fit.warnings[-1].split(" by ")[1].split(" ppm")[0]) == pytest.approx(80, rel=0.15)
    assert fit.misfit.groupby("frf")["ratio"].median().max() < 1.4


@pytest.mark.slow
def test_free_beam_has_no_mode_within_the_drift_of_another(beam):
    fit = fit_modes(beam.select_frfs(range(1, 9)), options=FitOptions(band_hz=(50.0, 1000.0)))
    np.testing.assert_allclose(frequencies(fit), BEAM_HZ, rtol=1e-4, atol=0)


@pytest.mark.slow
def test_ninth_file_of_the_free_beam_with_poles_held(beam):
    eight = fit_modes(beam.select_frfs(range(8)), options=BEAM_BAND)
    assert eight.n_modes == 4
    ninth = fit_residues(beam.select_frfs([8]), poles=eight.model.poles[:4], options=BEAM_BAND)
    assert "off the given poles" in ninth.warnings[0]
    assert float(ninth.warnings[0].split(";")[0].split()[-1]) == pytest.approx(-50, abs=12)
    assert ninth.misfit["ratio"].median() < 1.2
    assert ninth.misfit["ratio"].max() < 1.6  # where the 112 Hz peak is, whose half width is less than a line


@pytest.mark.slow
def test_steel_beam(recordings):
    frfs = frfs_of(recordings / "steel_beam_5x3" / "test.toml")
    fit = fit_modes(frfs, options=FitOptions(band_hz=(1.0, 600.0)))
    peaks = (32.7, 51.9, 93.1, 105.7, 172.4, 183.7, 289.0, 377.3, 437.5, 450.1)  # peaks of the plots
    natural_hz = frequencies(fit)
    assert all(np.abs(natural_hz / hz - 1).min() < 5e-3 for hz in peaks)
    assert 13 <= fit.n_modes <= 16
    assert fit.misfit.groupby("frf")["ratio"].median().max() < 1.5


@pytest.mark.slow
def test_raw_impacts_of_a_lightly_damped_structure(recordings):
    frfs = frfs_of(recordings / "raw_hammer" / "test.toml")
    fit = fit_modes(frfs, options=FitOptions(band_hz=(500.0, 6500.0)))
    peaks = (810.3, 851.6, 900.0, 2640.2, 3007.5, 3035.3, 3669.0, 3689.4, 4127.6, 4163.2, 4391.7, 4421.0, 4470.0)
    natural_hz = frequencies(fit)
    assert all(np.abs(natural_hz / hz - 1).min() < 1e-3 for hz in (*peaks, 5031.0, 5073.8, 5969.6, 6076.7))
    assert fit.n_modes < 40
    assert "times the noise of the recordings" in fit.warnings[0]
    used = fit.used_lines
    values, model = frfs.values[used], fit.model(frfs.s[used])
    assert np.median(np.abs(model / values - 1)) < 0.02


@pytest.mark.slow
def test_raw_impacts_cut_to_half_have_the_same_modes(recordings):
    files = sorted((recordings / "raw_hammer" / "hits").glob("*.csv"))
    columns = [np.loadtxt(path, delimiter=",", skiprows=1) for path in files]
    impacts = [
        Recording(
            force=values[: len(values) // 2, 1],
            responses=values[: len(values) // 2, 2],
            sample_rate_hz=25600.0,
            input_dof="2:+z",
            output_dofs=["1:+z"],
        )
        for values in columns
    ]
    frfs = estimate_frfs(VibrationTest.from_recordings(impacts)).frfs
    fit = fit_modes(frfs, options=FitOptions(band_hz=(500.0, 6500.0)))
    peaks = (810.3, 851.6, 900.0, 2640.2, 3007.5, 3035.3, 3669.0, 3689.4, 4127.6, 4163.2, 4391.7, 4421.0, 4470.0)
    assert all(np.abs(frequencies(fit) / hz - 1).min() < 1e-3 for hz in (*peaks, 5031.0, 5073.8, 5969.6, 6076.7))
    assert 31 <= fit.n_modes < 40


@pytest.mark.slow
def test_one_impact_on_a_milling_tool(recordings):
    values = np.loadtxt(recordings / "milling_tool" / "Impact_Point1.txt")
    impact = Recording(
        force=values[:, 1], responses=values[:, 2], sample_rate_hz=51200.0, input_dof="1:+z", output_dofs=["1:+z"]
    )
    frfs = estimate_frfs(VibrationTest.from_recordings([impact])).frfs
    bands = [None, (300.0, 3500.0), (306.0, 3500.0), (294.0, 3500.0), (300.0, 3430.0), (300.0, 3570.0)]
    counts = []
    for band in bands:
        fit = fit_modes(frfs, options=FitOptions(band_hz=band))
        assert all(np.abs(frequencies(fit) / hz - 1).min() < 0.03 for hz in (1074.0, 1235.0, 1815.0, 2612.0, 2735.0))
        counts.append(fit.n_modes)
    assert min(counts) >= 10
    assert max(counts) <= 15
    assert max(counts) - counts[1] <= 2
    assert counts[1] - min(counts) <= 2
