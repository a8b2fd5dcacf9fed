"""Records with the same excited point and the same sensors, transformed on uniform lines beside the imaginary axis."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import next_fast_len

from frf_ipz.arrays import ComplexArray, FloatArray

if TYPE_CHECKING:
    from frf_ipz.diagnosis.observations import Observations, ObservedRecord

FINER = 4  # lines for each one of the record: peaks are sampled at their tops


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GroupSpectra:
    """Transforms of the records of one group.

    Parameters
    ----------
    s : (n_lines,) complex array
        rad/s.
    force : (n_lines, n_records) complex array
        N s.
    responses : (n_lines, n_records, n_sensors) complex array
        SI.
    """

    s: ComplexArray
    force: ComplexArray
    responses: ComplexArray

    @property
    def frequency_hz(self) -> FloatArray:
        """Frequencies of the lines, Hz."""
        return np.asarray(self.s.imag / (2 * np.pi))

    @property
    def power(self) -> FloatArray:
        """Energy of the force of all records, (n_lines,)."""
        return np.asarray((np.abs(self.force) ** 2).sum(1))

    @property
    def values(self) -> ComplexArray:
        """H1 estimate of the FRFs from all records, (n_lines, n_sensors)."""
        crossed = (self.responses * self.force.conj()[:, :, None]).sum(1)
        return np.asarray(crossed / self.power[:, None])

    @property
    def unexplained(self) -> FloatArray:
        """Energy of each response, (n_lines, n_sensors), that the FRF of all records does not explain."""
        misfit = self.responses - self.values[:, None, :] * self.force[:, :, None]
        return np.asarray((np.abs(misfit) ** 2).sum(1) / (self.force.shape[1] - 1))


def transform_group(group: tuple[ObservedRecord, ...], band_hz: tuple[float, float], decay_1_s: float) -> GroupSpectra:
    """Transform the records of a group to uniform lines of a band by FFT.

    Parameters
    ----------
    group : tuple of ObservedRecord
        With one excited point and the same sensors; where they differ in length, the shortest counts.
    band_hz : pair of float
        Hz.
    decay_1_s : float
        Distance of the lines from the axis.

    Returns
    -------
    GroupSpectra
        On `FINER` times as many lines as the shortest record has.
    """
    n, step = min(record.n_samples for record in group), group[0].step_s
    window = np.exp(-decay_1_s * step * np.arange(n)) * step
    padded = next_fast_len(FINER * n, real=True)
    frequency = np.fft.rfftfreq(padded, step)
    inside = (frequency >= band_hz[0]) & (frequency <= band_hz[1])
    force = np.stack([np.fft.rfft(record.force[:n] * window, padded)[inside] for record in group], 1)
    responses = np.stack([np.fft.rfft(record.responses[:, :n] * window, padded)[:, inside].T for record in group], 1)
    s = np.asarray(decay_1_s + 2j * np.pi * frequency[inside], np.complex128)
    return GroupSpectra(s=s, force=force, responses=responses)


def group_records(observations: Observations) -> tuple[tuple[ObservedRecord, ...], ...]:
    """Group the records with the same excited point and the same sensors.

    Parameters
    ----------
    observations : Observations
        Of a hammer or a shaker.

    Returns
    -------
    tuple of tuple of ObservedRecord
        The highest force of each group first.
    """
    keys = dict.fromkeys(
        (record.input_dof, tuple((sensor.channel, sensor.dof) for sensor in record.sensors))
        for record in observations.records
    )
    return tuple(
        tuple(
            record
            for record in observations.records_at(key[0])
            if tuple((sensor.channel, sensor.dof) for sensor in record.sensors) == key[1]
        )
        for key in keys
    )
