"""The commands of ``frf-ipz``: arguments into calls of the library.

Every stage is imported by the command that needs it, so that ``--help`` answers at once.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from frf_ipz import __version__
from frf_ipz.cli.printing import say
from frf_ipz.late_imports import import_late
from frf_ipz.visible_text import one_line

if TYPE_CHECKING:
    from frf_ipz.cli.comparison import compare_folders
    from frf_ipz.cli.local_page import serve_page
    from frf_ipz.cli.pictures import draw_picture, picture_list
    from frf_ipz.cli.terminal import run_fleet_with_progress, run_with_progress
    from frf_ipz.pipeline.check.setup import describe_setup
    from frf_ipz.pipeline.init.starting_files import write_starting_files
    from frf_ipz.pipeline.inputs import read_inputs
else:
    compare_folders = import_late("frf_ipz.cli.comparison", "compare_folders")
    serve_page = import_late("frf_ipz.cli.local_page", "serve_page")
    draw_picture = import_late("frf_ipz.cli.pictures", "draw_picture")
    picture_list = import_late("frf_ipz.cli.pictures", "picture_list")
    run_fleet_with_progress = import_late("frf_ipz.cli.terminal", "run_fleet_with_progress")
    run_with_progress = import_late("frf_ipz.cli.terminal", "run_with_progress")
    describe_setup = import_late("frf_ipz.pipeline.check.setup", "describe_setup")
    write_starting_files = import_late("frf_ipz.pipeline.init.starting_files", "write_starting_files")
    read_inputs = import_late("frf_ipz.pipeline.inputs", "read_inputs")

EPILOG = """
[bold]From a folder of recordings to a controller-ready model[/bold]

  frf-ipz init FOLDER                    writes test.toml, model.toml and pipeline.toml from FOLDER
  frf-ipz check FOLDER                   validates everything and draws the set-up
  frf-ipz run FOLDER --out RESULTS
  frf-ipz show RESULTS                   opens the results as a page to look at and to work on
  frf-ipz compare RESULTS LATER_RESULTS  says which modes have moved between two tests

