"""Compare locations: the same, within one node or element, or wrong."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import permutations
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from frf_ipz.input_files import read_text

KEYS = ("nodes", "elements", "springs", "groups", "channels")
EXACT, NEAR, WRONG = "exact", "near", "wrong"
RANKS = {EXACT: 2, NEAR: 1, WRONG: 0}
SAME_LENGTH = 1.001  # of distances: drawn positions have nine digits

Part = TypeVar("Part", int, str)


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """What lies next to what in a model.

    Parameters
    ----------
    positions : mapping of int to tuple
        Of the nodes of a model of kind matrices, m. Empty for others.
    springs : mapping of str to pair of int
        Nodes of each spring of a lumped model.
    ends : mapping of str to int
        Nodes at the ends of a beam.
    """

    positions: Mapping[int, tuple[float, ...]] = field(default_factory=dict)
    springs: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    ends: Mapping[str, int] = field(default_factory=dict)

    def are_neighbours(self, a: int, b: int) -> bool:
        """Whether two nodes are the same or next to each other.

        In a beam their numbers differ by one; in a lumped model a spring joins them; else one of them is no farther
        from the other than its second nearest node.
        """
        if a == b:
            return True
        if self.springs:
            return {a, b} in [set(nodes) for nodes in self.springs.values()]
        if not self.positions:
            return abs(a - b) == 1
        if a not in self.positions or b not in self.positions:
            return False
        distance = float(np.linalg.norm(np.subtract(self.positions[a], self.positions[b])))
        return distance <= SAME_LENGTH * max(self._second_distance(a), self._second_distance(b))

    def _second_distance(self, node: int) -> float:
        """Return the distance to the second nearest node."""
        neighbours = np.array([position for number, position in self.positions.items() if number != node])
        return float(np.sort(np.linalg.norm(neighbours - np.array(self.positions[node]), axis=1))[1])

    def share_a_node(self, a: str, b: str) -> bool:
        """Whether two springs are the same or meet at a node; the ground is none."""
        if a == b:
            return True
        return bool((set(self.springs.get(a, ())) & set(self.springs.get(b, ()))) - {0})


def read_layout(case: Path) -> Layout:
    """Read what lies next to what from the files of a case.

    Parameters
    ----------
    case : Path
        Its folder.

    Returns
    -------
    Layout
        Of its model.
    """
    table = tomllib.loads(read_text(case / "model.toml"))
    if "lumped" in table:
        springs = table["lumped"]["spring"]
        return Layout(springs={spring["id"]: (spring["nodes"][0], spring["nodes"][1]) for spring in springs})
    if "beam" in table:
        return Layout(ends={"left": 1, "right": table["beam"]["elements"] + 1})
    lines = read_text(case / table["matrices"]["dofs"]).split()
    rows = [line.split(",") for line in lines[1:]]
    return Layout(positions={int(row[0]): tuple(float(x) for x in row[2:5]) for row in rows})


def compare_locations(truth: Mapping[str, Any], statement: Mapping[str, Any], layout: Layout) -> str | None:
    """Compare a location with the true one.

    Parameters
    ----------
    truth, statement : mapping
        As ``location`` in ``diagnosis.json``. The end of a beam may be named by its side or by its node.
    layout : Layout
        Of the model.

    Returns
    -------
    str, or None
        ``exact``, ``near`` (within one node or element) or ``wrong``; None for an effect without a location.
    """
    if truth.get("end") and not statement.get("end"):
        node = layout.ends.get(truth["end"])
        truth = {"nodes": truth.get("nodes") or [node]}
    keys = ["end"] if truth.get("end") else [key for key in KEYS if truth.get(key)]
    matches = [_compare(key, truth[key], statement.get(key), layout) for key in keys]
    return min(matches, key=RANKS.__getitem__, default=None)


def _compare(key: str, truth: Any, statement: Any, layout: Layout) -> str:  # noqa: ANN401 - a list or a name
    if not statement:
        return WRONG
    if key == "elements":
        return _compare_segments(truth, statement)
    if key == "end":
        return EXACT if statement == truth else WRONG
    if sorted(statement) == sorted(truth):
        return EXACT
    is_near = (key == "nodes" and _are_paired(truth, statement, layout.are_neighbours)) or (
        key == "springs" and _are_paired(truth, statement, layout.share_a_node)
    )
    return NEAR if is_near else WRONG


def _compare_segments(truth: Sequence[int], statement: Sequence[int]) -> str:
    """Compare segments [first, last] of elements."""
    distance = max(abs(statement[0] - truth[0]), abs(statement[-1] - truth[-1]))
    return EXACT if distance == 0 else NEAR if distance == 1 else WRONG


def _are_paired(truth: Sequence[Part], statement: Sequence[Part], is_close: Callable[[Part, Part], bool]) -> bool:
    """Whether each true part, a node or a spring, is close to a different one of the stated parts."""
    return len(truth) == len(statement) and any(
        all(is_close(a, b) for a, b in zip(truth, order, strict=True)) for order in permutations(statement)
    )
