"""Places that explain alike as long as the model is thought to miss more than it does."""

from types import SimpleNamespace

import numpy as np
import pytest

from frf_ipz.diagnosis.nonlinear.fitting import rescoring as reweighted
from frf_ipz.diagnosis.nonlinear.fitting.fitted_segments import FittedSegments
from frf_ipz.diagnosis.nonlinear.fitting.refine import Start
from frf_ipz.diagnosis.nonlinear.fitting.rescoring import tell_apart
from frf_ipz.diagnosis.nonlinear.laws.finder import shipped_laws
from frf_ipz.diagnosis.nonlinear.linear.modal_model import make_modal_model
from frf_ipz.diagnosis.nonlinear.recorded.noise import read_noise
from frf_ipz.diagnosis.options import DiagnoseOptions

FRICTION_N = 0.05
GUESSED = 0.3  # of the response: far more than the model misses


@pytest.fixture(scope="module")
def track(chain, strike):
    """Blows on the chain with friction at node 3."""
    observations = strike(lambda _, v: FRICTION_N * np.tanh(v / 1e-4))
    recordings = FittedSegments(
        training=observations,
        held_out=observations,
        modal_model=make_modal_model(chain.model, observations),
        noise=read_noise(observations),
        options=DiagnoseOptions(),
    )
    return recordings.track(1.0, GUESSED, loudest=False)


def fit_at(track, node):
    places = track.linear.nuisance_prior.modal_model.places
    place = next(i for i, p in enumerate(places) if p.location.get("nodes") == [node])
    start = Start(
        law=shipped_laws()["dry_friction"],
        place=place,
        strength=FRICTION_N,
        shape=0.0,
        unknowns=track.linear.as_stated,
    )
    return track.fit_output_error(
        SimpleNamespace(start=lambda _: start, unknowns=start.unknowns, n_rows=track.linear.n_rows), 12
    )


def test_data_that_are_better_than_guessed_tell_places_apart(track, monkeypatch):
    monkeypatch.setattr(reweighted, "ALIKE", np.inf)
    right, wrong = fits = [fit_at(track, node) for node in (3, 2)]
    (again, beside), behind = tell_apart(track, fits)
    assert right.cost < wrong.cost
    assert behind[0] == 0
    assert behind[1] > 20 * (wrong.cost - right.cost) / 2
    assert (again.place, beside.place) == (right.place, wrong.place)
    assert again.strength == pytest.approx(FRICTION_N, rel=0.05)
    assert again.cost == pytest.approx(right.cost, abs=0.1 * right.n_rows)


def test_what_is_without_a_rival_stays_as_it_is(track):
    fits = [SimpleNamespace(cost=100.0, n_rows=200), SimpleNamespace(cost=150.0, n_rows=200)]
    near, behind = tell_apart(track, fits)
    assert near == fits[:1]
    assert behind.tolist() == [0.0]


def test_a_model_that_is_wrong_is_not_given_a_larger_variance(track):
    fits = [SimpleNamespace(cost=900.0, n_rows=200), SimpleNamespace(cost=910.0, n_rows=200)]
    near, behind = tell_apart(track, fits)
    assert near == fits
    assert behind.tolist() == [0.0, 0.0]
