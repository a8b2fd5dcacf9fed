"""Global scan for large effects: all of them at all locations for many values, far from the axis, where all is smooth.

Many effects are one dynamic stiffness D on one motion p. The FRFs then change by ``-R_sp D / (1 + R_pp D) R_ph``: for
every line the misfit is a quadratic of one complex number, whose three coefficients do not depend on the effect. All
such effects at all locations, for all values of their parameters, cost a few operations a line each; the others are
evaluated value by value. Misfits count by their logarithm.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.evidence.hypothesis import Component
from frf_ipz.diagnosis.evidence.inference_problem import InferenceProblem, compute_weights
from frf_ipz.diagnosis.search.robust_refinement import Start, compute_robust_misfit

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.effect import Effect, Signature
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.evidence.fit import Fit
    from frf_ipz.diagnosis.measured.transfer_functions import TransferFunctions
    from frf_ipz.diagnosis.model.basis import Basis
    from frf_ipz.diagnosis.model.layout import Layout
    from frf_ipz.diagnosis.model.response import Response

MOTIONS_AT_ONCE = 400  # motions: keeps arrays within some ten MB
AMPLITUDES = np.geomspace(1e-3, 300.0, 20)  # over the stiffness of the structure against the motion
FINER_STEPS = tuple(np.geomspace(1 / step, step, 9) for step in (1.6, 1.1))  # times the best of them, twice
LARGEST_FLEXIBILITY = 2500  # DOFs up to which the static flexibility of all of them is found
SCAN_ERROR = 0.02  # of an FRF's size: what counts as a misfit far from the axis
NUISANCE_ERROR = 0.1  # the same where the nuisance was fitted
NEIGHBOURS_OF = 16  # best locations of each effect whose neighbours are scanned, where not all locations are listed


Terms: TypeAlias = tuple[FloatArray, ComplexArray, FloatArray, ComplexArray]
"""Of the misfit of each line with a dynamic stiffness on a motion: constant, linear, square; and R_pp."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Receptances:
    """FRFs to, from and at motions, on top of the fit to build on.

    Parameters
    ----------
    across : (n_points, n_frfs, n_motions) complex array
        R_sp R_ph as the channels record it.
    at_motions : (n_points, n_motions) complex array
        R_pp.
    """

    across: ComplexArray
    at_motions: ComplexArray


def evaluate_receptances(
    base: Response, basis: Basis, layout: Layout, motions: FloatArray, missing_flexibility: FloatArray
) -> Receptances:
    """Evaluate FRFs of motions.

    Parameters
    ----------
    base : Response
        Of the fit to build on.
    basis : Basis
        Its coordinates.
    layout : Layout
        Sensors and excited points.
    motions : (n_all, n_motions) array
        Weights of all DOFs.
    missing_flexibility : (n_motions,) array
        Static flexibility that the basis lacks, m/N.

    Returns
    -------
    Receptances
        Of the motions.
    """
    shapes = motions.T @ basis.vectors @ base.modes.vectors
    from_outputs, from_inputs = np.matmul(shapes, base.output_motion), np.matmul(shapes, base.input_motion)
    across = from_outputs[:, :, layout.output_index] * from_inputs[:, :, layout.input_index] * base.chain[:, None, :]
    s, modes = base.s[:, None], base.modes
    damping = 2 * modes.ratio * np.sqrt(np.abs(modes.squares))
    at_motions = (1 / (s**2 + s * damping + modes.squares)) @ (shapes**2).T + missing_flexibility
    if base.attached_motion.shape[2]:
        at_attachments = np.matmul(shapes, base.attached_motion)
        at_motions = at_motions - np.einsum("kpa,kab,kpb->kp", at_attachments, base.attached_stiffness, at_attachments)
    return Receptances(across=np.moveaxis(across, 1, 2), at_motions=np.asarray(at_motions))


def compute_missing_flexibility(basis: Basis, motions: FloatArray) -> FloatArray:
    """Find the static flexibility of motions that a basis lacks.

    Parameters
    ----------
    basis : Basis
        Of the nominal model.
    motions : (n_all, n_motions) array
        Weights of all DOFs.

    Returns
    -------
    (n_motions,) array
        m/N; zero for models that are too large.
    """
    model, shift = basis.model, basis.modes.shift
    free = motions[~model.fixed]
    if len(free) > LARGEST_FLEXIBILITY:
        return np.zeros(motions.shape[1])
    used = np.flatnonzero(np.abs(free).max(1) > 0)
    loads = np.zeros((len(free), len(used)))
    loads[used, np.arange(len(used))] = 1.0
    flexibility = basis.modes.factor.solve(loads)[used]
    whole = np.sum(free[used] * (flexibility @ free[used]), 0)
    shapes = motions.T @ basis.vectors
    inside = np.sum(shapes * np.linalg.solve(basis.stiffness + shift * np.eye(len(basis.stiffness)), shapes.T).T, 1)
    return np.asarray(np.maximum(whole - inside, 0.0))


