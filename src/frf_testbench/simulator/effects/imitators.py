"""Which effects imitate which: the confusions that are known, at the place of the true effect and next to it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from frf_testbench.simulator.effects.dissipative import lossy, spring_motion
from frf_testbench.simulator.effects.effect import Bench, Effect, Mount, Pair, constant
from frf_testbench.simulator.effects.measuring import first_order
from frf_testbench.simulator.structures.beams import BeamDrawing
from frf_testbench.simulator.structures.frames import FrameDrawing
from frf_testbench.simulator.structures.reality import Key

Values = dict[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Substitute:
    """An effect with free parameters, all positive or all of the sign they start with.

    Parameters
    ----------
    name, location
        As in ``diagnosis.json``.
    build : callable
        Makes the effect from its parameters.
    start : dict of str to float
        First guess; a fit changes their logarithms.
    fixed : dict of str to str
        Parameters that are text.
    """

    name: str
    location: dict[str, Any]
    build: Callable[[dict[str, float]], Effect]
    start: dict[str, float]
    fixed: dict[str, str] = field(default_factory=dict)


def imitators(bench: Bench, effect: Effect) -> list[Substitute]:
    """List effects that may look like a given one.

    Parameters
    ----------
    bench : Bench
        The specimen on its test bench.
    effect : Effect
        A linear one.

    Returns
    -------
    list of Substitute
        Empty for effects that nothing imitates.
    """
    return {
        "added_mass": _of_mass,
        "grounded_spring": _of_spring,
        "coupling_spring": _of_coupling,
        "attached_resonator": _of_resonator,
        "local_damper": _of_damper,
        "viscoelastic_joint": _of_joint,
        "local_stiffness": _of_stiffness,
        "boundary_compliance": _of_boundary,
        "damping_level": lambda one_bench, one: [_loss(one_bench, 2 * one.parameters["modal_ratio"])],
        "structural_damping": lambda one_bench, one: [_level(one_bench, one.parameters["loss_factor"] / 2)],
        "time_delay": _of_delay,
        "sensor_dynamics": _of_filter,
        "sensor_gain": _of_gain,
        "sensor_misplaced": _of_place,
        "unknown": _of_outside,
    }.get(effect.name, lambda _bench, _one: [])(bench, effect)


def _attached(
    name: str,
    location: dict[str, Any],
    motion: Pair,
    stiffness: Callable[[Values], Callable[[np.ndarray], np.ndarray]],
    start: Values,
) -> Substitute:
    """Make an effect that is one dynamic stiffness at one motion."""

    def build(values: Values) -> Effect:
        mount = Mount(motions=(motion,), stiffness=constant([[1.0]], stiffness(values)))
        return Effect(name=name, location=location, parameters=values, mounts=(mount,))

    return Substitute(name=name, location=location, build=build, start=start)


def _mass(bench: Bench, node: int, mass: float) -> Substitute:
    motion = (bench.point(node), None)
    return _attached(
        "added_mass", {"nodes": [node]}, motion, lambda v: lambda s: v["mass_kg"] * s**2, {"mass_kg": mass}
    )


def _spring(name: str, location: dict[str, Any], motion: Pair, stiffness: float) -> Substitute:
    def dynamic(values: Values) -> Callable[[np.ndarray], np.ndarray]:
        return lambda s: np.full(s.shape, values["stiffness_N_m"], dtype=complex)

    return _attached(name, location, motion, dynamic, {"stiffness_N_m": stiffness})


def _grounded(bench: Bench, node: int, stiffness: float) -> Substitute:
    return _spring("grounded_spring", {"nodes": [node]}, (bench.point(node), None), stiffness)


def _damper(bench: Bench, node: int, damping: float) -> Substitute:
    motion = (bench.point(node), None)
    return _attached(
        "local_damper", {"nodes": [node]}, motion, lambda v: lambda s: v["damping_Ns_m"] * s, {"damping_Ns_m": damping}
    )


def _joint(location: dict[str, Any], motion: Pair, name: str, stiffness: float, relaxation: float) -> Substitute:
    def dynamic(values: Values) -> Callable[[np.ndarray], np.ndarray]:
        time = values["relaxation_time_s"]
        return lambda s: values[name] * s * time / (1 + s * time)

    return _attached(
        "viscoelastic_joint", location, motion, dynamic, {name: stiffness, "relaxation_time_s": relaxation}
    )


def _resonator(bench: Bench, node: int, values: Values) -> Substitute:
    def dynamic(v: Values) -> Callable[[np.ndarray], np.ndarray]:
        omega = 2 * np.pi * v["frequency_hz"]
        link = lambda s: omega**2 + 2 * v["damping_ratio"] * omega * s  # noqa: E731 - a formula of two lines
        return lambda s: v["mass_kg"] * s**2 * link(s) / (s**2 + link(s))

    return _attached("attached_resonator", {"nodes": [node]}, (bench.point(node), None), dynamic, dict(values))


def _neighbours(bench: Bench, node: int, count: int = 2) -> list[int]:
    """Nodes next to a node that move."""
    place = np.array(bench.structure.nodes[node])
    others = [other for other in bench.nodes if other != node]
    return sorted(others, key=lambda other: float(np.linalg.norm(np.array(bench.structure.nodes[other]) - place)))[
        :count
    ]


def _middle(bench: Bench) -> float:
    """Angular frequency of the middle of the band."""
    return float(2 * np.pi * np.sqrt(np.prod(bench.set_up.band_hz)))


def _of_mass(bench: Bench, effect: Effect) -> list[Substitute]:
    node, mass = effect.location["nodes"][0], effect.parameters["mass_kg"]
    found = [_mass(bench, other, mass) for other in _neighbours(bench, node)]
    drawing = bench.specimen.drawing
    if isinstance(drawing, BeamDrawing):
        first = int(np.clip(node - 1, 1, drawing.elements - 1))
        found.append(_stretch((first, first + 1), 0.7))
    return found


def _of_spring(bench: Bench, effect: Effect) -> list[Substitute]:
    node, stiffness = effect.location["nodes"][0], effect.parameters["stiffness_N_m"]
    found = [_grounded(bench, other, stiffness) for other in _neighbours(bench, node)]
    late = 10 / (2 * np.pi * bench.set_up.band_hz[0])
    found.append(_joint({"nodes": [node]}, (bench.point(node), None), "stiffness_N_m", stiffness, late))
    drawing = bench.specimen.drawing
    if isinstance(drawing, FrameDrawing):
        for spring in drawing.springs:
            if spring.nodes == (0, node):
                found.append(_stiffer(spring.id, {"springs": [spring.id]}, 1 + stiffness / spring.stiffness_n_m))
    return found


def _of_coupling(bench: Bench, effect: Effect) -> list[Substitute]:
    (a, b), stiffness = effect.location["nodes"], effect.parameters["stiffness_N_m"]
    found = [_grounded(bench, node, stiffness) for node in (a, b)]
    pairs = [(near, b) for near in _neighbours(bench, a, 1)] + [(a, near) for near in _neighbours(bench, b, 1)]
    for first, second in pairs:
        if first != second:
            motion = (bench.point(first), bench.point(second))
            found.append(_spring("coupling_spring", {"nodes": sorted((first, second))}, motion, stiffness))
    return found


def _of_resonator(bench: Bench, effect: Effect) -> list[Substitute]:
    node, values = effect.location["nodes"][0], effect.parameters
    stiffness = values["mass_kg"] * (2 * np.pi * values["frequency_hz"]) ** 2
    found = [_resonator(bench, other, dict(values)) for other in _neighbours(bench, node)]
    found += [_mass(bench, node, values["mass_kg"]), _grounded(bench, node, stiffness)]
    return [*found, _damper(bench, node, stiffness / _middle(bench))]


def _of_damper(bench: Bench, effect: Effect) -> list[Substitute]:
    node, damping = effect.location["nodes"][0], effect.parameters["damping_Ns_m"]
    early = 0.1 / (2 * np.pi * bench.set_up.band_hz[1])
    found = [_damper(bench, other, damping) for other in _neighbours(bench, node)]
    joint = _joint({"nodes": [node]}, (bench.point(node), None), "stiffness_N_m", damping / early, early)
    return [*found, joint, _level(bench, 1.5 * bench.set_up.damping_ratio)]


def _of_joint(bench: Bench, effect: Effect) -> list[Substitute]:
    name = next(key for key in effect.parameters if "stiffness" in key)
    stiffness, time = effect.parameters[name], effect.parameters["relaxation_time_s"]
    if "springs" in effect.location:
        spring = effect.location["springs"][0]
        drawn = bench.specimen.drawing.spring(spring).stiffness_n_m  # type: ignore[union-attr]  # frames have springs
        first, second = sorted(bench.specimen.drawing.spring(spring).nodes)  # type: ignore[union-attr]
        found = [_stiffer(spring, {"springs": [spring]}, 1 + 0.5 * stiffness / drawn)]
        if first:
            return found
        return [*found, _joint({"nodes": [second]}, spring_motion(bench, spring), name, stiffness, time)]
    node = effect.location["nodes"][0]
    if "rotational" in name:
        return [_level(bench, 1.5 * bench.set_up.damping_ratio)]
    found = [_grounded(bench, node, 0.5 * stiffness), _damper(bench, node, stiffness * time)]
    near = _neighbours(bench, node)
    return found + [_joint({"nodes": [one]}, (bench.point(one), None), name, stiffness, time) for one in near]


def _stiffer(key: Key, location: dict[str, Any], ratio: float) -> Substitute:
    """Make a part of another stiffness."""

    def build(values: Values) -> Effect:
        softened = ((key, values["stiffness_ratio"]),)
        return Effect(
            name="local_stiffness",
            location=location,
            change=lambda reality: replace(reality, softened=(*reality.softened, *softened)),
        )

    return Substitute(name="local_stiffness", location=location, build=build, start={"stiffness_ratio": ratio})


def _stretch(elements: tuple[int, int], ratio: float) -> Substitute:
    return _stiffer(elements, {"elements": list(elements)}, ratio)


def _end(bench: Bench, end: str, held: tuple[str, ...], start: Values) -> Substitute:
    """Make an end that is held by springs."""
    drawing = bench.specimen.drawing
    node = 1 if end == "left" else drawing.elements + 1  # type: ignore[union-attr]  # asked for beams only
    names = {"rotation": "rotational_stiffness_Nm_rad", "translation": "translational_stiffness_N_m"}
    location = {"end": end, "nodes": [node]}

    def build(values: Values) -> Effect:
        springs = (values.get(names["rotation"]), values.get(names["translation"]))
        return Effect(
            name="boundary_compliance",
            location=location,
            change=lambda reality: replace(reality, released={**reality.released, end: springs}),
        )

    chosen = {names[motion]: start[names[motion]] for motion in held}
    return Substitute(name="boundary_compliance", location=location, build=build, start=chosen)


def _of_boundary(bench: Bench, effect: Effect) -> list[Substitute]:
    drawing = bench.specimen.drawing
    if not isinstance(drawing, BeamDrawing):
        return []
    end, values = effect.location["end"], dict(effect.parameters)
    found = []
    if len(values) == 2:
        found += [_end(bench, end, (motion,), values) for motion in ("rotation", "translation")]
    for count in (1, 3):
        elements = (1, count) if end == "left" else (drawing.elements - count + 1, drawing.elements)
        found.append(_stretch(elements, 0.5))
    return found


def _of_stiffness(bench: Bench, effect: Effect) -> list[Substitute]:
    ratio = effect.parameters["stiffness_ratio"]
    drawing = bench.specimen.drawing
    if "springs" in effect.location and isinstance(drawing, FrameDrawing):
        spring = drawing.spring(effect.location["springs"][0])
        change = (ratio - 1) * spring.stiffness_n_m
        if 0 in spring.nodes:
            return [_grounded(bench, max(spring.nodes), change)]
        motion = spring_motion(bench, spring.id)
        return [_spring("coupling_spring", {"nodes": sorted(spring.nodes)}, motion, change)]
    if "elements" not in effect.location or not isinstance(drawing, BeamDrawing):
        return []
    first, last = effect.location["elements"]
    moved = [(first - 1, last - 1), (first + 1, last + 1), (first - 1, last), (first, last + 1)]
    moved += [(first + 1, last), (first, last - 1)] if last > first else []
    return [_stretch(pair, ratio) for pair in moved if pair[0] >= 1 and pair[1] <= drawing.elements]


def _level(bench: Bench, ratio: float) -> Substitute:
    nominal = bench.set_up.damping_ratio

    def build(values: Values) -> Effect:
        return Effect(name="damping_level", damping_factor=values["modal_ratio"] / nominal)

    return Substitute(name="damping_level", location={}, build=build, start={"modal_ratio": ratio})


def _loss(bench: Bench, factor: float) -> Substitute:
    def build(values: Values) -> Effect:
        return Effect(name="structural_damping", modulus=lossy(values["loss_factor"], bench.set_up.band_hz))

    return Substitute(name="structural_damping", location={}, build=build, start={"loss_factor": factor})


def _delay(channel: str, delay: float) -> Substitute:
    def build(values: Values) -> Effect:
        return Effect(name="time_delay", gains={channel: lambda s: np.exp(-s * values["delay_s"])})

    return Substitute(name="time_delay", location={"channels": [channel]}, build=build, start={"delay_s": delay})


def _filter(channel: str, kind: str, corner: float) -> Substitute:
    def build(values: Values) -> Effect:
        return Effect(name="sensor_dynamics", gains={channel: first_order(kind, values["corner_hz"])})

    location = {"channels": [channel]}
    return Substitute(
        name="sensor_dynamics", location=location, build=build, start={"corner_hz": corner}, fixed={"kind": kind}
    )


def _gain(channel: str, gain: float) -> Substitute:
    def build(values: Values) -> Effect:
        return Effect(
            name="sensor_gain", gains={channel: lambda s: np.full(s.shape, values["gain_ratio"], dtype=complex)}
        )

    return Substitute(name="sensor_gain", location={"channels": [channel]}, build=build, start={"gain_ratio": gain})


def _of_delay(bench: Bench, effect: Effect) -> list[Substitute]:
    del bench
    channel, delay = effect.location["channels"][0], effect.parameters["delay_s"]
    return [_filter(channel, "lowpass", 1 / (2 * np.pi * delay))]


def _of_filter(bench: Bench, effect: Effect) -> list[Substitute]:
    channel, corner = effect.location["channels"][0], effect.parameters["corner_hz"]
    if effect.parameters["kind"] == "highpass":
        return [_gain(channel, 0.95)]
    found = [_delay(channel, 1 / (2 * np.pi * corner)), _gain(channel, 0.95)]
    del bench
    return found


def _of_gain(bench: Bench, effect: Effect) -> list[Substitute]:
    """With one sensor the other channel, the other way round."""
    channel, gain = effect.location["channels"][0], effect.parameters["gain_ratio"]
    others = [other for other in bench.columns if other != channel]
    return [_gain(other, 1 / gain) for other in others]


def _of_place(bench: Bench, effect: Effect) -> list[Substitute]:
    channel, node = effect.location["channels"][0], effect.location["nodes"][0]
    stated = {sensor.column: sensor.node for sensor in bench.set_up.sensors}[channel]
    found = []
    for other in _neighbours(bench, node):
        if other != stated:
            location = {"channels": [channel], "nodes": [other]}
            effect_there = Effect(name="sensor_misplaced", moved={channel: other})
            found.append(
                Substitute(name="sensor_misplaced", location=location, build=lambda _v, e=effect_there: e, start={})
            )
    return [*found, _gain(channel, 0.8)]


def _of_outside(bench: Bench, effect: Effect) -> list[Substitute]:
    """Make what the table has for the channels or for some of the nodes of an effect outside it, and for damping."""
    low, high = bench.set_up.band_hz
    found = []
    for channel in effect.location.get("channels", ()):
        found += [_gain(channel, 0.9), _delay(channel, 0.02 / high)]
        found += [_filter(channel, "lowpass", 3 * high), _filter(channel, "highpass", low / 3)]
    nodes = effect.location.get("nodes", [])
    for node in nodes[:: max(1, len(nodes) // 2)]:
        motion = (bench.point(node), None)
        stiffness, middle = 0.3 * bench.stiffness(motion), _middle(bench)
        hung = {"mass_kg": stiffness / middle**2, "frequency_hz": middle / (2 * np.pi), "damping_ratio": 0.02}
        found += [_grounded(bench, node, stiffness), _mass(bench, node, hung["mass_kg"]), _resonator(bench, node, hung)]
        found += [_damper(bench, node, bench.damping(motion))]
        found += [_joint({"nodes": [node]}, motion, "stiffness_N_m", stiffness, 1 / middle)]
    ratio = bench.set_up.damping_ratio
    return [*found, _level(bench, 1.2 * ratio), _loss(bench, 0.5 * ratio)]
