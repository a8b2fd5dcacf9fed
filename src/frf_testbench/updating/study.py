"""Update random beams, frames and plates, and judge the FRFs predicted at points that nobody measured.

``frf-testbench updating [FIRST_SEED] [COUNT]``; 200 structures take some ten minutes. The defaults of `minimal-change`
were tuned on seeds below 1000; what is reported starts at 1000. Beside it stand the nominal model, the measured
poles with nominal shapes (the trivial answer), and `ipz`: stopped after `IPZ_ITERATIONS`, and where it
diverges at its smallest misfit.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from time import process_time

import numpy as np
import pandas as pd

from frf_ipz.errors import FrfIpzError
from frf_ipz.fe.reduction.options import ReduceOptions
from frf_ipz.fe.reduction.reduce import reduce_to_dofs
from frf_ipz.fe.response import compute_frfs
from frf_ipz.frf import FrfLabel
from frf_ipz.identification.modal_fit import ModalFit
from frf_ipz.pairing.pair import pair_roots
from frf_ipz.pairing.pairs import Pairs
from frf_ipz.prediction.agreement import compare_frfs, shift_to_measured_poles
from frf_ipz.prediction.predict import predict_frfs
from frf_ipz.structure import ReducedModel
from frf_ipz.updating.options import UpdateOptions
from frf_ipz.updating.parameters import make_structural_basis
from frf_ipz.updating.update import update_model
from frf_ipz.updating.updated_model import UpdatedModel, UpdateStatus
from frf_testbench.updating.random_structures import RandomStructure, draw_structure
from frf_testbench.updating.synthetic_fit import TrueModes, choose_band, list_labels, simulate_fit

FIRST_SEED, COUNT = 1000, 200
NOISE = 0.002  # standard deviation of a line over the root mean square of its FRF
LINES = 400
IPZ_ITERATIONS = 3000  # of the published iteration: it creeps
METHODS = ("nominal", "trivial", "ipz", "minimal-change")


@dataclass(frozen=True, kw_only=True)
class UpdateCase:
    """One structure with its measurement, reduced and paired: what an update starts from."""

    structure: RandomStructure
    true_modes: TrueModes
    labels: tuple[FrfLabel, ...]
    fit: ModalFit
    reduced_model: ReducedModel
    pairs: Pairs


def print_study(first: int, count: int) -> None:
    """Study structures and print the tables.

    Parameters
    ----------
    first : int
        First seed.
    count : int
        Structures.
    """
    frames = []
    for seed in range(first, first + count):
        frames.append(study_structure(seed))
        if (seed - first + 1) % 20 == 0:
            print(f"{seed - first + 1} of {count} structures", file=sys.stderr, flush=True)
    points = pd.concat(frames, ignore_index=True)
    with pd.option_context("display.width", 200, "display.max_columns", 20, "display.float_format", "{:.3g}".format):
        print(summarise_points(points).to_string())
        worse = points[points["minimal-change"] > points["nominal"]]
        print("worse than nominal:\n", worse[["seed", "kind", "frfs", *METHODS]].to_string(index=False))
        print(summarise_updates(points).to_string())


def study_structure(seed: int, *, with_ipz: bool = True) -> pd.DataFrame:
    """Judge one structure: one row a point of interest."""
    case = make_update_case(seed)
    basis = make_structural_basis(case.structure.nominal_model, case.reduced_model)
    start = process_time()
    updated = update_model(case.fit, case.reduced_model, pairs=case.pairs, options=UpdateOptions(), basis=basis)
    cpu_s = process_time() - start
    ipz_update = update_by_ipz(case) if with_ipz else None
    models = {
        "nominal": case.reduced_model,
        "trivial": shift_to_measured_poles(case.pairs, case.reduced_model),
        "ipz": None if ipz_update is None else ipz_update.model,
        "minimal-change": updated.model,
    }
    common_columns = {
        "seed": seed,
        "kind": case.structure.nominal_model.name,
        "frfs": len(case.labels),
        "order": len(case.reduced_model.dofs),
        "converged": updated.status is UpdateStatus.CONVERGED,
        "iterations": len(updated.history),
        "unmet": len(updated.unmet),
        "cpu_s": cpu_s,
        "ipz_status": "failed" if ipz_update is None else ipz_update.status.name,
    }
    return pd.DataFrame([common_columns | row for row in judge_points(case, updated, models)])


def make_update_case(seed: int) -> UpdateCase:
    """Draw a structure, measure it as a fitter would report it, reduce its model and pair."""
    structure = draw_structure(seed)
    true_modes = TrueModes(structure.true_model, structure.damping)
    labels = list_labels(structure.input_dofs, structure.sensors)
    band = choose_band(true_modes, structure.n_modes)
    fit = simulate_fit(true_modes, labels, band, noise=NOISE, rng=np.random.default_rng(seed + 7))
    reduced_model = reduce_to_dofs(
        structure.nominal_model,
        options=ReduceOptions(),
        actuators=structure.input_dofs,
        sensors=structure.sensors,
        points=structure.points,
        band_hz=band,
    )
    return UpdateCase(
        structure=structure,
        true_modes=true_modes,
        labels=labels,
        fit=fit,
        reduced_model=reduced_model,
        pairs=pair_roots(fit, reduced_model),
    )


def update_by_ipz(case: UpdateCase) -> UpdatedModel | None:
    """Update as published; None where the method cannot begin."""
    try:
        return update_model(
            case.fit,
            case.reduced_model,
            pairs=case.pairs,
            options=UpdateOptions(method="ipz", max_iterations=IPZ_ITERATIONS),
        )
    except FrfIpzError:
        return None


def judge_points(
    case: UpdateCase, updated: UpdatedModel, models: dict[str, ReducedModel | None]
) -> list[dict[str, float]]:
    """Compare the FRFs from the first input to every point of interest with the truth."""
    lines = np.linspace(*case.fit.band_hz, LINES)
    predicted = predict_frfs(case.fit, updated, points=case.structure.points, frequency_hz=lines)
    rows = []
    for number, label in enumerate(predicted.labels):
        if label.input_dof != case.structure.input_dofs[0]:
            continue
        s = np.asarray(2j * np.pi * lines, np.complex128)
        truth = case.true_modes.receptance(s, label)[:, None]
        row = {
            name: np.nan if model is None else float(compare_frfs(truth, compute_frfs(model, [label], s)).median_db[0])
            for name, model in models.items()
        }
        low, high = predicted.magnitude_low[:, number], predicted.magnitude_high[:, number]
        magnitude = np.abs(truth[:, 0])
        row["covered"] = float(np.mean((magnitude >= low) & (magnitude <= high)))
        row["band_db"] = float(np.median(20 * np.log10(high / low)))
        rows.append(row)
    return rows


def summarise_points(points: pd.DataFrame) -> pd.DataFrame:
    """Take medians over the points of interest, of all and of each kind: errors in dB, and ratios of errors."""
    groups = {"all": points} | {f"{n} FRF": points[points.frfs == n] for n in range(1, 5)}
    groups |= {kind: points[points.kind == kind] for kind in ("beam", "frame", "plate")}
    return pd.DataFrame({name: _summarise_group(group) for name, group in groups.items() if len(group)}).T


def _summarise_group(group: pd.DataFrame) -> dict[str, float]:
    medians = {name: group[name].median() for name in METHODS}
    minimal_change = medians["minimal-change"]
    return {
        "points": len(group),
        **medians,
        "below nominal": medians["nominal"] / minimal_change,
        "below trivial": medians["trivial"] / minimal_change,
        "worse than nominal %": float(100 * np.mean(group["minimal-change"] > group["nominal"])),
        "covered %": 100 * group["covered"].mean(),
        "band dB": group["band_db"].median(),
    }


def summarise_updates(points: pd.DataFrame) -> pd.Series:
    """Count how the updates went, one structure at a time."""
    updates = points.groupby("seed").first()
    medians = points.groupby("seed")[["nominal", "minimal-change"]].median()
    return pd.Series(
        {
            "structures": len(updates),
            "converged": int(updates.converged.sum()),
            "worse than nominal %": 100 * np.mean(medians["minimal-change"] > medians["nominal"]),
            "with a target unmet": int((updates.unmet > 0).sum()),
            "iterations, median": updates.iterations.median(),
            "iterations, most": updates.iterations.max(),
            "order, median": updates.order.median(),
            "CPU ms an update, median": 1e3 * updates.cpu_s.median(),
            "ipz converged": int((updates.ipz_status == "CONVERGED").sum()),
            "ipz diverged or failed": int(updates.ipz_status.isin(["DIVERGED", "failed"]).sum()),
        }
    )
