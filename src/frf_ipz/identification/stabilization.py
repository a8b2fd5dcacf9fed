"""Start poles: a stabilisation diagram over model orders, and the poles of its highest order.

The choice is generous. LSCF poles are biased by noise, most of all in damping: the likelihood only starts from them.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray
from frf_ipz.identification.options import Stability
from frf_ipz.late_imports import import_late
from frf_ipz.numerics.polyreference import denominator, denominator_roots, participation, reduced_normal_matrix
from frf_ipz.rational import damping_ratio, natural_frequency_hz

if TYPE_CHECKING:
    import pandas as pd

    from frf_ipz.frf import FrfSet
    from frf_ipz.identification.measured_lines import MeasuredLines
else:
    pd = import_late("pandas")

MOST_ORDERS = 50  # of the diagram: orders are one apart, and two where there would be more
TOP_POLES = 150  # poles of the highest order, conjugates counted: twice what the band of a test usually holds
TOP_ORDER = (24, 100)  # bounds of the highest order
LINES_PER_COEFFICIENT = 4  # lines that each coefficient needs
OFFSET_BAND = 0.25  # lowest over highest frequency: above, the band alone is mapped onto the circle
CIRCLE = 0.9  # part of the circle that such a band covers
MAX_DAMPING = 0.25  # damping ratio of a pole that may be a mode
MAX_REFERENCES = 12  # more references make the orders too low


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StartPoles:
    """Poles that the likelihood starts from.

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


