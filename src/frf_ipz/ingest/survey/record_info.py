"""What the survey measures of each record, and what it decides for a whole test."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.ingest.campaign import TestSetup
from frf_ipz.ingest.signals.spikes import Spike

STANDS_STILL = "is dead: all its samples are"  # and a value: what is wrong with a channel


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordInfo:
    """One impact of a hammer or one record of a shaker: where it is, what was measured, what is wrong with it.

    Parameters
    ----------
    name : str
        Its file, relative to the test, with ``#2`` for the second impact in a file.
    setup : TestSetup
        What it belongs to.
    path : Path
        Its file.
    start, stop : int
        Its rows in the file.
    step_s : float
        Time step of the file, s.
    trigger : int
        Sample, from `start`, at which the force sets in.
    pulse_interval : pair of int
        First sample of its pulse, ringing and second pulses included, and the one after the last; from `start`.
    force_interval : pair of int
        The samples that a force window keeps, first and one after the last, from `start`; all where there is none.
    offsets : tuple of float
        DC offset of the force and of each response, to be subtracted, SI.
    peak_force : float
        Extreme value of the force, N, with its sign.
    has_coarse_force : bool
        The force is digitised in coarse steps, so that equal peaks mean nothing.
    pulse_s : float
        Length of the pulse at half of its height, s; NaN for a shaker's record.
    force_noise : float
        Standard deviation of the force outside of its pulse, N; NaN for a shaker's record.
    force_band_hz : float
        Up to where the force's spectrum stays within 20 dB of its largest value, Hz; NaN for a shaker's record.
    second_pulse_ratio : float
        Height of a second pulse over the first; 0 where there is none.
    remaining_amplitude : float
        Share of its amplitude that the slowest mode still has at the end.
    slowest_mode_hz : float
        That mode's frequency, Hz.
    cut_off_ratio, cut_off_amplitude, cut_off_hz : float
        What the end of the record cuts off of a mode, over the deviation of its noise; the share of its amplitude that
        this mode still has there, and its frequency, Hz.
    snr_db : float
        Power of the response over its noise, median of the channels, dB; NaN where the noise is not known.
    starts_at_rest : bool
        The structure was at rest at the first sample.
    number : int
        1 for the first impact in its file; at those after it, the structure may still move from the one before.
    faults : tuple of str
        Why it is left out unless the user keeps it.
    channel_faults : tuple of pairs of int and str
        Why one response of it, by its place in the set-up, is left out unless the user keeps the record.
    remarks : tuple of str
        What is wrong without being a reason to leave it out.
    used : bool
        It enters the FRFs.
    keeps_channels : bool
        It enters them with all channels, whatever is wrong with them.
    missing_force : tuple of float
        Samples of the force that its record lacks because it begins within the pulse, N.
    missing_ringing : tuple of float
        What its filter may have rung before its first sample, where it begins just before the pulse, the same way.
    lacks_most : bool
        Its record begins so late in the pulse that nothing is known of the force.
    noise_weights : tuple of tuples of float
        For each response, the weight of this impact on points from 0 Hz to half of the sampling rate, equally spaced;
        the mean over the impacts is 1. Empty where they cannot be compared.
    noise_scales : tuple of float
        Noise power of each response over that of the other impacts, under these weights; empty as they are.
    doubts : tuple of float
        Factor on the variance of each response, where the impacts at its point are two groups; empty for 1.
    spikes : tuple of Spike
        Jumps in its responses that no band-limited motion makes, from `start`; they are taken off.
    period : int
        Samples after which the force of a shaker comes again; 0 where it does not.
    steady_part : int
        The first of its parts of whole periods without a transient; -1 where transients have to be fitted.
    is_unlike : bool
        All its responses contradict those of the other impacts, and no fault of a recording explains it.
    """

    name: str
    setup: TestSetup
    path: Path
    start: int
    stop: int
    step_s: float
    trigger: int
    pulse_interval: tuple[int, int]
    force_interval: tuple[int, int]
    offsets: tuple[float, ...]
    peak_force: float
    has_coarse_force: bool
    pulse_s: float
    force_noise: float
    force_band_hz: float = float("nan")
    second_pulse_ratio: float = 0.0
    remaining_amplitude: float = 0.0
    slowest_mode_hz: float = 0.0
    cut_off_ratio: float = 0.0
    cut_off_amplitude: float = 0.0
    cut_off_hz: float = 0.0
    snr_db: float = float("nan")
    starts_at_rest: bool = True
    number: int = 1
    faults: tuple[str, ...] = ()
    channel_faults: tuple[tuple[int, str], ...] = ()
    remarks: tuple[str, ...] = ()
    used: bool = True
    keeps_channels: bool = False
    missing_force: tuple[float, ...] = (0.0,)
    missing_ringing: tuple[float, ...] = (0.0,)
    lacks_most: bool = False
    noise_weights: tuple[tuple[float, ...], ...] = ()
    noise_scales: tuple[float, ...] = ()
    doubts: tuple[float, ...] = ()
    spikes: tuple[Spike, ...] = ()
    period: int = 0
    steady_part: int = -1
    is_unlike: bool = False

    @property
    def n_samples(self) -> int:
        """Number of samples."""
        return self.stop - self.start

    def spike_power(self, output: int, window: FloatArray) -> float:
        """Give the mean squared modulus of what the errors of the spikes of a response add to its transform.

        Parameters
        ----------
        output : int
            Which response, by its place in the set-up.
        window : (n_samples,) array
            What the response is multiplied by.

        Returns
        -------
        float
            0 where it has none.
        """
        inside = [spike for spike in self.spikes if spike.output == output and spike.start < len(window)]
        return float(sum(spike.error * window[spike.start] ** 2 for spike in inside))

    def correct(self, signals: FloatArray) -> FloatArray:
        """Take offsets and spikes off.

        Parameters
        ----------
        signals : (1 + n_outputs, n_samples) array
            Force and responses as recorded, SI.

        Returns
        -------
        (1 + n_outputs, n_samples) array
            Corrected.
        """
        corrected = signals - np.array(self.offsets)[:, None]
        for spike in self.spikes:
            part = corrected[1 + spike.output, spike.start : spike.start + len(spike.values)]
            part -= spike.values[: len(part)]
        return np.asarray(corrected)

    @property
    def ringing_s(self) -> float:
        """Time from the impact to the end, s."""
        return (self.n_samples - self.trigger) * self.step_s

    @property
    def marks(self) -> tuple[str, ...]:
        """Everything that is wrong, the reasons for leaving it out first."""
        return (*self.faults, *dict.fromkeys(text for _, text in self.channel_faults), *self.remarks)

    @property
    def used_outputs(self) -> tuple[int, ...]:
        """The responses, by their place in the set-up, that enter the FRFs."""
        bad_outputs = () if self.keeps_channels else [output for output, _ in self.channel_faults]
        return tuple(output for output in range(len(self.setup.output_dofs)) if output not in bad_outputs)


@dataclass(frozen=True, slots=True, kw_only=True)
class Survey:
    """The records of a test with what was measured of each, and what was decided for all.

    Parameters
    ----------
    records : tuple of RecordInfo
        All records, also those that are left out.
    step_s : float
        Time step that those that are used have in common, s.
    n_samples : int
        Length of the transforms; shorter records are padded with zeros.
    decay_1_s : float
        Rate sigma of the exponential window on force and response; 0 for none.
    segment_length : int
        Samples of the segments, under Hann windows, that records are cut into; 0 for none.
    subrecord_length : int
        Samples of the sub-records, transients removed, that records are cut into; 0 for none.
    choices : tuple of str
        What was chosen, and by what.
    warnings : tuple of str
        What the user has to know.
    """

    records: tuple[RecordInfo, ...]
    step_s: float
    n_samples: int
    decay_1_s: float = 0.0
    segment_length: int = 0
    subrecord_length: int = 0
    choices: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def used(self) -> tuple[RecordInfo, ...]:
        """The records that enter the FRFs."""
        return tuple(record for record in self.records if record.used)
