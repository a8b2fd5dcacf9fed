"""Prove the diagnosis on blind cases: make them, seal the answers, diagnose, open, score, and write a page.

``frf-testbench prove`` writes ``proof.html``, ``scores.json`` and ``validation.md`` into ``results/proof``. It goes on
where it was stopped; cases that a changed package has not seen are diagnosed again.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from pathlib import Path

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from frf_testbench.proof.blind_runs import diagnose_all, is_worth_predicting, predict_all
from frf_testbench.proof.commands import compute_code_digest
from frf_testbench.proof.page import write_page, write_scores
from frf_testbench.proof.plan import FULL, QUICK, Folders, Order, plan_cases
from frf_testbench.proof.scoring import Bar, open_cases, score_bars
from frf_testbench.proof.sealing import BrokenSealError, check_seal, make_cases
from frf_testbench.proof.validation import write_validation

TITLE = "Blind proof of the diagnosis"
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
        A few cases of each group.
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
    orders: list[Order] = []
    if cases is not None:
        root = out or Path("results") / cases.resolve().name
        folders = Folders(root, cases, answers or cases / "truth")
    else:
        folders = Folders.inside(out or Path("results") / "proof")
        orders = plan_cases({**(QUICK if quick else FULL), **(counts or {})}, shift=seed_shift)
    names = [order.name for order in orders] or sorted(path.stem for path in folders.sealed.glob("case_*.json"))
    with Progress(TextColumn("{task.description:24}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()) as bar:

        def count_steps(text: str, total: int) -> Callable[[], None]:
            task = bar.add_task(text, total=total)
            return lambda: bar.advance(task)

        if orders:
            make_cases(orders, folders, workers=jobs, step=count_steps("making cases", len(names)))
        step = count_steps("diagnosing", len(names))
        diagnose_all(names, folders, workers=jobs, command=command, step=step)
        explained = [name for name in names if is_worth_predicting(name, folders)][:points]
        step = count_steps("predicting points", len(explained))
        predict_all(explained, folders, workers=jobs, command=command, step=step)
    try:
        check_seal(folders, names)
    except BrokenSealError as error:
        sys.exit(f"proof: {error}")
    scored_cases = open_cases(names, folders)
    bars, code = score_bars(scored_cases), compute_code_digest()
    page, scores = folders.root / "proof.html", folders.root / "scores.json"
    write_page(page, scored_cases, bars, title=TITLE, code=code)
    write_scores(scores, scored_cases, bars, title=TITLE, code=code)
    write_validation([scores], folders.root / "validation.md")
    print("\n".join([*map(format_line, bars), str(page)]))


def format_line(bar: Bar) -> str:
    """Format one line of the table on the terminal."""
    count = f"{bar.rate.hits}/{bar.rate.count}" if bar.rate else ""
    word = {True: "reached", False: "MISSED", None: "-"}[bar.passes]
    return f"{bar.group:22}{bar.name:80}{bar.requirement:16}{bar.value:9.3g} {count:9}{word}"
