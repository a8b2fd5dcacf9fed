"""What a measurement can show: the smallest size of each effect, and which sensor would tell two explanations apart."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from frf_ipz.diagnosis.evidence.hypothesis import Cause
from frf_ipz.diagnosis.model.response import nuisance_jacobian
from frf_ipz.numerics.least_squares import cholesky_with_prior

if TYPE_CHECKING:
    from collections.abc import Callable

    from frf_ipz.arrays import ComplexArray, FloatArray
    from frf_ipz.diagnosis.catalogue.effect import Effect, Parameter
    from frf_ipz.diagnosis.evidence.fit import Fit
    from frf_ipz.diagnosis.evidence.hypothesis import Hypothesis
    from frf_ipz.diagnosis.evidence.inference_problem import InferenceProblem

PLACES = 2  # of each effect, spread over the structure
STEPS = 5  # halvings of the range
MOST_CANDIDATES = 60
TELLS = 0.02  # relative difference of FRFs that a measurement shows beyond doubt


def detectable_sizes(bench: InferenceProblem, null: Fit, needed_nats: float) -> dict[str, dict[str, float]]:
    """Find the size at which each effect changes the FRFs by more than noise and tolerances can explain.

    Parameters
    ----------
    bench : InferenceProblem
        The measurement.
    null : Fit
        Of the nominal model.
    needed_nats : float
        Evidence that a finding needs.

    Returns
    -------
    dict of str to dict
        For each effect, the value of its first parameter at the place where it shows best; effects that have no
        parameter, or do not apply, are left out.
    """
    measure = _evidence(bench, null)
    found = {}
    for effect in bench.effects.values():
        sizes = [_smallest(bench, effect, place, measure, needed_nats) for place in _some_places(bench, effect)]
        known = [size for size in sizes if size is not None]
        if known:
            best = min(known, key=lambda size: size[2])
            found[effect.name] = {best[0]: best[1]}
    return found


def _some_places(bench: InferenceProblem, effect: Effect) -> list[Cause]:
    places = list(effect.places(bench.specimen))
    chosen = places[:: -(-len(places) // PLACES)] if places else []
    return [Cause(effect=effect, place=place, n_places=len(places)) for place in chosen]


def _evidence(bench: InferenceProblem, null: Fit) -> Callable[[Hypothesis, FloatArray], float]:
    """Half the squared norm of a change that no scatter explains."""
    data, nothing = bench.data, np.zeros(bench.nuisance.size)
    nominal = null.hypothesis.respond(null.values, nothing, data.measured.s)
    columns = data.slopes(nominal, nuisance_jacobian(nominal, bench.nuisance, bench.specimen.layout))
    factor = cholesky_with_prior(columns.T)

    def evidence(hypothesis: Hypothesis, values: FloatArray) -> float:
        changed = hypothesis.respond(values, nothing, data.measured.s)
        white = data.slopes(nominal, (changed.values - nominal.values)[:, :, None])[:, 0]
        seen = linalg.solve_triangular(factor, columns.T @ white, lower=True)
        return 0.5 * float(white @ white - seen @ seen)

    return evidence


def _smallest(
    bench: InferenceProblem,
    effect: Effect,
    cause: Cause,
    measure: Callable[[Hypothesis, FloatArray], float],
    needed_nats: float,
) -> tuple[str, float, float] | None:
    """Name, value and relative size of the first parameter at the threshold; None where there is none."""
    parameters = effect.parameters(bench.specimen, cause.place)
    if not parameters:
        return None
    hypothesis = bench.suppose((cause,))
    first = parameters[0]
    others = [float(np.sqrt(p.low * p.high)) if p.is_log else 0.5 * (p.low + p.high) for p in parameters[1:]]
    near, far = 0.0, 1.0
    if measure(hypothesis, np.array([_at(first, far), *others])) < needed_nats:
        return None
    for _ in range(STEPS):
        middle = 0.5 * (near + far)
        if measure(hypothesis, np.array([_at(first, middle), *others])) < needed_nats:
            near = middle
        else:
            far = middle
    return first.name, effect.reported(cause.place, first.name, _at(first, far)), far


def _at(parameter: Parameter, part: float) -> float:
    """From where an effect vanishes (0) to where it is largest (1)."""
    if not parameter.is_log:
        return parameter.neutral + part * (parameter.high - parameter.neutral)
    low, high = np.log(parameter.low), np.log(parameter.high)
    if np.isinf(parameter.neutral):
        return float(np.exp(high + part * (low - high)))
    start = np.log(parameter.neutral) if parameter.low < parameter.neutral < parameter.high else low
    return float(np.exp(start + part * (high - start)))


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
