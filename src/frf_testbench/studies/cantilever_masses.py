"""Six pieces on a cantilever, in 70 layouts and two states: what changed between the states.

``frf-testbench study cantilever_masses FOLDER``. Every other layout of the healthy state calibrates one model for all
(length in the clamp, Young's modulus, mass of a piece and of the sensor, over that of the beam) and teaches how far
tests are apart. The other healthy layouts were never seen: each that is called changed is a false alarm. Then layouts
of the second state are compared, and the same changes are weighed in all of them. The scale is not known, and phases
and sizes of the resonances are those of an accelerance times 1 + i f / 40 Hz, as if the force had passed a lowpass:
that is taken out.
"""

from __future__ import annotations

import zipfile
from dataclasses import astuple, dataclass
from typing import TYPE_CHECKING, NamedTuple
from xml.etree import ElementTree as ET

import numpy as np
import pandas as pd
from scipy.optimize import least_squares

import frf_ipz
from frf_ipz.diagnosis.catalogue.finder import shipped_effects
from frf_ipz.diagnosis.compare.compare import judge
from frf_ipz.diagnosis.compare.learnt_nuisance import learn, pose_state_problem
from frf_ipz.diagnosis.compare.mass_loss import MassLoss
from frf_ipz.diagnosis.evidence.hypothesis import Component
from frf_ipz.diagnosis.measured.data_split import split_data
from frf_ipz.diagnosis.search.component_search import fit_null_model
from frf_ipz.diagnosis.verdict.findings import describe_component
from frf_ipz.progress import silent
from frf_testbench.studies.recordings import require_recordings

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from frf_ipz.arrays import ComplexArray, FloatArray
    from frf_ipz.progress import Progress

SHEET = "{http://schemas.openxmlformats.org/spreadsheetml/2006/main}"
BAND_HZ = (110.0, 840.0)  # of the fifth resonance, at 1155 Hz, no uniform beam follows the healthy layouts
SUPPORT_HZ = ((244.0, 262.0), (588.0, 612.0), (764.0, 800.0))  # resonances that stay where they are in every layout
MODES_HZ = ((120.0, 155.0), (340.0, 425.0), (680.0, 764.0))
CORNER_HZ = 40.0  # from the phases of the resonances of the healthy layouts: 77, 83, 87 and 88 degrees
ELEMENTS, STRUCK_M, SENSOR_M = 80, 0.03, 0.37
FREE_LENGTH_M, WIDTH_M, THICKNESS_M = 0.38, 0.04, 4.75e-3  # the width is a guess: only ratios of masses show
DENSITY_KG_M3 = 7850.0
EFFECTS = ("added_mass", "local_stiffness", "global_stiffness", "boundary_compliance", "damping_level")
WEIGHED = ("global_stiffness", "boundary_compliance", "damping_level")  # besides the pieces, in all layouts together
EVERY = 5  # of the layouts that are compared: all of them take five times as long


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """What is the same in all layouts.

    Parameters
    ----------
    in_clamp_m, modulus_pa : float
        Length that moves within the clamp, m, and Young's modulus, Pa.
    piece, sensor : float
        Their masses over that of the free beam.
    to_middle_m : float
        From the edge of a piece, by which the sheet goes, to its middle, m.
    """

    in_clamp_m: float
    modulus_pa: float
    piece: float
    sensor: float
    to_middle_m: float


START = Setup(in_clamp_m=0.01, modulus_pa=2.0e11, piece=0.03, sensor=0.03, to_middle_m=0.005)


class Layout(NamedTuple):
    """A model, and the nodes of its pieces, of the impact and of the sensor."""

    fe_model: frf_ipz.StructuralModel
    pieces: tuple[int, ...]
    struck: int
    sensor: int


def healthy_file(folder: Path, number: int) -> Path:
    """File of a layout in the healthy state, numbers from 0."""
    return folder / "Beam_healthy" / f"P-{number + 1}.txt"


def second_file(folder: Path, number: int) -> Path:
    """File of a layout in the second state, numbers from 0."""
    return folder / "Beam_damage_2.96" / f"P-{number + 1}-1.txt"


def read_layouts(folder: Path) -> FloatArray:
    """Positions of the six pieces from the clamp, (n_layouts, 6) array, m: the sheet says mm, the values are cm."""
    with zipfile.ZipFile(folder / "mass_positions.xlsx") as book:
        sheet = ET.fromstring(book.read("xl/worksheets/sheet1.xml"))
    cells = {cell.get("r"): float(cell.findtext(f"{SHEET}v") or "nan") for cell in sheet.iter(f"{SHEET}c")}
    return np.array([[cells[f"{column}{row}"] for column in "BCDEFG"] for row in range(3, 73)]) / 100


