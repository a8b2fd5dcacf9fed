"""A law at its location in time: its force, and the response to a record with and without it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.nonlinear.segments import starts_at_rest
from frf_ipz.diagnosis.nonlinear.simulate import simulate
from frf_ipz.diagnosis.result import LawInTime

if TYPE_CHECKING:
    from frf_ipz.diagnosis.nonlinear.fitting.alternating_fit import LawFit
    from frf_ipz.diagnosis.nonlinear.fitting.problem import LawFitData, LawFitProblem
    from frf_ipz.diagnosis.observations import ObservedRecord


def simulate_law_in_time(data: LawFitData, problem: LawFitProblem, fit: LawFit) -> LawInTime:
    """Simulate a law for a figure.

    Parameters
    ----------
    data : LawFitData
        Records that it was fitted to, and those held out.
    problem : LawFitProblem
        The segments that it was fitted to.
    fit : LawFit
        The law at its location.

    Returns
    -------
    LawInTime
        With the response to the strongest record from rest that was held out, or else to the strongest of all.
    """
    largest = int(np.argmax(np.abs(fit.motion).max(1)))
    motion, velocity = fit.motion[largest], fit.velocity[largest]
    force = fit.strength * fit.law.unit_force(motion, velocity, fit.shape)
    law = LawInTime(motion_m=motion, velocity_m_s=velocity, force_N=force)
    is_hammer = data.training.kind == "hammer"
    for observations in (data.held_out, data.training):
        from_rest = [record for record in observations.records if _is_from_rest(record, is_hammer=is_hammer)]
        if from_rest:
            record = max(from_rest, key=lambda candidate: candidate.level)
            return _with_response(law, data, problem, fit, record, is_held_out=observations is data.held_out)
    return law


def _is_from_rest(record: ObservedRecord, *, is_hammer: bool) -> bool:
    return not record.has_predecessor if is_hammer else starts_at_rest(record)


def _with_response(
    law: LawInTime,
    data: LawFitData,
    problem: LawFitProblem,
    fit: LawFit,
    record: ObservedRecord,
    *,
    is_held_out: bool,
) -> LawInTime:
    nuisance_prior, nuisance = problem.linear.nuisance_prior.without_initial_states(fit.nuisance)
    alone = replace(data.training, records=(record,))
    simulation = simulate(alone, nuisance_prior, replace(fit, nuisance=nuisance), duration_s=problem.duration_s)
    sizes = np.linalg.norm(simulation.measured[0], axis=1)
    sizes = np.where(sizes > 0, sizes, np.inf)  # a channel that was left out of this record shows nothing
    row = int(np.argmax(np.linalg.norm(simulation.simulated[0] - simulation.without[0], axis=1) / sizes))
    sensor = nuisance_prior.modal_model.sensors[row]
    return replace(
        law,
        record=record.name,
        is_held_out=is_held_out,
        channel=sensor.channel,
        response=sensor.quantity.response,
        unit=sensor.quantity.response_unit(sensor.dof.direction),
        time_s=np.asarray(simulation.step_s * np.arange(simulation.measured.shape[-1]), float),
        measured=simulation.measured[0, row],
        without=simulation.without[0, row],
        simulated=simulation.simulated[0, row],
    )
