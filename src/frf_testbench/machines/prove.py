"""Prove the diagnosis on blind machines: make them, seal the answers, diagnose, open, and score.

``frf-testbench machines`` writes ``scores.csv`` into its folder, one row a machine. It goes on where it was stopped.
"""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from frf_testbench.machines.concealed import EFFECTS
from frf_testbench.machines.machine import make_machine
from frf_testbench.proof.blind_runs import diagnose_all
from frf_testbench.proof.locations import WRONG
from frf_testbench.proof.plan import Folders
from frf_testbench.proof.rates import Rate
from frf_testbench.proof.scoring import ScoredCase, open_cases
from frf_testbench.proof.sealing import check_seal, is_made, seal

SOUND_EVERY = 3  # machines: one of them is sound


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineOrder:
    """A machine to be made.

    Parameters
    ----------
    name : str
        Of its folder: it says nothing about the effect.
    effect : str
        ``null``, or one of `EFFECTS`.
    seed : int
        Of the machine.
    """

    name: str
    effect: str
    seed: int


def plan_machines(first_seed: int, count: int) -> list[MachineOrder]:
    """List the machines of a proof: every third one is sound, and the others conceal one effect after the other.

    Parameters
    ----------
    first_seed : int
        Of the first one.
    count : int
        Of all.

    Returns
    -------
    list of MachineOrder
        By name, so that effects are mixed.
    """
    effects, changed = list(EFFECTS), 0
    orders = []
    for seed in range(first_seed, first_seed + count):
        is_sound = (seed - first_seed) % SOUND_EVERY == SOUND_EVERY - 1
        effect = "null" if is_sound else effects[changed % len(effects)]
        changed += not is_sound
        name = "case_" + hashlib.blake2s(f"machine {seed}".encode(), digest_size=5).hexdigest()
        orders.append(MachineOrder(name=name, effect=effect, seed=seed))
    return sorted(orders, key=lambda order: order.name)


def prove_machines(
    folder: Path,
    *,
    first_seed: int,
    count: int,
    jobs: int = 1,
    command: list[str] | None = None,
    step: Callable[[str], None] = print,
) -> pd.DataFrame:
    """Make machines, seal their answers, diagnose, open, and score.

    Parameters
    ----------
    folder : Path
        Where everything is kept; what is there is not made again.
    first_seed, count : int
        As for `plan_machines`.
    jobs : int
        Machines that are diagnosed at the same time.
    command : list of str, optional
        What is diagnosed with; the public command by default.
    step : callable
        Receives a line for each machine that is made.

    Returns
    -------
    DataFrame
        One row a machine: ``name, seed, kind, effect, verdict, stated, probability, named, location, stage_s, cpu_s,
        fault``.

    Raises
    ------
    BrokenSealError
        If an answer is not what was sealed.
    """
    folders, orders = Folders.inside(folder), plan_machines(first_seed, count)
    for order in orders:
        if not is_made(order.name, folders):
            unfinished = folders.cases / f".{order.name}"
            shutil.rmtree(unfinished, ignore_errors=True)
            make_machine(order.seed, order.effect).write(unfinished, folders.sealed / f"{order.name}.json")
            unfinished.rename(folders.cases / order.name)
            step(f"made {order.name}")
    names = [order.name for order in orders]
    seal(folders, names)
    diagnose_all(names, folders, workers=jobs, step=lambda: None, command=command)
    check_seal(folders, names)
    table = pd.DataFrame([_describe(case) for case in open_cases(names, folders)])
    table.insert(3, "asked", [order.effect for order in orders])
    return table


def _describe(case: ScoredCase) -> dict[str, object]:
    judged = case.judgement
    return {
        "name": judged.name,
        "seed": judged.seed,
        "kind": judged.structure,
        "effect": judged.true_label,
        "verdict": judged.verdict,
        "stated": judged.stated_label,
        "probability": judged.probability,
        "named": judged.is_right,
        "location": judged.location_match,
        "stage_s": case.stage_s,
        "cpu_s": None if case.outcome is None else case.outcome.cpu_s,
        "fault": case.fault,
    }


def summarise_machines(table: pd.DataFrame) -> pd.DataFrame:
    """Count what machines are asked for.

    Parameters
    ----------
    table : DataFrame
        As `prove_machines` gives it.

    Returns
    -------
    DataFrame
        One row a question: ``question, count, of, low, high``, with the 95 % interval of the rate.
    """
    sound = table["effect"] == "nothing"
    named = table["named"] & ~sound
    located = named & table["location"].notna()
    placed = located & (table["location"] != WRONG)
    questions = [
        ("effects named", named.sum(), (~sound).sum()),
        ("named effects placed, node or neighbour", placed.sum(), located.sum()),
        ("sound machines called otherwise", (table["verdict"] != "consistent")[sound].sum(), sound.sum()),
    ]
    rates = [(question, Rate(hits=int(hits), count=int(total))) for question, hits, total in questions]
    return pd.DataFrame(
        [
            {"question": question, "count": rate.hits, "of": rate.count, "low": low, "high": high}
            for question, rate in rates
            for low, high in [rate.interval]
        ]
    )
