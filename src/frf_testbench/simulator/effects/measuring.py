"""Effects in the measuring chain: channels that are late, filtered, mis-scaled or somewhere else."""

from __future__ import annotations

import numpy as np

from frf_testbench.simulator.effects.effect import Draw, Effect, EffectTarget, Gain, draw_log_uniform


def _draw_channel(rng: np.random.Generator, target: EffectTarget) -> str:
    """Draw a channel; the force is one too."""
    return str(rng.choice(target.columns))


def draw_time_delay(rng: np.random.Generator, target: EffectTarget) -> Effect:
    """Draw a channel that is late."""
    channel = _draw_channel(rng, target)
    delay = draw_log_uniform(rng, 0.003, 0.12) / target.set_up.band_hz[1]
    return Effect(
        name="time_delay",
        location={"channels": [channel]},
        parameters={"delay_s": delay},
        gains={channel: lambda s: np.exp(-s * delay)},
    )


def draw_sensor_dynamics(rng: np.random.Generator, target: EffectTarget) -> Effect:
    """Draw a first-order high-pass or low-pass of a channel."""
    channel = _draw_channel(rng, target)
    low, high = target.set_up.band_hz
    kind = str(rng.choice(["highpass", "lowpass"]))
    corner = (
        draw_log_uniform(rng, 0.15 * low, 2.5 * low)
        if kind == "highpass"
        else draw_log_uniform(rng, 0.7 * high, 8 * high)
    )
    return Effect(
        name="sensor_dynamics",
        location={"channels": [channel]},
        parameters={"kind": kind, "corner_hz": corner},
        gains={channel: make_first_order_filter(kind, corner)},
    )


def make_first_order_filter(kind: str, corner_hz: float) -> Gain:
    """Make the transfer function of a first-order filter."""
    omega = 2 * np.pi * corner_hz
    return (lambda s: s / (s + omega)) if kind == "highpass" else (lambda s: omega / (s + omega))


def draw_sensor_gain(rng: np.random.Generator, target: EffectTarget) -> Effect:
    """Draw a channel of another gain, or of the other sign."""
    channel = _draw_channel(rng, target)
    change = draw_log_uniform(rng, 0.015, 0.5)
    gain = round((1 + change) ** float(rng.choice([-1, 1])), 4)
    if rng.random() < 0.2:
        gain = -1.0 if rng.random() < 0.7 else -gain
    return Effect(
        name="sensor_gain",
        location={"channels": [channel]},
        parameters={"gain_ratio": gain},
        gains={channel: lambda s: np.full(s.shape, gain, dtype=complex)},
    )


def draw_sensor_misplaced(rng: np.random.Generator, target: EffectTarget) -> Effect | None:
    """Draw a sensor that sits at another node than the test file says."""
    sensor = target.set_up.sensors[int(rng.integers(len(target.set_up.sensors)))]
    sensor_nodes = {channel.node for channel in target.set_up.sensors}
    positions = target.structure.nodes
    size = max(np.ptp(np.array(list(positions.values())), axis=0).max(), 1e-9)
    candidates = [
        node
        for node in target.nodes
        if node not in sensor_nodes
        and np.linalg.norm(np.subtract(positions[node], positions[sensor.node])) < 0.3 * size
    ]
    if not candidates:
        return None
    node = int(rng.choice(candidates))
    return Effect(
        name="sensor_misplaced",
        location={"channels": [sensor.column], "nodes": [node]},
        sensor_nodes={sensor.column: node},
    )


DRAWS: dict[str, Draw] = {
    draw.__name__.removeprefix("draw_"): draw
    for draw in (draw_time_delay, draw_sensor_dynamics, draw_sensor_gain, draw_sensor_misplaced)
}
