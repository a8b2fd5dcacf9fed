"""Stretches of recordings as they are looked at."""

from dataclasses import replace

import numpy as np
import pytest

from frf_ipz.diagnosis.nonlinear.linear.modal_model import make_modal_model
from frf_ipz.diagnosis.nonlinear.linear.nuisance_prior import make_nuisance_prior
from frf_ipz.diagnosis.nonlinear.recorded.noise import read_noise
from frf_ipz.diagnosis.nonlinear.recorded.segments import Window, transform
from frf_ipz.diagnosis.options import DiagnoseOptions


def test_lines_that_are_left_out_are_not_fitted(chain, strike):
    observations = replace(strike(), exclude_hz=((30.0, 40.0),))
    window = Window(duration_s=1.0)
    stretches = transform(observations, make_modal_model(chain.model, observations), read_noise(observations), window)
    used_hz = stretches.s.imag[stretches.used] / (2 * np.pi)
    width_hz = stretches.sigma_1_s / (2 * np.pi)
    assert used_hz.min() < 10.0
    assert used_hz.max() > 70.0
    assert not np.any((used_hz > 30.0 - width_hz) & (used_hz < 40.0 + width_hz))


@pytest.mark.parametrize(("loud_s", "expected"), [(2.0, [False, True]), (0.1, [False])], ids=["late", "early"])
def test_a_record_is_looked_at_where_it_is_loudest(chain, strike, random_records, loud_s, expected):
    observations = random_records(strike(), loud_s)
    modal_model, noise = make_modal_model(chain.model, observations), read_noise(observations)
    stretches = transform(observations, modal_model, noise, Window(duration_s=1.0))
    assert stretches.moving.tolist() == 2 * expected
    for start in stretches.first_sample[stretches.moving] * stretches.step_s:
        assert start < loud_s < start + 0.3  # what lies early in a stretch counts most


def test_a_record_is_looked_at_once_where_that_is_enough(chain, strike, random_records):
    observations = random_records(strike(), 2.0)
    modal_model, noise = make_modal_model(chain.model, observations), read_noise(observations)
    assert not transform(observations, modal_model, noise, Window(duration_s=1.0, loudest=False)).moving.any()


def test_noise_of_the_force_is_more_of_a_weak_blow(chain, strike):
    """It is the same in all blows, and the responses follow the force."""
    observations = strike()
    modal_model, quiet = make_modal_model(chain.model, observations), read_noise(observations)
    loud = replace(quiet, force=replace(quiet.force, white=1e4 * max(quiet.force.white, 1e-12)))
    added = [transform(observations, modal_model, noise, Window(duration_s=1.0)).noise for noise in (loud, quiet)]
    stretches = transform(observations, modal_model, quiet, Window(duration_s=1.0))
    part = ((added[0] - added[1]).mean(1) / np.mean(np.abs(stretches.motion) ** 2, 1))[:, stretches.used].mean(1)
    peaks = np.abs(stretches.fine_force).max(1)
    assert np.all(np.diff(part[np.argsort(peaks)]) < 0)
    assert part.max() > 10 * part.min()


def test_a_record_is_not_looked_at_where_its_motion_has_died_away(chain, strike, random_records):
    """A shaker that was running before the record, and stops half-way."""
    observations, begin, stop_s = random_records(strike(), 0.5), 120, 1.7
    modal_model, noise = make_modal_model(chain.model, observations), read_noise(observations)
    runs = record_times(observations.records[0])[begin:] < begin * observations.records[0].step_s + stop_s
    cut = tuple(
        replace(
            record, force=record.force[begin:] * runs, responses=np.gradient(record.responses[:, begin:], axis=1) * runs
        )
        for record in observations.records
    )
    stretches = transform(replace(observations, records=cut), modal_model, noise, Window(duration_s=1.0))
    assert stretches.moving.all()
    assert np.max(stretches.first_sample * stretches.step_s) < stop_s


def test_a_record_without_any_motion_is_looked_at_all_the_same(chain, strike, random_records):
    observations = random_records(strike(), 0.5)
    modal_model, noise = make_modal_model(chain.model, observations), read_noise(observations)
    dead = tuple(replace(record, responses=np.zeros_like(record.responses)) for record in observations.records)
    stretches = transform(replace(observations, records=dead), modal_model, noise, Window(duration_s=1.0))
    assert stretches.n_records >= len(dead)


def record_times(record):
    return record.step_s * np.arange(record.n_samples)


@pytest.mark.parametrize(("pause_s", "moves"), [(4.0, True), (40.0, False)], ids=["soon", "late"])
def test_blows_before_the_structure_rests_start_in_motion(chain, strike, pause_s, moves):
    """How far the modes may move then is what the strongest blow can have left."""
    observations = strike()
    first, *others = observations.records
    n = round(pause_s / first.step_s)
    longer = [
        replace(record, number=2, force=np.resize(record.force, n) * (np.arange(n) < record.n_samples),
                responses=np.pad(record.responses, ((0, 0), (0, n - record.n_samples))))
        for record in others
    ]  # fmt: skip
    struck_on = replace(observations, records=(first, *longer))
    modal_model, noise = make_modal_model(chain.model, struck_on), read_noise(struck_on)
    stretches = transform(struck_on, modal_model, noise, Window(duration_s=1.0))
    assert stretches.moving.tolist() == [False, *[moves] * len(others)]
    assert np.all((stretches.pause_s > 0) == stretches.moving)
    nuisance_prior = make_nuisance_prior(modal_model, stretches, struck_on.band_hz[1], DiagnoseOptions())
    if moves:
        unknown = make_nuisance_prior(
            modal_model, replace(stretches, pause_s=0 * stretches.pause_s), 75.0, DiagnoseOptions()
        )
        fastest, slowest = (nuisance_prior.starts / unknown.starts)[:, [-1, 0]].max(0)
        assert fastest < 0.2 * slowest
        assert slowest < 1.0
