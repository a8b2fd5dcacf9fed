"""One door to transfer functions on contours, from blows or from FRFs; and what of them is kept for a check."""

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

ENOUGH_BLOWS = 3  # at a place: one of them can be kept for the check, the rest still tell the noise
EVERY = 4  # points of the contour: one is kept for the check where blows are too few


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DataSplit:
    """What is measured, divided into what is fitted and what is kept for the check.

    Parameters
    ----------
    coarse, middle, training, held_out : TransferFunctions
        Far from the axis; on the way; near it; near it and never fitted.
    survey : RecordSurvey or FrfSurvey
        Noise and resonances of what is fitted.
    kind : str
        What was looked at: blows of a ``hammer``, ``random`` records from rest, ``running`` ones or sweeps,
        or ``frf``.
    held : str
        What was kept for the check: ``records`` or ``lines``.
    held_names : tuple of str
        The blows that were kept.
    """

    coarse: TransferFunctions
    middle: TransferFunctions
    training: TransferFunctions
    held_out: TransferFunctions
    survey: RecordSurvey | FrfSurvey
    kind: str
    held: str
    held_names: tuple[str, ...] = ()


def split_data(observations: Observations) -> DataSplit:
    """Measure, and keep something for the check.

    Parameters
    ----------
    observations : Observations
        Blows, records or FRFs.

    Returns
    -------
    DataSplit
        Transfer functions.

    Raises
    ------
    InputError
        If there is nothing to look at, or nothing of it is left.
    """
    if not observations.are_from_rest or _sweeps(observations):
        return _of_frfs(observations)
    kept = _kept_records(observations)
    names = {record.name for record in kept}
    fitted = tuple(record for record in observations.records if record.name not in names)
    found = survey_records(replace(observations, records=fitted))
    far = _far(observations, found.least_decay_1_s, lambda s: estimate_transfer_functions(found, s))
    s = fine_contour(found.resonances, observations.band_hz, found.least_decay_1_s)
    near = _looked_at(estimate_transfer_functions(found, s), observations)
    if not kept:
        return _by_points(far, near, found, observations.kind)
    held = raise_faint_sizes(
        estimate_transfer_functions(with_records(found, replace(observations, records=kept)), near.s)
    )
    return DataSplit(
        coarse=far[0],
        middle=far[1],
        training=near,
        held_out=held,
        survey=found,
        kind=observations.kind,
        held="blows",
        held_names=tuple(sorted(names)),
    )


def _sweeps(observations: Observations) -> bool:
    """Tell whether records end before the structure has answered all of a sweep."""
    if observations.kind == "hammer" or observations.frfs is None:
        return False
    decay = window_decay_1_s(observations.records)
    return any(is_sweep(record, observations.band_hz, decay) for record in observations.records)


def _kept_records(observations: Observations) -> tuple[ObservedRecord, ...]:
    """One of the stronger blows of every place and layout of sensors, if each has enough of them."""
    groups: dict[tuple[object, ...], list[ObservedRecord]] = {}
    for dof in observations.input_dofs:
        for record in observations.at(dof):
            key = (record.input_dof, *((sensor.channel, sensor.dof) for sensor in record.sensors))
            groups.setdefault(key, []).append(record)
    if observations.kind != "hammer" or min(len(group) for group in groups.values()) < ENOUGH_BLOWS:
        return ()
    return tuple(group[1] for group in groups.values())


def _of_frfs(observations: Observations) -> DataSplit:
    if observations.frfs is None:
        raise InputError("there are neither blows nor FRFs to diagnose; check the test file's entries")
    running = observations.kind == "random" and not observations.frfs.window_decay_1_s
    frfs = estimate_finer_frfs(observations, observations.frfs) if running else observations.frfs
    found = survey_frfs(frfs, observations.band_hz)
    far = _far(observations, found.least_decay_1_s, lambda s: continue_frfs_coarsely(found, s))
    kind = "running" if running else "frf"
    return _by_points(far, _looked_at(_near(found, observations), observations), found, kind)


def _far(
    observations: Observations, least_decay_1_s: float, at: Callable[[ComplexArray], TransferFunctions]
) -> tuple[TransferFunctions, TransferFunctions]:
    """Measure far from the axis, and on the way to it."""
    coarse, middle = (wide_contour(observations.band_hz, least_decay_1_s, distance) for distance in (COARSE, MIDDLE))
    return _looked_at(at(coarse), observations), _looked_at(at(middle), observations)


def _near(found: FrfSurvey, observations: Observations) -> TransferFunctions:
    """Smooth what was estimated from running records, on many fine lines; take others as they are."""
    if observations.records:
        return continue_frfs(found, fine_contour(found.resonances, observations.band_hz, found.least_decay_1_s))
    spacing = float(np.median(np.diff(found.frfs.s.imag)))
    return select_nearest_lines(found, fine_contour(found.resonances, observations.band_hz, spacing))


def _looked_at(measured: TransferFunctions, observations: Observations) -> TransferFunctions:
    """Leave out stretches of the band, and what is nearer to them than a point's own width."""
    frequency, width = measured.frequency_hz, measured.s.real / (2 * np.pi)
    kept = np.ones(len(frequency), bool)
    for low, high in observations.exclude_hz:
        kept &= (frequency < low - width) | (frequency > high + width)
    if not kept.any():
        raise InputError("[fit] exclude_hz leaves nothing of the band to diagnose; exclude narrower stretches")
    return raise_faint_sizes(select_points(measured, np.flatnonzero(kept)))


def _by_points(
    far: tuple[TransferFunctions, TransferFunctions],
    near: TransferFunctions,
    found: RecordSurvey | FrfSurvey,
    kind: str,
) -> DataSplit:
    number = np.arange(len(near.s))
    held = number % EVERY == EVERY // 2
    return DataSplit(
        coarse=far[0],
        middle=far[1],
        training=select_points(near, np.flatnonzero(~held)),
        held_out=select_points(near, np.flatnonzero(held)),
        survey=found,
        kind=kind,
        held="lines",
    )
