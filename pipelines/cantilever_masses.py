"""Six pieces on a cantilever, in 70 layouts and two states: what changed between the states, found by frf_ipz.compare.

Run from the checkout: ``python pipelines/cantilever_masses.py ../shared/recordings/cantilever_masses OUT_FOLDER``; a
number behind it takes every so many layouts only.

Every other layout of the healthy state calibrates one model for all (length in the clamp, Young's modulus, mass of a
piece and of the sensor, over that of the beam) and teaches how far tests are apart. The other healthy layouts were
never seen: each that is called changed is a false alarm. Then every layout of the second state is compared, and all
together. The scale is not known, and the phases and sizes of the resonances are those of an accelerance times
1 + i f / 40 Hz, as if the force had passed a lowpass: that is taken out.
"""

from __future__ import annotations

import sys
import tempfile
import zipfile
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as ET

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib import pyplot as plt
from scipy import stats
from scipy.optimize import least_squares

import frf_ipz
from frf_ipz.diagnosis.catalogue.effect import Location
from frf_ipz.diagnosis.catalogue.finder import shipped_effects
from frf_ipz.diagnosis.compare.compare import judge
from frf_ipz.diagnosis.compare.learnt_nuisance import learn, pose_state_problem
from frf_ipz.diagnosis.compare.mass_loss import MassLoss
from frf_ipz.diagnosis.evidence.hypothesis import Component
from frf_ipz.diagnosis.measured.data_split import split_data
from frf_ipz.diagnosis.observations import Observations
from frf_ipz.diagnosis.search.component_search import fit_null_model
from frf_ipz.diagnosis.verdict.findings import describe_component

SHEET = "{http://schemas.openxmlformats.org/spreadsheetml/2006/main}"
BAND_HZ = (110.0, 840.0)  # of the fifth resonance, at 1155 Hz, no uniform beam follows the healthy layouts
SUPPORT_HZ = ((244.0, 262.0), (588.0, 612.0), (764.0, 800.0))  # resonances that stay where they are in every layout
MODES_HZ = ((120.0, 155.0), (340.0, 425.0), (680.0, 764.0))
CORNER_HZ = 40.0  # from the phases of the resonances of the healthy layouts: 77, 83, 87 and 88 degrees
ELEMENTS, STRUCK_M, SENSOR_M = 80, 0.03, 0.37
FREE_LENGTH_M, WIDTH_M = 0.38, 0.04  # the width is a guess: only ratios of masses show
EFFECTS = ("added_mass", "local_stiffness", "global_stiffness", "boundary_compliance", "damping_level")
BEAM = """
[model]
kind = "beam"
name = "cantilever with six pieces"
[damping]
modal_ratio = [0.011, 0.006, 0.005, 0.0075, 0.011]
[beam]
length_m = {length}
elements = {elements}
formulation = "timoshenko"
youngs_modulus_Pa = {modulus}
density_kg_m3 = 7850.0
poisson_ratio = 0.29
width_m = {width}
thickness_m = 4.75e-3
left = "clamped"
right = "free"
"""


@dataclass(frozen=True)
class Common:
    """What is the same in all layouts: m, Pa, and masses over that of the free beam; m from a piece's edge."""

    in_clamp_m: float
    modulus_pa: float
    piece: float
    sensor: float
    to_middle_m: float


START = Common(in_clamp_m=0.01, modulus_pa=2.0e11, piece=0.03, sensor=0.03, to_middle_m=0.005)


def read_layouts(folder: Path) -> np.ndarray:
    """Positions of the six pieces from the clamp, (70, 6) array, m: the sheet says mm, the values are cm."""
    with zipfile.ZipFile(folder / "mass_positions.xlsx") as book:
        sheet = ET.fromstring(book.read("xl/worksheets/sheet1.xml"))
    cells = {cell.get("r"): cell.findtext(f"{SHEET}v") for cell in sheet.iter(f"{SHEET}c")}
    return np.array([[float(cells[f"{column}{row}"]) for column in "BCDEFG"] for row in range(3, 73)]) / 100


