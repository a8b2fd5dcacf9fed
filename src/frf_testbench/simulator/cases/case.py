"""One blind case: what a user hands in, and the sealed truth."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from frf_testbench.simulator.cases.campaign import Drive, draw_drives, draw_noise, files_of, store, swing, true_records
from frf_testbench.simulator.cases.detectability import Lines, change, four, level_change, make_lines, step_change
from frf_testbench.simulator.cases.files import file_name, write_model, write_recording, write_test
from frf_testbench.simulator.cases.nuisance import make_ruler
from frf_testbench.simulator.cases.scatter import Scatter, draw_scatter, no_scatter
from frf_testbench.simulator.cases.set_up import MARGIN, SetUp, draw_set_up, moving_nodes
from frf_testbench.simulator.cases.specimens import KINDS, Specimen, draw_specimen
from frf_testbench.simulator.cases.substitutes import compare
from frf_testbench.simulator.cases.truth import GENERATOR, average_frf, describe, point_frfs, visibility
from frf_testbench.simulator.cases.world import World, make_world
from frf_testbench.simulator.effects.catalogue import draw_effects, kinds_for, needs_levels
from frf_testbench.simulator.effects.effect import Bench, Effect
from frf_testbench.simulator.signals.channels import Noise
from frf_testbench.simulator.signals.receptance import solve_modes
from frf_testbench.simulator.structures.nominal import NominalModel

FloatArray = NDArray[np.float64]

ATTEMPTS = 60
WEIGHTS = {"frame": 2.5, "grid": 2.0, "plate": 1.5, "stepped": 1.5}  # of the kinds of specimens; 1 for all others
MOST_COARSE = 1.5e-4  # error of a nominal frequency in band: a model that a user would trust
LEAST_RATIO = 3.0  # of the change of the FRFs over their noise, RMS: below, nobody could see the effect
LEAST_LEVEL_CHANGE = 0.01  # of responses to blows of different levels: less is hidden by the noise of a weak blow
MOST_STEP_CHANGE = 0.02  # of the loudest responses when the step is doubled: more, and they are chaotic
MOST_LEFT = 0.5  # of the motion at the end of a record: more, and it is a structure that feeds itself


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Case:
    """A complete case in memory.

    Parameters
    ----------
    world, base, ideal : World
        With the effects; without them; without them and without scatter.
    nominal : NominalModel
        What the owner of the specimen has.
    drives : tuple of Drive
        Blows or records.
    stored : (n_drives, n_channels, n_samples) array
        Recordings in the channels' units.
    noise : tuple of Noise
        Of the channels.
    truth : dict
        What ``diagnosis.json`` is judged by.
    points : dict of str to array
        True FRFs at the points of interest, long form.
    """

    world: World
    base: World
    ideal: World
    nominal: NominalModel
    drives: tuple[Drive, ...]
    stored: FloatArray
    noise: tuple[Noise, ...]
    truth: dict[str, Any]
    points: dict[str, NDArray[np.generic]]

    def write(self, folder: Path, truth: Path) -> None:
        """Write what a user hands in to `folder`, and the answers to `truth` (JSON) and beside it (CSV)."""
        set_up, specimen = self.world.set_up, self.world.specimen
        write_model(folder, specimen, self.nominal, set_up.damping_ratio)
        write_test(folder, specimen, set_up)
        columns = ("force", *(sensor.column for sensor in set_up.sensors))
        blows = iter(self.stored)
        for file in files_of(self.drives, set_up):
            signals = np.concatenate([next(blows) for _ in file], axis=1)
            path = folder / f"{file_name(file, set_up)}.csv"
            write_recording(path, dict(zip(columns, signals, strict=True)), set_up.rate_hz)
        truth.parent.mkdir(parents=True, exist_ok=True)
        truth.write_text(json.dumps(self.truth, indent=1) + "\n", encoding="utf-8")
        if self.points:
            names = list(self.points)
            rows = zip(*(self.points[name].tolist() for name in names), strict=True)
            lines = [",".join(f"{v:.7g}" if isinstance(v, float) else str(v) for v in row) for row in rows]
            text = "\n".join([",".join(names), *lines]) + "\n"
            truth.with_name(f"{truth.stem}_points.csv").write_text(text, encoding="utf-8")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Ready:
    """A specimen on its bench, before something is concealed."""

    specimen: Specimen
    set_up: SetUp
    nominal: NominalModel
    scatter: Scatter
    base: World
    ideal: World
    drives: tuple[Drive, ...]
    noise: tuple[Noise, ...]
    lines: Lines
    bench: Bench


def make_case(seed: int, effect: str = "null", *, structure: str | None = None, analyse: bool = True) -> Case:
    """Make a blind case.

    Parameters
    ----------
    seed : int
        The same case comes out for the same seed, effect and structure.
    effect : str
        ``null``, the name of an effect of the contract, ``unknown`` or ``unknown:KIND``, ``pair`` or ``pair:A+B``.
    structure : str, optional
        One of the kinds of specimens; drawn among those that can have the effect.
    analyse : bool
        Measure the evidence for linear effects and look for others that explain the data as well.

    Returns
    -------
    Case
        Whose effects can be seen in the data.

    Raises
    ------
    RuntimeError
        If no specimen was found on which the effect can be seen.
    """
    for attempt in range(ATTEMPTS):
        rng = np.random.default_rng([seed, attempt])
        wanted, kinds = kinds_for(rng, effect, KINDS)
        weights = np.array([WEIGHTS.get(kind, 1.0) for kind in kinds])
        ready = _prepare(rng, structure or str(rng.choice(kinds, p=weights / weights.sum())), wanted)
        if ready is None:
            continue
        effects = draw_effects(rng, wanted, ready.bench)
        if effects is None:
            continue
        case = _finish(
            rng, ready, effects, head={"seed": seed, "attempt": attempt, "effect_asked": effect}, analyse=analyse
        )
        if case is not None:
            return case
    raise RuntimeError(f"no specimen was found for the effect '{effect}' with seed {seed} in {ATTEMPTS} attempts")


def _prepare(rng: np.random.Generator, kind: str, wanted: tuple[str, ...]) -> _Ready | None:
    """Draw a specimen and its test; None where its nominal model is too coarse for the band."""
    thick = "shear_rotary_inertia" in wanted
    specimen = draw_specimen(rng, kind, thick_euler=thick)
    drawn = specimen.build()
    modes = solve_modes(drawn)
    set_up = draw_set_up(rng, specimen, drawn, modes, levels=needs_levels(wanted))
    nominal = specimen.nominal()
    coarse = solve_modes(nominal.structure()).frequencies_hz
    inside = np.flatnonzero((modes.frequencies_hz >= set_up.band_hz[0]) & (modes.frequencies_hz <= set_up.band_hz[1]))
    if np.abs(coarse[inside] / modes.frequencies_hz[inside] - 1).max() > MOST_COARSE:
        return None
    first = float(modes.frequencies_hz[drawn.n_rigid])
    scatter = draw_scatter(rng, specimen, set_up, first)
    base = make_world(specimen, set_up, scatter, ())
    ideal = make_world(specimen, set_up, no_scatter(specimen, set_up, first), ())
    drives = draw_drives(rng, set_up, double_hit=rng.random() < 0.12)
    loudest = max(drives, key=lambda drive: drive.rms_n or (drive.blow.peak_n if drive.blow else 0.0))
    signals, _ = true_records(base, (loudest,))
    noise = draw_noise(rng, signals)
    bench = Bench(
        specimen=specimen,
        set_up=set_up,
        structure=drawn,
        modes=modes,
        nodes=tuple(moving_nodes(drawn, modes, set_up.band_hz, MARGIN)),
        mass_kg=specimen.mass_kg,
        swing=lambda motion: swing(ideal, drives, motion),
        vibration=lambda motion: swing(ideal, drives, motion, drifting=False)[0],
    )
    return _Ready(
        specimen=specimen,
        set_up=set_up,
        nominal=nominal,
        scatter=scatter,
        base=base,
        ideal=ideal,
        drives=drives,
        noise=noise,
        lines=make_lines(base, drives, noise),
        bench=bench,
    )


def _finish(
    rng: np.random.Generator, ready: _Ready, effects: tuple[Effect, ...], *, head: dict[str, Any], analyse: bool
) -> Case | None:
    """Simulate the test with the effects; None where nobody could see them, or where the structure is not stable."""
    world = make_world(ready.specimen, ready.set_up, ready.scatter, effects)
    visible = visibility(ready.lines, ready.ideal, world)
    if not _is_visible(visible, effects):
        return None
    try:
        signals, points = true_records(world, ready.drives)
    except FloatingPointError:
        return None
    left = _left_at_end(signals, world)
    if left > MOST_LEFT:
        return None
    if any(effect.law for effect in effects):
        visible["step_change"] = four(step_change(world, ready.drives, signals))
        if visible["step_change"] > MOST_STEP_CHANGE:
            return None
    if _depends_on_blow(effects):
        visible |= _by_level(ready, world, signals)
        if visible["level_ratio_rms"] < LEAST_RATIO or visible["level_change"] < LEAST_LEVEL_CHANGE:
            return None
    stored, full_scale = store(rng, signals, ready.noise, ready.set_up)
    truth = {"generator": GENERATOR} | head
    truth |= describe(ready.ideal, world, ready.nominal, ready.drives, ready.noise)
    if analyse and not _depends_on_blow(effects):
        truth |= _rivals(ready, world, visible)
    truth["noise"]["full_scale"] = [four(value) for value in full_scale]
    truth["detectability"] = visible | {"left_at_end": four(left)}
    return Case(
        world=world,
        base=ready.base,
        ideal=ready.ideal,
        nominal=ready.nominal,
        drives=ready.drives,
        stored=stored,
        noise=ready.noise,
        truth=truth,
        points=point_frfs(world, ready.drives, signals, points),
    )


def _rivals(ready: _Ready, world: World, visible: dict[str, Any]) -> dict[str, Any]:
    """Measure the evidence for each effect, and find what may explain a single one as well; adds to `visible`."""
    if not world.effects:
        return {}
    ruler = make_ruler(world, ready.lines)
    frequencies = ruler.frequencies_hz
    ideal = make_world(ready.specimen, ready.set_up, ready.ideal.scatter, world.effects)
    visible["scatter_nats"] = four(ruler.nats(ideal.measured_frf(frequencies)))
    visible["evidence_nats"] = four(ruler.nats(ready.base.measured_frf(frequencies)))
    if len(world.effects) > 1:
        for i, one in enumerate(visible["each"]):
            others = world.effects[:i] + world.effects[i + 1 :]
            without = make_world(ready.specimen, ready.set_up, ready.scatter, others)
            one["evidence_nats"] = four(ruler.nats(without.measured_frf(frequencies)))
        return {}
    found = compare(ready.bench, world, ruler)
    equivalents = found.pop("equivalents")
    visible |= found
    return {"equivalents": equivalents}


def _by_level(ready: _Ready, world: World, signals: FloatArray) -> dict[str, Any]:
    """Compare with what the structure would do without laws, saturation and drift."""
    linear_effects = [effect for effect in world.effects if not _depends_on_blow((effect,))]
    linear = make_world(ready.specimen, ready.set_up, ready.scatter, linear_effects)
    without, _ = true_records(linear, ready.drives)
    units = np.array([sensor.unit_si for sensor in ready.set_up.sensors])
    frfs = [
        np.stack([average_frf(one[mine, 1:], one[mine, :1], ready.set_up) for mine in _by_point(ready)], axis=2)
        * units[:, None]
        for one in (signals, without)
    ]
    return change(ready.lines, *frfs) | level_change(signals, without, ready.noise, ready.drives, world)


def _by_point(ready: _Ready) -> list[list[int]]:
    """Return indices of the blows of each struck point."""
    points = range(len(ready.set_up.struck))
    return [[i for i, drive in enumerate(ready.drives) if drive.struck == point] for point in points]


def _depends_on_blow(effects: tuple[Effect, ...]) -> bool:
    """Whether the FRFs of single blows differ."""
    return any(not effect.is_linear or effect.drift for effect in effects)


def _is_visible(visible: dict[str, Any], effects: tuple[Effect, ...]) -> bool:
    """Whether each effect that changes the linear FRFs does so beyond the noise."""
    linear = [effect.is_linear and not effect.drift for effect in effects]
    changes = visible.get("each", [visible])
    return all(one["ratio_rms"] >= LEAST_RATIO for one, counts in zip(changes, linear, strict=False) if counts)


def _left_at_end(signals: FloatArray, world: World) -> float:
    """Largest motion in the last part of a record over the largest one; of a shaker, what is left of a burst."""
    if world.set_up.kind == "random" and world.set_up.burst == 1.0:
        return 0.0
    tail = np.abs(signals[:, 1:, -signals.shape[2] // 50 :]).max(axis=2)
    return float((tail / np.abs(signals[:, 1:]).max(axis=2)).max())
