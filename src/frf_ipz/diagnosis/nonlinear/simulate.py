"""Simulation of whole records by the model with its law, and their misfit against the measured responses.

The law acts at its location on the modes of the structure, with the fitted nuisance values. It holds for motions of the
location up to those that it was fitted to.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.nonlinear.channel_noise import read_noise
from frf_ipz.diagnosis.nonlinear.model.time_response import TimeResponse
from frf_ipz.diagnosis.nonlinear.model.time_stepping import step_in_time
from frf_ipz.diagnosis.nonlinear.segments import SegmentWindow, cut_segments
from frf_ipz.errors import InputError

if TYPE_CHECKING:
    from frf_ipz.diagnosis.nonlinear.fitting.alternating_fit import LawFit
    from frf_ipz.diagnosis.nonlinear.model.modal_model import ModalModel
    from frf_ipz.diagnosis.nonlinear.model.nuisance_prior import NuisancePrior
    from frf_ipz.diagnosis.nonlinear.model.time_stepping import TimeHistory
    from frf_ipz.diagnosis.nonlinear.segments import SegmentSet
    from frf_ipz.diagnosis.observations import Observations
    from frf_ipz.dofs import AnyDof


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Simulation:
    """Responses of a structure with a law to the forces of a test.

    Parameters
    ----------
    step_s : float
        Time step, s.
    measured, simulated, without : (n_records, n_sensors, n_samples) array
        Responses from shortly before each impact on, as measured, with the law and without it, in the sensors'
        quantities and signs; 0 where a record has no such sensor.
    motion : (n_records, n_samples) array
        Of the law's location, m.
    force : (n_records, n_samples) array
        Of the law, against the motion, N.
    misfit : (n_records,) array
        Norm of measured minus simulated over the norm of measured, on the lines of the band.
    """

    step_s: float
    measured: FloatArray
    simulated: FloatArray
    without: FloatArray
    motion: FloatArray
    force: FloatArray
    misfit: FloatArray


def simulate(
    observations: Observations, nuisance_prior: NuisancePrior, fit: LawFit, *, duration_s: float = np.inf
) -> Simulation:
    """Simulate records.

    Parameters
    ----------
    observations : Observations
        Records that start at rest, without the dispersion of their converters (`remove_dispersion`) if the law was
        fitted without it.
    nuisance_prior : NuisancePrior
        That the law was fitted with.
    fit : LawFit
        The law at its location.
    duration_s : float
        How much of each record, s; all of it by default.

    Returns
    -------
    Simulation
        Of all records.

    Raises
    ------
    InputError
        If a record starts in motion.
    """
    time_response, history = _step_records(observations, nuisance_prior, fit, duration_s)
    segments, responses = time_response.segments, _sensor_responses(time_response, history.force)
    measured = _cut_responses(observations, nuisance_prior.modal_model, segments)
    is_present = np.abs(measured).max(-1, keepdims=True) > 0
    return Simulation(
        step_s=segments.step_s,
        measured=measured,
        simulated=responses * is_present,
        without=_sensor_responses(time_response, np.zeros_like(history.force)) * is_present,
        motion=history.motion[:, :: segments.steps_per_sample],
        force=history.force[:, :: segments.steps_per_sample],
        misfit=_relative_misfit(measured, responses, segments.step_s, observations),
    )


def subtract_law(observations: Observations, nuisance_prior: NuisancePrior, fit: LawFit) -> Observations:
    """Subtract from records the response to a law's force.

    Parameters
    ----------
    observations : Observations
        As for `simulate`.
    nuisance_prior : NuisancePrior
        That the law was fitted with.
    fit : LawFit
        The law at its location.

    Returns
    -------
    Observations
        As the structure would have responded without the law; unchanged before an impact.

    Raises
    ------
    InputError
        If a record starts in motion.
    """
    time_response, history = _step_records(observations, nuisance_prior, fit, np.inf)
    by_law = _sensor_responses(time_response, history.force)
    by_law = by_law - _sensor_responses(time_response, np.zeros_like(history.force))
    records, keys = list(observations.records), _sensor_keys(nuisance_prior.modal_model)
    for row, number in enumerate(time_response.segments.record_of):
        record, start = records[number], time_response.segments.first_sample[row]
        responses = record.responses.copy()
        for response, sensor in zip(responses, record.sensors, strict=True):
            response[start : start + by_law.shape[-1]] -= by_law[row, keys.index((sensor.channel, sensor.dof))]
        records[number] = replace(record, responses=responses)
    return replace(observations, records=tuple(records))


def _step_records(
    observations: Observations, nuisance_prior: NuisancePrior, fit: LawFit, duration_s: float
) -> tuple[TimeResponse, TimeHistory]:
    """Step through records, or the first part of them."""
    longest = max(record.duration_s for record in observations.records)
    window = SegmentWindow(duration_s=min(duration_s, longest), loudest=False)
    segments = cut_segments(observations, nuisance_prior.modal_model, read_noise(observations), window)
    if segments.moving.any():
        raise InputError("a record starts in motion of unknown state; only records that start at rest are simulated")
    time_response = TimeResponse(
        segments=segments, nuisance_prior=nuisance_prior, nuisance=fit.nuisance, location=fit.location
    )
    compliance = time_response.compliance(hold=fit.law.holds)
    numbers = fit.strength, fit.shape
    return time_response, step_in_time(fit.law, numbers, compliance, *time_response.motion_without_law())


def _sensor_keys(modal_model: ModalModel) -> list[tuple[str, AnyDof]]:
    return [(sensor.channel, sensor.dof) for sensor in modal_model.sensors]


def _sensor_responses(time_response: TimeResponse, law_force: FloatArray) -> FloatArray:
    """(n_records, n_sensors, n_samples) responses in the sensors' quantities."""
    modal_model, segments = time_response.nuisance_prior.modal_model, time_response.segments
    modes = time_response.modes()
    force = time_response.input_forces() - time_response.shapes[:, None] * law_force[:, None]
    z = modes.drive(force)
    displacement, velocity = modes.displacement(z), modes.velocity(z)
    loss, square = -2 * modes.poles.real[:, None], np.abs(modes.poles[:, None]) ** 2
    modal = (displacement, velocity, force - loss * velocity - square * displacement)
    shapes = modal_model.at_sensors.shapes + time_response.nuisance_values.sensors
    at_inputs = (modal_model.at_sensors.weights @ modal_model.at_inputs.static)[:, segments.input_of]
    at_location = modal_model.at_sensors.weights @ modal_model.at_locations.static[:, time_response.location]
    static = at_inputs.T[..., None] * segments.fine_force[:, None] - at_location[:, None] * law_force[:, None]
    responses = np.zeros(static[..., :: segments.steps_per_sample].shape)
    for row, sensor in enumerate(modal_model.sensors):
        residual = static[:, row]
        for _ in range(sensor.quantity.power):
            residual = np.gradient(residual, time_response.step_s, axis=-1)
        modal_sum = np.einsum("m,bmt->bt", shapes[row], modal[sensor.quantity.power])
        responses[:, row] = (modal_sum + residual)[:, :: segments.steps_per_sample]
    return responses


