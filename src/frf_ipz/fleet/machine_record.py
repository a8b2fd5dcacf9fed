"""What a fleet needs to know of one machine's results: a few hundred numbers, small enough to be sent around."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.export.run_tables import pole_table, zero_table
from frf_ipz.identification.results.shapes import mode_shapes
from frf_ipz.pairing.pairs import PairVerdict
from frf_ipz.runs.digests import digest_arrays

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pyarrow as pa

    from frf_ipz.diagnosis.result import Finding
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.pairing.pairs import Pairs
    from frf_ipz.runs.results import Results
    from frf_ipz.updating.updated_model import UpdatedModel

DONE, FAILED, NOT_RUN = "done", "failed", "not run"
AT_POINTS = "points of interest"
RATIO = ("stiffness of ", "mass of ", "damping of mode ")  # how the names of parameters begin in a history
NORMAL_90 = 1.6448536269514722  # standard deviations from the middle to the ends of a 90 % band


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Roots:
    """Poles or zeros of one machine.

    Parameters
    ----------
    frf : tuple of str
        The FRF of each zero, as ``21:+z / 15:+z``; empty texts for poles.
    frequency_hz, damping_ratio, frequency_std_hz, damping_ratio_std : (n,) array
        As measured.
    counterpart : (n,) int array
        Number of its counterpart in the reduced model, from 0; -1 where pairing has found none that is sure.
    shapes : (n_dofs, n) complex array
        Of modes, at `dofs`; without rows for zeros.
    dofs : tuple of str
        Rows of the shapes.
    """

    frf: tuple[str, ...]
    frequency_hz: FloatArray
    damping_ratio: FloatArray
    frequency_std_hz: FloatArray
    damping_ratio_std: FloatArray
    counterpart: IntArray
    shapes: ComplexArray
    dofs: tuple[str, ...] = ()

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self.frequency_hz)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MachineRecord:
    """What became of one machine.

    Parameters
    ----------
    machine : str
        Its id.
    status : str
        ``done``, ``failed`` or ``not run``.
    message : str
        Why it failed.
    cpu_s : float
        CPU time that this command has spent on it, s.
    computed : tuple of str
        Stages that were computed, and not taken from its folder.
    reduction : str
        Digest of the reduced model before updating; empty without one.
    poles, zeros : Roots, optional
        As measured.
    parameters : mapping of str to tuple of float
        Value and standard deviation of each updating parameter; the latter NaN where it is not known.
    verdict, assessment : str
        Of the diagnosis, and of the result as a whole; empty where there is none.
    is_searched : bool
        True where a complete search for causes has been made.
    findings : tuple of Finding
        What the diagnosis has found and holds for more than its tolerances.
    poi_error_db : float
        Median deviation at the points of interest, where something was measured there; else NaN.
    particulars : mapping of str to str
        Serial number, date and the like.
    """

    machine: str
    status: str
    message: str = ""
    cpu_s: float = 0.0
    computed: tuple[str, ...] = ()
    reduction: str = ""
    poles: Roots | None = None
    zeros: Roots | None = None
    parameters: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    verdict: str = ""
    assessment: str = ""
    is_searched: bool = False
    findings: tuple[Finding, ...] = ()
    poi_error_db: float = float("nan")
    particulars: Mapping[str, str] = field(default_factory=dict)


def describe_results(machine: str, results: Results) -> MachineRecord:
    """Say what a machine's results say.

    Parameters
    ----------
    machine : str
        Its id.
    results : Results
        Of its folder.

    Returns
    -------
    MachineRecord
        With the status ``done``.
    """
    fit, pairs, updated = results.fit, results.pairs, results.updated_model
    diagnosis, assessment = results.diagnosis, results.assessment
    if "diagnose" in results.stale:
        diagnosis = None
    deviations = () if assessment is None else assessment.deviations
    at_points = [deviation.updated_db for deviation in deviations if deviation.at == AT_POINTS]
    stated = results.manifest.get("test", {})
    return MachineRecord(
        machine=machine,
        status=DONE,
        reduction=_reduction(results),
        poles=None if fit is None else _poles(fit, pairs),
        zeros=None if fit is None else _zeros(fit, pairs),
        parameters={} if updated is None else _parameters(updated),
        verdict="" if diagnosis is None else diagnosis.verdict.value,
        assessment="" if assessment is None else assessment.verdict.value,
        is_searched=diagnosis is not None and diagnosis.is_complete,
        findings=() if diagnosis is None else tuple(each for each in diagnosis.findings if each.is_significant),
        poi_error_db=at_points[0] if at_points else float("nan"),
        particulars={name: str(text) for name, text in stated.items() if name not in {"name", "kind"}},
    )


def _reduction(results: Results) -> str:
    """Say which model it is: machines whose reduced models have the same digest can be mixed."""
    model = results.reduced_model
    if model is None:
        return ""
    return digest_arrays([model.mass, model.stiffness, [dof.name for dof in model.dofs]])


def _counterparts(pairs: Pairs | None, kind: str, count: int) -> IntArray:
    found = np.full(count, -1)
    for row in pairs.rows if pairs is not None else ():
        if row.kind == kind and row.verdict is PairVerdict.PAIRED:
            found[row.measured] = row.computed
    return found


def _poles(fit: ModalFit, pairs: Pairs | None) -> Roots:
    modes = mode_shapes(fit)
    frequency_hz, damping_ratio, *std = (np.array(column, float) for column in _numbers(pole_table(fit)))
    return Roots(
        frf=("",) * fit.n_modes,
        frequency_hz=frequency_hz,
        damping_ratio=damping_ratio,
        frequency_std_hz=std[0],
        damping_ratio_std=std[1],
        counterpart=_counterparts(pairs, "pole", fit.n_modes),
        shapes=modes.shapes,
        dofs=tuple(dof.name for dof in modes.dofs),
    )


def _zeros(fit: ModalFit, pairs: Pairs | None) -> Roots:
    frame = zero_table(fit)
    table = frame.to_pydict()
    is_known = np.array(table["identifiable"], bool) & (np.array(table["kind"]) == "complex")
    known = np.flatnonzero(is_known & (np.array(table["frequency_hz"], float) > 0))
    frfs = [f"{out} / {force}" for out, force in zip(table["output_dof"], table["input_dof"], strict=True)]
    frequency_hz, damping_ratio, *std = (np.array(column, float)[known] for column in _numbers(frame))
    return Roots(
        frf=tuple(frfs[index] for index in known),
        frequency_hz=frequency_hz,
        damping_ratio=damping_ratio,
        frequency_std_hz=std[0],
        damping_ratio_std=std[1],
        counterpart=_counterparts(pairs, "zero", len(frfs))[known],
        shapes=np.zeros((0, len(known)), complex),
    )


def _numbers(table: pa.Table) -> list[list[float]]:
    names = ("frequency_hz", "damping_ratio", "frequency_std_hz", "damping_ratio_std")
    return [table[name].to_pylist() for name in names]


def _parameters(updated: UpdatedModel) -> dict[str, tuple[float, float]]:
    """Last value of every parameter of the history, and its deviation where the update has a band of it."""
    history, parts = updated.history, updated.parts
    std = {}
    if len(parts) and "stiffness_ratio_low" in parts:
        width = (parts["stiffness_ratio_high"] - parts["stiffness_ratio_low"]) / (2 * NORMAL_90)
        std = {f"stiffness of {name}": float(value) for name, value in zip(parts["name"], width, strict=True)}
    found = {}
    for name in map(str, history.columns):
        values = history[name].dropna().to_numpy(float) if name.startswith(RATIO) else np.zeros(0)
        if len(values):
            found[name] = float(values[-1]), std.get(name, float("nan"))
    return found
