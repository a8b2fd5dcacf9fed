"""Where a mismatch sits, whatever its cause: the node at which one unknown dynamic stiffness explains most of it.

On each line the stiffness may be any complex number; all FRFs of the line share it, so that two FRFs or more tell one
node from another.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.search.global_scan.signatures import receptances
from frf_ipz.diagnosis.search.inference_problem import weights_of

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray
    from frf_ipz.diagnosis.search.fit import Fit
    from frf_ipz.diagnosis.search.inference_problem import InferenceProblem

ERROR = 0.01  # of an FRF's size: what counts as a misfit
FEWEST_FRFS = 2
TELLS = 0.1  # of the misfit: a node that explains less tells nothing


def trace(bench: InferenceProblem, null: Fit) -> dict[str, list[int]]:
    """Trace the misfit of the nominal model to a node.

    Parameters
    ----------
    bench : InferenceProblem
        With the data.
    null : Fit
        Of the nominal model.

    Returns
    -------
    dict
        ``{"nodes": [node]}``; empty where one FRF is all there is, or no node explains much of the misfit.
    """
    if len(bench.data.measured.labels) < FEWEST_FRFS:
        return {}
    dofs = bench.specimen.moving_dofs
    before, left = _misfits(bench, null, np.stack([bench.specimen.unit(dof) for dof in dofs], 1))
    best = int(np.argmin(left))
    return {"nodes": [dofs[best].node]} if left[best] < (1 - TELLS) * before else {}


def _misfits(bench: InferenceProblem, null: Fit, motions: FloatArray) -> tuple[float, FloatArray]:
    """Robust misfit without and with a free dynamic stiffness on each of some motions."""
    is_near = null.is_nearly_right
    data = bench.thin.measured if is_near else bench.coarse
    unknown = null.unknown if is_near else np.zeros(bench.nuisance.size)
    response = null.hypothesis.respond(null.values, unknown, data.s)
    gains = bench.thin.gains(response) if is_near else 1.0
    weights = weights_of(data, ERROR)
    misfit = data.values - gains * response.values
    none = np.zeros(motions.shape[1])
    across = receptances(response, null.hypothesis.basis, bench.specimen.layout, motions, none).across
    seen = np.einsum("kf,kfp->kp", weights * misfit.conj(), across)
    size = np.einsum("kf,kfp->kp", weights, np.abs(across) ** 2)
    before = np.sum(weights * np.abs(misfit) ** 2, axis=1)
    taken = np.abs(seen) ** 2 / np.maximum(size, np.finfo(float).tiny)
    left = np.log1p(np.maximum(before[:, None] - taken, 0.0)).sum(0)
    return float(np.log1p(before).sum()), np.asarray(left)
