"""Test of linearity: does one linear system explain the records of all levels? No model is needed.

Impacts start at rest: damped by exp(-sigma t) until nothing is left at their end, the responses over the forces must
agree line by line. With a shaker the structure may move before the record: within a few neighbouring lines every linear
system is a quotient of two short polynomials, the same for all records, and the transient of a record is another one
over the same denominator, different in each record (the local rational method of [McKelveyGuerin2012]). The misfit is
compared with the noise of the channels and with a small part of the response.

Under the exponential window of impacts noise is nearly the same on neighbouring lines, and so is that of the force in
the few milliseconds of its gate: the lines of a group hold few independent numbers, whose mean may exceed any fixed
limit by chance. How far it may is computed from the covariance of the lines (three cumulants of a sum of exponential
variables, [Buckley1988]), for all groups of a test together. The statistic stays the plain mean: a law bends the FRF
as smoothly as such noise does, and weights that suppress the noise would suppress the law.

[Buckley1988] M. J. Buckley and G. K. Eagleson, An approximation to the distribution of quadratic forms in normal random
variables, Australian Journal of Statistics 30A, 1988, doi:10.1111/j.1467-842X.1988.tb00471.x.
[McKelveyGuerin2012] T. McKelvey and G. Guerin, Non-parametric frequency response estimation using a local rational
model, IFAC Proceedings 45(16), 2012, doi:10.3182/20120711-3-BE-2027.00299.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import gammainccinv

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.diagnosis.measured.contour import WINDOW_DECAYS
from frf_ipz.diagnosis.measured.forces import MISSING_SAMPLES, isolate_pulse, missing_ringing
from frf_ipz.diagnosis.measured.group_spectra import group_records
from frf_ipz.diagnosis.measured.levels import MIN_RECORDS
from frf_ipz.diagnosis.measured.noise_growth import MeasuredNoise
from frf_ipz.diagnosis.measured.preprocessing.residual_motion import MODEL_ERROR
from frf_ipz.diagnosis.nonlinear.channel_noise import ChannelNoise, read_noise
from frf_ipz.numerics.least_squares import solve_scaled_columns

if TYPE_CHECKING:
    from frf_ipz.diagnosis.observations import Observations, ObservedRecord

WIDTH = 24  # lines that are fitted together
DEGREES = (0, 2), (2, 2), (3, 3)  # of the local polynomials: of the poles; of the zeros and of transients
ROUNDS = 4  # of weights
LEAD = 2  # samples before the pulse
END = 10  # part of a record at its end that shows the residual motion for the next impact in the same recording
CUT = 1e-12  # of the largest singular value of the local polynomials
LEAKAGE = 2.0  # lines beside its own on which a tone shows
LIMIT_HAMMER, LIMIT_SHAKER = 5.0, 2.0  # times the expected misfit, in the worst group of lines
CHANCE = 1e-3  # that a whole linear test exceeds the limit by its noise


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Linearity:
    """How far records of different levels disagree with any linear system.

    Parameters
    ----------
    score : float
        Largest misfit of all groups of lines over the one expected by noise; about 1 or less for a linear system. Where
        chance alone may exceed the limit, the limit times the misfit over what chance may reach.
    limit : float
        Above it, the system is not linear, or changed between the records.
    frequency_hz : (n_groups,) array
        Middle of the groups of lines, of all excited points in turn.
    misfit : (n_groups, n_sensors) array
        Over the one expected by noise.
    """

    score: float
    limit: float
    frequency_hz: FloatArray
    misfit: FloatArray

    @property
    def is_nonlinear(self) -> bool:
        """No linear system explains the records."""
        return self.score > self.limit


def assess_linearity(observations: Observations) -> Linearity:
    """Compare all records of each excited point with the best linear system.

    Parameters
    ----------
    observations : Observations
        Records of a hammer or a shaker; excited points with a single one do not count.

    Returns
    -------
    Linearity
        The score and where in the band it comes from.
    """
    noise = read_noise(observations)
    parts = [_assess_group(observations, records, noise) for records in group_records(observations)]
    frequency, misfit, spread = (np.concatenate(values) for values in zip(*parts, strict=True))
    limit = LIMIT_HAMMER if noise.is_hammer else LIMIT_SHAKER
    by_chance = largest_mean(spread, CHANCE / max(misfit.size, 1))
    return Linearity(
        score=float((misfit * limit / np.maximum(by_chance, limit)).max(initial=0.0)),
        limit=limit,
        frequency_hz=frequency,
        misfit=misfit,
    )


def _assess_group(
    observations: Observations, records: tuple[ObservedRecord, ...], noise: ChannelNoise
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Middles of groups of lines, misfits (n_groups, n_sensors), and their cumulants (n_groups, n_sensors, 2)."""
    n, step = min(record.n_samples for record in records), records[0].step_s
    frequency = np.asarray(np.fft.rfftfreq(n, step), float)
    included = observations.mask_band(frequency, LEAKAGE / (n * step)) & (len(records) >= MIN_RECORDS)
    used, n_groups = _group_lines(np.flatnonzero(included))
    middle = frequency[used].reshape(n_groups, WIDTH).mean(1)
    misfit = np.zeros((n_groups, len(noise.sensors)))
    cumulants = np.zeros((*misfit.shape, 2))
    if not n_groups:
        return middle, misfit, cumulants
    sigma = WINDOW_DECAYS / (n * step) if noise.is_hammer else 0.0
    lines = [_transform(record, noise, n, sigma)[:, used] for record in records]
    length = (1 - np.exp(-2 * WINDOW_DECAYS)) / (2 * sigma) if sigma else n * step
    missing = np.array(
        [
            _missing_ringing_energy(record) if noise.is_hammer else np.zeros(1 + len(record.responses))
            for record in records
        ]
    )
    by_force = MeasuredNoise(channel=records[0].input_channel).scales(records)[:, None]
    of_force = noise.force_energy(frequency[used], n * step) * by_force
    s = np.asarray(sigma + 2j * np.pi * np.arange(WIDTH) / (n * step), np.complex128)
    durations_s = (noise.pulse_s, n * step) if noise.is_hammer else ()
    correlation = np.array([decaying_correlation(s, duration_s) for duration_s in durations_s])
    for row, sensor in enumerate(records[0].sensors):
        column = noise.sensors.index((sensor.channel, sensor.dof))
        by_record = MeasuredNoise(channel=sensor.channel).scales(records)[:, None]
        of_response = noise.response_energy(column, frequency[used], length) * by_record
        stationary = np.array([of_force, of_response])
        motion_before = _residual_motion_energy(records, row, frequency[used], sigma)
        common = np.array([missing[:, :1] + np.zeros_like(of_force), missing[:, [1 + row]] + motion_before])
        for group in range(n_groups):
            part = slice(group * WIDTH, (group + 1) * WIDTH)
            force, motion = (np.array([line[i, part] for line in lines]) for i in (0, 1 + row))
            if noise.is_hammer:
                energies = stationary[..., part], common[..., part]
                misfit[group, column], *cumulants[group, column] = _frf_misfit(force, motion, *energies, correlation)
            else:
                misfit[group, column] = _quotient_misfit(force, motion, (stationary + common)[..., part])
    return middle, misfit, cumulants


