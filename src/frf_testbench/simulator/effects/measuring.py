"""Effects in the measuring chain: channels that are late, filtered, mis-scaled or somewhere else."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from frf_testbench.simulator.effects.effect import Bench, Effect, Gain, log_uniform

Draw = Callable[[np.random.Generator, Bench], Effect | None]


def _channel(rng: np.random.Generator, bench: Bench) -> str:
    """Draw a channel; the force is one too."""
    return str(rng.choice(bench.columns))


def time_delay(rng: np.random.Generator, bench: Bench) -> Effect:
    """Draw a channel that is late."""
    channel = _channel(rng, bench)
    delay = log_uniform(rng, 0.003, 0.12) / bench.set_up.band_hz[1]
    return Effect(
        name="time_delay",
        location={"channels": [channel]},
        parameters={"delay_s": delay},
        gains={channel: lambda s: np.exp(-s * delay)},
    )


def sensor_dynamics(rng: np.random.Generator, bench: Bench) -> Effect:
    """Draw a first-order high-pass or low-pass of a channel."""
    channel = _channel(rng, bench)
    low, high = bench.set_up.band_hz
    kind = str(rng.choice(["highpass", "lowpass"]))
    corner = log_uniform(rng, 0.15 * low, 2.5 * low) if kind == "highpass" else log_uniform(rng, 0.7 * high, 8 * high)
    return Effect(
        name="sensor_dynamics",
        location={"channels": [channel]},
        parameters={"kind": kind, "corner_hz": corner},
        gains={channel: first_order(kind, corner)},
    )


def first_order(kind: str, corner_hz: float) -> Gain:
    """Transfer function of a first-order filter."""
    omega = 2 * np.pi * corner_hz
    return (lambda s: s / (s + omega)) if kind == "highpass" else (lambda s: omega / (s + omega))


def sensor_gain(rng: np.random.Generator, bench: Bench) -> Effect:
    """Draw a channel of another gain, or of the other sign."""
    channel = _channel(rng, bench)
    change = log_uniform(rng, 0.015, 0.5)
    gain = round((1 + change) ** float(rng.choice([-1, 1])), 4)
    if rng.random() < 0.2:
        gain = -1.0 if rng.random() < 0.7 else -gain
    return Effect(
        name="sensor_gain",
        location={"channels": [channel]},
        parameters={"gain_ratio": gain},
        gains={channel: lambda s: np.full(s.shape, gain, dtype=complex)},
    )


def sensor_misplaced(rng: np.random.Generator, bench: Bench) -> Effect | None:
    """Draw a sensor that sits at another node than the test file says."""
    sensor = bench.set_up.sensors[int(rng.integers(len(bench.set_up.sensors)))]
    taken = {other.node for other in bench.set_up.sensors}
    places = bench.structure.nodes
    size = max(np.ptp(np.array(list(places.values())), axis=0).max(), 1e-9)
    near = [
        node
        for node in bench.nodes
        if node not in taken and np.linalg.norm(np.subtract(places[node], places[sensor.node])) < 0.3 * size
    ]
    if not near:
        return None
    node = int(rng.choice(near))
    return Effect(
        name="sensor_misplaced",
        location={"channels": [sensor.column], "nodes": [node]},
        moved={sensor.column: node},
    )


DRAWS: dict[str, Draw] = {draw.__name__: draw for draw in (time_delay, sensor_dynamics, sensor_gain, sensor_misplaced)}