def find_start_poles(
    frfs: FrfSet, lines: MeasuredLines, *, max_order: int | None = None, stability: Stability | None = None
) -> StartPoles:
    """Find start poles by polyreference LSCF.

    Parameters
    ----------
    frfs : FrfSet
        Measured FRFs; their labels give sensor and excited DOF of each.
    lines : MeasuredLines
        The lines that are fitted.
    max_order : int, optional
        Highest model order.
    stability : Stability, optional
        Tolerances of the diagram; without them there is no diagram, and the table holds the start only.

    Returns
    -------
    StartPoles
        Poles and stabilisation diagram.
    """
    H = _rows_by_references(frfs, lines)
    n_ref = H.shape[2]
    top = max_order or int(np.clip(TOP_POLES // n_ref, *TOP_ORDER))
    top = max(2, min(top, 2 * len(lines.s) // (LINES_PER_COEFFICIENT * n_ref)))
    circle = _CircleMap.of_lines(lines)
    M = reduced_normal_matrix(circle.angles(lines.s), H, top, real=circle.real)
    step = 1 if top <= MOST_ORDERS else 2
    orders = [top] if stability is None else range(top, 1, -step)
    diagram = [_poles_of_order(M, n_ref, order, circle, lines) for order in sorted(orders)]
    stable = [np.zeros((3, len(diagram[0].poles)), bool)]
    stable += [_stability(low, high, stability or Stability()) for low, high in pairwise(diagram)]
    return StartPoles(poles=diagram[-1].poles, table=_diagram_table(diagram, stable))


@dataclass(frozen=True, slots=True, kw_only=True)
class _CircleMap:
    """Map of frequencies onto the unit circle: angle = rate (omega - origin)."""

    origin: float
    rate: float
    sigma: float
    real: bool

    @staticmethod
    def of_lines(lines: MeasuredLines) -> _CircleMap:
        low, high = (2 * np.pi * hz for hz in lines.band_hz)
        sigma = float(lines.s[0].real)
        if low < OFFSET_BAND * high:
            return _CircleMap(origin=0.0, rate=np.pi / high, sigma=sigma, real=True)
        return _CircleMap(origin=low, rate=2 * np.pi * CIRCLE / (high - low), sigma=sigma, real=False)

    def angles(self, s: ComplexArray) -> FloatArray:
        return np.asarray(self.rate * (s.imag - self.origin))

    def poles(self, z: ComplexArray) -> ComplexArray:
        with np.errstate(divide="ignore", invalid="ignore"):  # z = 0 is a pole at infinity, which no band holds
            return np.asarray(-np.log(z) / self.rate + 1j * self.origin + self.sigma)


def _rows_by_references(frfs: FrfSet, lines: MeasuredLines) -> ComplexArray:
    """Arrange FRFs as accelerances with the smaller side last, and rows of equal noise.

    All lines weigh the same: where the noise follows the peaks, its weights would hide the modes.
    """
    scaled = lines.s / abs(lines.s[-1])
    values = lines.receptance * scaled[:, None] ** 2
    weights = lines.weighted()
    rows = {dof: index for index, dof in enumerate(frfs.output_dofs)}
    columns = {dof: index for index, dof in enumerate(frfs.input_dofs)}
    if len(rows) * len(columns) != frfs.n_frfs or min(len(rows), len(columns)) > MAX_REFERENCES:
        return np.asarray((values * weights.gain)[:, :, None])
    H = np.zeros((len(values), len(rows), len(columns)), complex)
    gain = np.zeros((len(rows), len(columns)))
    for index, label in enumerate(frfs.labels):
        entry = rows[label.output_dof], columns[label.input_dof]
        H[:, *entry], gain[entry] = values[:, index], np.log(weights.gain[index])
    if len(columns) > len(rows):
        H, gain = H.transpose(0, 2, 1), gain.T
    row_gain = gain.mean(axis=1, keepdims=True)
    return np.asarray(H * np.exp(row_gain + (gain - row_gain).mean(axis=0)))


def _poles_of_order(M: ComplexArray, n_ref: int, order: int, circle: _CircleMap, lines: MeasuredLines) -> _OrderPoles:
    D = denominator(M, n_ref, order)
    z = denominator_roots(D)
    poles = circle.poles(z)
    low, high = (2 * np.pi * hz for hz in lines.band_hz)
    inside = (poles.real < 0) & (poles.imag > low) & (poles.imag < high) & (damping_ratio(poles) < MAX_DAMPING)
    selected = np.flatnonzero(inside)
    selected = selected[np.argsort(poles.imag[selected])]
    return _OrderPoles(order=order, poles=poles[selected], shapes=participation(D, z[selected]))


def _stability(low: _OrderPoles, high: _OrderPoles, tolerance: Stability) -> BoolArray:
    """Mark the poles that agree with one of the lower order in frequency, in damping too, and in the vector too."""
    hertz, lower_hertz = np.abs(high.poles)[:, None], np.abs(low.poles)
    ratio, lower_ratio = damping_ratio(high.poles)[:, None], damping_ratio(low.poles)
    frequency = np.abs(hertz - lower_hertz) < tolerance.frequency * hertz
    damping = frequency & (np.abs(ratio - lower_ratio) < tolerance.damping * ratio)
    assurance = np.abs(high.shapes.conj() @ low.shapes.T) ** 2
    shape = damping & (1 - assurance < tolerance.vector)
    return np.stack([frequency.any(axis=1), damping.any(axis=1), shape.any(axis=1)])


def _diagram_table(diagram: list[_OrderPoles], stable: list[BoolArray]) -> pd.DataFrame:
    poles = np.concatenate([order.poles for order in diagram])
    marks = np.concatenate(stable, axis=1)
    return pd.DataFrame(
        {
            "order": np.repeat([order.order for order in diagram], [len(order.poles) for order in diagram]),
            "frequency_hz": natural_frequency_hz(poles),
            "damping_ratio": damping_ratio(poles),
            "stable_frequency": marks[0],
            "stable_damping": marks[1],
            "stable_shape": marks[2],
            "taken": np.arange(len(poles)) >= len(poles) - len(diagram[-1].poles),
        }
    )


def columns_of_modes(table: pd.DataFrame, frequency_hz: FloatArray, tolerance: Stability) -> pd.DataFrame:
    """Say of each pole of a diagram whether it stands in the column of a mode of the fit.

    Parameters
    ----------
    table : DataFrame
        The diagram.
    frequency_hz : (n_modes,) array
        Natural frequencies of the fit.
    tolerance : Stability
        How near a stable pole is to the mode.

    Returns
    -------
    DataFrame
        With the column ``mode``: number of the mode from 1, or 0.
    """
    hertz = table["frequency_hz"].to_numpy(float)
    if not len(hertz) or not len(frequency_hz):
        return table.assign(mode=np.zeros(len(hertz), np.int64))
    distance = np.abs(hertz[:, None] / frequency_hz - 1)
    nearest = distance.argmin(axis=1)
    is_stable = table["stable_frequency"].to_numpy(bool) if "stable_frequency" in table else np.zeros(len(hertz), bool)
    in_column = is_stable & (distance.min(axis=1) < tolerance.frequency)
    return table.assign(mode=np.where(in_column, nearest + 1, 0))