def scan_signatures(
    components: Sequence[Component], signatures: Sequence[Signature], base: Response, basis: Basis, layout: Layout,
    measured: TransferFunctions, weights: FloatArray,
) -> list[Start]:  # fmt: skip
    """Find the best values of each effect at each location.

    Parameters
    ----------
    components : sequence of Component
        Effects at their locations.
    signatures : sequence of Signature
        Of the same, as dynamic stiffness.
    base : Response
        Of the fit to build on.
    basis : Basis
        Its coordinates.
    layout : Layout
        Sensors and excited points.
    measured : TransferFunctions
        Transfer functions on the contour of the signatures.
    weights : (n_points, n_frfs) array
        Over the squared misfit.

    Returns
    -------
    list of Start
        One a component.
    """
    misfit = measured.values - base.values
    constant = np.sum(weights * np.abs(misfit) ** 2, 1)
    starts = []
    for group in _group_by_motion(signatures):
        motions = np.stack([signatures[members[0]].motion for members in group], 1)
        receptances = evaluate_receptances(base, basis, layout, motions, compute_missing_flexibility(basis, motions))
        linear = np.einsum("kf,kfp->kp", weights * misfit.conj(), receptances.across)
        square = np.einsum("kf,kfp->kp", weights, np.abs(receptances.across) ** 2)
        for column, members in enumerate(group):
            terms = constant, linear[:, column], square[:, column], receptances.at_motions[:, column]
            starts += [_best_amplitude(components[member], signatures[member], terms) for member in members]
    return starts


def _group_by_motion(signatures: Sequence[Signature]) -> Iterator[list[list[int]]]:
    """Signatures on the same motion share their receptances; motions come in groups that fit into memory."""
    members: dict[bytes, list[int]] = {}
    for index, signature in enumerate(signatures):
        members.setdefault(signature.motion.tobytes(), []).append(index)
    groups = list(members.values())
    for start in range(0, len(groups), MOTIONS_AT_ONCE):
        yield groups[start : start + MOTIONS_AT_ONCE]


def _best_amplitude(component: Component, signature: Signature, terms: Terms) -> Start:
    at_motion = terms[3]
    if signature.amplitudes is None:
        scale = np.median(np.abs(at_motion)) * np.median(np.abs(signature.shapes), axis=1)
        amplitudes = AMPLITUDES[None, :] / scale[:, None]
    else:
        amplitudes = np.broadcast_to(signature.amplitudes, (len(signature.shapes), len(signature.amplitudes)))
    costs = _costs(signature.shapes, amplitudes, terms)
    shape, size = np.unravel_index(int(np.argmin(costs)), costs.shape)
    best, cost = amplitudes[shape, size], costs[shape, size]
    for factors in FINER_STEPS if amplitudes.shape[1] > 1 else ():
        finer = best * factors
        costs = _costs(signature.shapes[shape, None], finer[None], terms)[0]
        nearest = int(np.argmin(costs))
        best, cost = finer[nearest], costs[nearest]
    values = signature.values[shape].copy()
    if len(values):
        values[signature.amplitude] *= best
    return Start(component=component, values=values, cost=float(cost))


def _costs(shapes: ComplexArray, amplitudes: FloatArray, terms: Terms) -> FloatArray:
    """Robust misfits of shapes times amplitudes, (n_shapes, n_amplitudes)."""
    constant, linear, square, at_motion = terms
    stiffness = amplitudes[:, :, None] * shapes[:, None, :]
    effective = stiffness / (1 + at_motion * stiffness)
    squares = constant + 2 * (effective * linear).real + np.abs(effective) ** 2 * square
    return np.asarray(np.sum(np.log1p(np.maximum(squares, 0.0)), axis=2))


def scan_globally(problem: InferenceProblem, base: Fit) -> list[Start]:
    """Scan for large effects, far from the axis.

    Parameters
    ----------
    problem : InferenceProblem
        Data and effects.
    base : Fit
        The fit to build on.

    Returns
    -------
    list of Start
        The best values of each component, by rising cost.
    """
    return _scan(problem, problem.context, problem.coarse, base, np.zeros(problem.nuisance_prior.size), SCAN_ERROR)


