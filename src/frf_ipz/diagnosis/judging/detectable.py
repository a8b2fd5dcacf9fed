"""The smallest size of each effect that this measurement would show."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from frf_ipz.diagnosis.physics.response import nuisance_jacobian
from frf_ipz.diagnosis.search.hypothesis import Cause
from frf_ipz.numerics.least_squares import cholesky_with_prior

if TYPE_CHECKING:
    from collections.abc import Callable

    from frf_ipz.arrays import FloatArray
    from frf_ipz.diagnosis.catalogue.effect import Effect, Parameter
    from frf_ipz.diagnosis.search.fit import Fit
    from frf_ipz.diagnosis.search.hypothesis import Hypothesis
    from frf_ipz.diagnosis.search.inference_problem import InferenceProblem

PLACES = 2  # of each effect, spread over the structure
STEPS = 5  # halvings of the range


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
