"""Modes as universal files (UFF): normal modes (analysis type 2) and complex modes (3 and 7), in text.

Data sets 55 (data at nodes), and 2414 (analysis data), which has replaced it. What the records hold: Universal File
Datasets Summary, Structural Dynamics Research Laboratory, University of Cincinnati. DOFs that are 0 in every mode were
not measured: nodes without a sensor in a direction hold a 0 there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import complex_array
from frf_ipz.dofs import DIRECTIONS, Dof
from frf_ipz.errors import FileFormatError
from frf_ipz.ingest.formats.modes_file import ModesSource, make_modes
from frf_ipz.input_files import open_input
from frf_ipz.rational import damping_ratio, natural_frequency_hz
from frf_ipz.universal_sets import DataSet, is_universal, read_data_sets
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from pathlib import Path

    from frf_ipz.arrays import ComplexArray, FloatArray
    from frf_ipz.modes import ModalParameters

NORMAL_MODE, COMPLEX_MODES = 2, (3, 7)  # the latter of displacements, or of velocities
REAL, COMPLEX = (2, 4), (5, 6)  # types of data, of single and of double precision
PER_LINE = 6  # numbers
HEAD_BYTES = 4096
NAMES, RESULTS = "55", "2414"  # kinds of data sets
N_LINES = {NAMES: 5, RESULTS: 8}  # before the types: texts; of results also a label, and where the data are
AT_NODES = 1  # such data
MOTIONS = {8, 11, 12}  # results that are displacements, velocities, accelerations
ADVICE = "export the modes again, as data sets 55 or 2414 with normal or complex modes"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Shape:
    """One mode."""

    frequency_hz: float
    ratio: float
    values: dict[int, ComplexArray]  # by node


class _ModesUff:
    rank = 0

    def holds_modes(self, path: Path, head: bytes) -> bool:
        del path
        return is_universal(head)

    def read_modes(self, source: ModesSource) -> ModalParameters:
        shapes = [_read_shape(data) for data in _modes_of(source.path)]
        if not shapes:
            raise FileFormatError(source.path, f"holds no mode shape (data set 55 or 2414); {ADVICE}")
        nodes = list(dict.fromkeys(node for shape in shapes for node in shape.values))
        width = max(len(value) for shape in shapes for value in shape.values.values())
        table = np.zeros((len(nodes), width, len(shapes)), complex)
        for place, shape in enumerate(shapes):
            for node, values in shape.values.items():  # a node that a mode leaves out is 0 in it
                table[nodes.index(node), : len(values), place] = values
        measured = np.argwhere(table.any(axis=2))
        return make_modes(
            source,
            natural_frequency_hz=np.array([shape.frequency_hz for shape in shapes]),
            damping_ratio=np.array([shape.ratio for shape in shapes]),
            shapes=table[measured[:, 0], measured[:, 1]],
            dofs=tuple(Dof(nodes[row], DIRECTIONS[column]) for row, column in measured.tolist()),
        )


FORMAT = _ModesUff()


def holds_shapes(path: Path) -> bool:
    """Tell whether a file is a universal file with mode shapes and without functions.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    bool
        True where it is.
    """
    with open_input(path) as stream:
        head = stream.read(HEAD_BYTES)
    try:
        return is_universal(head) and bool(_modes_of(path))
    except FileFormatError:  # said where the modes are read
        return True


def _modes_of(path: Path) -> list[DataSet]:
    """Find the data sets 55, and those 2414 that are modes: other results of a computation stand beside them."""
    return [data for data in read_data_sets(path, set(N_LINES), advice=ADVICE) if data.kind == NAMES or _is_mode(data)]


def _is_mode(data: DataSet) -> bool:
    """Tell whether results are motions of nodes in a mode."""
    location = data.integers(data.first + 2, 10, 1, "where data are")[0]
    _, analysis, _, result, *_ = data.integers(_types(data), 10, 6, "the types of a data set 2414")
    return location == AT_NODES and analysis in {NORMAL_MODE, *COMPLEX_MODES} and result in MOTIONS


def _types(data: DataSet) -> int:
    """Line of the types."""
    return data.first + N_LINES[data.kind]


def _read_shape(data: DataSet) -> _Shape:
    at = _types(data)
    _, analysis, _, _, data_type, n_values = data.integers(at, 10, 6, f"the types of a data set {data.kind}")
    is_complex = data_type in COMPLEX
    if analysis not in (NORMAL_MODE, *COMPLEX_MODES) or not (is_complex or data_type in REAL):
        raise data.fault(f"the analysis of type {analysis} with data of type {data_type} is no mode that is read", at)
    if not 1 <= n_values <= len(DIRECTIONS):
        raise data.fault(f"{counted(n_values, 'value')} a node; a node has 1 to 6", at)
    n_numbers = n_values * (2 if is_complex else 1)
    if data.kind == RESULTS:
        frequency_hz, ratio = _read_result_pole(data, at + 3, analysis)
        motions = _read_motions(data, at + 5, n_numbers)
    else:
        n_real = data.integers(at + 1, 10, 2, "the counts of a data set 55")[1]
        frequency_hz, ratio = _read_pole(data, at + 2, analysis, n_real)
        motions = _read_motions(data, at + 3 + max(0, -(-n_real // PER_LINE) - 1), n_numbers)
    values = {
        node: complex_array(row[::2], row[1::2]) if is_complex else row.astype(complex) for node, row in motions.items()
    }
    return _Shape(frequency_hz=frequency_hz, ratio=ratio, values=values)


def _read_pole(data: DataSet, line: int, analysis: int, n_real: int) -> tuple[float, float]:
    """Read frequency and damping ratio of a data set 55."""
    values = data.numbers(line, 13, min(max(n_real, 2), 4), "the frequency of a mode")
    if analysis in COMPLEX_MODES:
        return _of_pole(data, line, complex(values[0], values[1]))
    viscous, hysteretic = (*values[2:4], 0.0, 0.0)[:2]
    return _checked(data, line, values[0], viscous, hysteretic)


def _read_result_pole(data: DataSet, line: int, analysis: int) -> tuple[float, float]:
    """Read frequency and damping ratio of a data set 2414, whose eigenvalue programs may leave out."""
    _, frequency_hz, _, _, viscous, hysteretic = data.numbers(line, 13, 6, "the frequency of a mode")[:6]
    eigenvalue = complex(*data.numbers(line + 1, 13, 2, "the eigenvalue of a mode")[:2])
    if analysis in COMPLEX_MODES and eigenvalue:
        return _of_pole(data, line + 1, eigenvalue)
    return _checked(data, line, frequency_hz, viscous, hysteretic)


def _of_pole(data: DataSet, line: int, value: complex) -> tuple[float, float]:
    pole = np.array(complex(value.real, abs(value.imag)))
    return _checked(data, line, float(natural_frequency_hz(pole)), float(damping_ratio(pole)), 0.0)


def _checked(data: DataSet, line: int, frequency_hz: float, viscous: float, hysteretic: float) -> tuple[float, float]:
    """Give frequency and damping ratio; a loss factor is twice the viscous ratio that dissipates as much."""
    ratio = viscous or hysteretic / 2
    if not ratio > 0:
        problem = f"the mode at {frequency_hz:g} Hz has no damping; a test needs it: state the modes in a CSV"
        raise FileFormatError(data.path, problem, where=f"line {line + 1}")
    return frequency_hz, ratio


def _read_motions(data: DataSet, line: int, n_numbers: int) -> dict[int, FloatArray]:
    """Read the numbers of each node, on as many lines as they take."""
    of_nodes: dict[int, FloatArray] = {}
    while line < data.end:
        node = data.integers(line, 10, 1, "the number of a node")[0]
        row: list[float] = []
        while len(row) < n_numbers:
            line += 1
            row += data.numbers(line, 13, min(n_numbers - len(row), PER_LINE), f"the motion of node {node}")
        of_nodes[node] = np.array(row[:n_numbers])
        line += 1
    if not of_nodes:
        raise data.fault("the motion of at least one node should stand there", line)
    return of_nodes
