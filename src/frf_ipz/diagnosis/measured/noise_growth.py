"""Noise that differs from record to record, as that of recorders does which choose their range.

Where the ends of records show it, it is read there, see `preprocessing.noise_levels`. Elsewhere it is taken to grow:
the noise power of a record is a power of the energy of its force: the exponent is 0 for noise of one power,
and 1 for noise in proportion to the level. What the FRF of all records leaves of record k, whose share of the force's
power on a line is h_k, has the expectation ``v (s_k (1 - 2 h_k) + h_k sum h_m s_m)`` for relative noise powers s; the
exponent is the one that makes all of these misfits the most likely, with a v of its own for each line.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from scipy.optimize import minimize_scalar

from frf_ipz.arrays import FloatArray

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from frf_ipz.diagnosis.measured.group_spectra import GroupSpectra
    from frf_ipz.diagnosis.observations import ObservedRecord

LEAST_RECORDS = 3  # two records have the same misfit, whichever is the noisy one


class RecordNoise(Protocol):
    """Noise power of records of one channel over that of a reference."""

    def scales(self, group: Sequence[ObservedRecord]) -> FloatArray:
        """Give the relative noise power of records, (n_records,) array."""
        ...


def find_unexplained_share(noise: RecordNoise, group: Sequence[ObservedRecord], lines: GroupSpectra) -> FloatArray:
    """Give what the FRF of all records leaves of their noise, over that of the reference.

    Parameters
    ----------
    noise : RecordNoise
        Of the records.
    group : sequence of ObservedRecord
        The records.
    lines : GroupSpectra
        Their transforms.

    Returns
    -------
    (n_lines,) array
        Expectation of `GroupSpectra.unexplained`; 1 for steady noise.
    """
    return np.asarray((1 - shares_of(lines)) @ noise.scales(group) / (len(group) - 1))


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredNoise:
    """Noise power of records that was measured in each.

    Parameters
    ----------
    channel : str
        Column of the recordings.
    """

    channel: str

    def scales(self, group: Sequence[ObservedRecord]) -> FloatArray:
        """Give the relative noise power of records, (n_records,) array: 1 for the mean of all."""
        return np.array([(record.noise_levels or {}).get(self.channel, 1.0) for record in group])

    @staticmethod
    def is_known(records: Iterable[ObservedRecord]) -> bool:
        """Whether it was measured in all records."""
        return all(record.noise_levels is not None for record in records)


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseGrowth:
    """Noise power of records over that of a record of a reference energy.

    Parameters
    ----------
    exponent : float
        Power of the energy of the force, 0 to 1.
    energy : float
        Of the force of the reference, N^2 of samples.
    """

    exponent: float
    energy: float = 1.0

    def scales(self, group: Sequence[ObservedRecord]) -> FloatArray:
        """Give the relative noise power of records.

        Parameters
        ----------
        group : sequence of ObservedRecord
            The records.

        Returns
        -------
        (n_records,) array
            1 for one with the energy of the reference.
        """
        return np.asarray((force_energies(group) / self.energy) ** self.exponent)


STEADY = NoiseGrowth(exponent=0.0)


def force_energies(group: Sequence[ObservedRecord]) -> FloatArray:
    """Give the energy of the force of each record, (n_records,), N^2 of samples; never 0."""
    return np.array([max(float(np.sum(record.force**2)), np.finfo(float).tiny) for record in group])


def fit_growth(parts: Sequence[tuple[Sequence[ObservedRecord], GroupSpectra, int]]) -> NoiseGrowth:
    """Find how the noise of a channel grows with the level of its records.

    Parameters
    ----------
    parts : sequence of (group, GroupSpectra, int)
        Records, their transforms, and the place of the channel among their sensors.

    Returns
    -------
    NoiseGrowth
        Steady where no group has three records or more.
    """
    known = [part for part in parts if len(part[0]) >= LEAST_RECORDS]
    if not known:
        return STEADY
    energies = [force_energies(group) for group, _, _ in known]
    energy = float(np.exp(np.mean(np.log(np.concatenate(energies)))))
    misfits = [_misfits(lines, sensor) for _, lines, sensor in known]

    def unlikeliness(exponent: float) -> float:
        return sum(
            _unlikeliness(shares, left, (of_group / energy) ** exponent)
            for (shares, left), of_group in zip(misfits, energies, strict=True)
        )

    best = minimize_scalar(unlikeliness, bounds=(0.0, 1.0), method="bounded")
    exponent = min((0.0, float(best.x), 1.0), key=unlikeliness)
    return NoiseGrowth(exponent=exponent, energy=energy)


def _misfits(lines: GroupSpectra, sensor: int) -> tuple[FloatArray, FloatArray]:
    """Shares of the force's power and squared misfits, (n_lines, n_records), where there is any."""
    left = np.abs(lines.responses[:, :, sensor] - lines.values[:, sensor, None] * lines.force) ** 2
    used = (lines.power > 0) & (left.sum(1) > 0)
    return shares_of(lines)[used], left[used]


def shares_of(lines: GroupSpectra) -> FloatArray:
    """Give the share that each record has of the force's power, (n_lines, n_records)."""
    return np.asarray(np.abs(lines.force) ** 2 / np.maximum(lines.power, np.finfo(float).tiny)[:, None])


def _unlikeliness(shares: FloatArray, left: FloatArray, scales: FloatArray) -> float:
    """Negative log likelihood of exponential misfits, with the power of each line as is likeliest."""
    expected = scales * (1 - 2 * shares) + shares * (shares @ scales)[:, None]
    power = np.mean(left / expected, axis=1)
    return float(np.sum(left.shape[1] * np.log(power) + np.log(expected).sum(1)))


def growth_of_levels(records: Sequence[ObservedRecord], powers: FloatArray) -> NoiseGrowth:
    """Find how noise grows with the level where its power was measured in each record.

    Parameters
    ----------
    records : sequence of ObservedRecord
        The records.
    powers : (n_records,) array
        Of the noise.

    Returns
    -------
    NoiseGrowth
        The straight line through the logarithms; steady for fewer than three records, and where there is no noise.
    """
    energies = np.log(force_energies(records))
    if len(records) < LEAST_RECORDS or not powers.all() or not np.ptp(energies):
        return STEADY
    slope = float(np.polyfit(energies, np.log(powers), 1)[0])
    return NoiseGrowth(exponent=min(max(slope, 0.0), 1.0), energy=float(np.exp(energies.mean())))
