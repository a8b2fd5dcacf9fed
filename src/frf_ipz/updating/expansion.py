"""What is said of measured shapes that were expanded over a model in the place of an update of its matrices."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.dofs import AnyDof, Dof

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.frf import FrfLabel

MOST_NAMED = 4
TOLD = 0.1  # of a mass, at the low end of its interval: else the data do not tell it from none


@dataclass(frozen=True, slots=True, kw_only=True)
class AttachedMass:
    """A mass that the model lacks.

    Parameters
    ----------
    place : str
        The DOF.
    mass_kg, low_kg, high_kg : float
        Most likely, and its 90 % interval, kg.

    Examples
    --------
    >>> import frf_ipz
    >>> frf_ipz.AttachedMass(place="1:z", mass_kg=0.010, low_kg=0.009, high_kg=0.012).text
    '10 g (9 to 12) at 1:z'
    """

    place: str
    mass_kg: float
    low_kg: float
    high_kg: float

    @property
    def text(self) -> str:
        """Mass with its interval and its place."""
        mass, low, high = (f"{1e3 * value:.2g}" for value in (self.mass_kg, self.low_kg, self.high_kg))
        return f"{mass} g ({low} to {high}) at {self.place}"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ShapeExpansion:
    """Measured shapes that were expanded over a model, and how well each measured point follows from the others.

    Parameters
    ----------
    points : tuple of str
        Measured points, each left out in turn.
    ratio : (n_points,) array
        Measured over predicted amplitude of each, the median over its modes.
    error_db : (n_points,) array
        How far off its FRFs are then: median over lines, dB; where the scale is unknown, after one factor a point.
    updated_error_db : (n_points,) array
        The same of an update at points that it was not given: every other one, then the others.
    stiffness_ratio : float
        Factor on the stiffness of the model over which they were expanded.
    masses : tuple of AttachedMass
        Masses that were added to it.
    split : tuple of tuple of float
        Frequencies of measured modes, Hz, that follow one mode of the model: something hidden splits it.
    is_level_known : bool
        Whether the test knows its scale.
    inner_nodes : tuple of int
        Nodes between the measured points; all others lie beyond them.
    inner_spread : float
        Spread of the ensemble that is due there, over the whole of it, which is due beyond.
    reciprocal_spread : float
        The same at a sensor where the test only excites, or the other way round: the model's shapes are known there as
        well as reciprocity holds.
    wrong_gains : tuple of (str, float, float)
        Points whose gain is wrong: logarithm of what was measured over what is, and its standard deviation.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> expansion = frf_ipz.ShapeExpansion(
    ...     points=("10:z", "30:z", "50:z"), ratio=np.ones(3), error_db=np.array([1.0, 1.2, 1.4]),
    ...     updated_error_db=np.full(3, 4.0), stiffness_ratio=0.97, masses=(), split=((289.0, 377.0),),
    ...     is_level_known=False,
    ... )
    >>> float(expansion.median_db)
    1.2
    """

    points: tuple[str, ...]
    ratio: FloatArray
    error_db: FloatArray
    updated_error_db: FloatArray
    stiffness_ratio: float
    masses: tuple[AttachedMass, ...]
    split: tuple[tuple[float, ...], ...]
    is_level_known: bool
    inner_nodes: tuple[int, ...] = ()
    inner_spread: float = 1.0
    reciprocal_spread: float = 1.0
    wrong_gains: tuple[tuple[str, float, float], ...] = ()

    def spread_at(self, dof: AnyDof) -> float:
        """Tell how much of the ensemble's spread is due at a point.

        Parameters
        ----------
        dof : Dof or PortDof
            The point.

        Returns
        -------
        float
            0 to 1; 1 beyond the measured points, and for a port, which has no place of its own.
        """
        return self.inner_spread if isinstance(dof, Dof) and dof.node in self.inner_nodes else 1.0

    def wrong_gains_of(self, labels: Sequence[FrfLabel]) -> FloatArray:
        """Give the factor by which each measured FRF is off, by the points whose gain is wrong.

        Parameters
        ----------
        labels : sequence of FrfLabel
            All FRFs of the test.

        Returns
        -------
        (n_frfs,) array
            1 where nothing is wrong.
        """
        sides = [label.output_dof for label in labels], [label.input_dof for label in labels]
        ends = max(sides, key=lambda side: len(set(side)))
        log_gains = {point: log_gain for point, log_gain, _ in self.wrong_gains}
        return np.exp([log_gains.get(end.name, 0.0) for end in ends])

    @property
    def median_db(self) -> float:
        """Median over the points."""
        return float(np.median(self.error_db))

    @property
    def statements(self) -> tuple[str, ...]:
        """What was done and found, for people."""
        worst = int(np.argmax(self.error_db))
        texts = [
            "the update of the matrices, given half of the measured points, is "
            f"{np.median(self.updated_error_db):.2g} dB off at the others (median), so the measured shapes were "
            "expanded over the model in its place: with each point left out in turn, its FRFs follow from the others "
            f"to {self.median_db:.2g} dB (median; worst {self.points[worst]} with {self.error_db[worst]:.2g} dB)"
        ]
        told = [mass.text for mass in self.masses if mass.low_kg > TOLD * mass.mass_kg]
        if told:
            texts.append(
                "measured shapes and frequencies ask for masses that the model lacks (90 % interval): "
                f"{', '.join(told)}; and for {100 * (self.stiffness_ratio - 1):+.2g} % of stiffness"
            )
        texts += self._gain_texts()
        if self.split:
            groups = "; ".join(", ".join(f"{hz:.4g}" for hz in group) for group in self.split[:MOST_NAMED])
            texts.append(
                f"several measured modes have the shape of one mode of the model: {groups} Hz; what splits it is not "
                "in the model, and is not named"
            )
        return tuple(texts)

    def _gain_texts(self) -> list[str]:
        """Name the points whose gain is wrong."""
        return [
            f"what was measured at {point} is {100 * abs(np.expm1(log_gain)):.0f} +- {100 * max(std, 0.01):.0f} % "
            f"{'low' if log_gain < 0 else 'high'} in all its modes against what the other points imply: look at the "
            "gain of that file; the prediction goes by the others"
            for point, log_gain, std in self.wrong_gains
        ]