def read_frf(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies in the band, and the accelerance, (n_lines,) arrays."""
    frequency, decibel, degrees = np.loadtxt(path, skiprows=1).T
    inside = (frequency >= BAND_HZ[0]) & (frequency <= BAND_HZ[1])
    values = 10 ** (decibel / 20) * np.exp(1j * np.deg2rad(degrees)) / (1 + 1j * frequency / CORNER_HZ)
    return frequency[inside], values[inside]


def build(common: Common, layout: np.ndarray, *, exact: bool = False) -> tuple[frf_ipz.MachineState, dict]:
    """Model of a layout, and the nodes of its pieces, of the impact and of the sensor.

    With `exact` each mass is shared by the two nodes beside it, so that frequencies follow its position smoothly.
    """
    length = FREE_LENGTH_M + common.in_clamp_m
    beam_kg = 7850.0 * WIDTH_M * 4.75e-3 * FREE_LENGTH_M
    positions = [(x + common.to_middle_m + common.in_clamp_m) / length * ELEMENTS for x in layout]
    sensor = (SENSOR_M + common.in_clamp_m) / length * ELEMENTS
    text = BEAM.format(length=length, elements=ELEMENTS, modulus=common.modulus_pa, width=WIDTH_M)
    for position, part in (*((position, common.piece) for position in positions), (sensor, common.sensor)):
        left = min(int(position), ELEMENTS - 1) if exact else round(position)
        for node, share in ((left, 1 - (position - left)), (left + 1, position - left)) if exact else ((left, 1.0),):
            text += f"[[beam.point_mass]]\nnode = {node + 1}\nmass_kg = {max(share, 0) * part * beam_kg}\n"
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch) / "model.toml"
        path.write_text(text, encoding="utf-8")
        model = frf_ipz.read_model(path)
    struck = (STRUCK_M + common.in_clamp_m) / length * ELEMENTS
    nodes = {
        "pieces": [1 + round(position) for position in positions],
        "struck": 1 + round(struck),
        "sensor": 1 + round(sensor),
    }
    return model, nodes


def peaks(path: Path) -> np.ndarray:
    """Resonances 2 to 4, Hz."""
    frequency, values = read_frf(path)
    found = []
    for low, high in MODES_HZ:
        inside = np.flatnonzero((frequency > low) & (frequency < high))
        top = inside[np.argmax(np.abs(values[inside]))]
        left, mid, right = np.log(np.abs(values[top - 1 : top + 2]))
        found.append(frequency[top] + (left - right) / (left - 2 * mid + right) / 2 * (frequency[1] - frequency[0]))
    return np.array(found)


def calibrate(folder: Path, layouts: np.ndarray, chosen: list[int]) -> Common:
    """Fit what all layouts share to the resonances of some, all in the healthy state."""
    measured = np.array([peaks(folder / "Beam_healthy" / f"P-{number + 1}.txt") for number in chosen])
    start = np.array(list(vars(START).values()))
    spread = np.array([1.0, 0.2, 0.5, 1.0, 0.5])  # standard deviations of the logarithms of what one would guess

    def misfit(scaled: np.ndarray) -> np.ndarray:
        common = Common(*(start * np.exp(scaled * spread)))
        modes = [frf_ipz.solve_modes(build(common, layouts[number], exact=True)[0], n_modes=4) for number in chosen]
        model = np.array([one.natural_frequency_hz[1:4] for one in modes])
        error = np.log(model / measured)  # what all layouts share is learned later: how they differ counts here
        return np.concatenate([((error - error.mean(0)) / 0.005).ravel(), error.mean(0) / 0.03, scaled])

    fit = least_squares(misfit, np.full(5, 0.1), loss="soft_l1", diff_step=0.2, xtol=1e-3, ftol=1e-3)
    return Common(*(start * np.exp(fit.x * spread)))


def state_of(path: Path, model: frf_ipz.MachineState, nodes: dict) -> frf_ipz.MachineState:
    frequency, values = read_frf(path)
    out, struck = (frf_ipz.parse_dof(f"{nodes[name]}:+z") for name in ("sensor", "struck"))
    label = frf_ipz.FrfLabel(out, struck, frf_ipz.FrfQuantity.ACCELERANCE, "accelerometer", "hammer")
    unknown = np.full((len(frequency), 1), np.nan)
    frfs = frf_ipz.FrfSet(
        frequency_hz=frequency, values=values[:, None], labels=(label,), variance=unknown, coherence=unknown,
        averages=np.zeros(1, int), unknown_scale="common",
    )  # fmt: skip
    return frf_ipz.MachineState(
        model=model, observed=Observations(kind="frf", records=(), band_hz=BAND_HZ, frfs=frfs, exclude_hz=SUPPORT_HZ)
    )


def compare_all(folder: Path, step: int) -> tuple[pd.DataFrame, pd.DataFrame, Common]:
    """Calibrate, learn, and judge every layout that was not used for it."""
    layouts = read_layouts(folder)
    every = range(len(layouts))
    common = calibrate(folder, layouts, list(every)[::2])
    options = frf_ipz.CompareOptions(effects=EFFECTS)
    models = [build(common, layout) for layout in layouts]
    healthy = [state_of(folder / "Beam_healthy" / f"P-{one + 1}.txt", *models[one]) for one in every]
    second = [state_of(folder / "Beam_damage_2.96" / f"P-{one + 1}-1.txt", *models[one]) for one in every]
    taught = healthy[:: 2 * step]
    learned = learn(taught, options)
    print(f"learned from {len(taught)} healthy layouts: {learned.scatter}")
    rows, together = [], []
    for name, states, chosen in (
        ("healthy", healthy, list(every)[1 :: 2 * step]),
        ("second", second, list(every)[1::step]),
    ):
        for one in chosen:
            found = judge(learned, states[one], options)
            first = found.changes[0] if found.changes else None
            print(name, one + 1, found.diagnosis.verdict, found.statement, flush=True)
            rows.append(
                {
                    "state": name,
                    "layout": one + 1,
                    "seen": name == "second" and one % 2 == 0,
                    "changed": found.is_changed,
                    "verdict": found.diagnosis.verdict,
                    "what": first.statement if first else "",
                    "misfit": found.diagnosis.numbers["null_misfit"],
                    "nuisance_chi2": found.diagnosis.numbers["null_nuisance_chi2"],
                }
            )
            together += [{"state": name, "layout": one + 1, **row} for row in weigh(found, models[one][1]["pieces"])]
    return pd.DataFrame(rows), pd.DataFrame(together), common


def weigh(found: frf_ipz.Comparison, pieces: list[int]) -> list[dict]:
    """Weigh the same hypotheses in every layout: a piece that lost mass, a softer clamp, a softer or damped beam."""
    problem = pose_state_problem(found.expected, split_data(found.expected.observed), found.scatter)
    null, known, rows = fit_null_model(problem), shipped_effects(), []
    components = {
        f"piece {number} lost mass": Component(
            effect=MassLoss(), location=Location(key=(node, "z"), entries={"nodes": [node]}), n_locations=len(pieces)
        )
        for number, node in enumerate(pieces, start=1)
    }
    for name in ("global_stiffness", "boundary_compliance", "damping_level"):
        for location in known[name].locations(problem.context):
            what = " ".join([name, *map(str, location.key)])
            components[what] = Component(effect=known[name], location=location, n_locations=len(pieces))
    for name, component in components.items():
        hypothesis = problem.make_hypothesis((component,))
        starts = component.effect.start_values(problem.context, component.location)
        fits = [problem.fit_from_base(hypothesis, start, null) for start in starts[:: max(1, len(starts) // 4)]]
        best = max(fits, key=lambda fit: fit.log_evidence)
        estimate = next(iter(describe_component(best, 0, 1.0, 0.0, 1.0, location_set=()).parameters.values()))
        rows.append(
            {
                "hypothesis": name,
                "nats": best.log_evidence - null.log_evidence,
                "value": estimate.value,
                "low": estimate.low,
                "high": estimate.high,
                "total_kg": problem.context.mass_kg,
            }
        )
    return rows


def main(folder: Path, out: Path, step: int) -> None:
    """Print the tables and draw the picture."""
    table, together, common = compare_all(folder, step)
    out.mkdir(parents=True, exist_ok=True)
    table.to_csv(out / "layouts.csv", index=False)
    together.to_csv(out / "hypotheses.csv", index=False)
    print(common)
    for (state, seen), rows in table.groupby(["state", "seen"]):
        count, n = int(rows.changed.sum()), len(rows)
        low, high = stats.beta.interval(0.95, np.array([count, count + 1]), np.array([n + 1 - count, n - count]))
        part = f"{np.nan_to_num(low[0]):.0%} to {np.nan_to_num(high[1], nan=1.0):.0%}"
        print(f"{state}{', calibrated on' if seen else ''}: {count} of {n} changed ({part})")
    summed = together.pivot_table(index="hypothesis", columns="state", values="nats", aggfunc="sum")
    print("evidence of the same change in all layouts, nats\n", summed.sort_values("second").to_string())
    best = together[(together.state == "second") & (together.hypothesis == summed.second.idxmax())]
    part = 100 * np.array([best.low, best.value, best.high]) / best.total_kg.to_numpy()
    weight = 1 / np.maximum(np.log(part[2] / part[0]) / 3.92, 0.05) ** 2
    mean, std = np.exp(weight @ np.log(part[1]) / weight.sum()), 1 / np.sqrt(weight.sum())
    print(f"{summed.second.idxmax()}: {mean:.2f} % of all mass (+- {mean * std:.2f} %)")
    draw(table, summed, out / "cantilever_masses.png")


def draw(table: pd.DataFrame, summed: pd.DataFrame, path: Path) -> None:
    """Draw how far each layout is from what was learned, and what explains the second state."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(13, 4))
    for state, rows in table.groupby("state"):
        left.plot(rows.layout, rows.nuisance_chi2, "o", label=f"{state} state")
    left.set_xlabel("layout")
    left.set_ylabel("squared deviations from what was learned")
    left.set_yscale("log")
    left.legend()
    summed.sort_values("second").plot.barh(ax=right)
    right.set_xlabel("evidence of the same change in all layouts, nats")
    right.set_ylabel("")
    figure.tight_layout()
    figure.savefig(path, dpi=70)


if __name__ == "__main__":
    mpl.use("Agg")
    main(Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]) if len(sys.argv) > 3 else 1)