def read_frf(path: Path) -> tuple[FloatArray, ComplexArray]:
    """Frequencies in the band, and the accelerance, (n_lines,) arrays."""
    frequency, decibel, degrees = np.loadtxt(path, skiprows=1).T
    inside = (frequency >= BAND_HZ[0]) & (frequency <= BAND_HZ[1])
    values = 10 ** (decibel / 20) * np.exp(1j * np.deg2rad(degrees)) / (1 + 1j * frequency / CORNER_HZ)
    return frequency[inside], values[inside]


def find_resonances(path: Path) -> FloatArray:
    """Resonances 2 to 4 of a file, Hz."""
    frequency, values = read_frf(path)
    resonances = []
    for low, high in MODES_HZ:
        inside = np.flatnonzero((frequency > low) & (frequency < high))
        top = inside[np.argmax(np.abs(values[inside]))]
        left, mid, right = np.log(np.abs(values[top - 1 : top + 2]))
        offset = (left - right) / (left - 2 * mid + right) / 2
        resonances.append(frequency[top] + offset * (frequency[1] - frequency[0]))
    return np.array(resonances)


def build_layout(setup: Setup, positions_m: FloatArray, *, exact: bool = False) -> Layout:
    """Build the model of a layout.

    With `exact` each mass is shared by the two nodes beside it, so that frequencies follow its position smoothly.
    """
    length = FREE_LENGTH_M + setup.in_clamp_m
    beam_kg = DENSITY_KG_M3 * WIDTH_M * THICKNESS_M * FREE_LENGTH_M
    pieces, sensor, struck = (
        (np.asarray(x) + setup.in_clamp_m) / length * ELEMENTS
        for x in (positions_m + setup.to_middle_m, SENSOR_M, STRUCK_M)
    )
    masses = []
    for position, part in [*((piece, setup.piece) for piece in pieces), (sensor, setup.sensor)]:
        left = min(int(position), ELEMENTS - 1) if exact else round(float(position))
        shares = {left: 1 - (position - left), left + 1: position - left} if exact else {left: 1.0}
        masses += [
            frf_ipz.BeamPointMass(node=node + 1, mass_kg=float(max(share, 0.0) * part * beam_kg))
            for node, share in shares.items()
        ]
    fe_model = frf_ipz.make_beam(
        length_m=length,
        elements=ELEMENTS,
        youngs_modulus_Pa=setup.modulus_pa,
        density_kg_m3=DENSITY_KG_M3,
        poisson_ratio=0.29,
        width_m=WIDTH_M,
        thickness_m=THICKNESS_M,
        left="clamped",
        point_mass=masses,
        modal_ratio=[0.011, 0.006, 0.005, 0.0075, 0.011],
        name="cantilever with six pieces",
    )
    nodes = tuple(1 + round(float(piece)) for piece in pieces)
    return Layout(fe_model, nodes, 1 + round(float(struck)), 1 + round(float(sensor)))


def calibrate(layouts: Sequence[FloatArray], resonances_hz: Sequence[FloatArray]) -> Setup:
    """Fit what all layouts share to resonances 2 to 4 of some layouts in the healthy state."""
    start = np.array(astuple(START))
    spread = np.array([1.0, 0.2, 0.5, 1.0, 0.5])  # standard deviations of the logarithms of what one would guess

    def to_setup(scaled: FloatArray) -> Setup:
        return Setup(**dict(zip(Setup.__slots__, (start * np.exp(scaled * spread)).tolist(), strict=True)))

    def misfit(scaled: FloatArray) -> FloatArray:
        models = [build_layout(to_setup(scaled), layout, exact=True).fe_model for layout in layouts]
        hertz = np.array([frf_ipz.solve_modes(model, n_modes=4).natural_frequency_hz[1:4] for model in models])
        error = np.log(hertz / np.array(resonances_hz))  # how layouts differ counts: what all share is learnt later
        return np.concatenate([((error - error.mean(0)) / 0.005).ravel(), error.mean(0) / 0.03, scaled])

    fit = least_squares(misfit, np.full(5, 0.1), loss="soft_l1", diff_step=np.full(5, 0.2), xtol=1e-3, ftol=1e-3)
    return to_setup(fit.x)


def read_state(path: Path, layout: Layout) -> frf_ipz.MachineState:
    """Read what was measured in a layout."""
    frequency, values = read_frf(path)
    frfs = frf_ipz.FrfSet.from_arrays(
        frequency,
        values[:, None, None],
        outputs=[f"{layout.sensor}:+z"],
        inputs=[f"{layout.struck}:+z"],
        unknown_scale="common",
    )
    observed = frf_ipz.Observations(kind="frf", records=(), band_hz=BAND_HZ, frfs=frfs, exclude_hz=SUPPORT_HZ)
    return frf_ipz.MachineState(fe_model=layout.fe_model, observed=observed)


