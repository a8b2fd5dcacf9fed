"""One blind case: what a user hands in, and the sealed truth."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from frf_testbench.simulator.cases.alternatives import fit_alternatives
from frf_testbench.simulator.cases.detectability import (
    FrfNoise,
    compare_frfs,
    compare_levels,
    compare_steps,
    measure_visibility,
    predict_frf_noise,
    round_to_four_digits,
)
from frf_testbench.simulator.cases.files import file_name, write_model, write_recording, write_test
from frf_testbench.simulator.cases.frf_distance import make_distance
from frf_testbench.simulator.cases.records import (
    Excitation,
    digitise,
    draw_excitations,
    draw_noise,
    group_by_file,
    peak_motion,
    simulate_records,
)
from frf_testbench.simulator.cases.scatter import Scatter, draw_scatter, make_zero_scatter
from frf_testbench.simulator.cases.system import TrueSystem, build_system
from frf_testbench.simulator.cases.truth import GENERATOR, compute_point_frfs, describe_case, estimate_frf
from frf_testbench.simulator.effects.catalogue import depends_on_level, draw_effects, select_effects
from frf_testbench.simulator.effects.effect import Effect, EffectTarget
from frf_testbench.simulator.set_up import MARGIN, SetUp, draw_set_up, is_reached, select_moving_nodes
from frf_testbench.simulator.signals.channels import Noise
from frf_testbench.simulator.signals.receptance import solve_modes
from frf_testbench.simulator.specimens import KINDS, Specimen, draw_specimen
from frf_testbench.simulator.structures.nominal import NominalModel

FloatArray = NDArray[np.float64]

ATTEMPTS = 60
WEIGHTS = {"frame": 2.5, "grid": 2.0, "plate": 1.5, "stepped": 1.5}  # of the kinds of specimens; 1 for all others
MOST_COARSE = 1.5e-4  # error of a nominal frequency in band: a model that a user would trust
LEAST_RATIO = 3.0  # of the change of the FRFs over their noise, RMS: below, nobody could see the effect
LEAST_LEVEL_CHANGE = 0.01  # of responses at different levels: less is hidden by the noise of a weak impact
MOST_STEP_CHANGE = 0.02  # of the loudest responses when the step is doubled: more, and they are chaotic
MOST_REMAINING_MOTION = 0.5  # of the motion at the end of a record: more, and it is a structure that feeds itself


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Case:
    """A complete case in memory.

    Parameters
    ----------
    system, base_system, ideal_system : TrueSystem
        With the effects; without them; without them and without scatter.
    nominal_model : NominalModel
        What the owner of the specimen has.
    excitations : tuple of Excitation
        Of all records.
    stored : (n_records, n_channels, n_samples) array
        Recordings in the channels' units.
    noise : tuple of Noise
        Of the channels.
    truth : dict
        What ``diagnosis.json`` is judged by.
    points : dict of str to array
        True FRFs at the points of interest, long form.
    """

    system: TrueSystem
    base_system: TrueSystem
    ideal_system: TrueSystem
    nominal_model: NominalModel
    excitations: tuple[Excitation, ...]
    stored: FloatArray
    noise: tuple[Noise, ...]
    truth: dict[str, Any]
    points: dict[str, NDArray[np.generic]]

    def write(self, folder: Path, truth: Path) -> None:
        """Write what a user hands in to `folder`, and the answers to `truth` (JSON) and beside it (CSV)."""
        set_up, specimen = self.system.set_up, self.system.specimen
        write_model(folder, specimen, self.nominal_model, set_up.damping_ratio)
        write_test(folder, specimen, set_up)
        columns = ("force", *(sensor.column for sensor in set_up.sensors))
        records = iter(self.stored)
        for file in group_by_file(self.excitations, set_up):
            signals = np.concatenate([next(records) for _ in file], axis=1)
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
class _PreparedTest:
    """A specimen in its test, before something is concealed."""

    specimen: Specimen
    set_up: SetUp
    nominal_model: NominalModel
    scatter: Scatter
    base_system: TrueSystem
    ideal_system: TrueSystem
    excitations: tuple[Excitation, ...]
    noise: tuple[Noise, ...]
    frf_noise: FrfNoise
    target: EffectTarget


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
        names, kinds = select_effects(rng, effect, KINDS)
        weights = np.array([WEIGHTS.get(kind, 1.0) for kind in kinds])
        prepared = _prepare(rng, structure or str(rng.choice(kinds, p=weights / weights.sum())), names)
        if prepared is None:
            continue
        effects = draw_effects(rng, names, prepared.target)
        if effects is None:
            continue
        case = _finish(
            rng, prepared, effects, head={"seed": seed, "attempt": attempt, "effect_asked": effect}, analyse=analyse
        )
        if case is not None:
            return case
    raise RuntimeError(f"no specimen was found for the effect '{effect}' with seed {seed} in {ATTEMPTS} attempts")


def _prepare(rng: np.random.Generator, kind: str, names: tuple[str, ...]) -> _PreparedTest | None:
    """Draw a specimen and its test; None where its nominal model is too coarse, or no force moves a sensor."""
    thick = "shear_rotary_inertia" in names
    specimen = draw_specimen(rng, kind, thick_euler=thick)
    drawn = specimen.build()
    modes = solve_modes(drawn)
    set_up = draw_set_up(rng, specimen, drawn, modes, levels=depends_on_level(names))
    if not is_reached(drawn, modes, set_up):
        return None
    nominal_model = specimen.build_nominal_model()
    nominal_hz = solve_modes(nominal_model.structure()).frequencies_hz
    inside = np.flatnonzero((modes.frequencies_hz >= set_up.band_hz[0]) & (modes.frequencies_hz <= set_up.band_hz[1]))
    if np.abs(nominal_hz[inside] / modes.frequencies_hz[inside] - 1).max() > MOST_COARSE:
        return None
    first = float(modes.frequencies_hz[drawn.n_rigid])
    scatter = draw_scatter(rng, specimen, set_up, first)
    base_system = build_system(specimen, set_up, scatter, ())
    ideal_system = build_system(specimen, set_up, make_zero_scatter(specimen, set_up, first), ())
    excitations = draw_excitations(rng, set_up, double_hit=rng.random() < 0.12)
    loudest = max(
        excitations, key=lambda excitation: excitation.rms_n or (excitation.impact.peak_n if excitation.impact else 0.0)
    )
    signals, _ = simulate_records(base_system, (loudest,))
    noise = draw_noise(rng, signals)
    target = EffectTarget(
        specimen=specimen,
        set_up=set_up,
        structure=drawn,
        modes=modes,
        nodes=tuple(select_moving_nodes(drawn, modes, set_up.band_hz, MARGIN)),
        mass_kg=specimen.mass_kg,
        peak_motion=lambda motion: peak_motion(ideal_system, excitations, motion),
        peak_vibration=lambda motion: peak_motion(ideal_system, excitations, motion, drifting=False)[0],
    )
    return _PreparedTest(
        specimen=specimen,
        set_up=set_up,
        nominal_model=nominal_model,
        scatter=scatter,
        base_system=base_system,
        ideal_system=ideal_system,
        excitations=excitations,
        noise=noise,
        frf_noise=predict_frf_noise(base_system, excitations, noise),
        target=target,
    )


def _finish(
    rng: np.random.Generator,
    prepared: _PreparedTest,
    effects: tuple[Effect, ...],
    *,
    head: dict[str, Any],
    analyse: bool,
) -> Case | None:
    """Simulate the test with the effects; None where nobody could see them, or where the structure is not stable."""
    system = build_system(prepared.specimen, prepared.set_up, prepared.scatter, effects)
    visible = measure_visibility(prepared.frf_noise, prepared.ideal_system, system)
    if not _is_visible(visible, effects):
        return None
    try:
        signals, points = simulate_records(system, prepared.excitations)
    except FloatingPointError:
        return None
    remaining_motion = _measure_remaining_motion(signals, system)
    if remaining_motion > MOST_REMAINING_MOTION:
        return None
    if any(effect.law for effect in effects):
        visible["step_change"] = round_to_four_digits(compare_steps(system, prepared.excitations, signals))
        if visible["step_change"] > MOST_STEP_CHANGE:
            return None
    if _depends_on_record(effects):
        visible |= _compare_levels(prepared, system, signals)
        if visible["level_ratio_rms"] < LEAST_RATIO or visible["level_change"] < LEAST_LEVEL_CHANGE:
            return None
    stored, full_scale = digitise(rng, signals, prepared.noise, prepared.set_up)
    truth = {"generator": GENERATOR} | head
    truth |= describe_case(prepared.ideal_system, system, prepared.nominal_model, prepared.excitations, prepared.noise)
    if analyse and not _depends_on_record(effects):
        truth |= _weigh_alternatives(prepared, system, visible)
    truth["noise"]["full_scale"] = [round_to_four_digits(value) for value in full_scale]
    truth["detectability"] = visible | {"left_at_end": round_to_four_digits(remaining_motion)}
    return Case(
        system=system,
        base_system=prepared.base_system,
        ideal_system=prepared.ideal_system,
        nominal_model=prepared.nominal_model,
        excitations=prepared.excitations,
        stored=stored,
        noise=prepared.noise,
        truth=truth,
        points=compute_point_frfs(system, prepared.excitations, signals, points),
    )


def _weigh_alternatives(prepared: _PreparedTest, system: TrueSystem, visible: dict[str, Any]) -> dict[str, Any]:
    """Measure the evidence for each effect, and find what may explain a single one as well; adds to `visible`."""
    if not system.effects:
        return {}
    distance = make_distance(system, prepared.frf_noise)
    frequencies = distance.frequencies_hz
    without_scatter = build_system(prepared.specimen, prepared.set_up, prepared.ideal_system.scatter, system.effects)
    visible["scatter_nats"] = round_to_four_digits(distance.measure(without_scatter.measured_frf(frequencies)))
    visible["evidence_nats"] = round_to_four_digits(distance.measure(prepared.base_system.measured_frf(frequencies)))
    if len(system.effects) > 1:
        for i, change in enumerate(visible["each"]):
            other_effects = system.effects[:i] + system.effects[i + 1 :]
            without = build_system(prepared.specimen, prepared.set_up, prepared.scatter, other_effects)
            change["evidence_nats"] = round_to_four_digits(distance.measure(without.measured_frf(frequencies)))
        return {}
    alternatives = fit_alternatives(prepared.target, system, distance)
    equivalents = alternatives.pop("equivalents")
    visible |= alternatives
    return {"equivalents": equivalents}


def _compare_levels(prepared: _PreparedTest, system: TrueSystem, signals: FloatArray) -> dict[str, Any]:
    """Compare with what the structure would do without laws, saturation and drift."""
    linear_effects = [effect for effect in system.effects if not _depends_on_record((effect,))]
    linear = build_system(prepared.specimen, prepared.set_up, prepared.scatter, linear_effects)
    without, _ = simulate_records(linear, prepared.excitations)
    units = np.array([sensor.unit_si for sensor in prepared.set_up.sensors])
    frfs = [
        np.stack(
            [
                estimate_frf(x[records, 1:], x[records, :1], prepared.set_up)
                for records in _group_by_point(prepared.excitations, len(prepared.set_up.excited_points))
            ],
            axis=2,
        )
        * units[:, None]
        for x in (signals, without)
    ]
    return compare_frfs(prepared.frf_noise, *frfs) | compare_levels(
        signals, without, prepared.noise, prepared.excitations, system
    )


def _group_by_point(excitations: tuple[Excitation, ...], n_points: int) -> list[list[int]]:
    """Return indices of the records of each excited point."""
    return [[i for i, excitation in enumerate(excitations) if excitation.point == point] for point in range(n_points)]


def _depends_on_record(effects: tuple[Effect, ...]) -> bool:
    """Whether the FRFs of single records differ."""
    return any(not effect.is_linear or effect.drift for effect in effects)


def _is_visible(visible: dict[str, Any], effects: tuple[Effect, ...]) -> bool:
    """Whether each effect that changes the linear FRFs does so beyond the noise."""
    linear = [effect.is_linear and not effect.drift for effect in effects]
    changes = visible.get("each", [visible])
    return all(change["ratio_rms"] >= LEAST_RATIO for change, counts in zip(changes, linear, strict=False) if counts)


def _measure_remaining_motion(signals: FloatArray, system: TrueSystem) -> float:
    """Measure the largest motion in the last part of a record over the largest one; of a shaker, after a burst."""
    if system.set_up.kind == "random" and system.set_up.burst == 1.0:
        return 0.0
    tail = np.abs(signals[:, 1:, -signals.shape[2] // 50 :]).max(axis=2)
    return float((tail / np.abs(signals[:, 1:]).max(axis=2)).max())
