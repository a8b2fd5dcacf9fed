"""Prove the diagnosis on blind cases: make them, seal the answers, diagnose, open, score, and write a page.

``frf-testbench prove`` writes ``results/proof/proof.html`` and ``scores.json``. It goes on where it was stopped;
cases that a changed package has not seen are diagnosed again.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from pathlib import Path

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from frf_testbench.proof.blind import diagnose_all, predict_all, worth_predicting
from frf_testbench.proof.commands import code_digest
from frf_testbench.proof.page import write_page, write_scores
from frf_testbench.proof.plan import FULL, SLICE, Folders, plan_cases
from frf_testbench.proof.scoring import Bar, bars, open_cases
from frf_testbench.proof.sealing import BrokenSealError, check_seal, make_cases

MOST_PREDICTED = 80  # explained cases: each is updated and predicted twice


def run_proof(
    *,
    out: Path | None = None,
    quick: bool = False,
    counts: Mapping[str, int] | None = None,
    seed_shift: int = 0,
    jobs: int = 2,
    points: int = MOST_PREDICTED,
    cases: Path | None = None,
    answers: Path | None = None,
    command: list[str] | None = None,
) -> None:
    """Make blind cases, seal their answers, diagnose, open, score, and write a page.

    Parameters
    ----------
    out : Path, optional
        Folder; ``results/proof`` by default, or ``results`` and the name of `cases`.
    quick : bool
        A slice of a few cases of each group.
    counts : mapping of str to int, optional
        Cases of a group where they are not the usual number.
    seed_shift : int
        Added to all seeds, for a trial on other cases.
    jobs : int
        Cases at the same time.
    points : int
        Explained cases whose points of interest are predicted.
    cases : Path, optional
        Folder of ``case_NN`` folders to score instead of making cases.
    answers : Path, optional
        Folder of their answers ``case_NN.json``; ``truth`` in `cases` by default.
    command : list of str, optional
        What is diagnosed with; the public command by default.
    """
    if cases is not None:
        root = out or Path("results") / cases.resolve().name
        folders, orders = Folders(root, cases, answers or cases / "truth"), []
    else:
        folders = Folders.inside(out or Path("results") / "proof")
        orders = plan_cases({**(SLICE if quick else FULL), **(counts or {})}, shift=seed_shift)
    names = [order.name for order in orders] or sorted(path.stem for path in folders.sealed.glob("case_*.json"))
    engine = {"workers": jobs, "command": command}
    with Progress(TextColumn("{task.description:24}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()) as bar:

        def steps(text: str, total: int) -> Callable[[], None]:
            task = bar.add_task(text, total=total)
            return lambda: bar.advance(task)

        if orders:
            make_cases(orders, folders, workers=jobs, step=steps("making cases", len(names)))
        diagnose_all(names, folders, step=steps("diagnosing", len(names)), **engine)
        explained = [name for name in names if worth_predicting(name, folders)][:points]
        predict_all(explained, folders, step=steps("predicting points", len(explained)), **engine)
    try:
        check_seal(folders, names)
    except BrokenSealError as error:
        sys.exit(f"proof: {error}")
    opened = open_cases(names, folders)
    reached, code = bars(opened), code_digest()
    page = folders.root / "proof.html"
    write_page(page, opened, reached, title="Blind proof of the diagnosis", code=code)
    write_scores(page.with_name("scores.json"), opened, reached, code=code)
    print("\n".join([*map(line, reached), str(page)]))


def line(bar: Bar) -> str:
    """One line of the table on the terminal."""
    count = f"{bar.rate.hits}/{bar.rate.count}" if bar.rate else ""
    word = {True: "reached", False: "MISSED", None: "-"}[bar.passes]
    return f"{bar.group:22}{bar.name:66}{bar.wanted:16}{bar.value:9.3g} {count:9}{word}"
