"""Global scan for large effects: all of them at all locations for many values, far from the axis, where all is smooth.

Many effects are one dynamic stiffness D on one motion p. The FRFs then change by ``-R_sp D / (1 + R_pp D) R_ph``: for
every line the misfit is a quadratic of one complex number, whose three coefficients do not depend on the effect. All
such effects at all locations, for all values of their parameters, cost a few operations a line each. What acts on
several motions alike, a mass in all directions, is as many such numbers, of the principal axes of R_pp. Sensors that
sit elsewhere read other rows of the same modal motion: all of them at all nodes are one product. The others are
evaluated value by value. Misfits count by their logarithm.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.diagnosis.evidence.hypothesis import Component
from frf_ipz.diagnosis.evidence.inference_problem import InferenceProblem, compute_weights
from frf_ipz.diagnosis.model.motion import Motion, stack_motions
from frf_ipz.diagnosis.search.places import search_places
from frf_ipz.diagnosis.search.robust_refinement import Start, compute_robust_misfit

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.effect import Effect, Reading, Signature
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.evidence.fit import Fit
    from frf_ipz.diagnosis.measured.transfer_functions import TransferFunctions
    from frf_ipz.diagnosis.model.basis import Basis
    from frf_ipz.diagnosis.model.layout import Layout
    from frf_ipz.diagnosis.model.response import Response

MOTIONS_AT_ONCE = 400  # motions: keeps arrays within some ten MB
VALUES_AT_ONCE = 400_000  # complex numbers: the same
AMPLITUDES = np.geomspace(1e-3, 300.0, 20)  # over the stiffness of the structure against the motion
FINER_STEPS = tuple(np.geomspace(1 / step, step, 9) for step in (1.6, 1.1))  # times the best of them, twice
LARGEST_FLEXIBILITY = 2500  # DOFs up to which the static flexibility of all of them is found
SCAN_ERROR = 0.02  # of an FRF's size: what counts as a misfit far from the axis
NUISANCE_ERROR = 0.1  # the same where the nuisance was fitted
NEIGHBOURS_OF = 16  # best locations of each effect whose neighbours are scanned, where not all locations are listed


Terms: TypeAlias = tuple[FloatArray, ComplexArray, ComplexArray, ComplexArray]
"""Of the misfit of each line with a dynamic stiffness on the motions of each location: constant, (n_points,); linear,
(n_locations, n_axes, n_points); square, (n_locations, n_axes, n_axes, n_points); and R_pp, as linear."""


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
    base: Response, basis: Basis, layout: Layout, motions: Sequence[Motion], missing_flexibility: FloatArray
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
    motions : sequence of Motion
        Where effects act.
    missing_flexibility : (n_motions,) array
        Static flexibility that the basis lacks, m/N.

    Returns
    -------
    Receptances
        Of the motions.
    """
    shapes = basis.project_motions(motions) @ base.modes.vectors
    from_outputs, from_inputs = np.matmul(shapes, base.output_motion), np.matmul(shapes, base.input_motion)
    across = from_outputs[:, :, layout.output_index] * from_inputs[:, :, layout.input_index] * base.chain[:, None, :]
    at_motions = _modal_receptances(base) @ (shapes**2).T + missing_flexibility
    if base.attached_motion.shape[2]:
        at_attachments = np.matmul(shapes, base.attached_motion)
        at_motions = at_motions - np.einsum("kpa,kab,kpb->kp", at_attachments, base.attached_stiffness, at_attachments)
    return Receptances(across=np.moveaxis(across, 1, 2), at_motions=np.asarray(at_motions))


