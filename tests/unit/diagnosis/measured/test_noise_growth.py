"""Noise in proportion to the level of a record, as of recorders that choose their range, is no missing physics."""

import numpy as np
import pytest

import frf_ipz
from frf_ipz.diagnosis.measured.group_spectra import group_records, transform_group
from frf_ipz.diagnosis.measured.noise_growth import STEADY, find_unexplained_share, fit_growth
from frf_ipz.diagnosis.observations import observe
from small_campaign import MODEL, RATE, SAMPLES, START, TEST, YOUNG, accelerance, write_csv

LEVELS_N = (3.0, 3.5, 10.0, 30.0, 100.0, 160.0)
STEADY_N = 30.0  # the level whose noise all records have, where it does not grow
NOISE = 0.01  # of the peak of the response; of the force a tenth of that


def write_records(folder, *, grows, seed, youngs_modulus_Pa=YOUNG):
    """A campaign of very unequal impacts, and the model of the same beam or of another one."""
    rng = np.random.default_rng(seed)
    time = np.arange(SAMPLES) / RATE
    pulse = np.where(abs(time - START) < 1.2e-3, np.cos(np.pi * (time - START) / 2.4e-3) ** 4, 0.0)
    decay = 12.0 / time[-1]
    s = decay + 2j * np.pi * np.fft.rfftfreq(SAMPLES, 1 / RATE)
    window = np.exp(-decay * time)
    response = np.fft.irfft(accelerance(s, 1.0, 14 / 20) * np.fft.rfft(pulse * window), SAMPLES) / window
    for number, level in enumerate(LEVELS_N):
        noise = NOISE * (level if grows else STEADY_N) * rng.standard_normal((2, SAMPLES))
        acceleration = level * response + np.abs(response).max() * noise[1]
        write_csv(folder / "hits" / f"blow_{number}.csv", time, level * pulse + 0.1 * noise[0], acceleration)
    (folder / "test.toml").write_text(TEST, encoding="utf-8")
    model = MODEL.replace(str(0.95 * YOUNG), str(youngs_modulus_Pa))
    (folder / "model.toml").write_text(model, encoding="utf-8")
    return frf_ipz.read_test(folder / "test.toml"), frf_ipz.read_model(folder / "model.toml")


@pytest.mark.parametrize(("grows", "exponent"), [(True, 1.0), (False, 0.0)])
def test_the_growth_is_read_from_the_records(tmp_path, grows, exponent):
    campaign, _ = write_records(tmp_path, grows=grows, seed=5)
    frfs = frf_ipz.estimate_frfs(campaign).frfs
    (group,) = group_records(observe(campaign, frfs=frfs, fit=frf_ipz.FitOptions(band_hz=(10.0, 600.0))))
    lines = transform_group(group, (10.0, 600.0), 12.0)
    growth = fit_growth([(group, lines, 0)])
    assert growth.exponent == pytest.approx(exponent, abs=0.05)
    np.testing.assert_allclose(STEADY.scales(group), 1.0, rtol=0)
    np.testing.assert_allclose(find_unexplained_share(STEADY, group, lines), 1.0, rtol=1e-12)
    assert fit_growth([(group[:2], lines, 0)]) is STEADY


@pytest.mark.parametrize("grows", [True, False])
def test_noise_that_grows_with_the_level_is_no_missing_physics(tmp_path, grows):
    campaign, model = write_records(tmp_path, grows=grows, seed=6)
    diagnosis = frf_ipz.diagnose(campaign, model, fit=frf_ipz.FitOptions(band_hz=(10.0, 600.0)))
    assert (diagnosis.verdict, diagnosis.findings, diagnosis.warnings) == ("consistent", (), ())
    assert diagnosis.numbers["null_misfit"] < 1.5  # 38 where all records were given the noise of their mean


def test_what_is_missing_is_found_under_such_noise(tmp_path):
    campaign, model = write_records(tmp_path, grows=True, seed=7, youngs_modulus_Pa=0.95 * YOUNG)
    options = frf_ipz.DiagnoseOptions(effects=("global_stiffness", "added_mass"))
    diagnosis = frf_ipz.diagnose(campaign, model, options=options, fit=frf_ipz.FitOptions(band_hz=(10.0, 600.0)))
    assert diagnosis.verdict == "explained"
    (finding,) = diagnosis.findings
    ratio = finding.parameters["stiffness_ratio"]
    assert ratio.value == pytest.approx(1 / 0.95, rel=0.005)
