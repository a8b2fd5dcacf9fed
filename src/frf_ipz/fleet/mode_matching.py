"""Which pole or zero of one machine is which of another: by their counterpart in the FE model, then by shape.

Two machines that have a mode paired with the same mode of the model have the same mode, however many others lie below
it in one of them. What has no sure counterpart is matched among the machines: by the frequency, after a factor common
to a machine, and by the modal assurance of the shapes.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from frf_ipz.modes import modal_assurance
from frf_ipz.pairing.matching import match
from frf_ipz.pairing.poles import AMPLITUDE_STD, FREQUENCY_GATE, FREQUENCY_STD, MAX_SHAPE, UNMATCHED

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
    from frf_ipz.fleet.machine_record import Roots

Kind: TypeAlias = "tuple[str, int]"


@dataclass(kw_only=True, eq=False)
class _Group:
    """One mode, or one zero of an FRF, of the fleet: the logarithm of its frequency in each machine, and its shape."""

    frf: str
    logs: dict[int, float] = field(default_factory=dict)
    shape: ComplexArray | None = None
    dofs: tuple[str, ...] = ()

    @property
    def centre(self) -> float:
        return float(np.median(list(self.logs.values())))


def match_roots(machines: Sequence[Roots]) -> list[IntArray]:
    """Give the poles or zeros of all machines common numbers.

    Parameters
    ----------
    machines : sequence of Roots
        Poles, or zeros, of each machine.

    Returns
    -------
    list of (n,) int array
        For each machine the number of each of its roots in the fleet, from 1 by ascending frequency; zeros are
        numbered FRF by FRF.
    """
    groups: list[_Group] = []
    places: list[dict[int, _Group]] = [{} for _ in machines]
    known: dict[Kind, _Group] = {}
    for machine, roots in enumerate(machines):
        for root in np.flatnonzero(roots.counterpart >= 0).tolist():
            kind = roots.frf[root], int(roots.counterpart[root])
            if kind not in known:
                known[kind] = _Group(frf=kind[0])
                groups.append(known[kind])
            if machine not in known[kind].logs:
                _join(places, known[kind], machine, roots, root)
    # whoever has most of them says what there is; the others are held against it
    for machine in sorted(range(len(machines)), key=lambda place: (len(places[place]) - machines[place].count, place)):
        roots = machines[machine]
        for frf in dict.fromkeys(roots.frf):
            _match_rest(places, groups, machine, roots, frf)
    numbers: dict[int, int] = {}
    for frf in dict.fromkeys(group.frf for group in groups):
        ordered = sorted((group for group in groups if group.frf == frf), key=lambda group: group.centre)
        numbers |= {id(group): number for number, group in enumerate(ordered, start=1)}
    return [
        np.array([numbers[id(places[machine][root])] for root in range(roots.count)], int)
        for machine, roots in enumerate(machines)
    ]


def _match_rest(places: list[dict[int, _Group]], groups: list[_Group], machine: int, roots: Roots, frf: str) -> None:
    """Give the roots of a machine that have no group yet one that has none of this machine, or a new one."""
    of_frf = [root for root in range(roots.count) if roots.frf[root] == frf]
    rest = [root for root in of_frf if root not in places[machine]]
    free = [group for group in groups if group.frf == frf and machine not in group.logs]
    if not rest:
        return
    logs = np.log(roots.frequency_hz)
    offsets = [logs[root] - group.centre for root, group in places[machine].items() if group.frf == frf]
    offset = float(np.median(offsets)) if offsets else 0.0
    gaps = logs[rest][:, None] - np.array([group.centre for group in free]) - offset
    costs = (gaps / FREQUENCY_STD) ** 2 + _shape_costs(roots, rest, free)
    costs[np.abs(gaps) > FREQUENCY_GATE] = np.inf
    partner = match(costs, np.full(len(rest), UNMATCHED), np.zeros(len(free))).partner
    for root, column in zip(rest, partner.tolist(), strict=True):
        group = free[column] if column >= 0 else _Group(frf=frf)
        if column < 0:
            groups.append(group)
        _join(places, group, machine, roots, root)


def _join(places: list[dict[int, _Group]], group: _Group, machine: int, roots: Roots, root: int) -> None:
    group.logs[machine] = float(np.log(roots.frequency_hz[root]))
    if group.shape is None and len(roots.dofs):
        group.shape, group.dofs = roots.shapes[:, root], roots.dofs
    places[machine][root] = group


def _shape_costs(roots: Roots, rest: list[int], free: list[_Group]) -> FloatArray:
    """Squared distance of shapes at the DOFs that both have, as pairing with a model has it; 0 where there is one."""
    costs = np.zeros((len(rest), len(free)))
    for column, group in enumerate(free):
        common = [dof for dof in group.dofs if dof in roots.dofs]
        if group.shape is None or not common:
            continue
        here = roots.shapes[[roots.dofs.index(dof) for dof in common]][:, rest]
        there = group.shape[[group.dofs.index(dof) for dof in common], None]
        unlike = 1 - modal_assurance(here, there)[:, 0]
        costs[:, column] = np.minimum(unlike * np.sqrt(len(common)) / AMPLITUDE_STD**2, MAX_SHAPE)
    return costs
