"""Which blind cases are made, and where everything lies. Seeds are fixed here, before anything is diagnosed."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from frf_testbench.simulator.effects.catalogue import CATALOGUE, NONLINEAR, OUT_OF_CATALOGUE

FULL = {"linear": 200, "null": 100, "nonlinear": 60, "pair": 60, "unknown": 60}
QUICK = {"linear": 8, "null": 4, "nonlinear": 3, "pair": 2, "unknown": 3}
FIRST_SEEDS = {
    "linear": 161_000_000, "null": 162_000_000, "nonlinear": 163_000_000, "pair": 164_000_000, "unknown": 165_000_000,
}  # fmt: skip
ORDER_SEED = 60  # of the order in which the effects of a group take turns


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """One case to be made.

    Parameters
    ----------
    name : str
        Of its folder: it says nothing about the effect.
    group : str
        One of `FULL`.
    effect : str
        As the simulator calls it.
    seed : int
        Of the simulator.
    """

    name: str
    group: str
    effect: str
    seed: int


@dataclass(frozen=True, slots=True)
class Folders:
    """Where a proof lies.

    Parameters
    ----------
    root : Path
        Its folder.
    cases : Path
        What a user hands in: all that the diagnosis reads.
    sealed : Path
        The answers, which only the scoring reads.
    """

    root: Path
    cases: Path
    sealed: Path

    @classmethod
    def inside(cls, root: Path) -> Folders:
        """Folders of a proof with cases of its own."""
        return cls(root, root / "cases", root / "sealed")

    @property
    def diagnosed(self) -> Path:
        """Return the folder of the runs of the diagnosis."""
        return self.root / "diagnosed"

    @property
    def predicted(self) -> Path:
        """Return the folder of the predictions at points of interest."""
        return self.root / "predicted"


def list_effects(group: str) -> list[str]:
    """List the effects of a group in the order in which they take turns: the same for a slice and for all."""
    effects = {
        "linear": [name for name in CATALOGUE if name not in NONLINEAR],
        "null": ["null"],
        "nonlinear": [name for name in CATALOGUE if name in NONLINEAR],
        "pair": ["pair"],
        "unknown": [f"unknown:{kind}" for kind in OUT_OF_CATALOGUE],
    }[group]
    return [effects[i] for i in np.random.default_rng(ORDER_SEED).permutation(len(effects))]


def plan_cases(counts: dict[str, int], *, shift: int = 0) -> list[Order]:
    """List the cases of a proof.

    Parameters
    ----------
    counts : dict of str to int
        How many of each group. The first ones of a group are the same, however many there are.

    shift : int
        Added to all seeds: for a trial on other cases than those of the proof.

    Returns
    -------
    list of Order
        By name, so that groups are mixed.
    """
    orders = []
    for group, count in counts.items():
        effects = list_effects(group)
        for i in range(count):
            name = "case_" + hashlib.blake2s(f"{group} {i}".encode(), digest_size=5).hexdigest()
            seed = FIRST_SEEDS[group] + shift + i
            orders.append(Order(name=name, group=group, effect=effects[i % len(effects)], seed=seed))
    return sorted(orders, key=lambda order: order.name)
