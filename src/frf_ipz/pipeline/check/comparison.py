"""The FE model beside the peaks of the FRFs: whether the two can be one structure, and what has to be corrected."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.assessment.assess import compare_modes
from frf_ipz.assessment.causes.columns import find_exchanged_columns
from frf_ipz.assessment.causes.likely_cause import agrees, find_likely_cause
from frf_ipz.assessment.causes.modal_comparison import FREQUENCY_SCALE, measured_modes, modes_of_peaks
from frf_ipz.errors import FrfIpzError
from frf_ipz.identification.fit import fit_modes
from frf_ipz.identification.peaks import find_peaks
from frf_ipz.pipeline.check.look import Look
from frf_ipz.plotting.wording import number
from frf_ipz.rational import natural_frequency_hz

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray
    from frf_ipz.assessment.assessment import LikelyCause
    from frf_ipz.assessment.causes.cause import Situation
    from frf_ipz.ingest.frf_estimate import FrfEstimate
    from frf_ipz.modes import ModalParameters
    from frf_ipz.pipeline.inputs import PipelineInputs

FREQUENCIES = 8  # that are listed
FEWEST = 3  # measured frequencies: two have a common factor with some pair of many computed ones by chance


def compare_with_model(inputs: PipelineInputs, estimate: FrfEstimate) -> Look:
    """Set the FE model's modes beside the peaks of the FRFs.

    Parameters
    ----------
    inputs : PipelineInputs
        The set-up.
    estimate : FrfEstimate
        Its FRFs.

    Returns
    -------
    Look
        The peaks and the model's frequencies in the same band; what most likely has to be corrected.
    """
    if estimate.modes is not None:
        return _beside_stated_modes(inputs, estimate.modes)
    places, labels = inputs.places_of_mistakes, estimate.frfs.labels
    impacts = inputs.impacts(estimate)
    exchanged = find_exchanged_columns(impacts, labels, test_file=places["test_file"])
    try:
        peaks = find_peaks(estimate.frfs, inputs.options.fit)
    except FrfIpzError as error:
        return Look(open_points=(*_worded(exchanged), str(error)))
    if not len(peaks.frequency_hz):
        return Look(open_points=(*_worded(exchanged), "no peak stands out of the FRFs"))
    line = f"  peaks     {_listed(peaks.frequency_hz)}"
    if exchanged is not None or inputs.fe_model is None:
        return Look(lines=(line,), open_points=tuple(_worded(exchanged)))
    measured = modes_of_peaks(peaks, labels)
    situation = compare_modes(measured, inputs.fe_model, **places)
    if situation is None:
        return Look(lines=(line,))
    beside = f"    model   {_listed(_in_band(situation))}"
    is_relative = estimate.frfs.unknown_scale != "none"
    return Look(lines=(line, beside), open_points=tuple(_open_points(situation, is_relative=is_relative)))


def _beside_stated_modes(inputs: PipelineInputs, modes: ModalParameters) -> Look:
    """Set the FE model's modes beside stated ones; of their shapes the pairing tells."""
    fit = fit_modes(modes, options=inputs.options.fit)
    lines = (f"  stated    {_listed(natural_frequency_hz(fit.model.poles))}",)
    if inputs.fe_model is None:
        return Look(lines=lines)
    situation = compare_modes(measured_modes(fit), inputs.fe_model, **inputs.places_of_mistakes)
    if situation is None:
        return Look(lines=lines)
    beside = f"    model   {_listed(_in_band(situation))}"
    return Look(lines=(*lines, beside), open_points=tuple(_common_factor(situation)))


def _open_points(situation: Situation, *, is_relative: bool) -> list[str]:
    """Say what has to be corrected; where the scale is unknown, frequencies alone tell."""
    if is_relative:
        return _common_factor(situation)
    cause = find_likely_cause(situation)
    if cause is not None:
        return _worded(cause)
    return [] if agrees(situation) else _disagreement(situation)


def _worded(cause: LikelyCause | None) -> list[str]:
    return [] if cause is None else [f"{cause.file}, {cause.line_or_key}: {cause.says}"]


def _in_band(situation: Situation) -> FloatArray:
    """Give the computed frequencies of the measured band; the lowest where none is in it."""
    low, high = situation.measured.band_hz
    frequency_hz = situation.computed.frequency_hz
    inside = frequency_hz[(frequency_hz >= low) & (frequency_hz <= high)]
    return inside if len(inside) else frequency_hz


def _listed(frequency_hz: FloatArray) -> str:
    more = f" and {len(frequency_hz) - FREQUENCIES} more" if len(frequency_hz) > FREQUENCIES else ""
    return " ".join(number(hz) for hz in frequency_hz[:FREQUENCIES]) + f" Hz{more}"


def _common_factor(situation: Situation) -> list[str]:
    """Name a factor that brings every measured frequency to a computed one; the model may have more."""
    measured, computed = situation.measured.frequency_hz, situation.computed.frequency_hz
    if len(measured) < FEWEST or not len(computed):
        return []
    anchors = np.log(measured[0] / computed)  # the lowest measured one is any of the computed
    errors = np.array([_distances(measured, computed * np.exp(anchor)) for anchor in anchors])
    best = int(np.argmin(errors.max(axis=1)))
    if errors[best].max() > FREQUENCY_SCALE or abs(anchors[best]) < FREQUENCY_SCALE:
        return []
    return [
        f"{situation.model_file}: all frequencies of the model are off by the common factor "
        f"{number(np.exp(anchors[best]))}: look at the units and values of its stiffness, mass and dimensions"
    ]


def _distances(measured: FloatArray, computed: FloatArray) -> FloatArray:
    """Give the relative distance of each measured frequency to the nearest computed one."""
    return np.asarray(np.abs(np.log(measured[:, None] / computed)).min(axis=1))


def _disagreement(situation: Situation) -> list[str]:
    factor = _common_factor(situation)
    if factor:
        return factor
    if _distances(situation.measured.frequency_hz, situation.computed.frequency_hz).max() < FREQUENCY_SCALE:
        return [
            f"{situation.test_file}: the frequencies agree with the model's, the shapes at the measured points do not, "
            "and no single mistake that is known explains it: look at DOFs, signs and units of sensors and inputs"
        ]
    return [
        f"{situation.model_file}: frequencies and shapes of the model do not agree with the peaks of the FRFs, and no "
        "single mistake that the program knows explains it: look at material, supports, DOFs of sensors and inputs"
    ]
