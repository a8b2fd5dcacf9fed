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
        Measured values by the number of the predicted FRF, NaN on lines that were not measured.
    """
    if frfs is None:
        return {}
    known = {_key(label): number for number, label in enumerate(frfs.labels)}
    found = {}
    for number, label in enumerate(prediction.labels):
        place = known.get(_key(label))
        if place is not None and frfs.labels[place].quantity is label.quantity:
            sign = label.sign * frfs.labels[place].sign
            found[number] = sign * _at(frfs, place, prediction)
    return found


def _key(label: FrfLabel) -> tuple[str, str]:
    return label.output_dof.name, label.input_dof.name


def _at(frfs: FrfSet, place: int, prediction: Prediction) -> ComplexArray:
    wanted, lines = prediction.frequency_hz, frfs.frequency_hz
    nearest = np.clip(np.searchsorted(lines, wanted), 1, len(lines) - 1)
    nearest -= wanted - lines[nearest - 1] < lines[nearest] - wanted
    step = float(np.median(np.diff(lines)))
    values: ComplexArray = frfs.values[nearest, place].copy()
    values[np.abs(lines[nearest] - wanted) > step / 2] = np.nan
    return values