def evaluate_on_axes(
    base: Response, basis: Basis, layout: Layout, locations: Sequence[tuple[Motion, ...]]
) -> Receptances:
    """Evaluate FRFs of the motions of locations, along the principal axes of the receptance of each.

    Parameters
    ----------
    base : Response
        Of the fit to build on.
    basis : Basis
        Its coordinates.
    layout : Layout
        Sensors and excited points.
    locations : sequence of tuple of Motion
        As many motions for each, on which the same dynamic stiffness acts.

    Returns
    -------
    Receptances
        With a last axis for the axes, (n_points, n_frfs, n_locations, n_axes) and (n_points, n_locations, n_axes): a
        dynamic stiffness acts along each of them as if it were alone.
    """
    motions, n_axes = [motion for of_location in locations for motion in of_location], len(locations[0])
    missing = compute_missing_flexibility(basis, motions)
    if n_axes == 1:
        alone = evaluate_receptances(base, basis, layout, motions, missing)
        return Receptances(across=alone.across[..., None], at_motions=alone.at_motions[..., None])
    shapes = (basis.project_motions(motions) @ base.modes.vectors).reshape(len(locations), n_axes, -1)
    between = (shapes[:, :, None] * shapes[:, None]).reshape(-1, shapes.shape[2])
    at_motions = (_modal_receptances(base) @ between.T).reshape(-1, len(locations), n_axes, n_axes)
    at_motions += missing.reshape(-1, n_axes, 1) * np.eye(n_axes)
    if base.attached_motion.shape[2]:
        at_attachments = shapes @ base.attached_motion[:, None]
        at_motions -= at_attachments @ base.attached_stiffness[:, None] @ at_attachments.swapaxes(2, 3)
    along_axes, axes = np.linalg.eig(at_motions)
    from_outputs = axes.swapaxes(2, 3) @ (shapes @ base.output_motion[:, None])
    from_inputs = np.linalg.solve(axes, shapes @ base.input_motion[:, None])
    across = from_outputs[..., layout.output_index] * from_inputs[..., layout.input_index]
    return Receptances(across=np.moveaxis(across * base.chain[:, None, None], 3, 1), at_motions=np.asarray(along_axes))


def _modal_receptances(base: Response) -> ComplexArray:
    """Receptance of each mode by itself, (n_points, q)."""
    s, modes = base.s[:, None], base.modes
    return np.asarray(1 / (s**2 + s * 2 * modes.ratio * np.sqrt(np.abs(modes.squares)) + modes.squares))


def compute_missing_flexibility(basis: Basis, motions: Sequence[Motion]) -> FloatArray:
    """Find the static flexibility of motions that a basis lacks.

    Parameters
    ----------
    basis : Basis
        Of the nominal model.
    motions : sequence of Motion
        Where effects act.

    Returns
    -------
    (n_motions,) array
        m/N; zero for models that are too large.
    """
    model, shift = basis.model, basis.modes.shift
    n_free = int(np.count_nonzero(~model.fixed))
    if n_free > LARGEST_FLEXIBILITY:
        return np.zeros(len(motions))
    free = stack_motions(motions, len(model.all_dofs)).toarray()[~model.fixed]
    used = np.flatnonzero(np.abs(free).max(1) > 0)
    loads = np.zeros((n_free, len(used)))
    loads[used, np.arange(len(used))] = 1.0
    flexibility = basis.modes.factor.solve(loads)[used]
    whole = np.sum(free[used] * (flexibility @ free[used]), 0)
    shapes = basis.project_motions(motions)
    inside = np.sum(shapes * np.linalg.solve(basis.stiffness + shift * np.eye(len(basis.stiffness)), shapes.T).T, 1)
    return np.asarray(np.maximum(whole - inside, 0.0))


def read_elsewhere(
    base: Response, basis: Basis, layout: Layout, local: FloatArray, channel: str, motions: Sequence[Motion]
) -> tuple[IntArray, ComplexArray]:
    """Evaluate the FRFs of a channel that reads other motions.

    Parameters
    ----------
    base : Response
        Of the fit to build on.
    basis : Basis
        Its coordinates.
    layout : Layout
        Sensors and excited points.
    local : (n_frfs,) array
        Error of the local compliance of each FRF, m/N, as in the base.
    channel : str
        An output.
    motions : sequence of Motion
        What it might read.

    Returns
    -------
    frfs : (n,) int array
        Indices of the channel's FRFs.
    values : (n_points, n, n_motions) complex array
        These FRFs with each motion.
    """
    of_channel = np.array([name == channel for name, _ in layout.outputs])
    frfs = np.flatnonzero(of_channel[layout.output_index])
    shapes = basis.project_motions(motions) @ base.modes.vectors
    receptance = np.matmul(shapes, base.input_motion)[:, :, layout.input_index[frfs]] + local[frfs]
    return frfs, np.asarray(np.moveaxis(receptance, 1, 2) * base.chain[:, frfs, None])


