"""Predict what was left out of real measurements, and compare.

python pipelines/real_beams.py TEST.toml MODEL.toml LOW_HZ HIGH_HZ {output,input} [NODE ...]

Every FRF with one of the nodes as its output (or input) is kept from the fit and the update, and predicted. Without
nodes each one is left out in turn. Scales of real channels are rarely known, so X_A and dB are given after one real
factor for what was left out, which is stated; X_S needs none.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
import pandas as pd

import frf_ipz
from frf_ipz.arrays import ComplexArray
from frf_ipz.updating.parameters import make_structural_basis


def main(test: Path, model: Path, band_hz: tuple[float, float], side: str, nodes: list[int]) -> None:
    frfs = frf_ipz.estimate_frfs(frf_ipz.read_test(test), options=frf_ipz.IngestOptions()).frfs
    full = frf_ipz.read_model(model)
    there = sorted({_node(label, side) for label in frfs.labels})
    if set(nodes) - set(there):
        sys.exit(f"no FRF has its {side} at node {min(set(nodes) - set(there))}; there are nodes {there}")
    for node in nodes or there:
        table = leave_out(frfs, full, band_hz, side, node)
        print(f"\n{side} at node {node} left out\n", table.to_string(float_format="{:.4g}".format))


def leave_out(frfs: frf_ipz.FrfSet, full: object, band_hz: tuple[float, float], side: str, node: int) -> pd.DataFrame:
    """Predict the FRFs of one node from all others: one row a model."""
    places = range(len(frfs.labels))
    out = [place for place in places if _node(frfs.labels[place], side) == node]
    rest = frfs.select_frfs([place for place in places if place not in out])
    fit = frf_ipz.fit_modes(rest, options=frf_ipz.FitOptions(band_hz=band_hz))
    ends = {"actuators": frfs.input_dofs, "sensors": frfs.output_dofs}
    reduced = frf_ipz.reduce_to_dofs(full, options=frf_ipz.ReduceOptions(), points=(), band_hz=fit.band_hz, **ends)
    pairs = frf_ipz.pair_roots(fit, reduced)
    updated = frf_ipz.update_model(fit, reduced, pairs=pairs, basis=make_structural_basis(full, reduced))
    left_out = frfs.select_frfs(out).select_lines(frfs.in_band(band_hz))
    models = {
        "nominal": reduced,
        "measured poles, nominal shapes": frf_ipz.shift_to_measured_poles(pairs, reduced),
        "updated": updated.model,
    }
    rows = {
        name: judge(left_out.values, frf_ipz.compute_frfs(each, left_out.labels, left_out.s))
        for name, each in models.items()
    }
    return pd.DataFrame(rows).T.assign(status=updated.status.name, targets=len(pairs.targets))


def judge(measured: ComplexArray, predicted: ComplexArray) -> dict[str, float]:
    """Medians over the FRFs that were left out."""
    factor = float(np.vdot(predicted, measured).real / np.vdot(predicted, predicted).real)
    plain, scaled = (frf_ipz.compare_frfs(measured, each * predicted) for each in (1.0, factor))
    return {
        "X_S": float(np.median(plain.shape)),
        "factor": factor,
        "X_A": float(np.median(scaled.amplitude)),
        "dB": float(np.median(scaled.median_db)),
    }


def _node(label: frf_ipz.FrfLabel, side: str) -> int:
    return label.output_dof.node if side == "output" else label.input_dof.node


def read_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("test", type=Path, help="test.toml of the measurement")
    parser.add_argument("model", type=Path, help="model.toml of its FE model")
    parser.add_argument("low_hz", type=float)
    parser.add_argument("high_hz", type=float)
    parser.add_argument("side", choices=["output", "input"], help="leave out sensors or struck points")
    parser.add_argument("nodes", type=int, nargs="*", help="each in turn where none is given")
    return parser.parse_args()


if __name__ == "__main__":
    given = read_arguments()
    main(given.test, given.model, (given.low_hz, given.high_hz), given.side, given.nodes)
