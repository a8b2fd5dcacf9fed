"""A law at its place in time: its force, and what a blow would have shown without it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.diagnosis import LawAtWork
from frf_ipz.diagnosis.nonlinear.recorded.segments import starts_at_rest
from frf_ipz.diagnosis.nonlinear.simulate import simulate

if TYPE_CHECKING:
    from frf_ipz.diagnosis.nonlinear.fitting.candidates import Track
    from frf_ipz.diagnosis.nonlinear.fitting.fitted_segments import Recordings
    from frf_ipz.diagnosis.nonlinear.fitting.refine import LawFit
    from frf_ipz.diagnosis.observations import Blow


def show_law(recordings: Recordings, track: Track, fit: LawFit) -> LawAtWork:
    """Show a law at work.

    Parameters
    ----------
    recordings : Recordings
        What it was fitted to, and what was held out.
    track : Track
        The stretches that it was fitted to.
    fit : LawFit
        The law at its place.

    Returns
    -------
    LawAtWork
        With the response to the strongest blow that was held out, or else to the strongest of all, from rest.
    """
    most = int(np.argmax(np.abs(fit.motion).max(1)))
    motion, velocity = fit.motion[most], fit.velocity[most]
    force = fit.strength * fit.law.unit_force(motion, velocity, fit.shape)
    law = LawAtWork(motion_m=motion, velocity_m_s=velocity, force_N=force)
    is_hammer = recordings.training.kind == "hammer"
    for source in (recordings.held_out, recordings.training):
        resting = [blow for blow in source.blows if _is_from_rest(blow, is_hammer=is_hammer)]
        if resting:
            blow = max(resting, key=lambda one: one.level)
            return _with_response(law, recordings, track, fit, blow, is_held_out=source is recordings.held_out)
    return law


def _is_from_rest(blow: Blow, *, is_hammer: bool) -> bool:
    return not blow.follows if is_hammer else starts_at_rest(blow)


def _with_response(
    law: LawAtWork, recordings: Recordings, track: Track, fit: LawFit, blow: Blow, *, is_held_out: bool
) -> LawAtWork:
    freedom, unknowns = track.linear.freedom.without_starts(fit.unknowns)
    alone = replace(recordings.training, blows=(blow,))
    shown = simulate(alone, freedom, replace(fit, unknowns=unknowns), duration_s=track.duration_s)
    sizes = np.maximum(np.linalg.norm(shown.measured[0], axis=1), np.finfo(float).tiny)
    row = int(np.argmax(np.linalg.norm(shown.simulated[0] - shown.without[0], axis=1) / sizes))
    sensor = freedom.plant.sensors[row]
    return replace(
        law,
        blow=blow.name,
        is_held_out=is_held_out,
        channel=sensor.channel,
        response=sensor.quantity.response,
        unit=sensor.quantity.response_unit(sensor.dof.direction),
        time_s=np.asarray(shown.step_s * np.arange(shown.measured.shape[-1]), float),
        measured=shown.measured[0, row],
        without=shown.without[0, row],
        simulated=shown.simulated[0, row],
    )