def group_readings(readings: Sequence[Reading]) -> Iterator[tuple[str, list[int]]]:
    """Group readings of the same channel, as many at once as fit into memory.

    Parameters
    ----------
    readings : sequence of Reading
        Of any channels.

    Yields
    ------
    channel : str
        Whose readings they are.
    indices : list of int
        Of these readings.
    """
    channels: dict[str, list[int]] = {}
    for index, reading in enumerate(readings):
        channels.setdefault(reading.channel, []).append(index)
    for channel, indices in channels.items():
        for start in range(0, len(indices), MOTIONS_AT_ONCE):
            yield channel, indices[start : start + MOTIONS_AT_ONCE]


def _scan_readings(
    components: Sequence[Component], readings: Sequence[Reading], base: Response, basis: Basis, layout: Layout,
    local: FloatArray, measured: TransferFunctions, weights: FloatArray,
) -> list[Start]:  # fmt: skip
    """Find the cost of each channel reading another motion."""
    squares = weights * np.abs(measured.values - base.values) ** 2
    starts = []
    for channel, members in group_readings(readings):
        motions = [readings[member].motion for member in members]
        frfs, values = read_elsewhere(base, basis, layout, local, channel, motions)
        changed = np.sum(weights[:, frfs, None] * np.abs(measured.values[:, frfs, None] - values) ** 2, axis=1)
        other_frfs = np.sum(np.delete(squares, frfs, axis=1), axis=1)
        costs = np.sum(np.log1p(other_frfs[:, None] + changed), axis=0)
        starts += [
            Start(component=components[member], values=np.zeros(0), cost=float(cost))
            for member, cost in zip(members, costs, strict=True)
        ]
    return starts


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
        receptances = evaluate_on_axes(base, basis, layout, [signatures[members[0]].motions for members in group])
        across = np.ascontiguousarray(receptances.across.transpose(0, 2, 3, 1))
        weighted = weights[:, None, None] * across.conj()
        linear = np.moveaxis(across @ (weights * misfit.conj())[:, None, :, None], 0, 3)[:, :, 0]
        square = np.moveaxis(across @ weighted.swapaxes(2, 3), 0, 3)
        at_motions = np.moveaxis(receptances.at_motions, 0, 2)
        columns = {member: column for column, members in enumerate(group) for member in members}
        for members in _group_by_shape(signatures, columns):
            used = [columns[member] for member in members]
            terms = constant, linear[used], square[used], at_motions[used]
            values, costs = _best_amplitudes([signatures[member] for member in members], terms)
            starts += [
                Start(component=components[member], values=values_there, cost=cost)
                for member, values_there, cost in zip(members, values, costs.tolist(), strict=True)
            ]
    return starts


def _group_by_motion(signatures: Sequence[Signature]) -> Iterator[list[list[int]]]:
    """Signatures on the same motions share their receptances; motions come in groups that fit into memory."""
    members: dict[int, dict[tuple[Motion, ...], list[int]]] = {}
    for index, signature in enumerate(signatures):
        motions = signature.motions
        members.setdefault(len(motions), {}).setdefault(motions, []).append(index)
    for count, of_motions in members.items():
        groups, at_once = list(of_motions.values()), MOTIONS_AT_ONCE // count
        for start in range(0, len(groups), at_once):
            yield groups[start : start + at_once]


