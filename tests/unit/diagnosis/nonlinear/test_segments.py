"""Segments of records, and how they start."""

from dataclasses import replace

import numpy as np
import pytest

from frf_ipz.diagnosis.nonlinear.channel_noise import read_noise
from frf_ipz.diagnosis.nonlinear.model.modal_model import make_modal_model
from frf_ipz.diagnosis.nonlinear.model.nuisance_prior import make_nuisance_prior
from frf_ipz.diagnosis.nonlinear.segments import SegmentWindow, cut_segments
from frf_ipz.diagnosis.options import DiagnoseOptions


def test_excluded_lines_are_not_fitted(chain, strike):
    observations = replace(strike(), exclude_hz=((30.0, 40.0),))
    window = SegmentWindow(duration_s=1.0)
    segments = cut_segments(observations, make_modal_model(chain.model, observations), read_noise(observations), window)
    used_hz = segments.s.imag[segments.used] / (2 * np.pi)
    width_hz = segments.sigma_1_s / (2 * np.pi)
    assert used_hz.min() < 10.0
    assert used_hz.max() > 70.0
    assert not np.any((used_hz > 30.0 - width_hz) & (used_hz < 40.0 + width_hz))


@pytest.mark.parametrize(("loud_s", "expected"), [(2.0, [False, True]), (0.1, [False])], ids=["late", "early"])
def test_a_segment_starts_where_a_record_is_loudest(chain, strike, random_records, loud_s, expected):
    observations = random_records(strike(), loud_s)
    modal_model, noise = make_modal_model(chain.model, observations), read_noise(observations)
    segments = cut_segments(observations, modal_model, noise, SegmentWindow(duration_s=1.0))
    assert segments.moving.tolist() == 2 * expected
    for start in segments.first_sample[segments.moving] * segments.step_s:
        assert start < loud_s < start + 0.3  # the early part of a segment counts most


def test_a_record_has_one_segment_where_that_is_enough(chain, strike, random_records):
    observations = random_records(strike(), 2.0)
    modal_model, noise = make_modal_model(chain.model, observations), read_noise(observations)
    assert not cut_segments(observations, modal_model, noise, SegmentWindow(duration_s=1.0, loudest=False)).moving.any()


def test_noise_of_the_force_is_a_larger_part_of_a_weak_impact(chain, strike):
    """It is the same in all impacts, and the responses follow the force."""
    observations = strike()
    modal_model, quiet = make_modal_model(chain.model, observations), read_noise(observations)
    loud = replace(quiet, force=replace(quiet.force, white=1e4 * max(quiet.force.white, 1e-12)))
    added = [
        cut_segments(observations, modal_model, noise, SegmentWindow(duration_s=1.0)).noise for noise in (loud, quiet)
    ]
    segments = cut_segments(observations, modal_model, quiet, SegmentWindow(duration_s=1.0))
    part = ((added[0] - added[1]).mean(1) / np.mean(np.abs(segments.motion) ** 2, 1))[:, segments.used].mean(1)
    peaks = np.abs(segments.fine_force).max(1)
    assert np.all(np.diff(part[np.argsort(peaks)]) < 0)
    assert part.max() > 10 * part.min()


def test_a_sensor_that_no_record_has_is_known_with_no_certainty(chain, strike):
    """One impact is looked at, in which a channel was overloaded; others have it."""
    whole = strike()
    modal_model, first = make_modal_model(chain.model, whole), whole.records[0]
    without = replace(first, sensors=first.sensors[:1], responses=first.responses[:1])
    alone = replace(whole, records=(without,))
    segments = cut_segments(alone, modal_model, read_noise(alone), SegmentWindow(duration_s=1.0))
    assert np.isfinite(segments.variance[:, 0]).all()
    assert np.isinf(segments.variance[:, 1]).all()


def test_no_segment_starts_where_the_motion_has_decayed(chain, strike, random_records):
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
    segments = cut_segments(replace(observations, records=cut), modal_model, noise, SegmentWindow(duration_s=1.0))
    assert segments.moving.all()
    assert np.max(segments.first_sample * segments.step_s) < stop_s


def test_a_record_without_motion_has_a_segment_too(chain, strike, random_records):
    observations = random_records(strike(), 0.5)
    modal_model, noise = make_modal_model(chain.model, observations), read_noise(observations)
    dead = tuple(replace(record, responses=np.zeros_like(record.responses)) for record in observations.records)
    segments = cut_segments(replace(observations, records=dead), modal_model, noise, SegmentWindow(duration_s=1.0))
    assert segments.n_segments >= len(dead)


def record_times(record):
    return record.step_s * np.arange(record.n_samples)


@pytest.mark.parametrize(("pause_s", "moves"), [(4.0, True), (40.0, False)], ids=["soon", "late"])
def test_impacts_before_the_structure_rests_start_in_motion(chain, strike, pause_s, moves):
    """The prior of their initial state is the motion by the strongest impact that remains."""
    observations = strike()
    first, *later = observations.records
    n = round(pause_s / first.step_s)
    longer = [
        replace(record, number=2, force=np.resize(record.force, n) * (np.arange(n) < record.n_samples),
                responses=np.pad(record.responses, ((0, 0), (0, n - record.n_samples))))
        for record in later
    ]  # fmt: skip
    successive = replace(observations, records=(first, *longer))
    modal_model, noise = make_modal_model(chain.model, successive), read_noise(successive)
    segments = cut_segments(successive, modal_model, noise, SegmentWindow(duration_s=1.0))
    assert segments.moving.tolist() == [False, *[moves] * len(later)]
    assert np.all((segments.pause_s > 0) == segments.moving)
    nuisance_prior = make_nuisance_prior(modal_model, segments, successive.band_hz[1], DiagnoseOptions())
    if moves:
        unknown = make_nuisance_prior(
            modal_model, replace(segments, pause_s=0 * segments.pause_s), 75.0, DiagnoseOptions()
        )
        fastest, slowest = (nuisance_prior.initial_states / unknown.initial_states)[:, [-1, 0]].max(0)
        assert fastest < 0.2 * slowest
        assert slowest < 1.0
