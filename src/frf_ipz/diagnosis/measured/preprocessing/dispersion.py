"""Dispersion of converters: FRFs do not show that high frequencies are late, but nonlinear laws are sensitive to it.

An anti-aliasing filter of low latency (of minimum phase) turns the phase close to its cut-off. All channels share it,
so that no FRF shows it; but the force of a law follows from the motion as it was, not as it was recorded. For a gain
that falls steeply at omega_c, the relation of gain and phase by Bode (1945) gives the phase -a ln((omega_c + omega) /
(omega_c - omega)): a delay, which does no harm, and the dispersion, which is removed here.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from frf_ipz.diagnosis.observations import Observations, ObservedRecord

CUT_OFF = 0.46  # of the sampling rate: usual for converters
LAST_PART = 0.97  # of the cut-off: above, nothing was recorded, and the phase stays constant
PADDING = 2048  # samples after the record, for what is moved to before its start


def remove_dispersion(observations: Observations, dispersion_rad: float) -> Observations:
    """Give records the phase of a filter whose delay is the same at all frequencies.

    Parameters
    ----------
    observations : Observations
        Records of a hammer or a shaker.
    dispersion_rad : float
        a, rad: the fall of the filter's gain in nepers over pi; 3.7 for 100 dB, 0 changes nothing.

    Returns
    -------
    Observations
        With the same FRFs.
    """
    if not dispersion_rad:
        return observations
    return replace(
        observations, records=tuple(_remove_from_record(record, dispersion_rad) for record in observations.records)
    )


def excess_delay_s(dispersion_rad: float, frequency_hz: float, step_s: float) -> float:
    """Delay at a frequency in excess of that at low frequencies, s.

    Parameters
    ----------
    dispersion_rad : float
        As in `remove_dispersion`.
    frequency_hz : float
        Hz.
    step_s : float
        Of the recordings, s.

    Returns
    -------
    float
        s.
    """
    part = min(frequency_hz * step_s / CUT_OFF, LAST_PART)
    return dispersion_rad * step_s / (np.pi * CUT_OFF) * part**2 / (1 - part**2)


def _remove_from_record(record: ObservedRecord, dispersion_rad: float) -> ObservedRecord:
    n = record.n_samples + PADDING
    part = np.minimum(np.fft.rfftfreq(n) / CUT_OFF, LAST_PART)
    turn = np.exp(2j * dispersion_rad * (np.arctanh(part) - part))
    signals = np.vstack([record.force, record.responses])
    turned = np.fft.irfft(np.fft.rfft(signals, n, axis=1) * turn, n, axis=1)[:, : record.n_samples]
    return replace(record, force=turned[0], responses=turned[1:])
