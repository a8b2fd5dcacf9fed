"""The linear model that a law is compared with."""

from dataclasses import replace

import numpy as np

from frf_ipz.diagnosis.nonlinear.channel_noise import read_noise
from frf_ipz.diagnosis.nonlinear.fitting.linear_fit import fit_linear
from frf_ipz.diagnosis.nonlinear.model.modal_model import make_modal_model
from frf_ipz.diagnosis.nonlinear.model.nuisance_prior import make_nuisance_prior
from frf_ipz.diagnosis.nonlinear.segments import SegmentWindow, cut_segments
from frf_ipz.diagnosis.options import DiagnoseOptions

OFF = np.log(1.04)  # frequencies: several widths of a resonance, far beyond one linear step
RIGHT = 1.05  # times the cost from where the model is right


def test_a_linear_model_is_fitted_in_more_than_one_step(chain, strike):
    observations = strike()
    modal_model = make_modal_model(chain.model, observations)
    segments = cut_segments(
        observations, modal_model, read_noise(observations), SegmentWindow(duration_s=4.0, floor=1e-4)
    )
    away = replace(modal_model, omega_rad_s=modal_model.omega_rad_s * np.exp(OFF))
    options = DiagnoseOptions(frequency_tolerance=0.1)
    right, off = (
        fit_linear(segments, make_nuisance_prior(start, segments, observations.band_hz[1], options))
        for start in (modal_model, away)
    )
    distance = 4 * (OFF / (0.1 / np.sqrt(3))) ** 2  # four modes, in prior standard deviations
    assert off.cost < RIGHT * right.cost + 2 * distance
