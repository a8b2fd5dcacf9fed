"""Effects on damping: the middle of the contract's table."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from frf_testbench.simulator.effects.effect import Bench, ComplexArray, Effect, Gain, Mount, Pair, constant, log_uniform
from frf_testbench.simulator.structures.beams import BeamDrawing
from frf_testbench.simulator.structures.frames import FrameDrawing
from frf_testbench.simulator.structures.points import Point

Draw = Callable[[np.random.Generator, Bench], Effect | None]

SOLIDS_BEYOND, SOLIDS_STEP = 1000.0, 0.5  # rates from below to above the band by this factor, and logarithmic steps


def damping_level(rng: np.random.Generator, bench: Bench) -> Effect:
    """Draw another ratio of all modes."""
    factor = log_uniform(rng, 1.6, 8) if rng.random() < 0.75 else 1 / log_uniform(rng, 2, 4)
    ratio = float(f"{factor * bench.set_up.damping_ratio:.3g}")
    return Effect(
        name="damping_level",
        parameters={"modal_ratio": ratio},
        damping_factor=ratio / bench.set_up.damping_ratio,
    )


def local_damper(rng: np.random.Generator, bench: Bench) -> Effect:
    """Draw a damper between a node and the ground."""
    node = int(rng.choice(bench.nodes))
    motion = (bench.point(node), None)
    damping = log_uniform(rng, 0.15, 15) * bench.damping(motion)
    return Effect(
        name="local_damper",
        location={"nodes": [node]},
        parameters={"damping_Ns_m": damping},
        mounts=(Mount(motions=(motion,), stiffness=constant([[damping]], lambda s: s)),),
    )


def structural_damping(rng: np.random.Generator, bench: Bench) -> Effect:
    """Draw a loss factor of the stiffness matrix."""
    loss = log_uniform(rng, 1.5, 15) * bench.set_up.damping_ratio
    modulus = lossy(loss, bench.set_up.band_hz)
    return Effect(name="structural_damping", parameters={"loss_factor": loss}, modulus=modulus)


def lossy(loss: float, band_hz: tuple[float, float]) -> Gain:
    """Build a stiffness with the same loss factor at all frequencies from standard solids, so that it is causal.

    Parameters
    ----------
    loss : float
        Loss factor.
    band_hz : (low, high)
        In its middle the stiffness is the nominal one.

    Returns
    -------
    callable
        Stiffness at `s` over the nominal one.
    """
    low, high = (2 * np.pi * edge for edge in band_hz)
    slope = 2 / np.pi * np.arctan(loss)
    logs = np.arange(np.log(low / SOLIDS_BEYOND), np.log(high * SOLIDS_BEYOND), SOLIDS_STEP)
    rates = np.exp(logs) / np.sqrt(low * high)
    strengths = np.sin(np.pi * slope) / np.pi * SOLIDS_STEP * rates**slope
    slowest = np.sin(np.pi * slope) / (np.pi * slope) * np.exp(-slope * SOLIDS_STEP / 2) * rates[0] ** slope

    def stiffness(s: ComplexArray) -> ComplexArray:
        s = s / np.sqrt(low * high)
        return np.asarray(slowest + sum(k * s / (s + rate) for k, rate in zip(strengths, rates, strict=True)))

    middle = stiffness(np.array([1j * np.sqrt(low * high)]))[0].real
    return lambda s: stiffness(s) / middle


def viscoelastic_joint(rng: np.random.Generator, bench: Bench) -> Effect:
    """Draw a joint that relaxes: between a node and the ground, across a spring, or on the rotation of a pinned end."""
    low, high = bench.set_up.band_hz
    relaxation = 1 / (2 * np.pi * log_uniform(rng, 1.2 * low, 0.9 * high))
    motion, location, name = _joint(rng, bench)
    stiffness = log_uniform(rng, 0.02, 2) * bench.stiffness(motion)
    return Effect(
        name="viscoelastic_joint",
        location=location,
        parameters={name: stiffness, "relaxation_time_s": relaxation},
        mounts=(
            Mount(
                motions=(motion,),
                stiffness=constant([[stiffness]], lambda s: s * relaxation / (1 + s * relaxation)),
            ),
        ),
    )


def _joint(rng: np.random.Generator, bench: Bench) -> tuple[Pair, dict[str, object], str]:
    drawing = bench.specimen.drawing
    if isinstance(drawing, BeamDrawing):
        pinned = [end for end in ("left", "right") if getattr(drawing, end) == "pinned"]
        if pinned and rng.random() < 0.6:
            end = str(rng.choice(pinned))
            node = 1 if end == "left" else drawing.elements + 1
            return (Point(node, "ry"), None), {"end": end, "nodes": [node]}, "rotational_stiffness_Nm_rad"
    if isinstance(drawing, FrameDrawing) and rng.random() < 0.6:
        spring = drawing.springs[int(rng.integers(len(drawing.springs)))]
        return spring_motion(bench, spring.id), {"springs": [spring.id]}, "stiffness_N_m"
    node = int(rng.choice(bench.nodes))
    return (bench.point(node), None), {"nodes": [node]}, "stiffness_N_m"


def spring_motion(bench: Bench, spring_id: str) -> Pair:
    """Extension of a spring of a frame: the second node minus the first."""
    drawing = bench.specimen.drawing
    if not isinstance(drawing, FrameDrawing):
        raise TypeError(f"springs are parts of frames, not of a {type(drawing).__name__}")
    first, second = (bench.point(node) for node in drawing.spring(spring_id).nodes)
    return second, first


DRAWS: dict[str, Draw] = {
    draw.__name__: draw for draw in (damping_level, local_damper, structural_damping, viscoelastic_joint)
}
