"""FRFs of a hammer test: windows, transforms, sums; one blow in memory at a time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.ingest.blows import read_blows, survey_blows
from frf_ipz.ingest.kinds.averages import RunAverage, about_variance, assemble_frfs
from frf_ipz.ingest.kinds.table import blow_table
from frf_ipz.ingest.kinds.traces import blow_traces
from frf_ipz.ingest.recording_files import RecordingFiles
from frf_ipz.ingest.recordings import Recordings, Trace
from frf_ipz.ingest.signals.decay import noise_power
from frf_ipz.ingest.signals.windows import exponential_window, force_window
from frf_ipz.ingest.spectra import empty_sums

if TYPE_CHECKING:
    from frf_ipz.ingest.blows import Blow
    from frf_ipz.ingest.options import IngestOptions
    from frf_ipz.ingest.survey.facts import Survey
    from frf_ipz.ingest.test_file import Test
    from frf_ipz.progress import Progress

SURVEYED = 0.6  # share of the work that the first look takes


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
    files = RecordingFiles(test=test)
    survey = survey_blows(files, options, lambda fraction, text: progress(SURVEYED * fraction, text))
    n_lines, n_outputs = survey.n_samples // 2 + 1, len(test.output_channels)
    averages = {run: RunAverage(empty_sums(n_lines, n_outputs)) for run in test.runs}
    energies: list[float] = []
    traces: tuple[Trace, ...] = ()
    blows = read_blows(test, options, survey=survey, files=files, used_only=False)
    for done, (facts, blow) in enumerate(zip(survey.blows, blows, strict=True)):
        progress(SURVEYED + (1.0 - SURVEYED) * done / len(survey.blows), f"averaging {blow.name}")
        traces = blow_traces(facts, blow, traces)
        energies.append(_add(averages[facts.run], blow, survey) if blow.used else 0.0)
    return Recordings(
        frfs=assemble_frfs(test, survey, averages, options),
        blows=blow_table(survey, energies),
        traces=traces,
        choices=survey.choices,
        warnings=(*survey.warnings, *about_variance(averages)),
    )


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