def decaying_correlation(s: ComplexArray, duration_s: float) -> ComplexArray:
    """Compute the correlation of white noise on lines under an exponential window.

    Parameters
    ----------
    s : (n_lines,) complex array
        rad/s, the decay of the window as real part.
    duration_s : float
        From the beginning of the window on, the noise lasts so long.

    Returns
    -------
    (n_lines, n_lines) complex array
        1 on the diagonal.

    Examples
    --------
    >>> lines = 8.0 + 2j * np.pi * np.arange(2)  # of one second
    >>> [round(abs(decaying_correlation(lines, duration_s)[0, 1]), 2) for duration_s in (1.0, 0.01)]
    [np.float64(0.93), np.float64(1.0)]
    """
    rate = s[:, None] + s[None, :].conj()
    covariance = -np.expm1(-rate * duration_s) / rate
    std = np.sqrt(np.diag(covariance).real)
    return np.asarray(covariance / np.outer(std, std))


def largest_mean(cumulants: FloatArray, probability: float) -> FloatArray:
    """Compute what a mean of squared moduli, 1 if expected, exceeds with a probability, as in [Buckley1988].

    Parameters
    ----------
    cumulants : (..., 2) array
        Sums of the second and of the third powers of its parts, each an exponential variable.
    probability : float
        Of a larger mean.

    Returns
    -------
    (...) array
        1 where the parts are not known.

    Examples
    --------
    >>> largest_mean(np.array([1.0, 1.0]), np.exp(-5.0)).round(2)  # a single exponential variable
    np.float64(5.0)
    """
    second, third = np.moveaxis(cumulants, -1, 0)
    scale = np.divide(third, second, out=np.zeros_like(third), where=second > 0)
    shape = np.divide(second**3, third**2, out=np.ones_like(third), where=third > 0)
    return np.asarray(1 + scale * (gammainccinv(shape, probability) - shape))


