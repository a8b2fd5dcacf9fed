"""Checks of the measurement that need no model: is it linear, is it reciprocal, does it stand out of the noise."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.diagnosis import Gate
from frf_ipz.diagnosis.measured.forces import window_energies
from frf_ipz.diagnosis.measured.from_blows import Survey
from frf_ipz.diagnosis.observations import spectra

if TYPE_CHECKING:
    from frf_ipz.arrays import ComplexArray, FloatArray
    from frf_ipz.diagnosis.measured.source import Source
    from frf_ipz.diagnosis.measured.transfer import Measured
    from frf_ipz.diagnosis.observations import Blow

HOMOGENEOUS = 1.5  # mean squared difference of strong and weak blows, over what noise explains
RECIPROCAL = 4.0  # the same of FRFs the other way round, over noise and tolerances
COHERENT = 0.5  # noise power over signal power, at the median of the points
MODEL_FREE = 2e-3  # relative repeatability of blows that nobody can better
EXCHANGED = 0.02  # relative tolerance of FRFs the other way round: two places and two gains each


def check(source: Source) -> tuple[Gate, ...]:
    """Check a measurement.

    Parameters
    ----------
    source : Source
        What was measured.

    Returns
    -------
    tuple of Gate
        Homogeneity, reciprocity, coherence.
    """
    return homogeneity(source), reciprocity(source.training), coherence(source.training)


def homogeneity(source: Source) -> Gate:
    """Compare strong and weak blows at the same place.

    Parameters
    ----------
    source : Source
        What was measured.

    Returns
    -------
    Gate
        Not checked where there are no two blows at a place.
    """
    value = np.nan
    if isinstance(source.survey, Survey):
        pairs = [(group[0], group[-1], place) for place, group in enumerate(source.survey.groups) if len(group) > 1]
        ratios = [_difference(source.survey, pair, source.training.s) for pair in pairs]
        value = float(max(ratios, default=np.nan))
    said = {
        True: "Strong and weak blows give the same FRFs: the structure behaves linearly.",
        False: f"FRFs change with the level of the blow, {value:.3g} times more than noise explains: something is not "
        "linear, or the structure changed from blow to blow.",
    }
    if np.isnan(value):
        return Gate(
            name="homogeneity",
            value=value,
            limit=HOMOGENEOUS,
            statement="Linearity could not be checked: no place has two blows.",
        )
    return Gate(name="homogeneity", value=value, limit=HOMOGENEOUS, statement=said[value <= HOMOGENEOUS])


def _difference(survey: Survey, pair: tuple[Blow, Blow, int], s: ComplexArray) -> float:
    strong, weak, place = pair
    (force_a, out_a), (force_b, out_b) = spectra((strong, weak), s)
    frequency = s.imag / (2 * np.pi)
    kept_s = np.mean([window_energies(s, pulse) for pulse in survey.pulses[place]], axis=0)
    per_force = 1 / np.abs(force_a) ** 2 + 1 / np.abs(force_b) ** 2
    total, count = 0.0, 0
    for column, sensor in enumerate(strong.sensors):
        first, second = out_a[:, column] / force_a, out_b[:, column] / force_b
        window = (1 - np.exp(-2 * s.real * strong.duration_s)) / (2 * s.real)
        noise = survey.responses[sensor.channel].density(frequency) * window * per_force
        size = np.maximum(np.abs(first), np.abs(second)) ** 2
        noise += size * (survey.force.density(frequency) * kept_s * per_force + 2 * MODEL_FREE**2)
        total += float(np.sum(np.abs(first - second) ** 2 / noise))
        count += len(s)
    return total / count


def reciprocity(measured: Measured) -> Gate:
    """Compare FRFs whose sensor and blow change places.

    Parameters
    ----------
    measured : Measured
        Transfer functions.

    Returns
    -------
    Gate
        Not checked where no pair was measured both ways.
    """
    ends = [(label.output_dof.unsigned, label.input_dof.unsigned) for label in measured.labels]
    ratios = []
    for index, (output, struck) in enumerate(ends):
        for other in range(index + 1, len(ends)):
            same = measured.labels[index].quantity is measured.labels[other].quantity
            if ends[other] == (struck, output) and output != struck and same:
                ratios.append(_exchanged(measured, index, other))
    if not ratios:
        return Gate(
            name="reciprocity",
            value=np.nan,
            limit=RECIPROCAL,
            statement="Reciprocity could not be checked: no FRF was measured both ways.",
        )
    value = max(ratios)
    good = value <= RECIPROCAL
    statement = (
        "FRFs are the same with sensor and blow exchanged."
        if good
        else f"FRFs differ with sensor and blow exchanged, {value:.3g} times more than noise and tolerances explain: a "
        "place, a gain or a delay is wrong, or something is not linear."
    )
    return Gate(name="reciprocity", value=value, limit=RECIPROCAL, statement=statement)


def _exchanged(measured: Measured, first: int, second: int) -> float:
    signs = measured.labels[first].sign * measured.labels[second].sign
    difference = measured.values[:, first] - signs * measured.values[:, second]
    size = np.maximum(measured.size[:, first], measured.size[:, second])
    noise = _noise(measured)[:, first] + _noise(measured)[:, second] + (EXCHANGED * size) ** 2
    return float(np.mean(np.abs(difference) ** 2 / noise))


def coherence(measured: Measured) -> Gate:
    """Compare noise with signal.

    Parameters
    ----------
    measured : Measured
        Transfer functions.

    Returns
    -------
    Gate
        Of the worst FRF.
    """
    share = np.median(_noise(measured) / np.maximum(measured.size, np.finfo(float).tiny) ** 2, axis=0)
    worst = int(np.argmax(share))
    value = float(share[worst])
    statement = (
        "The FRFs stand out of the noise."
        if value <= COHERENT
        else f"The FRF {measured.labels[worst]} drowns in noise over half of the band or more: strike harder, average "
        "more, or leave it out."
    )
    return Gate(name="coherence", value=value, limit=COHERENT, statement=statement)


def _noise(measured: Measured) -> FloatArray:
    return np.array([np.diag(covariance).real for covariance in measured.covariance]).T
