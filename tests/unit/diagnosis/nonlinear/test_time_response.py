"""Derivatives of a location's motion by the nuisance parameters, at rest and in motion at the start."""

from dataclasses import replace

import numpy as np
import pytest

from frf_ipz.diagnosis.nonlinear.channel_noise import read_noise
from frf_ipz.diagnosis.nonlinear.model.modal_model import make_modal_model
from frf_ipz.diagnosis.nonlinear.model.nuisance_prior import make_nuisance_prior
from frf_ipz.diagnosis.nonlinear.model.time_response import TimeResponse
from frf_ipz.diagnosis.nonlinear.segments import SegmentWindow, cut_segments
from frf_ipz.diagnosis.options import DiagnoseOptions

STEP = 1e-3  # prior standard deviations: a change of the motion by less than a part in 1e3
ROUNDING = 1e-30  # m: states of modes that no force excites
CLOSE = 1e-4  # of the largest difference: what its step leaves


def time_response(chain, strike):
    observations = strike(lambda w, v: 0.0 * w * v)
    modal_model = make_modal_model(chain.model, observations)
    segments = cut_segments(observations, modal_model, read_noise(observations), SegmentWindow(duration_s=0.1))
    prior = make_nuisance_prior(modal_model, segments, observations.band_hz[1], DiagnoseOptions())
    return TimeResponse(segments=segments, nuisance_prior=prior, nuisance=np.zeros(prior.n_nuisance), location=2)


def test_a_mode_that_decays_within_a_step_has_derivatives(chain, strike):
    """As a search tries it: what is left of it after a step is 0 in double precision."""
    here = time_response(chain, strike)
    far = here.nuisance.copy()
    far[: 2 * len(here.nuisance_prior.modes)] = 1e6  # frequencies and damping ratios, as far as they may go
    there = replace(here, nuisance=far)
    assert (there.modes().turn == 0).any()
    with np.errstate(all="raise", under="ignore"):
        assert np.isfinite(there.derivatives(here.segments.fine_force)).all()


@pytest.mark.parametrize("moves", [False, True])
def test_the_motion_follows_small_changes_of_the_model(chain, strike, moves):
    observations = strike(lambda w, v: 0.0 * w * v)
    modal_model = make_modal_model(chain.model, observations)
    window = SegmentWindow(duration_s=0.1)
    segments = cut_segments(observations, modal_model, read_noise(observations), window)
    segments = replace(segments, steps_per_sample=2)
    if moves:
        moving = np.arange(segments.n_segments) % 2 == 1
        segments = replace(segments, moving=moving, pause_s=np.zeros(len(moving)))
    prior = make_nuisance_prior(modal_model, segments, observations.band_hz[1], DiagnoseOptions())
    rng = np.random.default_rng(4)
    nuisance, law_force = rng.standard_normal(prior.n_nuisance), 3 * segments.fine_force[:, ::-1]
    here = TimeResponse(segments=segments, nuisance_prior=prior, nuisance=nuisance, location=2)

    def motion(changed):
        there = replace(here, nuisance=changed)
        z = there.modes().drive(there.input_forces() - there.shapes[:, None] * law_force[:, None])
        by_force = there.modes().drive(there.input_forces())
        modal = [getattr(there.modes(), name)(z - by_force) for name in ("displacement", "velocity")]
        return there.motion_without_law() + np.einsum("m,kbmt->kbt", there.shapes, np.array(modal))

    n, sensors = len(prior.modes), prior.sensors.size
    columns = here.derivatives(law_force)
    assert columns.shape == (segments.n_segments, (6 if moves else 4) * n, 2, segments.fine_force.shape[1])
    starts = [0, n, 2 * n + sensors, 2 * n + sensors + prior.inputs.size]
    if moves:
        starts += [starts[-1] + n, starts[-1] + n + prior.initial_states.size]
    for kind, first in enumerate(starts):
        for mode in (0, 1):
            ends = []
            for sign in (1, -1):
                changed = nuisance.copy()
                blocks = [0]
                if kind == 2:
                    blocks = n * np.arange(len(prior.inputs))
                if kind > 3:
                    blocks = n * np.arange(len(prior.moving))
                changed[[first + block + mode for block in blocks]] += sign * STEP
                ends.append(motion(changed))
            expected = ((ends[0] - ends[1]) / (2 * STEP)).swapaxes(0, 1)
            error = np.abs(columns[:, kind * n + mode] - expected)
            assert (error.max((0, 2)) <= CLOSE * np.abs(expected).max((0, 2)) + ROUNDING).all()
