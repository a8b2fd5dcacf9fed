"""Poles and zeros in the s-plane with their error ellipses; tables of modes and zeros."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import IntArray
from frf_ipz.plotting.ellipses import root_covariances, root_deviations
from frf_ipz.plotting.wording import number, with_error
from frf_ipz.rational import damping_ratio, natural_frequency_hz
from frf_ipz.report.section import Block, Section, Table, run_figures
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.runs.results import Results


def build(run: Results) -> Section | None:
    """Give the section on poles and zeros.

    Parameters
    ----------
    run : Results
        What the run holds.

    Returns
    -------
    Section or None
        None without a fit.
    """
    fit = run.fit
    if fit is None:
        return None
    known = int(np.count_nonzero(fit.zeros.identifiable))
    n_unknown = len(fit.zeros.values) - known
    rest = f"; {n_unknown} more that the data do not support." if n_unknown else "."
    zeros = f"{counted(known, 'zero')} of single FRFs with a number{rest}"
    lead = f"{counted(fit.n_modes, 'pole')} shared by all FRFs, and {zeros}"
    if fit.modes_given is not None:
        lead = f"{counted(fit.n_modes, 'mode')} identified elsewhere; zeros belong to FRFs, and none was measured."
    blocks: list[Block] = [
        *run_figures(run, "poles", hints={"pole-zero-map": "Zoom in to see small ellipses."}),
        _mode_table(fit),
    ]
    blocks += [_zero_table(fit)] if len(fit.zeros.values) else []
    return Section(anchor="poles", title="Poles and zeros", lead=lead, blocks=tuple(blocks), notes=fit.warnings)


def _mode_table(fit: ModalFit) -> Table:
    poles = fit.model.poles[: fit.n_modes]
    hertz_std, ratio_std = root_deviations(poles, root_covariances(fit)[: fit.n_modes])
    extra = [name for name in ("mpc", "found_again", "quality") if name in fit.modes and len(fit.modes) == len(poles)]
    rows = []
    for row, pole in enumerate(poles):
        hertz, ratio = float(natural_frequency_hz(pole)), float(damping_ratio(pole))
        quality = [_cell(fit.modes[name].iloc[row]) for name in extra]
        cells = [with_error(hertz, hertz_std[row], 7), with_error(100 * ratio, 100 * ratio_std[row], 5)]
        rows.append([str(row + 1), *cells, *quality])
    columns = (
        "pole",
        "frequency, Hz",
        "damping ratio, %",
        *[name.upper() if name == "mpc" else name.replace("_", " ") for name in extra],
    )
    return Table(caption="Modes of the band", columns=columns, rows=rows, file="poles.parquet, modes.parquet")


def _cell(value: object) -> str:
    return number(float(value), 3) if isinstance(value, float | int | np.number) else str(value)


def _zero_table(fit: ModalFit) -> Table:
    zeros = fit.zeros
    hertz_std, ratio_std = root_deviations(zeros.values, root_covariances(fit)[fit.n_modes :])
    order: IntArray = np.lexsort((np.abs(zeros.values), zeros.frf))
    rows = []
    for row in order:
        root, known = zeros.values[row], bool(zeros.identifiable[row])
        numbers = ["–", "–"]
        if known:
            hertz, ratio = float(natural_frequency_hz(root)), float(damping_ratio(root))
            damping = with_error(100 * ratio, 100 * ratio_std[row], 5)
            if zeros.kind[row] == "real":
                damping = f"{'left' if root.real < 0 else 'right'} half plane"
            numbers = [with_error(hertz, hertz_std[row], 7), damping]
        rows.append([str(fit.labels[zeros.frf[row]]), zeros.kind[row], *numbers, zeros.reason[row]])
    columns = ("FRF (output / input)", "kind", "frequency, Hz", "damping ratio, %", "why without a number")
    marked = frozenset(np.flatnonzero(~zeros.identifiable[order]).tolist())
    return Table(caption="Zeros", columns=columns, rows=rows, marked=marked, file="zeros.parquet")
