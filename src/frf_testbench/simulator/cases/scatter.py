"""What a user cannot know: stiffness, mass, frequencies, damping, gains and positions within their tolerances."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from frf_testbench.simulator.set_up import SetUp
from frf_testbench.simulator.specimens import Specimen
from frf_testbench.simulator.structures.frames import FrameDrawing
from frf_testbench.simulator.structures.grids import GridDrawing
from frf_testbench.simulator.structures.plates import PlateDrawing
from frf_testbench.simulator.structures.reality import Variation

FloatArray = NDArray[np.float64]

STIFFNESS, MASS = 0.001, 0.0004  # largest deviation of the fields
FREQUENCY, DAMPING, GAIN, POSITION_M_PER_M = 0.0004, 0.3, 0.005, 1e-3  # of each mode, channel, point
N_MODES = 400  # more than any structure has up to where its modes are summed


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scatter:
    """One draw of everything a user cannot know.

    Parameters
    ----------
    stiffness, density : Variation
        Fields around 1.
    frequency, damping : (N_MODES,) array
        Factors of each mode.
    gains : dict of str to float
        Factors of the channels, ``force`` among them.
    offsets : dict of str to tuple
        How far each sensor (by its column) and each excited node (``hit 17``) is from its node, along x and y, m.
    suspension_hz, suspension_damping
        Of a free structure.
    """

    stiffness: Variation
    density: Variation
    frequency: FloatArray
    damping: FloatArray
    gains: dict[str, float]
    offsets: dict[str, tuple[float, float]]
    suspension_hz: float
    suspension_damping: float


def _draw_field(rng: np.random.Generator, specimen: Specimen, size: float) -> Variation:
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


def _draw_offset(rng: np.random.Generator, extent: FloatArray) -> tuple[float, float]:
    x, y = (rng.uniform(-1, 1, 2) * extent).tolist()
    return x, y


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
    points = [*columns, *(f"hit {node}" for node, _ in set_up.excited_points)]
    free = specimen.drawing.n_rigid > 0
    return Scatter(
        stiffness=_draw_field(rng, specimen, size * STIFFNESS),
        density=_draw_field(rng, specimen, size * MASS),
        frequency=1 + size * rng.uniform(-FREQUENCY, FREQUENCY, N_MODES),
        damping=1 + rng.uniform(-DAMPING, DAMPING, N_MODES),
        gains={column: float(1 + rng.uniform(-GAIN, GAIN)) for column in ("force", *columns)},
        offsets={point: _draw_offset(rng, extent) for point in points},
        suspension_hz=float(first_hz * rng.uniform(0.005, 0.012)) if free else 0.0,
        suspension_damping=float(rng.uniform(0.02, 0.06)),
    )


def make_zero_scatter(specimen: Specimen, set_up: SetUp, first_hz: float) -> Scatter:
    """Return a draw in which everything is as the drawing says, but for the suspension."""
    free = specimen.drawing.n_rigid > 0
    columns = [sensor.column for sensor in set_up.sensors]
    return Scatter(
        stiffness=Variation(),
        density=Variation(),
        frequency=np.ones(N_MODES),
        damping=np.ones(N_MODES),
        gains=dict.fromkeys(("force", *columns), 1.0),
        offsets=dict.fromkeys((*columns, *(f"hit {node}" for node, _ in set_up.excited_points)), (0.0, 0.0)),
        suspension_hz=0.008 * first_hz if free else 0.0,
        suspension_damping=0.04,
    )
