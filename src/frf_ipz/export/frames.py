"""Data frames of results, with the columns that the files of a run have."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, fields
from typing import TYPE_CHECKING, Any, TypeAlias

from frf_ipz.assessment.assessment import Assessment, Check
from frf_ipz.diagnosis.result import Diagnosis, Estimate
from frf_ipz.errors import InputError, did_you_mean
from frf_ipz.export import run_tables
from frf_ipz.frf import FrfSet
from frf_ipz.identification.modal_fit import ModalFit
from frf_ipz.ingest.frf_estimate import FrfEstimate
from frf_ipz.late_imports import import_late
from frf_ipz.pairing.pairs import Pairs
from frf_ipz.prediction.prediction import Prediction
from frf_ipz.updating.updated_model import UpdatedModel

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa
else:
    pd = import_late("pandas")

MakeFrame: TypeAlias = "Callable[[Any], pd.DataFrame]"


def to_frame(result: object, table: str | None = None) -> pd.DataFrame:
    """Give a table of a result.

    Parameters
    ----------
    result : object
        Of a type in `FRAMES`.
    table : str, optional
        Its name; the first of the type where it is left out.

    Returns
    -------
    DataFrame
        The table.

    Raises
    ------
    InputError
        If the type has no such table.
    """
    frames = FRAMES[type(result)]
    name = next(iter(frames)) if table is None else table
    if name not in frames:
        raise InputError(f"{type(result).__name__} has no table '{name}'; {did_you_mean(name, list(frames))}")
    return frames[name](result)


def as_frame(table: pa.Table) -> pd.DataFrame:
    """Give a table as a data frame; what is null is NaN or None.

    Parameters
    ----------
    table : pyarrow.Table
        The table.

    Returns
    -------
    DataFrame
        The same columns.
    """
    frame: pd.DataFrame = table.to_pandas()
    return frame


def _of(make: Callable[[Any], pa.Table]) -> MakeFrame:
    return lambda result: as_frame(make(result))


def _findings(diagnosis: Diagnosis) -> pd.DataFrame:
    """One row a finding and parameter; a parameter that is a text has no interval."""
    rows = [
        {
            "effect": finding.effect,
            "location": ", ".join(f"{kind} {value}" for kind, value in finding.location.items()),
            "parameter": name,
            "value": value.value if isinstance(value, Estimate) else value,
            "std": value.std if isinstance(value, Estimate) else None,
            "low": value.low if isinstance(value, Estimate) else None,
            "high": value.high if isinstance(value, Estimate) else None,
            "probability": finding.probability,
            "log_evidence_gain": finding.log_evidence_gain,
        }
        for finding in diagnosis.findings
        for name, value in (finding.parameters or {"": ""}).items()
    ]
    columns = ["effect", "location", "parameter", "value", "std", "low", "high", "probability", "log_evidence_gain"]
    return pd.DataFrame(rows, columns=columns)


def _data_checks(diagnosis: Diagnosis) -> pd.DataFrame:
    rows = [(check.name, check.value, check.limit, check.passed, check.statement) for check in diagnosis.data_checks]
    return pd.DataFrame(rows, columns=["name", "value", "limit", "passed", "statement"])


def _checks(assessment: Assessment) -> pd.DataFrame:
    rows = [{**asdict(check), "verdict": check.verdict.value} for check in assessment.checks]
    return pd.DataFrame(rows, columns=[field.name for field in fields(Check)])


FRAMES: dict[type, dict[str, MakeFrame]] = {
    FrfSet: {"frf": _of(run_tables.frf_table)},
    FrfEstimate: {
        "records": lambda estimate: estimate.records,
        "frf": lambda estimate: estimate.frfs.to_frame(),
        "coherence": lambda estimate: estimate.coherences,
    },
    ModalFit: {
        "poles": _of(run_tables.pole_table),
        "zeros": _of(run_tables.zero_table),
        "modes": _of(run_tables.mode_table),
        "fit": lambda fit: fit.misfit,
        "decisions": lambda fit: fit.decisions,
        "stabilization": lambda fit: fit.stabilization,
    },
    Pairs: {"pairs": _of(run_tables.pair_table)},
    UpdatedModel: {
        "parameters": _of(run_tables.history_table),
        "parts": lambda updated: updated.parts,
        "masses": lambda updated: updated.masses,
    },
    Prediction: {"poi_frf": _of(run_tables.prediction_table)},
    Assessment: {"checks": _checks},
    Diagnosis: {
        "findings": _findings,
        "mismatch": lambda diagnosis: diagnosis.mismatch,
        "data_checks": _data_checks,
    },
}
