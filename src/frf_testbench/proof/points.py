"""Errors of predicted FRFs at points that were never measured, against the sealed truth."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

import frf_ipz
from frf_ipz.frf import FrfLabel

Key = tuple[int, str, int, str]
SAME_LINE = 1e-6  # relative difference of frequencies that are written with seven digits


@dataclass(frozen=True, slots=True, kw_only=True)
class PointErrors:
    """Norm of prediction minus truth over the norm of the truth, over all points and lines.

    Parameters
    ----------
    nominal, without, diagnosed : float
        By the model as it was handed in; updated without a diagnosis; with it.
    """

    nominal: float
    without: float
    diagnosed: float


def compute_point_errors(case: Path, truth: Path, predicted: Path) -> PointErrors | None:
    """Compare predictions of a case with the truth.

    Parameters
    ----------
    case : Path
        Folder of the case.
    truth : Path
        ``NAME_points.csv`` of the sealed folder.
    predicted : Path
        Folder that holds the runs ``with`` and ``without``.

    Returns
    -------
    PointErrors, or None
        None where a prediction or the truth is missing.
    """
    files = [predicted / label / "poi_frf.parquet" for label in ("with", "without")]
    if not truth.is_file() or not all(file.is_file() for file in files):
        return None
    table = pd.read_csv(truth)
    diagnosed, without = (pd.read_parquet(file) for file in files)
    nominal = evaluate_nominal_model(case, diagnosed)
    return PointErrors(
        nominal=compute_frf_error(table, nominal),
        without=compute_frf_error(table, without),
        diagnosed=compute_frf_error(table, diagnosed),
    )


def evaluate_nominal_model(case: Path, prediction: pd.DataFrame) -> pd.DataFrame:
    """Evaluate the model as it was handed in, at the lines and points of a prediction.

    Parameters
    ----------
    case : Path
        Folder of the case.
    prediction : DataFrame
        ``poi_frf.parquet``.

    Returns
    -------
    DataFrame
        With the same rows.
    """
    model = frf_ipz.read_model(case / "model.toml")
    frfs = []
    for (output, source, quantity), rows in prediction.groupby(["output_dof", "input_dof", "quantity"], sort=False):
        label = FrfLabel(frf_ipz.parse_dof(str(output)), frf_ipz.parse_dof(str(source)), frf_ipz.FrfQuantity(quantity))
        H = frf_ipz.compute_frfs(model, [label], 2j * np.pi * rows["frequency_hz"].to_numpy())[:, 0]
        frfs.append(rows.assign(real=H.real, imag=H.imag))
    return pd.concat(frfs)


def compute_frf_error(truth: pd.DataFrame, predicted: pd.DataFrame) -> float:
    """Compute the norm of the difference over the norm of the truth, on the lines that both have.

    Parameters
    ----------
    truth, predicted : DataFrame
        With ``frequency_hz, output_dof, input_dof, real, imag``; labels may differ in their signs.

    Returns
    -------
    float
        Nan where they have no line in common.
    """
    true_frfs, predicted_frfs = _group_by_path(truth), _group_by_path(predicted)
    misfit = norm = 0.0
    for key, (lines, H) in predicted_frfs.items():
        if key not in true_frfs:
            continue
        true_lines, true_H = true_frfs[key]
        nearest = np.abs(true_lines[:, None] - lines[None, :]).argmin(axis=0)
        same = np.abs(true_lines[nearest] / lines - 1) < SAME_LINE
        misfit += float(np.sum(np.abs(H[same] - true_H[nearest[same]]) ** 2))
        norm += float(np.sum(np.abs(true_H[nearest[same]]) ** 2))
    return float(np.sqrt(misfit / norm)) if norm else float("nan")


def _group_by_path(table: pd.DataFrame) -> dict[Key, tuple[NDArray[np.float64], NDArray[np.complex128]]]:
    """Group FRFs by output and input, with positive signs."""
    result = {}
    for (output, source), rows in table.groupby(["output_dof", "input_dof"], sort=False):
        (out_node, out_direction, a), (in_node, in_direction, b) = _split_label(str(output)), _split_label(str(source))
        H = a * b * (rows["real"].to_numpy() + 1j * rows["imag"].to_numpy())
        result[out_node, out_direction, in_node, in_direction] = rows["frequency_hz"].to_numpy(), H
    return result


def _split_label(label: str) -> tuple[int, str, int]:
    """Split a label into node, direction and sign."""
    node, direction = label.split(":")
    return int(node), direction.lstrip("+-"), -1 if direction.startswith("-") else 1
