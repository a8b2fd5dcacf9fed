"""When responses arrive: a delay of many samples, found without poles.

A linear structure does not move before the force. The transform of an FRF from the lines to time begins where its
response does, whatever the modes are: there its envelope rises by more than anywhere else. That is known to about a
period of the highest frequency, which is enough for `likelihood.delay` to find the rest, and more than a fit needs to
find its poles: with a delay of a few periods, terms that are smooth over the lines no longer are.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray

if TYPE_CHECKING:
    from frf_ipz.identification.measured_lines import MeasuredLines

EVEN = 0.01  # of the distance of lines: a transform needs even ones
WIDTH = 3.0  # periods over which a rise is measured: the main lobe of a Hann window over the lines
FINER = 4  # points of time a period
MOST_ARRIVALS = 4  # that are tried: of 48 tests whose modes beat, the true one was the fourth at worst


def find_arrivals(lines: MeasuredLines) -> FloatArray:
    """Find when the responses may begin.

    Parameters
    ----------
    lines : MeasuredLines
        Lines and their noise.

    Returns
    -------
    (n,) array
        s after the force, below 0 where the responses come first, the most likely one first: where modes beat, a later
        rise may be the highest. Only 0 where lines are not even.
    """
    places = (lines.frequency_hz - lines.frequency_hz[0]) / lines.line_hz
    if np.abs(places - np.round(places)).max() > EVEN:
        return np.zeros(1)
    places = np.round(places).astype(np.int64)  # lines in between are not used
    # as mobilities, in which masses and springs weigh alike
    values = lines.receptance * lines.s[:, None]
    noise = lines.variance * np.abs(lines.s[:, None]) ** 2
    signal = np.maximum(1.0 - noise / np.maximum(np.abs(values) ** 2, np.finfo(float).tiny), 0.0)
    n_lines = int(places[-1]) + 1
    size = FINER * n_lines
    taper = np.sin(np.pi * (places + 0.5) / n_lines) ** 2
    spectra = np.zeros((n_lines, values.shape[1]), complex)
    spectra[places] = values * signal * taper[:, None]
    envelopes = np.abs(np.fft.ifft(spectra, size, axis=0)) ** 2
    envelope = np.sum(envelopes / np.maximum(envelopes.sum(axis=0), np.finfo(float).tiny), axis=1)
    width = round(WIDTH * FINER)
    total = np.cumsum(np.concatenate([[0.0], np.tile(envelope, 3)]))
    times = size + np.arange(size)
    rise = total[times + width] - 2 * total[times] + total[times - width]
    peaks = np.flatnonzero((rise >= np.roll(rise, 1)) & (rise > np.roll(rise, -1)))
    highest = peaks[np.argsort(-rise[peaks])][:MOST_ARRIVALS]
    return np.asarray(np.fft.fftfreq(size, lines.line_hz)[highest])
