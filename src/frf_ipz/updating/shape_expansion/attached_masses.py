"""Masses at ends and transducers, found before any pairing: by how well measured shapes then follow modes of the model.

The evidence is that of the directions of the measured shapes in the field of `random_forces`, times that of their
frequencies: a measured mode lies within a scatter of the modes that its shape is made of, or it is one that the model
does not have. Neither needs to know which mode belongs to which. The unknowns are one factor on the stiffness, the
masses, the scatter, and the error of the measured amplitudes; each has a prior, so that what the data do not tell
stays small.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.dofs import TRANSLATIONS, AnyDof, Dof
from frf_ipz.late_imports import import_late
from frf_ipz.updating.expansion import AttachedMass
from frf_ipz.updating.shape_expansion.random_forces import ModalModel, expand_shape, rows_of_ends

if TYPE_CHECKING:
    from collections.abc import Callable

    from scipy import optimize

    from frf_ipz.arrays import FloatArray
    from frf_ipz.structure import Geometry, ReducedModel
    from frf_ipz.updating.shape_expansion.measured_shapes import MeasuredShapes
else:
    optimize = import_late("scipy.optimize")

STIFFNESS_STD = 0.05  # of the logarithm: 3 % of a modulus over density, and 2 % of a thickness, which counts twice
SHARE_STD = 0.3  # of the mass that a mode has at the place: what is attached is the smaller part
LIKELY_ERROR, ERROR_STD = 0.1, 1.0  # of the measured amplitudes; median, and std of the logarithm
STRANGE = 0.05  # probability that a measured mode is none of the model's
LIKELY_SCATTER, SCATTER_STD = 0.03, 1.5  # of the logarithms of frequencies: of a good model; std of its own logarithm
STARTS = (0.1, 0.03, 0.01)  # scatters to start from: what a drawing promises, a good model, a very good one
FEW = 0.3  # masses to start from, in their deviation: little is attached
DIFFERENCE = 1e-5  # of an unknown, of size 1: between rounding and curvature
EVEN, FLAT = 1e-14, 1e-6  # relative decrease and slope of the evidence where it has converged: what differences tell
MOST_PLACES = 8
FARTHEST = 30.0  # that an unknown is searched, in deviations of its prior: no data outweigh it, no number overflows
RIGID = 1e-3  # of the lowest measured frequency: a mode of the model below is one of a rigid body, but for rounding
STEP = 0.05  # of a logarithm, over which the curvature of the evidence is taken
Q90 = 1.645


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoadedModel:
    """A reduced model with the masses that were found.

    Parameters
    ----------
    model : ReducedModel
        With them.
    stiffness_ratio : float
        Over that of the model before.
    masses : tuple of AttachedMass
        What was found.
    error : float
        Relative error of the measured amplitudes.
    scatter : float
        Of the logarithms of measured frequencies about those of the model.
    """

    model: ReducedModel
    stiffness_ratio: float
    masses: tuple[AttachedMass, ...]
    error: float
    scatter: float


def attachment_places(model: ReducedModel, measured: MeasuredShapes, geometry: Geometry | None) -> tuple[AnyDof, ...]:
    """Choose where things may be attached: at free ends of lines, and at the transducers that stay in place.

    Of sensors and excited DOFs the side with fewer stays, as a roving hammer or sensor leaves nothing behind.

    Parameters
    ----------
    model : ReducedModel
        The model.
    measured : MeasuredShapes
        Names the sensors and excited DOFs.
    geometry : Geometry, optional
        Nodes and the lines between them.

    Returns
    -------
    tuple of Dof or PortDof
        Unsigned; none where there are more than can be told apart.
    """
    staying = measured.outputs if len(measured.outputs) < len(measured.inputs) else measured.inputs
    places = [dof.unsigned for dof in staying]
    directions = {dof.direction for dof in places if isinstance(dof, Dof)} & set(TRANSLATIONS)
    if geometry is not None and len(geometry.lines):
        nodes, counts = np.unique(np.asarray(geometry.lines), return_counts=True)
        ends = [Dof(int(node), direction) for node in nodes[counts == 1] for direction in sorted(directions)]
        places = [*[dof for dof in ends if dof in model.expanded_dofs], *places]
    chosen = tuple(dict.fromkeys(places))
    return chosen if len(chosen) <= MOST_PLACES else ()


def find_attached_masses(model: ReducedModel, measured: MeasuredShapes, places: tuple[AnyDof, ...]) -> LoadedModel:
    """Find masses by the evidence of measured frequencies and shapes.

    Parameters
    ----------
    model : ReducedModel
        The model without them.
    measured : MeasuredShapes
        What was measured.
    places : tuple of Dof or PortDof
        Where there may be one.

    Returns
    -------
    LoadedModel
        The most likely masses; the model as it is but for the factor on its stiffness where there is no place.
    """
    rows = np.array([model.row(place) for place in places]).reshape(len(places), len(model.mass))
    felt = len(model.mass) / np.einsum("ij,jk,ik->i", rows, np.linalg.inv(model.mass), rows)
    count = len(places)
    typical = np.concatenate([[0.0], np.zeros(count), np.log([LIKELY_ERROR, LIKELY_SCATTER])])
    deviations = np.array([STIFFNESS_STD, *[1.0] * count, ERROR_STD, SCATTER_STD])
    ends = rows_of_ends(model, measured)

    def masses_of(unknowns: FloatArray) -> FloatArray:
        return np.asarray(SHARE_STD * felt * unknowns[..., 1 : 1 + count])

    def loaded(unknowns: FloatArray) -> tuple[FloatArray, FloatArray]:
        added = (rows.T * masses_of(unknowns)[..., None, :]) @ rows
        return model.mass + added, np.exp(unknowns[..., 0, None, None]) * model.stiffness

    def cost(unknowns: FloatArray) -> FloatArray:
        error, scatter = np.exp(unknowns[..., 1 + count]), np.exp(unknowns[..., 2 + count])
        modal = ModalModel.of_matrices(*loaded(unknowns), *ends, scatter)
        prior = 0.5 * np.sum(((unknowns - typical) / deviations) ** 2, axis=-1)
        return np.asarray(prior - _log_evidence(modal, measured, error))

    def with_slope(unknowns: FloatArray) -> tuple[float, FloatArray]:
        steps = DIFFERENCE * np.eye(len(unknowns))
        after, before = cost(unknowns + np.stack([steps, -steps]))
        return float(cost(unknowns)), np.asarray((after - before) / (2 * DIFFERENCE))

    least, most = typical - FARTHEST * deviations, typical + FARTHEST * deviations
    least[1 : 1 + count] = 0.0
    few = typical + np.concatenate([[0.0], np.full(count, FEW), [0.0, 0.0]])
    starts = [np.concatenate([few[:-1], [np.log(scatter)]]) for scatter in STARTS]
    optima = [
        optimize.minimize(
            with_slope,
            start,
            jac=True,
            method="L-BFGS-B",
            bounds=optimize.Bounds(least, most),
            options={"ftol": EVEN, "gtol": FLAT},
        )
        for start in starts
    ]
    best = np.asarray(min(optima, key=lambda optimum: optimum.fun).x)
    std = _deviations(cost, best, deviations)
    low, middle, high = (masses_of(np.maximum(best + width * std, 0.0)) for width in (-Q90, 0.0, Q90))
    masses = [
        AttachedMass(place=place.name, mass_kg=float(mass), low_kg=float(lowest), high_kg=float(highest))
        for place, mass, lowest, highest in zip(places, middle, low, high, strict=True)
    ]
    mass, stiffness = loaded(best)
    return LoadedModel(
        model=replace(model, mass=mass, stiffness=stiffness),
        stiffness_ratio=float(np.exp(best[0])),
        masses=tuple(masses),
        error=float(np.exp(best[-2])),
        scatter=float(np.exp(best[-1])),
    )


def _log_evidence(model: ModalModel, measured: MeasuredShapes, error: FloatArray) -> FloatArray:
    """Logarithm of the probability of all directions and frequencies, (...)."""
    elastic = model.omega > RIGID * measured.omega.min()
    omega_of_model = np.where(elastic, model.omega, np.inf)
    total = np.zeros(model.omega.shape[:-1])
    for mode, omega in enumerate(measured.omega):
        shape = expand_shape(model, measured, mode, error)
        shares = shape.amplitudes**2 / np.sum(shape.amplitudes**2, axis=-1, keepdims=True)
        distance = np.log(omega_of_model / omega) / model.scatter[..., None]
        density = np.sum(shares * np.exp(-0.5 * distance**2), axis=-1) / model.scatter
        total += shape.log_evidence + np.log(density + STRANGE)
    return total


def _deviations(cost: Callable[[FloatArray], FloatArray], best: FloatArray, prior: FloatArray) -> FloatArray:
    """Give standard deviations by the curvature; no more than those of the prior."""
    steps = STEP * np.eye(len(best))
    twice = steps[:, None] + steps  # (n, n, n)
    apart = steps[:, None] - steps
    corners = cost(best + np.stack([twice, apart, -apart, -twice]))
    hessian = (corners[0] - corners[1] - corners[2] + corners[3]) / (2 * STEP) ** 2
    values, vectors = np.linalg.eigh(hessian * np.outer(prior, prior))
    covariance = (vectors / np.maximum(values, 1.0)) @ vectors.T
    return np.asarray(prior * np.sqrt(np.diag(covariance)))
