"""A force law is drawn at work: its force, and a record as measured, with it and without it."""

from dataclasses import replace

import numpy as np
import pytest

from frf_ipz.report.sections.diagnosis import law_pictures
from synthetic_run import synthetic_law


def test_a_record_is_drawn_with_the_law_and_without_it_and_the_misfit_is_stated():
    _, response = law_pictures(synthetic_law())
    assert [trace["name"] for trace in response.traces] == [
        "measured",
        "without the law",
        "with the law",
        "measured minus with the law",
    ]
    assert "50 % of the measured one without the law, of 0.1 % with it" in response.note
    assert "not shown to the fit" in response.title
    assert max(response.traces[3]["y"]) == pytest.approx(1e-3 * max(response.traces[0]["y"]), rel=0.1)


def test_a_few_periods_are_seen_where_the_law_does_most():
    _, response = law_pictures(synthetic_law())
    low, high = response.layout["xaxis"]["range"]
    assert high - low == pytest.approx(12 / 20, rel=0.05)
    assert low == 0.0  # the response is strongest at its start


def test_the_force_is_drawn_over_motion_and_velocity():
    law = synthetic_law()
    force, _ = law_pictures(law)
    over_motion, over_velocity = force.traces
    np.testing.assert_array_equal(over_motion["y"], 1e9 * over_motion["x"] ** 3)
    np.testing.assert_array_equal(over_velocity["x"], law.velocity_m_s)
    assert over_velocity["xaxis"] == "x2"


def test_where_records_start_in_motion_the_force_is_all_there_is():
    assert [picture.name for picture in law_pictures(replace(synthetic_law(), record=""))] == ["law-force"]
    assert law_pictures(None) == []
