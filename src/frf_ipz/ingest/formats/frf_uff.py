"""FRFs as universal files (UFF): functions of type 4 in data sets 58, and coherences of type 6 beside them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.dofs import AnyDof, Dof
from frf_ipz.errors import FileFormatError, QuantityError
from frf_ipz.ingest.formats.frf_file import FrfContents, FrfSource, MeasuredFrf, note_at_rest
from frf_ipz.ingest.formats.universal_file import (
    COHERENCE,
    FRF,
    TIME_RESPONSE,
    describe_functions,
    find_dof,
    read_functions,
)
from frf_ipz.ingest.units import frequency_factor, frf_factor, is_stated, unit_ratio
from frf_ipz.input_files import read_bytes
from frf_ipz.quantities import FrfQuantity
from frf_ipz.universal_sets import is_universal

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.ingest.formats.universal_file import UniversalFunction

UNKNOWN = {0, 1}  # types of data: unknown, general
RESPONSES = {8: FrfQuantity.RECEPTANCE, 11: FrfQuantity.MOBILITY, 12: FrfQuantity.ACCELERANCE}
FORCES = {9, 13}  # reaction force, excitation force
SAME_UNITS = 1e-3  # relative: factors of data set 164 are often given with few digits


class _UniversalFile:
    rank = 0

    def holds(self, source: FrfSource, head: bytes) -> bool:
        return not source.columns and is_universal(head)

    def read(self, source: FrfSource) -> tuple[MeasuredFrf, ...]:
        functions = read_functions(source.path, read_bytes(source.path))
        if source.is_reciprocal:  # their axes and ends are those of the motion over the force, the other way round
            functions = tuple(map(_turned_round, functions))
        frfs, notes = _select(source, functions)
        coherences = {function.ends: function for function in functions if function.function_type == COHERENCE}
        measured = [_make_frf(source, function, coherences.get(function.ends)) for function in frfs]
        return (replace(measured[0], notes=(*measured[0].notes, *notes)), *measured[1:])

    def look(self, source: FrfSource) -> FrfContents:
        frfs, _ = _select(source, read_functions(source.path, read_bytes(source.path)))
        ends = [(find_dof(*frf.ends[:2]), find_dof(*frf.ends[2:])) for frf in frfs]
        known = tuple((output, input_) for output, input_ in ends if output is not None and input_ is not None)
        kinds = {RESPONSES.get(frf.ordinate.data_type) for frf in frfs}
        nodes = [node for frf in frfs for node in (frf.response_node, frf.reference_node)]
        return FrfContents(
            n_outputs=len(frfs),
            n_inputs=1,
            ends=known if len(known) == len(frfs) else (),
            quantity=kinds.pop() if len(kinds) == 1 else None,
            unit=frfs[0].ordinate.unit if is_stated(frfs[0].ordinate.unit) else "",
            lacks_directions=len(known) < len(frfs) and min(nodes) > 0,
        )


FORMAT = _UniversalFile()


def _turned_round(function: UniversalFunction) -> UniversalFunction:
    """Exchange numerator and denominator, but not the values, which are the reciprocals still."""
    return replace(
        function,
        ordinate=function.denominator,
        denominator=function.ordinate,
        response_node=function.reference_node,
        response_direction=function.reference_direction,
        reference_node=function.response_node,
        reference_direction=function.response_direction,
    )


def _select(source: FrfSource, functions: Sequence[UniversalFunction]) -> tuple[list[UniversalFunction], list[str]]:
    """Take the FRFs that are asked for; one that stands there twice is taken once."""
    frfs = [function for function in functions if function.function_type == FRF]
    if not frfs:
        recordings = any(function.function_type == TIME_RESPONSE for function in functions)
        way_out = (
            "time responses are recordings: name the file under [[hit]] or [[record]]"
            if recordings
            else "export the FRFs"
        )
        problem = (
            f"holds no data set 58 with a frequency response function (type 4), but {describe_functions(functions)}"
        )
        raise FileFormatError(source.path, f"{problem}; {way_out}")
    if source.sets:
        unknown = sorted(set(source.sets) - {function.number for function in frfs})
        if unknown:
            known = ", ".join(str(function.number) for function in frfs)
            raise FileFormatError(source.path, f"'sets' names {unknown[0]}, which is no FRF; FRFs are the sets {known}")
        frfs = [function for function in frfs if function.number in source.sets]
    for name, places in (("output_dof", slice(0, 2)), ("input_dof", slice(2, 4))):
        ends = {function.ends[places] for function in frfs}
        if getattr(source, name) is not None and len(ends) > 1:
            problem = f"holds {len(frfs)} FRFs of {len(ends)} such DOFs, so '{name}' cannot name one for all"
            raise FileFormatError(source.path, f"{problem}; where directions are missing give 'direction' instead")
    return _without_copies(source, frfs)


def _without_copies(source: FrfSource, frfs: Sequence[UniversalFunction]) -> tuple[list[UniversalFunction], list[str]]:
    first: dict[tuple[int, ...], UniversalFunction] = {}
    notes: list[str] = []
    for function in frfs:
        earlier = first.setdefault(function.ends, function)
        if earlier is function:
            continue
        numbers = f"data sets {earlier.number} and {function.number}"
        if not np.array_equal(earlier.x, function.x) or not np.array_equal(
            earlier.values, function.values, equal_nan=True
        ):
            problem = f"{numbers} are both the FRF {_describe_ends(function)}, with different values"
            raise FileFormatError(
                source.path, f"{problem}; take one out, or name those to read in its [[frf]], as in sets = [1, 2]"
            )
        notes.append(f"{source.path.name}: {numbers} are the same; it is used once")
    return list(first.values()), notes


def _describe_ends(function: UniversalFunction) -> str:
    node, direction, reference, reference_direction = function.ends
    return f"of node {node} (direction {direction}) over node {reference} (direction {reference_direction})"


def _make_frf(source: FrfSource, function: UniversalFunction, coherence: UniversalFunction | None) -> MeasuredFrf:
    node, direction, reference, reference_direction = function.ends
    output_dof = source.output_dof or _make_dof(source, function, node, direction, "response")
    input_dof = source.input_dof or _make_dof(source, function, reference, reference_direction, "reference")
    if source.force_dof is None:
        _check_quantity(source, function, f"{output_dof} / {input_dof}")
    unit, notes = _find_unit(source, function, output_dof, input_dof)
    unit = f"1/({unit})" if unit and source.is_reciprocal else unit
    order = np.argsort(function.x, kind="stable")
    frequency_hz = function.x[order] * _abscissa_factor(source, function)
    with np.errstate(invalid="ignore"):  # what is not finite is looked for below
        values = function.values[order] * _unit_of_ratio(source, function)
    is_finite = np.isfinite(values)
    left_out = ~is_finite & (frequency_hz == 0.0)
    if not (is_finite | left_out).all():
        place = int(np.argmin(is_finite | left_out))
        hertz, line = frequency_hz[place], function.point_lines[order[place]]
        problem = f"the FRF {output_dof} / {input_dof} is not finite at {hertz:g} Hz; correct the file"
        raise FileFormatError(source.path, problem, where=f"data set {function.number}, line {line}")
    notes = (*notes, *note_at_rest(source, output_dof, input_dof, left_out))
    known_coherence = None
    if coherence is not None and len(coherence.x) == len(function.x):
        known_coherence = coherence.values.real[order][is_finite]
    elif coherence is not None:
        notes = (*notes, f"{source.path.name}: the coherence of {output_dof} / {input_dof} has other lines: left out")
    return MeasuredFrf(
        source=source,
        output_dof=output_dof,
        input_dof=input_dof,
        frequency_hz=frequency_hz[is_finite],
        values=values[is_finite],
        unit=unit,
        coherence=known_coherence,
        notes=notes,
    )


def _make_dof(source: FrfSource, function: UniversalFunction, node: int, direction: int, end: str) -> Dof:
    key = "output_dof" if end == "response" else "input_dof"
    where = f"data set {function.number}, line {function.line}"
    if node <= 0:
        problem = f"the {end} is at node {node}, and node 0 is the ground"
        way_out = "name output_dof and input_dof in its [[frf]], or where it holds several FRFs, count nodes from 1"
        raise FileFormatError(source.path, f"{problem}; {way_out}", where=where)
    if direction == 0 and source.direction:
        sign = -1 if source.direction.startswith("-") else 1
        return Dof(node, source.direction.lstrip("+-"), sign)
    dof = find_dof(node, direction)
    if dof is None:
        problem = f"states no direction of the {end} (direction {direction} at node {node})"
        way_out = "give its [[frf]] a 'direction' for all FRFs that have none, as in direction = \"z\""
        raise FileFormatError(source.path, f"{problem}; {way_out}, or name {key}", where=where)
    return dof


def _check_quantity(source: FrfSource, function: UniversalFunction, name: str) -> None:
    kind, denominator = function.ordinate.data_type, function.denominator.data_type
    if kind not in UNKNOWN and kind not in RESPONSES:
        problem = f"the FRF {name} is that of no motion (type {kind}); needed are displacement, velocity, acceleration"
        raise FileFormatError(source.path, problem, where="ordinate data type")
    quantity = RESPONSES.get(kind, source.quantity)
    if quantity is not source.quantity:
        problem = f"the FRF {name} is stated to be {quantity.value}, but the test says {source.quantity.value}"
        raise FileFormatError(source.path, problem, where="ordinate data type")
    if denominator not in FORCES | UNKNOWN:
        raise FileFormatError(source.path, f"the FRF {name} is not a ratio to a force", where="denominator data type")


def _abscissa_factor(source: FrfSource, function: UniversalFunction) -> float:
    try:
        return frequency_factor(function.abscissa.unit)
    except QuantityError as error:
        raise FileFormatError(source.path, str(error), where=f"data set {function.number}, abscissa") from None


def _unit_of_ratio(source: FrfSource, function: UniversalFunction) -> float:
    """Give the factor that a transmissibility has where its two responses are in two units."""
    units = function.ordinate.unit, function.denominator.unit
    ratio = unit_ratio(*units) if source.force_dof is not None and all(map(is_stated, units)) else None
    if ratio is not None and np.isnan(ratio):
        problem = f"is a ratio of '{units[0]}' over '{units[1]}', which is no transmissibility"
        raise FileFormatError(source.path, problem, where=f"data set {function.number}")
    return ratio or 1.0


def _find_unit(
    source: FrfSource, function: UniversalFunction, output_dof: AnyDof, input_dof: AnyDof
) -> tuple[str, tuple[str, ...]]:
    """Return the unit that the file states: by its labels, else by its factors from SI; never SI against a label."""
    if source.unit or source.force_dof is not None:
        return "", ()
    numerator, denominator = function.ordinate.unit, function.denominator.unit
    directions = output_dof.direction, input_dof.direction
    by_factors = _unit_of_factors(source, function, output_dof, input_dof)
    labels = [numerator] if is_stated(numerator) else []
    if is_stated(denominator):
        labels.insert(0, f"({numerator if labels else '?'})/({denominator})")
    if not labels:
        taken = f"states no unit of {output_dof} / {input_dof}: taken as {source.quantity.unit(*directions)}"
        return by_factors, () if by_factors else (f"{source.path.name}: {taken}",)
    for label in labels:
        try:
            factor = frf_factor(label, source.quantity, *directions)
        except QuantityError:
            continue
        if by_factors and abs(frf_factor(by_factors, source.quantity, *directions) / factor - 1.0) > SAME_UNITS:
            problem = f"the label says '{label}' and data set 164 another unit; say which by 'unit' in its [[frf]]"
            raise QuantityError(f"{source.path}, data set {function.number}: {problem}")
        return label, ()
    stated = " over ".join(f"'{label}'" for label in (numerator, denominator) if is_stated(label))
    expected = (
        f"{source.quantity.value} of {output_dof} / {input_dof} has a unit like {source.quantity.unit(*directions)}"
    )
    where = f"{source.path}, data set {function.number}"
    way_out = "give the 'unit' in its [[frf]], or correct the direction"
    raise QuantityError(f"{where}: the unit {stated} cannot be used: the {expected}; {way_out}")


def _unit_of_factors(source: FrfSource, function: UniversalFunction, output_dof: AnyDof, input_dof: AnyDof) -> str:
    if function.units is None:
        return ""
    length, force = function.units
    lengths = 0 if output_dof.direction.startswith("r") else 1
    lengths -= 1 if input_dof.direction.startswith("r") else 0
    unit = source.quantity.unit(output_dof.direction, input_dof.direction)
    return f"{force / length**lengths!r} {unit}"
