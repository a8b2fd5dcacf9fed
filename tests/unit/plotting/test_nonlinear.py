"""A force law is drawn at work, weak and strong records side by side, and modes over the level."""

from dataclasses import replace

import numpy as np
import pytest

from frf_ipz.plotting.nonlinear import (
    describe_law_force,
    describe_law_response,
    describe_level_modes,
    describe_levels,
)
from synthetic_run import synthetic_folder, synthetic_law


@pytest.fixture(scope="module")
def folder():
    return synthetic_folder(diagnosed=True)


def test_a_record_is_drawn_with_the_law_and_without_it_and_the_misfit_is_stated():
    response = describe_law_response(synthetic_law())
    assert [layer.name for layer in response.layers] == [
        "measured",
        "without the law",
        "with the law",
        "measured minus with the law",
    ]
    assert "50 % of the measured one without the law, of 0.1 % with it" in response.note
    assert "not shown to the fit" in response.title
    measured, misfit = response.layers[0], response.layers[3]
    assert max(misfit.y) == pytest.approx(1e-3 * max(measured.y), rel=0.1)


def test_a_few_periods_are_seen_where_the_law_does_most():
    low, high = describe_law_response(synthetic_law()).x.limits
    assert high - low == pytest.approx(12 / 20, rel=0.05)
    assert low == 0.0  # the response is strongest at its start


def test_the_force_is_drawn_over_motion_and_velocity():
    law = synthetic_law()
    left, right = describe_law_force(law).panels
    (over_motion,), (over_velocity,) = left.layers, right.layers
    np.testing.assert_array_equal(over_motion.y, 1e9 * over_motion.x**3)
    np.testing.assert_array_equal(over_velocity.x, law.velocity_m_s)
    assert (left.x.title, right.x.title) == ("Motion, m", "Velocity, m/s")


def test_where_records_start_in_motion_the_force_is_all_there_is():
    assert describe_law_response(replace(synthetic_law(), record="")) is None


def test_weak_and_strong_records_of_every_frf_are_drawn_and_their_difference_stated(folder):
    levels, labels = folder.results["levels"], folder.results["fit"].labels
    picture = describe_levels(levels, labels, band_hz=(10.0, 100.0))
    assert len(picture.layers) == 2 * len(labels)
    assert [layer.dash for layer in picture.layers[:2]] == ["solid", "dash"]
    assert [layer.frf for layer in picture.layers] == [0, 0, 1, 1]
    assert max(picture.layers[0].y) == levels.strong[:, 0].max()
    assert "differ by 9.1 % of their norm" in picture.note
    assert picture.is_over_frequency
    assert len({layer.name for layer in picture.layers}) == len(picture.layers)


def test_a_mode_that_falls_with_the_level_is_seen_to_fall_and_the_other_to_stay(folder):
    linear, falling = describe_level_modes(folder.results["levels"]).panels[0].layers
    assert list(linear.x) == [2.0, 8.0, 30.0]
    np.testing.assert_allclose(linear.y, 0.0, atol=1e-12)  # per cent, of the same number
    assert (np.diff(falling.y) < 0).all()
    assert falling.y[-1] == 0.0
    assert (falling.deviation > 0).all()


def test_one_level_has_no_pictures(folder):
    levels = replace(folder.results["levels"], labels=(), modes=folder.results["levels"].modes.iloc[:0])
    assert describe_levels(levels) is None
    assert describe_level_modes(levels) is None