def scan_beside_nuisance(problem: InferenceProblem, base: Fit) -> list[Start]:
    """Scan for large effects half-way to the axis, beside the nuisance that was fitted without them.

    The nuisance takes up what shifts natural frequencies; what it cannot, stands out.

    Parameters
    ----------
    problem : InferenceProblem
        Data and effects.
    base : Fit
        The fit to build on.

    Returns
    -------
    list of Start
        The best values of each component, by rising cost.
    """
    context = replace(problem.context, contour=problem.middle.s)
    return _scan(problem, context, problem.middle, base, base.nuisance, NUISANCE_ERROR)


def list_components(effect: Effect, context: ModelContext) -> list[Component]:
    """List an effect at all its locations.

    Parameters
    ----------
    effect : Effect
        The effect.
    context : ModelContext
        Model, layout and tolerances.

    Returns
    -------
    list of Component
        One a location.
    """
    locations = effect.locations(context)
    return [Component(effect=effect, location=location, n_locations=len(locations)) for location in locations]


def _scan(
    problem: InferenceProblem,
    context: ModelContext,
    measured: TransferFunctions,
    base: Fit,
    nuisance: FloatArray,
    error: float,
) -> list[Start]:
    components = [component for effect in problem.effects.values() for component in list_components(effect, context)]
    weights = compute_weights(measured, error)
    response = base.hypothesis.respond(base.values, nuisance, measured.s)
    scan = partial(_scan_with_signatures, context, measured, base, response, weights)
    starts, without_signature = scan(components)
    starts.sort(key=lambda start: start.cost)
    starts += scan(_unlisted_neighbours(context, components, starts))[0]
    starts += [
        find_best_start(problem, base, component, measured, weights, nuisance) for component in without_signature
    ]
    return sorted(starts, key=lambda start: start.cost)


def _scan_with_signatures(
    context: ModelContext,
    measured: TransferFunctions,
    base: Fit,
    response: Response,
    weights: FloatArray,
    components: Sequence[Component],
) -> tuple[list[Start], list[Component]]:
    """Find the best values of components that have a signature, and list those that have none."""
    signatures = [component.effect.signature(context, component.location) for component in components]
    signed = [
        (component, signature)
        for component, signature in zip(components, signatures, strict=True)
        if signature is not None
    ]
    starts = scan_signatures(
        [component for component, _ in signed], [signature for _, signature in signed], response, base.hypothesis.basis,
        context.layout, measured, weights,
    )  # fmt: skip
    return starts, [component for component, signature in zip(components, signatures, strict=True) if signature is None]


def _unlisted_neighbours(
    context: ModelContext, components: Sequence[Component], starts: Sequence[Start]
) -> list[Component]:
    """List the neighbours of the best locations of each effect that are not among the scanned ones."""
    known = {component.key for component in components}
    counts, unlisted = Counter[str](), list[Component]()
    for start in starts:
        effect = start.component.effect
        counts[effect.name] += 1
        if counts[effect.name] > NEIGHBOURS_OF:
            continue
        for location in effect.neighbours(context, start.component.location):
            component = Component(effect=effect, location=location, n_locations=start.component.n_locations)
            if component.key not in known:
                known.add(component.key)
                unlisted.append(component)
    return unlisted


def find_best_start(
    problem: InferenceProblem,
    base: Fit,
    component: Component,
    measured: TransferFunctions,
    weights: FloatArray,
    nuisance: FloatArray,
) -> Start:
    """Try the values that an effect proposes to start from.

    Parameters
    ----------
    problem : InferenceProblem
        Data and effects.
    base : Fit
        The fit to build on.
    component : Component
        Effect and location.
    measured : TransferFunctions
        Transfer functions.
    weights : (n_points, n_frfs) array
        Over the squared misfit.
    nuisance : (n_nuisance,) array
        Nuisance parameters, in standard deviations.

    Returns
    -------
    Start
        The best of these values.
    """
    hypothesis = problem.make_hypothesis((*base.hypothesis.components, component), exact=False)
    grid = component.effect.start_values(problem.context, component.location)
    costs = []
    for values in grid:
        response = hypothesis.respond(np.concatenate([base.values, values]), nuisance, measured.s)
        costs.append(compute_robust_misfit(measured.values - response.values, weights))
    best = int(np.argmin(costs))
    return Start(component=component, values=grid[best], cost=costs[best])
