"""``frf-testbench``: make blind cases, prove the diagnosis on them, and judge the update on known structures."""

from __future__ import annotations

import sys
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from collections.abc import Iterator

    from frf_ipz.progress import Progress

app = typer.Typer(
    help="What frf_ipz is judged by: simulated machines with sealed answers, and structures that are known.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


@app.command()
def simulate(
    out: Annotated[Path, typer.Option("--out", help="Folder of the case.")],
    seed: Annotated[int, typer.Option("--seed", help="The same seed gives the same case.")],
    effect: Annotated[
        str, typer.Option("--effect", help="What is concealed: null, an effect, unknown[:KIND], pair[:A+B].")
    ] = "null",
    structure: Annotated[str | None, typer.Option("--structure", help="Kind of specimen; drawn by default.")] = None,
    truth: Annotated[Path | None, typer.Option("--truth", help="Folder of the answers; truth beside the case.")] = None,
) -> None:
    """Make a blind case of a vibration test: recordings, a model, and sealed answers."""
    from frf_testbench.simulator.cases.case import make_case

    case = make_case(seed, effect, structure=structure)
    answers = (truth or out.parent / "truth") / f"{out.name}.json"
    case.write(out, answers)
    print(f"{out}: {case.system.specimen.name}, {len(case.excitations)} records; answers in {answers}")


@app.command("check-simulator")
def check_simulator(
    n_specimens: Annotated[int, typer.Option("--each", help="Specimens of each kind.")] = 3,
    kinds: Annotated[list[str] | None, typer.Option("--kind", help="Kind of specimen; all by default.")] = None,
    laws: Annotated[bool, typer.Option("--laws/--no-laws", help="Halve the step of force laws too.")] = True,
) -> None:
    """Check the simulator against nominal models and its own time step."""
    from frf_testbench.simulator.self_check import print_checks

    print_checks(n_specimens=n_specimens, kinds=kinds, laws=laws)


@app.command()
def prove(
    out: Annotated[Path | None, typer.Option("--out", help="Folder; results/proof by default.")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="A slice of a few cases.")] = False,
    linear: Annotated[int | None, typer.Option("--linear", metavar="N", help="Cases with a linear effect.")] = None,
    null: Annotated[int | None, typer.Option("--null", metavar="N", help="Cases with nothing missing.")] = None,
    nonlinear: Annotated[int | None, typer.Option("--nonlinear", metavar="N", help="Cases with a force law.")] = None,
    pair: Annotated[int | None, typer.Option("--pair", metavar="N", help="Cases with two effects.")] = None,
    unknown: Annotated[int | None, typer.Option("--unknown", metavar="N", help="Cases outside the table.")] = None,
    seed_shift: Annotated[int, typer.Option("--seed-shift", metavar="N", help="Added to all seeds, for a trial.")] = 0,
    jobs: Annotated[int, typer.Option("--jobs", help="Cases at the same time.")] = 2,
    points: Annotated[
        int | None, typer.Option("--points", metavar="N", help="Explained cases whose points are predicted.")
    ] = None,
    cases: Annotated[
        Path | None, typer.Option("--cases", help="Folder of case_NN folders to score instead of making cases.")
    ] = None,
    answers: Annotated[
        Path | None, typer.Option("--answers", help="Folder of their answers case_NN.json; truth in it by default.")
    ] = None,
) -> None:
    """Prove the diagnosis on blind cases: make, seal, diagnose, open, score, and write a page.

    It goes on where it was stopped; cases that a changed package has not seen are diagnosed again.
    """
    from frf_testbench.proof.prove import MOST_PREDICTED, run_proof

    counts = {"linear": linear, "null": null, "nonlinear": nonlinear, "pair": pair, "unknown": unknown}
    run_proof(
        out=out,
        quick=quick,
        counts={group: count for group, count in counts.items() if count is not None},
        seed_shift=seed_shift,
        jobs=jobs,
        points=MOST_PREDICTED if points is None else points,
        cases=cases,
        answers=answers,
    )


