"""A force at a place, before anything is known of its law: by how it reaches the sensors."""

from dataclasses import replace

import numpy as np
import pytest

from frf_ipz.diagnosis.nonlinear.fitting import candidates
from frf_ipz.diagnosis.nonlinear.fitting import force_localisation as module
from frf_ipz.diagnosis.nonlinear.fitting.force_localisation import free_force, neighbours, start_at, whereabouts
from frf_ipz.diagnosis.nonlinear.fitting.output_error_fit import fit_output_error
from frf_ipz.diagnosis.nonlinear.fitting.refine import Start
from frf_ipz.diagnosis.nonlinear.fitting.score_test import fit_linear
from frf_ipz.diagnosis.nonlinear.laws.cubic_stiffness import CubicStiffness
from frf_ipz.diagnosis.nonlinear.laws.gap_contact import GapContact
from frf_ipz.diagnosis.nonlinear.linear.modal_model import make_modal_model
from frf_ipz.diagnosis.nonlinear.linear.nuisance_prior import make_nuisance_prior
from frf_ipz.diagnosis.nonlinear.recorded.noise import read_noise
from frf_ipz.diagnosis.nonlinear.recorded.segments import Window, transform
from frf_ipz.diagnosis.options import DiagnoseOptions

LAWS = {
    "cubic": (lambda w, _: 2e10 * w**3, (0, 0, 1, 0), {"nodes": [3]}),
    "gap": (lambda w, _: 3e4 * max(w - 2e-4, 0.0), (0, 0, 0, 1), {"nodes": [4]}),
    "none that is known": (lambda w, v: 3e7 * w * abs(w) + 5.0 * v * abs(v), (0, -1, 1, 0), {"springs": ["k3"]}),
}
READ = 0.3  # relative: by the nearest of a few gaps


def prepared(model, observations, *, duration_s=2.0, floor=2e-3):
    modal_model = make_modal_model(model, observations)
    stretches = transform(
        observations, modal_model, read_noise(observations), Window(duration_s=duration_s, floor=floor)
    )
    return stretches, fit_linear(stretches, make_nuisance_prior(modal_model, stretches, 75.0, DiagnoseOptions()))


@pytest.mark.parametrize("name", LAWS)
def test_a_force_is_placed_whatever_its_law(chain, strike, name):
    law, where, location = LAWS[name]
    stretches, linear = prepared(chain.model, strike(law, where))
    found = whereabouts(stretches, linear)
    assert dict(linear.nuisance_prior.modal_model.places[found.equal[0]].location) == location
    assert found.forces[0].cost < 1e-3 * linear.cost
    assert set(found.equal) <= set(found.possible)
    assert len(found.possible) < len(linear.nuisance_prior.modal_model.places)


def test_a_place_is_fitted_from_what_explains_beside_it(chain, strike, monkeypatch):
    """By themselves all places but one end where much is left."""
    law, where, _ = LAWS["cubic"]
    stretches, linear = prepared(chain.model, strike(law, where))
    best, modal_model = whereabouts(stretches, linear).equal[0], linear.nuisance_prior.modal_model
    beside = next(place for place in range(len(modal_model.places)) if best in neighbours(modal_model, place, 1))

    def astray(stretches, linear, place, unknowns=None):
        found = free_force(stretches, linear, place, unknowns)
        return found if place == beside or unknowns is not None else replace(found, cost=found.cost + 1e12)

    monkeypatch.setattr(module, "free_force", astray)
    assert whereabouts(stretches, linear).equal[0] == best


def test_any_force_leaves_less_than_a_law_at_its_place_however_far_off_the_model_starts(chain_like, strike):
    """Where the model's own errors are large beside what data leave, whole steps go astray."""
    model = chain_like(ratio=0.006, stiffness_n_m=0.99 * 4e4)
    stretches, linear = prepared(model, strike(*LAWS["cubic"][:2]), duration_s=3.0, floor=5e-4)
    start = Start(law=CubicStiffness(), place=2, strength=2e10, shape=0.0, unknowns=linear.as_stated)
    law = fit_output_error(stretches, linear.nuisance_prior, start, iterations=20)
    assert law.cost < linear.n_rows
    assert free_force(stretches, linear, 2).cost < law.cost
    assert whereabouts(stretches, linear).equal == (2,)


def test_one_sensor_places_nothing(chain, strike):
    law, where, _ = LAWS["cubic"]
    observations = strike(law, where)
    records = tuple(
        replace(record, sensors=record.sensors[:1], responses=record.responses[:1]) for record in observations.records
    )
    stretches, linear = prepared(chain.model, replace(observations, records=records))
    found = whereabouts(stretches, linear)
    assert found.equal == found.possible == tuple(range(len(linear.nuisance_prior.modal_model.places)))
    assert found.forces == ()


@pytest.mark.parametrize(
    ("name", "law", "strength", "shape"), [("cubic", CubicStiffness(), 2e10, 0.0), ("gap", GapContact(), 3e4, 2e-4)]
)
def test_the_numbers_of_a_law_are_read_from_the_force(chain, strike, name, law, strength, shape):
    stretches, linear = prepared(chain.model, strike(*LAWS[name][:2]))
    start = start_at(stretches, linear, whereabouts(stretches, linear).forces[0], law)
    assert start.strength == pytest.approx(strength, rel=READ)
    assert start.shape == pytest.approx(shape, rel=READ)
    assert np.isfinite(start.unknowns).all()


@pytest.mark.parametrize("far_off", [True, False])
def test_a_law_that_refining_leads_astray_is_simulated_as_it_was_read(chain, strike, monkeypatch, far_off):
    stretches, linear = prepared(chain.model, strike(*LAWS["gap"][:2]))
    track = candidates.LawFitProgress(stretches=stretches, linear=linear, where=whereabouts(stretches, linear))
    refined = candidates.refine

    def led_astray(*given, **options):
        fit = refined(*given, **options)
        return replace(fit, shape=20 * abs(fit.shape), strength=1e-3 * fit.strength)  # a gap that is never closed

    monkeypatch.setattr(candidates, "refine", led_astray)
    if not far_off:
        monkeypatch.setattr(candidates, "FAR_OFF", np.inf)
    found = candidates.find_candidates(track, track, [GapContact()])
    is_found = bool(found) and (found[0].strength, found[0].shape) == pytest.approx((3e4, 2e-4), rel=0.05)
    assert is_found is far_off


def test_a_place_whose_force_reaches_the_sensors_best_is_simulated_whatever_refining_says(chain, strike, monkeypatch):
    stretches, linear = prepared(chain.model, strike(*LAWS["cubic"][:2]))
    where = whereabouts(stretches, linear)
    everywhere = tuple(range(len(linear.nuisance_prior.modal_model.places)))
    track = candidates.LawFitProgress(stretches=stretches, linear=linear, where=replace(where, possible=everywhere))
    refined, read = candidates._refined, candidates._read
    monkeypatch.setattr(candidates, "_refined", lambda *given: [fit for fit in refined(*given) if fit.place != 2])
    monkeypatch.setattr(candidates, "_read", lambda *given: [replace(fit, cost=np.inf) for fit in read(*given)])
    monkeypatch.setattr(candidates.LawFitProgress, "beside", lambda *_: [])
    monkeypatch.setattr(candidates, "FEW", 0)
    monkeypatch.setattr(candidates, "FAR_OFF", np.inf)
    assert where.equal[0] == 2
    assert candidates.find_candidates(track, track, [CubicStiffness()])[0].place == 2
