"""The output-error fit of a law: errors of the linear model, and derivatives that diverge."""

from dataclasses import replace

import numpy as np
import pytest

from frf_ipz.diagnosis.nonlinear.channel_noise import read_noise
from frf_ipz.diagnosis.nonlinear.fitting import output_error_fit
from frf_ipz.diagnosis.nonlinear.fitting.alternating_fit import LawStart
from frf_ipz.diagnosis.nonlinear.fitting.output_error_fit import fit_output_error
from frf_ipz.diagnosis.nonlinear.laws.finder import shipped_laws
from frf_ipz.diagnosis.nonlinear.model.modal_model import make_modal_model
from frf_ipz.diagnosis.nonlinear.model.nuisance_prior import make_nuisance_prior
from frf_ipz.diagnosis.nonlinear.segments import SegmentWindow, cut_segments
from frf_ipz.diagnosis.options import DiagnoseOptions

K3 = 3e9  # N/m^3: at the strongest impact as stiff as a third of a spring of the chain
SHAPE_ERROR = 4.0  # prior standard deviations, of the first mode at the location of the law
MODEL_ERROR = 1e-3  # of the response
CERTAIN = 3.0  # standard deviations


def hardening(w, v):
    del v
    return K3 * w**3


@pytest.fixture(scope="module")
def cubic(chain, strike):
    """Impacts on the chain with a cubic spring at node 3, and the prior, with 1 % of uneven stiffness allowed."""
    observations = strike(hardening)
    modal_model = make_modal_model(chain.model, observations)
    segments = cut_segments(
        observations, modal_model, read_noise(observations), SegmentWindow(duration_s=1.0, floor=MODEL_ERROR)
    )
    options = DiagnoseOptions(stiffness_tolerance=5e-3)
    location = next(i for i, p in enumerate(modal_model.locations) if p == {"nodes": [3]})
    return segments, make_nuisance_prior(modal_model, segments, observations.band_hz[1], options), location


def start_of(nuisance_prior, location, **changes):
    law = shipped_laws()["cubic_stiffness"]
    return replace(
        LawStart(law=law, location=location, strength=K3, shape=0.0, nuisance=np.zeros(nuisance_prior.n_nuisance)),
        **changes,
    )


@pytest.mark.slow
def test_the_shape_at_the_location_of_a_law_is_fitted(cubic):
    segments, nuisance_prior, location = cubic
    shapes = nuisance_prior.modal_model.at_locations.shapes.copy()
    shapes[location, nuisance_prior.modes] -= (
        SHAPE_ERROR * nuisance_prior.locations[location] * (nuisance_prior.modes == 0)
    )
    wrong = replace(
        nuisance_prior.modal_model, at_locations=replace(nuisance_prior.modal_model.at_locations, shapes=shapes)
    )
    fit = fit_output_error(
        segments, replace(nuisance_prior, modal_model=wrong), start_of(nuisance_prior, location), iterations=12
    )
    fixed = fit_output_error(
        segments,
        replace(nuisance_prior, modal_model=wrong, locations=1e-9 * nuisance_prior.locations),
        start_of(nuisance_prior, location),
        iterations=12,
    )
    assert fit.cost < 0.5 * fixed.cost
    std = np.sqrt(fit.estimate_covariance()[0, 0])
    assert abs(fit.strength - K3) < CERTAIN * std
    assert abs(fixed.strength - K3) > CERTAIN * np.sqrt(fixed.estimate_covariance()[0, 0])


@pytest.mark.parametrize("size", [pytest.param(1e200, marks=pytest.mark.slow), np.inf])
def test_derivatives_that_diverge_are_set_to_zero(cubic, monkeypatch, size):
    """Of a stiff stop, say: the derivative grows from contact to contact until it overflows."""
    segments, nuisance_prior, location = cubic
    tangent = output_error_fit.step_tangent
    monkeypatch.setattr(output_error_fit, "step_tangent", lambda *arguments: size * tangent(*arguments))
    fit = fit_output_error(segments, nuisance_prior, start_of(nuisance_prior, location), iterations=2)
    assert np.isfinite(fit.cost)
    assert np.isfinite(fit.estimate_covariance()).all()


def test_a_fit_goes_on_from_its_simulation(cubic, monkeypatch):
    """The first simulation of further steps is the last one of those before; what is given up needs no covariance."""
    segments, nuisance_prior, location = cubic
    calls = {"step_in_time": 0, "step_tangent": 0}

    def counted(name):
        function = getattr(output_error_fit, name)

        def count(*arguments):
            calls[name] += 1
            return function(*arguments)

        return count

    for name in calls:
        monkeypatch.setattr(output_error_fit, name, counted(name))
    start = start_of(nuisance_prior, location, strength=0.9 * K3)
    fit = fit_output_error(segments, nuisance_prior, start, iterations=1)
    assert calls == {"step_in_time": 2, "step_tangent": 1}
    further = fit_output_error(segments, nuisance_prior, fit.start(), iterations=1, known=fit.simulation)
    assert calls == {"step_in_time": 3, "step_tangent": 2}
    assert further.cost == fit_output_error(segments, nuisance_prior, fit.start(), iterations=1).cost
    assert calls == {"step_in_time": 5, "step_tangent": 3}
    other = replace(fit.start(), strength=K3)
    moved = fit_output_error(segments, nuisance_prior, other, iterations=0, known=fit.simulation)
    assert moved.cost != fit.cost