[bold]Exit status[/bold]  0 done; 2 the input is wrong, one message says where and what to do; 1 no result could be
computed, or a fault of the program.
"""

app = typer.Typer(
    help="From hammer-test recordings and a nearly right FE model to a controller-ready model, and to what the model "
    "left out.",
    epilog=EPILOG,
    rich_markup_mode="rich",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

PipelineArgument = Annotated[
    Path, typer.Argument(metavar="PIPELINE", help="The pipeline.toml to work on, or the folder that holds it.")
]
OutOption = Annotated[Path, typer.Option("--out", "-o", metavar="DIR", help="Folder for the results.")]
QuietOption = Annotated[bool, typer.Option("--quiet", "-q", help="No progress, no summary.")]

HELP = {
    "run": "Run the whole chain: FRFs, poles and zeros, updated model, prediction, state space, report.",
    "ingest": "Recordings into FRFs with their variance: frf.parquet, records.parquet.",
    "fit": "FRFs into poles, zeros and mode shapes: poles.parquet, zeros.parquet, fit.parquet, modes.parquet.",
    "diagnose": "Locate a mismatch of model and recordings, and say what was left out: diagnosis.json, report.html.",
    "pair": "Measured poles and zeros against those of the reduced FE model: pairs.parquet.",
    "update": "Bring the reduced model to the measured poles and zeros: updated_model.npz, parameters.parquet.",
    "predict": "FRFs at the points of interest, with their band: poi_frf.parquet.",
    "export": "The state space for python-control and MATLAB: statespace.json, statespace.mat.",
    "report": "Everything on one page: report.html.",
}


def _version(is_given: bool) -> None:  # noqa: FBT001  the signature of a typer callback
    if is_given:
        say(f"frf-ipz {__version__}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """Take the options that stand before the command."""
    del version


def _stage_command(stage: str) -> None:
    """Add the command that runs the chain up to a stage."""

    def command(pipeline: PipelineArgument, out: OutOption = Path("results"), quiet: QuietOption = False) -> None:
        until, diagnosing = ("report", None) if stage == "run" else (stage, True if stage == "diagnose" else None)
        run_with_progress(pipeline, out, until=until, diagnosing=diagnosing, quiet=quiet)

    app.command(stage, help=HELP[stage])(command)


for _stage in HELP:
    _stage_command(_stage)


@app.command()
def fleet(
    fleet: Annotated[Path, typer.Argument(metavar="FLEET", help="The fleet.toml: machines, one model, one pipeline.")],
    out: OutOption = Path("results"),
    jobs: Annotated[
        int | None, typer.Option("--jobs", "-j", min=1, metavar="N", help="Processes; by cores and memory by default.")
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option("--scheduler", metavar="tcp://HOST:PORT", help="Of a Dask cluster that does the work.")
    ] = None,
    only: Annotated[str, typer.Option("--only", metavar="ID,ID", help="Run these machines only.")] = "",
    quiet: QuietOption = False,
) -> None:
    """Run many machines of one kind, and compare them: fleet.parquet, fleet_poles.parquet, fleet.html and others."""
    run_fleet_with_progress(fleet, out, jobs=jobs, scheduler=scheduler, only=only, quiet=quiet)


@app.command()
def compare(
    before: Annotated[Path, typer.Argument(metavar="BEFORE", help="Folder with the results of the test before.")],
    after: Annotated[Path, typer.Argument(metavar="AFTER", help="Folder with the results of the test after.")],
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="DIR", help="Folder for compare.html and compare.csv.")
    ] = Path(),
    frequency_scatter: Annotated[
        float | None, typer.Option(metavar="RATIO", help="Of frequencies from test to test with nothing changed.")
    ] = None,
    damping_scatter: Annotated[
        float | None, typer.Option(metavar="RATIO", help="Of damping ratios from test to test with nothing changed.")
    ] = None,
) -> None:
    """Say which modes have moved from one test of a structure to another: compare.html, compare.csv."""
    say(compare_folders(before, after, out, frequency_scatter=frequency_scatter, damping_scatter=damping_scatter))


@app.command()
def check(pipeline: PipelineArgument) -> None:
    """Validate test, model and pipeline, draw the set-up, run nothing."""
    say(describe_setup(read_inputs(pipeline)))


@app.command()
def init(
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="Folder with the recordings as CSV, and the matrices of the model.")
    ],
) -> None:
    """Write commented test.toml, model.toml and pipeline.toml from a folder of CSVs; what is there is left alone."""
    files = write_starting_files(folder)
    for path, written in files.written.items():
        say(one_line(f"{'wrote' if written else 'left '} {path}"))
    for text in (*files.taken_for, files.next_step):
        say(one_line(text))


@app.command()
def plot(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder with the results of a run.")],
    name: Annotated[
        str | None, typer.Argument(metavar="NAME", help="Which picture; without it, all are named.")
    ] = None,
    file_format: Annotated[
        str | None,
        typer.Option("--format", "-f", metavar="svg|pdf|png", help="Kind of file; by the end of FILE, else svg."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="FILE", help="File to write; NAME.FORMAT here by default.")
    ] = None,
) -> None:
    """Draw one picture of a run for a publication."""
    say(picture_list(folder) if name is None else draw_picture(folder, name, file_format, out))


@app.command()
def show(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of a run, or of a campaign.")],
    port: Annotated[int, typer.Option("--port", min=0, max=65535, help="Where to listen; 0 for any free port.")] = 0,
    browser: Annotated[
        bool | None, typer.Option("--browser/--no-browser", help="Open the page; by default on a desktop only.")
    ] = None,
) -> None:
    """Open a local page on a run or a campaign: look, run, reject and pin poles; changes go to pipeline.toml."""
    serve_page(folder, port=port, browser=browser)
