"""Prior of the initial states of segments that start in motion."""

from dataclasses import replace

import numpy as np
import pytest

from frf_ipz.diagnosis.nonlinear.channel_noise import read_noise
from frf_ipz.diagnosis.nonlinear.model.modal_model import make_modal_model
from frf_ipz.diagnosis.nonlinear.model.nuisance_prior import make_nuisance_prior
from frf_ipz.diagnosis.nonlinear.segments import SegmentWindow, cut_segments
from frf_ipz.diagnosis.options import DiagnoseOptions


@pytest.fixture
def nuisance_prior(chain, strike, random_records):
    """Of segments in motion, with the first mode taken for a rigid-body mode."""
    observations = random_records(strike(), 2.0)
    modal_model = replace(make_modal_model(chain.model, observations), n_rigid=1)
    segments = cut_segments(observations, modal_model, read_noise(observations), SegmentWindow(duration_s=1.0))
    return make_nuisance_prior(modal_model, segments, observations.band_hz[1], DiagnoseOptions())


def test_initial_states_of_rigid_body_modes_are_smaller_than_those_of_resonances(nuisance_prior):
    assert np.all(nuisance_prior.initial_states[:, 0] < 0.2 * nuisance_prior.initial_states[:, 1])


def test_initial_states_of_rigid_body_modes_by_a_linear_model_are_dropped(nuisance_prior):
    """Hardly anything but a law shows it: it takes up what the linear model lacks elsewhere."""
    states = nuisance_prior.initial_states_of(nuisance_prior.keep_initial_states(np.ones(nuisance_prior.n_nuisance)))
    assert np.all(states[..., 0] == 0)
    assert np.all(states[..., 1:] == nuisance_prior.initial_states[:, 1:])
    assert not np.any(
        nuisance_prior.keep_initial_states(np.ones(nuisance_prior.n_nuisance))[: nuisance_prior.n_structural]
    )
