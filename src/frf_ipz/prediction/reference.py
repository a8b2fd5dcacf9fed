"""Predicted FRFs that were measured after all: kept aside, or among those of the test."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray

if TYPE_CHECKING:
    from frf_ipz.frf import FrfLabel, FrfSet
    from frf_ipz.prediction.prediction import Prediction


def measured_at(prediction: Prediction, frfs: FrfSet | None) -> dict[int, ComplexArray]:
    """Find the predicted FRFs that were measured after all, on the lines of the prediction.

    Parameters
    ----------
    prediction : Prediction
        The prediction.
    frfs : FrfSet, optional
        Measured FRFs, with or without those.

    Returns
    -------
    dict of int to (n_lines,) complex array
        Measured values by the number of the predicted FRF, NaN on lines that were not measured. Where the shape alone
        is predicted, at the level of the prediction.
    """
    if frfs is None:
        return {}
    known = {_key(label): number for number, label in enumerate(frfs.labels)}
    measured = {}
    for number, label in enumerate(prediction.labels):
        column = known.get(_key(label))
        if column is not None and frfs.labels[column].quantity is label.quantity:
            sign = label.sign * frfs.labels[column].sign
            measured[number] = sign * _at(frfs, column, prediction)
    return _to_known_level(prediction, measured)


def _to_known_level(prediction: Prediction, measured: dict[int, ComplexArray]) -> dict[int, ComplexArray]:
    """Bring the FRFs of each point whose level is not predicted to that of the prediction, by one real factor."""
    points: dict[str, list[int]] = {}
    for number in measured:
        if number in prediction.relative:
            points.setdefault(prediction.labels[number].output_dof.name, []).append(number)
    levelled = dict(measured)
    for numbers in points.values():
        computed = prediction.values[:, numbers]
        values = np.stack([measured[number] for number in numbers], axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):  # an FRF may be 0, and is NaN where it was not measured
            logs = np.log(np.abs(computed) / np.abs(values))
        known = np.isfinite(logs)
        if known.any():
            sign = -1.0 if np.sum((computed.conj() * values)[known].real) < 0 else 1.0
            factor = sign * float(np.exp(np.median(logs[known])))
            levelled.update({number: factor * measured[number] for number in numbers})
    return levelled


def _key(label: FrfLabel) -> tuple[str, str]:
    return label.output_dof.name, label.input_dof.name


def _at(frfs: FrfSet, column: int, prediction: Prediction) -> ComplexArray:
    predicted_hz, lines = prediction.frequency_hz, frfs.frequency_hz
    nearest = np.clip(np.searchsorted(lines, predicted_hz), 1, len(lines) - 1)
    nearest -= predicted_hz - lines[nearest - 1] < lines[nearest] - predicted_hz
    step = float(np.median(np.diff(lines)))
    values: ComplexArray = frfs.values[nearest, column].copy()
    values[np.abs(lines[nearest] - predicted_hz) > step / 2] = np.nan
    return values
