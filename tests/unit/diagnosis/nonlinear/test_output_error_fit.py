"""The fit of a law by simulation: what the linear model around it may be wrong by."""

from dataclasses import replace

import numpy as np
import pytest

from frf_ipz.diagnosis.nonlinear.fitting import output_error_fit as shooting
from frf_ipz.diagnosis.nonlinear.fitting.output_error_fit import fit_output_error
from frf_ipz.diagnosis.nonlinear.fitting.refine import Start
from frf_ipz.diagnosis.nonlinear.laws.finder import shipped_laws
from frf_ipz.diagnosis.nonlinear.linear.modal_model import make_modal_model
from frf_ipz.diagnosis.nonlinear.linear.nuisance_prior import make_nuisance_prior
from frf_ipz.diagnosis.nonlinear.recorded.noise import read_noise
from frf_ipz.diagnosis.nonlinear.recorded.segments import Window, transform
from frf_ipz.diagnosis.options import DiagnoseOptions

K3 = 3e9  # N/m^3: at the strongest blow as stiff as a third of a spring of the chain
OFF = 4.0  # prior standard deviations that the shape at the place is off by, in the first mode
NOISE_FLOOR = 1e-3  # of the response: what the fit may miss
CERTAIN = 3.0  # standard deviations


def hardening(w, v):
    del v
    return K3 * w**3


@pytest.fixture(scope="module")
def cubic(chain, strike):
    """Blows on the chain with a cubic spring at node 3, and the plant, with 1 % of uneven stiffness allowed."""
    observations = strike(hardening)
    modal_model = make_modal_model(chain.model, observations)
    stretches = transform(
        observations, modal_model, read_noise(observations), Window(duration_s=1.0, floor=NOISE_FLOOR)
    )
    options = DiagnoseOptions(stiffness_tolerance=5e-3)
    place = next(i for i, p in enumerate(modal_model.places) if p.location == {"nodes": [3]})
    return stretches, make_nuisance_prior(modal_model, stretches, observations.band_hz[1], options), place


def start_at(nuisance_prior, place, **changes):
    law = shipped_laws()["cubic_stiffness"]
    return replace(
        Start(law=law, place=place, strength=K3, shape=0.0, unknowns=np.zeros(nuisance_prior.n_unknowns)), **changes
    )


def test_the_shape_at_the_place_of_a_law_may_be_off(cubic):
    stretches, nuisance_prior, place = cubic
    shapes = nuisance_prior.modal_model.at_places.shapes.copy()
    shapes[place, nuisance_prior.modes] -= OFF * nuisance_prior.places[place] * (nuisance_prior.modes == 0)
    wrong = replace(nuisance_prior.modal_model, at_places=replace(nuisance_prior.modal_model.at_places, shapes=shapes))
    fit = fit_output_error(
        stretches, replace(nuisance_prior, modal_model=wrong), start_at(nuisance_prior, place), iterations=12
    )
    held = fit_output_error(
        stretches,
        replace(nuisance_prior, modal_model=wrong, places=1e-9 * nuisance_prior.places),
        start_at(nuisance_prior, place),
        iterations=12,
    )
    assert fit.cost < 0.5 * held.cost
    std = np.sqrt(fit.covariance[0, 0])
    assert abs(fit.strength - K3) < CERTAIN * std
    assert abs(held.strength - K3) > CERTAIN * np.sqrt(held.covariance[0, 0])


@pytest.mark.parametrize("size", [1e200, np.inf])
def test_changes_that_run_away_are_taken_for_none(cubic, monkeypatch, size):
    """Of a stiff stop, say: the derivative grows from contact to contact until it has no number any more."""
    stretches, nuisance_prior, place = cubic
    follow = shooting.step_tangent
    monkeypatch.setattr(shooting, "step_tangent", lambda *given: size * follow(*given))
    fit = fit_output_error(stretches, nuisance_prior, start_at(nuisance_prior, place), iterations=2)
    assert np.isfinite(fit.cost)
    assert np.isfinite(fit.covariance).all()
