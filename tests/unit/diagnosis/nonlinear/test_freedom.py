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
def nuisance_prior(chain, strike, random_records):
    """Of stretches in motion, with the first mode taken for a rigid-body mode."""
    observations = random_records(strike(), 2.0)
    modal_model = replace(make_modal_model(chain.model, observations), n_rigid=1)
    stretches = transform(observations, modal_model, read_noise(observations), Window(duration_s=1.0))
    return make_nuisance_prior(modal_model, stretches, observations.band_hz[1], DiagnoseOptions())


def test_a_rigid_body_is_not_thought_to_start_as_fast_as_a_resonance(nuisance_prior):
    assert np.all(nuisance_prior.starts[:, 0] < 0.2 * nuisance_prior.starts[:, 1])


def test_what_a_linear_model_says_of_a_rigid_bodys_start_is_not_kept(nuisance_prior):
    """Hardly anything but a law shows it: it takes up what the linear model lacks elsewhere."""
    kept = nuisance_prior.starts_of(nuisance_prior.as_stated(np.ones(nuisance_prior.n_unknowns)))
    assert np.all(kept[..., 0] == 0)
    assert np.all(kept[..., 1:] == nuisance_prior.starts[:, 1:])
    assert not np.any(nuisance_prior.as_stated(np.ones(nuisance_prior.n_unknowns))[: nuisance_prior.n_lasting])
