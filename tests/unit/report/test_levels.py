"""Weak and strong records are drawn side by side, and modes over the level."""

import numpy as np
import pytest

from frf_ipz.report.sections.diagnosis import level_pictures
from synthetic_run import synthetic_folder


@pytest.fixture(scope="module")
def folder():
    return synthetic_folder(diagnosed=True)


def test_weak_and_strong_records_of_every_frf_are_drawn_and_their_difference_stated(folder):
    levels, labels = folder.results["levels"], folder.results["fit"].labels
    curves, _ = level_pictures(levels, labels, (10.0, 100.0))
    assert len(curves.traces) == 2 * len(labels)
    assert [trace["line"]["dash"] for trace in curves.traces[:2]] == ["solid", "dash"]
    assert [trace["meta"]["frf"] for trace in curves.traces] == [0, 0, 1, 1]
    assert max(curves.traces[0]["y"]) == levels.strong[:, 0].max()
    assert "differ by 9.1 % of their norm" in curves.note
    assert curves.is_over_frequency


def test_a_mode_that_falls_with_the_level_is_seen_to_fall_and_the_other_to_stay(folder):
    _, modes = level_pictures(folder.results["levels"], folder.results["fit"].labels, (10.0, 100.0))
    linear, falling = (trace for trace in modes.traces if trace.get("showlegend", True))
    assert list(linear["x"]) == [2.0, 8.0, 30.0]
    np.testing.assert_allclose(linear["y"], 0.0, atol=1e-12)  # per cent, of the same number
    assert (np.diff(falling["y"]) < 0).all()
    assert falling["y"][-1] == 0.0
    assert (falling["error_y"]["array"] > 0).all()
    assert len(modes.table.rows) == 6


def test_one_level_has_no_pictures():
    assert level_pictures(None, (), (1.0, 2.0)) == []
