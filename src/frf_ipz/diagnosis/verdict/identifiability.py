"""What a measurement can show: the smallest size of each effect, and which sensor would tell two explanations apart."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from frf_ipz.diagnosis.evidence.hypothesis import Component
from frf_ipz.diagnosis.model.response import nuisance_jacobian
from frf_ipz.numerics.least_squares import cholesky_with_prior

if TYPE_CHECKING:
    from collections.abc import Callable

    from frf_ipz.arrays import ComplexArray, FloatArray
    from frf_ipz.diagnosis.catalogue.effect import Effect, Parameter
    from frf_ipz.diagnosis.evidence.fit import Fit
    from frf_ipz.diagnosis.evidence.hypothesis import Hypothesis
    from frf_ipz.diagnosis.evidence.inference_problem import InferenceProblem

N_LOCATIONS = 2  # of each effect, spread over the structure
N_HALVINGS = 5  # halvings of the range
MAX_CANDIDATES = 60
DISTINCT = 0.02  # relative difference of FRFs that a measurement shows beyond doubt


def find_detectable_sizes(
    problem: InferenceProblem, null: Fit, required_log_bayes_factor: float
) -> dict[str, dict[str, float]]:
    """Find the size at which each effect changes the FRFs by more than noise and tolerances can explain.

    Parameters
    ----------
    problem : InferenceProblem
        The measurement.
    null : Fit
        Of the nominal model.
    required_log_bayes_factor : float
        Evidence that a finding needs.

    Returns
    -------
    dict of str to dict
        For each effect, the value of its first parameter at the place where it shows best; effects that have no
        parameter, or do not apply, are left out.
    """
    measure = _make_evidence(problem, null)
    found = {}
    for effect in problem.effects.values():
        sizes = [
            _smallest(problem, effect, location, measure, required_log_bayes_factor)
            for location in _spread_locations(problem, effect)
        ]
        known = [size for size in sizes if size is not None]
        if known:
            best = min(known, key=lambda size: size[2])
            found[effect.name] = {best[0]: best[1]}
    return found


def _spread_locations(problem: InferenceProblem, effect: Effect) -> list[Component]:
    locations = list(effect.locations(problem.context))
    chosen = locations[:: -(-len(locations) // N_LOCATIONS)] if locations else []
    return [Component(effect=effect, location=location, n_locations=len(locations)) for location in chosen]


def _make_evidence(problem: InferenceProblem, null: Fit) -> Callable[[Hypothesis, FloatArray], float]:
    """Half the squared norm of a change that no scatter explains."""
    data, nothing = problem.data, np.zeros(problem.nuisance_prior.size)
    nominal = null.hypothesis.respond(null.values, nothing, data.measured.s)
    columns = data.slopes(nominal, nuisance_jacobian(nominal, problem.nuisance_prior, problem.context.layout))
    factor = cholesky_with_prior(columns.T)

    def evidence(hypothesis: Hypothesis, values: FloatArray) -> float:
        changed = hypothesis.respond(values, nothing, data.measured.s)
        white = data.slopes(nominal, (changed.values - nominal.values)[:, :, None])[:, 0]
        seen = linalg.solve_triangular(factor, columns.T @ white, lower=True)
        return 0.5 * float(white @ white - seen @ seen)

    return evidence


def _smallest(
    problem: InferenceProblem,
    effect: Effect,
    component: Component,
    measure: Callable[[Hypothesis, FloatArray], float],
    required_log_bayes_factor: float,
) -> tuple[str, float, float] | None:
    """Name, value and relative size of the first parameter at the threshold; None where there is none."""
    parameters = effect.parameters(problem.context, component.location)
    if not parameters:
        return None
    hypothesis = problem.make_hypothesis((component,))
    first = parameters[0]
    others = [float(np.sqrt(p.low * p.high)) if p.is_log else 0.5 * (p.low + p.high) for p in parameters[1:]]
    near, far = 0.0, 1.0
    if measure(hypothesis, np.array([_value_at(first, far), *others])) < required_log_bayes_factor:
        return None
    for _ in range(N_HALVINGS):
        middle = 0.5 * (near + far)
        if measure(hypothesis, np.array([_value_at(first, middle), *others])) < required_log_bayes_factor:
            near = middle
        else:
            far = middle
    return first.name, effect.report_value(component.location, first.name, _value_at(first, far)), far


def _value_at(parameter: Parameter, part: float) -> float:
    """From where an effect vanishes (0) to where it is largest (1)."""
    if not parameter.is_log:
        return parameter.neutral + part * (parameter.high - parameter.neutral)
    low, high = np.log(parameter.low), np.log(parameter.high)
    if np.isinf(parameter.neutral):
        return float(np.exp(high + part * (low - high)))
    start = np.log(parameter.neutral) if parameter.low < parameter.neutral < parameter.high else low
    return float(np.exp(start + part * (high - start)))


def find_best_sensor(problem: InferenceProblem, first: Fit, second: Fit) -> str:
    """Find the place at which two explanations predict the most different FRFs.

    Parameters
    ----------
    problem : InferenceProblem
        With the test as it is.
    first, second : Fit
        The explanations.

    Returns
    -------
    str
        A sentence.
    """
    context = problem.context
    dofs = context.moving_dofs[:: -(-len(context.moving_dofs) // MAX_CANDIDATES)]
    motions = np.stack([context.unit(dof) for dof in dofs], 1)
    s = context.contour
    one, other = (_receptances(fit, motions, s) for fit in (first, second))
    size = np.sqrt(np.mean(np.abs(one) ** 2, axis=0))
    apart = np.sqrt(np.mean(np.abs(one - other) ** 2, axis=0)) / np.maximum(size, 1e-3 * size.max())
    sensor, struck = np.unravel_index(int(np.argmax(apart)), apart.shape)
    where, record = context.where(dofs[int(sensor)].node), context.layout.inputs[int(struck)]
    if apart[sensor, struck] < DISTINCT:
        return (
            "No further sensor in the directions of this test tells them apart; that takes a wider band, or another "
            "kind of test."
        )
    return (
        f"A sensor at {where} with the blow at {record} tells them apart: there they predict FRFs that differ by "
        f"{100 * float(apart[sensor, struck]):.2g} %."
    )


def _receptances(fit: Fit, motions: FloatArray, s: ComplexArray) -> ComplexArray:
    response = fit.hypothesis.respond(fit.values, fit.nuisance, s)
    shapes = motions.T @ fit.hypothesis.basis.vectors @ response.modes.vectors
    return np.asarray(np.matmul(shapes, response.input_motion))
