"""Compare places: the same, within one node or element, or wrong."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np

from frf_ipz.toml_files import read_text

KEYS = ("nodes", "elements", "springs", "groups", "channels")
EXACT, NEAR, WRONG = "exact", "near", "wrong"
RANKS = {EXACT: 2, NEAR: 1, WRONG: 0}
SAME_LENGTH = 1.001  # of distances: drawn positions have nine digits


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
        return distance <= SAME_LENGTH * max(self._second(a), self._second(b))

    def _second(self, node: int) -> float:
        """Distance to the second nearest node."""
        places = np.array([place for other, place in self.positions.items() if other != node])
        return float(np.sort(np.linalg.norm(places - np.array(self.positions[node]), axis=1))[1])

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
        return Layout(springs={one["id"]: tuple(one["nodes"]) for one in table["lumped"]["spring"]})
    if "beam" in table:
        return Layout(ends={"left": 1, "right": table["beam"]["elements"] + 1})
    lines = read_text(case / table["matrices"]["dofs"]).split()
    rows = [line.split(",") for line in lines[1:]]
    return Layout(positions={int(row[0]): tuple(float(x) for x in row[2:5]) for row in rows})


def compare_places(truth: Mapping[str, Any], said: Mapping[str, Any], layout: Layout) -> str | None:
    """Compare a place with the true one.

    Parameters
    ----------
    truth, said : mapping
        As ``location`` in ``diagnosis.json``. The end of a beam may be named by its side or by its node.
    layout : Layout
        Of the model.

    Returns
    -------
    str, or None
        ``exact``, ``near`` (within one node or element) or ``wrong``; None for an effect without a place.
    """
    if truth.get("end") and not said.get("end"):
        node = layout.ends.get(truth["end"])
        truth = {"nodes": truth.get("nodes") or [node]}
    keys = ["end"] if truth.get("end") else [key for key in KEYS if truth.get(key)]
    return min((_compare(key, truth[key], said.get(key), layout) for key in keys), key=RANKS.get, default=None)


def _compare(key: str, truth: Any, said: Any, layout: Layout) -> str:  # noqa: ANN401 - a list or a name
    if not said:
        return WRONG
    if key == "elements":
        return _stretch(truth, said)
    if key == "end":
        return EXACT if said == truth else WRONG
    if sorted(said) == sorted(truth):
        return EXACT
    close = {"nodes": layout.are_neighbours, "springs": layout.share_a_node}.get(key)
    return NEAR if close and _pair_up(truth, said, close) else WRONG


def _stretch(truth: Sequence[int], said: Sequence[int]) -> str:
    """Compare stretches [first, last] of elements."""
    off = max(abs(said[0] - truth[0]), abs(said[-1] - truth[-1]))
    return EXACT if off == 0 else NEAR if off == 1 else WRONG


def _pair_up(truth: Sequence[Any], said: Sequence[Any], close: Any) -> bool:  # noqa: ANN401 - of nodes or springs
    """Whether each of the one is close to one of the other."""
    return len(truth) == len(said) and any(
        all(close(a, b) for a, b in zip(truth, order, strict=True)) for order in permutations(said)
    )
