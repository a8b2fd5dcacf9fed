"""The comparison of two runs, from the command line."""

from __future__ import annotations

from pathlib import Path

from frf_ipz.fleet.comparison_page import write_comparison
from frf_ipz.fleet.mode_changes import DAMPING_SCATTER, FREQUENCY_SCATTER, compare_runs
from frf_ipz.output_files import cannot_write, write_text
from frf_ipz.runs.results import errors_of_results, open_results

PAGE, TABLE = "compare.html", "compare.csv"


def compare_folders(
    before: Path, after: Path, out: Path, *, frequency_scatter: float | None, damping_scatter: float | None
) -> str:
    """Compare two runs, write the page and the table.

    Parameters
    ----------
    before, after : Path
        Folders of results.
    out : Path
        Folder for what is written.
    frequency_scatter, damping_scatter : float, optional
        As `compare_runs` has them.

    Returns
    -------
    str
        What changed.

    Raises
    ------
    InputError
        If a folder holds no run with a fit, or nothing can be written.
    """
    runs = open_results(before), open_results(after)
    with errors_of_results(before), errors_of_results(after):
        comparison = compare_runs(
            *runs,
            frequency_scatter=FREQUENCY_SCATTER if frequency_scatter is None else frequency_scatter,
            damping_scatter=DAMPING_SCATTER if damping_scatter is None else damping_scatter,
        )
        try:
            out.mkdir(parents=True, exist_ok=True)
            write_comparison(comparison, *runs, out / PAGE)
            write_text(out / TABLE, comparison.to_frame().to_csv(index=False, lineterminator="\n"))
        except OSError as error:
            raise cannot_write(out, error) from error
    return f"{comparison.summary()}\n\npage  {out / PAGE}"
