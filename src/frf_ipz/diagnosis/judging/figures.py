"""How far models are from measurements, before and after: figures, curves, and where they disagree."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from frf_ipz.diagnosis.diagnosis import Curves, Misfit
from frf_ipz.diagnosis.measured.transfer_functions import ROUGH_PART, SMOOTH_PART
from frf_ipz.diagnosis.physics.response import nuisance_jacobian

if TYPE_CHECKING:
    from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray
    from frf_ipz.diagnosis.options import DiagnoseOptions
    from frf_ipz.diagnosis.search.fit import Data, Fit
    from frf_ipz.diagnosis.search.inference_problem import InferenceProblem

BANDS = 6  # pieces of the band, on a logarithmic scale
DISAGREES = 3.0  # standard deviations
MOST_NOISE = 0.3  # of an FRF: where noise is more, a norm would be one of noise
NAMED = 3  # FRFs and bands in the text


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Proof:
    """Figures of three models: as it is, with what tolerances allow, with the findings.

    Parameters
    ----------
    before, updated, after : Misfit
        The figures.
    curves : Curves
        FRFs to draw.
    """

    before: Misfit
    updated: Misfit
    after: Misfit
    curves: Curves


def prove(bench: InferenceProblem, held_out: Data, null: Fit, final: Fit) -> Proof:
    """Compare models with what was fitted and what was not.

    Parameters
    ----------
    bench : InferenceProblem
        With what was fitted.
    held_out : Data
        What was not.
    null, final : Fit
        Of the nominal model with what its tolerances allow, and with the findings.

    Returns
    -------
    Proof
        Figures and curves.
    """
    nothing = np.zeros(bench.nuisance.size)
    cases = ((null, nothing), (null, null.unknown), (final, final.unknown))
    figures = [_misfit(fit, unknown, bench.data, held_out) for fit, unknown in cases]
    shown = [_shown(fit, unknown, bench.data) for fit, unknown in cases]
    measured = bench.data.measured
    curves = Curves(
        s=measured.s,
        labels=measured.labels,
        measured=measured.values,
        nominal=shown[0],
        updated=shown[1],
        explained=shown[2],
        expected=expected(bench.data, bench.specimen.options),
    )
    return Proof(before=figures[0], updated=figures[1], after=figures[2], curves=curves)


def expected(data: Data, options: DiagnoseOptions) -> FloatArray:
    """Give the standard deviation of noise and of what no parameter of a model stands for.

    Parameters
    ----------
    data : Data
        Transfer functions.
    options : DiagnoseOptions
        Tolerances.

    Returns
    -------
    (n_points, n_frfs) array
        SI.
    """
    measured = data.measured
    noise = np.array([np.diag(covariance).real for covariance in measured.covariance]).T
    shared = np.stack([np.sum(np.abs(measured.common[place]) ** 2, 1) for place in measured.input_of], 1)
    model = (np.hypot(SMOOTH_PART, ROUGH_PART) * options.stiffness_tolerance) ** 2
    return np.asarray(np.sqrt(noise + shared * np.abs(measured.values) ** 2 + model * measured.size**2))


def _shown(fit: Fit, unknown: FloatArray, data: Data) -> ComplexArray:
    response = fit.hypothesis.respond(fit.values, unknown, data.measured.s)
    return np.asarray(data.gains(response) * response.values)


def _misfit(fit: Fit, unknown: FloatArray, training: Data, held_out: Data) -> Misfit:
    figures = []
    for data in (training, held_out):
        response = fit.hypothesis.respond(fit.values, unknown, data.measured.s)
        white = data.misfit(response)
        seen = _stands_out(data)
        measured = np.where(seen, data.measured.values, 0.0)
        wrong = measured - np.where(seen, data.gains(response) * response.values, 0.0)
        figures.append((_relative(wrong, measured), float(np.sqrt(white @ white / len(white)))))
    return Misfit(
        training=figures[0][0],
        held_out=figures[1][0],
        training_noise=figures[0][1],
        held_out_noise=figures[1][1],
    )


def _stands_out(data: Data) -> BoolArray:
    """Where the FRFs are more than noise; everywhere, if they are nowhere."""
    noise = np.array([np.diag(covariance).real for covariance in data.measured.covariance]).T
    seen = noise < (MOST_NOISE * data.measured.size) ** 2
    return np.asarray(seen | ~seen.any(0))


def _relative(wrong: ComplexArray, measured: ComplexArray) -> float:
    """Norm over norm; each FRF that shows anything counts by its own size, for sensors have several units."""
    scale = np.sqrt(np.mean(np.abs(measured) ** 2, 0))
    shown = scale > 0
    wrong, measured = (part[:, shown] / scale[shown] for part in (wrong, measured))
    return float(np.linalg.norm(wrong) / np.linalg.norm(measured))


def disagreement(bench: InferenceProblem, null: Fit, curves: Curves) -> tuple[FloatArray, str, pd.DataFrame]:
    """Say where the nominal model disagrees, beyond noise and what its tolerances allow.

    Parameters
    ----------
    bench : InferenceProblem
        With what was fitted.
    null : Fit
        Of the nominal model.
    curves : Curves
        FRFs of all models.

    Returns
    -------
    frequency_hz : (n,) array
        Where it disagrees, Hz.
    where : str
        The same in words.
    table : DataFrame
        Each FRF and band, as in `Diagnosis.mismatch`.
    """
    nothing = np.zeros(bench.nuisance.size)
    nominal = null.hypothesis.respond(null.values, nothing, curves.s)
    allowed = np.sum(np.abs(nuisance_jacobian(nominal, bench.nuisance, bench.specimen.layout)) ** 2, 2)
    spread = np.sqrt(curves.expected**2 + allowed)
    before = np.abs(curves.measured - curves.nominal) / spread
    after = np.abs(curves.measured - curves.explained) / curves.expected
    frequency = curves.s.imag / (2 * np.pi)
    table = _table(frequency, before, after, [str(label) for label in curves.labels])
    worst = before.max(1) > DISAGREES
    return frequency[worst], _in_words(table, frequency[worst]), table


def _table(frequency: FloatArray, before: FloatArray, after: FloatArray, names: list[str]) -> pd.DataFrame:
    edges = np.geomspace(frequency[0], frequency[-1] * (1 + 1e-12), BANDS + 1)
    rows = []
    for name, first, last in zip(names, before.T, after.T, strict=True):
        for low, high in pairwise(edges):
            inside = (frequency >= low) & (frequency < high)
            if inside.any():
                rms = [float(np.sqrt(np.mean(one[inside] ** 2))) for one in (first, last)]
                rows.append({"frf": name, "low_hz": low, "high_hz": high, "before": rms[0], "after": rms[1]})
    return pd.DataFrame(rows)


def _in_words(table: pd.DataFrame, frequency_hz: FloatArray) -> str:
    if not len(frequency_hz):
        return "The model agrees with every FRF of the band within noise and tolerances."
    ranked = table.sort_values("before", ascending=False).head(NAMED)
    parts = [
        f"{row.frf} from {row.low_hz:.4g} to {row.high_hz:.4g} Hz ({row.before:.3g} times)"
        for row in ranked.itertuples()
    ]
    by_frf = table.groupby("frf")["before"].max().sort_values(ascending=False)
    off = [name for name, value in by_frf.items() if value > DISAGREES]
    return (
        f"{len(off)} of {len(by_frf)} FRFs disagree, between {frequency_hz.min():.4g} and {frequency_hz.max():.4g} Hz; "
        f"most of all, in units of what noise and tolerances explain, {'; '.join(parts)}."
    )
