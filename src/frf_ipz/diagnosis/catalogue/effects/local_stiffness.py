"""A part that is softer or stiffer than in the model: a crack, a loose joint, another thickness."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.diagnosis.catalogue.effect import Builder, Effect, Parameter, Signature
from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.model.change import Change
from frf_ipz.diagnosis.model.matrix_sum import MatrixSum
from frf_ipz.diagnosis.model.motion import Motion
from frf_ipz.dofs import Dof
from frf_ipz.fe.changes import part_matrices

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.result import Estimate
    from frf_ipz.structure import Part

BOUNDS = 0.02, 20.0
START_VALUES = np.array([0.1, 0.25, 0.4, 0.55, 0.7, 0.8, 0.88, 0.94, 0.97, 1.03, 1.06, 1.12, 1.2, 1.35, 1.6, 2.2, 4.0])
LENGTHS = (1, 2, 4, 8, 16)  # of segments of elements that are searched; others are found from them
USUAL_LENGTH, WITHIN = 0.04, 2.0  # of the whole: a crack takes away stiffness over about three heights; to a factor
MIN_CHANGE = 0.03  # of stiffness: below, all changes are as likely
LONGEST = 4  # of the whole, as a divisor: longer segments are not local
KINDS = ("element", "spring", "group")


class LocalStiffness(Effect):
    """Segments of elements, springs or groups; masses stay."""

    name = "local_stiffness"

    def locations(self, context: ModelContext) -> Sequence[Location]:
        """Segments of some lengths; every spring; every group."""
        parts = [part for part in context.model.parts if part.kind in KINDS and _has_stiffness(part)]
        elements = [part for part in parts if part.kind == "element"]
        if not elements:
            names = [(part.kind == "spring", (part.name,)) for part in parts]
            return [Location(springs=name) if is_spring else Location(groups=name) for is_spring, name in names]
        return [
            _segment(first, first + length - 1)
            for length in LENGTHS
            if length <= max(len(elements) // LONGEST, 1)
            for first in range(1, len(elements) - length + 2, max(length // 4, 1))
        ]

    def parameters(self, context: ModelContext, location: Location) -> tuple[Parameter, ...]:
        """Real stiffness over the model's."""
        del location
        tolerance = context.options.stiffness_tolerance
        return (Parameter(name="stiffness_ratio", low=BOUNDS[0], high=BOUNDS[1], neutral=1.0, tolerance=tolerance),)

    def build(self, context: ModelContext, location: Location) -> Builder:
        """Scale the parts' share of the matrix."""
        _, stiffness = part_matrices(context.model, _kind(location), _names(location))
        return lambda values: Change(stiffness=MatrixSum(((values[0] - 1, stiffness),)))

    def start_values(self, context: ModelContext, location: Location) -> FloatArray:
        """Softer and stiffer, by little and by much."""
        del context, location
        return START_VALUES[:, None]

    def signature(self, context: ModelContext, location: Location) -> Signature | None:
        """Bend a segment with constant curvature, extend a spring; a group has no such single motion."""
        if location.groups:
            return None
        motion, stiffness = (_curvature if location.elements else _extension)(context, location)
        changes = (START_VALUES - 1) * stiffness
        shapes = np.repeat(changes[:, None] + 0j, len(context.contour), 1)
        return Signature(motion=motion, shapes=shapes, values=START_VALUES[:, None], amplitudes=np.ones(1))

    def neighbours(self, context: ModelContext, location: Location) -> Sequence[Location]:
        """Segments that begin or end an element earlier or later; all other springs or groups are searched anyway."""
        if not location.elements:
            return []
        first, last = location.elements
        total = sum(part.kind == "element" for part in context.model.parts)
        stride = max((last - first + 1) // 3, 2)
        moves = {(a, b) for step in (1, stride) for a in (-step, 0, step) for b in (-step, 0, step)} - {(0, 0)}
        candidates = [(first + a, last + b) for a, b in sorted(moves)]
        return [_segment(a, b) for a, b in candidates if 1 <= a <= b <= total and b - a < max(total // LONGEST, 1)]

    def log_prior(self, context: ModelContext, location: Location, values: FloatArray) -> float:
        """Expect some length, and the size of the change in flexibility to be known by its logarithm only.

        A short segment that changes much and a longer one that changes little look alike. Without this the short one
        is preferred, whose change has the larger uncertainty.
        """
        by_size = -float(np.log(max(abs(values[0] - 1), MIN_CHANGE)))
        if not location.elements:
            return by_size
        first, last = location.elements
        usual = max(USUAL_LENGTH * sum(part.kind == "element" for part in context.model.parts), 1.0)
        return by_size - 0.5 * float(np.log((last - first + 1) / usual) / np.log(WITHIN)) ** 2

    def statement(self, context: ModelContext, location: Location, values: Mapping[str, Estimate]) -> str:
        """Say which part, and by how much."""
        ratio = values["stiffness_ratio"]
        how = "stiffer" if ratio.value > 1 else "softer"
        return (
            f"{_name_part(context, location)} {ratio.in_words('%', 100 if ratio.value > 1 else -100, less=1)} {how} "
            "than in the model."
        )


def _has_stiffness(part: Part) -> bool:
    return bool(part.stiffness.size if isinstance(part.stiffness, np.ndarray) else part.stiffness.nnz)


def _segment(first: int, last: int) -> Location:
    return Location(elements=(first, last))


def _kind(location: Location) -> str:
    return next(kind for kind in KINDS if f"{kind}s" in location)


def _names(location: Location) -> list[str]:
    if not location.elements:
        return [*location.springs, *location.groups]
    first, last = location.elements
    return [str(number) for number in range(first, last + 1)]


def _name_part(context: ModelContext, location: Location) -> str:
    if not location.elements:
        return f"The {_kind(location)} '{_names(location)[0]}' is"
    first, last = location.elements
    ends = [float(context.positions[node][0]) for node in (first, last + 1)]
    what = f"Element {first} is" if first == last else f"The elements {first} to {last} are"
    return f"{what[:-3] if first == last else what[:-4]} (x = {ends[0]:.3f} to {ends[1]:.3f} m) {what.split()[-1]}"


def _curvature(context: ModelContext, location: Location) -> tuple[Motion, float]:
    """Rotation of a segment's right end against its left one, and the bending stiffness against that."""
    first, last = location.elements
    model = context.model
    rotations = tuple(model.full_index(Dof(node, "ry")) for node in (last + 1, first))
    parts = {part.name: part for part in model.parts if part.kind == "element"}
    flexibility = 0.0
    for name in _names(location):
        bent = np.array([0.0, -0.5, 0.0, 0.5])
        flexibility += 1 / float(bent @ parts[name].stiffness @ bent)
    return Motion(rows=rotations, weights=(1.0, -1.0)), 1 / flexibility


def _extension(context: ModelContext, location: Location) -> tuple[Motion, float]:
    part = context.spring_at(location)
    return context.extension(part), float(part.stiffness[1, 1])
