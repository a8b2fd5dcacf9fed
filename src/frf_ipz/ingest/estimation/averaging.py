"""FRFs of a test of recordings: each record added to the averages of its set-up, one in memory at a time.

What the kinds of test differ in is how a record is added. Averages become FRFs by an estimator, with coherence and
variance; an FRF that several set-ups measured is the mean of them all.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from frf_ipz.frf import ForceNoise, FrfLabel, FrfSet
from frf_ipz.ingest.campaign import setup_labels
from frf_ipz.ingest.estimation.impact_noise import (
    ImpactNoise,
    add_noise,
    gain_variance,
    impact_variance,
    relative_force_noise,
    without_force_noise,
)
from frf_ipz.ingest.estimation.record_table import record_table
from frf_ipz.ingest.estimation.spectra import SpectrumSums, empty_sums, estimate_coherence, estimate_frf
from frf_ipz.ingest.estimation.traces import add_traces
from frf_ipz.ingest.estimation.variance import frf_variance
from frf_ipz.ingest.frf_estimate import FrfEstimate, Trace
from frf_ipz.ingest.records import read_records, survey_records
from frf_ipz.ingest.signals.windows import correlated_lines, taper_length

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from frf_ipz.arrays import ComplexArray, FloatArray
    from frf_ipz.ingest.campaign import TestSetup, VibrationTest
    from frf_ipz.ingest.options import IngestOptions
    from frf_ipz.ingest.recording_files import RecordingFiles
    from frf_ipz.ingest.records import Record
    from frf_ipz.ingest.signals.periods import PeriodicForce
    from frf_ipz.ingest.survey.record_info import RecordInfo, Survey
    from frf_ipz.progress import Progress

Column = TypeVar("Column", "FloatArray", "ComplexArray")
SURVEY_SHARE = 0.6  # of the work


@dataclass(slots=True, eq=False)
class SetupAverage:
    """What has been summed for one set-up.

    Parameters
    ----------
    sums : SpectrumSums
        Of all its impacts, records or segments.
    independent : (n_outputs,) array
        How many independent ones those of each response are worth.
    noise : ImpactNoise, optional
        What was measured in the records themselves, where they are impacts.
    periodic : PeriodicForce, optional
        What comes again of the force, where all of it does so.
    """

    sums: SpectrumSums
    independent: FloatArray
    noise: ImpactNoise | None = None
    periodic: PeriodicForce | None = None

    def take(self, rows: Sequence[int]) -> SetupAverage:
        """Take some responses.

        Parameters
        ----------
        rows : sequence of int
            Which.

        Returns
        -------
        SetupAverage
            Theirs.
        """
        noise = None if self.noise is None else self.noise.take(rows)
        return SetupAverage(self.sums.take(rows), self.independent[list(rows)], noise, self.periodic)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _LabelEstimate:
    values: ComplexArray
    variance: FloatArray
    coherence: FloatArray
    count: int
    force_noise: ComplexArray | None
    missing_force: ComplexArray | None
    gain_variance: FloatArray | None
    force: int = 0


def average_recordings(
    files: RecordingFiles,
    options: IngestOptions,
    progress: Progress,
    add: Callable[[SetupAverage, RecordInfo, Record, Survey], float],
) -> FrfEstimate:
    """Average all records of a test.

    Parameters
    ----------
    files : RecordingFiles
        The recordings of the test.
    options : IngestOptions
        The user's choice.
    progress : Progress
        Called with the share of the work that is done.
    add : callable
        Adds one record to the averages of its set-up, and returns the energy of its force.

    Returns
    -------
    FrfEstimate
        FRFs, table of records, traces.

    Raises
    ------
    InputError
        If a recording cannot be used.
    """
    test = files.test
    survey = survey_records(files, options, lambda fraction, text: progress(SURVEY_SHARE * fraction, text))
    n_lines, n_outputs = survey.n_samples // 2 + 1, len(test.output_channels)
    averages = {setup: SetupAverage(empty_sums(n_lines, n_outputs), np.zeros(n_outputs)) for setup in test.setups}
    energies: list[float] = []
    traces: tuple[Trace, ...] = ()
    records = read_records(files, options, used_only=False)
    for position, (info, record) in enumerate(zip(survey.records, records, strict=True)):
        fraction = position / len(survey.records)
        progress(SURVEY_SHARE + (1.0 - SURVEY_SHARE) * fraction, f"averaging {record.name}")
        traces = add_traces(traces, info, record)
        energies.append(add(averages[info.setup], info, record, survey) if record.used else 0.0)
    return FrfEstimate(
        frfs=_assemble_frfs(test, survey, averages, options),
        records=record_table(survey, energies),
        traces=traces,
        choices=survey.choices,
        warnings=(*survey.warnings, *_warn_of_single_records(averages)),
    )


def _assemble_frfs(
    test: VibrationTest, survey: Survey, averages: Mapping[TestSetup, SetupAverage], options: IngestOptions
) -> FrfSet:
    """Make the FRFs of a test, in the order of its labels."""
    estimates: dict[FrfLabel, _LabelEstimate] = {}
    for number, (setups, labels) in enumerate(_group_labels(test).items()):
        pooled_average = _pool(test, [averages[setup] for setup in setups], setups, labels)
        of_labels = _estimate(pooled_average, labels, options.estimator)
        estimates |= {label: replace(estimate, force=number) for label, estimate in of_labels.items()}
    measured_labels = tuple(label for label in test.labels if label in estimates)
    ordered_estimates = [estimates[label] for label in measured_labels]
    duration = survey.n_samples * survey.step_s
    n_lines = survey.n_samples // 2 + 1
    return FrfSet(
        frequency_hz=np.arange(n_lines) / duration,
        values=np.column_stack([estimate.values for estimate in ordered_estimates]),
        labels=measured_labels,
        variance=np.column_stack([estimate.variance for estimate in ordered_estimates]),
        coherence=np.column_stack([estimate.coherence for estimate in ordered_estimates]),
        averages=np.array([estimate.count for estimate in ordered_estimates], np.int64),
        window_decay_1_s=survey.decay_1_s,
        correlated_lines=correlated_lines(survey.decay_1_s * duration),
        unknown_scale=test.unknown_scale,
        force_noise=_force_noise(survey, ordered_estimates),
        missing_force=_columns_unless_zero([estimate.missing_force for estimate in ordered_estimates]),
        gain_variance=_columns_unless_zero([estimate.gain_variance for estimate in ordered_estimates]),
    )


def _columns_unless_zero(columns: Sequence[Column | None]) -> Column | None:
    """Stack what FRFs lack; None where they lack nothing, or it is not known."""
    known_columns = [column for column in columns if column is not None]
    if len(known_columns) < len(columns) or not np.any(known_columns):
        return None
    return np.column_stack(known_columns)


def _force_noise(survey: Survey, estimates: Sequence[_LabelEstimate]) -> ForceNoise | None:
    """Give the noise of forces over the time for which they are kept, half of their windows' tapers included.

    None without windows: then lines have their own.
    """
    columns = [estimate.force_noise for estimate in estimates if estimate.force_noise is not None]
    intervals_s = np.array([_kept_interval_s(record) for record in survey.used])
    is_cut = any(record.force_interval[1] < record.n_samples for record in survey.used)
    if len(columns) < len(estimates) or not is_cut:
        return None
    start_s, stop_s = np.median(intervals_s, axis=0).tolist()  # all are the same but for double hits
    return ForceNoise(
        relative=np.column_stack(columns),
        force=np.array([estimate.force for estimate in estimates], np.int64),
        interval_s=(start_s, stop_s),
    )


def _kept_interval_s(record: RecordInfo) -> tuple[float, float]:
    start, stop = record.force_interval
    taper = taper_length(start, stop) / 2
    start_at, stop_at = max(start - taper, 0), min(stop + taper, record.n_samples)
    return (start_at - record.trigger) * record.step_s, (stop_at - record.trigger) * record.step_s


def _group_labels(test: VibrationTest) -> dict[tuple[TestSetup, ...], list[FrfLabel]]:
    """Group the labels by the set-ups that measured them."""
    groups: dict[tuple[TestSetup, ...], list[FrfLabel]] = {}
    for label in test.labels:
        setups = tuple(setup for setup in test.setups if label in setup_labels(test.channels, setup))
        groups.setdefault(setups, []).append(label)
    return groups


def _pool(
    test: VibrationTest, averages: Sequence[SetupAverage], setups: Sequence[TestSetup], labels: Sequence[FrfLabel]
) -> SetupAverage:
    """Add up the averages of some set-ups, of the rows that some labels stand in."""
    rows_of_setup = [[setup_labels(test.channels, setup).index(label) for label in labels] for setup in setups]
    parts = [average.take(rows) for average, rows in zip(averages, rows_of_setup, strict=True)]
    sums = SpectrumSums(
        np.sum([part.sums.force for part in parts], axis=0),
        np.sum([part.sums.cross for part in parts], axis=0),
        np.sum([part.sums.responses for part in parts], axis=0),
        np.sum([part.sums.counts for part in parts], axis=0),
    )
    noises = [part.noise for part in parts if part.noise is not None]
    independent = np.sum([part.independent for part in parts], axis=0)
    periodic = [part.periodic for part in parts if part.periodic is not None]
    return SetupAverage(
        sums,
        independent,
        add_noise(noises) if noises else None,
        sum(periodic[1:], periodic[0]) if periodic and len(periodic) == len(parts) else None,
    )


def _estimate(average: SetupAverage, labels: Sequence[FrfLabel], estimator: str) -> dict[FrfLabel, _LabelEstimate]:
    """Estimate the FRFs of some labels; none of a response that no record has."""
    sums, noise = average.sums, average.noise
    values = estimate_frf(sums, estimator)
    coherence = estimate_coherence(sums)
    force_noise = missing_force = slow_variance = None
    if noise is None:
        variance = frf_variance(sums, average.independent)
        if average.periodic is not None:
            variance[average.periodic.is_noise()] = np.nan
    else:
        if estimator == "H1":
            own_power = without_force_noise(sums, noise)
            values = estimate_frf(replace(sums, force=np.where(own_power > 0.0, own_power, sums.force)))
        variance = impact_variance(sums, noise, values)
        slow_variance = gain_variance(sums, noise, values)
        force_noise = relative_force_noise(sums, noise, values, variance - slow_variance)
        power = sums.force.T
        missing_force = np.divide(noise.missing_force.T, power, out=np.zeros(values.shape, complex), where=power > 0.0)
    return {
        label: _LabelEstimate(
            values=values[:, column],
            variance=variance[:, column],
            coherence=coherence[:, column],
            count=int(sums.counts[column]),
            force_noise=None if force_noise is None else force_noise[:, column],
            missing_force=None if missing_force is None else missing_force[:, column],
            gain_variance=None if slow_variance is None else slow_variance[:, column],
        )
        for column, label in enumerate(labels)
        if sums.counts[column]
    }


def _warn_of_single_records(averages: Mapping[TestSetup, SetupAverage]) -> tuple[str, ...]:
    """Say which FRFs come from a single record, and what their variance is then."""
    single_averages = {setup: average for setup, average in averages.items() if max(average.sums.counts) == 1}
    if not single_averages:
        return ()
    single_dofs = [str(setup.input_dof) for setup in single_averages]
    is_known = all(average.noise is not None for average in single_averages.values())
    source = "is the noise in that record alone" if is_known else "is not known"
    return (f"a single record at {', '.join(dict.fromkeys(single_dofs))}: no coherence, and the variance {source}",)
