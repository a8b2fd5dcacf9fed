"""The set-up in words and as a drawing in characters, before anything is run."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from frf_ipz.ingest.recording_files import RecordingFiles
from frf_ipz.late_imports import import_late
from frf_ipz.pipeline.check.look import Look
from frf_ipz.pipeline.check.measurement import look_at_measurement, open_recordings
from frf_ipz.pipeline.check.model import look_at_model
from frf_ipz.pipeline.check.open_marks import look_for_marks
from frf_ipz.pipeline.check.sketch import draw
from frf_ipz.visible_text import counted, one_line

if TYPE_CHECKING:
    from collections.abc import Iterable

    from frf_ipz.dofs import AnyDof
    from frf_ipz.pipeline.check.comparison import compare_with_model
    from frf_ipz.pipeline.inputs import PipelineInputs
else:
    compare_with_model = import_late("frf_ipz.pipeline.check.comparison", "compare_with_model")

FITS = "Everything fits together. Nothing was run."
MARKS_ARE_OPEN = "Lines that 'init' had to guess; correct each, and take CHECK away where it is right:"


def describe_setup(inputs: PipelineInputs) -> str:
    """Look at what a pipeline would work on.

    Parameters
    ----------
    inputs : PipelineInputs
        The pipeline with its test and model.

    Returns
    -------
    str
        A drawing of the structure with sensors, inputs and points of interest; what was measured, beside the model;
        what should be looked at, or that everything fits together.

    Raises
    ------
    InputError
        If a recording or a file of FRFs cannot be read as the test says.
    """
    test = inputs.test
    lines = [inputs.name, ""]
    geometry = test.geometry if inputs.fe_model is None else inputs.fe_model.geometry
    if geometry is not None:
        lines += [*draw(geometry, test.output_dofs, test.input_dofs, inputs.points), ""]
    model = Look() if inputs.fe_model is None else look_at_model(inputs.fe_model)
    lines += model.lines
    lines.append(f"test        {test.name} ({test.kind}), {counted(len(test.files), 'file')}")
    files = RecordingFiles(test=test)
    read_lines, is_whole = open_recordings(files)
    measurement = comparison = Look()
    if is_whole:
        measurement, estimate = look_at_measurement(files, inputs.options)
        comparison = compare_with_model(inputs, estimate)
    lines += [
        *read_lines,
        *measurement.lines,
        *comparison.lines,
        f"sensors  S  {_names(test.output_dofs)}",
        f"inputs   F  {_names(test.input_dofs)}",
        f"points   *  {_names(inputs.points)}",
        "",
    ]
    open_points = [*model.open_points, *comparison.open_points, *measurement.open_points, *_measured_points(inputs)]
    marks = look_for_marks(_toml_files(inputs)).open_points
    lines += _conclusion(open_points, marks)
    return "\n".join(map(one_line, lines))


def _conclusion(open_points: list[str], marks: tuple[str, ...]) -> list[str]:
    if not open_points and not marks:
        return [FITS]
    lines = ["Look at:", *(f"  - {text}" for text in open_points)] if open_points else []
    lines += [MARKS_ARE_OPEN, *(f"  {text}" for text in marks)] if marks else []
    return [*lines, "Nothing was run."]


def _measured_points(inputs: PipelineInputs) -> list[str]:
    """Name the points of interest at which a sensor sits."""
    sensors = {dof.unsigned for dof in inputs.test.output_dofs}
    return [
        f"the point of interest {point} is measured: a prediction there says nothing new; leave it out of [predict] "
        "points, or keep its sensor aside with [ingest] hide"
        for point in inputs.points
        if point.unsigned in sensors
    ]


def _toml_files(inputs: PipelineInputs) -> list[Path]:
    """Give the files that ``frf-ipz init`` may have written."""
    names = [inputs.source, str(inputs.test.path), *inputs.model_names]
    return [Path(name) for name in dict.fromkeys(names) if name.endswith(".toml") and Path(name).is_file()]


def _names(dofs: Iterable[AnyDof]) -> str:
    return " ".join(str(dof) for dof in dofs) or "none"