def study_cantilever_masses(folder: Path, *, progress: Progress = silent) -> dict[str, pd.DataFrame]:
    """Calibrate, learn, and judge layouts that were not used for it.

    Parameters
    ----------
    folder : Path
        Holds the layouts and both states.
    progress : Progress
        Receives the progress.

    Returns
    -------
    dict of str to DataFrame
        The calibrated setup, what was said of each layout, and the evidence of changes in all layouts.

    Raises
    ------
    StudyError
        If the folder does not hold the recordings.
    """
    require_recordings(folder, "cantilever_masses")
    positions, numbers = read_layouts(folder), range(70)
    progress(0.0, "calibrating")
    taught = numbers[::2]
    setup = calibrate(
        [positions[number] for number in taught], [find_resonances(healthy_file(folder, number)) for number in taught]
    )
    layouts = [build_layout(setup, layout) for layout in positions]
    before = [read_state(healthy_file(folder, number), layouts[number]) for number in taught[::EVERY]]
    after = {
        (name, number + 1): (read_state(file(folder, number), layouts[number]), layouts[number])
        for name, file in (("healthy", healthy_file), ("second", second_file))
        for number in numbers[1 :: 2 * EVERY]
    }
    return {"the setup": pd.DataFrame([setup])} | compare_layouts(before, after, progress=progress)


def compare_layouts(
    before: Sequence[frf_ipz.MachineState],
    after: dict[tuple[str, int], tuple[frf_ipz.MachineState, Layout]],
    *,
    progress: Progress = silent,
) -> dict[str, pd.DataFrame]:
    """Judge layouts, named by state and number, by healthy ones; and weigh the same changes in all of them."""
    options = frf_ipz.CompareOptions(effects=EFFECTS)
    progress(0.1, f"learning from {len(before)} healthy layouts")
    learnt = learn(before, options)
    rows: list[dict[str, object]] = []
    weights: list[dict[str, object]] = []
    for (name, number), (state, layout) in after.items():
        progress(0.2 + 0.8 * len(rows) / len(after), f"{name} state, layout {number}")
        comparison = judge(learnt, state, options)
        first = comparison.changes[0].statement if comparison.changes else ""
        rows.append({"state": name, "layout": number, "verdict": comparison.diagnosis.verdict, "change": first})
        weights += [{"state": name, **row} for row in weigh_changes(comparison, layout.pieces)]
    table = pd.DataFrame(weights)
    summed = table.pivot_table(index="hypothesis", columns="state", values="log Bayes factor", aggfunc="sum")
    values = table.pivot_table(index="hypothesis", columns="state", values="value", aggfunc="median")
    return {
        "each layout": pd.DataFrame(rows),
        "the same change in all layouts": summed.join(values.add_prefix("median value, ")).sort_values("second"),
    }


def weigh_changes(comparison: frf_ipz.Comparison, pieces: Sequence[int]) -> list[dict[str, object]]:
    """Weigh a piece that lost mass (in % of all mass), a softer clamp, and a softer or more damped beam."""
    problem = pose_state_problem(comparison.expected, split_data(comparison.expected.observed), comparison.scatter)
    null, mass_loss, shipped = fit_null_model(problem), MassLoss(), shipped_effects()
    changes: dict[str, tuple[frf_ipz.Effect, frf_ipz.Location]] = {
        f"piece {number} lost mass": (mass_loss, frf_ipz.Location.at_node(node, "z"))
        for number, node in enumerate(pieces, start=1)
    }
    changes |= {
        " ".join([name, location.text, *location.directions]): (shipped[name], location)
        for name in WEIGHED
        for location in shipped[name].locations(problem.context)
    }
    rows: list[dict[str, object]] = []
    for name, (effect, location) in changes.items():
        hypothesis = problem.make_hypothesis((Component(effect=effect, location=location, n_locations=len(pieces)),))
        starts = effect.start_values(problem.context, location)
        fits = [problem.fit_from_base(hypothesis, start, null) for start in starts[:: max(1, len(starts) // 4)]]
        best = max(fits, key=lambda fit: fit.log_evidence)
        estimate = next(iter(describe_component(best, 0, 1.0, 0.0, 1.0, location_set=()).parameters.values()))
        value = np.nan if isinstance(estimate, str) else estimate.value
        if effect is mass_loss:
            value *= 100 / problem.context.mass_kg
        rows.append({"hypothesis": name, "log Bayes factor": best.log_evidence - null.log_evidence, "value": value})
    return rows
