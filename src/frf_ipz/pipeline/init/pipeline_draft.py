"""``pipeline.toml`` to start from."""

from __future__ import annotations

from typing import TYPE_CHECKING

from frf_ipz.errors import FrfIpzError, problem_of
from frf_ipz.ingest.formats.frf_file import FrfSource
from frf_ipz.ingest.formats.registry import read_frf_file
from frf_ipz.pipeline.init.text import HEAD, guessed, quoted, with_comment
from frf_ipz.quantities import FrfQuantity

if TYPE_CHECKING:
    from pathlib import Path

    from frf_ipz.pipeline.init.folder_contents import FolderContents

REST = """
[fit]
# band_hz = [10.0, 700.0]       # the band that carries signal where it is left out
# exclude_hz = [[49.5, 50.5]]   # mains
# delay = true                  # channels may be late

# [diagnose]                    # say what the model left out
# apply = true                  # and let it flow on into updating and prediction
"""
EXPORT = """
# [export]
# ensemble = 50                 # members of the posterior, for robust design
"""


def draft_pipeline(contents: FolderContents, *, has_model: bool) -> str:
    """Write a pipeline for what a folder holds.

    Parameters
    ----------
    contents : FolderContents
        The folder.
    has_model : bool
        ``model.toml`` says more than comments.

    Returns
    -------
    str
        Text of ``pipeline.toml``.
    """
    model = 'model = "model.toml"'
    lines = [HEAD, "[pipeline]", f"name = {quoted(contents.folder.resolve().name)}", 'test = "test.toml"']
    lines.append(model if has_model else with_comment(f"# {model}", "the FE model, once it is filled in"))
    return "\n".join(lines) + "\n" + REST + "\n" + "\n".join(_prediction(contents, has_model=has_model)) + "\n" + EXPORT


def _prediction(contents: FolderContents, *, has_model: bool) -> list[str]:
    """Take FRFs that were kept aside as the reference, and their sensors as points of interest."""
    lines = ["[predict]"]
    if not contents.references:
        return [*lines, with_comment("points = []", 'points of interest, never measured, e.g. ["49:+z"]')]
    reference = contents.references[0]
    dofs, problem = _output_dofs(reference)
    points = f"points = [{', '.join(quoted(dof) for dof in dofs)}]"
    key, what = f"reference = {quoted(contents.name(reference))}", "FRFs kept aside, to judge by"
    if problem:
        key, what = f"# {key}", f"no reference as it is: {problem}"
    if not has_model:
        points, key = f"# {points}", f"# {key.removeprefix('# ')}"
    lines += [guessed(points, "points of interest, never measured"), guessed(key, what)]
    return [*lines, *(f"# {quoted(contents.name(path))} holds FRFs too" for path in contents.references[1:])]


def _output_dofs(reference: Path) -> tuple[list[str], str]:
    """Give the sensors of a reference, or why it cannot be one: no ``[[frf]]`` says what its file does not."""
    problem = ""
    for quantity in FrfQuantity:  # that of the test is not known yet
        try:
            frfs = read_frf_file(FrfSource(path=reference, quantity=quantity))
        except FrfIpzError as error:
            problem = problem or problem_of(error)
        else:
            return list(dict.fromkeys(str(frf.label.output_dof) for frf in frfs)), ""
    return [], problem
