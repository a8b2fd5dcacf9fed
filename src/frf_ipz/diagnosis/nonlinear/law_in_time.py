"""A law at its place in time: its force, and what a blow would have shown without it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.nonlinear.recorded.segments import starts_at_rest
from frf_ipz.diagnosis.nonlinear.simulate import simulate
from frf_ipz.diagnosis.result import LawInTime

if TYPE_CHECKING:
    from frf_ipz.diagnosis.nonlinear.fitting.candidates import LawFitProgress
    from frf_ipz.diagnosis.nonlinear.fitting.fitted_segments import FittedSegments
    from frf_ipz.diagnosis.nonlinear.fitting.refine import LawFit
    from frf_ipz.diagnosis.observations import ObservedRecord


def show_law(recordings: FittedSegments, track: LawFitProgress, fit: LawFit) -> LawInTime:
    """Show a law at work.

    Parameters
    ----------
    recordings : FittedSegments
        What it was fitted to, and what was held out.
    track : LawFitProgress
        The stretches that it was fitted to.
    fit : LawFit
        The law at its place.

    Returns
    -------
    LawInTime
        With the response to the strongest blow that was held out, or else to the strongest of all, from rest.
    """
    most = int(np.argmax(np.abs(fit.motion).max(1)))
    motion, velocity = fit.motion[most], fit.velocity[most]
    force = fit.strength * fit.law.unit_force(motion, velocity, fit.shape)
    law = LawInTime(motion_m=motion, velocity_m_s=velocity, force_N=force)
    is_hammer = recordings.training.kind == "hammer"
    for source in (recordings.held_out, recordings.training):
        resting = [record for record in source.records if _is_from_rest(record, is_hammer=is_hammer)]
        if resting:
            record = max(resting, key=lambda one: one.level)
            return _with_response(law, recordings, track, fit, record, is_held_out=source is recordings.held_out)
    return law


def _is_from_rest(record: ObservedRecord, *, is_hammer: bool) -> bool:
    return not record.has_predecessor if is_hammer else starts_at_rest(record)


def _with_response(
    law: LawInTime,
    recordings: FittedSegments,
    track: LawFitProgress,
    fit: LawFit,
    record: ObservedRecord,
    *,
    is_held_out: bool,
) -> LawInTime:
    nuisance_prior, unknowns = track.linear.nuisance_prior.without_starts(fit.unknowns)
    alone = replace(recordings.training, records=(record,))
    shown = simulate(alone, nuisance_prior, replace(fit, unknowns=unknowns), duration_s=track.duration_s)
    sizes = np.maximum(np.linalg.norm(shown.measured[0], axis=1), np.finfo(float).tiny)
    row = int(np.argmax(np.linalg.norm(shown.simulated[0] - shown.without[0], axis=1) / sizes))
    sensor = nuisance_prior.modal_model.sensors[row]
    return replace(
        law,
        record=record.name,
        is_held_out=is_held_out,
        channel=sensor.channel,
        response=sensor.quantity.response,
        unit=sensor.quantity.response_unit(sensor.dof.direction),
        time_s=np.asarray(shown.step_s * np.arange(shown.measured.shape[-1]), float),
        measured=shown.measured[0, row],
        without=shown.without[0, row],
        simulated=shown.simulated[0, row],
    )
