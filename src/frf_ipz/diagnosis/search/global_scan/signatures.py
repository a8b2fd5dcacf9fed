"""Wide search among effects that are one dynamic stiffness on one motion.

With a dynamic stiffness D on a motion p, the FRFs change by ``-R_sp D / (1 + R_pp D) R_ph``: for every line the misfit
is a quadratic of one complex number, whose three coefficients do not depend on the effect. All effects at all places,
for all values of their parameters, cost a few operations a line each.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.search.hypothesis import Cause

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.effect import Signature
    from frf_ipz.diagnosis.measured.transfer_functions import TransferFunctions
    from frf_ipz.diagnosis.physics.basis import Basis
    from frf_ipz.diagnosis.physics.layout import Layout
    from frf_ipz.diagnosis.physics.response import Response

AT_ONCE = 400  # motions: keeps arrays within some ten MB
AMPLITUDES = np.geomspace(1e-3, 300.0, 20)  # over the stiffness of the structure against the motion
CLOSER = tuple(np.geomspace(1 / step, step, 9) for step in (1.6, 1.1))  # times the best of them, twice
LARGEST_FLEXIBILITY = 2500  # DOFs up to which the static flexibility of all of them is found

Terms: TypeAlias = tuple[FloatArray, ComplexArray, FloatArray, ComplexArray]
"""Of the misfit of each line with a dynamic stiffness on a motion: constant, linear, square; and R_pp."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Start:
    """Where a fit may begin.

    Parameters
    ----------
    cause : Cause
        Effect and place.
    values : (n_parameters,) array
        Physical values of its parameters.
    cost : float
        Robust misfit there; the lower the better.
    """

    cause: Cause
    values: FloatArray
    cost: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Receptances:
    """FRFs to, from and at motions, on top of what is supposed already.

    Parameters
    ----------
    across : (n_points, n_frfs, n_motions) complex array
        R_sp R_ph as the channels show it.
    own : (n_points, n_motions) complex array
        R_pp.
    """

    across: ComplexArray
    own: ComplexArray


def receptances(base: Response, basis: Basis, layout: Layout, motions: FloatArray, rest: FloatArray) -> Receptances:
    """Evaluate FRFs of motions.

    Parameters
    ----------
    base : Response
        Of what is supposed already.
    basis : Basis
        Its coordinates.
    layout : Layout
        Sensors and blows.
    motions : (n_all, n_motions) array
        Weights of all DOFs.
    rest : (n_motions,) array
        Static flexibility that the basis lacks, m/N.

    Returns
    -------
    Receptances
        Of the motions.
    """
    shapes = motions.T @ basis.vectors @ base.modes.vectors
    left, right = np.matmul(shapes, base.output_motion), np.matmul(shapes, base.input_motion)
    across = left[:, :, layout.output_of] * right[:, :, layout.input_of] * base.chain[:, None, :]
    s, modes = base.s[:, None], base.modes
    damping = 2 * modes.ratio * np.sqrt(np.abs(modes.squares))
    own = (1 / (s**2 + s * damping + modes.squares)) @ (shapes**2).T + rest
    if base.attached_motion.shape[2]:
        felt = np.matmul(shapes, base.attached_motion)
        own = own - np.einsum("kpa,kab,kpb->kp", felt, base.attached_stiffness, felt)
    return Receptances(across=np.moveaxis(across, 1, 2), own=np.asarray(own))


def missing_flexibility(basis: Basis, motions: FloatArray) -> FloatArray:
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


def search_sketches(
    causes: Sequence[Cause], sketches: Sequence[Signature], base: Response, basis: Basis, layout: Layout,
    measured: TransferFunctions, weights: FloatArray,
) -> list[Start]:  # fmt: skip
    """Find the best values of each effect at each place.

    Parameters
    ----------
    causes : sequence of Cause
        What is tried.
    sketches : sequence of Signature
        The same as dynamic stiffness.
    base : Response
        Of what is supposed already.
    basis : Basis
        Its coordinates.
    layout : Layout
        Sensors and blows.
    measured : TransferFunctions
        Transfer functions on the contour of the sketches.
    weights : (n_points, n_frfs) array
        Over the squared misfit.

    Returns
    -------
    list of Start
        One a cause.
    """
    misfit = measured.values - base.values
    constant = np.sum(weights * np.abs(misfit) ** 2, 1)
    found = []
    for group in _by_motion(sketches):
        motions = np.stack([sketches[members[0]].motion for members in group], 1)
        parts = receptances(base, basis, layout, motions, missing_flexibility(basis, motions))
        linear = np.einsum("kf,kfp->kp", weights * misfit.conj(), parts.across)
        square = np.einsum("kf,kfp->kp", weights, np.abs(parts.across) ** 2)
        for column, members in enumerate(group):
            terms = constant, linear[:, column], square[:, column], parts.own[:, column]
            found += [_best(causes[member], sketches[member], terms) for member in members]
    return found


def _by_motion(sketches: Sequence[Signature]) -> Iterator[list[list[int]]]:
    """Sketches on the same motion share their receptances; motions come in handy numbers."""
    same: dict[bytes, list[int]] = {}
    for index, sketch in enumerate(sketches):
        same.setdefault(sketch.motion.tobytes(), []).append(index)
    groups = list(same.values())
    for start in range(0, len(groups), AT_ONCE):
        yield groups[start : start + AT_ONCE]


def _best(cause: Cause, sketch: Signature, terms: Terms) -> Start:
    own = terms[3]
    if sketch.amplitudes is None:
        scale = np.median(np.abs(own)) * np.median(np.abs(sketch.shapes), axis=1)
        amplitudes = AMPLITUDES[None, :] / scale[:, None]
    else:
        amplitudes = np.broadcast_to(sketch.amplitudes, (len(sketch.shapes), len(sketch.amplitudes)))
    costs = _costs(sketch.shapes, amplitudes, terms)
    shape, size = np.unravel_index(int(np.argmin(costs)), costs.shape)
    best, cost = amplitudes[shape, size], costs[shape, size]
    for closer in CLOSER if amplitudes.shape[1] > 1 else ():
        around = best * closer
        costs = _costs(sketch.shapes[shape, None], around[None], terms)[0]
        nearest = int(np.argmin(costs))
        best, cost = around[nearest], costs[nearest]
    values = sketch.values[shape].copy()
    if len(values):
        values[sketch.amplitude] *= best
    return Start(cause=cause, values=values, cost=float(cost))


def _costs(shapes: ComplexArray, amplitudes: FloatArray, terms: Terms) -> FloatArray:
    """Robust misfits of shapes times amplitudes, (n_shapes, n_amplitudes)."""
    constant, linear, square, own = terms
    stiffness = amplitudes[:, :, None] * shapes[:, None, :]
    effective = stiffness / (1 + own * stiffness)
    squares = constant + 2 * (effective * linear).real + np.abs(effective) ** 2 * square
    return np.asarray(np.sum(np.log1p(np.maximum(squares, 0.0)), axis=2))
