"""The controller-ready model: sizes, names, units, poles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.plotting.wording import counted, number
from frf_ipz.rational import damping_ratio, natural_frequency_hz
from frf_ipz.report.section import Section, Table

if TYPE_CHECKING:
    from frf_ipz.export.state_space import StateSpaceModel
    from frf_ipz.runs.results import Results

MOST_POLES = 40
AT_REST = 1e-6  # of the highest frequency: a double pole at 0 is found to about the root of machine precision


def build(run: Results) -> Section | None:
    """Give the section on the state space.

    Parameters
    ----------
    run : Results
        What the run holds.

    Returns
    -------
    Section or None
        None where nothing was exported.
    """
    model = run.state_space_arrays
    if model is None:
        return None
    time = f"sampled at {number(model.dt)} s" if model.dt else "in continuous time"
    lead = (
        f"{counted(len(model.state_names), 'state')}, {counted(len(model.input_names), 'input')}, "
        f"{counted(len(model.output_names), 'output')}, {time}; frf_ipz.read_state_space('statespace.json') gives a "
        "control.StateSpace."
    )
    ports = [["input", name, unit] for name, unit in zip(model.input_names, model.input_units, strict=True)]
    ports += [["output", name, unit] for name, unit in zip(model.output_names, model.output_units, strict=True)]
    table = Table(
        caption="Inputs and outputs",
        columns=("port", "DOF", "unit"),
        rows=ports,
        file="statespace.json, statespace.mat",
    )
    return Section(
        anchor="state-space", title="State space", lead=lead, blocks=(table, _poles(model)), choices=model.notes
    )


def _poles(model: StateSpaceModel) -> Table:
    values = np.linalg.eigvals(model.A).astype(complex)
    if model.dt:
        with np.errstate(divide="ignore"):  # a pole at 0 of a sampled model is a pure delay
            values = np.log(values) / model.dt
    values = values[(values.imag >= 0) & np.isfinite(values)]
    top = float(natural_frequency_hz(values).max(initial=0.0))
    values = values[np.argsort(np.abs(values))][:MOST_POLES]
    rows = [
        ["0 (rigid body)", ""] if hertz < AT_REST * top else [number(float(hertz), 6), number(100 * float(ratio), 4)]
        for hertz, ratio in zip(natural_frequency_hz(values), damping_ratio(values), strict=True)
    ]
    return Table(caption="Poles of the state space", columns=("frequency, Hz", "damping ratio, %"), rows=rows)
