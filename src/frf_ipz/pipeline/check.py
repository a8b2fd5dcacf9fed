"""The set-up in words and as a drawing in characters, before anything is run."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.errors import InputError
from frf_ipz.ingest.formats.frf_conventions import read_frf_source
from frf_ipz.ingest.recording_files import RecordingFiles
from frf_ipz.visible_text import one_line

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from frf_ipz.arrays import FloatArray
    from frf_ipz.dofs import Dof
    from frf_ipz.ingest.campaign import VibrationTest
    from frf_ipz.pipeline.inputs import PipelineInputs
    from frf_ipz.structure import Geometry

WIDTH = 72
HEIGHT = 18
MARKS = {"node": "-", "support": "#", "sensor": "S", "input": "F", "both": "X", "point": "*"}
WHOLE_BYTES = 1 << 28  # of recordings, read within seconds; of more only the first block of each
FLAT = 1e-6  # of the largest extent: a structure thinner than this is a line


def describe_setup(inputs: PipelineInputs) -> str:
    """Describe what a pipeline would work on.

    Parameters
    ----------
    inputs : PipelineInputs
        The pipeline with its test and model.

    Returns
    -------
    str
        A drawing of the structure with sensors, inputs and points of interest, and what was read.

    Raises
    ------
    InputError
        If a recording or a file of FRFs cannot be read as the test says.
    """
    test = inputs.test
    lines = [inputs.name, ""]
    if inputs.fe_model is not None:
        lines += [*draw(inputs.fe_model.geometry, test.output_dofs, test.input_dofs, inputs.points), ""]
        lines.append(
            f"model       {inputs.fe_model.name} ({inputs.fe_model.kind}), {len(inputs.fe_model.dofs)} free DOFs"
        )
        lines += [f"  note      {note}" for note in inputs.fe_model.notes]
    lines += [
        f"test        {test.name} ({test.kind}), {len(test.files)} files",
        *_describe_files(test),
        f"sensors  S  {_names(test.output_dofs)}",
        f"inputs   F  {_names(test.input_dofs)}",
        f"points   *  {_names(inputs.points)}",
        "",
        "Everything fits together. Nothing was run.",
    ]
    return "\n".join(map(one_line, lines))


def _describe_files(test: VibrationTest) -> list[str]:
    """Read what the run would read; large recordings to the first block."""
    for source in test.frf_sources:
        read_frf_source(source)
    recordings = [(setup, path) for setup in test.setups for path in setup.files if path not in test.signals]
    is_large = sum(path.stat().st_size for _, path in recordings) > WHOLE_BYTES
    files = RecordingFiles(test=test)
    lengths: Counter[str] = Counter()
    faults = []
    for setup, path in recordings:
        try:
            lengths[_describe_recording(files.blocks(setup, path), is_large=is_large)] += 1
        except InputError as error:
            faults.append(error)
    if len(faults) > 1:
        raise InputError(f"{faults[0]} (so or otherwise, {len(faults)} of {len(recordings)} recordings cannot be read)")
    if faults:
        raise faults[0]
    return [f"  read      {count} x {what}" for what, count in lengths.items()]


def _describe_recording(blocks: Iterator[FloatArray], *, is_large: bool) -> str:
    first = next(blocks)
    last, n_rows = first, len(first)
    for block in () if is_large else blocks:
        last, n_rows = block, n_rows + len(block)
    rate_hz = (n_rows - 1) / (last[-1, 0] - first[0, 0])
    return f"{'more than ' if is_large else ''}{n_rows} samples at {rate_hz:.6g} Hz"


def draw(geometry: Geometry, sensors: Iterable[Dof], inputs: Iterable[Dof], points: Iterable[Dof]) -> list[str]:
    """Draw a structure in characters.

    Parameters
    ----------
    geometry : Geometry
        Where the nodes are.
    sensors, inputs, points : iterable of Dof
        What to mark.

    Returns
    -------
    list of str
        Lines of text.
    """
    columns, rows = _places(geometry.coordinates_m)
    canvas = [[" "] * WIDTH for _ in range(int(rows.max()) + 1)]
    place = {int(node): index for index, node in enumerate(geometry.nodes)}
    excited, sensed = {dof.node for dof in inputs}, {dof.node for dof in sensors}
    marks = dict.fromkeys(place, MARKS["node"]) | {
        node: MARKS["support"] for node in geometry.supports if node in place
    }
    marks |= {dof.node: MARKS["point"] for dof in points}
    marks |= {node: MARKS["both" if node in sensed else "input"] for node in excited}
    marks |= dict.fromkeys(sensed - excited, MARKS["sensor"])
    for node in sorted(marks, key=lambda node: marks[node] != MARKS["node"]):
        if node in place:
            canvas[rows[place[node]]][columns[place[node]]] = marks[node]
    return ["".join(row).rstrip() for row in canvas]


def _places(coordinates: FloatArray) -> tuple[np.ndarray, np.ndarray]:
    """Columns and rows of the nodes, looking along the direction in which the structure is thinnest."""
    extent = np.ptp(coordinates, axis=0)
    across, up = np.argsort(-extent, kind="stable")[:2]
    largest = max(float(extent[across]), np.finfo(float).tiny)
    columns = (coordinates[:, across] - coordinates[:, across].min()) / largest * (WIDTH - 1)
    height = extent[up] / largest
    rows = np.zeros(len(coordinates))
    if height > FLAT:
        rows = (coordinates[:, up].max() - coordinates[:, up]) / extent[up] * min(HEIGHT, max(2, height * WIDTH / 2))
    return np.rint(columns).astype(int), np.rint(rows).astype(int)


def _names(dofs: Iterable[Dof]) -> str:
    return " ".join(str(dof) for dof in dofs) or "none"