@app.command()
def validation(
    scores: Annotated[list[Path], typer.Argument(metavar="SCORES.json", help="Of proofs, in the order of the page.")],
    out: Annotated[Path, typer.Option("--out", help="The page, in Markdown.")],
) -> None:
    """Write the figures of proofs as a page of the documentation."""
    from frf_testbench.proof.validation import ScoresError, write_validation

    try:
        write_validation(scores, out)
    except ScoresError as error:
        print(f"frf-testbench: {error}", file=sys.stderr)
        raise typer.Exit(2) from None


@app.command()
def updating(
    first_seed: Annotated[int | None, typer.Argument(metavar="[FIRST_SEED]", help="1000 or more.")] = None,
    count: Annotated[int | None, typer.Argument(metavar="[COUNT]", help="Structures; 200 take ten minutes.")] = None,
) -> None:
    """Update random beams, frames and plates, and judge FRFs predicted where nobody measured."""
    from frf_testbench.updating.study import COUNT, FIRST_SEED, print_study

    print_study(FIRST_SEED if first_seed is None else first_seed, COUNT if count is None else count)


@app.command()
def study(
    name: Annotated[
        str, typer.Argument(help="beam_physics, cantilever_masses, double_beam_ringdown, left_out, silverbox.")
    ],
    folder: Annotated[Path, typer.Argument(help="Folder of its recordings, which are not part of the repository.")],
) -> None:
    """Say what frf_ipz finds in measurements by others, as tables."""
    from frf_ipz.errors import FrfIpzError
    from frf_testbench.studies.recordings import StudyError
    from frf_testbench.studies.run import run_study

    try:
        with _progress_bar() as progress:
            tables = run_study(name, folder, progress=progress)
    except (StudyError, FrfIpzError) as error:
        print(f"frf-testbench: {error}", file=sys.stderr)
        raise typer.Exit(2) from None
    for title, table in tables.items():
        print(f"{title}\n{table.to_string(float_format='{:.4g}'.format)}\n")


@app.command()
def verdicts(
    folder: Annotated[Path, typer.Argument(help="Where campaigns and results are kept.")],
    first_seed: Annotated[int, typer.Option("--first-seed", help="Of the first campaign.")] = 800_000,
    count: Annotated[int, typer.Option("--each", metavar="N", help="Campaigns of each group.")] = 100,
    jobs: Annotated[int, typer.Option("--jobs", help="Campaigns at the same time.")] = 2,
) -> None:
    """Judge the verdicts on campaigns that are sound, have a user's mistake in them, or conceal an effect."""
    from frf_testbench.proof.verdicts import judge_verdicts, summarise_verdicts

    table = judge_verdicts(folder, first_seed=first_seed, count=count, jobs=jobs)
    table.to_csv(folder / "verdicts.csv", index=False)
    print(summarise_verdicts(table).to_string(index=False))


@app.command()
def machines(
    folder: Annotated[Path, typer.Argument(help="Where machines and results are kept.")],
    first_seed: Annotated[int, typer.Option("--first-seed", help="Of the first machine.")] = 171_000_000,
    count: Annotated[int, typer.Option("--count", metavar="N", help="Machines; every third one is sound.")] = 60,
    jobs: Annotated[int, typer.Option("--jobs", help="Machines at the same time.")] = 1,
) -> None:
    """Prove the diagnosis on three-dimensional machines: make, seal, diagnose, open, score."""
    from frf_testbench.machines.prove import prove_machines, summarise_machines

    table = prove_machines(folder, first_seed=first_seed, count=count, jobs=jobs)
    table.to_csv(folder / "scores.csv", index=False)
    print(table.to_string(index=False, float_format="{:.4g}".format))
    print(summarise_machines(table).to_string(index=False))


@contextmanager
def _progress_bar() -> Iterator[Progress]:
    """Show how far the work is, where there is a terminal."""
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bar

    console = Console(stderr=True, highlight=False)
    columns = (TextColumn("{task.description}"), BarColumn(bar_width=24), TimeElapsedColumn())
    with Bar(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("reading", total=1.0)

        def show(fraction: float, text: str) -> None:
            bar.update(task, completed=fraction, description=text[:60].ljust(60))

        yield show


@app.command()
def paper() -> None:
    """Compare `ipz`, `minimal-change` and the trivial answer on both examples of Dorosti et al. (2018)."""
    from frf_testbench.updating.paper_comparison import print_comparison

    print_comparison()
