"""Locations that explain equally well as long as the expected error of the model is too large."""

from types import SimpleNamespace

import numpy as np
import pytest

from frf_ipz.diagnosis.nonlinear.channel_noise import read_noise
from frf_ipz.diagnosis.nonlinear.fitting import rescoring
from frf_ipz.diagnosis.nonlinear.fitting.alternating_fit import LawStart
from frf_ipz.diagnosis.nonlinear.fitting.problem import LawFitData
from frf_ipz.diagnosis.nonlinear.fitting.rescoring import rescore, select_contenders
from frf_ipz.diagnosis.nonlinear.laws.finder import shipped_laws
from frf_ipz.diagnosis.nonlinear.model.modal_model import make_modal_model
from frf_ipz.diagnosis.nonlinear.segments import REFINEMENT
from frf_ipz.diagnosis.options import DiagnoseOptions

FRICTION_N = 0.05
GUESSED_ERROR = 0.3  # of the response: far more than that of the model


@pytest.fixture(scope="module")
def problem(chain, strike):
    """Impacts on the chain with friction at node 3."""
    observations = strike(lambda _, v: FRICTION_N * np.tanh(v / 1e-4))
    data = LawFitData(
        training=observations,
        held_out=observations,
        modal_model=make_modal_model(chain.model, observations),
        noise=read_noise(observations),
        options=DiagnoseOptions(),
    )
    return data.make_problem(1.0, GUESSED_ERROR, loudest=False).with_steps(REFINEMENT)


def fit_at(problem, node):
    locations = problem.linear.nuisance_prior.modal_model.locations
    location = next(i for i, p in enumerate(locations) if p.nodes == (node,))
    start = LawStart(
        law=shipped_laws()["dry_friction"],
        location=location,
        strength=FRICTION_N,
        shape=0.0,
        nuisance=problem.linear.start_nuisance,
    )
    return problem.fit_output_error(
        SimpleNamespace(start=lambda _: start, nuisance=start.nuisance, n_rows=problem.linear.n_rows, simulation=None),
        12,
    )


@pytest.mark.slow
def test_data_that_are_better_than_guessed_distinguish_locations(problem, monkeypatch):
    monkeypatch.setattr(rescoring, "MAX_DIFFERENCE", np.inf)
    right, wrong = fits = [fit_at(problem, node) for node in (3, 2)]
    (rescored, rescored_wrong), behind = rescore(problem, fits)
    assert right.cost < wrong.cost
    assert behind[0] == 0
    assert behind[1] > 20 * (wrong.cost - right.cost) / 2
    assert (rescored.location, rescored_wrong.location) == (right.location, wrong.location)
    assert rescored.strength == pytest.approx(FRICTION_N, rel=0.05)
    assert rescored.cost == pytest.approx(right.cost, abs=0.1 * right.n_rows)


def test_a_fit_without_a_rival_is_not_rescored():
    fits = [SimpleNamespace(cost=100.0, n_rows=200), SimpleNamespace(cost=150.0, n_rows=200)]
    assert select_contenders(fits) == fits[:1]
    assert select_contenders([fits[0], SimpleNamespace(cost=109.0, n_rows=200)])[1].cost == 109.0


def test_a_model_that_is_wrong_is_not_given_a_larger_variance():
    fits = [SimpleNamespace(cost=900.0, n_rows=200), SimpleNamespace(cost=910.0, n_rows=200)]
    assert select_contenders(fits) == fits[:1]
