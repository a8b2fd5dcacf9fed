"""Supports that the model has and the machine does not, or the other way round."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.assessment.causes.cause import Cause
from frf_ipz.assessment.causes.modal_comparison import computed_modes
from frf_ipz.errors import FrfIpzError
from frf_ipz.fe.eigen import solve_modes

if TYPE_CHECKING:
    from frf_ipz.assessment.causes.cause import Situation
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
        One an end and condition.
    """
    if situation.model.kind != "beam":
        return
    needed = {dof for label in situation.measured.labels for dof in (label.output_dof, label.input_dof)}
    for end, place in ENDS.items():
        node = int(situation.model.geometry.nodes[place])
        for condition, held in CONDITIONS.items():
            try:
                model = _with_end(situation.model, node, held)
                if np.array_equal(model.fixed, situation.model.fixed):
                    continue
                model.rows(list(needed))  # refuses DOFs that would be held
                modes = solve_modes(model, n_modes=min(len(situation.computed.frequency_hz) + 2, model.n_modes))
            except FrfIpzError:
                continue
            says = f'the {end} end seems to be {condition}: write {end} = "{condition}"'
            yield Cause(
                says=says,
                file=situation.model_file,
                line_or_key=f"[beam] {end}",
                computed=computed_modes(modes),
                log_prior=-float(np.log(len(ENDS) * (len(CONDITIONS) - 1))),
            )


def _with_end(model: StructuralModel, node: int, held: tuple[str, ...]) -> StructuralModel:
    rows = zip(model.all_dofs, model.fixed, strict=True)
    fixed = [dof.direction in held if dof.node == node else bool(is_held) for dof, is_held in rows]
    return replace(model, fixed=np.array(fixed))
