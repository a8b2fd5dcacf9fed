"""Writes ``test.toml``, ``model.toml`` and ``pipeline.toml`` into a folder of recordings."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from frf_ipz.errors import FileFormatError, InputError
from frf_ipz.input_files import read_text
from frf_ipz.output_files import write_text
from frf_ipz.pipeline.init.campaign_draft import draft_test
from frf_ipz.pipeline.init.folder_contents import look_into
from frf_ipz.pipeline.init.model_draft import draft_model
from frf_ipz.pipeline.init.pipeline_draft import draft_pipeline
from frf_ipz.pipeline.init.places import Places
from frf_ipz.toml_files import parse_toml

if TYPE_CHECKING:
    from frf_ipz.pipeline.init.folder_contents import FolderContents
    from frf_ipz.pipeline.init.model_files import FoundModel


@dataclass(frozen=True, slots=True, kw_only=True)
class StartingFiles:
    """What was written, and what to do next.

    Parameters
    ----------
    written : dict of Path to bool
        Each file, and whether it was written; what was there is left alone.
    taken_for : tuple of str
        What files besides recordings were taken for.
    next_step : str
        What to do now.
    """

    written: dict[Path, bool]
    taken_for: tuple[str, ...]
    next_step: str


def write_starting_files(folder: Path) -> StartingFiles:
    """Write starting files for a folder of measurements.

    Parameters
    ----------
    folder : Path
        Holds the recordings, in itself or in folders below it; the FE model's matrices too, where there are any.

    Returns
    -------
    StartingFiles
        What was written.

    Raises
    ------
    InputError
        If the folder holds no recordings and no FRFs, or the recordings' columns differ.
    """
    contents = look_into(folder)
    model, written = folder / "model.toml", {}
    test = draft_test(contents, Places())  # refused before anything is written
    written[model] = _write(model, draft_model(contents))
    places = Places.of_model(model)
    test = draft_test(contents, places) if places.free else test
    written[folder / "test.toml"] = _write(folder / "test.toml", test)
    pipeline = draft_pipeline(contents, has_model=_says_something(model))
    written[folder / "pipeline.toml"] = _write(folder / "pipeline.toml", pipeline)
    return StartingFiles(
        written=dict(sorted(written.items(), key=lambda item: item[0].name != "test.toml")),
        taken_for=tuple(_taken_for(contents)),
        next_step=f"next: look at the lines with CHECK at their end, then run 'frf-ipz check {folder}'",
    )


def _says_something(model: Path) -> bool:
    """Tell whether a model is more than a skeleton; what is damaged is something, and `check` says what."""
    try:
        return bool(parse_toml(read_text(model), model))
    except FileFormatError:
        return True


def _write(path: Path, text: str) -> bool:
    try:
        if path.exists() and path.stat().st_size:  # an empty one is what a full disk has left
            return False
        write_text(path, text)
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from None
    return True


def _taken_for(contents: FolderContents) -> list[str]:
    texts = [_of_model(contents)] if contents.model.matrices else []
    if contents.model.rows is not None:
        texts.append(f"{contents.name(contents.model.rows)}: rows of the matrices")
    if contents.model.nodes is not None:
        texts.append(f"{contents.name(contents.model.nodes)}: where the model's nodes are")
    for model in contents.models[1:]:
        if model.has_both:
            texts.append(f"{_matrices(contents, model)}: matrices of another FE model, which is left out")
    texts += [] if contents.modes is None else [f"{contents.name(contents.modes)}: modes without FRFs"]
    if contents.geometry is not None:
        texts.append(f"{contents.name(contents.geometry)}: where the nodes are, for drawings")
    texts += [f"{contents.name(path)}: FRFs kept aside, no recording" for path in contents.references]
    texts += [f"{contents.name(path)}: left out, {reason}" for path, reason in contents.unread.items()]
    return texts


def _of_model(contents: FolderContents) -> str:
    model = contents.model
    if model.is_complete:
        return f"{_matrices(contents, model)}: matrices of the FE model"
    missing = [what for what in ("mass", "stiffness") if what not in model.matrices]
    missing += [] if model.rows or model.names_rows else ["dofs.csv, which names the rows"]
    return f"{_matrices(contents, model)}: matrices of an FE model; it needs also: {', '.join(missing)}"


def _matrices(contents: FolderContents, model: FoundModel) -> str:
    return ", ".join(contents.name(path) for path in dict.fromkeys(model.matrices.values()))
