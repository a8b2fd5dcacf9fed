"""Where the nominal model disagrees with the measurement: in which FRFs and bands, and at which node of the structure.

The node is the one at which one free dynamic stiffness explains most of the misfit. On each line the stiffness may be
any complex number; all FRFs of the line share it, so that two FRFs or more distinguish the nodes.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.evidence.inference_problem import compute_weights
from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.model.response import nuisance_jacobian
from frf_ipz.diagnosis.result import Curves
from frf_ipz.diagnosis.search.global_scan import MOTIONS_AT_ONCE, evaluate_receptances
from frf_ipz.diagnosis.search.robust_refinement import REFINED_ERROR
from frf_ipz.late_imports import import_late

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd

    from frf_ipz.arrays import FloatArray
    from frf_ipz.diagnosis.evidence.fit import Fit
    from frf_ipz.diagnosis.evidence.inference_problem import InferenceProblem
    from frf_ipz.diagnosis.model.motion import Motion
else:
    pd = import_late("pandas")

N_SUBBANDS = 6  # subbands, on a logarithmic scale
DISAGREES = 3.0  # standard deviations
N_NAMED = 3  # FRFs and bands in the text
MIN_FRFS = 2
MIN_EXPLAINED = 0.1  # of the misfit: a node that explains less is no location


def describe_mismatch(problem: InferenceProblem, null: Fit, curves: Curves) -> tuple[FloatArray, str, pd.DataFrame]:
    """Say where the nominal model disagrees, beyond noise and what its tolerances allow.

    Parameters
    ----------
    problem : InferenceProblem
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
    no_nuisance = np.zeros(problem.nuisance_prior.size)
    nominal = null.hypothesis.respond(null.values, no_nuisance, curves.s)
    allowed = np.sum(np.abs(nuisance_jacobian(nominal, problem.nuisance_prior, problem.context.layout)) ** 2, 2)
    spread = np.sqrt(curves.expected**2 + allowed)
    before = np.abs(curves.measured - curves.nominal) / spread
    after = np.abs(curves.measured - curves.explained) / curves.expected
    frequency = curves.s.imag / (2 * np.pi)
    table = _tabulate(frequency, before, after, [str(label) for label in curves.labels])
    worst = before.max(1) > DISAGREES
    return frequency[worst], _describe_table(table, frequency[worst]), table


def _tabulate(frequency: FloatArray, before: FloatArray, after: FloatArray, names: list[str]) -> pd.DataFrame:
    edges = np.geomspace(frequency[0], frequency[-1] * (1 + 1e-12), N_SUBBANDS + 1)
    rows = []
    for name, first, last in zip(names, before.T, after.T, strict=True):
        for low, high in pairwise(edges):
            inside = (frequency >= low) & (frequency < high)
            if inside.any():
                rms = [float(np.sqrt(np.mean(ratio[inside] ** 2))) for ratio in (first, last)]
                rows.append({"frf": name, "low_hz": low, "high_hz": high, "before": rms[0], "after": rms[1]})
    return pd.DataFrame(rows)


def _describe_table(table: pd.DataFrame, frequency_hz: FloatArray) -> str:
    ranked = table.sort_values("before", ascending=False).head(N_NAMED)
    parts = [
        f"{row.frf} from {row.low_hz:.4g} to {row.high_hz:.4g} Hz ({row.before:.3g} times)"
        for row in ranked.itertuples()
    ]
    worst = f"most of all, in units of what noise and tolerances explain, {'; '.join(parts)}."
    if not len(frequency_hz):
        return f"No line differs by more than {DISAGREES:g} times what noise and tolerances explain; {worst}"
    by_frf = table.groupby("frf")["before"].max().sort_values(ascending=False)
    off = [name for name, value in by_frf.items() if value > DISAGREES]
    return (
        f"{len(off)} of {len(by_frf)} FRFs disagree, between {frequency_hz.min():.4g} and {frequency_hz.max():.4g} Hz; "
        f"{worst}"
    )


def localise_mismatch(problem: InferenceProblem, null: Fit) -> Location:
    """Localise the misfit of the nominal model at a node.

    Parameters
    ----------
    problem : InferenceProblem
        With the data.
    null : Fit
        Of the nominal model.

    Returns
    -------
    Location
        A node; empty for a single FRF, or where no node explains much of the misfit.
    """
    if len(problem.data.measured.labels) < MIN_FRFS:
        return Location()
    dofs = problem.context.moving_dofs
    before, remaining = _compute_misfits(problem, null, [problem.context.motion(dof) for dof in dofs])
    best = int(np.argmin(remaining))
    return Location.at_node(dofs[best].node) if remaining[best] < (1 - MIN_EXPLAINED) * before else Location()


def _compute_misfits(problem: InferenceProblem, null: Fit, motions: Sequence[Motion]) -> tuple[float, FloatArray]:
    """Compute the robust misfit without and with a free dynamic stiffness on each of some motions."""
    is_on_fit = null.is_nearly_right
    data = problem.sparse_data.measured if is_on_fit else problem.coarse
    nuisance = null.nuisance if is_on_fit else np.zeros(problem.nuisance_prior.size)
    response = null.hypothesis.respond(null.values, nuisance, data.s)
    gains = problem.sparse_data.gains(response) if is_on_fit else 1.0
    weights = compute_weights(data, REFINED_ERROR)
    misfit = data.values - gains * response.values
    before = np.sum(weights * np.abs(misfit) ** 2, axis=1)
    remaining = []
    for first in range(0, len(motions), MOTIONS_AT_ONCE):
        some = motions[first : first + MOTIONS_AT_ONCE]
        across = evaluate_receptances(
            response, null.hypothesis.basis, problem.context.layout, some, np.zeros(len(some))
        ).across
        products = np.einsum("kf,kfp->kp", weights * misfit.conj(), across)
        size = np.einsum("kf,kfp->kp", weights, np.abs(across) ** 2)
        explained = np.abs(products) ** 2 / np.maximum(size, np.finfo(float).tiny)
        remaining.append(np.log1p(np.maximum(before[:, None] - explained, 0.0)).sum(0))
    return float(np.log1p(before).sum()), np.concatenate(remaining)
