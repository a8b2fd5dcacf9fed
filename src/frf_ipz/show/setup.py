"""What is seen of a pipeline before its first run: the structure with sensors, inputs and points, and what was read."""

from __future__ import annotations

from typing import TYPE_CHECKING

from frf_ipz.errors import InputError
from frf_ipz.plotting.structure import StructureMarks, describe_structure
from frf_ipz.plotting.wording import listed
from frf_ipz.report.section import Block, Figure, Section, Table
from frf_ipz.runs.memory import RunMemory
from frf_ipz.runs.results import Results
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from frf_ipz.dofs import AnyDof
    from frf_ipz.pipeline.inputs import PipelineInputs
    from frf_ipz.structure import Geometry


def read_setup(pipeline: Path, read: Callable[[Path], PipelineInputs]) -> tuple[Results, Section]:
    """Read a pipeline that has not been run yet.

    Parameters
    ----------
    pipeline : Path
        The pipeline file.
    read : callable
        Reads it and all that it names, as `pipeline.inputs.read_inputs` does.

    Returns
    -------
    run : Results
        The name, and the geometry where the model or the test has one.
    section : Section
        What was read; or what is wrong with it.
    """
    title, anchor = "Set-up", "overview"
    try:
        inputs = read(pipeline)
    except InputError as error:
        notes = (str(error), "Correct the file, then load this page again.")
        lead = "This pipeline cannot be run as it stands."
        return _results_of(pipeline.stem), Section(anchor=anchor, title=title, lead=lead, blocks=(), notes=notes)
    run = _results_of(inputs.name, inputs.test.geometry if inputs.fe_model is None else inputs.fe_model.geometry)
    marks = StructureMarks(sensors=inputs.test.output_dofs, inputs=inputs.test.input_dofs, points=inputs.points)
    drawing = describe_structure(run.geometry, marks)
    lead = "Nothing has been run yet. This is what the files say; 'Run' above starts the computation."
    blocks: list[Block] = (
        [_what_was_read(inputs)] if drawing is None else [Figure(picture=drawing), _what_was_read(inputs)]
    )
    return run, Section(anchor=anchor, title=title, lead=lead, blocks=tuple(blocks))


def _results_of(name: str, geometry: Geometry | None = None) -> Results:
    results = {} if geometry is None else {"model": geometry}
    return Results(RunMemory(manifest={"name": name, "stages": {stage: {} for stage in results}}, results=results))


def _what_was_read(inputs: PipelineInputs) -> Table:
    test, model = inputs.test, inputs.fe_model
    model_text = "none: the run ends with the fit"
    if model is not None:
        model_text = f"{model.name} ({model.kind}), {counted(len(model.dofs), 'free DOF')}"
    rows = [
        ["test", f"{test.name} ({test.kind}), {counted(len(test.files), 'file')}"],
        ["model", model_text],
        ["sensors", _names(test.output_dofs)],
        ["inputs", _names(test.input_dofs)],
        ["points of interest", _names(inputs.points)],
    ]
    return Table(caption="What was read", columns=("", "in the files"), rows=rows)


def _names(dofs: tuple[AnyDof, ...]) -> str:
    return listed([str(dof) for dof in dofs], 24) if dofs else "none"
