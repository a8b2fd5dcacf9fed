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
from frf_ipz.fe.reduction.reduce import reduce_model
from frf_ipz.fe.response import model_frfs
from frf_ipz.frf import FrfLabel
from frf_ipz.identification.modal_fit import ModalFit
from frf_ipz.pairing.pair import pair
from frf_ipz.pairing.pairs import Pairs
from frf_ipz.prediction.agreement import compare_frfs, with_measured_poles
from frf_ipz.prediction.predict import predict_frfs
from frf_ipz.structure import ReducedModel
from frf_ipz.updating.options import UpdateOptions
from frf_ipz.updating.parameters import structural_basis
from frf_ipz.updating.update import update_model
from frf_ipz.updating.updated_model import UpdatedModel, UpdateStatus
from frf_testbench.updating.random_structures import Case, random_case
from frf_testbench.updating.synthetic_fit import Truth, band_of, labels_of, synthetic_fit

FIRST_SEED, COUNT = 1000, 200
NOISE = 0.002  # standard deviation of a line over the root mean square of its FRF
LINES = 400
IPZ_ITERATIONS = 3000  # of the published iteration: it creeps
METHODS = ("nominal", "trivial", "ipz", "minimal-change")


@dataclass(frozen=True, kw_only=True)
class Bench:
    """One structure with its measurement, paired."""

    case: Case
    truth: Truth
    labels: tuple[FrfLabel, ...]
    fit: ModalFit
    reduced: ReducedModel
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
        frames.append(study(seed))
        if (seed - first + 1) % 20 == 0:
            print(f"{seed - first + 1} of {count} structures", file=sys.stderr, flush=True)
    points = pd.concat(frames, ignore_index=True)
    with pd.option_context("display.width", 200, "display.max_columns", 20, "display.float_format", "{:.3g}".format):
        print(summary(points).to_string())
        worse = points[points["minimal-change"] > points["nominal"]]
        print("worse than nominal:\n", worse[["seed", "kind", "frfs", *METHODS]].to_string(index=False))
        print(about_updates(points).to_string())


def study(seed: int, *, with_ipz: bool = True) -> pd.DataFrame:
    """Judge one structure: one row a point of interest."""
    bench = set_up(seed)
    basis = structural_basis(bench.case.nominal, bench.reduced)
    start = process_time()
    updated = update_model(bench.reduced, bench.fit, bench.pairs, UpdateOptions(), basis=basis)
    taken = process_time() - start
    published = by_ipz(bench) if with_ipz else None
    models = {
        "nominal": bench.reduced,
        "trivial": with_measured_poles(bench.reduced, bench.pairs),
        "ipz": None if published is None else published.model,
        "minimal-change": updated.model,
    }
    about = {
        "seed": seed,
        "kind": bench.case.nominal.name,
        "frfs": len(bench.labels),
        "order": len(bench.reduced.dofs),
        "converged": updated.status is UpdateStatus.CONVERGED,
        "iterations": len(updated.history),
        "unmet": len(updated.unmet),
        "cpu_s": taken,
        "ipz_status": "failed" if published is None else published.status.name,
    }
    return pd.DataFrame([about | row for row in judge(bench, updated, models)])


def set_up(seed: int) -> Bench:
    """Draw a structure, measure it as a fitter would report it, reduce its model and pair."""
    case = random_case(seed)
    truth, labels = Truth(case.truth, case.damping), labels_of(case)
    band = band_of(truth, case.n_modes)
    fit = synthetic_fit(truth, labels, band, noise=NOISE, rng=np.random.default_rng(seed + 7))
    ends = {"actuators": case.input_dofs, "sensors": case.sensors, "points": case.points}
    reduced = reduce_model(case.nominal, ReduceOptions(), band_hz=band, **ends)
    return Bench(case=case, truth=truth, labels=labels, fit=fit, reduced=reduced, pairs=pair(fit, reduced))


def by_ipz(bench: Bench) -> UpdatedModel | None:
    """Update as published; None where the method cannot begin."""
    try:
        return update_model(
            bench.reduced, bench.fit, bench.pairs, UpdateOptions(method="ipz", max_iterations=IPZ_ITERATIONS)
        )
    except FrfIpzError:
        return None


def judge(bench: Bench, updated: UpdatedModel, models: dict[str, ReducedModel | None]) -> list[dict[str, float]]:
    """Compare the FRFs from the first blow to every point of interest with the truth."""
    lines = np.linspace(*bench.fit.band_hz, LINES)
    predicted = predict_frfs(updated, bench.case.points, bench.labels, lines)
    rows = []
    for number, label in enumerate(predicted.labels):
        if label.input_dof != bench.case.input_dofs[0]:
            continue
        s = 2j * np.pi * lines
        truth = bench.truth.receptance(s, label)[:, None]
        row = {
            name: np.nan if model is None else float(compare_frfs(truth, model_frfs(model, [label], s)).median_db[0])
            for name, model in models.items()
        }
        low, high = predicted.magnitude_low[:, number], predicted.magnitude_high[:, number]
        magnitude = np.abs(truth[:, 0])
        row["covered"] = float(np.mean((magnitude >= low) & (magnitude <= high)))
        row["band_db"] = float(np.median(20 * np.log10(high / low)))
        rows.append(row)
    return rows


def summary(points: pd.DataFrame) -> pd.DataFrame:
    """Medians over the points of interest, of all and of each kind: errors in dB, and how many times below others."""
    groups = {"all": points} | {f"{n} FRF": points[points.frfs == n] for n in range(1, 5)}
    groups |= {kind: points[points.kind == kind] for kind in ("beam", "frame", "plate")}
    return pd.DataFrame({name: _one_group(group) for name, group in groups.items() if len(group)}).T


def _one_group(group: pd.DataFrame) -> dict[str, float]:
    medians = {name: group[name].median() for name in METHODS}
    ours = medians["minimal-change"]
    return {
        "points": len(group),
        **medians,
        "below nominal": medians["nominal"] / ours,
        "below trivial": medians["trivial"] / ours,
        "worse than nominal %": 100 * np.mean(group["minimal-change"] > group["nominal"]),
        "covered %": 100 * group["covered"].mean(),
        "band dB": group["band_db"].median(),
    }


def about_updates(points: pd.DataFrame) -> pd.Series:
    """How the updates went, one structure at a time."""
    each = points.groupby("seed").first()
    medians = points.groupby("seed")[["nominal", "minimal-change"]].median()
    return pd.Series(
        {
            "structures": len(each),
            "converged": int(each.converged.sum()),
            "worse than nominal %": 100 * np.mean(medians["minimal-change"] > medians["nominal"]),
            "with a target unmet": int((each.unmet > 0).sum()),
            "iterations, median": each.iterations.median(),
            "iterations, most": each.iterations.max(),
            "order, median": each.order.median(),
            "CPU ms an update, median": 1e3 * each.cpu_s.median(),
            "ipz converged": int((each.ipz_status == "CONVERGED").sum()),
            "ipz diverged or failed": int(each.ipz_status.isin(["DIVERGED", "failed"]).sum()),
        }
    )
