"""How good a predicted FRF is, and the trivial answer that every method must beat."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import eigh

from frf_ipz.arrays import ComplexArray, FloatArray

if TYPE_CHECKING:
    from frf_ipz.pairing.pairs import Pairs
    from frf_ipz.structure import ReducedModel


def error_db(found: ComplexArray, truth: ComplexArray) -> float:
    """Median over the lines of how far the magnitude is off, in dB either way."""
    return float(np.median(np.abs(20 * np.log10(np.abs(found) / np.abs(truth)))))


def correlations(found: ComplexArray, truth: ComplexArray) -> tuple[float, float]:
    """X_S (shape) and X_A (amplitude) of one FRF over its lines, Grafe's criteria; 1 is best."""
    inner = abs(np.vdot(truth, found))
    sizes = np.vdot(truth, truth).real, np.vdot(found, found).real
    return float(inner**2 / (sizes[0] * sizes[1])), float(2 * inner / sum(sizes))


def measured_poles_with_nominal_shapes(model: ReducedModel, pairs: Pairs) -> ReducedModel:
    """Put the measured poles into the nominal model: what anybody gets without updating."""
    values, shapes = eigh(model.stiffness, model.mass)
    sides = model.mass @ shapes
    inside = shapes.T @ model.damping @ shapes
    rates = np.diag(inside).copy()
    for pair in pairs.targets:
        if pair.kind == "pole":
            values[pair.computed] = abs(pair.measured_value) ** 2
            rates[pair.computed] = -2 * pair.measured_value.real
    damping = inside - np.diag(np.diag(inside)) + np.diag(rates)
    return replace(model, stiffness=_congruent(sides, np.diag(values)), damping=_congruent(sides, damping))


def _congruent(sides: FloatArray, inside: FloatArray) -> FloatArray:
    result = sides @ inside @ sides.T
    return np.asarray((result + result.T) / 2)
