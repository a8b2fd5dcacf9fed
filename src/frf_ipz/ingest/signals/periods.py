"""Periodic excitation: over a whole number of periods a transform has no leakage.

That holds once the motion from before the record, or from its start at rest, has died out. The later half of the parts
that a record is cut into gives an FRF and the noise of the responses; the first parts of which the FRF leaves more
than that noise, about some line, hold such motion.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Self

import numpy as np

from frf_ipz.ingest.signals.scatter import overlapping_bands
from frf_ipz.late_imports import import_late

if TYPE_CHECKING:
    from collections.abc import Iterator

    from scipy import fft, special

    from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray
else:
    fft = import_late("scipy.fft")
    special = import_late("scipy.special")

DIFFERENT = 0.01  # of the mean square: the same force again differs by noise and by the shaker's own distortion
CHANGED = 0.5  # of the mean square
SHORTEST = 16  # samples
FEWEST = 3  # parts without transients: their scatter is the noise
SIDE = 8  # lines to each side that are judged together
BAND = 64  # lines over which the noise of a force is alike
CHANCE = 1e-6  # share of lines without a force that are taken for one with
LEVEL = 1e-3  # probability that a part without a transient is taken for one with


def find_period(force: FloatArray) -> int:
    """Find after how many samples a force comes again and again.

    Parameters
    ----------
    force : (n,) array
        As recorded; its start may be that of a switched-on generator.

    Returns
    -------
    int
        Samples of a period; 0 where it does not repeat at least once, as noise and sweeps do not.

    Examples
    --------
    >>> noise = np.random.default_rng(1).standard_normal(100)
    >>> find_period(np.tile(noise, 4)), find_period(np.random.default_rng(2).standard_normal(400))
    (100, 0)
    """
    signal = force - force.mean()
    n_samples = len(signal)
    lags = np.arange(SHORTEST, n_samples // 2 + 1)
    if not len(lags) or not np.any(signal):
        return 0
    padded = fft.next_fast_len(2 * n_samples, real=True)
    correlation = fft.irfft(np.abs(fft.rfft(signal, padded)) ** 2, padded)[lags]
    power = np.concatenate([[0.0], np.cumsum(signal**2)])
    both = power[n_samples - lags] + power[-1] - power[lags]  # of the signal without its end, and without its start
    difference = 1.0 - 2.0 * correlation / np.where(both > 0.0, both, np.inf)
    has_changed = np.maximum.accumulate(difference) > CHANGED  # a force with few high frequencies begins by being alike
    again = np.flatnonzero(has_changed & (difference < DIFFERENT))
    if not len(again):
        return 0
    end = int(again[0])
    while end + 1 < len(lags) and difference[end + 1] < difference[end]:
        end += 1
    period = int(lags[end])
    last = n_samples // 2 // period * period  # noise in a narrow band is alike after one cycle, and not after many
    return period if difference[last - SHORTEST] < DIFFERENT else 0


def transform_parts(
    force: FloatArray, responses: FloatArray, length: int, first: int = 0
) -> Iterator[tuple[ComplexArray, ComplexArray]]:
    """Transform the parts of a periodic record, each of whole periods.

    Parameters
    ----------
    force : (n_samples,) array
        N.
    responses : (n_outputs, n_samples) array
        SI.
    length : int
        Samples of a part; a shorter remainder at the end is not used.
    first : int
        The first part to give.

    Yields
    ------
    force : (n_lines,) complex array
        Transform of a part.
    responses : (n_outputs, n_lines) complex array
        Those of the responses.
    """
    for start in range(first * length, len(force) - length + 1, length):
        samples = slice(start, start + length)
        yield fft.rfft(force[samples]), fft.rfft(responses[:, samples])


@dataclass(slots=True, kw_only=True, eq=False)
class PeriodicForce:
    """What the parts of periodic records tell of their force: what comes again, and what does not.

    Parameters
    ----------
    mean_power : (n_lines,) array
        Squared modulus of the mean over the parts of a record times their number, summed over the records.
    scatter : (n_lines,) array
        Squared moduli of what differs from that mean, summed over all parts.
    n_records, degrees : int
        Records, and parts less one for each.
    """

    mean_power: FloatArray
    scatter: FloatArray
    n_records: int
    degrees: int

    @classmethod
    def of_parts(cls, spectra: ComplexArray) -> Self:
        """Measure one record.

        Parameters
        ----------
        spectra : (n_parts, n_lines) complex array
            Transforms of the force.

        Returns
        -------
        PeriodicForce
            Of this record.
        """
        mean = spectra.mean(axis=0)
        return cls(
            mean_power=len(spectra) * np.abs(mean) ** 2,
            scatter=np.sum(np.abs(spectra - mean) ** 2, axis=0),
            n_records=1,
            degrees=len(spectra) - 1,
        )

    def __add__(self, record: Self) -> Self:
        return type(self)(
            **{field.name: getattr(self, field.name) + getattr(record, field.name) for field in fields(self)}
        )

    def is_noise(self) -> BoolArray:
        """Tell on which lines the force is noise alone, as lines between those that a generator excites.

        Noise alone has the power of its scatter in the means too. That is pooled over the lines of a band, so that the
        power of R means over it is distributed as a gamma variable of R degrees of freedom.

        Returns
        -------
        (n_lines,) bool array
            False where the means have more power than chance gives to one line in a million.
        """
        if not self.degrees:
            return np.zeros(len(self.scatter), bool)
        bands, shares = overlapping_bands(len(self.scatter), BAND)
        quiet = np.median(self.scatter[bands], axis=1) / special.gammaincinv(self.degrees, 0.5)
        noise = np.bincount(bands.ravel(), (shares * quiet[:, None]).ravel(), len(self.scatter))
        return np.asarray(self.mean_power <= noise * special.gammainccinv(self.n_records, CHANCE))


def first_steady_part(force: FloatArray, responses: FloatArray, length: int) -> int:
    """Find the part of a periodic record from which on nothing but noise adds to the answer to its force.

    Parameters
    ----------
    force : (n_samples,) array
        N.
    responses : (n_outputs, n_samples) array
        SI.
    length : int
        Samples of a part.

    Returns
    -------
    int
        Its number, from 0; -1 where fewer than three parts are left: then transients have to be fitted.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> force = np.tile(rng.standard_normal(256), 8)
    >>> noise = 0.01 * rng.standard_normal((1, 2048))
    >>> settling = np.exp(-np.arange(2048) / 50)
    >>> first_steady_part(force, force + noise, 256), first_steady_part(force, force + noise + settling, 256)
    (0, 2)
    """
    n_parts = len(force) // length
    n_later = max(n_parts // 2, 2)
    if n_parts < FEWEST:
        return -1
    spectra = list(transform_parts(force, responses, length))
    later = spectra[-n_later:]
    power = np.sum([np.abs(F) ** 2 for F, _ in later], axis=0)
    frf = np.sum([F.conj() * X for F, X in later], axis=0) / np.maximum(power, np.finfo(float).tiny)
    noise = _smooth(np.sum([np.abs(X - frf * F) ** 2 for F, X in later], axis=0)) / (n_later - 1)
    n_tried = n_parts * noise.size
    first = 0
    for number, (F, X) in enumerate(spectra[:-n_later]):
        left = _smooth(np.abs(X - frf * F) ** 2 / (1.0 + np.abs(F) ** 2 / np.maximum(power, np.finfo(float).tiny)))
        ratio = np.divide(left, noise, out=np.ones_like(left), where=noise > 0.0).max(initial=0.0)
        degrees = 2 * (2 * SIDE + 1)
        if special.fdtrc(degrees, degrees * (n_later - 1), ratio) < LEVEL / n_tried:
            first = number + 2  # what has died out to below the noise has not ended: one more is left out
    return first if n_parts - first >= FEWEST else -1


def _smooth(power: FloatArray) -> FloatArray:
    """Average over neighbouring lines without that at 0 Hz, where offsets drift; near the ends over those there are."""
    sums = np.cumsum(np.pad(power[:, 1:], ((0, 0), (1, 0))), axis=1)
    lines = np.arange(sums.shape[1] - 1)
    start, stop = np.maximum(lines - SIDE, 0), np.minimum(lines + SIDE + 1, len(lines))
    return np.asarray((sums[:, stop] - sums[:, start]) / (stop - start))
