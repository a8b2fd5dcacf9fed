"""FRFs of a hammer test: windows, transforms, averages."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.ingest.estimation.averaging import average_recordings
from frf_ipz.ingest.estimation.impact_noise import empty_noise
from frf_ipz.ingest.signals.decay import noise_power
from frf_ipz.ingest.signals.windows import exponential_window, impact_windows

if TYPE_CHECKING:
    from frf_ipz.arrays import ComplexArray, FloatArray
    from frf_ipz.ingest.estimation.averaging import SetupAverage
    from frf_ipz.ingest.estimation.impact_noise import ImpactNoise
    from frf_ipz.ingest.frf_estimate import FrfEstimate
    from frf_ipz.ingest.options import IngestOptions
    from frf_ipz.ingest.recording_files import RecordingFiles
    from frf_ipz.ingest.records import Record
    from frf_ipz.ingest.survey.record_info import RecordInfo, Survey
    from frf_ipz.progress import Progress

MOST_REMAINING = 0.25  # of the slowest mode: what is missing is then as large as the second half of the record
RESTORED_BY = 0.5  # of what was restored, its error: of sines that were cut at 0.1 to 0.7 of their height 0.2 to 0.5


def estimate_hammer(files: RecordingFiles, options: IngestOptions, progress: Progress) -> FrfEstimate:
    """Estimate the FRFs of a hammer test.

    Parameters
    ----------
    files : RecordingFiles
        The recordings of the test.
    options : IngestOptions
        The user's choice.
    progress : Progress
        Called with the share of the work that is done.

    Returns
    -------
    FrfEstimate
        FRFs, table of impacts, traces.

    Raises
    ------
    InputError
        If a recording cannot be used.
    """
    return average_recordings(files, options, progress, _add_impact)


def _add_impact(average: SetupAverage, info: RecordInfo, record: Record, survey: Survey) -> float:
    """Add an impact to the average of its set-up, and return the energy of its force."""
    signals = record.apply_windows(survey.decay_1_s, survey.n_samples)
    rows = list(record.outputs)
    weights = _weights(info, survey.n_samples // 2 + 1)[rows]
    average.sums.add(signals[0], signals[1:], rows, weights)
    average.independent[rows] += 1.0
    average.noise = average.noise or empty_noise(survey.n_samples // 2 + 1, len(average.sums.cross))
    spectrum = np.fft.rfft(signals[0])
    _add_noise(average.noise, info, record, survey, spectrum, weights)
    share = np.mean(np.average(weights, axis=1, weights=np.abs(spectrum) ** 2)) if np.any(spectrum) else 0.0
    return float(share * np.sum(signals[0] ** 2))


def _weights(info: RecordInfo, n_lines: int) -> FloatArray:
    """Weights of an impact for all responses of its set-up, (n_outputs, n_lines)."""
    if not info.noise_weights:
        return np.ones((len(info.setup.output_dofs), n_lines))
    lines = np.linspace(0.0, 1.0, n_lines)
    return np.array([np.interp(lines, np.linspace(0.0, 1.0, len(row)), row) for row in info.noise_weights])


def _add_noise(
    noise: ImpactNoise,
    info: RecordInfo,
    record: Record,
    survey: Survey,
    spectrum: ComplexArray,
    weights: FloatArray,
) -> None:
    """Add what is known of the noise of an impact; `spectrum` is that of its force, `weights` are its own."""
    rows, force = list(record.outputs), np.abs(spectrum)
    frequency_hz = np.asarray(np.fft.rfftfreq(survey.n_samples, record.step_s))
    rate = survey.decay_1_s * record.step_s
    window, decay = impact_windows(record.n_samples, record.force_interval, rate, record.trigger)
    responses = [noise_power(response[record.trigger :], record.step_s, frequency_hz) for response in record.responses]
    scales = np.array(info.noise_scales)[rows, None] if info.noise_scales else np.ones((len(rows), 1))
    spikes = np.array([[info.spike_power(output, decay)] for output in rows])
    noise.response[rows] += weights * (np.array(responses) * np.sum(decay**2) + spikes)
    force_noise = noise_power(record.force[record.trigger :], record.step_s, frequency_hz)
    noise.force[rows] += weights * force_noise * np.sum(window**2)
    noise.scales[rows] += scales
    noise.doubts[rows] += np.array(info.doubts)[rows, None] if info.doubts else 1.0
    noise.scaled_force[rows] += scales * weights * force**2
    noise.pulse[rows] += force * spectrum * np.exp(2j * np.pi * frequency_hz * record.trigger * record.step_s)
    noise.cut_off[rows] += weights * force * _beyond_the_end(info, record, survey, decay)
    missing_samples = info.missing_force if any(info.missing_force) else info.missing_ringing
    noise.restored[rows] += weights * force * _error_of_restored(record, survey, decay)
    if any(missing_samples):
        count = len(missing_samples)
        lost = missing_samples * exponential_window(count, 1.0, rate, count + record.trigger)
        earlier = np.exp(2j * np.pi * frequency_hz * count * record.step_s)
        missing = spectrum.conj() * np.fft.rfft(lost, survey.n_samples) * earlier
        first = slice(0, count + 1)
        sizes = np.linalg.norm(record.responses[:, first], axis=1)
        noise.missing_force[rows] += weights * missing
        noise.missing_response[rows] += weights * np.abs(missing) * sizes[:, None] / np.linalg.norm(record.force[first])


def _error_of_restored(record: Record, survey: Survey, window: FloatArray) -> FloatArray:
    """Give the deviation of the transforms of what was restored, alike in all parts and each by its own, as moduli."""
    restored = record.restored * window
    if not restored.any():
        return np.zeros((len(restored), 1))
    power = np.abs(np.fft.rfft(restored, survey.n_samples)) ** 2
    for row, part in enumerate(restored):
        starts = np.flatnonzero(np.diff(part != 0.0, prepend=False) & (part != 0.0))
        power[row] += np.sum(np.add.reduceat(part, starts) ** 2) if starts.size else 0.0
    return np.asarray(RESTORED_BY * np.sqrt(power))


def _beyond_the_end(info: RecordInfo, record: Record, survey: Survey, window: FloatArray) -> FloatArray:
    """Give the modulus of what the end of an impact cuts off of the transforms of its windowed responses.

    A mode that has fallen to q^2 at the end of the record has q of its first half in the second one, and q, q^2, ... of
    that one in what would follow, so that q / (1 - q) of it is missing. q is that of the slowest mode.
    """
    remaining = info.remaining_amplitude * np.exp(-survey.decay_1_s * info.ringing_s)
    q = float(np.sqrt(min(remaining, MOST_REMAINING)))
    windowed = record.responses * window
    windowed[:, : (record.trigger + record.n_samples) // 2] = 0.0
    return np.asarray(np.abs(np.fft.rfft(windowed, survey.n_samples)) * q / (1.0 - q))
