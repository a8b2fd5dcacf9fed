"""What real beams have that their models lack, in order of weight; and whether that helps where nothing was measured.

``frf-testbench study beam_physics FOLDER``. One cause after the other is added, the most probable one each time, until
the next one brings too little or nothing is left to explain. What `TESTS` states is not searched for: how wrong
section, material and damping may be, and how far resonances drift from file to file, as a variance of the FRFs.

What to expect of the steel beam, in some four minutes: its channels are late together by 0.96 ms. Then small
resonators, one after the other, where the measured resonances come in pairs (93 and 106, 173 and 184, 437 and 451 Hz)
of which the plain beam has one each: its model lacks the bent legs and the wires that it hangs in, and the catalogue
has no word for them but resonator. All resonances stay some 20 % lower than the model's and its tolerances say:
unexplained. With these causes in the model, the sensor that is left out is predicted better than with the plain one.

What to expect of the free beam: its model, within these tolerances, lies on the measured FRFs; what is left beside the
drift is largest below 100 Hz, where the beam moves in its suspension, and no cause that is added is worth believing.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

import frf_ipz
from frf_ipz.diagnosis.catalogue.finder import shipped_effects
from frf_ipz.diagnosis.evidence.inference_problem import pose_problem
from frf_ipz.diagnosis.measured.data_split import split_data
from frf_ipz.diagnosis.model.change import with_change
from frf_ipz.diagnosis.search.component_search import fit_null_model, search_component
from frf_ipz.diagnosis.verdict.findings import describe_component
from frf_ipz.diagnosis.verdict.goodness import assess_goodness, required_log_bayes_factor
from frf_ipz.progress import silent
from frf_testbench.studies.left_out import BeamTest, predict_left_out, read_beam

if TYPE_CHECKING:
    from pathlib import Path

    from frf_ipz.diagnosis.evidence.fit import Fit
    from frf_ipz.diagnosis.evidence.inference_problem import InferenceProblem
    from frf_ipz.progress import Progress

MOST_CAUSES = 6
SUBBANDS = 5
NOISE = 0.003  # of an FRF, beside the drift of its resonances


@dataclass(frozen=True, slots=True, kw_only=True)
class Knowledge:
    """What is known of a test.

    Parameters
    ----------
    tolerances : DiagnoseOptions
        How wrong its model may be.
    drift : float
        How far resonances drift from file to file, relative; 0 where the FRFs say how certain they are.
    left_out : int
        Node of a sensor that is predicted; 0 for none.
    """

    tolerances: frf_ipz.DiagnoseOptions
    drift: float = 0.0
    left_out: int = 0


TESTS = {
    "steel_beam_5x3": Knowledge(
        tolerances=frf_ipz.DiagnoseOptions(stiffness_tolerance=0.02, frequency_tolerance=0.01, damping_tolerance=0.9),
        left_out=70,
    ),
    "freefree_beam": Knowledge(
        tolerances=frf_ipz.DiagnoseOptions(
            stiffness_tolerance=0.01, frequency_tolerance=0.005, damping_tolerance=0.9, gain_tolerance=0.05
        ),
        drift=1e-4,
    ),
}


def study_beam_physics(folder: Path, *, progress: Progress = silent) -> dict[str, pd.DataFrame]:
    """Add causes to the model of a beam, and predict a sensor that was left out with each of them.

    Parameters
    ----------
    folder : Path
        ``steel_beam_5x3`` or ``freefree_beam``.
    progress : Progress
        Receives the progress.

    Returns
    -------
    dict of str to DataFrame
        The causes; where the first and the last model are wrong; and how well the sensor is predicted.

    Raises
    ------
    StudyError
        If the folder does not hold the recordings.
    """
    beam = read_beam(folder)
    return explain_beam(beam, TESTS[folder.resolve().name], progress=progress)


def explain_beam(beam: BeamTest, known: Knowledge, *, progress: Progress = silent) -> dict[str, pd.DataFrame]:
    """Do so for a measured beam of which something is known."""
    frfs = beam.frfs.select_lines(beam.frfs.in_band(beam.band_hz))
    if known.drift:
        slope = np.abs(np.gradient(frfs.values, frfs.frequency_hz, axis=0))
        drift = known.drift * frfs.frequency_hz[:, None] * slope
        frfs = replace(frfs, variance=drift**2 + (NOISE * np.abs(frfs.values)) ** 2)
    nodes = [frf_ipz.parse_dof(str(label.output_dof)).node for label in frfs.labels]
    others = [index for index, node in enumerate(nodes) if node != known.left_out]
    problem = pose_beam_problem(replace(beam, frfs=frfs.select_frfs(others)), known)
    fits = add_causes(problem, progress)
    tables = {
        "causes, the most probable one first": list_causes(problem, fits),
        "misfit over noise of the model": locate_misfit(problem, fits[0]),
        "misfit over noise with all causes": locate_misfit(problem, fits[-1]),
    }
    if known.left_out:  # one cause more each time: what helps the fit need not help here
        agreements = {}
        for number, fit in enumerate(fits):
            progress(0.5 + 0.5 * number / len(fits), f"predicting node {known.left_out} with {number} causes")
            fe_model = with_change(beam.fe_model, fit.hypothesis.change(fit.values))
            agreements[number] = predict_left_out(replace(beam, frfs=frfs, fe_model=fe_model), known.left_out)
        title = f"sensor at node {known.left_out}, predicted from all others with the first causes in the model"
        tables[title] = pd.concat(agreements, names=["causes"])
    return tables


def pose_beam_problem(beam: BeamTest, known: Knowledge) -> InferenceProblem:
    """Pose the search for causes; where scales are unknown, gains are no cause."""
    scale = beam.frfs.unknown_scale
    effects = {name: effect for name, effect in shipped_effects().items() if scale == "none" or name != "sensor_gain"}
    observations = frf_ipz.Observations(kind="frf", records=(), band_hz=beam.band_hz, frfs=beam.frfs)
    source = split_data(observations)
    return pose_problem(beam.fe_model, source, beam.band_hz, known.tolerances, effects, free_gains=scale)


def add_causes(problem: InferenceProblem, progress: Progress) -> list[Fit]:
    """Return the fits with nothing, one cause, two causes and so on, the most probable one more each time."""
    fits = [fit_null_model(problem)]
    for number in range(MOST_CAUSES):
        progress(0.5 * number / MOST_CAUSES, f"searching for cause {number + 1}")
        best = search_component(problem, fits[-1]).best
        required = required_log_bayes_factor(problem, assess_goodness(problem, fits[-1]))
        if best.log_evidence - fits[-1].log_evidence < required:
            break
        fits.append(best)
        if assess_goodness(problem, best).is_good:
            break
    return fits


def list_causes(problem: InferenceProblem, fits: list[Fit]) -> pd.DataFrame:
    """Say what each cause is, what it brings and what it leaves: misfits over the expected one."""
    rows = []
    for number, fit in enumerate(fits):
        goodness = assess_goodness(problem, fit)
        row = {
            "misfit": np.sqrt(goodness.misfit),
            "worst subband": np.sqrt(goodness.worst_subband),
            "nuisance chi2": goodness.nuisance_chi2,
            "log Bayes factor": fit.log_evidence - fits[max(number - 1, 0)].log_evidence,
            "left": "" if goodness.is_good else goodness.shortfall,
            "cause": "the model, within its tolerances",
        }
        if number:
            scale = max(1.0, goodness.misfit)
            row["cause"] = describe_component(fit, number - 1, 1.0, 0.0, scale, location_set=()).statement
        rows.append(row)
    return pd.DataFrame(rows)


def locate_misfit(problem: InferenceProblem, fit: Fit) -> pd.DataFrame:
    """Gain of each FRF, and its misfit over noise and drift in subbands: what defends a verdict."""
    layout, nuisance_values = problem.context.layout, fit.hypothesis.nuisance_prior.unpack(fit.nuisance)
    measured = problem.data.measured
    response = fit.hypothesis.respond(fit.values, fit.nuisance, measured.s)
    noise = np.sqrt(np.array([np.diag(covariance).real for covariance in measured.covariance]).T)
    misfit = np.abs(measured.values - problem.data.gains(response) * response.values) / noise
    columns = {"gain": np.exp(layout.gain_signs @ nuisance_values.gains)}
    low, high = problem.context.band_hz
    for start, end in pairwise(np.geomspace(low, high, SUBBANDS + 1).round()):
        is_inside = (measured.frequency_hz >= start) & (measured.frequency_hz < end)
        columns[f"{start:g}-{end:g} Hz"] = np.sqrt(np.mean(misfit[is_inside] ** 2, axis=0))
    return pd.DataFrame(columns, index=[str(label) for label in measured.labels])
