"""A resonator that hangs on the structure: a cable, a loose part, an absorber."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.catalogue.effect import (
    Builder,
    Effect,
    Parameter,
    Signature,
    list_neighbouring_nodes,
    list_node_locations,
)
from frf_ipz.diagnosis.catalogue.effects.added_mass import SMALLEST
from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.model.change import Attachment, Change

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.result import Estimate

LARGEST = 1.0  # of the mass of the structure
LOWEST, HIGHEST = 0.5, 1.6  # of the edges of the band: beyond, it is a spring, a damper or a mass
RATIOS = 1e-3, 0.5
USUAL_RATIO, WITHIN = 0.05, 1.7  # the largest of real resonators, and the factor by which it may be more
FREQUENCY_STEP = 1.06
START_RATIOS = (0.01, 0.06)
MAX_RATIO = 0.2  # with more, what fits is a resonator in name only


class AttachedResonator(Effect):
    """A mass on a spring and a damper at a node."""

    name = "attached_resonator"
    has_dynamics = True

    def locations(self, context: ModelContext) -> Sequence[Location]:
        """Every node that moves."""
        return list_node_locations(context)

    def parameters(self, context: ModelContext, location: Location) -> tuple[Parameter, ...]:
        """Mass, frequency, damping ratio."""
        del location
        low, high = context.band_hz
        return (
            Parameter(name="mass_kg", low=SMALLEST * context.mass_kg, high=LARGEST * context.mass_kg),
            Parameter(name="frequency_hz", low=LOWEST * low, high=HIGHEST * high),
            Parameter(name="damping_ratio", low=RATIOS[0], high=RATIOS[1]),
        )

    def build(self, context: ModelContext, location: Location) -> Builder:
        """Attach its dynamic stiffness."""
        motion = context.motion(location.dof).dense(len(context.model.all_dofs))[:, None]

        def change(values: np.ndarray) -> Change:
            mass, frequency_hz, ratio = values
            omega = 2 * np.pi * frequency_hz
            inertia, across = np.diag([0.0, mass]), np.array([[1.0, -1.0], [-1.0, 1.0]])
            attachment = Attachment(
                motions=motion,
                stiffness=lambda s: mass * dynamic_mass(s, frequency_hz, ratio),
                matrices=(inertia, 2 * ratio * omega * mass * across, omega**2 * mass * across),
            )
            return Change(attachments=(attachment,))

        return change

    def signature(self, context: ModelContext, location: Location) -> Signature:
        """All frequencies and some damping ratios."""
        shapes, values, amplitudes = _make_shapes(context)
        return Signature(motion=context.motion(location.dof), shapes=shapes, values=values, amplitudes=amplitudes)

    def neighbours(self, context: ModelContext, location: Location) -> Sequence[Location]:
        """Nodes beside."""
        return list_neighbouring_nodes(context, location)

    def log_prior(self, context: ModelContext, location: Location, values: FloatArray) -> float:
        """Expect a resonator to be little damped: with much damping it is a damper with a mass behind it."""
        del context, location
        beyond = max(float(np.log(values[2] / USUAL_RATIO)), 0.0)
        return -0.5 * (beyond / float(np.log(WITHIN))) ** 2

    def implausibility(self, values: FloatArray) -> str:
        """Refuse one of large damping: it can imitate many other losses."""
        _, frequency_hz, ratio = values
        if ratio <= MAX_RATIO:
            return ""
        return (
            f"what looks like a resonator of {frequency_hz:.4g} Hz has a damping ratio of {100 * ratio:.2g} %, far "
            "more than a resonator has: it rather stands for another loss of energy"
        )

    def statement(self, context: ModelContext, location: Location, values: Mapping[str, Estimate]) -> str:
        """Say what is attached where."""
        return (
            f"A resonator of {values['mass_kg'].in_words('g', 1e3)} is attached at "
            f"{context.describe_node(location.node)} that the model lacks: its natural frequency is "
            f"{values['frequency_hz'].in_words('Hz')}, its damping ratio {values['damping_ratio'].in_words('%', 100)}."
        )


@lru_cache(maxsize=4)  # the same at all locations
def _make_shapes(context: ModelContext) -> tuple[ComplexArray, FloatArray, FloatArray]:
    low, high = context.band_hz
    count = int(np.log(1.3 * high / (0.7 * low)) / np.log(FREQUENCY_STEP)) + 1
    pairs = list(product(np.geomspace(0.7 * low, 1.3 * high, count), START_RATIOS))
    return (
        np.array([dynamic_mass(context.contour, frequency, ratio) for frequency, ratio in pairs]),
        np.array([(1.0, frequency, ratio) for frequency, ratio in pairs]),
        np.geomspace(3e-4, 0.3, 9) * context.mass_kg,
    )


def dynamic_mass(s: ComplexArray, frequency_hz: float, ratio: float) -> ComplexArray:
    """Dynamic stiffness of a resonator of unit mass: s^2 (k + c s) / (k + c s + s^2).

    Parameters
    ----------
    s : (n_points,) complex array
        rad/s.
    frequency_hz, ratio : float
        Of the resonator on a fixed base.

    Returns
    -------
    (n_points,) complex array
        N/m per kg.
    """
    omega = 2 * np.pi * frequency_hz
    spring = omega**2 + 2 * ratio * omega * s
    return np.asarray(s**2 * spring / (s**2 + spring))
