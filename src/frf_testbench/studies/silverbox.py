"""Silverbox: which law an electronic oscillator has, and its coefficient, from a record whose level grows.

``frf-testbench study silverbox FOLDER``. Input V1 and output V2 are taken as a force and a displacement: the
coefficient is in V of V1 per V^3 of V2. A first search has the laws of the catalogue, a second one also a law of this
file: the cube with a little of the square.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

import frf_ipz
from frf_ipz.arrays import FloatArray
from frf_ipz.diagnosis.nonlinear.laws.finder import shipped_laws
from frf_ipz.diagnosis.nonlinear.search import search_laws
from frf_ipz.diagnosis.observations import ObservedRecord, Sensor
from frf_ipz.progress import silent
from frf_testbench.studies.recordings import require_recordings

if TYPE_CHECKING:
    from pathlib import Path

    from frf_ipz.arrays import FloatArray
    from frf_ipz.diagnosis.nonlinear.search import LawSearch
    from frf_ipz.progress import Progress

RATE_HZ = 1e7 / 2**14
GROWING = slice(100, 40500)  # samples whose level grows from nothing
SEGMENTS = 4
MAINS_HZ = (148.0, 152.0)  # the third harmonic of the mains stands out of the weak part
TOLERANCES = frf_ipz.DiagnoseOptions(frequency_tolerance=0.02, damping_tolerance=0.5, gain_tolerance=0.02)


class CubicWithSquare(frf_ipz.Law):
    """Force k3 (w^3 + a w^2)."""

    name = "cubic_with_square"
    strength_name = "cubic_V_V3"
    shape_name = "square_over_cubic_V"
    strength_can_be_negative = True
    degree = 4.0
    phrase = "a spring of {} V/V^3 whose force is the cube with a part of the square"

    def unit_force(self, w: FloatArray, v: FloatArray, shape: float) -> FloatArray:
        """Cube and square."""
        del v
        return w * w * (w + shape)

    def shapes(self, largest_w: float, largest_v: float) -> FloatArray:
        """Parts of the largest motion."""
        del largest_v
        return np.array([-0.1, -0.03, -0.01, 0.01, 0.03, 0.1]) * largest_w


def fit_linear_oscillator(force: FloatArray, motion: FloatArray) -> FloatArray:
    """Mass, damping and stiffness of the weak beginning, by an exponentially damped transform."""
    step, n = 1 / RATE_HZ, len(force)
    sigma = 8 / (n * step)
    s = sigma + 2j * np.pi * np.fft.rfftfreq(n, step)
    damp = np.exp(-sigma * step * np.arange(n))
    F, W = np.fft.rfft(force * damp), np.fft.rfft(motion * damp)
    band = (s.imag > 2 * np.pi * 20) & (s.imag < 2 * np.pi * 120)
    A = np.stack([s**2 * W, s * W, W], 1)[band]
    columns, right = np.vstack([A.real, A.imag]), np.concatenate([F[band].real, F[band].imag])
    sizes = np.abs(columns).max(0)
    return np.asarray(np.linalg.lstsq(columns / sizes, right, rcond=None)[0] / sizes)


def study_silverbox(folder: Path, *, progress: Progress = silent) -> dict[str, pd.DataFrame]:
    """Search with the laws of the catalogue, and with the law of this file.

    Parameters
    ----------
    folder : Path
        Holds ``SNLS80mV.csv``.
    progress : Progress
        Receives the progress.

    Returns
    -------
    dict of str to DataFrame
        The weak oscillator, and what each search found.

    Raises
    ------
    StudyError
        If it does not.
    """
    require_recordings(folder, "silverbox")
    data = pd.read_csv(folder / "SNLS80mV.csv", usecols=["V1", "V2"]).to_numpy()[GROWING].T
    force, motion = data - data[:, :50].mean(1, keepdims=True)
    mass, damping, stiffness = fit_linear_oscillator(force[:8000], motion[:8000])
    ratio = damping / (2 * np.sqrt(mass * stiffness))
    model = frf_ipz.StructuralModel.from_matrices(
        [[mass]], [[stiffness]], dofs=["1:x"], modal_damping=ratio, name="silverbox"
    )
    observations = cut_into_segments(force, motion)
    catalogue = tuple(shipped_laws().values())
    searches = {"catalogue": catalogue, "with cubic_with_square": (*catalogue, CubicWithSquare())}
    columns = {}
    for number, (name, laws) in enumerate(searches.items()):

        def report(fraction: float, text: str, number: int = number, name: str = name) -> None:
            progress((number + fraction) / len(searches), f"{name}: {text}")

        search = search_laws(model, observations, TOLERANCES, laws=laws, progress=report)
        columns[name] = describe_search(search, stiffness)
    weak = {"frequency_hz": np.sqrt(stiffness / mass) / (2 * np.pi), "damping_ratio": ratio, "k1_V_V": stiffness}
    return {"the weak oscillator": pd.DataFrame([weak]), "the laws": pd.DataFrame(columns)}


def cut_into_segments(force: FloatArray, motion: FloatArray) -> frf_ipz.Observations:
    """Cut the record into segments of growing level, as records that follow each other."""
    dof = frf_ipz.parse_dof("1:+x")
    records = tuple(
        ObservedRecord(
            name=f"segment {number}",
            input_channel="V1",
            input_dof=dof,
            sensors=(Sensor(channel="V2", dof=dof, quantity=frf_ipz.FrfQuantity.RECEPTANCE),),
            step_s=1 / RATE_HZ,
            force=force[cut],
            responses=motion[None, cut],
            starts_at_rest=number == 0,
        )
        for number, cut in enumerate(np.array_split(np.arange(len(force)), SEGMENTS))
    )
    return frf_ipz.Observations(kind="random", records=records, band_hz=(20.0, 180.0), exclude_hz=(MAINS_HZ,))


def describe_search(search: LawSearch, stiffness: float) -> dict[str, object]:
    """Sum up a search: the verdict, the best law with its coefficient, and what it leaves of the response."""
    row: dict[str, object] = {"verdict": search.verdict, "linearity score": search.linearity.score}
    for finding in search.findings[:1]:
        row |= {"law": finding.effect, "log Bayes factor": finding.log_evidence_gain}
        row |= {
            name: value if isinstance(value, str) else f"{value.value:.4g} +- {value.std:.2g}"
            for name, value in finding.parameters.items()
        }
    for name, misfit in (("linear", search.updated), ("with the law", search.after)):
        if misfit is not None:
            row |= {f"misfit, {name}": misfit.training, f"misfit over noise, {name}": misfit.training_noise}
    if search.fit is not None:
        row["k3 / k1, 1/V^2"] = search.fit.strength / stiffness
    return row
