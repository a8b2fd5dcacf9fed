"""Predicted FRFs as they were before the last change: drawn behind those of now."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from frf_ipz.plotting.frfs import magnitude_and_phase, magnitude_hover
from frf_ipz.plotting.picture import Picture, Role, with_layers

if TYPE_CHECKING:
    from frf_ipz.arrays import ComplexArray, FloatArray
    from frf_ipz.frf import FrfLabel
    from frf_ipz.prediction.prediction import Prediction
    from frf_ipz.runs.results import Results

NAME = "before the last change"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ghost:
    """What is kept of a prediction when another one takes its place.

    Parameters
    ----------
    frequency_hz : (n_lines,) array
        Hz.
    curves : dict of FrfLabel to (n_lines,) complex array
        FRFs of the updated model.
    """

    frequency_hz: FloatArray
    curves: dict[FrfLabel, ComplexArray]

    @classmethod
    def of(cls, run: Results) -> Self | None:
        """Keep what a run has predicted.

        Parameters
        ----------
        run : Results
            What it holds.

        Returns
        -------
        Ghost or None
            None where nothing was predicted.
        """
        prediction = run.prediction
        if prediction is None:
            return None
        curves = dict(zip(prediction.labels, prediction.values.T.copy(), strict=True))
        return cls(frequency_hz=prediction.frequency_hz, curves=curves)

    def behind(self, picture: Picture, prediction: Prediction) -> Picture:
        """Draw the older curve into the picture of a prediction.

        Parameters
        ----------
        picture : Picture
            Any picture; those of predictions are named ``prediction-`` and the number of the FRF.
        prediction : Prediction
            What is predicted now.

        Returns
        -------
        Picture
            With the curve, where there was another one.
        """
        label = next((label for k, label in enumerate(prediction.labels) if picture.name == f"prediction-{k}"), None)
        if label is None or label not in self.curves:
            return picture
        values, now = self.curves[label], prediction.values[:, prediction.labels.index(label)]
        if np.array_equal(self.frequency_hz, prediction.frequency_hz) and np.array_equal(values, now):
            return picture
        curves = magnitude_and_phase(
            NAME, Role.MUTED, self.frequency_hz, values, magnitude_hover(label), dash="dot", width=2.0
        )
        for panel, curve in enumerate(curves):
            picture = with_layers(picture, curve, panel=panel)
        return picture
