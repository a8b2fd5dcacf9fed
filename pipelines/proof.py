"""Prove the diagnosis on blind cases: make them, seal the answers, diagnose, open, score, and write a page.

``python pipelines/proof.py`` writes ``results/proof/proof.html`` and ``scores.json``. It goes on where it was stopped;
cases that a changed package has not seen are diagnosed again. ``--quick`` does a slice; ``--cases FOLDER`` scores
``case_NN`` folders with their answers in ``truth/`` instead of making cases.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from proof_tools.blind import diagnose_all, predict_all, worth_predicting
from proof_tools.commands import code_digest
from proof_tools.page import write_page, write_scores
from proof_tools.plan import FULL, SLICE, Folders, Order, plan_cases
from proof_tools.scoring import Bar, bars, open_cases
from proof_tools.sealing import BrokenSealError, check_seal, make_cases

MOST_PREDICTED = 80  # explained cases: each is updated and predicted twice


def main(arguments: list[str] | None = None, *, command: list[str] | None = None) -> None:
    options = read_arguments(arguments)
    folders, orders = choose_cases(options)
    names = [order.name for order in orders] or sorted(path.stem for path in folders.sealed.glob("case_*.json"))
    both = {"workers": options.jobs, "command": command}
    with Progress(TextColumn("{task.description:24}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()) as bar:

        def steps(text: str, total: int) -> Callable[[], None]:
            task = bar.add_task(text, total=total)
            return lambda: bar.advance(task)

        if orders:
            make_cases(orders, folders, workers=options.jobs, step=steps("making cases", len(names)))
        diagnose_all(names, folders, step=steps("diagnosing", len(names)), **both)
        told = [name for name in names if worth_predicting(name, folders)][: options.points]
        predict_all(told, folders, step=steps("predicting points", len(told)), **both)
    try:
        check_seal(folders, names)
    except BrokenSealError as error:
        sys.exit(f"proof: {error}")
    cases = open_cases(names, folders)
    reached, code = bars(cases), code_digest()
    page = folders.root / "proof.html"
    write_page(page, cases, reached, title="Blind proof of the diagnosis", code=code)
    write_scores(page.with_name("scores.json"), cases, reached, code=code)
    print("\n".join([*map(line, reached), str(page)]))


def choose_cases(options: argparse.Namespace) -> tuple[Folders, list[Order]]:
    """Give the folders, and what is to be made: nothing where the cases are there already."""
    if options.cases:
        root = options.out or Path("results") / options.cases.resolve().name
        return Folders(root, options.cases, options.answers or options.cases / "truth"), []
    usual = SLICE if options.quick else FULL
    counts = {group: usual[group] if (n := getattr(options, group)) is None else n for group in FULL}
    return Folders.inside(options.out or Path("results") / "proof"), plan_cases(counts, shift=options.other_seeds)


def line(bar: Bar) -> str:
    """One line of the table on the terminal."""
    count = f"{bar.rate.hits}/{bar.rate.count}" if bar.rate else ""
    word = {True: "reached", False: "MISSED", None: "-"}[bar.passes]
    return f"{bar.group:22}{bar.name:66}{bar.wanted:16}{bar.value:9.3g} {count:9}{word}"


def read_arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Prove the diagnosis on blind cases.")
    parser.add_argument("--out", type=Path, help="folder (default: results/proof, or results/practice)")
    parser.add_argument("--quick", action="store_true", help=f"a slice: {SLICE}")
    for group, count in FULL.items():
        parser.add_argument(f"--{group}", type=int, metavar="N", help=f"cases of this group (default: {count})")
    parser.add_argument("--other-seeds", type=int, default=0, metavar="N", help="added to all seeds, for a trial")
    parser.add_argument("--jobs", type=int, default=2, help="cases at the same time (default: 2)")
    parser.add_argument(
        "--points",
        type=int,
        default=MOST_PREDICTED,
        metavar="N",
        help=f"explained cases whose points of interest are predicted (default: {MOST_PREDICTED})",
    )
    parser.add_argument("--cases", type=Path, help="folder of case_NN folders to score instead of making cases")
    parser.add_argument("--answers", type=Path, help="folder of their answers case_NN.json (default: truth in it)")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    main()
