"""What a user cannot know: stiffness, mass, frequencies, damping, gains and positions within their tolerances."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from frf_testbench.simulator.cases.set_up import SetUp
from frf_testbench.simulator.cases.specimens import Specimen
from frf_testbench.simulator.structures.frames import FrameDrawing
from frf_testbench.simulator.structures.grids import GridDrawing
from frf_testbench.simulator.structures.plates import PlateDrawing
from frf_testbench.simulator.structures.reality import Variation

FloatArray = NDArray[np.float64]

STIFFNESS, MASS = 0.001, 0.0004  # largest deviation of the fields
FREQUENCY, DAMPING, GAIN, POSITION_M_PER_M = 0.0004, 0.3, 0.005, 1e-3  # of each mode, channel, place
MANY = 400  # modes


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scatter:
    """One draw of everything a user cannot know.

    Parameters
    ----------
    stiffness, density : Variation
        Fields around 1.
    frequency, damping : (MANY,) array
        Factors of each mode.
    gains : dict of str to float
        Factors of the channels, ``force`` among them.
    offsets : dict of str to tuple
        How far each sensor (by its column) and each struck node (``hit 17``) is from its node, along x and y, m.
    cords_hz, cords_damping
        Of a free structure.
    """

    stiffness: Variation
    density: Variation
    frequency: FloatArray
    damping: FloatArray
    gains: dict[str, float]
    offsets: dict[str, tuple[float, float]]
    cords_hz: float
    cords_damping: float


def _field(rng: np.random.Generator, specimen: Specimen, size: float) -> Variation:
    """Draw a field whose deviations stay within a size."""
    drawing = specimen.drawing
    if isinstance(drawing, FrameDrawing):
        n = max(len(drawing.masses_kg), len(drawing.springs))
        return Variation(parts=rng.uniform(-size, size, n))
    shape = (4, 3) if isinstance(drawing, PlateDrawing) else (5, 1)
    cosines = rng.standard_normal(shape)
    cosines *= 0.6 * size / np.abs(cosines).sum()
    n_parts = len(drawing.layout[1]) if isinstance(drawing, GridDrawing) else 0
    return Variation(cosines=cosines, parts=0.4 * size * rng.uniform(-1, 1, n_parts))


def draw_scatter(rng: np.random.Generator, specimen: Specimen, set_up: SetUp, first_hz: float) -> Scatter:
    """Draw everything a user cannot know.

    Parameters
    ----------
    rng : Generator
        Of the case.
    specimen, set_up
        What is tested, and how.
    first_hz : float
        First flexible natural frequency.

    Returns
    -------
    Scatter
        Within the tolerances of the contract.
    """
    extent = np.array(specimen.length_m) * POSITION_M_PER_M
    size = float(rng.uniform(0.25, 1.0))  # some owners know their structures better than they say
    columns = [sensor.column for sensor in set_up.sensors]
    places = [*columns, *(f"hit {node}" for node, _ in set_up.struck)]
    free = specimen.drawing.n_rigid > 0
    return Scatter(
        stiffness=_field(rng, specimen, size * STIFFNESS),
        density=_field(rng, specimen, size * MASS),
        frequency=1 + size * rng.uniform(-FREQUENCY, FREQUENCY, MANY),
        damping=1 + rng.uniform(-DAMPING, DAMPING, MANY),
        gains={column: float(1 + rng.uniform(-GAIN, GAIN)) for column in ("force", *columns)},
        offsets={place: tuple((rng.uniform(-1, 1, 2) * extent).tolist()) for place in places},
        cords_hz=float(first_hz * rng.uniform(0.005, 0.012)) if free else 0.0,
        cords_damping=float(rng.uniform(0.02, 0.06)),
    )


def no_scatter(specimen: Specimen, set_up: SetUp, first_hz: float) -> Scatter:
    """Return a draw in which everything is as the drawing says, but for the cords."""
    free = specimen.drawing.n_rigid > 0
    columns = [sensor.column for sensor in set_up.sensors]
    return Scatter(
        stiffness=Variation(),
        density=Variation(),
        frequency=np.ones(MANY),
        damping=np.ones(MANY),
        gains=dict.fromkeys(("force", *columns), 1.0),
        offsets=dict.fromkeys((*columns, *(f"hit {node}" for node, _ in set_up.struck)), (0.0, 0.0)),
        cords_hz=0.008 * first_hz if free else 0.0,
        cords_damping=0.04,
    )
