"""The model with its law in time: whole records as it would have answered, and how far they are from what was measured.

The law sits at its place on the modes of the structure, with the deviations from the nominal model that the fit found.
It holds for motions of the place up to those that it was fitted to.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.nonlinear.fitting.time_stepping import step_in_time
from frf_ipz.diagnosis.nonlinear.linear.place_in_time import PlaceInTime
from frf_ipz.diagnosis.nonlinear.recorded.noise import read_noise
from frf_ipz.diagnosis.nonlinear.recorded.segments import FINER, Window, transform
from frf_ipz.errors import InputError

if TYPE_CHECKING:
    from frf_ipz.diagnosis.nonlinear.fitting.refine import LawFit
    from frf_ipz.diagnosis.nonlinear.fitting.time_stepping import TimeSteps
    from frf_ipz.diagnosis.nonlinear.linear.modal_model import ModalModel
    from frf_ipz.diagnosis.nonlinear.linear.nuisance_prior import NuisancePrior
    from frf_ipz.diagnosis.nonlinear.recorded.segments import SegmentSet
    from frf_ipz.diagnosis.observations import Observations
    from frf_ipz.dofs import Dof


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Simulation:
    """How a structure with a law answers the forces of a test.

    Parameters
    ----------
    step_s : float
        Time step, s.
    measured, simulated, without : (n_blows, n_sensors, n_samples) array
        Responses from shortly before each blow on, as measured, with the law and without it, in the sensors' quantities
        and signs; 0 where a blow lacks a sensor.
    motion : (n_blows, n_samples) array
        Of the law's place, m.
    force : (n_blows, n_samples) array
        Of the law, against the motion, N.
    misfit : (n_blows,) array
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
        Blows or records that start at rest, without the dispersion of their converters (`remove_dispersion`) if the
        law was fitted without it.
    nuisance_prior : NuisancePrior
        Unknowns of the linear model that the law was fitted with.
    fit : LawFit
        The law at its place.
    duration_s : float
        How much of each record, s; all of it unless told.

    Returns
    -------
    Simulation
        Of all blows.

    Raises
    ------
    InputError
        If a record starts in motion.
    """
    place, done = _in_time(observations, nuisance_prior, fit, duration_s)
    stretches, shown = place.stretches, _sensors(place, done.force)
    measured = _measured(observations, nuisance_prior.modal_model, stretches)
    is_there = np.abs(measured).max(-1, keepdims=True) > 0
    return Simulation(
        step_s=stretches.step_s,
        measured=measured,
        simulated=shown * is_there,
        without=_sensors(place, np.zeros_like(done.force)) * is_there,
        motion=done.motion[:, ::FINER],
        force=done.force[:, ::FINER],
        misfit=_misfit(measured, shown, stretches.step_s, observations),
    )


def subtract_law(observations: Observations, nuisance_prior: NuisancePrior, fit: LawFit) -> Observations:
    """Take out of recordings what a law adds to them.

    Parameters
    ----------
    observations : Observations
        As for `simulate`.
    nuisance_prior : NuisancePrior
        Unknowns of the linear model that the law was fitted with.
    fit : LawFit
        The law at its place.

    Returns
    -------
    Observations
        As the structure would have answered without the law; what lies before a blow is left as it is.

    Raises
    ------
    InputError
        If a record starts in motion.
    """
    place, done = _in_time(observations, nuisance_prior, fit, np.inf)
    added = _sensors(place, done.force) - _sensors(place, np.zeros_like(done.force))
    records, keys = list(observations.records), _channels(nuisance_prior.modal_model)
    for row, number in enumerate(place.stretches.record_of):
        record, start = records[number], place.stretches.first_sample[row]
        left = record.responses.copy()
        for response, sensor in zip(left, record.sensors, strict=True):
            response[start : start + added.shape[-1]] -= added[row, keys.index((sensor.channel, sensor.dof))]
        records[number] = replace(record, responses=left)
    return replace(observations, records=tuple(records))


def _in_time(
    observations: Observations, nuisance_prior: NuisancePrior, fit: LawFit, duration_s: float
) -> tuple[PlaceInTime, TimeSteps]:
    """Go through records, or the first part of them."""
    longest = max(record.duration_s for record in observations.records)
    window = Window(duration_s=min(duration_s, longest), loudest=False)
    stretches = transform(observations, nuisance_prior.modal_model, read_noise(observations), window)
    if stretches.moving.any():
        raise InputError("a record starts in motion, which is not known; only records that start at rest are simulated")
    place = PlaceInTime(stretches=stretches, nuisance_prior=nuisance_prior, unknowns=fit.unknowns, place=fit.place)
    yielding = place.yielding(constant=fit.law.holds)
    return place, step_in_time(fit.law, (fit.strength, fit.shape), yielding, *place.without_law())


def _channels(modal_model: ModalModel) -> list[tuple[str, Dof]]:
    return [(sensor.channel, sensor.dof) for sensor in modal_model.sensors]


def _sensors(place: PlaceInTime, law_force: FloatArray) -> FloatArray:
    """(n_blows, n_sensors, n_samples) what sensors show."""
    modal_model, stretches, modes = place.nuisance_prior.modal_model, place.stretches, place.modes()
    push = place.push() - place.shapes[:, None] * law_force[:, None]
    z = modes.drive(push)
    displacement, velocity = modes.displacement(z), modes.velocity(z)
    loss, square = -2 * modes.poles.real[:, None], np.abs(modes.poles[:, None]) ** 2
    modal = (displacement, velocity, push - loss * velocity - square * displacement)
    shapes = modal_model.at_sensors.shapes + place.deviations.sensors
    at_inputs = (modal_model.at_sensors.weights @ modal_model.at_inputs.static)[:, stretches.input_of]
    at_place = modal_model.at_sensors.weights @ modal_model.at_places.static[:, place.place]
    rest = at_inputs.T[..., None] * stretches.fine_force[:, None] - at_place[:, None] * law_force[:, None]
    shown = np.zeros(rest[..., ::FINER].shape)
    for row, sensor in enumerate(modal_model.sensors):
        own = rest[:, row]
        for _ in range(sensor.quantity.power):
            own = np.gradient(own, place.step_s, axis=-1)
        shown[:, row] = (np.einsum("m,bmt->bt", shapes[row], modal[sensor.quantity.power]) + own)[:, ::FINER]
    return shown


def _measured(observations: Observations, modal_model: ModalModel, stretches: SegmentSet) -> FloatArray:
    found = np.zeros((stretches.n_records, stretches.motion.shape[1], stretches.n_samples))
    keys = _channels(modal_model)
    for row, number in enumerate(stretches.record_of):
        record, start = observations.records[number], stretches.first_sample[row]
        for sensor, response in zip(record.sensors, record.responses, strict=True):
            found[row, keys.index((sensor.channel, sensor.dof))] = response[start : start + stretches.n_samples]
    return found


def _misfit(measured: FloatArray, simulated: FloatArray, step_s: float, observations: Observations) -> FloatArray:
    frequency = np.asarray(np.fft.rfftfreq(measured.shape[-1], step_s))
    inside = observations.mask_band(frequency, frequency[1])
    present = np.abs(measured).max(-1, keepdims=True) > 0
    there, away = (_lines(signals)[..., inside] for signals in (measured, (measured - simulated) * present))
    return np.asarray(np.linalg.norm(away, axis=(1, 2)) / np.maximum(np.linalg.norm(there, axis=(1, 2)), 1e-300))


def _lines(signals: FloatArray) -> ComplexArray:
    return np.asarray(np.fft.rfft(signals))
