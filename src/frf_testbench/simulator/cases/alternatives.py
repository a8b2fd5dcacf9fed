"""Other effects that may explain the data of a case as well as the true one does.

Each effect has its known alternatives, at its location and next to it. They are fitted to the exact FRFs of the case.
What comes closer than `EQUIVALENT` is accepted as right; the closest of the others is the runner-up, and its distance
says how decidable the case is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from frf_testbench.simulator.cases.frf_distance import FrfDistance
from frf_testbench.simulator.cases.system import TrueSystem, build_system
from frf_testbench.simulator.effects.dissipative import make_lossy_modulus, spring_extension
from frf_testbench.simulator.effects.effect import (
    ComplexArray,
    Effect,
    EffectTarget,
    Gain,
    Mount,
    keep_reality,
    make_dynamic_stiffness,
)
from frf_testbench.simulator.effects.measuring import make_first_order_filter
from frf_testbench.simulator.structures.beams import BeamDrawing
from frf_testbench.simulator.structures.frames import FrameDrawing, Spring
from frf_testbench.simulator.structures.reality import PartKey
from frf_testbench.simulator.structures.structure import Motion

FloatArray = NDArray[np.float64]
Values = dict[str, float]

EQUIVALENT = 3.0  # log Bayes factor: no data of this size could tell them apart
EVALUATIONS = 25  # of each fit


@dataclass(frozen=True, slots=True, kw_only=True)
class Alternative:
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
    build: Callable[[Values], Effect]
    start: Values
    fixed: dict[str, str] = field(default_factory=dict)


def fit_alternatives(target: EffectTarget, system: TrueSystem, distance: FrfDistance) -> dict[str, Any]:
    """Fit all alternatives to the only effect of a case.

    Parameters
    ----------
    target : EffectTarget
        The specimen in its test, without the effect.
    system : TrueSystem
        With the effect.
    distance : FrfDistance
        From its FRFs.

    Returns
    -------
    dict
        ``equivalents`` and ``runner_up`` (lists, closest first); ``separation_nats`` from the closest other effect and
        ``place_separation_nats`` from the closest other location, None where there is none.
    """
    effect = system.effects[0]
    fits = [_fit_alternative(alternative, system, distance) for alternative in list_alternatives(target, effect)]
    fits.sort(key=lambda fit: fit["nats"])
    return {
        "equivalents": [{**fit, "class": "practical"} for fit in fits if fit["nats"] < EQUIVALENT],
        "runner_up": [fit for fit in fits if fit["nats"] >= EQUIVALENT][:2],
        "separation_nats": min((fit["nats"] for fit in fits if fit["effect"] != effect.name), default=None),
        "place_separation_nats": min((fit["nats"] for fit in fits if fit["effect"] == effect.name), default=None),
    }


class _Trial:
    """FRFs of a system with another effect; the structure is solved again only where it changes."""

    def __init__(self, system: TrueSystem, effect: Effect) -> None:
        self.system = system
        self.template = self._build(replace(effect, damping_factor=1.0, modulus=None))

    def _build(self, effect: Effect) -> TrueSystem:
        return build_system(self.system.specimen, self.system.set_up, self.system.scatter, (effect,))

    def frf(self, effect: Effect, frequencies_hz: FloatArray) -> ComplexArray:
        """Return the (n, n_sensors, n_excited) FRFs with the effect."""
        if effect.change_reality is not keep_reality or effect.sensor_nodes:
            return self._build(effect).measured_frf(frequencies_hz)
        model = self.template.receptance
        ratio = model.damping_ratio.copy()
        ratio[self.template.structure.n_rigid :] *= effect.damping_factor
        attachments = tuple(
            replace(attachment, stiffness=mount.stiffness)
            for attachment, mount in zip(model.attachments, effect.mounts, strict=True)
        )
        model = replace(model, damping_ratio=ratio, modulus=effect.modulus, attachments=attachments)
        return replace(self.template, receptance=model, effects=(effect,)).measured_frf(frequencies_hz)


def _fit_alternative(alternative: Alternative, system: TrueSystem, distance: FrfDistance) -> dict[str, Any]:
    """Fit one alternative, and measure how far it stays away."""
    names = list(alternative.start)
    start = np.log([abs(alternative.start[name]) for name in names])
    signs = np.sign([alternative.start[name] for name in names])
    trial = _Trial(system, alternative.build(alternative.start))

    def to_values(logs: FloatArray) -> Values:
        return dict(zip(names, (signs * np.exp(logs)).tolist(), strict=True))

    def misfit(logs: FloatArray) -> FloatArray:
        return distance.misfit(trial.frf(alternative.build(to_values(logs)), distance.frequencies_hz))

    best = start
    if names:
        bounds = (start - 7, start + 7)
        fit = least_squares(misfit, start, bounds=bounds, diff_step=[1e-4], max_nfev=EVALUATIONS, xtol=1e-5)
        best = fit.x
    separation = distance.measure(trial.frf(alternative.build(to_values(best)), distance.frequencies_hz))
    return {
        "effect": alternative.name,
        "location": alternative.location,
        "parameters": {name: float(f"{value:.4g}") for name, value in to_values(best).items()} | alternative.fixed,
        "nats": float(f"{separation:.4g}"),
    }


def list_alternatives(target: EffectTarget, effect: Effect) -> list[Alternative]:
    """List effects that may look like a given one: the confusions that are known.

    Parameters
    ----------
    target : EffectTarget
        The specimen in its test, without the effect.
    effect : Effect
        A linear one.

    Returns
    -------
    list of Alternative
        Empty for effects that nothing imitates.
    """
    lists: dict[str, Callable[[EffectTarget, Effect], list[Alternative]]] = {
        "added_mass": _list_for_mass,
        "grounded_spring": _list_for_spring,
        "coupling_spring": _list_for_coupling,
        "attached_resonator": _list_for_resonator,
        "local_damper": _list_for_damper,
        "viscoelastic_joint": _list_for_joint,
        "local_stiffness": _list_for_local_stiffness,
        "boundary_compliance": _list_for_boundary,
        "damping_level": _list_for_damping_level,
        "structural_damping": _list_for_structural_damping,
        "time_delay": _list_for_delay,
        "sensor_dynamics": _list_for_filter,
        "sensor_gain": _list_for_gain,
        "sensor_misplaced": _list_for_misplaced_sensor,
        "unknown": _list_for_unknown,
    }
    return lists[effect.name](target, effect) if effect.name in lists else []


def _make_attached(
    name: str, location: dict[str, Any], motion: Motion, stiffness: Callable[[Values], Gain], start: Values
) -> Alternative:
    """Make an effect that is one dynamic stiffness at one motion."""

    def build(values: Values) -> Effect:
        mount = Mount(motions=(motion,), stiffness=make_dynamic_stiffness([[1.0]], stiffness(values)))
        return Effect(name=name, location=location, parameters=values, mounts=(mount,))

    return Alternative(name=name, location=location, build=build, start=start)


def _make_mass(target: EffectTarget, node: int, mass: float) -> Alternative:
    def dynamic(values: Values) -> Gain:
        return lambda s: values["mass_kg"] * s**2

    motion = (target.point(node), None)
    return _make_attached("added_mass", {"nodes": [node]}, motion, dynamic, {"mass_kg": mass})


def _make_spring(name: str, location: dict[str, Any], motion: Motion, stiffness: float) -> Alternative:
    def dynamic(values: Values) -> Gain:
        return lambda s: np.full(s.shape, values["stiffness_N_m"], dtype=complex)

    return _make_attached(name, location, motion, dynamic, {"stiffness_N_m": stiffness})


def _make_grounded_spring(target: EffectTarget, node: int, stiffness: float) -> Alternative:
    return _make_spring("grounded_spring", {"nodes": [node]}, (target.point(node), None), stiffness)


def _make_damper(target: EffectTarget, node: int, damping: float) -> Alternative:
    def dynamic(values: Values) -> Gain:
        return lambda s: values["damping_Ns_m"] * s

    motion = (target.point(node), None)
    return _make_attached("local_damper", {"nodes": [node]}, motion, dynamic, {"damping_Ns_m": damping})


def _make_joint(
    location: dict[str, Any], motion: Motion, name: str, stiffness: float, relaxation_s: float
) -> Alternative:
    def dynamic(values: Values) -> Gain:
        time = values["relaxation_time_s"]
        return lambda s: values[name] * s * time / (1 + s * time)

    start = {name: stiffness, "relaxation_time_s": relaxation_s}
    return _make_attached("viscoelastic_joint", location, motion, dynamic, start)


def _make_resonator(target: EffectTarget, node: int, start: Values) -> Alternative:
    def dynamic(values: Values) -> Gain:
        omega = 2 * np.pi * values["frequency_hz"]

        def link(s: ComplexArray) -> ComplexArray:
            return omega**2 + 2 * values["damping_ratio"] * omega * s

        return lambda s: values["mass_kg"] * s**2 * link(s) / (s**2 + link(s))

    return _make_attached("attached_resonator", {"nodes": [node]}, (target.point(node), None), dynamic, dict(start))


def _make_local_stiffness(key: PartKey, location: dict[str, Any], ratio: float) -> Alternative:
    """Make a part of another stiffness."""

    def build(values: Values) -> Effect:
        softened = ((key, values["stiffness_ratio"]),)
        return Effect(
            name="local_stiffness",
            location=location,
            change_reality=lambda reality: replace(reality, softened=(*reality.softened, *softened)),
        )

    return Alternative(name="local_stiffness", location=location, build=build, start={"stiffness_ratio": ratio})


def _make_segment_stiffness(elements: tuple[int, int], ratio: float) -> Alternative:
    return _make_local_stiffness(elements, {"elements": list(elements)}, ratio)


def _make_boundary(drawing: BeamDrawing, end: str, released: Sequence[str], start: Values) -> Alternative:
    """Make an end that is held by springs."""
    node = 1 if end == "left" else drawing.elements + 1
    names = {"rotation": "rotational_stiffness_Nm_rad", "translation": "translational_stiffness_N_m"}
    location = {"end": end, "nodes": [node]}

    def build(values: Values) -> Effect:
        springs = (values.get(names["rotation"]), values.get(names["translation"]))
        return Effect(
            name="boundary_compliance",
            location=location,
            change_reality=lambda reality: replace(reality, released={**reality.released, end: springs}),
        )

    start = {names[motion]: start[names[motion]] for motion in released}
    return Alternative(name="boundary_compliance", location=location, build=build, start=start)


def _make_damping_level(target: EffectTarget, ratio: float) -> Alternative:
    nominal_ratio = target.set_up.damping_ratio

    def build(values: Values) -> Effect:
        return Effect(name="damping_level", damping_factor=values["modal_ratio"] / nominal_ratio)

    return Alternative(name="damping_level", location={}, build=build, start={"modal_ratio": ratio})


def _make_structural_damping(target: EffectTarget, loss_factor: float) -> Alternative:
    def build(values: Values) -> Effect:
        modulus = make_lossy_modulus(values["loss_factor"], target.set_up.band_hz)
        return Effect(name="structural_damping", modulus=modulus)

    return Alternative(name="structural_damping", location={}, build=build, start={"loss_factor": loss_factor})


def _make_delay(channel: str, delay_s: float) -> Alternative:
    def build(values: Values) -> Effect:
        return Effect(name="time_delay", gains={channel: lambda s: np.exp(-s * values["delay_s"])})

    return Alternative(name="time_delay", location={"channels": [channel]}, build=build, start={"delay_s": delay_s})


def _make_filter(channel: str, kind: str, corner_hz: float) -> Alternative:
    def build(values: Values) -> Effect:
        return Effect(name="sensor_dynamics", gains={channel: make_first_order_filter(kind, values["corner_hz"])})

    return Alternative(
        name="sensor_dynamics",
        location={"channels": [channel]},
        build=build,
        start={"corner_hz": corner_hz},
        fixed={"kind": kind},
    )


def _make_gain(channel: str, gain: float) -> Alternative:
    def build(values: Values) -> Effect:
        return Effect(
            name="sensor_gain", gains={channel: lambda s: np.full(s.shape, values["gain_ratio"], dtype=complex)}
        )

    return Alternative(name="sensor_gain", location={"channels": [channel]}, build=build, start={"gain_ratio": gain})


def _make_misplaced_sensor(channel: str, node: int) -> Alternative:
    effect = Effect(name="sensor_misplaced", sensor_nodes={channel: node})
    location = {"channels": [channel], "nodes": [node]}
    return Alternative(name="sensor_misplaced", location=location, build=lambda _values: effect, start={})


def _list_neighbours(target: EffectTarget, node: int, count: int = 2) -> list[int]:
    """List the nodes next to a node that move."""
    positions = {number: np.array(position) for number, position in target.structure.nodes.items()}

    def distance(neighbour: int) -> float:
        return float(np.linalg.norm(positions[neighbour] - positions[node]))

    return sorted((neighbour for neighbour in target.nodes if neighbour != node), key=distance)[:count]


def _middle_of_band(target: EffectTarget) -> float:
    """Return the angular frequency of the middle of the band."""
    return float(2 * np.pi * np.sqrt(np.prod(target.set_up.band_hz)))


def _spring_of_frame(target: EffectTarget, spring_id: str) -> Spring:
    drawing = target.specimen.drawing
    if not isinstance(drawing, FrameDrawing):
        raise TypeError(f"springs are parts of frames, not of a {type(drawing).__name__}")
    return drawing.spring(spring_id)


def _list_for_mass(target: EffectTarget, effect: Effect) -> list[Alternative]:
    node, mass = effect.location["nodes"][0], effect.parameters["mass_kg"]
    alternatives = [_make_mass(target, neighbour, mass) for neighbour in _list_neighbours(target, node)]
    drawing = target.specimen.drawing
    if isinstance(drawing, BeamDrawing):
        first = int(np.clip(node - 1, 1, drawing.elements - 1))
        alternatives.append(_make_segment_stiffness((first, first + 1), 0.7))
    return alternatives


def _list_for_spring(target: EffectTarget, effect: Effect) -> list[Alternative]:
    node, stiffness = effect.location["nodes"][0], effect.parameters["stiffness_N_m"]
    neighbours = _list_neighbours(target, node)
    alternatives = [_make_grounded_spring(target, neighbour, stiffness) for neighbour in neighbours]
    slow_s = 10 / (2 * np.pi * target.set_up.band_hz[0])
    alternatives.append(_make_joint({"nodes": [node]}, (target.point(node), None), "stiffness_N_m", stiffness, slow_s))
    drawing = target.specimen.drawing
    if isinstance(drawing, FrameDrawing):
        for spring in drawing.springs:
            if spring.nodes == (0, node):
                ratio = 1 + stiffness / spring.stiffness_n_m
                alternatives.append(_make_local_stiffness(spring.id, {"springs": [spring.id]}, ratio))
    return alternatives


def _list_for_coupling(target: EffectTarget, effect: Effect) -> list[Alternative]:
    (a, b), stiffness = effect.location["nodes"], effect.parameters["stiffness_N_m"]
    alternatives = [_make_grounded_spring(target, node, stiffness) for node in (a, b)]
    pairs = [(neighbour, b) for neighbour in _list_neighbours(target, a, 1)]
    pairs += [(a, neighbour) for neighbour in _list_neighbours(target, b, 1)]
    for first, second in pairs:
        if first != second:
            motion = (target.point(first), target.point(second))
            location = {"nodes": sorted((first, second))}
            alternatives.append(_make_spring("coupling_spring", location, motion, stiffness))
    return alternatives


def _list_for_resonator(target: EffectTarget, effect: Effect) -> list[Alternative]:
    node, values = effect.location["nodes"][0], dict(effect.parameters)
    stiffness = values["mass_kg"] * (2 * np.pi * values["frequency_hz"]) ** 2
    return [
        *(_make_resonator(target, neighbour, values) for neighbour in _list_neighbours(target, node)),
        _make_mass(target, node, values["mass_kg"]),
        _make_grounded_spring(target, node, stiffness),
        _make_damper(target, node, stiffness / _middle_of_band(target)),
    ]


def _list_for_damper(target: EffectTarget, effect: Effect) -> list[Alternative]:
    node, damping = effect.location["nodes"][0], effect.parameters["damping_Ns_m"]
    fast_s = 0.1 / (2 * np.pi * target.set_up.band_hz[1])
    return [
        *(_make_damper(target, neighbour, damping) for neighbour in _list_neighbours(target, node)),
        _make_joint({"nodes": [node]}, (target.point(node), None), "stiffness_N_m", damping / fast_s, fast_s),
        _make_damping_level(target, 1.5 * target.set_up.damping_ratio),
    ]


def _list_for_joint(target: EffectTarget, effect: Effect) -> list[Alternative]:
    name = next(key for key in effect.parameters if "stiffness" in key)
    stiffness, time = effect.parameters[name], effect.parameters["relaxation_time_s"]
    if "springs" in effect.location:
        spring = _spring_of_frame(target, effect.location["springs"][0])
        first, second = sorted(spring.nodes)
        ratio = 1 + 0.5 * stiffness / spring.stiffness_n_m
        stiffer = _make_local_stiffness(spring.id, {"springs": [spring.id]}, ratio)
        if first:
            return [stiffer]
        motion = spring_extension(target, spring.id)
        return [stiffer, _make_joint({"nodes": [second]}, motion, name, stiffness, time)]
    node = effect.location["nodes"][0]
    if "rotational" in name:
        return [_make_damping_level(target, 1.5 * target.set_up.damping_ratio)]
    return [
        _make_grounded_spring(target, node, 0.5 * stiffness),
        _make_damper(target, node, stiffness * time),
        *(
            _make_joint({"nodes": [neighbour]}, (target.point(neighbour), None), name, stiffness, time)
            for neighbour in _list_neighbours(target, node)
        ),
    ]


def _list_for_local_stiffness(target: EffectTarget, effect: Effect) -> list[Alternative]:
    ratio = effect.parameters["stiffness_ratio"]
    drawing = target.specimen.drawing
    if "springs" in effect.location and isinstance(drawing, FrameDrawing):
        spring = drawing.spring(effect.location["springs"][0])
        change = (ratio - 1) * spring.stiffness_n_m
        if 0 in spring.nodes:
            return [_make_grounded_spring(target, max(spring.nodes), change)]
        motion = spring_extension(target, spring.id)
        return [_make_spring("coupling_spring", {"nodes": sorted(spring.nodes)}, motion, change)]
    if "elements" not in effect.location or not isinstance(drawing, BeamDrawing):
        return []
    first, last = effect.location["elements"]
    segments = [(first - 1, last - 1), (first + 1, last + 1), (first - 1, last), (first, last + 1)]
    segments += [(first + 1, last), (first, last - 1)] if last > first else []
    return [
        _make_segment_stiffness(segment, ratio)
        for segment in segments
        if segment[0] >= 1 and segment[1] <= drawing.elements
    ]


def _list_for_boundary(target: EffectTarget, effect: Effect) -> list[Alternative]:
    drawing = target.specimen.drawing
    if not isinstance(drawing, BeamDrawing):
        return []
    end, values = effect.location["end"], dict(effect.parameters)
    alternatives = []
    if len(values) == 2:
        alternatives += [_make_boundary(drawing, end, (motion,), values) for motion in ("rotation", "translation")]
    for count in (1, 3):
        elements = (1, count) if end == "left" else (drawing.elements - count + 1, drawing.elements)
        alternatives.append(_make_segment_stiffness(elements, 0.5))
    return alternatives


def _list_for_damping_level(target: EffectTarget, effect: Effect) -> list[Alternative]:
    return [_make_structural_damping(target, 2 * effect.parameters["modal_ratio"])]


def _list_for_structural_damping(target: EffectTarget, effect: Effect) -> list[Alternative]:
    return [_make_damping_level(target, effect.parameters["loss_factor"] / 2)]


def _list_for_delay(_target: EffectTarget, effect: Effect) -> list[Alternative]:
    channel, delay = effect.location["channels"][0], effect.parameters["delay_s"]
    return [_make_filter(channel, "lowpass", 1 / (2 * np.pi * delay))]


def _list_for_filter(_target: EffectTarget, effect: Effect) -> list[Alternative]:
    channel, corner = effect.location["channels"][0], effect.parameters["corner_hz"]
    if effect.parameters["kind"] == "highpass":
        return [_make_gain(channel, 0.95)]
    return [_make_delay(channel, 1 / (2 * np.pi * corner)), _make_gain(channel, 0.95)]


def _list_for_gain(target: EffectTarget, effect: Effect) -> list[Alternative]:
    """With one sensor the other channel, the other way round."""
    channel, gain = effect.location["channels"][0], effect.parameters["gain_ratio"]
    return [_make_gain(column, 1 / gain) for column in target.columns if column != channel]


def _list_for_misplaced_sensor(target: EffectTarget, effect: Effect) -> list[Alternative]:
    channel, node = effect.location["channels"][0], effect.location["nodes"][0]
    stated_node = {sensor.column: sensor.node for sensor in target.set_up.sensors}[channel]
    neighbours = [neighbour for neighbour in _list_neighbours(target, node) if neighbour != stated_node]
    return [*(_make_misplaced_sensor(channel, neighbour) for neighbour in neighbours), _make_gain(channel, 0.8)]


def _list_for_unknown(target: EffectTarget, effect: Effect) -> list[Alternative]:
    """List what the catalogue has for the channels or nodes of an effect outside it, and for damping."""
    low, high = target.set_up.band_hz
    alternatives = []
    for channel in effect.location.get("channels", ()):
        alternatives += [_make_gain(channel, 0.9), _make_delay(channel, 0.02 / high)]
        alternatives += [_make_filter(channel, "lowpass", 3 * high), _make_filter(channel, "highpass", low / 3)]
    nodes = effect.location.get("nodes", [])
    for node in nodes[:: max(1, len(nodes) // 2)]:
        motion = (target.point(node), None)
        stiffness, middle = 0.3 * target.stiffness(motion), _middle_of_band(target)
        resonator = {"mass_kg": stiffness / middle**2, "frequency_hz": middle / (2 * np.pi), "damping_ratio": 0.02}
        alternatives += [
            _make_grounded_spring(target, node, stiffness),
            _make_mass(target, node, resonator["mass_kg"]),
            _make_resonator(target, node, resonator),
            _make_damper(target, node, target.damping(motion)),
            _make_joint({"nodes": [node]}, motion, "stiffness_N_m", stiffness, 1 / middle),
        ]
    ratio = target.set_up.damping_ratio
    return [*alternatives, _make_damping_level(target, 1.2 * ratio), _make_structural_damping(target, 0.5 * ratio)]
