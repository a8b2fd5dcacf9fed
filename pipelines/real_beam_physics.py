"""What real beams have that their models lack, in order of weight; and whether that helps where nothing was measured.

Run from the checkout: ``python pipelines/real_beam_physics.py ../shared/recordings/steel_beam_5x3 OUT_FOLDER``, or with
``../shared/recordings/freefree_beam``.

One cause after the other is added, the most probable one each time, until the next one brings too little or nothing is
left to explain.

What `CASES` states of a test is not searched for: how wrong section, material and damping may be, which scales nobody
knows, and how far resonances drift from file to file, as a variance of the FRFs.

What to expect of the steel beam, in some four minutes: its channels are late together by 0.96 ms (164 000 nats).
Then, one after the other, four small resonators: at 176 Hz (39 000 nats), 99 Hz (4 000), 177 Hz (5 600) and 444 Hz
(6 900). They are where the measured resonances come in pairs, 93 and 106, 173 and 184, 437 and 451 Hz, of which the
plain beam has one each: its model lacks the bent legs and the wires that it hangs in, and the catalogue has no word
for them but resonator. A sensor a few millimetres off comes last (700 nats). The misfit falls from 10.2 to 3.5 times
the expected one, and all resonances are some 20 % lower than the model's and its tolerances say: unexplained. The
sensor that is left out is predicted to 7.2 dB by updating the plain model, and to 5.1 dB with these causes in it.
With the first four alone it is predicted badly (49 dB): the update then goes astray.

What to expect of the free beam: its model, within these tolerances, lies on the measured FRFs; the gain of the driving
point, 99 / 99, is 15 % below those of the other eight, and what is left beside the drift, 2.1 times as much, is largest
below 100 Hz, where the beam moves in its cords. What is added gains 50 to 170 nats each and leaves 2.0 times: none of
it is the cords, and none is worth believing.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib import pyplot as plt

import frf_ipz
import real_beams
from frf_ipz.diagnosis.catalogue.finder import shipped_effects
from frf_ipz.diagnosis.evidence.fit import Fit
from frf_ipz.diagnosis.evidence.inference_problem import InferenceProblem, pose_problem
from frf_ipz.diagnosis.measured.data_split import split_data
from frf_ipz.diagnosis.model.change import with_change
from frf_ipz.diagnosis.observations import Observations
from frf_ipz.diagnosis.search.component_search import fit_null_model, search_component
from frf_ipz.diagnosis.verdict.findings import describe_component
from frf_ipz.diagnosis.verdict.goodness import FIRST_LOG_BAYES_FACTOR, assess_goodness

MOST_CAUSES = 6


@dataclass(frozen=True)
class Case:
    """What is known of a test."""

    band_hz: tuple[float, float]
    scale: str
    tolerances: frf_ipz.DiagnoseOptions
    drift: float = 0.0  # relative, of resonances from file to file
    left_out: int = 0  # node of a sensor that is predicted


CASES = {
    "steel_beam_5x3": Case(
        band_hz=(20.0, 600.0),
        scale="per_channel",
        tolerances=frf_ipz.DiagnoseOptions(stiffness_tolerance=0.02, frequency_tolerance=0.01, damping_tolerance=0.9),
        left_out=70,
    ),
    "freefree_beam": Case(
        band_hz=(50.0, 1000.0),
        scale="none",
        tolerances=frf_ipz.DiagnoseOptions(
            stiffness_tolerance=0.01, frequency_tolerance=0.005, damping_tolerance=0.9, gain_tolerance=0.05
        ),
        drift=1e-4,
    ),
}


def main(folder: Path, out: Path) -> None:
    """Print what is missing, and draw measurement and models."""
    case = CASES[folder.name]
    test = frf_ipz.read_test(folder / "test.toml")
    model = frf_ipz.read_model(folder / "model.toml")
    frfs = replace(frf_ipz.estimate_frfs(test, options=frf_ipz.IngestOptions()).frfs, unknown_scale=case.scale)
    frfs = with_drift(frfs.select_lines(frfs.in_band(case.band_hz)), case.drift)
    kept = [index for index, label in enumerate(frfs.labels) if label.output_dof.node != case.left_out]
    fits, problem = find_components(frfs.select_frfs(kept), model, case)
    for fit in (fits[0], fits[-1]):
        print(where_it_is(problem, fit).to_string(float_format="{:.2f}".format))
    out.mkdir(parents=True, exist_ok=True)
    draw(
        frfs.select_frfs(kept), problem, {"model": fits[0], "with what was found": fits[-1]}, out / f"{folder.name}.png"
    )
    if case.left_out:
        for number, fit in enumerate(fits):  # one cause more each time: what helps the fit need not help here
            full = with_change(model, fit.hypothesis.change(fit.values))
            found = real_beams.leave_out(frfs, full, case.band_hz, "output", case.left_out)
            print(
                f"\nsensor at node {case.left_out} left out, with the first {number} of the causes\n",
                found.to_string(float_format="{:.4g}".format),
                flush=True,
            )


def with_drift(frfs: frf_ipz.FrfSet, drift: float) -> frf_ipz.FrfSet:
    """State that resonances differ by a part of their frequency from file to file."""
    if not drift:
        return frfs
    slope = np.abs(np.gradient(frfs.values, frfs.frequency_hz, axis=0))
    noise = 0.003 * np.abs(frfs.values)
    return replace(frfs, variance=(drift * frfs.frequency_hz[:, None] * slope) ** 2 + noise**2)


def find_components(frfs: frf_ipz.FrfSet, model: object, case: Case) -> tuple[list[Fit], InferenceProblem]:
    """Add the cause with the largest evidence until the next one brings too little, and print what each leaves."""
    effects = {name: one for name, one in shipped_effects().items() if case.scale == "none" or name != "sensor_gain"}
    source = split_data(Observations(kind="frf", records=(), band_hz=case.band_hz, frfs=frfs))
    problem = pose_problem(model, source, case.band_hz, case.tolerances, effects, free_gains=case.scale)
    fits = add_components(problem)
    for before, fit in zip([fits[0], *fits], fits, strict=False):
        goodness = assess_goodness(problem, fit)
        said = [
            describe_component(fit, number, 1.0, 0.0, max(1.0, goodness.misfit), location_set=()).statement
            for number in range(len(fit.hypothesis.components))
        ]
        print(
            f"misfit {np.sqrt(goodness.misfit):.3g}, worst subband {np.sqrt(goodness.worst_subband):.3g} times the "
            f"expected one, nuisance chi2 {goodness.nuisance_chi2:.0f}, log Bayes factor "
            f"{fit.log_evidence - before.log_evidence:.0f}:",
            " ".join(said) or "the model, within its tolerances.",
            flush=True,
        )
    print("explained" if goodness.is_good else f"unexplained: what was found {goodness.shortfall}")
    return fits, problem


def add_components(problem: InferenceProblem) -> list[Fit]:
    """Return the fits with nothing, one cause, two causes and so on, the most probable one more each time."""
    fits = [fit_null_model(problem)]
    for _ in range(MOST_CAUSES):
        best = search_component(problem, fits[-1]).best
        if best.log_evidence - fits[-1].log_evidence < FIRST_LOG_BAYES_FACTOR:
            break
        fits.append(best)
        if assess_goodness(problem, best).is_good:
            break
    return fits


def where_it_is(problem: object, fit: object) -> pd.DataFrame:
    """Gain of each FRF, and its misfit over noise and drift in pieces of the band: what defends a verdict."""
    layout, nuisance_values = problem.context.layout, fit.hypothesis.nuisance_prior.unpack(fit.nuisance)
    measured = problem.data.measured
    response = fit.hypothesis.respond(fit.values, fit.nuisance, measured.s)
    noise = np.sqrt(np.array([np.diag(one).real for one in measured.covariance]).T)
    wrong = np.abs(measured.values - problem.data.gains(response) * response.values) / noise
    edges = np.geomspace(*problem.context.band_hz, 6).round()
    table = pd.DataFrame({"gain": np.exp(layout.gain_signs @ nuisance_values.gains)}, index=map(str, measured.labels))
    for low, high in pairwise(edges):
        inside = (measured.frequency_hz >= low) & (measured.frequency_hz < high)
        table[f"{low:g}-{high:g} Hz"] = np.sqrt(np.mean(wrong[inside] ** 2, axis=0))
    return table


def draw(frfs: frf_ipz.FrfSet, problem: object, fits: dict, path: Path) -> None:
    """Draw measured FRFs and models, on the gains that fit best."""
    rows = -(-frfs.n_frfs // 3)
    figure, axes = plt.subplots(rows, 3, figsize=(18, 3.2 * rows), squeeze=False, layout="constrained")
    for name, fit in fits.items():
        gains = problem.data.gains(fit.hypothesis.respond(fit.values, fit.nuisance, problem.data.measured.s))
        values = gains * fit.hypothesis.respond(fit.values, fit.nuisance, frfs.s).values
        for axis, column in zip(axes.flat, values.T, strict=False):
            axis.semilogy(frfs.frequency_hz, np.abs(column), lw=0.8, label=name)
    for axis, label, column in zip(axes.flat, frfs.labels, frfs.values.T, strict=False):
        axis.semilogy(frfs.frequency_hz, np.abs(column), "k", lw=0.6, label="measured")
        axis.set_title(str(label), fontsize=9)
    axes.flat[0].legend()
    figure.supxlabel("Frequency, Hz")
    figure.supylabel(f"Magnitude of the {frfs.labels[0].quantity.value}, scaled as recorded")
    figure.savefig(path, dpi=60)
    print(f"drawn: {path}")


if __name__ == "__main__":
    mpl.use("Agg")
    main(Path(sys.argv[1]), Path(sys.argv[2]))
