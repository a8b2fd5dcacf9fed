"""Supports that the model has and the machine does not, or the other way round."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.assessment.causes.cause import Cause
from frf_ipz.assessment.causes.modal_comparison import computed_modes
from frf_ipz.errors import FrfIpzError
from frf_ipz.fe.eigen import solve_modes

if TYPE_CHECKING:
    from frf_ipz.assessment.causes.cause import Situation
    from frf_ipz.assessment.causes.modal_comparison import ComputedModes
    from frf_ipz.structure import StructuralModel

ENDS = {"left": 0, "right": -1}
CONDITIONS = {"clamped": ("z", "ry"), "pinned": ("z",), "sliding": ("ry",), "free": ()}


def other_supports(situation: Situation) -> Iterator[Cause]:
    """List other conditions of the two ends of a beam.

    Parameters
    ----------
    situation : Situation
        Measurement and model.

    Yields
    ------
    Cause
        One an end and condition, and one of both ends exchanged.
    """
    if situation.model.kind != "beam":
        return
    changes: list[tuple[str, str, dict[str, tuple[str, ...]]]] = [
        (f'the {end} end seems to be {condition}: write {end} = "{condition}"', f"[beam] {end}", {end: held})
        for end in ENDS
        for condition, held in CONDITIONS.items()
    ]
    held_now = {end: _held_at(situation.model, end) for end in ENDS}
    exchanged = {"left": held_now["right"], "right": held_now["left"]}
    changes.append(
        ("the beam seems to be held at the other end: exchange left and right", "[beam] left, right", exchanged)
    )
    others = [change for change in changes if any(held_now[end] != held for end, held in change[2].items())]
    for says, key, ends in others:
        modes = _modes_with(situation, ends)
        if modes is not None:
            log_prior = -float(np.log(len(others)))
            yield Cause(says=says, file=situation.model_file, line_or_key=key, computed=modes, log_prior=log_prior)


def _modes_with(situation: Situation, ends: Mapping[str, tuple[str, ...]]) -> ComputedModes | None:
    """Compute the modes with other supports; None where a measured DOF would be held."""
    model, labels = situation.model, situation.measured.labels
    needed = {dof for label in labels for dof in (label.output_dof, label.input_dof)}
    try:
        for end, held in ends.items():
            model = _with_end(model, int(model.geometry.nodes[ENDS[end]]), held)
        model.rows(list(needed))
        return computed_modes(solve_modes(model, n_modes=min(len(situation.computed.frequency_hz) + 2, model.n_modes)))
    except FrfIpzError:
        return None


def _held_at(model: StructuralModel, end: str) -> tuple[str, ...]:
    node = int(model.geometry.nodes[ENDS[end]])
    rows = zip(model.all_dofs, model.fixed, strict=True)
    return tuple(dof.direction for dof, is_held in rows if dof.node == node and is_held)


def _with_end(model: StructuralModel, node: int, held: tuple[str, ...]) -> StructuralModel:
    rows = zip(model.all_dofs, model.fixed, strict=True)
    fixed = [dof.direction in held if dof.node == node else bool(is_held) for dof, is_held in rows]
    return replace(model, fixed=np.array(fixed))