def _cut_responses(observations: Observations, modal_model: ModalModel, segments: SegmentSet) -> FloatArray:
    responses = np.zeros((segments.n_segments, segments.motion.shape[1], segments.n_samples))
    keys = _sensor_keys(modal_model)
    for row, number in enumerate(segments.record_of):
        record, start = observations.records[number], segments.first_sample[row]
        for sensor, response in zip(record.sensors, record.responses, strict=True):
            part = response[start : start + segments.n_samples]
            responses[row, keys.index((sensor.channel, sensor.dof))] = part
    return responses


def _relative_misfit(
    measured: FloatArray, simulated: FloatArray, step_s: float, observations: Observations
) -> FloatArray:
    frequency = np.asarray(np.fft.rfftfreq(measured.shape[-1], step_s))
    inside = observations.mask_band(frequency, frequency[1])
    present = np.abs(measured).max(-1, keepdims=True) > 0
    response, misfit = (_spectrum(signals)[..., inside] for signals in (measured, (measured - simulated) * present))
    size = np.maximum(np.linalg.norm(response, axis=(1, 2)), 1e-300)
    return np.asarray(np.linalg.norm(misfit, axis=(1, 2)) / size)


def _spectrum(signals: FloatArray) -> ComplexArray:
    return np.asarray(np.fft.rfft(signals))
