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

MAX_RECIPROCITY_ERROR = 4.0  # the same of FRFs the other way round, over noise and tolerances
MAX_NOISE_SHARE = 0.5  # noise power over signal power, at the median of the points
MIN_RINGING = 1e-4  # of a blow's peak: less ringing at the start of a record changes nothing
RINGING_SAMPLES = 100  # samples before a blow that hold all ringing
RECIPROCITY_TOLERANCE = 0.02  # relative tolerance of FRFs the other way round: two places and two gains each


def run_data_checks(source: DataSplit, linearity: Linearity | None) -> tuple[DataCheck, ...]:
    """Check a measurement.

    Parameters
    ----------
    source : DataSplit
        What was measured.
    linearity : Linearity, optional
        How far blows of different levels disagree; None where no place has two blows.

    Returns
    -------
    tuple of DataCheck
        Homogeneity, reciprocity, coherence.
    """
    return check_homogeneity(linearity), check_reciprocity(source.training), check_coherence(source.training)


def list_warnings(source: DataSplit, gates: tuple[DataCheck, ...]) -> tuple[str, ...]:
    """Say what a user has to know before they believe a diagnosis.

    Parameters
    ----------
    source : DataSplit
        What was measured.
    gates : tuple of DataCheck
        As `run_data_checks` gives them.

    Returns
    -------
    tuple of str
        What failed, which records began too late, and which FRFs were too faint to tell anything.
    """
    failed = (*(gate.statement for gate in gates if not gate.passed), *_warn_of_missing_ringing(source))
    faint = find_faint_frfs(source.training)
    if not faint:
        return failed
    subject, verb, they = ("FRF", "stays", "it tells") if len(faint) == 1 else ("FRFs", "stay", "they tell")
    return (
        *failed,
        f"{subject} {', '.join(map(str, faint))} {verb} below {100 * FAINT:.0f} % of the largest of the same blow: so "
        f"faint that {they} nothing, for a sensor a little out of line makes as much. What is missing may hide there; "
        "put the sensor elsewhere.",
    )


def _warn_of_missing_ringing(source: DataSplit) -> tuple[str, ...]:
    """Say which records begin within the ringing that the converter's filter makes before a blow."""
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
        f"{', '.join(late)}: the recording begins within the ringing that the converter's filter makes before a blow, "
        f"and lacks part of it: FRFs are less certain by that. Let it start {RINGING_SAMPLES} samples before the blow.",
    )


def check_homogeneity(linearity: Linearity | None) -> DataCheck:
    """Say whether strong and weak blows agree.

    Parameters
    ----------
    linearity : Linearity, optional
        As for `run_data_checks`.

    Returns
    -------
    DataCheck
        Not checked where no place has two blows.
    """
    if linearity is None:
        statement = "Linearity could not be checked: no place has two blows or records."
        return DataCheck(name="homogeneity", value=np.nan, limit=np.nan, statement=statement)
    statement = (
        f"Blows do not agree with one linear system, {linearity.score:.3g} times worse than noise explains: something "
        "is not linear, or the structure changed from blow to blow."
        if linearity.is_nonlinear
        else "Blows of all levels agree with one linear system."
    )
    return DataCheck(name="homogeneity", value=linearity.score, limit=linearity.limit, statement=statement)


def check_reciprocity(measured: TransferFunctions) -> DataCheck:
    """Compare FRFs whose sensor and blow change places.

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
    for index, (output, struck) in enumerate(ends):
        for other in range(index + 1, len(ends)):
            same = measured.labels[index].quantity is measured.labels[other].quantity
            if ends[other] == (struck, output) and output != struck and same:
                ratios.append(_reciprocity_error(measured, index, other))
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
        "FRFs are the same with sensor and blow exchanged."
        if is_reciprocal
        else f"FRFs differ with sensor and blow exchanged, {value:.3g} times more than noise and tolerances explain: a "
        "place, a gain or a delay is wrong, or something is not linear."
    )
    return DataCheck(name="reciprocity", value=value, limit=MAX_RECIPROCITY_ERROR, statement=statement)


def _reciprocity_error(measured: TransferFunctions, first: int, second: int) -> float:
    signs = measured.labels[first].sign * measured.labels[second].sign
    difference = measured.values[:, first] - signs * measured.values[:, second]
    size = np.maximum(measured.size[:, first], measured.size[:, second])
    noise = _noise(measured)[:, first] + _noise(measured)[:, second] + (RECIPROCITY_TOLERANCE * size) ** 2
    return float(np.mean(np.abs(difference) ** 2 / noise))


def check_coherence(measured: TransferFunctions) -> DataCheck:
    """Compare noise with signal.

    Parameters
    ----------
    measured : TransferFunctions
        Transfer functions.

    Returns
    -------
    DataCheck
        Of the worst FRF.
    """
    share = np.median(_noise(measured) / np.maximum(measured.size**2, np.finfo(float).tiny), axis=0)
    worst = int(np.argmax(share))
    value = float(share[worst])
    statement = (
        "The FRFs stand out of the noise."
        if value <= MAX_NOISE_SHARE
        else f"The FRF {measured.labels[worst]} drowns in noise over half of the band or more: strike harder, average "
        "more, or leave it out."
    )
    return DataCheck(name="coherence", value=value, limit=MAX_NOISE_SHARE, statement=statement)


def _noise(measured: TransferFunctions) -> FloatArray:
    return np.array([np.diag(covariance).real for covariance in measured.covariance]).T
