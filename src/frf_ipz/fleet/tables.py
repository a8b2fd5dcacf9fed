"""The tables of a fleet: the columns of each file, with unit and meaning."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.export.parquet import Column, make_table

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pyarrow as pa

    from frf_ipz.fleet.analysis import FleetAnalysis, FleetRoots

ID = Column("machine", "text", "", "id of the machine, and name of its folder in machines")
MACHINE = (
    ID,
    Column("status", "text", "", "done, failed or not run"),
    Column("message", "text", "", "why it failed"),
    Column("n_modes", "int", "1", "number of modes that were found; null where it failed"),
    Column("verdict", "text", "", "of the diagnosis: consistent, explained or unexplained; empty without one"),
    Column("assessment", "text", "", "of the result: usable, with care or not usable; empty without one"),
    Column("poi_error_db", "float", "dB", "median deviation at the points of interest; null where none was measured"),
    Column("cpu_s", "float", "s", "CPU time that the last command has spent on it"),
    Column("outlier", "flag", "", "true where a pole or a zero is unlike the other machines'"),
    Column("serial_number", "text", "", "as fleet.toml or the test states it"),
    Column("date", "text", "", "as fleet.toml or the test states it"),
)
ROOT = (
    Column("frequency_hz", "float", "Hz", "undamped natural frequency"),
    Column("damping_ratio", "float", "1", "damping ratio"),
    Column("frequency_std_hz", "float", "Hz", "standard deviation of the frequency in this machine's test"),
    Column("damping_ratio_std", "float", "1", "standard deviation of the damping ratio in this machine's test"),
    Column("deviation_sigma", "float", "1", "distance of the frequency from the other machines, in deviations"),
    Column("damping_deviation_sigma", "float", "1", "the same of the damping ratio"),
    Column("outlier", "flag", "", "true where either is more than chance; see the how-to for the false alarms"),
)
POLE = (ID, Column("mode", "int", "", "number of the mode in the fleet, the same in all machines"), *ROOT)
ZERO = (
    ID,
    Column("output_dof", "text", "", "sensor of the FRF"),
    Column("input_dof", "text", "", "excited DOF of the FRF"),
    Column("mode", "int", "", "number of the zero in its FRF, the same in all machines"),
    *ROOT,
)
PARAMETER = (
    ID,
    Column("parameter", "text", "", "name as in parameters.parquet"),
    Column("value", "float", "1, or kg for the mass of a sensor", "updated value"),
    Column("std", "float", "as value", "standard deviation in this machine's update; null where it is not known"),
)
FINDING = (
    Column("effect", "text", "", "name in the catalogue"),
    Column("location", "text", "", "as in diagnosis.json, as JSON"),
    Column("of", "text", "", "model, or the id of the machine that has it alone"),
    Column("parameter", "text", "", "which of its parameters the value is"),
    Column("value", "float", "SI", "of the model's: mean over machines"),
    Column("std", "float", "SI", "standard deviation of the value"),
    Column("log_evidence", "float", "1", "natural log Bayes factor over a fleet without it"),
    Column("probability", "float", "1", "that it is there, and whose it is said to be"),
    Column("n_machines", "int", "1", "number of machines in which it was found"),
)
FILES = {
    "fleet.parquet": MACHINE,
    "fleet_poles.parquet": POLE,
    "fleet_zeros.parquet": ZERO,
    "fleet_parameters.parquet": PARAMETER,
    "fleet_findings.parquet": FINDING,
}


def fleet_tables(analysis: FleetAnalysis) -> dict[str, pa.Table]:
    """Make all tables of a fleet.

    Parameters
    ----------
    analysis : FleetAnalysis
        What is known of it.

    Returns
    -------
    dict of str to pyarrow.Table
        By the names of their files.
    """
    return {
        "fleet.parquet": _machines(analysis),
        "fleet_poles.parquet": make_table(POLE, _roots(analysis, analysis.poles)),
        "fleet_zeros.parquet": make_table(ZERO, {**_roots(analysis, analysis.zeros), **_dofs(analysis.zeros)}),
        "fleet_parameters.parquet": _parameters(analysis),
        "fleet_findings.parquet": _findings(analysis),
    }


def _machines(analysis: FleetAnalysis) -> pa.Table:
    records = analysis.records
    named = ("machine", "status", "message", "verdict", "assessment", "poi_error_db", "cpu_s")
    values: dict[str, list[object]] = {name: [getattr(record, name) for record in records] for name in named}
    values["n_modes"] = [None if record.poles is None else record.poles.count for record in records]
    values["outlier"] = [record.machine in analysis.outliers for record in records]
    for name in ("serial_number", "date"):
        values[name] = [record.particulars.get(name, "") for record in records]
    return make_table(MACHINE, values)


def _roots(analysis: FleetAnalysis, roots: FleetRoots) -> dict[str, object]:
    columns = ("frequency_hz", "damping_ratio", "frequency_std_hz", "damping_ratio_std")
    return {
        "machine": [analysis.records[place].machine for place in roots.machine],
        "mode": roots.number,
        **{name: getattr(roots, name) for name in columns},
        "deviation_sigma": roots.deviation_sigma,
        "damping_deviation_sigma": roots.damping_deviation_sigma,
        "outlier": roots.is_outlier,
    }


def _dofs(zeros: FleetRoots) -> dict[str, list[str]]:
    ends = [frf.split(" / ") for frf in zeros.frf]
    return {"output_dof": [end[0] for end in ends], "input_dof": [end[1] for end in ends]}


def _parameters(analysis: FleetAnalysis) -> pa.Table:
    rows = [(record.machine, name, *pair) for record in analysis.records for name, pair in record.parameters.items()]
    return make_table(PARAMETER, _columns(("machine", "parameter", "value", "std"), rows))


def _findings(analysis: FleetAnalysis) -> pa.Table:
    names = ("effect", "location", "of", "parameter", "value", "std", "log_evidence", "probability")
    rows = [(*(getattr(each, name) for name in names), len(each.machines)) for each in analysis.findings]
    return make_table(FINDING, _columns((*names, "n_machines"), rows))


def _columns(names: tuple[str, ...], rows: Sequence[tuple[object, ...]]) -> dict[str, object]:
    columns = list(zip(*rows, strict=True)) or [()] * len(names)
    return {
        name: np.array(column, float) if column and isinstance(column[0], float) else list(column)
        for name, column in zip(names, columns, strict=True)
    }
