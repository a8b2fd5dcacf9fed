"""FRFs of a hammer test: windows, transforms, averages."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.ingest.estimation.averaging import average_recordings
from frf_ipz.ingest.signals.decay import noise_power
from frf_ipz.ingest.signals.windows import exponential_window, force_window

if TYPE_CHECKING:
    from frf_ipz.ingest.campaign import VibrationTest
    from frf_ipz.ingest.estimation.averaging import SetupAverage
    from frf_ipz.ingest.frf_estimate import FrfEstimate
    from frf_ipz.ingest.options import IngestOptions
    from frf_ipz.ingest.records import Record
    from frf_ipz.ingest.survey.record_info import Survey
    from frf_ipz.progress import Progress


def estimate_hammer(test: VibrationTest, options: IngestOptions, progress: Progress) -> FrfEstimate:
    """Estimate the FRFs of a hammer test.

    Parameters
    ----------
    test : VibrationTest
        The test.
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
    return average_recordings(test, options, progress, _add_impact)


def _add_impact(average: SetupAverage, record: Record, survey: Survey) -> float:
    """Add an impact to the average of its set-up, and return the energy of its force."""
    signals = record.apply_windows(survey.decay_1_s, survey.n_samples)
    average.sums.add(signals[0], signals[1:])
    average.independent += 1.0
    if average.sums.count == 1:  # should it stay the only one, the noise has to come from its own record
        _measure_noise(average, record, survey)
    return float(np.sum(signals[0] ** 2))


def _measure_noise(average: SetupAverage, record: Record, survey: Survey) -> None:
    frequency_hz = np.asarray(np.fft.rfftfreq(survey.n_samples, record.step_s))
    decay = exponential_window(record.n_samples, record.step_s, survey.decay_1_s, record.trigger)
    window = decay * force_window(record.n_samples, *record.force_interval)
    responses = [noise_power(response[record.trigger :], record.step_s, frequency_hz) for response in record.responses]
    average.response_noise = np.array(responses) * np.sum(decay**2)
    average.force_noise = noise_power(record.force[record.trigger :], record.step_s, frequency_hz) * np.sum(window**2)
