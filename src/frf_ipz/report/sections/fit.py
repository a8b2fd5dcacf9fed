"""The fit against the measurement: curves, misfit, noise, and how sure the fitted curve is."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.plotting.wording import number
from frf_ipz.report.section import Section, Table, run_figures

if TYPE_CHECKING:
    import pandas as pd

    from frf_ipz.runs.results import Results

LARGE = 2.0  # misfit over noise from which a row of the table is marked


def build(run: Results) -> Section | None:
    """Give the section on the fit.

    Parameters
    ----------
    run : Results
        What the run holds.

    Returns
    -------
    Section or None
        None without a fit.
    """
    fit, frfs = run.fit, run.frfs
    if fit is None or frfs is None:
        return None
    used = frfs.select_lines(fit.used_lines)
    fitted = fit.model(used.s)
    misfit = np.linalg.norm(fitted - used.values) / max(float(np.linalg.norm(used.values)), np.finfo(float).tiny)
    lead = f"The fitted curves differ from the measured ones by {number(100 * float(misfit), 3)} % of their norm."
    return Section(
        anchor="fit",
        title="Fit",
        lead=lead,
        blocks=(
            *run_figures(run, "fit"),
            *([_table(fit.misfit)] if len(fit.misfit) else []),
            *(run_figures(run, "levels") if run.diagnosis is None else ()),  # else that section has them
        ),
    )


def _table(misfit: pd.DataFrame) -> Table:
    rows = [
        [
            f"{row['output_dof']} / {row['input_dof']}",
            f"{number(row['band_low_hz'])} to {number(row['band_high_hz'])}",
            *[number(float(row[name]), 3) for name in ("misfit", "noise", "ratio")],
        ]
        for row in misfit.to_dict("records")
    ]
    large = frozenset(np.flatnonzero(misfit["ratio"].to_numpy(float) > LARGE).tolist())
    columns = ("FRF (output / input)", "band, Hz", "misfit, SI", "noise, SI", "misfit over noise")
    return Table(caption="Misfit against noise", columns=columns, rows=rows, marked=large, file="fit.parquet")