def _missing_ringing_energy(record: ObservedRecord) -> FloatArray:
    """Energy, of the force and of each response, of the filter ringing that is missing at the start of a record."""
    return MISSING_SAMPLES * (record.step_s * missing_ringing(isolate_pulse(record), record.responses)) ** 2


def _residual_motion_energy(
    records: tuple[ObservedRecord, ...], row: int, frequency_hz: FloatArray, sigma: float
) -> FloatArray:
    """Energy of the residual motion at the next impact of a recording, (n_records, n_lines).

    Where a mode is not known well, as much remains after its removal. Its size is read at the ends of the records.
    """
    ends = [record.responses[row, -max(record.n_samples // END, 1) :] for record in records]
    largest = 2 * max(float(np.mean(end**2)) for end in ends)
    energy = largest / (sigma**2 + (2 * np.pi * frequency_hz) ** 2)
    return np.array([energy if record.has_predecessor and sigma else np.zeros_like(energy) for record in records])


def _group_lines(used: IntArray) -> tuple[IntArray, int]:
    """Select lines that make whole groups of neighbours, and count the groups."""
    runs = np.split(used, np.flatnonzero(np.diff(used) > 1) + 1)
    grouped = np.concatenate([run[: len(run) // WIDTH * WIDTH] for run in runs])
    return grouped, len(grouped) // WIDTH


def _transform(record: ObservedRecord, noise: ChannelNoise, n: int, sigma: float) -> ComplexArray:
    """Transform force and responses, those of an impact from its pulse on."""
    signals = np.vstack([noise.force_of(record), record.responses])[:, :n]
    if sigma:
        start = max(int(np.argmax(np.abs(signals[0]) > 0)) - LEAD, 0)
        signals = np.hstack([signals[:, start:], np.zeros((len(signals), start))])
    return (
        np.asarray(np.fft.rfft(signals * np.exp(-sigma * record.step_s * np.arange(signals.shape[1])))) * record.step_s
    )


def _variance(motion: ComplexArray, frf: ComplexArray, energies: FloatArray) -> FloatArray:
    return np.asarray(energies[1] + np.abs(frf) ** 2 * energies[0] + (MODEL_ERROR * np.abs(motion)) ** 2)


def _frf_misfit(
    force: ComplexArray, motion: ComplexArray, stationary: FloatArray, common: FloatArray, correlation: ComplexArray
) -> tuple[float, float, float]:
    """Misfit of one FRF for all records over the expected one, and its second and third cumulant.

    Parameters
    ----------
    force, motion : (n_records, WIDTH) complex array
        Transforms.
    stationary, common : (2, n_records, WIDTH) array
        Energy, of force and response, of noise and of what is one number on all lines.
    correlation : (2, WIDTH, WIDTH) complex array
        Of the noise.

    Returns
    -------
    misfit, second, third : float
        1 is expected of the misfit.
    """
    energies = stationary + common
    frf = np.sum(motion * force.conj(), 0) / np.sum(np.abs(force) ** 2, 0)
    variance = _variance(motion, frf, energies)
    weight = np.abs(force) ** 2 / variance
    frf = np.sum(motion * force.conj() / variance, 0) / np.sum(weight, 0)
    misfit = np.sum(np.abs(motion - frf * force) ** 2 / variance) / (motion.size - motion.shape[1])
    std = np.sqrt(variance)
    gains = np.array([np.broadcast_to(frf, motion.shape), np.ones_like(motion)]) / std
    noises, shared = gains * np.sqrt(stationary), gains * np.sqrt(common)
    # of each record: a record that determines the FRF alone has no misfit
    part = np.sqrt(1 - weight / np.sum(weight, 0))
    noises, shared = part * noises, part * shared
    covariance = np.sum(
        correlation * (noises.swapaxes(1, 2) @ noises.conj()) + shared.swapaxes(1, 2) @ shared.conj(), 0
    )
    covariance[np.diag_indices_from(covariance)] = np.sum(part**2, 0)  # what else there is differs from line to line
    covariance /= np.trace(covariance).real
    square = covariance @ covariance
    n_left = len(motion) - 1  # records that the FRF does not explain: each has the same covariance, or nearly so
    second, third = np.trace(square).real / n_left, np.trace(square @ covariance).real / n_left**2
    return float(misfit), float(second), float(third)


def _quotient_misfit(force: ComplexArray, motion: ComplexArray, energies: FloatArray) -> float:
    """Misfit of the best local quotient over the expected one; force and motion are (n_records, WIDTH).

    Far from resonances, poles follow the noise; any quotient that explains is a proof of linearity.
    """
    return min(_quotient_misfit_of(degrees, force, motion, energies) for degrees in DEGREES)


def _quotient_misfit_of(
    degrees: tuple[int, int], force: ComplexArray, motion: ComplexArray, energies: FloatArray
) -> float:
    """Least misfit of all rounds over the expected one; it may oscillate where a pole comes onto a line.

    Each record has a transient of its own, a polynomial: what these can explain is projected out record by record.
    """
    (n_records, n_lines), (poles, zeros) = motion.shape, degrees
    above = np.linspace(-1, 1, n_lines)[:, None] ** np.arange(zeros + 1)
    below = above[:, 1 : poles + 1]
    sides = np.concatenate([-below * motion[..., None], above * force[..., None], motion[..., None]], axis=2)
    denominator, frf = np.ones(n_lines, complex), np.zeros(n_lines, complex)
    least = np.inf
    for _ in range(ROUNDS):
        weight = 1 / (np.sqrt(_variance(motion, frf, energies)) * np.abs(denominator))
        smooth, weighted = np.linalg.qr(weight[..., None] * above)[0], weight[..., None] * sides
        rough = (weighted - smooth @ (smooth.swapaxes(1, 2) @ weighted)).reshape(motion.size, -1)
        columns, right = rough[:, :-1], rough[:, -1]
        coefficients = solve_scaled_columns(columns, right, CUT)
        denominator = 1 + below @ coefficients[:poles]
        frf = (above @ coefficients[poles:]) / denominator
        misfit = (right - columns @ coefficients).reshape(motion.shape) / (weight * denominator)
        least = min(least, float(np.sum(np.abs(misfit) ** 2 / _variance(motion, frf, energies))))
    return float(least / (motion.size - columns.shape[1] - n_records * (zeros + 1)))
