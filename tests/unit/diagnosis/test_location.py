"""Where something sits, as one value."""

import json

import pytest

from frf_ipz.diagnosis.location import Location
from frf_ipz.dofs import Dof

JOINT = Location(end="left", nodes=(1,), directions=("ry",))
SENSOR = Location(channels=("acc_1",), nodes=(3, 4), directions=("z",))


@pytest.mark.parametrize(
    ("location", "text"),
    [
        (Location(elements=(4, 4)), "element 4"),
        (Location(elements=(4, 9)), "elements 4 to 9"),
        (Location(end="left", nodes=(1,)), "end left; node 1"),
        (Location(springs=("left", "tip")), "springs left, tip"),
        (Location(), ""),
    ],
)
def test_one_is_named_as_one(location, text):
    assert location.text == text


def test_as_a_mapping_it_is_what_the_contract_says_of_it():
    assert json.dumps(dict(JOINT)) == '{"end": "left", "nodes": [1]}'
    assert list(SENSOR) == ["channels", "nodes"]
    assert SENSOR["nodes"] == [3, 4]
    assert SENSOR.get("form") is None
    assert not Location(form="causal")


def test_it_equals_a_mapping_by_its_entries_and_another_location_by_all_that_distinguishes_them():
    assert JOINT == {"end": "left", "nodes": [1]}
    assert JOINT != {"nodes": [1]}
    assert Location.at_node(1, "x") != Location.at_node(1, "y")
    assert len({Location.at_node(1, "x"), Location.at_node(1, "x"), Location.at_node(1, "y")}) == 2


def test_its_words():
    assert (SENSOR.text, SENSOR.words) == ("channel acc_1; nodes 3, 4", "channel acc_1 and nodes 3, 4")
    assert repr(Location.on_channel("a", sign=-1)) == "Location(channels=('a',), sign=-1)"
    assert Location.at_node(7, "z").dof == Dof(7, "z")


def test_its_order_is_that_of_nodes():
    locations = [Location.at_node(node, "z") for node in (10, 9, 2)]
    assert [location.node for location in sorted(locations)] == [2, 9, 10]


@pytest.mark.parametrize(
    ("first", "second", "is_near"),
    [
        (Location.at_node(5, "z"), Location.at_node(7, "z"), True),
        (Location.at_node(5, "z"), Location.at_node(8, "z"), False),
        (Location.at_node(5, "z"), Location.at_node(6, "y"), False),
        (Location.at_node(5, "z"), Location(nodes=(5, 6), directions=("z",)), False),
        (Location(nodes=(5, 9)), Location(nodes=(5, 12)), False),
        (Location(elements=(5, 9)), Location(elements=(4, 11)), True),
        (Location(springs=("k1",)), Location(springs=("k2",)), False),
        (Location.on_channel("a"), Location.on_channel("a", sign=-1), True),
        (Location.on_channel("a", form="highpass"), Location.on_channel("a", form="lowpass"), False),
    ],
)
def test_what_lies_near_it(first, second, is_near):
    assert first.is_near(second, 2) == second.is_near(first, 2) == is_near
