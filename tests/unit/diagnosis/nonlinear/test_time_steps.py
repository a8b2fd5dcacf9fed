"""The number of time steps of a search: as many as it takes that twice as many change nothing."""

from dataclasses import replace

import numpy as np
import pytest

from frf_ipz.diagnosis.nonlinear.channel_noise import read_noise
from frf_ipz.diagnosis.nonlinear.fitting import time_steps
from frf_ipz.diagnosis.nonlinear.fitting.alternating_fit import LawStart
from frf_ipz.diagnosis.nonlinear.fitting.output_error_fit import fit_output_error
from frf_ipz.diagnosis.nonlinear.fitting.problem import LawFitData
from frf_ipz.diagnosis.nonlinear.fitting.time_steps import first_steps, resolve_in_time
from frf_ipz.diagnosis.nonlinear.laws.finder import shipped_laws
from frf_ipz.diagnosis.nonlinear.model.modal_model import make_modal_model
from frf_ipz.diagnosis.nonlinear.segments import REFINEMENT
from frf_ipz.diagnosis.options import DiagnoseOptions

FRICTION_N = 0.05
K3 = 3e9  # N/m^3


def fit_law(chain, strike, name, strength, law_force):
    """Fit a law at node 3 to the first moments of impacts on the chain, in the steps that a search begins with."""
    observations = strike(law_force)
    data = LawFitData(
        training=observations,
        held_out=observations,
        modal_model=make_modal_model(chain.model, observations),
        noise=read_noise(observations),
        options=DiagnoseOptions(),
    )
    problem = data.make_problem(0.25, 0.005, loudest=False)
    location = next(i for i, p in enumerate(data.modal_model.locations) if p.nodes == (3,))
    nuisance = problem.linear.start_nuisance
    start = LawStart(law=shipped_laws()[name], location=location, strength=strength, shape=0.0, nuisance=nuisance)
    return problem, fit_output_error(problem.segments, problem.linear.nuisance_prior, start)


@pytest.mark.parametrize(("change", "steps"), [(np.inf, 1), (1e-9, REFINEMENT)])
def test_steps_are_halved_until_that_changes_nothing(chain, strike, monkeypatch, change, steps):
    monkeypatch.setattr(time_steps, "LARGEST_CHANGE", change)
    problem, fit = fit_law(chain, strike, "dry_friction", FRICTION_N, lambda _, v: FRICTION_N * np.tanh(v / 1e-4))
    problem = problem.with_steps(1)
    fit = problem.fit_output_error(fit, 6)
    resolved, (best,) = resolve_in_time(problem, [fit])
    assert resolved.segments.steps_per_sample == steps
    assert best.motion.shape[1] == steps * problem.segments.n_samples


def test_a_fit_that_does_not_converge_in_the_steps_that_it_needs_is_searched_for_again(chain, strike, monkeypatch):
    problem, fit = fit_law(chain, strike, "cubic_stiffness", K3, lambda w, _: K3 * w**3)
    problem = problem.with_steps(1)
    fit = problem.fit_output_error(fit, 6)
    monkeypatch.setattr(time_steps, "LARGEST_CHANGE", 1e-9)
    monkeypatch.setattr(time_steps, "STEPS", 0)
    finer, fits = resolve_in_time(problem, [fit])
    assert fits is None
    assert finer.segments.steps_per_sample == 2


def test_a_search_begins_with_steps_that_resolve_the_band(chain, strike):
    problem, _ = fit_law(chain, strike, "cubic_stiffness", K3, lambda w, _: K3 * w**3)
    segments, rate = problem.segments, 1 / problem.segments.step_s
    assert [first_steps(segments, rate * part) for part in (0.45, 0.25, 0.2, 0.1)] == [4, 2, 2, 1]
    for steps in (1, 2, 4):
        coarser = replace(segments, steps_per_sample=steps).fine_force
        assert coarser.shape == (segments.n_segments, steps * segments.n_samples)
        assert (coarser == segments.finest_force[:, :: REFINEMENT // steps]).all()
