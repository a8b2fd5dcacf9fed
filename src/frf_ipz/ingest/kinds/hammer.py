"""FRFs of a hammer test: windows, transforms, sums; one blow in memory at a time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.ingest.kinds.averaging import average_recordings
from frf_ipz.ingest.signals.decay import noise_power
from frf_ipz.ingest.signals.windows import exponential_window, force_window

if TYPE_CHECKING:
    from frf_ipz.ingest.campaign_file import Test
    from frf_ipz.ingest.frf_estimate import Recordings
    from frf_ipz.ingest.kinds.averages import RunAverage
    from frf_ipz.ingest.options import IngestOptions
    from frf_ipz.ingest.records import Blow
    from frf_ipz.ingest.survey.record_info import Survey
    from frf_ipz.progress import Progress


def estimate_hammer(test: Test, options: IngestOptions, progress: Progress) -> Recordings:
    """Estimate the FRFs of a hammer test.

    Parameters
    ----------
    test : Test
        The test.
    options : IngestOptions
        The user's choice.
    progress : Progress
        Told how far it is.

    Returns
    -------
    Recordings
        FRFs, table of blows, traces.

    Raises
    ------
    InputError
        If a recording cannot be used.
    """
    return average_recordings(test, options, progress, _add)


def _add(average: RunAverage, blow: Blow, survey: Survey) -> float:
    """Add a blow to its run's sums, and return the energy of its force."""
    signals = blow.windowed(survey.decay_1_s, survey.n_samples)
    average.sums.add(signals[0], signals[1:])
    average.independent += 1.0
    if average.sums.count == 1:  # should it stay the only one, its own record has to tell the noise
        _measure_noise(average, blow, survey)
    return float(np.sum(signals[0] ** 2))


def _measure_noise(average: RunAverage, blow: Blow, survey: Survey) -> None:
    frequency = np.asarray(np.fft.rfftfreq(survey.n_samples, blow.step_s))
    decay = exponential_window(blow.n_samples, blow.step_s, survey.decay_1_s, blow.trigger)
    kept = decay * force_window(blow.n_samples, *blow.kept_force)
    responses = [noise_power(response[blow.trigger :], blow.step_s, frequency) for response in blow.responses]
    average.response_noise = np.array(responses) * np.sum(decay**2)
    average.force_noise = noise_power(blow.force[blow.trigger :], blow.step_s, frequency) * np.sum(kept**2)
