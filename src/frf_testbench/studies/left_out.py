"""Predict what was left out of real measurements, and compare.

``frf-testbench study left_out FOLDER`` leaves out each sensor of the steel beam in turn, or each struck point of the
free beam: its FRFs are kept from the fit and the update, and predicted. Errors stand in dB as predicted, and after one
factor, the median of the ratios of all that was left out: the scale of a channel is rarely known.
`pipelines/left_out.py` does the same with any test.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

import frf_ipz
from frf_ipz.identification.noise import rough_variance
from frf_ipz.progress import silent
from frf_testbench.studies.recordings import require_recordings

if TYPE_CHECKING:
    from pathlib import Path

    from frf_ipz.arrays import ComplexArray, FloatArray
    from frf_ipz.progress import Progress

NORMAL_90 = 1.645  # standard deviations on either side that hold 90 % of a normal distribution


@dataclass(frozen=True, slots=True, kw_only=True)
class BeamTest:
    """A measured beam with its model.

    Parameters
    ----------
    frfs : FrfSet
        What was measured.
    fe_model : StructuralModel
        The beam as drawn.
    band_hz : pair of float
        Where the measurement is good.
    side : str
        What is left out: ``output`` for sensors, ``input`` for struck points.
    """

    frfs: frf_ipz.FrfSet
    fe_model: frf_ipz.StructuralModel
    band_hz: tuple[float, float]
    side: str

    def dof(self, label: frf_ipz.FrfLabel) -> frf_ipz.Dof:
        """DOF of the side that is left out."""
        return frf_ipz.parse_dof(str(label.output_dof if self.side == "output" else label.input_dof))


BANDS_AND_SIDES = {"steel_beam_5x3": ((20.0, 600.0), "output"), "freefree_beam": ((50.0, 1000.0), "input")}


def read_beam(folder: Path) -> BeamTest:
    """Read one of both beams; `StudyError` where the folder does not hold one."""
    band_hz, side = BANDS_AND_SIDES[require_recordings(folder, *BANDS_AND_SIDES)]
    frfs = frf_ipz.estimate_frfs(frf_ipz.read_test(folder / "test.toml")).frfs
    return BeamTest(frfs=frfs, fe_model=frf_ipz.read_model(folder / "model.toml"), band_hz=band_hz, side=side)


def study_left_out(folder: Path, *, progress: Progress = silent) -> dict[str, pd.DataFrame]:
    """Leave out every sensor or struck point of a beam in turn.

    Parameters
    ----------
    folder : Path
        ``steel_beam_5x3`` or ``freefree_beam``.
    progress : Progress
        Receives the progress.

    Returns
    -------
    dict of str to DataFrame
        How well each was predicted, one row a node and model.

    Raises
    ------
    StudyError
        If the folder does not hold the recordings.
    """
    beam = read_beam(folder)
    nodes = sorted({beam.dof(label).node for label in beam.frfs.labels})
    tables = {}
    for number, node in enumerate(nodes):
        progress(number / len(nodes), f"predicting node {node} from the others")
        tables[node] = predict_left_out(beam, node)
    return {f"FRFs with their {beam.side} at a node, predicted from all others": pd.concat(tables, names=["node"])}


def predict_left_out(beam: BeamTest, node: int) -> pd.DataFrame:
    """Predict the FRFs of one node from all others.

    Parameters
    ----------
    beam : BeamTest
        Measurement and model.
    node : int
        A sensor or a struck point.

    Returns
    -------
    DataFrame
        One row a model: X_S, factor, dB as predicted and after that factor, share of lines in the 90 % band of the
        updated model (with their own noise) and its half width, and number of targets.
    """
    at_node = [beam.dof(label).node == node for label in beam.frfs.labels]
    left_out = beam.frfs.select_frfs(np.flatnonzero(at_node).tolist())
    left_out = left_out.select_lines(left_out.in_band(beam.band_hz))
    remaining = beam.frfs.select_frfs(np.flatnonzero(~np.array(at_node)).tolist())
    fit = frf_ipz.fit_modes(remaining, options=frf_ipz.FitOptions(band_hz=beam.band_hz))
    reduced_model = frf_ipz.reduce_model(fit, beam.fe_model, points=[beam.dof(left_out.labels[0])])
    pairs = frf_ipz.pair_roots(fit, reduced_model)
    updated = frf_ipz.update_model(fit, reduced_model, pairs=pairs, fe_model=beam.fe_model)
    shifted = frf_ipz.shift_to_measured_poles(pairs, reduced_model)
    labels, lines = left_out.labels, left_out.s
    gains = updated.nominal_scale.gains(labels)
    predicted = {
        "nominal": updated.compute_frfs(labels, lines, nominal=True),
        "measured poles, nominal shapes": frf_ipz.compute_frfs(shifted, labels, lines) * gains,
        "updated": updated.compute_frfs(labels, lines),
    }
    rows = {name: assess_agreement(left_out.values, values) for name, values in predicted.items()}
    low, high = frf_ipz.band_of_magnitudes(fit, updated, labels=labels, s=lines)
    rows["updated"] |= {
        "in the band": share_in_band(left_out, np.abs(predicted["updated"]), low, high),
        "band, +- dB": float(np.median(10 * np.log10(high / low))),
    }
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("model").assign(targets=len(pairs.targets))


def share_in_band(measured: frf_ipz.FrfSet, predicted: FloatArray, low: FloatArray, high: FloatArray) -> float:
    """Count the lines whose measured magnitude is as far from the prediction as its 90 % band and the noise allow.

    A band tells where the FRF is, not where noise takes its measurement: near antiresonances that is far more.

    Parameters
    ----------
    measured : FrfSet
        What was left out; where its variance is not known, lines tell it by what differs from one to the next.
    predicted, low, high : (n_lines, n_frfs) array
        Magnitudes.

    Returns
    -------
    float
        0 to 1.
    """
    stated = measured.variance
    variance = np.where(np.isfinite(stated), stated, rough_variance(measured.values))
    distance = np.abs(measured.values) - predicted
    width = np.where(distance < 0, predicted - low, high - predicted)
    return float(np.mean(distance**2 <= width**2 + NORMAL_90**2 * variance / 2))


def assess_agreement(measured: ComplexArray, predicted: ComplexArray) -> dict[str, float]:
    """Medians over lines and FRFs that were left out."""
    difference = 20 * np.log10(np.abs(predicted) / np.abs(measured))
    offset = float(np.median(difference))
    return {
        "X_S": float(np.median(frf_ipz.compare_frfs(measured, predicted).shape)),
        "factor": float(10 ** (-offset / 20)),
        "dB": float(np.median(np.abs(difference))),
        "dB after the factor": float(np.median(np.abs(difference - offset))),
    }
