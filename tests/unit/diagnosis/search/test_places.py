"""Of many places a coarse set is looked at, and all around the best of them."""

from types import SimpleNamespace

import numpy as np

from frf_ipz.diagnosis.evidence.hypothesis import Component
from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.search.places import PLACES_PER_MODE, search_places
from frf_ipz.diagnosis.search.robust_refinement import Start

ROWS, COLUMNS = 30, 40
MASS, SENSOR = SimpleNamespace(name="added_mass"), SimpleNamespace(name="sensor_misplaced")
NODES = {1 + number: np.array([number % COLUMNS, number // COLUMNS, 0.0]) for number in range(ROWS * COLUMNS)}


def context_of(*, is_schematic=False):
    return SimpleNamespace(positions=NODES, model=SimpleNamespace(geometry=SimpleNamespace(is_schematic=is_schematic)))


def at_all_nodes(effect, locate=lambda node: Location.at_node(node, "z")):
    return [Component(effect=effect, location=locate(node), n_locations=len(NODES)) for node in NODES]


def cost_at(true_node, evaluated):
    """A cost that falls towards one node, with a smaller hollow about another."""

    def evaluate(components):
        evaluated.extend(components)
        starts = []
        for component in components:
            here = NODES[component.location.node]
            near, far = (np.linalg.norm(here - NODES[node]) for node in (true_node, 17))
            cost = -np.exp(-((near / 4) ** 2)) - 0.8 * np.exp(-((far / 6) ** 2))
            starts.append(Start(component=component, values=np.zeros(0), cost=cost))
        return starts

    return evaluate


def test_the_best_of_a_thousand_places_is_found_by_looking_at_a_third_of_them():
    for true_node in (1, 617, 618, 619, 1200):
        evaluated = []
        starts = search_places(context_of(), 16, at_all_nodes(MASS), cost_at(true_node, evaluated))
        assert min(starts, key=lambda start: start.cost).component.location.node == true_node
        assert len(evaluated) == len({component.key for component in evaluated}) < len(NODES) / 3


def test_each_channel_has_its_own_coarse_places():
    components = [
        component
        for channel in ("acc_1", "acc_2")
        for component in at_all_nodes(
            SENSOR, lambda node, channel=channel: Location(channels=(channel,), nodes=(node,))
        )
    ]
    evaluated = []
    search_places(context_of(), 16, components, cost_at(600, evaluated))
    keys = [component.location for component in evaluated]
    assert {location.node for location in keys if location.channel == "acc_1"} == {
        location.node for location in keys if location.channel == "acc_2"
    }
    assert len(keys) > 2 * 16 * PLACES_PER_MODE


def test_all_are_looked_at_where_they_are_few_or_their_positions_mean_nothing():
    for context, n_modes in ((context_of(), len(NODES) // PLACES_PER_MODE), (context_of(is_schematic=True), 1)):
        evaluated = []
        search_places(context, n_modes, at_all_nodes(MASS), cost_at(600, evaluated))
        assert len(evaluated) == len(NODES)
