"""Transfer functions on contours from records or from FRFs, split into training data and data held out for a check."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.measured.contour import COARSE, MIDDLE, fine_contour, wide_contour
from frf_ipz.diagnosis.measured.forces import is_sweep
from frf_ipz.diagnosis.measured.from_frfs import (
    FrfSurvey,
    continue_frfs,
    continue_frfs_coarsely,
    select_nearest_lines,
    survey_frfs,
)
from frf_ipz.diagnosis.measured.from_records import (
    RecordSurvey,
    estimate_transfer_functions,
    survey_records,
    window_decay_1_s,
    with_records,
)
from frf_ipz.diagnosis.measured.from_running_records import estimate_finer_frfs
from frf_ipz.diagnosis.measured.transfer_functions import raise_faint_sizes, select_points
from frf_ipz.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable

    from frf_ipz.arrays import ComplexArray
    from frf_ipz.diagnosis.measured.transfer_functions import TransferFunctions
    from frf_ipz.diagnosis.observations import Observations, ObservedRecord

MIN_RECORDS = 3  # of a group: one of them can be held out, and the others still show the noise
EVERY = 4  # points of the contour: one is held out where records are too few


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DataSplit:
    """Measured transfer functions, split into training data and data held out.

    Parameters
    ----------
    coarse, middle, training, held_out : TransferFunctions
        Far from the axis; between; near it; near it and never fitted.
    survey : RecordSurvey or FrfSurvey
        Noise and resonances of the training data.
    kind : str
        What it is from: impacts of a ``hammer``, ``random`` records from rest, ``running`` ones or sweeps, or ``frf``.
    held_out_kind : str
        What is held out: ``records`` or ``lines``.
    """

    coarse: TransferFunctions
    middle: TransferFunctions
    training: TransferFunctions
    held_out: TransferFunctions
    survey: RecordSurvey | FrfSurvey
    kind: str
    held_out_kind: str


def split_data(observations: Observations) -> DataSplit:
    """Evaluate transfer functions on contours, and hold out a part of the data.

    Parameters
    ----------
    observations : Observations
        Records or FRFs.

    Returns
    -------
    DataSplit
        Training data, and what is held out.

    Raises
    ------
    InputError
        If there are neither records nor FRFs, or nothing of the band remains.
    """
    if not observations.start_at_rest or _has_sweeps(observations):
        return _split_frfs(observations)
    held_out = _records_to_hold_out(observations)
    names = {record.name for record in held_out}
    training = tuple(record for record in observations.records if record.name not in names)
    survey = survey_records(replace(observations, records=training))
    far = _evaluate_far(observations, survey.least_decay_1_s, lambda s: estimate_transfer_functions(survey, s))
    s = fine_contour(survey.resonances, observations.band_hz, survey.least_decay_1_s)
    fine = _inside_band(estimate_transfer_functions(survey, s), observations)
    if not held_out:
        return _hold_out_points(far, fine, survey, observations.kind)
    further = with_records(survey, replace(observations, records=held_out))
    return DataSplit(
        coarse=far[0],
        middle=far[1],
        training=fine,
        held_out=raise_faint_sizes(estimate_transfer_functions(further, fine.s)),
        survey=survey,
        kind=observations.kind,
        held_out_kind="records",
    )


def _has_sweeps(observations: Observations) -> bool:
    """Tell whether records end before the structure has responded to all of a sweep."""
    if observations.kind == "hammer" or observations.frfs is None:
        return False
    decay = window_decay_1_s(observations.records)
    return any(is_sweep(record, observations.band_hz, decay) for record in observations.records)


def _records_to_hold_out(observations: Observations) -> tuple[ObservedRecord, ...]:
    """Give the second strongest impact of each group, if all groups have enough of them."""
    groups: dict[tuple[object, ...], list[ObservedRecord]] = {}
    for dof in observations.input_dofs:
        for record in observations.records_at(dof):
            key = (record.input_dof, *((sensor.channel, sensor.dof) for sensor in record.sensors))
            groups.setdefault(key, []).append(record)
    if observations.kind != "hammer" or min(len(group) for group in groups.values()) < MIN_RECORDS:
        return ()
    return tuple(group[1] for group in groups.values())


def _split_frfs(observations: Observations) -> DataSplit:
    if observations.frfs is None:
        raise InputError("there are neither records nor FRFs to diagnose; check the test file's entries")
    running = observations.kind == "random" and not observations.frfs.window_decay_1_s
    frfs = estimate_finer_frfs(observations, observations.frfs) if running else observations.frfs
    survey = survey_frfs(frfs, observations.band_hz)
    far = _evaluate_far(observations, survey.least_decay_1_s, lambda s: continue_frfs_coarsely(survey, s))
    kind = "running" if running else "frf"
    return _hold_out_points(far, _inside_band(_evaluate_fine(survey, observations), observations), survey, kind)


def _evaluate_far(
    observations: Observations, least_decay_1_s: float, evaluate: Callable[[ComplexArray], TransferFunctions]
) -> tuple[TransferFunctions, TransferFunctions]:
    """Evaluate on the coarse and on the middle contour."""
    coarse, middle = (wide_contour(observations.band_hz, least_decay_1_s, distance) for distance in (COARSE, MIDDLE))
    return _inside_band(evaluate(coarse), observations), _inside_band(evaluate(middle), observations)


def _evaluate_fine(survey: FrfSurvey, observations: Observations) -> TransferFunctions:
    """Continue FRFs of running records, which are noisy and on many lines, off the axis; take others on their lines."""
    if observations.records:
        return continue_frfs(survey, fine_contour(survey.resonances, observations.band_hz, survey.least_decay_1_s))
    spacing = float(np.median(np.diff(survey.frfs.s.imag)))
    return select_nearest_lines(survey, fine_contour(survey.resonances, observations.band_hz, spacing))


def _inside_band(measured: TransferFunctions, observations: Observations) -> TransferFunctions:
    """Drop points in excluded parts of the band, or nearer to them than a point's own width."""
    frequency, width = measured.frequency_hz, measured.s.real / (2 * np.pi)
    included = np.ones(len(frequency), bool)
    for low, high in observations.exclude_hz:
        included &= (frequency < low - width) | (frequency > high + width)
    if not included.any():
        raise InputError("[fit] exclude_hz leaves nothing of the band to diagnose; exclude less of it")
    return raise_faint_sizes(select_points(measured, np.flatnonzero(included)))


def _hold_out_points(
    far: tuple[TransferFunctions, TransferFunctions],
    fine: TransferFunctions,
    survey: RecordSurvey | FrfSurvey,
    kind: str,
) -> DataSplit:
    number = np.arange(len(fine.s))
    is_held_out = number % EVERY == EVERY // 2
    return DataSplit(
        coarse=far[0],
        middle=far[1],
        training=select_points(fine, np.flatnonzero(~is_held_out)),
        held_out=select_points(fine, np.flatnonzero(is_held_out)),
        survey=survey,
        kind=kind,
        held_out_kind="lines",
    )
