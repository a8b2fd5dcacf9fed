"""Twenty mistakes, each with what it does to a campaign and what a good answer names."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

if TYPE_CHECKING:
    import pandas as pd

    from frf_testbench.mistakes.campaign_files import CampaignFiles

STANDARD_GRAVITY = 9.80665
POUND_FORCE = 4.4482216152605
Apply: TypeAlias = "Callable[[CampaignFiles, np.random.Generator], bool]"


@dataclass(frozen=True, slots=True, kw_only=True)
class Mistake:
    """A mistake of a user.

    Parameters
    ----------
    name : str
        What it is called.
    apply : callable
        Makes it; gives False where it cannot be made with this campaign.
    file : str
        The file to correct: ``test.toml``, ``model.toml`` or a matrix.
    names : str
        Pattern that the line or key of a right answer matches.
    """

    name: str
    apply: Apply
    file: str
    names: str


def _all_outputs(factor: float) -> Apply:
    def apply(files: CampaignFiles, rng: np.random.Generator) -> bool:
        del rng
        columns = files.outputs
        files.edit_recordings(lambda table: table.assign(**{name: table[name] * factor for name in columns}))
        return True

    return apply


def _one_output(factor: float) -> Apply:
    def apply(files: CampaignFiles, rng: np.random.Generator) -> bool:
        if len(files.outputs) < 2:
            return False
        name = str(rng.choice(files.outputs))
        files.edit_recordings(lambda table: table.assign(**{name: table[name] * factor}))
        return True

    return apply


def _force(factor: float) -> Apply:
    def apply(files: CampaignFiles, rng: np.random.Generator) -> bool:
        del rng
        files.edit_recordings(lambda table: table.assign(force=table["force"] * factor))
        return True

    return apply


def _time(factor: float) -> Apply:
    def apply(files: CampaignFiles, rng: np.random.Generator) -> bool:
        del rng
        files.edit_recordings(lambda table: table.assign(time=table["time"] * factor))
        return True

    return apply


def _reverse_sensor(files: CampaignFiles, rng: np.random.Generator) -> bool:
    name = str(rng.choice(files.outputs))
    files.edit_recordings(lambda table: table.assign(**{name: -table[name]}))
    return True


def _exchange_columns(files: CampaignFiles, rng: np.random.Generator) -> bool:
    del rng
    name = files.outputs[0]
    files.edit_recordings(lambda table: _exchanged(table, "force", name))
    return True


def _exchanged(table: pd.DataFrame, first: str, second: str) -> pd.DataFrame:
    return table.assign(**{first: table[second], second: table[first]})


def _exchange_sensors(files: CampaignFiles, rng: np.random.Generator) -> bool:
    dofs = [f'dof = "{dof}"' for dof in files.sensor_dofs]
    if len(dofs) < 2:
        return False
    channels, records = files.channels_and_records
    first, second = rng.choice(dofs, 2, replace=False)
    files.edit_test(lambda _: _swapped(channels, str(first), str(second)) + records)
    return True


def _exchange_excited(files: CampaignFiles, rng: np.random.Generator) -> bool:
    dofs = [f'dof = "{dof}"' for dof in files.excited_dofs]
    if len(dofs) < 2:
        return False
    channels, records = files.channels_and_records
    first, second = rng.choice(dofs, 2, replace=False)
    files.edit_test(lambda _: channels + _swapped(records, str(first), str(second)))
    return True


def _swapped(text: str, first: str, second: str) -> str:
    return text.replace(first, "\0").replace(second, first).replace("\0", second)


def _move_sensor(files: CampaignFiles, rng: np.random.Generator) -> bool:
    """Write a wrong node at a sensor, far from where it sits."""
    dofs = files.sensor_dofs
    if len(dofs) < 2 or not files.is_beam:
        return False
    elements = re.search(r"elements = (\d+)", files.model)
    if elements is None:
        return False
    nodes = int(elements[1]) + 1
    dof = str(rng.choice(dofs))
    node, direction = dof.split(":")
    wrong = (int(node) + int(rng.integers(nodes // 4, 3 * nodes // 4))) % nodes
    held = {1: "left", nodes: "right"}
    if wrong < 1 or (wrong in held and f'{held[wrong]} = "free"' not in files.model):
        wrong = nodes // 2
    head, tail = files.test.split(f'dof = "{dof}"', 1)
    files.edit_test(lambda _: f'{head}dof = "{wrong}:{direction}"{tail}')
    return True


def _wrong_quantity(files: CampaignFiles, rng: np.random.Generator) -> bool:
    del rng
    if "acceleration" not in files.test:
        return False
    files.edit_test(lambda text: text.replace('"acceleration"', '"velocity"').replace('"m/s^2"', '"m/s"'))
    return True


def _model_value(key: str, factor: float) -> Apply:
    def apply(files: CampaignFiles, rng: np.random.Generator) -> bool:
        del rng
        if not files.is_beam:
            return False
        files.scale_value(key, factor)
        return True

    return apply


def _matrices(mass: float, stiffness: float) -> Apply:
    def apply(files: CampaignFiles, rng: np.random.Generator) -> bool:
        del rng
        if not files.has_matrices:
            return False
        files.scale_matrix("M", mass)
        files.scale_matrix("K", stiffness)
        return True

    return apply


def _other_end(files: CampaignFiles, rng: np.random.Generator) -> bool:
    """Hold the wrong end of a beam."""
    del rng
    ends = re.findall(r'^(left|right) = "(\w+)"', files.model, re.MULTILINE)
    if not files.is_beam or len(ends) < 2 or ends[0][1] == ends[1][1]:
        return False
    files.edit_model(lambda text: _swapped(text, f'= "{ends[0][1]}"', f'= "{ends[1][1]}"'))
    return True


def _clamp_free_end(files: CampaignFiles, rng: np.random.Generator) -> bool:
    del rng
    if not files.is_beam or 'right = "free"' not in files.model:
        return False
    last = re.search(r"elements = (\d+)", files.model)
    pipeline = (files.folder / "pipeline.toml").read_text(encoding="utf-8")
    if last is None or f'"{int(last[1]) + 1}:' in files.test + pipeline:
        return False
    files.edit_model(lambda text: text.replace('right = "free"', 'right = "clamped"'))
    return True


TEST, MODEL = "test.toml", "model.toml"
MISTAKES = (
    Mistake(name="acceleration in g", apply=_all_outputs(1 / STANDARD_GRAVITY), file=TEST, names="unit|sensitivity"),
    Mistake(name="one sensor in g", apply=_one_output(1 / STANDARD_GRAVITY), file=TEST, names="unit|sensitivity"),
    Mistake(name="acceleration in mm/s^2", apply=_all_outputs(1e3), file=TEST, names="unit|sensitivity"),
    Mistake(name="force in lbf", apply=_force(1 / POUND_FORCE), file=TEST, names="unit|sensitivity"),
    Mistake(name="force in kN", apply=_force(1e-3), file=TEST, names="unit|sensitivity"),
    Mistake(name="sensor reversed", apply=_reverse_sensor, file=TEST, names="dof"),
    Mistake(name="force reversed", apply=_force(-1.0), file=TEST, names="dof|force"),
    Mistake(name="sensors exchanged", apply=_exchange_sensors, file=TEST, names="dof"),
    Mistake(name="excited points exchanged", apply=_exchange_excited, file=TEST, names="dof"),
    Mistake(name="sensor at a wrong node", apply=_move_sensor, file=TEST, names="dof"),
    Mistake(name="columns exchanged", apply=_exchange_columns, file=TEST, names="column"),
    Mistake(name="velocity for acceleration", apply=_wrong_quantity, file=TEST, names="quantity"),
    Mistake(name="time in ms", apply=_time(1e3), file=TEST, names="time"),
    Mistake(name="modulus of another metal", apply=_model_value("youngs_modulus_Pa", 3.0), file=MODEL, names="modulus"),
    Mistake(name="modulus in GPa", apply=_model_value("youngs_modulus_Pa", 1e-9), file=MODEL, names="modulus"),
    Mistake(name="modulus off by ten", apply=_model_value("youngs_modulus_Pa", 0.1), file=MODEL, names="modulus"),
    Mistake(name="thickness in mm", apply=_model_value("thickness_m", 1e3), file=MODEL, names="thickness"),
    Mistake(name="density in g/cm^3", apply=_model_value("density_kg_m3", 1e-3), file=MODEL, names="density"),
    Mistake(name="wrong end held", apply=_other_end, file=MODEL, names="left|right"),
    Mistake(name="free end clamped", apply=_clamp_free_end, file=MODEL, names="right"),
    Mistake(name="matrices in mm, t, s", apply=_matrices(1e-3, 1e-3), file=MODEL, names="units|mass|stiffness"),
    Mistake(name="mass in t", apply=_matrices(1e-3, 1.0), file=MODEL, names="units|mass"),
    Mistake(name="stiffness in N/mm", apply=_matrices(1.0, 1e-3), file=MODEL, names="units|stiffness"),
)
