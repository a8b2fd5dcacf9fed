"""Weak and strong impacts: equal FRFs for a linear structure, different ones where frequencies follow the level."""

from dataclasses import replace

import numpy as np
import pytest

from frf_ipz.diagnosis.measured.levels import compare_levels
from frf_ipz.diagnosis.observations import observe
from frf_ipz.identification.fit import fit_modes
from frf_ipz.identification.options import FitOptions
from frf_ipz.ingest.campaign_file import read_test
from frf_ipz.ingest.estimate import estimate_frfs
from frf_ipz.ingest.options import IngestOptions
from synthetic_campaign import HIT, Structure, hammer_campaign, impact, write_csv, write_test

BAND = FitOptions(band_hz=(20.0, 220.0))
HEIGHTS = (10.0, 30.0, 100.0, 200.0)
SOFTENING = 0.02  # of the frequencies, from the weakest impact to the strongest
QUOTIENT = 2e-4  # relative: what the neighbouring modes do within a resonance, beside (c0 + c1 s) / (s - p)
DAMPING = 0.01  # relative, for the same reason


PEAK = 0.05  # relative: the largest force falls between two samples


def observed(path):
    test = read_test(path)
    return observe(test, ingest=IngestOptions(), frfs=estimate_frfs(test, options=IngestOptions()).frfs, fit=BAND)


def observed_and_fitted(path):
    observations = observed(path)
    return observations, fit_modes(observations.frfs, options=BAND)


@pytest.fixture(scope="module")
def linear(tmp_path_factory):
    return observed_and_fitted(hammer_campaign(tmp_path_factory.mktemp("linear"), heights=HEIGHTS))


@pytest.fixture(scope="module")
def softening(tmp_path_factory, linear):
    """Each impact meets a structure whose frequencies are those of its level; the fit is that of the linear one."""
    folder = tmp_path_factory.mktemp("softening")
    true = Structure()
    for number, height in enumerate(HEIGHTS):
        factor = 1 - SOFTENING * number / (len(HEIGHTS) - 1)
        structure = replace(true, frequency_hz=tuple(factor * hertz for hertz in true.frequency_hz))
        write_csv(folder / "hits" / f"p_{number}.csv", impact(structure, height=height), 1 / 2048)
    return observed(write_test(folder, HIT)), linear[1]


def test_a_linear_structure_has_one_frf_at_all_levels(linear):
    levels = compare_levels(*linear)
    assert [str(label) for label in levels.labels] == ["1:+z / 7:+z", "2:+z / 7:+z"]
    np.testing.assert_allclose(levels.weak_N, 20.0, rtol=PEAK)
    np.testing.assert_allclose(levels.strong_N, 150.0, rtol=PEAK)
    assert np.linalg.norm(levels.weak - levels.strong) < 1e-3 * np.linalg.norm(levels.strong)
    exact = np.abs(Structure().accelerance(2j * np.pi * levels.frequency_hz))
    assert np.linalg.norm(levels.strong - exact) < 1e-3 * np.linalg.norm(exact)


def test_single_impacts_give_the_true_modes(linear):
    modes = compare_levels(*linear).modes
    assert len(modes) == 3 * len(HEIGHTS)
    true = Structure()
    for mode, rows in modes.groupby("mode"):
        np.testing.assert_allclose(rows["frequency_hz"], true.frequency_hz[mode], rtol=QUOTIENT)
        np.testing.assert_allclose(rows["damping_ratio"], true.damping_ratio[mode], rtol=DAMPING)


def test_frequencies_that_follow_the_level_are_estimated(softening):
    levels = compare_levels(*softening)
    assert np.linalg.norm(levels.weak - levels.strong) > 0.1 * np.linalg.norm(levels.strong)
    for mode, rows in levels.modes.groupby("mode"):
        ordered = rows.sort_values("level_N")
        np.testing.assert_allclose(ordered["level_N"], HEIGHTS, rtol=PEAK, err_msg=f"mode {mode}")
        shift = ordered["frequency_hz"].to_numpy() / ordered["frequency_hz"].iloc[0] - 1
        np.testing.assert_allclose(shift[1:], -SOFTENING * np.arange(1, 4) / 3, rtol=0.02)


def test_a_single_level_gives_no_comparison(tmp_path):
    levels = compare_levels(*observed_and_fitted(hammer_campaign(tmp_path, heights=(100.0, 110.0, 120.0))))
    assert (levels.labels, len(levels.modes), levels.weak.shape) == ((), 0, (0, 0))


def test_records_of_a_shaker_are_compared_too(linear):
    observations, fit = linear
    rng = np.random.default_rng(5)
    records = []
    for number, size in enumerate((1.0, 5.0)):
        force = size * rng.standard_normal(8 * 4096)
        signals = impact(Structure(), n_samples=len(force), force=force)
        first_record = observations.records[0]
        records.append(
            replace(first_record, name=f"r{number}", force=force, responses=signals[1:], starts_at_rest=False)
        )
    levels = compare_levels(replace(observations, kind="random", records=tuple(records)), fit)
    assert levels.weak_N[0] < 0.3 * levels.strong_N[0]
    assert np.linalg.norm(levels.weak - levels.strong) < 1e-4 * np.linalg.norm(levels.strong)  # other forces
    assert set(levels.modes["mode"]) <= {0, 1, 2}
