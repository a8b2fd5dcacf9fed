"""How stretches that start in motion may start."""

from dataclasses import replace

import numpy as np
import pytest

from frf_ipz.diagnosis.nonlinear.linear.modal_model import make_modal_model
from frf_ipz.diagnosis.nonlinear.linear.nuisance_prior import make_nuisance_prior
from frf_ipz.diagnosis.nonlinear.recorded.noise import read_noise
from frf_ipz.diagnosis.nonlinear.recorded.segments import Window, transform
from frf_ipz.diagnosis.options import DiagnoseOptions


@pytest.fixture
def freedom(chain, strike, random_records):
    """Of stretches in motion, with the first mode taken for a rigid-body mode."""
    observations = random_records(strike(), 2.0)
    plant = replace(make_modal_model(chain.model, observations), n_rigid=1)
    stretches = transform(observations, plant, read_noise(observations), Window(duration_s=1.0))
    return make_nuisance_prior(plant, stretches, observations.band_hz[1], DiagnoseOptions())


def test_a_rigid_body_is_not_thought_to_start_as_fast_as_a_resonance(freedom):
    assert np.all(freedom.starts[:, 0] < 0.2 * freedom.starts[:, 1])


def test_what_a_linear_model_says_of_a_rigid_bodys_start_is_not_kept(freedom):
    """Hardly anything but a law shows it: it takes up what the linear model lacks elsewhere."""
    kept = freedom.starts_of(freedom.as_stated(np.ones(freedom.n_unknowns)))
    assert np.all(kept[..., 0] == 0)
    assert np.all(kept[..., 1:] == freedom.starts[:, 1:])
    assert not np.any(freedom.as_stated(np.ones(freedom.n_unknowns))[: freedom.n_lasting])
