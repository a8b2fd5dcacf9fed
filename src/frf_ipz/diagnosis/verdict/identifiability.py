"""What a measurement can show: the smallest size of each effect, and the sensor that distinguishes two explanations."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from frf_ipz.diagnosis.evidence.hypothesis import Component
from frf_ipz.diagnosis.model.response import nuisance_jacobian
from frf_ipz.numerics.least_squares import cholesky_with_prior

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from frf_ipz.arrays import ComplexArray, FloatArray
    from frf_ipz.diagnosis.catalogue.effect import Effect, Parameter
    from frf_ipz.diagnosis.evidence.fit import Fit
    from frf_ipz.diagnosis.evidence.hypothesis import Hypothesis
    from frf_ipz.diagnosis.evidence.inference_problem import InferenceProblem
    from frf_ipz.diagnosis.model.motion import Motion

N_LOCATIONS = 2  # of each effect, spread over the structure
N_HALVINGS = 5  # halvings of the range
MAX_CANDIDATES = 60
DISTINCT = 0.02  # relative difference of FRFs that a measurement shows clearly


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
        Log Bayes factor that a finding needs.

    Returns
    -------
    dict of str to dict
        For each effect, the value of its first parameter at the location where it shows best; effects that have no
        parameter, or do not apply, are left out.
    """
    measure = _make_evidence(problem, null)
    smallest = {}
    for effect in problem.effects.values():
        sizes = [
            _find_smallest_size(problem, effect, location, measure, required_log_bayes_factor)
            for location in _spread_locations(problem, effect)
        ]
        known = [size for size in sizes if size is not None]
        if known:
            best = min(known, key=lambda size: size[2])
            smallest[effect.name] = {best[0]: best[1]}
    return smallest


def _spread_locations(problem: InferenceProblem, effect: Effect) -> list[Component]:
    locations = list(effect.locations(problem.context))
    selected = locations[:: -(-len(locations) // N_LOCATIONS)] if locations else []
    return [Component(effect=effect, location=location, n_locations=len(locations)) for location in selected]


def _make_evidence(problem: InferenceProblem, null: Fit) -> Callable[[Hypothesis, FloatArray], float]:
    """Half the squared norm of a change that the nuisance cannot explain."""
    data, no_nuisance = problem.data, np.zeros(problem.nuisance_prior.size)
    nominal = null.hypothesis.respond(null.values, no_nuisance, data.measured.s)
    columns = data.slopes(nominal, nuisance_jacobian(nominal, problem.nuisance_prior, problem.context.layout))
    factor = cholesky_with_prior(columns.T)

    def evidence(hypothesis: Hypothesis, values: FloatArray) -> float:
        changed = hypothesis.respond(values, no_nuisance, data.measured.s)
        white = data.slopes(nominal, (changed.values - nominal.values)[:, :, None])[:, 0]
        explained = linalg.solve_triangular(factor, columns.T @ white, lower=True)
        return 0.5 * float(white @ white - explained @ explained)

    return evidence


def _find_smallest_size(
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
    further = [float(np.sqrt(p.low * p.high)) if p.is_log else 0.5 * (p.low + p.high) for p in parameters[1:]]
    low, high = 0.0, 1.0
    if measure(hypothesis, np.array([_value_at(first, high), *further])) < required_log_bayes_factor:
        return None
    for _ in range(N_HALVINGS):
        middle = 0.5 * (low + high)
        if measure(hypothesis, np.array([_value_at(first, middle), *further])) < required_log_bayes_factor:
            low = middle
        else:
            high = middle
    return first.name, effect.report_value(component.location, first.name, _value_at(first, high)), high


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
    """Find the sensor position at which two explanations predict the most different FRFs.

    Parameters
    ----------
    problem : InferenceProblem
        Of the present test.
    first, second : Fit
        The explanations.

    Returns
    -------
    str
        A sentence.
    """
    context = problem.context
    dofs = context.moving_dofs[:: -(-len(context.moving_dofs) // MAX_CANDIDATES)]
    motions = [context.motion(dof) for dof in dofs]
    s = context.contour
    first_frfs, second_frfs = (_receptances(fit, motions, s) for fit in (first, second))
    size = np.sqrt(np.mean(np.abs(first_frfs) ** 2, axis=0))
    difference = np.sqrt(np.mean(np.abs(first_frfs - second_frfs) ** 2, axis=0)) / np.maximum(size, 1e-3 * size.max())
    sensor, excited = np.unravel_index(int(np.argmax(difference)), difference.shape)
    position, excited_dof = context.describe_node(dofs[int(sensor)].node), context.layout.inputs[int(excited)]
    if difference[sensor, excited] < DISTINCT:
        return (
            "No further sensor in the directions of this test distinguishes them; that takes a wider band, or another "
            "kind of test."
        )
    return (
        f"A sensor at {position} with the excitation at {excited_dof} distinguishes them: there they predict FRFs that "
        f"differ by {100 * float(difference[sensor, excited]):.2g} %."
    )


def _receptances(fit: Fit, motions: Sequence[Motion], s: ComplexArray) -> ComplexArray:
    response = fit.hypothesis.respond(fit.values, fit.nuisance, s)
    shapes = fit.hypothesis.basis.project_motions(motions) @ response.modes.vectors
    return np.asarray(np.matmul(shapes, response.input_motion))
