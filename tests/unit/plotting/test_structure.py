"""The drawing shows every mark where it belongs."""

import numpy as np
import pytest

from frf_ipz.dofs import PortDof, parse_dof
from frf_ipz.plotting.picture import Labels, Points
from frf_ipz.plotting.structure import StructureMarks, describe_structure
from frf_ipz.structure import Geometry

MARKS = StructureMarks(
    sensors=(parse_dof("3:+z"),), inputs=(parse_dof("2:-z"),), points=(parse_dof("1:+z"),), missing={2: "added mass"}
)


@pytest.fixture
def frame():
    return Geometry(
        nodes=np.array([1, 2, 3]),
        coordinates_m=np.array([[0.0, 0, 0], [1.0, 0, 0], [1.0, 0, 2.0]]),
        lines=np.array([[1, 2], [2, 3]]),
        supports={1: "clamped"},
    )


def layer(picture, name):
    return next(layer for layer in picture.layers if layer.name == name)


@pytest.mark.parametrize(
    ("name", "position"), [("sensor", (1, 2)), ("input", (1, 0)), ("point of interest", (0, 0)), ("support", (0, 0))]
)
def test_marks_stand_at_their_nodes(frame, name, position):
    mark = layer(describe_structure(frame, MARKS), name)
    assert (mark.x[0], mark.y[0]) == position


def test_what_is_missing_is_ringed_and_named(frame):
    mark = layer(describe_structure(frame, MARKS), "missing in the model")
    assert (mark.x[0], mark.y[0]) == (1, 0)
    assert mark.texts == ["added mass"]


def test_lines_join_the_nodes_they_name(frame):
    body = layer(describe_structure(frame, MARKS), "structure")
    np.testing.assert_array_equal(body.x, [0, 1, np.nan, 1, 1, np.nan])
    np.testing.assert_array_equal(body.y, [0, 0, np.nan, 0, 2, np.nan])


def test_a_beam_is_drawn_as_a_line_with_its_positions(frame):
    beam = Geometry(
        nodes=frame.nodes, coordinates_m=np.eye(3) * 0 + [[0, 0, 0], [0.5, 0, 0], [1.5, 0, 0]], lines=frame.lines
    )
    picture = describe_structure(beam, MARKS)
    assert picture.x.title == "Position, m"
    assert layer(picture, "sensor").x[0] == 1.5


def test_without_a_model_nodes_stand_in_a_row():
    picture = describe_structure(None, MARKS)
    assert layer(picture, "sensor").x[0] == 3
    assert "by their numbers" in picture.note


def test_without_anything_nothing_is_drawn():
    assert describe_structure(None, StructureMarks()) is None


def test_the_drawing_is_described_in_words(frame):
    alt = describe_structure(frame, MARKS).alt
    for words in ("3 nodes", "node 1 clamped", "sensors at 3:+z", "inputs at 2:-z", "added mass at node 2"):
        assert words in alt


@pytest.mark.parametrize(
    ("nodes", "labels"),
    [
        ((1, 50), ["1:+z", "50:+z"]),
        ((1, 49, 50), ["1:+z", "49:+z 50:+z"]),
        ((41, 42, 43, 44, 45, 46), ["41:+z … 46:+z"]),
    ],
)
def test_labels_that_would_cover_each_other_are_written_side_by_side(nodes, labels):
    along = np.zeros((100, 3))
    along[:, 0] = np.linspace(0, 1, 100)
    beam = Geometry(
        nodes=np.arange(1, 101), coordinates_m=along, lines=np.stack([np.arange(1, 100), np.arange(2, 101)], 1)
    )
    picture = describe_structure(beam, StructureMarks(sensors=tuple(parse_dof(f"{node}:+z") for node in nodes)))
    words = next(layer for layer in picture.layers if isinstance(layer, Labels))
    assert list(words.texts) == labels
    joined = [node for node in nodes if str(node) in labels[-1]]
    np.testing.assert_allclose(words.x[-1], (along[nodes[-1] - 1, 0] + along[joined[0] - 1, 0]) / 2, rtol=1e-12, atol=0)


def test_a_port_stands_amid_the_nodes_that_it_joins():
    plate = Geometry(
        nodes=np.array([1, 2, 3, 4]),
        coordinates_m=np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]),
        lines=np.array([[1, 2], [2, 3], [3, 4], [4, 1]]),
        ports={"tilt": (1, 3)},
    )
    picture = describe_structure(plate, StructureMarks(points=(PortDof("tilt"),)))
    (port,) = [one for one in picture.layers if one.name == "point of interest: port" and isinstance(one, Points)]
    body = layer(describe_structure(plate, StructureMarks()), "nodes")
    np.testing.assert_allclose([port.x[0], port.y[0]], [np.mean(body.x[[0, 2]]), np.mean(body.y[[0, 2]])])
    assert port.texts == ["tilt"]
