"""Bands hold the truth where the model lacks a mode, hangs otherwise, or has another mass."""

from dataclasses import replace

import numpy as np
import pytest

import frf_ipz
from frf_ipz.updating.scale import MeasuredScale
from hidden_effects import HiddenRun


def share_inside_by_ensemble(run, updated):
    """Share of the lines that the band holds without what the model misses at the measured points."""
    point, lines = [run.hidden.point], run.prediction.frequency_hz
    prediction = frf_ipz.predict_frfs(run.frfs, updated, points=point, frequency_hz=lines)
    return np.mean((run.truth >= prediction.magnitude_low) & (run.truth <= prediction.magnitude_high))


def test_a_band_reaches_as_far_as_the_mass_is_in_doubt():
    runs = [HiddenRun("mass", 4000 + seed, expand=False) for seed in range(4)]
    assert all(abs(np.log(run.updated.scale.level)) > 0.05 for run in runs)
    assert np.mean([share_inside_by_ensemble(run, run.updated) for run in runs]) > 0.6
    sure_of_mass = [share_inside_by_ensemble(run, replace(run.updated, scale=MeasuredScale())) for run in runs]
    assert np.mean(sure_of_mass) < 0.1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "machines", "least"),
    [("cords", 12, 0.85), ("lump", 12, 0.85), ("mass", 12, 0.85), ("local modes", 6, 0.85), ("region", 12, 0.9)],
)
def test_bands_hold_the_truth_over_many_machines(kind, machines, least):
    """Of a region, 0.86 without masses that differ along the structure."""
    assert np.mean([HiddenRun(kind, 5000 + seed).share_inside for seed in range(machines)]) > least
