"""What all drawings of FRFs share, on paper and on the page: phases, bands of confidence, titles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.frf import FrfLabel

Q95 = 1.96  # standard deviations of a 95 % interval
LEAST = 0.1  # of the magnitude: a band that reaches below is drawn down to here

PHASE_CUT = 135.0  # degrees: structures stay near multiples of 90, so that noise does not make curves jump at the cut
PHASE_LIMITS = (PHASE_CUT - 365, PHASE_CUT + 5)


DASHES = ("solid", "dash", "dot", "dashdot", "longdash", "longdashdot")
N_COLOURS = 7  # curves that differ in their colour; more of them differ in their dashes too


def dash_of(number: int) -> str:
    """Dash of the n-th curve: curves that share a colour differ in it.

    Parameters
    ----------
    number : int
        From 0.

    Returns
    -------
    str
        As a `Line` has it.

    Examples
    --------
    >>> [dash_of(number) for number in (0, 6, 7)]
    ['solid', 'solid', 'dash']
    """
    return DASHES[(number // N_COLOURS) % len(DASHES)]


def phase_degrees(values: ComplexArray) -> FloatArray:
    """Phase, cut where structures hardly ever are.

    Parameters
    ----------
    values : complex array
        FRFs.

    Returns
    -------
    array
        From -225 to 135 degrees.

    Examples
    --------
    >>> phase_degrees(np.array([1j, -1 + 0.01j])).round(1).tolist()
    [90.0, -180.6]
    """
    return np.asarray((np.degrees(np.angle(values)) - PHASE_CUT) % -360.0 + PHASE_CUT)


def confidence_band(magnitude: FloatArray, std: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Limits between which a magnitude lies with 95 %, as they are drawn on a logarithmic axis.

    Parameters
    ----------
    magnitude : array
        Of an FRF.
    std : array
        Its standard deviation, in the same unit.

    Returns
    -------
    low, high : array
        The lower one never below a tenth of the magnitude.

    Examples
    --------
    >>> low, high = confidence_band(np.array([1.0, 1.0]), np.array([0.1, 2.0]))
    >>> low.round(3).tolist(), high.round(3).tolist()
    ([0.804, 0.1], [1.196, 4.92])
    """
    return np.maximum(magnitude - Q95 * std, LEAST * magnitude), magnitude + Q95 * std


def magnitude_title(labels: Sequence[FrfLabel]) -> str:
    """Title of an axis with the magnitude of FRFs.

    Parameters
    ----------
    labels : sequence of FrfLabel
        What is drawn.

    Returns
    -------
    str
        Quantity and unit, or several of them.
    """
    kinds = dict.fromkeys((label.quantity.value, label.unit) for label in labels)
    return " or ".join(f"{quantity.capitalize()}, {unit}" for quantity, unit in kinds)
