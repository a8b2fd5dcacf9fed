"""Which further sensor would tell two explanations apart."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from frf_ipz.arrays import ComplexArray, FloatArray
    from frf_ipz.diagnosis.search.fit import Fit
    from frf_ipz.diagnosis.search.inference_problem import InferenceProblem

MOST_CANDIDATES = 60
TELLS = 0.02  # relative difference of FRFs that a measurement shows beyond doubt


def best_sensor(bench: InferenceProblem, first: Fit, second: Fit) -> str:
    """Find the place at which two explanations predict the most different FRFs.

    Parameters
    ----------
    bench : InferenceProblem
        With the test as it is.
    first, second : Fit
        The explanations.

    Returns
    -------
    str
        A sentence.
    """
    specimen = bench.specimen
    dofs = specimen.moving_dofs[:: -(-len(specimen.moving_dofs) // MOST_CANDIDATES)]
    motions = np.stack([specimen.unit(dof) for dof in dofs], 1)
    s = specimen.contour
    one, other = (_receptances(fit, motions, s) for fit in (first, second))
    size = np.sqrt(np.mean(np.abs(one) ** 2, axis=0))
    apart = np.sqrt(np.mean(np.abs(one - other) ** 2, axis=0)) / np.maximum(size, 1e-3 * size.max())
    sensor, struck = np.unravel_index(int(np.argmax(apart)), apart.shape)
    where, record = specimen.where(dofs[int(sensor)].node), specimen.layout.inputs[int(struck)]
    if apart[sensor, struck] < TELLS:
        return (
            "No further sensor in the directions of this test tells them apart; that takes a wider band, or another "
            "kind of test."
        )
    return (
        f"A sensor at {where} with the blow at {record} tells them apart: there they predict FRFs that differ by "
        f"{100 * float(apart[sensor, struck]):.2g} %."
    )


def _receptances(fit: Fit, motions: FloatArray, s: ComplexArray) -> ComplexArray:
    response = fit.hypothesis.respond(fit.values, fit.unknown, s)
    shapes = motions.T @ fit.hypothesis.basis.vectors @ response.modes.vectors
    return np.asarray(np.matmul(shapes, response.input_motion))
