"""Sums of spectra per run into FRFs per label: estimator, coherence, variance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.frf import FrfLabel, FrfSet
from frf_ipz.ingest.campaign import setup_labels
from frf_ipz.ingest.signals.windows import correlated_lines
from frf_ipz.ingest.spectra import SpectrumSums, estimate_coherence, estimate_frf
from frf_ipz.ingest.variance import frf_variance, power_to_variance

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from frf_ipz.arrays import ComplexArray, FloatArray
    from frf_ipz.ingest.campaign import TestSetup, VibrationTest
    from frf_ipz.ingest.options import IngestOptions
    from frf_ipz.ingest.survey.record_info import Survey


@dataclass(slots=True, eq=False)
class SetupAverage:
    """What has been summed for one run.

    Parameters
    ----------
    sums : SpectrumSums
        Of all its blows or segments.
    independent : float
        How many independent ones they are worth.
    response_noise, force_noise : array, optional
        Noise power of one blow's responses, (n_outputs, n_lines), and force, (n_lines,), where it was measured in the
        record itself.
    """

    sums: SpectrumSums
    independent: float = 0.0
    response_noise: FloatArray | None = None
    force_noise: FloatArray | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Estimate:
    values: ComplexArray
    variance: FloatArray
    coherence: FloatArray
    count: int


def assemble_frfs(
    test: VibrationTest, survey: Survey, averages: Mapping[TestSetup, SetupAverage], options: IngestOptions
) -> FrfSet:
    """Make the FRFs of a test.

    Parameters
    ----------
    test : VibrationTest
        The test.
    survey : Survey
        Step, length and window.
    averages : mapping of TestSetup to SetupAverage
        Sums of each run. An FRF that several runs measured is the mean of them all.
    options : IngestOptions
        The estimator.

    Returns
    -------
    FrfSet
        In the order of the test's labels.
    """
    estimates: dict[FrfLabel, _Estimate] = {}
    for setups, labels in _sharing(test).items():
        pooled = _pool(test, [averages[setup] for setup in setups], setups, labels)
        estimates |= _estimate(pooled, labels, options.estimator)
    ordered = [estimates[label] for label in test.labels]
    duration = survey.n_samples * survey.step_s
    n_lines = survey.n_samples // 2 + 1
    return FrfSet(
        frequency_hz=np.arange(n_lines) / duration,
        values=np.column_stack([one.values for one in ordered]),
        labels=test.labels,
        variance=np.column_stack([one.variance for one in ordered]),
        coherence=np.column_stack([one.coherence for one in ordered]),
        averages=np.array([one.count for one in ordered], np.int64),
        window_decay_1_s=survey.decay_1_s,
        correlated_lines=correlated_lines(survey.decay_1_s * duration),
        unknown_scale=test.unknown_scale,
    )


def about_variance(averages: Mapping[TestSetup, SetupAverage]) -> tuple[str, ...]:
    """Say where the variance comes from a single blow.

    Parameters
    ----------
    averages : mapping of TestSetup to SetupAverage
        Sums of each run.

    Returns
    -------
    tuple of str
        Warnings.
    """
    single = [str(setup.input_dof) for setup, average in averages.items() if average.sums.count == 1]
    if not single:
        return ()
    known = all(average.response_noise is not None for average in averages.values() if average.sums.count == 1)
    source = "is the noise in that record alone" if known else "is not known"
    return (f"a single blow or record at {', '.join(dict.fromkeys(single))}: no coherence, and the variance {source}",)


def _sharing(test: VibrationTest) -> dict[tuple[TestSetup, ...], list[FrfLabel]]:
    """Group the labels by the runs that measured them."""
    groups: dict[tuple[TestSetup, ...], list[FrfLabel]] = {}
    for label in test.labels:
        setups = tuple(setup for setup in test.setups if label in setup_labels(test.channels, setup))
        groups.setdefault(setups, []).append(label)
    return groups


def _pool(
    test: VibrationTest, averages: Sequence[SetupAverage], setups: Sequence[TestSetup], labels: Sequence[FrfLabel]
) -> SetupAverage:
    places = [[setup_labels(test.channels, setup).index(label) for label in labels] for setup in setups]
    first = averages[0]
    if len(averages) == 1:
        rows = places[0]
        sums = SpectrumSums(first.sums.force, first.sums.cross[rows], first.sums.responses[rows], first.sums.count)
        noise = None if first.response_noise is None else first.response_noise[rows]
        return SetupAverage(sums, first.independent, noise, first.force_noise)
    parts = list(zip(averages, places, strict=True))
    sums = SpectrumSums(
        np.sum([one.sums.force for one in averages], axis=0),
        np.sum([one.sums.cross[rows] for one, rows in parts], axis=0),
        np.sum([one.sums.responses[rows] for one, rows in parts], axis=0),
        sum(one.sums.count for one in averages),
    )
    return SetupAverage(sums, sum(one.independent for one in averages))


def _estimate(average: SetupAverage, labels: Sequence[FrfLabel], estimator: str) -> dict[FrfLabel, _Estimate]:
    sums = average.sums
    values = estimate_frf(sums, estimator)
    coherence = estimate_coherence(sums)
    variance = _variance(average, values)
    return {
        label: _Estimate(
            values=values[:, place],
            variance=variance[:, place],
            coherence=coherence[:, place],
            count=sums.count,
        )
        for place, label in enumerate(labels)
    }


def _variance(average: SetupAverage, values: ComplexArray) -> FloatArray:
    """Take the scatter between blows, and of a single blow the noise in its own record."""
    if average.sums.count == 1 and average.response_noise is not None and average.force_noise is not None:
        power = average.response_noise.T + average.force_noise[:, None] * np.abs(values) ** 2
        return power_to_variance(power, average.sums.force)
    return frf_variance(average.sums, average.independent)
