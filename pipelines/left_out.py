"""Leave out every sensor, or every struck point, of a measured structure in turn; predict its FRFs, and compare.

``python pipelines/left_out.py TEST MODEL LOW HIGH [NODE ...]``: test.toml and model.toml, the band in Hz, and the nodes
to leave out (all, by default) of the side of the test that has more points. Nothing of what is left out is used. Errors
are medians over lines in dB: as predicted, and after the one factor that suits all FRFs of the node best. Beside them
stand the measured poles with nominal shapes, which any prediction has to beat, and the share of lines that lie in the
90 % band, the noise of their own allowed for: near antiresonances that is far more than the band.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.ndimage import median_filter

import frf_ipz

NORMAL_90, NEARBY = 1.645, 49  # deviations on either side that hold 90 %; lines that tell the noise together


def nodes_of(frfs: frf_ipz.FrfSet) -> tuple[str, list[int]]:
    """Name the side that has more points, and its nodes."""
    sides = {side: {getattr(label, side).node for label in frfs.labels} for side in ("output_dof", "input_dof")}
    side = max(sides, key=lambda name: len(sides[name]))
    return side, sorted(sides[side])


def differences_db(measured: np.ndarray, predicted: np.ndarray) -> tuple[float, float]:
    """Give the median differences of magnitudes: as they are, and after one factor."""
    difference = 20 * np.log10(np.abs(predicted) / np.abs(measured))
    return float(np.median(np.abs(difference))), float(np.median(np.abs(difference - np.median(difference))))


def share_in_band(measured: frf_ipz.FrfSet, predicted: np.ndarray, low: np.ndarray, high: np.ndarray) -> float:
    """Count the lines that are as far from the prediction as its 90 % band and the noise of the measurement allow."""
    third = np.abs(np.diff(measured.values, 3, axis=0, append=measured.values[-3:])) ** 2 / 20  # no response has any
    variance = median_filter(third, (NEARBY, 1)) / np.log(2)
    distance = np.abs(measured.values) - predicted
    width = np.where(distance < 0, predicted - low, high - predicted)
    return float(np.mean(distance**2 <= width**2 + NORMAL_90**2 * variance / 2))


def leave_out(
    frfs: frf_ipz.FrfSet, fe_model: frf_ipz.StructuralModel, band_hz: tuple[float, float], side: str, node: int
) -> dict[str, float]:
    """Predict the FRFs of one node from all others, and give the errors."""
    at_node = np.array([getattr(label, side).node == node for label in frfs.labels])
    kept = frfs.select_frfs(np.flatnonzero(~at_node).tolist())
    left_out = frfs.select_frfs(np.flatnonzero(at_node).tolist())
    left_out = left_out.select_lines(left_out.in_band(band_hz))
    point = getattr(left_out.labels[0], side)
    fit = frf_ipz.fit_modes(kept, options=frf_ipz.FitOptions(band_hz=band_hz))
    reduced_model = frf_ipz.reduce_model(fit, fe_model, points=[point])
    pairs = frf_ipz.pair_roots(fit, reduced_model)
    updated = frf_ipz.update_model(fit, reduced_model, pairs=pairs, fe_model=fe_model)
    predicted = updated.compute_frfs(left_out.labels, left_out.s)
    nominal = frf_ipz.compute_frfs(frf_ipz.shift_to_measured_poles(pairs, reduced_model), left_out.labels, left_out.s)
    low, high = frf_ipz.band_of_magnitudes(fit, updated, labels=left_out.labels, s=left_out.s)
    return {
        "nominal shapes, dB after a factor": differences_db(left_out.values, nominal)[1],
        **dict(zip(("dB", "dB after a factor"), differences_db(left_out.values, predicted), strict=True)),
        "in the band": share_in_band(left_out, np.abs(predicted), low, high),
        "band, +- dB": float(np.median(10 * np.log10(high / low))),
    }


def main(test: str, model: str, low_hz: str, high_hz: str, *nodes: str) -> pd.DataFrame:
    """Leave out each node, and print the table."""
    frfs, fe_model = frf_ipz.estimate_frfs(frf_ipz.read_test(Path(test))).frfs, frf_ipz.read_model(Path(model))
    side, every = nodes_of(frfs)
    band_hz = float(low_hz), float(high_hz)
    rows = {node: leave_out(frfs, fe_model, band_hz, side, node) for node in [int(name) for name in nodes] or every}
    table = pd.DataFrame(rows).T.rename_axis(side.replace("_dof", " left out"))
    print(table.round(2).to_string())
    return table


if __name__ == "__main__":
    main(*sys.argv[1:])
