"""The controller-ready model: sizes, names, units, poles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.plotting.wording import number
from frf_ipz.rational import damping_ratio, natural_frequency_hz
from frf_ipz.report.section import Section, Table
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.arrays import ComplexArray
    from frf_ipz.export.state_space import StateSpaceModel
    from frf_ipz.runs.results import Results

MOST_POLES = 40
MODEL_ONLY = "model only"
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
    poles = _poles(model)
    origins = _origins(run, poles)
    n_alone = sum(not origin for origin in origins)
    if n_alone:
        come, them = ("comes", "it") if n_alone == 1 else ("come", "them")
        lead += (
            f" {counted(n_alone, 'pole')} of {len(poles)}, marked below, {come} from the FE model only: no measured "
            f"mode supports {them}."
        )
    return Section(
        anchor="state-space",
        title="State space",
        lead=lead,
        blocks=(table, _pole_table(poles, origins)),
        choices=model.notes,
    )


def _poles(model: StateSpaceModel) -> ComplexArray:
    """Give the poles in continuous time, one of each conjugate pair, by ascending modulus."""
    values = np.linalg.eigvals(model.A).astype(complex)
    if model.dt:
        with np.errstate(divide="ignore"):  # a pole at 0 of a sampled model is a pure delay
            values = np.log(values) / model.dt
    values = values[(values.imag >= 0) & np.isfinite(values)]
    return np.asarray(values[np.argsort(np.abs(values))])


def _origins(run: Results, poles: ComplexArray) -> list[str]:
    """Say of each pole which measured one it is; nothing where it comes from the model only."""
    origins = [""] * len(poles)
    updated, pairs = run.updated_model, run.pairs
    if updated is None or pairs is None or not len(poles) or len(pairs.targets) != len(updated.after):
        return origins
    for target, after in zip(pairs.targets, updated.after, strict=True):
        if target.kind == "pole":
            hertz = number(float(natural_frequency_hz(np.array(target.measured_value))), 6)
            origins[int(np.argmin(np.abs(poles - after)))] = f"measured at {hertz} Hz"
    return origins


def _pole_table(poles: ComplexArray, origins: Sequence[str]) -> Table:
    frequencies, ratios = natural_frequency_hz(poles), damping_ratio(poles)
    top = float(frequencies.max(initial=0.0))
    rows = [
        ["0 (rigid body)", "", origin or MODEL_ONLY]
        if hertz < AT_REST * top
        else [number(float(hertz), 6), number(100 * float(ratio), 4), origin or MODEL_ONLY]
        for hertz, ratio, origin in zip(frequencies, ratios, origins, strict=True)
    ]
    return Table(
        caption="Poles of the state space",
        columns=("frequency, Hz", "damping ratio, %", "where it comes from"),
        rows=rows[:MOST_POLES],
        marked=frozenset(place for place, origin in enumerate(origins) if not origin),
    )
