"""FRFs as universal files (UFF), data sets 58 by pyuff: functions of type 4, and coherences of type 6 beside them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyuff

from frf_ipz.arrays import FloatArray
from frf_ipz.dofs import DIRECTIONS, Dof
from frf_ipz.errors import FileFormatError, QuantityError
from frf_ipz.ingest.formats.frf_file import FrfSource, MeasuredFrf
from frf_ipz.ingest.units import GRAVITY_SYMBOLS, frf_factor
from frf_ipz.quantities import FrfQuantity

START = b"    -1"
FRF, COHERENCE = 4, 6  # types of functions
RESPONSES = {8: FrfQuantity.RECEPTANCE, 11: FrfQuantity.MOBILITY, 12: FrfQuantity.ACCELERANCE}
FORCES = {0, 9, 13}  # unknown, reaction force, excitation force


class _UniversalFile:
    rank = 0

    def holds(self, source: FrfSource, head: bytes) -> bool:
        return not source.columns and head.lstrip(b"\r\n").startswith(START)

    def read(self, source: FrfSource) -> tuple[MeasuredFrf, ...]:
        sets = _read_sets(source)
        units = next((item for item in sets if item["type"] == 164), None)
        functions = [item for item in sets if item["type"] == 58]
        frfs = [item for item in functions if int(item["func_type"]) == FRF]
        if not frfs:
            raise FileFormatError(source.path, "holds no data set 58 with a frequency response function (type 4)")
        if len(frfs) > 1 and (source.output_dof or source.input_dof):
            raise FileFormatError(source.path, f"holds {len(frfs)} FRFs, so their [[frf]] cannot name one DOF for all")
        coherences = {_nodes_and_directions(item): item for item in functions if int(item["func_type"]) == COHERENCE}
        return tuple(_make_frf(source, item, coherences.get(_nodes_and_directions(item)), units) for item in frfs)


FORMAT = _UniversalFile()


def _read_sets(source: FrfSource) -> list[dict[str, Any]]:
    try:
        sets = pyuff.UFF(str(source.path)).read_sets()
    except Exception as error:  # pyuff raises bare Exception for whatever is wrong with a file
        raise FileFormatError(source.path, f"is no universal file that pyuff can read: {error}") from None
    return sets if isinstance(sets, list) else [sets]


def _nodes_and_directions(item: dict[str, Any]) -> tuple[int, int, int, int]:
    node, direction, reference, reference_direction = (
        int(item[key]) for key in ("rsp_node", "rsp_dir", "ref_node", "ref_dir")
    )
    return node, direction, reference, reference_direction


def _make_frf(
    source: FrfSource, item: dict[str, Any], coherence: dict[str, Any] | None, units: dict[str, Any] | None
) -> MeasuredFrf:
    node, direction, reference, reference_direction = _nodes_and_directions(item)
    output_dof = source.output_dof or _make_dof(source, node, direction, "rsp_dir")
    input_dof = source.input_dof or _make_dof(source, reference, reference_direction, "ref_dir")
    _check_quantity(source, item, f"{output_dof} / {input_dof}")
    n_lines, n_values = len(item["x"]), len(item["data"])
    if n_lines != n_values:
        raise FileFormatError(
            source.path,
            f"announces {n_lines} lines for the FRF {output_dof} / {input_dof}, but holds {n_values}; is it cut off?",
        )
    return MeasuredFrf(
        source=source,
        output_dof=output_dof,
        input_dof=input_dof,
        frequency_hz=np.asarray(item["x"], float),
        values=np.asarray(item["data"], complex),
        unit=_find_unit(source, item, units, output_dof, input_dof),
        coherence=_matching_coherence(coherence, len(item["x"])),
    )


def _matching_coherence(coherence: dict[str, Any] | None, n_lines: int) -> FloatArray | None:
    if coherence is None or len(coherence["data"]) != n_lines:
        return None
    return np.asarray(np.real(coherence["data"]), float)


def _make_dof(source: FrfSource, node: int, direction: int, key: str) -> Dof:
    if not 1 <= abs(direction) <= len(DIRECTIONS):
        raise FileFormatError(
            source.path,
            f"states no direction ({key} {direction} at node {node}); name output_dof and input_dof in its [[frf]]",
        )
    return Dof(node, DIRECTIONS[abs(direction) - 1], 1 if direction > 0 else -1)


def _check_quantity(source: FrfSource, item: dict[str, Any], name: str) -> None:
    quantity = RESPONSES.get(int(item.get("ordinate_spec_data_type", 0)))
    if quantity not in {None, source.quantity}:
        problem = f"the FRF {name} is stated to be {quantity.value}, but the test says {source.quantity.value}"
        raise FileFormatError(source.path, problem, where="ordinate data type")
    if int(item.get("orddenom_spec_data_type", 0)) not in FORCES:
        raise FileFormatError(source.path, f"the FRF {name} is not a ratio to a force", where="denominator data type")


def _find_unit(
    source: FrfSource, item: dict[str, Any], units: dict[str, Any] | None, output_dof: Dof, input_dof: Dof
) -> str:
    """Return the unit that the file states: in its labels if they can be read, else by its factors from SI."""
    numerator, denominator = (str(item.get(f"{end}_axis_units_lab", "")).strip() for end in ("ordinate", "orddenom"))
    numerator = GRAVITY_SYMBOLS.get(numerator, numerator)
    label = f"({numerator}) / ({denominator})" if denominator.upper() not in {"", "NONE"} else numerator
    try:
        frf_factor(label, source.quantity, output_dof.direction, input_dof.direction)
    except QuantityError:
        if units is None:
            return ""
        lengths = 0 if output_dof.direction.startswith("r") else 1
        lengths -= 1 if input_dof.direction.startswith("r") else 0
        factor = float(units["force"]) / float(units["length"]) ** lengths
        return f"{factor!r} {source.quantity.unit(output_dof.direction, input_dof.direction)}"
    return label
