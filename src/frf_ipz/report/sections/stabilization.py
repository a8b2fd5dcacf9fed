"""Where the modes are: indicator function, poles over model orders, what was taken, and why."""

from __future__ import annotations

from typing import TYPE_CHECKING

from frf_ipz.plotting.wording import number, percent
from frf_ipz.report.section import Block, Section, Table, run_figures
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    import pandas as pd

    from frf_ipz.runs.results import Results


def build(run: Results) -> Section | None:
    """Give the section on the stabilisation diagram.

    Parameters
    ----------
    run : Results
        What the run holds.

    Returns
    -------
    Section or None
        None where the fit kept no diagram.
    """
    fit = run.fit
    if fit is None or not len(fit.stabilization):
        return None
    n_taken = int(fit.stabilization["taken"].astype(bool).sum())
    orders = fit.stabilization["order"].nunique()
    lead = (
        f"{counted(len(fit.stabilization), 'pole')} of {counted(orders, 'model order')} up to "
        f"{int(fit.stabilization['order'].max())}; {n_taken} of them were where the fit started, and "
        f"{counted(fit.n_modes, 'mode')} remained."
    )
    blocks: list[Block] = [*run_figures(run, "cmif", "stabilization")]
    blocks += [_decisions(fit.decisions)] if len(fit.decisions) else []
    return Section(anchor="stabilization", title="Stabilisation", lead=lead, blocks=tuple(blocks))


def _decisions(decisions: pd.DataFrame) -> Table:
    rows = [
        [number(row["frequency_hz"], 6), percent(row["damping_ratio"]), str(row["action"]), str(row["reason"])]
        for row in decisions.to_dict("records")
    ]
    columns = ("frequency, Hz", "damping", "what was done", "why")
    return Table(caption="Decisions on the way from start to fit", columns=columns, rows=rows)
