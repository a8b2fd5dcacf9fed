"""First poles: a stabilisation diagram over model orders, and those of its poles that keep coming back.

The choice is generous. LSCF poles are biased by noise, most of all in damping: they are only where the likelihood
starts.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray
from frf_ipz.numerics.polyreference import denominator, denominator_roots, participation, reduced_normal_matrix
from frf_ipz.rational import damping_ratio, natural_frequency_hz

if TYPE_CHECKING:
    from frf_ipz.frf import FrfSet
    from frf_ipz.identification.measured_lines import MeasuredLines

ORDERS = 10  # model orders in the diagram, evenly spaced
TOP_POLES = 150  # poles of the highest order, conjugates counted: twice what a band of a test mostly holds
TOP_ORDER = (24, 100)  # bounds of the highest order
LINES_A_COEFFICIENT = 4  # lines that each coefficient needs
STABLE_FREQUENCY, STABLE_DAMPING, STABLE_SHAPE = 5e-3, 0.6, 0.9  # agreement with the next lower order: relative, MAC
OFFSET_BAND = 0.25  # lowest over highest frequency: above, the band alone is mapped onto the circle
CIRCLE = 0.9  # part of the circle that such a band covers
MOST_DAMPING = 0.25  # damping ratio of a pole that may be a mode
MOST_REFERENCES = 12  # more references make the orders too low


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Start:
    """Where the likelihood starts.

    Parameters
    ----------
    poles : (n_poles,) complex array
        rad/s, by ascending frequency.
    table : DataFrame
        The stabilisation diagram, as `ModalFit.stabilization`.
    """

    poles: ComplexArray
    table: pd.DataFrame


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _OrderPoles:
    order: int
    poles: ComplexArray
    shapes: ComplexArray


def start_poles(frfs: FrfSet, lines: MeasuredLines, *, max_order: int | None = None) -> Start:
    """Find first poles by polyreference LSCF.

    Parameters
    ----------
    frfs : FrfSet
        Measured FRFs; tells which sensor and blow each belongs to.
    lines : MeasuredLines
        What is fitted.
    max_order : int, optional
        Highest model order.

    Returns
    -------
    Start
        Poles and stabilisation diagram.
    """
    H = _rows_and_references(frfs, lines)
    n_ref = H.shape[2]
    top = max_order or int(np.clip(TOP_POLES // n_ref, *TOP_ORDER))
    top = max(2, min(top, 2 * len(lines.s) // (LINES_A_COEFFICIENT * n_ref)))
    circle = _Circle.of(lines)
    M = reduced_normal_matrix(circle.angles(lines.s), H, top, real=circle.real)
    orders = np.unique(np.linspace(max(2, top // 4), top, ORDERS).astype(int))
    found = [_poles_of_order(M, n_ref, int(order), circle, lines) for order in orders]
    stable = [np.zeros((3, len(found[0].poles)), bool)]
    stable += [_stability(low, high) for low, high in pairwise(found)]
    return Start(poles=found[-1].poles, table=_table(found, stable))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Circle:
    """How frequencies are mapped onto the unit circle: angle = rate (omega - origin)."""

    origin: float
    rate: float
    sigma: float
    real: bool

    @staticmethod
    def of(lines: MeasuredLines) -> _Circle:
        low, high = (2 * np.pi * hz for hz in lines.band_hz)
        sigma = float(lines.s[0].real)
        if low < OFFSET_BAND * high:
            return _Circle(origin=0.0, rate=np.pi / high, sigma=sigma, real=True)
        return _Circle(origin=low, rate=2 * np.pi * CIRCLE / (high - low), sigma=sigma, real=False)

    def angles(self, s: ComplexArray) -> FloatArray:
        return np.asarray(self.rate * (s.imag - self.origin))

    def poles(self, z: ComplexArray) -> ComplexArray:
        with np.errstate(divide="ignore", invalid="ignore"):  # z = 0 is a pole at infinity, which no band holds
            return np.asarray(-np.log(z) / self.rate + 1j * self.origin + self.sigma)


def _rows_and_references(frfs: FrfSet, lines: MeasuredLines) -> ComplexArray:
    """FRFs as accelerances with the smaller side last; rows are alike in noise.

    All lines weigh the same: where the noise follows the peaks, its weights would hide the modes.
    """
    scaled = lines.s / abs(lines.s[-1])
    values = lines.receptance * scaled[:, None] ** 2
    weights = lines.weighted()
    rows = {dof: index for index, dof in enumerate(frfs.output_dofs)}
    columns = {dof: index for index, dof in enumerate(frfs.input_dofs)}
    if len(rows) * len(columns) != frfs.n_frfs or min(len(rows), len(columns)) > MOST_REFERENCES:
        return np.asarray((values * weights.gain)[:, :, None])
    H = np.zeros((len(values), len(rows), len(columns)), complex)
    gain = np.zeros((len(rows), len(columns)))
    for index, label in enumerate(frfs.labels):
        place = rows[label.output_dof], columns[label.input_dof]
        H[:, *place], gain[place] = values[:, index], np.log(weights.gain[index])
    if len(columns) > len(rows):
        H, gain = H.transpose(0, 2, 1), gain.T
    across = gain.mean(axis=1, keepdims=True)
    return np.asarray(H * np.exp(across + (gain - across).mean(axis=0)))


def _poles_of_order(M: ComplexArray, n_ref: int, order: int, circle: _Circle, lines: MeasuredLines) -> _OrderPoles:
    D = denominator(M, n_ref, order)
    z = denominator_roots(D)
    poles = circle.poles(z)
    low, high = (2 * np.pi * hz for hz in lines.band_hz)
    inside = (poles.real < 0) & (poles.imag > low) & (poles.imag < high) & (damping_ratio(poles) < MOST_DAMPING)
    kept = np.flatnonzero(inside)
    kept = kept[np.argsort(poles.imag[kept])]
    return _OrderPoles(order=order, poles=poles[kept], shapes=participation(D, z[kept]))


def _alike(poles: ComplexArray, others: ComplexArray) -> tuple[BoolArray, BoolArray]:
    """Which poles agree with which others in frequency, and in damping too."""
    frequency = np.abs(np.abs(poles)[:, None] - np.abs(others)) < STABLE_FREQUENCY * np.abs(poles)[:, None]
    damping = np.abs(others.real - poles.real[:, None]) < STABLE_DAMPING * np.abs(poles.real)[:, None]
    return frequency, frequency & damping


def _stability(low: _OrderPoles, high: _OrderPoles) -> BoolArray:
    frequency, damping = _alike(high.poles, low.poles)
    assurance = np.abs(high.shapes.conj() @ low.shapes.T) ** 2
    shape = damping & (assurance > STABLE_SHAPE)
    return np.stack([frequency.any(axis=1), damping.any(axis=1), shape.any(axis=1)])


def _table(found: list[_OrderPoles], stable: list[BoolArray]) -> pd.DataFrame:
    poles = np.concatenate([order.poles for order in found])
    marks = np.concatenate(stable, axis=1)
    return pd.DataFrame(
        {
            "order": np.repeat([order.order for order in found], [len(order.poles) for order in found]),
            "frequency_hz": natural_frequency_hz(poles),
            "damping_ratio": damping_ratio(poles),
            "stable_frequency": marks[0],
            "stable_damping": marks[1],
            "stable_shape": marks[2],
            "taken": np.arange(len(poles)) >= len(poles) - len(found[-1].poles),
        }
    )