def _group_by_shape(signatures: Sequence[Signature], members: Iterable[int]) -> Iterator[list[int]]:
    """Signatures with as many shapes and amplitudes are scanned at once, as many as fit into memory."""
    alike: dict[tuple[int, int], list[int]] = {}
    for member in members:
        signature = signatures[member]
        count = 0 if signature.amplitudes is None else len(signature.amplitudes)  # 0: those of all
        alike.setdefault((len(signature.shapes), count), []).append(member)
    for (n_shapes, count), indices in alike.items():
        n_points = signatures[indices[0]].shapes.shape[1]
        at_once = max(VALUES_AT_ONCE // (n_shapes * (count or len(AMPLITUDES)) * n_points), 1)
        for start in range(0, len(indices), at_once):
            yield indices[start : start + at_once]


def _best_amplitudes(signatures: Sequence[Signature], terms: Terms) -> tuple[list[FloatArray], FloatArray]:
    """Values of the parameters, and robust misfit, of each signature at its best."""
    at_motion, number = terms[3], np.arange(len(signatures))
    shapes = np.stack([signature.shapes for signature in signatures])
    if signatures[0].amplitudes is None:
        compliance = np.median(np.abs(at_motion), axis=2).max(axis=1)
        scale = compliance[:, None] * np.median(np.abs(shapes), axis=2)
        amplitudes = AMPLITUDES / scale[:, :, None]
    else:
        stated = np.array([signature.amplitudes for signature in signatures], float)
        amplitudes = np.broadcast_to(stated[:, None], (*shapes.shape[:2], stated.shape[1]))
    costs = _costs(shapes, amplitudes, terms).reshape(len(signatures), -1)
    shape, size = np.unravel_index(np.argmin(costs, axis=1), amplitudes.shape[1:])
    best, cost = amplitudes[number, shape, size], costs.min(axis=1)
    for factors in FINER_STEPS if amplitudes.shape[2] > 1 else ():
        finer = best[:, None] * factors
        costs = _costs(shapes[number, shape][:, None], finer[:, None], terms)[:, 0]
        nearest = np.argmin(costs, axis=1)
        best, cost = finer[number, nearest], costs[number, nearest]
    values = [signature.values[index].copy() for signature, index in zip(signatures, shape.tolist(), strict=True)]
    for signature, values_there, amplitude in zip(signatures, values, best.tolist(), strict=True):
        if len(values_there):
            values_there[signature.amplitude] *= amplitude
    return values, cost


def _costs(shapes: ComplexArray, amplitudes: FloatArray, terms: Terms) -> FloatArray:
    """Robust misfits of shapes times amplitudes, (n_motions, n_shapes, n_amplitudes)."""
    constant, linear, square, at_motion = (term[:, None, None] if term.ndim > 1 else term for term in terms)
    stiffness = amplitudes[..., None] * shapes[:, :, None]
    n_axes, squares = at_motion.shape[3], constant
    effective = [stiffness / (1 + at_motion[..., axis, :] * stiffness) for axis in range(n_axes)]
    for axis, along in enumerate(effective):
        squares = (
            squares + 2 * (along * linear[..., axis, :]).real + np.abs(along) ** 2 * square[..., axis, axis, :].real
        )
        for other in range(axis):
            squares += 2 * (along * effective[other].conj() * square[..., axis, other, :]).real
    return np.asarray(np.sum(np.log1p(np.maximum(squares, 0.0)), axis=3))


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
    basis, layout = base.hypothesis.basis, context.layout

    local = problem.nuisance_prior.unpack(nuisance).local

    def evaluate(some: Sequence[Component]) -> list[Start]:
        problem.deadline.check()
        shown = show_components(context, some)
        return [
            *scan_signatures(*shown.signed, response, basis, layout, measured, weights),
            *_scan_readings(*shown.read, response, basis, layout, local, measured, weights),
            *(find_best_start(problem, base, component, measured, weights, nuisance) for component in shown.unshown),
        ]

    starts = search_places(context, problem.nuisance_prior.n_modes, components, evaluate)
    starts.sort(key=lambda start: start.cost)
    starts += evaluate(_unlisted_neighbours(context, components, starts))
    return sorted(starts, key=lambda start: start.cost)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ShownComponents:
    """Components by how they show in the FRFs.

    Parameters
    ----------
    signed : tuple of (list of Component, list of Signature)
        Those that are a dynamic stiffness on a motion.
    read : tuple of (list of Component, list of Reading)
        Those that are another motion that a channel reads.
    unshown : list of Component
        The others, which are evaluated one by one.
    """

    signed: tuple[list[Component], list[Signature]]
    read: tuple[list[Component], list[Reading]]
    unshown: list[Component]


def show_components(context: ModelContext, components: Iterable[Component]) -> ShownComponents:
    """Sort components by how they show in the FRFs.

    Parameters
    ----------
    context : ModelContext
        Its contour is where signatures are evaluated.
    components : iterable of Component
        Effects at their locations.

    Returns
    -------
    ShownComponents
        The same components.
    """
    shown = ShownComponents(signed=([], []), read=([], []), unshown=[])
    for component in components:
        signature = component.effect.signature(context, component.location)
        reading = component.effect.reading(context, component.location) if signature is None else None
        if signature is not None:
            shown.signed[0].append(component)
            shown.signed[1].append(signature)
        elif reading is not None:
            shown.read[0].append(component)
            shown.read[1].append(reading)
        else:
            shown.unshown.append(component)
    return shown


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
