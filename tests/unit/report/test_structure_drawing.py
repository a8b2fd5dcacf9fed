"""The drawing shows every mark where it belongs."""

import numpy as np
import pytest

from frf_ipz.dofs import parse_dof
from frf_ipz.report.structure_drawing import Marks, draw_structure
from frf_ipz.structure import Geometry

MARKS = Marks(
    sensors=(parse_dof("3:+z"),), blows=(parse_dof("2:-z"),), points=(parse_dof("1:+z"),), missing={2: "added mass"}
)


@pytest.fixture
def frame():
    return Geometry(
        nodes=np.array([1, 2, 3]),
        coordinates_m=np.array([[0.0, 0, 0], [1.0, 0, 0], [1.0, 0, 2.0]]),
        lines=np.array([[1, 2], [2, 3]]),
        supports={1: "clamped"},
    )


def trace(picture, name):
    return next(one for one in picture.traces if one["name"] == name)


@pytest.mark.parametrize(
    ("name", "place"), [("sensor", (1, 2)), ("blow", (1, 0)), ("point of interest", (0, 0)), ("support", (0, 0))]
)
def test_marks_stand_at_their_nodes(frame, name, place):
    found = trace(draw_structure(frame, MARKS), name)
    assert (found["x"][0], found["y"][0]) == place


def test_what_is_missing_is_ringed_and_named(frame):
    found = trace(draw_structure(frame, MARKS), "missing in the model")
    assert (found["x"][0], found["y"][0]) == (1, 0)
    assert found["text"] == ["added mass"]


def test_lines_join_the_nodes_they_name(frame):
    body = trace(draw_structure(frame, MARKS), "structure")
    np.testing.assert_array_equal(body["x"], [0, 1, np.nan, 1, 1, np.nan])
    np.testing.assert_array_equal(body["y"], [0, 0, np.nan, 0, 2, np.nan])


def test_a_beam_is_drawn_as_a_line_with_its_positions(frame):
    beam = Geometry(
        nodes=frame.nodes, coordinates_m=np.eye(3) * 0 + [[0, 0, 0], [0.5, 0, 0], [1.5, 0, 0]], lines=frame.lines
    )
    picture = draw_structure(beam, MARKS)
    assert picture.layout["xaxis"]["title"]["text"] == "Position, m"
    assert trace(picture, "sensor")["x"][0] == 1.5


def test_without_a_model_nodes_stand_in_a_row():
    picture = draw_structure(None, MARKS)
    assert trace(picture, "sensor")["x"][0] == 3
    assert "by their numbers" in picture.note


def test_without_anything_nothing_is_drawn():
    assert draw_structure(None, Marks()) is None


def test_the_drawing_is_told_in_words(frame):
    alt = draw_structure(frame, MARKS).alt
    for words in ("3 nodes", "node 1 clamped", "sensors at 3:+z", "blows at 2:-z", "added mass at node 2"):
        assert words in alt
