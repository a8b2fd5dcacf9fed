"""FRFs as universal files (UFF), data sets 58 by pyuff: functions of type 4, and coherences of type 6 beside them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyuff

from frf_ipz.arrays import FloatArray
from frf_ipz.dofs import DIRECTIONS, Dof
from frf_ipz.errors import FileFormatError, QuantityError
from frf_ipz.ingest.formats.frf_file import FrfSource, MeasuredFrf
from frf_ipz.ingest.units import frf_factor
from frf_ipz.quantities import FrfQuantity

START = b"    -1"
FRF, COHERENCE = 4, 6  # types of functions
RESPONSES = {8: FrfQuantity.RECEPTANCE, 11: FrfQuantity.MOBILITY, 12: FrfQuantity.ACCELERANCE}
FORCES = {0, 9, 13}  # unknown, reaction force, excitation force
GRAVITY = {"g": "g_0", "G": "g_0", "gn": "g_0"}


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
        coherences = {_ends(item): item for item in functions if int(item["func_type"]) == COHERENCE}
        return tuple(_frf(source, item, coherences.get(_ends(item)), units) for item in frfs)


FORMAT = _UniversalFile()


def _read_sets(source: FrfSource) -> list[dict[str, Any]]:
    try:
        sets = pyuff.UFF(str(source.path)).read_sets()
    except Exception as error:  # pyuff raises bare Exception for whatever is wrong with a file
        raise FileFormatError(source.path, f"is no universal file that pyuff can read: {error}") from None
    return sets if isinstance(sets, list) else [sets]


def _ends(item: dict[str, Any]) -> tuple[int, int, int, int]:
    node, direction, reference, reference_direction = (
        int(item[key]) for key in ("rsp_node", "rsp_dir", "ref_node", "ref_dir")
    )
    return node, direction, reference, reference_direction


def _frf(
    source: FrfSource, item: dict[str, Any], coherence: dict[str, Any] | None, units: dict[str, Any] | None
) -> MeasuredFrf:
    node, direction, reference, reference_direction = _ends(item)
    output_dof = source.output_dof or _dof(source, node, direction, "rsp_dir")
    input_dof = source.input_dof or _dof(source, reference, reference_direction, "ref_dir")
    _check_quantity(source, item, f"{output_dof} / {input_dof}")
    return MeasuredFrf(
        source=source,
        output_dof=output_dof,
        input_dof=input_dof,
        frequency_hz=np.asarray(item["x"], float),
        values=np.asarray(item["data"], complex),
        unit=_unit(source, item, units, output_dof, input_dof),
        coherence=_same_lines(coherence, len(item["x"])),
    )


def _same_lines(coherence: dict[str, Any] | None, n_lines: int) -> FloatArray | None:
    if coherence is None or len(coherence["data"]) != n_lines:
        return None
    return np.asarray(np.real(coherence["data"]), float)


def _dof(source: FrfSource, node: int, direction: int, key: str) -> Dof:
    if not 1 <= abs(direction) <= len(DIRECTIONS):
        raise FileFormatError(
            source.path,
            f"states no direction ({key} {direction} at node {node}); name output_dof and input_dof in its [[frf]]",
        )
    return Dof(node, DIRECTIONS[abs(direction) - 1], 1 if direction > 0 else -1)


def _check_quantity(source: FrfSource, item: dict[str, Any], name: str) -> None:
    stated = RESPONSES.get(int(item.get("ordinate_spec_data_type", 0)))
    if stated not in {None, source.quantity}:
        problem = f"the FRF {name} is stated to be {stated.value}, but the test says {source.quantity.value}"
        raise FileFormatError(source.path, problem, where="ordinate data type")
    if int(item.get("orddenom_spec_data_type", 0)) not in FORCES:
        raise FileFormatError(source.path, f"the FRF {name} is not a ratio to a force", where="denominator data type")


def _unit(
    source: FrfSource, item: dict[str, Any], units: dict[str, Any] | None, output_dof: Dof, input_dof: Dof
) -> str:
    """Return the unit that the file states: in its labels if they can be read, else by its factors from SI."""
    top, bottom = (str(item.get(f"{end}_axis_units_lab", "")).strip() for end in ("ordinate", "orddenom"))
    top = GRAVITY.get(top, top)
    label = f"({top}) / ({bottom})" if bottom.upper() not in {"", "NONE"} else top
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
