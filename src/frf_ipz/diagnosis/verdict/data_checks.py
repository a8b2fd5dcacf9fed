"""Checks of the measurement that need no model: is it linear, is it reciprocal, does it stand out of the noise."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.measured.forces import missing_ringing
from frf_ipz.diagnosis.measured.from_records import RecordSurvey
from frf_ipz.diagnosis.measured.transfer_functions import FAINT, find_faint_frfs
from frf_ipz.diagnosis.result import DataCheck

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray
    from frf_ipz.diagnosis.measured.data_split import DataSplit
    from frf_ipz.diagnosis.measured.transfer_functions import TransferFunctions
    from frf_ipz.diagnosis.nonlinear.linearity import Linearity

MAX_RECIPROCITY_ERROR = 4.0  # mean square difference of FRFs the other way round, over noise and tolerances
MAX_NOISE_SHARE = 0.5  # noise power over signal power, at the median of the points
MIN_RINGING = 1e-4  # of the peak of an impact: less ringing at the start of a record changes nothing
RINGING_SAMPLES = 100  # samples before an impact that hold all ringing
RECIPROCITY_TOLERANCE = 0.02  # relative tolerance of FRFs the other way round: two positions and two gains each


def run_data_checks(source: DataSplit, linearity: Linearity | None) -> tuple[DataCheck, ...]:
    """Check a measurement.

    Parameters
    ----------
    source : DataSplit
        What was measured.
    linearity : Linearity, optional
        How far records of different levels disagree; None where no point was excited twice.

    Returns
    -------
    tuple of DataCheck
        Homogeneity, reciprocity, coherence.
    """
    return check_homogeneity(linearity), check_reciprocity(source.training), check_coherence(source.training)


def list_warnings(source: DataSplit, data_checks: tuple[DataCheck, ...]) -> tuple[str, ...]:
    """List what a user has to know before they trust a diagnosis.

    Parameters
    ----------
    source : DataSplit
        What was measured.
    data_checks : tuple of DataCheck
        From `run_data_checks`.

    Returns
    -------
    tuple of str
        Failed checks, records that begin too late, and FRFs that are too faint to show anything.
    """
    failed = (*(check.statement for check in data_checks if not check.passed), *_warn_of_missing_ringing(source))
    faint = find_faint_frfs(source.training)
    if not faint:
        return failed
    subject, verb, consequence = ("FRF", "stays", "it shows") if len(faint) == 1 else ("FRFs", "stay", "they show")
    return (
        *failed,
        f"{subject} {', '.join(map(str, faint))} {verb} below {100 * FAINT:.0f} % of the largest at the same input: so "
        f"faint that {consequence} nothing, for a small misalignment of the sensor makes as much. What is missing may "
        "hide there; move the sensor.",
    )


def _warn_of_missing_ringing(source: DataSplit) -> tuple[str, ...]:
    """Name the records that begin within the ringing of the converter's filter before an impact."""
    if source.kind != "hammer" or not isinstance(source.survey, RecordSurvey):
        return ()
    records = [record for group in source.survey.groups for record in group]
    pulses = [pulse for group in source.survey.pulses for pulse in group]
    late = [
        record.name
        for record, pulse in zip(records, pulses, strict=True)
        if missing_ringing(pulse, record.responses)[0] > MIN_RINGING * record.level
    ]
    if not late:
        return ()
    return (
        f"{', '.join(late)}: the recording begins within the ringing of the converter's filter before an impact, and "
        f"lacks part of it: FRFs are less certain for that. Let it start {RINGING_SAMPLES} samples before the impact.",
    )


def check_homogeneity(linearity: Linearity | None) -> DataCheck:
    """Check whether strong and weak records agree.

    Parameters
    ----------
    linearity : Linearity, optional
        As for `run_data_checks`.

    Returns
    -------
    DataCheck
        Not checked where no point was excited twice.
    """
    if linearity is None:
        statement = "Linearity could not be checked: no point was excited twice."
        return DataCheck(name="homogeneity", value=np.nan, limit=np.nan, statement=statement)
    statement = (
        f"Records do not agree with one linear system, {linearity.score:.3g} times worse than noise explains: "
        "something is nonlinear, or the structure changed from record to record."
        if linearity.is_nonlinear
        else "Records of all levels agree with one linear system."
    )
    return DataCheck(name="homogeneity", value=linearity.score, limit=linearity.limit, statement=statement)


def check_reciprocity(measured: TransferFunctions) -> DataCheck:
    """Check whether FRFs agree with sensor and excitation exchanged.

    Parameters
    ----------
    measured : TransferFunctions
        Transfer functions.

    Returns
    -------
    DataCheck
        Not checked where no pair was measured both ways.
    """
    ends = [(label.output_dof.unsigned, label.input_dof.unsigned) for label in measured.labels]
    ratios = []
    for index, (output, excited) in enumerate(ends):
        for second in range(index + 1, len(ends)):
            is_same_quantity = measured.labels[index].quantity is measured.labels[second].quantity
            if ends[second] == (excited, output) and output != excited and is_same_quantity:
                ratios.append(_reciprocity_error(measured, index, second))
    if not ratios:
        return DataCheck(
            name="reciprocity",
            value=np.nan,
            limit=MAX_RECIPROCITY_ERROR,
            statement="Reciprocity could not be checked: no FRF was measured both ways.",
        )
    value = max(ratios)
    is_reciprocal = value <= MAX_RECIPROCITY_ERROR
    statement = (
        "FRFs are the same with sensor and excitation exchanged."
        if is_reciprocal
        else f"FRFs differ with sensor and excitation exchanged, {value:.3g} times more than noise and tolerances "
        "explain: a position, a gain or a delay is wrong, or something is nonlinear."
    )
    return DataCheck(name="reciprocity", value=value, limit=MAX_RECIPROCITY_ERROR, statement=statement)


def _reciprocity_error(measured: TransferFunctions, first: int, second: int) -> float:
    signs = measured.labels[first].sign * measured.labels[second].sign
    difference = measured.values[:, first] - signs * measured.values[:, second]
    size = np.maximum(measured.size[:, first], measured.size[:, second])
    noise = (
        _noise_variance(measured)[:, first] + _noise_variance(measured)[:, second] + (RECIPROCITY_TOLERANCE * size) ** 2
    )
    return float(np.mean(np.abs(difference) ** 2 / noise))


def check_coherence(measured: TransferFunctions) -> DataCheck:
    """Check whether the FRFs stand out of the noise.

    Parameters
    ----------
    measured : TransferFunctions
        Transfer functions.

    Returns
    -------
    DataCheck
        Of the worst FRF.
    """
    share = np.median(_noise_variance(measured) / np.maximum(measured.size**2, np.finfo(float).tiny), axis=0)
    worst = int(np.argmax(share))
    value = float(share[worst])
    statement = (
        "The FRFs stand out of the noise."
        if value <= MAX_NOISE_SHARE
        else f"The FRF {measured.labels[worst]} drowns in noise over half of the band or more: excite more "
        "strongly, average more, or leave it out."
    )
    return DataCheck(name="coherence", value=value, limit=MAX_NOISE_SHARE, statement=statement)


def _noise_variance(measured: TransferFunctions) -> FloatArray:
    return np.array([np.diag(covariance).real for covariance in measured.covariance]).T
